/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/** pen_net.h on lanes: layers, activations, trust envelope. Part of pen_lanes.h, which includes it. */
#ifndef PEN_LANES_NET_H
#define PEN_LANES_NET_H

/* ---- pen_net: dense layers. Weights are stored as pen_net.h says. ---- */

LANES_INLINE lanes_t lanes_rectified(lanes_t x)
{
    return HALF * (x + lanes_abs(x));
}

/**
 * `rows` rows of one block; their accumulators stay in registers.
 * @param bias  without it: the tangent
 * @param relu  apply the activation
 */
LANES_INLINE void lanes_block(size_t rows, size_t n_in, const weight_t w[], const lanes_t x[], lanes_t y[], bool bias, bool relu)
{
    lanes_t a[16];

#pragma GCC unroll 16
    for (size_t r = 0U; r < rows; r++) {
        a[r] = bias ? lanes_weight(w[r]) : lanes_wide(ZERO);
    }
    for (size_t i = 0U; i < n_in; i++) {
        const lanes_t xi = x[i];
#pragma GCC unroll 16
        for (size_t r = 0U; r < rows; r++) {
            a[r] += w[(rows * (i + 1U)) + r] * xi;
        }
    }
#pragma GCC unroll 16
    for (size_t r = 0U; r < rows; r++) {
        y[r] = relu ? lanes_rectified(a[r]) : a[r];
    }
}

/**
 * y = W x + b
 * @param after_relu  x comes from a ReLU: the last n_out % 4 rows are summed twice as large, as in pen_dense1_relu
 * @param relu        apply the activation to y
 */
LANES_INLINE void lanes_dense(size_t n_out, size_t n_in, const weight_t w[], const lanes_t x[], lanes_t y[], bool after_relu, bool relu)
{
    size_t row = 0U;

    for (; (row + 16U) <= n_out; row += 16U) {
        lanes_block(16U, n_in, &w[row * (n_in + 1U)], x, &y[row], true, relu);
    }
    for (; (row + 4U) <= n_out; row += 4U) {
        lanes_block(4U, n_in, &w[row * (n_in + 1U)], x, &y[row], true, relu);
    }
    for (; row < n_out; row++) {
        const weight_t *const own = &w[row * (n_in + 1U)];
        lanes_t a = after_relu ? lanes_weight(own[0] + own[0]) : lanes_weight(own[0]);
        for (size_t i = 0U; i < n_in; i++) {
            a += own[i + 1U] * (after_relu ? (x[i] + x[i]) : x[i]);
        }
        a = after_relu ? (HALF * a) : a;
        y[row] = relu ? lanes_rectified(a) : a;
    }
}

/** y = W t */
LANES_INLINE void lanes_tangent(size_t n_out, size_t n_in, const weight_t w[], const lanes_t t[], lanes_t y[])
{
    size_t row = 0U;

    for (; (row + 16U) <= n_out; row += 16U) {
        lanes_block(16U, n_in, &w[row * (n_in + 1U)], t, &y[row], false, false);
    }
    for (; (row + 4U) <= n_out; row += 4U) {
        lanes_block(4U, n_in, &w[row * (n_in + 1U)], t, &y[row], false, false);
    }
    for (; row < n_out; row++) {
        const weight_t *const own = &w[row * (n_in + 1U)];
        lanes_t a = own[1] * t[0];
        for (size_t i = 1U; i < n_in; i++) {
            a += own[i + 1U] * t[i];
        }
        y[row] = a;
    }
}

/* ---- pen_net: the other activations in place, and t[i] *= act'(.) from the value after the activation ---- */

LANES_INLINE void lanes_act_tanh(size_t n, lanes_t h[])
{
    for (size_t i = 0U; i < n; i++) {
        h[i] = lanes_tanh(h[i]) + (ZERO * h[i]);
    }
}

LANES_INLINE void lanes_act_sigmoid(size_t n, lanes_t h[])
{
    for (size_t i = 0U; i < n; i++) {
        h[i] = lanes_sigmoid(h[i]) + (ZERO * h[i]);
    }
}

LANES_INLINE void lanes_act_softplus(size_t n, lanes_t h[])
{
    for (size_t i = 0U; i < n; i++) {
        h[i] = lanes_softplus(h[i]) + (ZERO * h[i]);
    }
}

LANES_INLINE void lanes_act_step(size_t n, lanes_t h[])
{
    for (size_t i = 0U; i < n; i++) {
        h[i] = lanes_pick(h[i] < ZERO, lanes_wide(ZERO), lanes_wide(ONE)) + (ZERO * h[i]);
    }
}

LANES_INLINE void lanes_slope_relu(size_t n, const lanes_t h[], lanes_t t[])
{
    for (size_t i = 0U; i < n; i++) {
        t[i] = (lanes_t)((h[i] > ZERO) & (mask_t)t[i]);
    }
}

LANES_INLINE void lanes_slope_tanh(size_t n, const lanes_t h[], lanes_t t[])
{
    for (size_t i = 0U; i < n; i++) {
        t[i] *= ONE - (h[i] * h[i]);
    }
}

LANES_INLINE void lanes_slope_sigmoid(size_t n, const lanes_t h[], lanes_t t[])
{
    for (size_t i = 0U; i < n; i++) {
        t[i] *= h[i] * (ONE - h[i]);
    }
}

LANES_INLINE void lanes_slope_softplus(size_t n, const lanes_t h[], lanes_t t[])
{
    for (size_t i = 0U; i < n; i++) {
        t[i] *= ONE - lanes_exp(-h[i]);
    }
}

LANES_INLINE void lanes_slope_step(size_t n, const lanes_t h[], lanes_t t[])
{
    for (size_t i = 0U; i < n; i++) {
        t[i] = ZERO * h[i];
    }
}

/* ---- pen_net: element-wise layers ---- */

LANES_INLINE void lanes_centre(size_t n, const weight_t w[], const lanes_t x[], lanes_t y[])
{
    for (size_t i = 0U; i < n; i++) {
        y[i] = (x[i] - w[i]) * w[n + i];
    }
}

LANES_INLINE void lanes_rescale(size_t n, const weight_t w[], const lanes_t x[], lanes_t y[])
{
    for (size_t i = 0U; i < n; i++) {
        y[i] = (x[i] * w[i]) + w[n + i];
    }
}

LANES_INLINE void lanes_centre_tangent(size_t n, const weight_t w[], lanes_t t[])
{
    for (size_t i = 0U; i < n; i++) {
        t[i] *= w[n + i];
    }
}

LANES_INLINE void lanes_rescale_tangent(size_t n, const weight_t w[], lanes_t t[])
{
    for (size_t i = 0U; i < n; i++) {
        t[i] *= w[i];
    }
}

/* ---- pen_net: trust envelope ---- */

/** Lanes in which any x[i] lies outside of its range, or is NaN. */
LANES_INLINE mask_t lanes_outside(size_t n, const weight_t range[], const lanes_t x[])
{
    mask_t outside = { 0 };

    for (size_t i = 0U; i < n; i++) {
        outside |= ~(x[i] >= range[i]) | ~(x[i] <= range[n + i]);
    }
    return outside;
}

LANES_INLINE void lanes_clamp(size_t n, const weight_t range[], const lanes_t x[], lanes_t y[])
{
    for (size_t i = 0U; i < n; i++) {
        const lanes_t raised = lanes_pick(x[i] < range[i], lanes_weight(range[i]), x[i]);
        y[i] = lanes_pick(raised > range[n + i], lanes_weight(range[n + i]), raised);
    }
}

LANES_INLINE lanes_t lanes_margin(size_t n, const weight_t range[], pen_real_t width, const lanes_t x[], size_t i)
{
    const weight_t span = width * (range[n + i] - range[i]);
    const lanes_t below = x[i] - range[i];
    const lanes_t above = range[n + i] - x[i];

    return ONE + (lanes_pick(below < above, below, above) / span);
}

LANES_INLINE lanes_t lanes_fade(size_t n, const weight_t range[], pen_real_t width, const lanes_t x[])
{
    lanes_t trust = lanes_wide(ONE);

    for (size_t i = 0U; i < n; i++) {
        const lanes_t here = lanes_margin(n, range, width, x, i);
        trust = lanes_pick(here < trust, here, trust) + (ZERO * here);
    }
    return lanes_pick(trust < ZERO, lanes_wide(ZERO), trust);
}

LANES_INLINE lanes_t lanes_clamp_slope(size_t n, const weight_t range[], const lanes_t x[], size_t i)
{
    const mask_t inside = (x[i] >= range[i]) & (x[i] <= range[n + i]);

    return lanes_pick(inside, lanes_wide(ONE), lanes_wide(ZERO));
}

LANES_INLINE lanes_t lanes_fade_slope(size_t n, const weight_t range[], pen_real_t width, const lanes_t x[], size_t i)
{
    const lanes_t trust = lanes_fade(n, range, width, x);
    const mask_t worst = ~(lanes_margin(n, range, width, x, i) > trust);
    const mask_t fading = (trust > ZERO) & (trust < ONE) & worst;
    const lanes_t steepness = lanes_weight(ONE / (width * (range[n + i] - range[i])));
    const lanes_t slope = lanes_pick(x[i] < range[i], steepness, -steepness);

    return lanes_pick(fading, slope, lanes_wide(ZERO));
}

#endif
