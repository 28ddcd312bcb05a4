/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "penode/pen_exact.h"

#include "penode/pen_net.h"

#include <stdbool.h>

#include "penode/pen_math.h"
#include "penode/pen_net16.h"
#include "penode/pen_port.h"

#define ZERO ((pen_real_t)0)
#define HALF ((pen_real_t)0.5F)
#define ONE  ((pen_real_t)1)
#define TWO  ((pen_real_t)2)

/* Rows r .. r + 3 of a block that has `rows` of them; without its bias, the tangent. */
static void four_rows(size_t rows, size_t n_in, const pen_real_t w[], const pen_real_t x[], pen_real_t y[], bool bias, bool relu)
{
    pen_real_t a0 = bias ? w[0] : ZERO;
    pen_real_t a1 = bias ? w[1] : ZERO;
    pen_real_t a2 = bias ? w[2] : ZERO;
    pen_real_t a3 = bias ? w[3] : ZERO;

    for (size_t i = 0U; i < n_in; i++) {
        const pen_real_t *const column = &w[rows * (i + 1U)];
        const pen_real_t xi = relu ? pen_rectified(x[i]) : x[i];
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
        pen_rows_relu(n_in, &w[row * (n_in + 1U)], x, &y[row]);
    }
    fours(n_out - wide, n_in, &w[wide * (n_in + 1U)], x, &y[wide], true, true);
    for (size_t row = n_out - (n_out % 4U); row < n_out; row++) {
        y[row] = pen_dense1_relu(n_in, &w[row * (n_in + 1U)], x);
    }
}

/* Eight rows of a block of sixteen. */
static void eight_duals(size_t n_in, const pen_real_t w[], const pen_real_t x[], const pen_real_t t[], pen_real_t y[], pen_real_t s[])
{
    pen_duals_t a;

    pen_duals_begin(&a, w, &w[16], x[0], t[0]);
    for (size_t i = 1U; i < n_in; i++) {
        pen_duals_add(&a, &w[(16U * i) + 16U], x[i], t[i]);
    }
    y[0] = a.r0;
    y[1] = a.r1;
    y[2] = a.r2;
    y[3] = a.r3;
    y[4] = a.r4;
    y[5] = a.r5;
    y[6] = a.r6;
    y[7] = a.r7;
    s[0] = a.d0;
    s[1] = a.d1;
    s[2] = a.d2;
    s[3] = a.d3;
    s[4] = a.d4;
    s[5] = a.d5;
    s[6] = a.d6;
    s[7] = a.d7;
}

void pen_dense_dual(size_t n_out, size_t n_in, const pen_real_t w[], const pen_real_t x[], const pen_real_t t[], pen_real_t y[],
                    pen_real_t s[])
{
    const size_t wide = n_out - (n_out % 16U);

    for (size_t row = 0U; row < wide; row += 16U) {
        const pen_real_t *const block = &w[row * (n_in + 1U)];
        eight_duals(n_in, &block[0], x, t, &y[row], &s[row]);
        eight_duals(n_in, &block[8], x, t, &y[row + 8U], &s[row + 8U]);
    }
    pen_dense(n_out - wide, n_in, &w[wide * (n_in + 1U)], x, &y[wide]);
    pen_dense_tangent(n_out - wide, n_in, &w[wide * (n_in + 1U)], t, &s[wide]);
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
        h[i] = pen_rectified(h[i]);
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

void pen_second_tanh(size_t n, const pen_real_t h[], const pen_real_t a[], const pen_real_t b[], pen_real_t c[])
{
    for (size_t i = 0U; i < n; i++) {
        const pen_real_t slope = ONE - (h[i] * h[i]);
        c[i] = slope * (c[i] - ((TWO * h[i]) * (a[i] * b[i])));
    }
}

void pen_second_sigmoid(size_t n, const pen_real_t h[], const pen_real_t a[], const pen_real_t b[], pen_real_t c[])
{
    for (size_t i = 0U; i < n; i++) {
        const pen_real_t slope = h[i] * (ONE - h[i]);
        c[i] = slope * (c[i] + ((ONE - (TWO * h[i])) * (a[i] * b[i])));
    }
}

void pen_second_softplus(size_t n, const pen_real_t h[], const pen_real_t a[], const pen_real_t b[], pen_real_t c[])
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

    return ONE + (pen_where(below < above, below, above) / span);
}

pen_real_t pen_fade(size_t n, const pen_real_t range[], pen_real_t width, const pen_real_t x[])
{
    pen_real_t trust = ONE;

    for (size_t i = 0U; i < n; i++) {
        const pen_real_t here = margin(n, range, width, x, i);
        trust = pen_where(here < trust, here, trust) + (ZERO * here);
    }
    return pen_where(trust < ZERO, ZERO, trust);
}

pen_real_t pen_clamp_slope(size_t n, const pen_real_t range[], const pen_real_t x[], size_t i)
{
    const pen_real_t inside_low = pen_where(x[i] >= range[i], ONE, ZERO);

    return pen_where(x[i] <= range[n + i], inside_low, ZERO);
}

pen_real_t pen_fade_slope(size_t n, const pen_real_t range[], pen_real_t width, const pen_real_t x[], size_t i)
{
    const pen_real_t trust = pen_fade(n, range, width, x);
    const pen_real_t steepness = ONE / (width * (range[n + i] - range[i]));
    const pen_real_t slope = pen_where(x[i] < range[i], steepness, -steepness);
    const pen_real_t above_none = pen_where(trust > ZERO, slope, ZERO);
    const pen_real_t fading = pen_where(trust < ONE, above_none, ZERO);

    return pen_where(margin(n, range, width, x, i) > trust, ZERO, fading); /* another input counts */
}
