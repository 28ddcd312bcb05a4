/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * The most common network as one function: one input, layers of 16 neurons with ReLU, one output (1-16-16-16-1, say).
 *
 * The same bits as layer by layer with penode/pen_net.h, and the same storage: a stream of biases and columns for each
 * layer. All rows of a layer are accumulated side by side, so that each weight is read once and in order.
 *
 * Cost on a Cortex-M4F for 1-16-16-16-1: 1336 instructions, with its slope 3474; optimised for size 934 and 2768.
 * That is with port/gnu, which has it in assembler there; the C below takes 1941 and 1043.
 */
#ifndef PEN_NET16_H
#define PEN_NET16_H

#include <stddef.h>

#include "penode/pen_port.h"
#include "penode/pen_real.h"

#ifdef __cplusplus
extern "C" {
#endif

/** max(0, x). Two instructions cheaper than a comparison, and -Inf + Inf is NaN: an overflow cannot hide behind the kink. */
PEN_PORT_INLINE pen_real_t pen_rectified(pen_real_t x)
{
    return (pen_real_t)0.5F * (x + pen_port_abs(x));
}

/* ---- sixteen rows at work: named, because only so they stay in registers at every optimisation level ---- */

typedef struct {
    pen_real_t r0;
    pen_real_t r1;
    pen_real_t r2;
    pen_real_t r3;
    pen_real_t r4;
    pen_real_t r5;
    pen_real_t r6;
    pen_real_t r7;
    pen_real_t r8;
    pen_real_t r9;
    pen_real_t r10;
    pen_real_t r11;
    pen_real_t r12;
    pen_real_t r13;
    pen_real_t r14;
    pen_real_t r15;
} pen_rows_t;

/** Rows at their biases. @param bias [16] */
PEN_PORT_INLINE void pen_rows_begin(pen_rows_t *a, const pen_real_t bias[])
{
    a->r0 = bias[0];
    a->r1 = bias[1];
    a->r2 = bias[2];
    a->r3 = bias[3];
    a->r4 = bias[4];
    a->r5 = bias[5];
    a->r6 = bias[6];
    a->r7 = bias[7];
    a->r8 = bias[8];
    a->r9 = bias[9];
    a->r10 = bias[10];
    a->r11 = bias[11];
    a->r12 = bias[12];
    a->r13 = bias[13];
    a->r14 = bias[14];
    a->r15 = bias[15];
}

/** Add a column of the weights times an input. @param column [16] */
PEN_PORT_INLINE void pen_rows_add(pen_rows_t *a, const pen_real_t column[], pen_real_t x)
{
    a->r0 += column[0] * x;
    a->r1 += column[1] * x;
    a->r2 += column[2] * x;
    a->r3 += column[3] * x;
    a->r4 += column[4] * x;
    a->r5 += column[5] * x;
    a->r6 += column[6] * x;
    a->r7 += column[7] * x;
    a->r8 += column[8] * x;
    a->r9 += column[9] * x;
    a->r10 += column[10] * x;
    a->r11 += column[11] * x;
    a->r12 += column[12] * x;
    a->r13 += column[13] * x;
    a->r14 += column[14] * x;
    a->r15 += column[15] * x;
}

/** The rows, before any activation. @param y [16] */
PEN_PORT_INLINE void pen_rows_end(const pen_rows_t *a, pen_real_t y[])
{
    y[0] = a->r0;
    y[1] = a->r1;
    y[2] = a->r2;
    y[3] = a->r3;
    y[4] = a->r4;
    y[5] = a->r5;
    y[6] = a->r6;
    y[7] = a->r7;
    y[8] = a->r8;
    y[9] = a->r9;
    y[10] = a->r10;
    y[11] = a->r11;
    y[12] = a->r12;
    y[13] = a->r13;
    y[14] = a->r14;
    y[15] = a->r15;
}

/** Sixteen rows of a layer: y = W max(0, x) + b. y may be x: nothing is written before all is read. */
PEN_PORT_INLINE void pen_rows_relu(size_t n_in, const pen_real_t w[], const pen_real_t x[], pen_real_t y[])
{
#ifdef PEN_PORT_ROWS
    pen_port_rows(n_in, w, x, y);
#else
    pen_rows_t a;

    pen_rows_begin(&a, w);
    for (size_t i = 0U; i < n_in; i++) {
        pen_rows_add(&a, &w[(16U * i) + 16U], pen_rectified(x[i]));
    }
    pen_rows_end(&a, y);
#endif
}

/**
 * The network's output at x.
 * @param hidden  layers 16 -> 16, at least 1
 * @param w       [32 + 272 * hidden + 17]
 */
#if defined(PEN_PORT_NET16)

PEN_PORT_INLINE pen_real_t pen_net16(size_t hidden, const pen_real_t w[], pen_real_t x)
{
    return pen_port_net16(hidden, w, x);
}

#elif defined(__OPTIMIZE_SIZE__)

/* The same with one loop for all layers: the smallest code. */
PEN_PORT_INLINE pen_real_t pen_net16(size_t hidden, const pen_real_t w[], pen_real_t x)
{
    const pen_real_t *p = &w[32];
    pen_real_t h[16];
    pen_real_t twice;

    for (size_t i = 0U; i < 16U; i++) {
        h[i] = w[i] + (w[i + 16U] * x);
    }
    for (size_t layer = 0U; layer < hidden; layer++) {
        pen_rows_relu(16U, p, h, h);
        p = &p[272];
    }
    twice = p[0] + p[0]; /* halved in the end: doubling is exact */
    for (size_t i = 0U; i < 16U; i++) {
        p = &p[1];
        twice += p[0] * (h[i] + pen_port_abs(h[i]));
    }
    return (pen_real_t)0.5F * twice;
}

#else

/* The last layer, one row, from the rows before it; halved in the end: doubling is exact. */
PEN_PORT_INLINE pen_real_t pen_rows_last(const pen_rows_t *a, const pen_real_t w[])
{
    pen_real_t twice = w[0] + w[0];

    twice += w[1] * (a->r0 + pen_port_abs(a->r0));
    twice += w[2] * (a->r1 + pen_port_abs(a->r1));
    twice += w[3] * (a->r2 + pen_port_abs(a->r2));
    twice += w[4] * (a->r3 + pen_port_abs(a->r3));
    twice += w[5] * (a->r4 + pen_port_abs(a->r4));
    twice += w[6] * (a->r5 + pen_port_abs(a->r5));
    twice += w[7] * (a->r6 + pen_port_abs(a->r6));
    twice += w[8] * (a->r7 + pen_port_abs(a->r7));
    twice += w[9] * (a->r8 + pen_port_abs(a->r8));
    twice += w[10] * (a->r9 + pen_port_abs(a->r9));
    twice += w[11] * (a->r10 + pen_port_abs(a->r10));
    twice += w[12] * (a->r11 + pen_port_abs(a->r11));
    twice += w[13] * (a->r12 + pen_port_abs(a->r12));
    twice += w[14] * (a->r13 + pen_port_abs(a->r13));
    twice += w[15] * (a->r14 + pen_port_abs(a->r14));
    twice += w[16] * (a->r15 + pen_port_abs(a->r15));
    return (pen_real_t)0.5F * twice;
}

/* The same with the rows in registers: the fastest code. */
PEN_PORT_INLINE pen_real_t pen_net16(size_t hidden, const pen_real_t w[], pen_real_t x)
{
    const pen_real_t *p = &w[32];
    pen_rows_t a;

    pen_rows_begin(&a, p);
    for (size_t i = 0U; i < 16U; i += 2U) { /* the first layer on the way: its neurons are the second one's columns */
        pen_rows_add(&a, &p[(16U * i) + 16U], pen_rectified(w[i] + (w[i + 16U] * x)));
        pen_rows_add(&a, &p[(16U * i) + 32U], pen_rectified(w[i + 1U] + (w[i + 17U] * x)));
    }
    for (size_t layer = 1U; layer < hidden; layer++) {
        pen_real_t h[16];
        pen_rows_end(&a, h);
        p = &p[272];
        pen_rows_begin(&a, p);
        for (size_t i = 0U; i < 16U; i++) {
            pen_rows_add(&a, &p[(16U * i) + 16U], pen_rectified(h[i]));
        }
    }
    return pen_rows_last(&a, &p[272]);
}

#endif

/* ---- eight rows and their derivatives along the input, which fill the registers as well ---- */

typedef struct {
    pen_real_t r0;
    pen_real_t r1;
    pen_real_t r2;
    pen_real_t r3;
    pen_real_t r4;
    pen_real_t r5;
    pen_real_t r6;
    pen_real_t r7;
    pen_real_t d0;
    pen_real_t d1;
    pen_real_t d2;
    pen_real_t d3;
    pen_real_t d4;
    pen_real_t d5;
    pen_real_t d6;
    pen_real_t d7;
} pen_duals_t;

/* Bias and first column. */
PEN_PORT_INLINE void pen_duals_begin(pen_duals_t *a, const pen_real_t bias[], const pen_real_t column[], pen_real_t x, pen_real_t t)
{
    a->r0 = bias[0] + (column[0] * x);
    a->d0 = column[0] * t;
    a->r1 = bias[1] + (column[1] * x);
    a->d1 = column[1] * t;
    a->r2 = bias[2] + (column[2] * x);
    a->d2 = column[2] * t;
    a->r3 = bias[3] + (column[3] * x);
    a->d3 = column[3] * t;
    a->r4 = bias[4] + (column[4] * x);
    a->d4 = column[4] * t;
    a->r5 = bias[5] + (column[5] * x);
    a->d5 = column[5] * t;
    a->r6 = bias[6] + (column[6] * x);
    a->d6 = column[6] * t;
    a->r7 = bias[7] + (column[7] * x);
    a->d7 = column[7] * t;
}

/* One more column: eight rows of values and of tangents. */
PEN_PORT_INLINE void pen_duals_add(pen_duals_t *a, const pen_real_t column[], pen_real_t x, pen_real_t t)
{
    a->r0 += column[0] * x;
    a->d0 += column[0] * t;
    a->r1 += column[1] * x;
    a->d1 += column[1] * t;
    a->r2 += column[2] * x;
    a->d2 += column[2] * t;
    a->r3 += column[3] * x;
    a->d3 += column[3] * t;
    a->r4 += column[4] * x;
    a->d4 += column[4] * t;
    a->r5 += column[5] * x;
    a->d5 += column[5] * t;
    a->r6 += column[6] * x;
    a->d6 += column[6] * t;
    a->r7 += column[7] * x;
    a->d7 += column[7] * t;
}

/* Eight of sixteen rows over sixteen columns. */
PEN_PORT_INLINE void pen_duals_fill(pen_duals_t *a, const pen_real_t w[], const pen_real_t x[], const pen_real_t t[])
{
    pen_duals_begin(a, w, &w[16], x[0], t[0]);
    for (size_t i = 1U; i < 16U; i += 5U) {
        const pen_real_t *const column = &w[(16U * i) + 16U];
        pen_duals_add(a, &column[0], x[i], t[i]);
        pen_duals_add(a, &column[16], x[i + 1U], t[i + 1U]);
        pen_duals_add(a, &column[32], x[i + 2U], t[i + 2U]);
        pen_duals_add(a, &column[48], x[i + 3U], t[i + 3U]);
        pen_duals_add(a, &column[64], x[i + 4U], t[i + 4U]);
    }
}

/* The derivative after a ReLU: 0 at the kink and below. */
PEN_PORT_INLINE pen_real_t pen_rectified_slope(pen_real_t r, pen_real_t d)
{
    return (r > (pen_real_t)0) ? d : (pen_real_t)0;
}

/* The rows after the ReLU, and their tangents. */
PEN_PORT_INLINE void pen_duals_end(const pen_duals_t *a, pen_real_t y[], pen_real_t s[])
{
    y[0] = pen_rectified(a->r0);
    s[0] = pen_rectified_slope(a->r0, a->d0);
    y[1] = pen_rectified(a->r1);
    s[1] = pen_rectified_slope(a->r1, a->d1);
    y[2] = pen_rectified(a->r2);
    s[2] = pen_rectified_slope(a->r2, a->d2);
    y[3] = pen_rectified(a->r3);
    s[3] = pen_rectified_slope(a->r3, a->d3);
    y[4] = pen_rectified(a->r4);
    s[4] = pen_rectified_slope(a->r4, a->d4);
    y[5] = pen_rectified(a->r5);
    s[5] = pen_rectified_slope(a->r5, a->d5);
    y[6] = pen_rectified(a->r6);
    s[6] = pen_rectified_slope(a->r6, a->d6);
    y[7] = pen_rectified(a->r7);
    s[7] = pen_rectified_slope(a->r7, a->d7);
}

/* The part of these rows in the last layer: twice the value, and the slope. */
PEN_PORT_INLINE void pen_duals_last(const pen_duals_t *a, const pen_real_t w[], pen_real_t *twice, pen_real_t *slope)
{
    *twice += w[0] * (a->r0 + pen_port_abs(a->r0));
    *slope += w[0] * pen_rectified_slope(a->r0, a->d0);
    *twice += w[1] * (a->r1 + pen_port_abs(a->r1));
    *slope += w[1] * pen_rectified_slope(a->r1, a->d1);
    *twice += w[2] * (a->r2 + pen_port_abs(a->r2));
    *slope += w[2] * pen_rectified_slope(a->r2, a->d2);
    *twice += w[3] * (a->r3 + pen_port_abs(a->r3));
    *slope += w[3] * pen_rectified_slope(a->r3, a->d3);
    *twice += w[4] * (a->r4 + pen_port_abs(a->r4));
    *slope += w[4] * pen_rectified_slope(a->r4, a->d4);
    *twice += w[5] * (a->r5 + pen_port_abs(a->r5));
    *slope += w[5] * pen_rectified_slope(a->r5, a->d5);
    *twice += w[6] * (a->r6 + pen_port_abs(a->r6));
    *slope += w[6] * pen_rectified_slope(a->r6, a->d6);
    *twice += w[7] * (a->r7 + pen_port_abs(a->r7));
    *slope += w[7] * pen_rectified_slope(a->r7, a->d7);
}

/** The network's output at x, to the bit, and its slope there. Parameters as above. */
PEN_PORT_INLINE pen_real_t pen_net16_slope(size_t hidden, const pen_real_t w[], pen_real_t x, pen_real_t *slope)
{
    const pen_real_t *p = &w[32];
    const pen_real_t *const last = &w[32U + (272U * hidden)];
    pen_real_t value[2][16];
    pen_real_t change[2][16];
    size_t from = 0U; /* which of the two is full */
    size_t to = 1U;

    for (size_t i = 0U; i < 16U; i++) {
        const pen_real_t r = w[i] + (w[i + 16U] * x);
        value[0][i] = pen_rectified(r);
        change[0][i] = pen_rectified_slope(r, w[i + 16U]);
    }
    for (size_t layer = 1U; layer < hidden; layer++) {
        for (size_t half = 0U; half < 16U; half += 8U) {
            pen_duals_t a;
            pen_duals_fill(&a, &p[half], value[from], change[from]);
            pen_duals_end(&a, &value[to][half], &change[to][half]);
        }
        from = to;
        to = 1U - from;
        p = &p[272];
    }
    value[to][0] = last[0] + last[0]; /* sums in memory: the registers are taken */
    change[to][0] = (pen_real_t)0;
    for (size_t half = 0U; half < 16U; half += 8U) {
        pen_duals_t a;
        pen_duals_fill(&a, &p[half], value[from], change[from]);
        pen_duals_last(&a, &last[half + 1U], &value[to][0], &change[to][0]);
    }
    *slope = change[to][0];
    return (pen_real_t)0.5F * value[to][0];
}

#ifdef __cplusplus
}
#endif

#endif
