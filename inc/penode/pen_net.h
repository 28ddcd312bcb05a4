/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * Kernels of feed-forward networks for one sample. Generated code calls them in the order of the layers.
 *
 * Storage. A dense layer of n_out rows is cut into blocks of 16 rows, then of 4, then of 1. A block of R rows is one
 * stream: R biases, then for each input the R weights of its column. Every accumulator starts at its bias and takes
 * the inputs in ascending order, so the result does not depend on the cut, to the bit.
 *
 * NaN and Inf. They are never lost: each activation turns Inf into NaN where the mathematical limit would hide it, so
 * an overflow or a broken weight reaches the network's output, where the step sees it.
 *
 * Cost: one multiplication and one addition a weight; nothing depends on the values. No kernel needs memory of its own.
 */
#ifndef PEN_NET_H
#define PEN_NET_H

#include <stddef.h>

#include "penode/pen_real.h"
#include "penode/pen_status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ---- dense layers: y = W x + b, and with _relu: y = W max(0, x) + b, the activation of the layer before ---- */

/** Any shape. @param w [n_out * (n_in + 1)] as above; @param x [n_in]; @param y [n_out], may not overlap x */
void pen_dense(size_t n_out, size_t n_in, const pen_real_t w[], const pen_real_t x[], pen_real_t y[]);
void pen_dense_relu(size_t n_out, size_t n_in, const pen_real_t w[], const pen_real_t x[], pen_real_t y[]); /* x < 0 counts as 0 */

/** One row. @param w [1 + n_in]; @param x [n_in] */
pen_real_t pen_dense1(size_t n_in, const pen_real_t w[], const pen_real_t x[]);
pen_real_t pen_dense1_relu(size_t n_in, const pen_real_t w[], const pen_real_t x[]); /* x < 0 counts as 0 */

/** y = W t, without the bias: how a small change t of the input changes the output. */
void pen_dense_tangent(size_t n_out, size_t n_in, const pen_real_t w[], const pen_real_t t[], pen_real_t y[]);

/** Both at once: y = W x + b and s = W t. The outputs may not overlap the inputs. */
void pen_dense_dual(size_t n_out, size_t n_in, const pen_real_t w[], const pen_real_t x[], const pen_real_t t[], pen_real_t y[],
                    pen_real_t s[]);

/* ---- activations, in place on h[n] ---- */

void pen_act_relu(size_t n, pen_real_t h[]); /* only where no dense layer follows */
void pen_act_tanh(size_t n, pen_real_t h[]); /* hyperbolic tangent */
void pen_act_sigmoid(size_t n, pen_real_t h[]); /* 1 / (1 + e^-h) */
void pen_act_softplus(size_t n, pen_real_t h[]); /* logarithm of 1 + e^h */
void pen_act_step(size_t n, pen_real_t h[]); /* 0 below zero, 1 from zero on */

/* ---- their slopes: t[i] *= act'(.), from the value h[i] after the activation (relu: before or after) ---- */

void pen_slope_relu(size_t n, const pen_real_t h[], pen_real_t t[]); /* 0 at the kink */
void pen_slope_tanh(size_t n, const pen_real_t h[], pen_real_t t[]); /* 1 - h^2 */
void pen_slope_sigmoid(size_t n, const pen_real_t h[], pen_real_t t[]); /* h (1 - h) */
void pen_slope_softplus(size_t n, const pen_real_t h[], pen_real_t t[]); /* 1 - e^-h */
void pen_slope_step(size_t n, const pen_real_t h[], pen_real_t t[]); /* 0 */

/* ---- their second derivatives: c[i] = act'(.) c[i] + act''(.) a[i] b[i], from the value h[i] after the activation ---- */

void pen_second_tanh(size_t n, const pen_real_t h[], const pen_real_t a[], const pen_real_t b[], pen_real_t c[]);
void pen_second_sigmoid(size_t n, const pen_real_t h[], const pen_real_t a[], const pen_real_t b[], pen_real_t c[]); /* as above */
void pen_second_softplus(size_t n, const pen_real_t h[], const pen_real_t a[], const pen_real_t b[], pen_real_t c[]); /* as above */

/* ---- element-wise layers. Standardising and min-max scaling are pen_centre, their inverses pen_rescale; a PCA is
 *      pen_centre and then pen_dense with the components as rows. ---- */

/** y[i] = (x[i] - p[i]) * p[n + i]; y may be x. @param p [2 * n]: mean or minimum, then 1 / deviation or 1 / span */
static inline void pen_centre(size_t n, const pen_real_t p[], const pen_real_t x[], pen_real_t y[])
{
    for (size_t i = 0U; i < n; i++) {
        y[i] = (x[i] - p[i]) * p[n + i];
    }
}

/** y[i] = x[i] * p[i] + p[n + i]; y may be x. @param p [2 * n]: deviation or span, then mean or minimum */
static inline void pen_rescale(size_t n, const pen_real_t p[], const pen_real_t x[], pen_real_t y[])
{
    for (size_t i = 0U; i < n; i++) {
        y[i] = (x[i] * p[i]) + p[n + i];
    }
}

/** How a change t of the input changes the output, in place. @param p as above */
void pen_centre_tangent(size_t n, const pen_real_t p[], pen_real_t t[]);
void pen_rescale_tangent(size_t n, const pen_real_t p[], pen_real_t t[]); /* t[i] *= p[i] */

/* ---- trust envelope: the range of each input that was seen in training ---- */

/** @param range [2 * n]: lowest, then highest values. @return PEN_OK; PEN_OUTSIDE if any x[i] lies outside (or is NaN) */
static inline pen_status_t pen_outside(size_t n, const pen_real_t range[], const pen_real_t x[])
{
    pen_status_t status = PEN_OK;

    for (size_t i = 0U; i < n; i++) {
        const bool inside_low = (x[i] >= range[i]);
        const bool inside_high = (x[i] <= range[n + i]);
        status |= inside_low ? PEN_OK : PEN_OUTSIDE;
        status |= inside_high ? PEN_OK : PEN_OUTSIDE;
    }
    return status;
}

/** y[i] = x[i] moved into its range; NaN stays NaN; y may be x. */
void pen_clamp(size_t n, const pen_real_t range[], const pen_real_t x[], pen_real_t y[]);

/**
 * How far to trust the network: 1 inside the range, falling linearly to 0 at `width` ranges outside of it (the worst
 * input counts), 0 beyond; NaN for NaN.
 */
pen_real_t pen_fade(size_t n, const pen_real_t range[], pen_real_t width, const pen_real_t x[]);

/** Derivatives of pen_clamp's y[i] and of pen_fade along x[i]: at an edge that of the inside, 0 where trust ends. */
pen_real_t pen_clamp_slope(size_t n, const pen_real_t range[], const pen_real_t x[], size_t i);
pen_real_t pen_fade_slope(size_t n, const pen_real_t range[], pen_real_t width, const pen_real_t x[], size_t i); /* of pen_fade */

#ifdef __cplusplus
}
#endif

#endif
