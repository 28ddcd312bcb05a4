/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "penode/pen_net.h"

#include <stdbool.h>

#include "penode/pen_math.h"
#include "penode/pen_port.h"

#define ZERO ((pen_real_t)0)
#define HALF ((pen_real_t)0.5F)
#define ONE  ((pen_real_t)1)
#define TWO  ((pen_real_t)2)

/* max(0, x). Two instructions cheaper than a comparison, and -Inf + Inf is NaN: an overflow cannot hide behind the kink. */
static inline pen_real_t rectified(pen_real_t x)
{
    return HALF * (x + pen_port_abs(x));
}

/* Named accumulators, because only those stay in registers at every optimisation level. */
void pen_dense16_relu(size_t n_in, const pen_real_t w[], const pen_real_t x[], pen_real_t y[])
{
    pen_real_t a0 = w[0];
    pen_real_t a1 = w[1];
    pen_real_t a2 = w[2];
    pen_real_t a3 = w[3];
    pen_real_t a4 = w[4];
    pen_real_t a5 = w[5];
    pen_real_t a6 = w[6];
    pen_real_t a7 = w[7];
    pen_real_t a8 = w[8];
    pen_real_t a9 = w[9];
    pen_real_t a10 = w[10];
    pen_real_t a11 = w[11];
    pen_real_t a12 = w[12];
    pen_real_t a13 = w[13];
    pen_real_t a14 = w[14];
    pen_real_t a15 = w[15];

    for (size_t i = 0U; i < n_in; i++) {
        const pen_real_t *const column = &w[(16U * i) + 16U];
        const pen_real_t xi = rectified(x[i]);
        a0 += column[0] * xi;
        a1 += column[1] * xi;
        a2 += column[2] * xi;
        a3 += column[3] * xi;
        a4 += column[4] * xi;
        a5 += column[5] * xi;
        a6 += column[6] * xi;
        a7 += column[7] * xi;
        a8 += column[8] * xi;
        a9 += column[9] * xi;
        a10 += column[10] * xi;
        a11 += column[11] * xi;
        a12 += column[12] * xi;
        a13 += column[13] * xi;
        a14 += column[14] * xi;
        a15 += column[15] * xi;
    }
    y[0] = a0;
    y[1] = a1;
    y[2] = a2;
    y[3] = a3;
    y[4] = a4;
    y[5] = a5;
    y[6] = a6;
    y[7] = a7;
    y[8] = a8;
    y[9] = a9;
    y[10] = a10;
    y[11] = a11;
    y[12] = a12;
    y[13] = a13;
    y[14] = a14;
    y[15] = a15;
}

#ifdef __OPTIMIZE_SIZE__ /* the same bits from the kernels that are there anyway */

void pen_dense16_pair(const pen_real_t w[], pen_real_t x, pen_real_t y[])
{
    pen_dense16_scalar(w, x, y);
    pen_dense16_relu(16U, &w[32], y, y);
}

pen_real_t pen_dense16_last(size_t n_in, const pen_real_t w[], pen_real_t x[])
{
    pen_dense16_relu(n_in, w, x, x);
    return pen_dense1_relu(16U, &w[16U * (n_in + 1U)], x);
}

#else

void pen_dense16_pair(const pen_real_t w[], pen_real_t x, pen_real_t y[])
{
    pen_real_t a0 = w[32];
    pen_real_t a1 = w[33];
    pen_real_t a2 = w[34];
    pen_real_t a3 = w[35];
    pen_real_t a4 = w[36];
    pen_real_t a5 = w[37];
    pen_real_t a6 = w[38];
    pen_real_t a7 = w[39];
    pen_real_t a8 = w[40];
    pen_real_t a9 = w[41];
    pen_real_t a10 = w[42];
    pen_real_t a11 = w[43];
    pen_real_t a12 = w[44];
    pen_real_t a13 = w[45];
    pen_real_t a14 = w[46];
    pen_real_t a15 = w[47];

    for (size_t i = 0U; i < 16U; i++) {
        const pen_real_t *const column = &w[(16U * i) + 48U];
        const pen_real_t xi = rectified(w[i] + (w[i + 16U] * x));
        a0 += column[0] * xi;
        a1 += column[1] * xi;
        a2 += column[2] * xi;
        a3 += column[3] * xi;
        a4 += column[4] * xi;
        a5 += column[5] * xi;
        a6 += column[6] * xi;
        a7 += column[7] * xi;
        a8 += column[8] * xi;
        a9 += column[9] * xi;
        a10 += column[10] * xi;
        a11 += column[11] * xi;
        a12 += column[12] * xi;
        a13 += column[13] * xi;
        a14 += column[14] * xi;
        a15 += column[15] * xi;
    }
    y[0] = a0;
    y[1] = a1;
    y[2] = a2;
    y[3] = a3;
    y[4] = a4;
    y[5] = a5;
    y[6] = a6;
    y[7] = a7;
    y[8] = a8;
    y[9] = a9;
    y[10] = a10;
    y[11] = a11;
    y[12] = a12;
    y[13] = a13;
    y[14] = a14;
    y[15] = a15;
}

pen_real_t pen_dense16_last(size_t n_in, const pen_real_t w[], pen_real_t x[])
{
    const pen_real_t *const last = &w[16U * (n_in + 1U)];
    pen_real_t twice = last[0] + last[0]; /* see pen_dense1_relu */
    pen_real_t a0 = w[0];
    pen_real_t a1 = w[1];
    pen_real_t a2 = w[2];
    pen_real_t a3 = w[3];
    pen_real_t a4 = w[4];
    pen_real_t a5 = w[5];
    pen_real_t a6 = w[6];
    pen_real_t a7 = w[7];
    pen_real_t a8 = w[8];
    pen_real_t a9 = w[9];
    pen_real_t a10 = w[10];
    pen_real_t a11 = w[11];
    pen_real_t a12 = w[12];
    pen_real_t a13 = w[13];
    pen_real_t a14 = w[14];
    pen_real_t a15 = w[15];

    for (size_t i = 0U; i < n_in; i++) {
        const pen_real_t *const column = &w[(16U * i) + 16U];
        const pen_real_t xi = rectified(x[i]);
        a0 += column[0] * xi;
        a1 += column[1] * xi;
        a2 += column[2] * xi;
        a3 += column[3] * xi;
        a4 += column[4] * xi;
        a5 += column[5] * xi;
        a6 += column[6] * xi;
        a7 += column[7] * xi;
        a8 += column[8] * xi;
        a9 += column[9] * xi;
        a10 += column[10] * xi;
        a11 += column[11] * xi;
        a12 += column[12] * xi;
        a13 += column[13] * xi;
        a14 += column[14] * xi;
        a15 += column[15] * xi;
    }
    twice += last[1] * (a0 + pen_port_abs(a0));
    twice += last[2] * (a1 + pen_port_abs(a1));
    twice += last[3] * (a2 + pen_port_abs(a2));
    twice += last[4] * (a3 + pen_port_abs(a3));
    twice += last[5] * (a4 + pen_port_abs(a4));
    twice += last[6] * (a5 + pen_port_abs(a5));
    twice += last[7] * (a6 + pen_port_abs(a6));
    twice += last[8] * (a7 + pen_port_abs(a7));
    twice += last[9] * (a8 + pen_port_abs(a8));
    twice += last[10] * (a9 + pen_port_abs(a9));
    twice += last[11] * (a10 + pen_port_abs(a10));
    twice += last[12] * (a11 + pen_port_abs(a11));
    twice += last[13] * (a12 + pen_port_abs(a12));
    twice += last[14] * (a13 + pen_port_abs(a13));
    twice += last[15] * (a14 + pen_port_abs(a14));
    twice += last[16] * (a15 + pen_port_abs(a15));
    return HALF * twice;
}

#endif

/* Rows r .. r + 3 of a block that has `rows` of them; without its bias, the tangent. */
static void four_rows(size_t rows, size_t n_in, const pen_real_t w[], const pen_real_t x[], pen_real_t y[], bool bias, bool relu)
{
    pen_real_t a0 = bias ? w[0] : ZERO;
    pen_real_t a1 = bias ? w[1] : ZERO;
    pen_real_t a2 = bias ? w[2] : ZERO;
    pen_real_t a3 = bias ? w[3] : ZERO;

    for (size_t i = 0U; i < n_in; i++) {
        const pen_real_t *const column = &w[rows * (i + 1U)];
        const pen_real_t xi = relu ? rectified(x[i]) : x[i];
        a0 += column[0] * xi;
        a1 += column[1] * xi;
        a2 += column[2] * xi;
        a3 += column[3] * xi;
    }
    y[0] = a0;
    y[1] = a1;
    y[2] = a2;
    y[3] = a3;
}

/* All rows but the last n_out % 4. */
static void fours(size_t n_out, size_t n_in, const pen_real_t w[], const pen_real_t x[], pen_real_t y[], bool bias, bool relu)
{
    const size_t wide = n_out - (n_out % 16U);

    for (size_t row = 0U; (row + 4U) <= n_out; row += 4U) {
        const bool in_wide = (row < wide);
        const size_t rows = in_wide ? 16U : 4U;
        const size_t first = in_wide ? (row - (row % 16U)) : row; /* of the block */
        four_rows(rows, n_in, &w[(first * (n_in + 1U)) + (row - first)], x, &y[row], bias, relu);
    }
}

void pen_dense(size_t n_out, size_t n_in, const pen_real_t w[], const pen_real_t x[], pen_real_t y[])
{
    fours(n_out, n_in, w, x, y, true, false);
    for (size_t row = n_out - (n_out % 4U); row < n_out; row++) {
        y[row] = pen_dense1(n_in, &w[row * (n_in + 1U)], x);
    }
}

void pen_dense_relu(size_t n_out, size_t n_in, const pen_real_t w[], const pen_real_t x[], pen_real_t y[])
{
    const size_t wide = n_out - (n_out % 16U);

    for (size_t row = 0U; row < wide; row += 16U) {
        pen_dense16_relu(n_in, &w[row * (n_in + 1U)], x, &y[row]);
    }
    fours(n_out - wide, n_in, &w[wide * (n_in + 1U)], x, &y[wide], true, true);
    for (size_t row = n_out - (n_out % 4U); row < n_out; row++) {
        y[row] = pen_dense1_relu(n_in, &w[row * (n_in + 1U)], x);
    }
}

void pen_dense_tangent(size_t n_out, size_t n_in, const pen_real_t w[], const pen_real_t t[], pen_real_t y[])
{
    fours(n_out, n_in, w, t, y, false, false);
    for (size_t row = n_out - (n_out % 4U); row < n_out; row++) {
        const pen_real_t *const stream = &w[row * (n_in + 1U)];
        pen_real_t a = stream[1] * t[0];
        for (size_t i = 1U; i < n_in; i++) {
            a += stream[i + 1U] * t[i];
        }
        y[row] = a;
    }
}

void pen_dense16_scalar(const pen_real_t w[], pen_real_t x, pen_real_t y[])
{
    for (size_t row = 0U; row < 16U; row++) {
        y[row] = w[row] + (w[row + 16U] * x);
    }
}

pen_real_t pen_dense1(size_t n_in, const pen_real_t w[], const pen_real_t x[])
{
    pen_real_t a = w[0];

    for (size_t i = 0U; i < n_in; i++) {
        a += w[i + 1U] * x[i];
    }
    return a;
}

/* Twice the sum, halved at the end: exact, and a multiplication less for each input. */
pen_real_t pen_dense1_relu(size_t n_in, const pen_real_t w[], const pen_real_t x[])
{
    pen_real_t twice = w[0] + w[0];

    for (size_t i = 0U; i < n_in; i++) {
        twice += w[i + 1U] * (x[i] + pen_port_abs(x[i]));
    }
    return HALF * twice;
}

/* Activations. Adding 0 * h keeps the value and turns Inf into NaN. */

void pen_act_relu(size_t n, pen_real_t h[])
{
    for (size_t i = 0U; i < n; i++) {
        h[i] = rectified(h[i]);
    }
}

void pen_act_tanh(size_t n, pen_real_t h[])
{
    for (size_t i = 0U; i < n; i++) {
        h[i] = pen_tanh(h[i]) + (ZERO * h[i]);
    }
}

void pen_act_sigmoid(size_t n, pen_real_t h[])
{
    for (size_t i = 0U; i < n; i++) {
        h[i] = pen_sigmoid(h[i]) + (ZERO * h[i]);
    }
}

void pen_act_softplus(size_t n, pen_real_t h[])
{
    for (size_t i = 0U; i < n; i++) {
        h[i] = pen_softplus(h[i]) + (ZERO * h[i]);
    }
}

void pen_act_step(size_t n, pen_real_t h[])
{
    for (size_t i = 0U; i < n; i++) {
        h[i] = ((h[i] < ZERO) ? ZERO : ONE) + (ZERO * h[i]);
    }
}

void pen_slope_relu(size_t n, const pen_real_t h[], pen_real_t t[])
{
    for (size_t i = 0U; i < n; i++) {
        t[i] = (h[i] > ZERO) ? t[i] : ZERO;
    }
}

void pen_slope_tanh(size_t n, const pen_real_t h[], pen_real_t t[])
{
    for (size_t i = 0U; i < n; i++) {
        t[i] *= ONE - (h[i] * h[i]);
    }
}

void pen_slope_sigmoid(size_t n, const pen_real_t h[], pen_real_t t[])
{
    for (size_t i = 0U; i < n; i++) {
        t[i] *= h[i] * (ONE - h[i]);
    }
}

void pen_slope_softplus(size_t n, const pen_real_t h[], pen_real_t t[])
{
    for (size_t i = 0U; i < n; i++) {
        t[i] *= ONE - pen_exp(-h[i]); /* h = log(1 + e^x), so e^x / (1 + e^x) = 1 - e^-h */
    }
}

void pen_bend_tanh(size_t n, const pen_real_t h[], const pen_real_t a[], const pen_real_t b[], pen_real_t c[])
{
    for (size_t i = 0U; i < n; i++) {
        const pen_real_t slope = ONE - (h[i] * h[i]);
        c[i] = slope * (c[i] - ((TWO * h[i]) * (a[i] * b[i])));
    }
}

void pen_bend_sigmoid(size_t n, const pen_real_t h[], const pen_real_t a[], const pen_real_t b[], pen_real_t c[])
{
    for (size_t i = 0U; i < n; i++) {
        const pen_real_t slope = h[i] * (ONE - h[i]);
        c[i] = slope * (c[i] + ((ONE - (TWO * h[i])) * (a[i] * b[i])));
    }
}

void pen_bend_softplus(size_t n, const pen_real_t h[], const pen_real_t a[], const pen_real_t b[], pen_real_t c[])
{
    for (size_t i = 0U; i < n; i++) {
        const pen_real_t rest = pen_exp(-h[i]); /* the slope is 1 - rest */
        c[i] = (ONE - rest) * (c[i] + (rest * (a[i] * b[i])));
    }
}

void pen_slope_step(size_t n, const pen_real_t h[], pen_real_t t[])
{
    for (size_t i = 0U; i < n; i++) {
        t[i] = ZERO * h[i];
    }
}

void pen_centre_tangent(size_t n, const pen_real_t p[], pen_real_t t[])
{
    for (size_t i = 0U; i < n; i++) {
        t[i] *= p[n + i];
    }
}

void pen_rescale_tangent(size_t n, const pen_real_t p[], pen_real_t t[])
{
    for (size_t i = 0U; i < n; i++) {
        t[i] *= p[i];
    }
}

void pen_clamp(size_t n, const pen_real_t range[], const pen_real_t x[], pen_real_t y[])
{
    for (size_t i = 0U; i < n; i++) {
        const pen_real_t raised = (x[i] < range[i]) ? range[i] : x[i];
        y[i] = (raised > range[n + i]) ? range[n + i] : raised;
    }
}

/* Trust in one input: 1 + its distance to the nearer edge in widths, above 1 inside, below 0 far outside. */
static pen_real_t margin(size_t n, const pen_real_t range[], pen_real_t width, const pen_real_t x[], size_t i)
{
    const pen_real_t span = width * (range[n + i] - range[i]);
    const pen_real_t below = x[i] - range[i];
    const pen_real_t above = range[n + i] - x[i];

    return ONE + (((below < above) ? below : above) / span);
}

pen_real_t pen_fade(size_t n, const pen_real_t range[], pen_real_t width, const pen_real_t x[])
{
    pen_real_t trust = ONE;

    for (size_t i = 0U; i < n; i++) {
        const pen_real_t here = margin(n, range, width, x, i);
        trust = ((here < trust) ? here : trust) + (ZERO * here);
    }
    return (trust < ZERO) ? ZERO : trust;
}

pen_real_t pen_clamp_slope(size_t n, const pen_real_t range[], const pen_real_t x[], size_t i)
{
    const bool inside = (x[i] >= range[i]) && (x[i] <= range[n + i]);

    return inside ? ONE : ZERO;
}

pen_real_t pen_fade_slope(size_t n, const pen_real_t range[], pen_real_t width, const pen_real_t x[], size_t i)
{
    const pen_real_t trust = pen_fade(n, range, width, x);
    const bool fading = (trust > ZERO) && (trust < ONE) && !(margin(n, range, width, x, i) > trust);
    const pen_real_t steepness = ONE / (width * (range[n + i] - range[i]));
    const pen_real_t slope = (x[i] < range[i]) ? steepness : -steepness;

    return fading ? slope : ZERO;
}
