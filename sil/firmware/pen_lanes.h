/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * The runtime on lanes: one vector register holds the same quantity of several runs. For the host's batch library only.
 *
 * Each lane does what inc/penode/ does with one number, in the same order, so it gives the same bits; only selections
 * differ: masks, where a single run picks from a pair. Vectors are those that GCC and clang have on any processor; constants and
 * polynomials of exp, tanh, sigmoid and softplus are those of src/pen_math.c. (A loop over the lanes in place of the
 * vector operators costs two to five times the run time and the compile time: measured with gcc 12.)
 */
#ifndef PEN_LANES_H
#define PEN_LANES_H

#include <math.h> /* INFINITY */
#include <stddef.h>
#include <stdint.h>

#include "penode/pen_real.h"

/* Functions of pen_math.c that no lane calls one by one: internal, so that a compiler leaves them out. */
#define LANES_INTERNAL static __attribute__((unused))
LANES_INTERNAL pen_real_t pen_exp(pen_real_t x);
LANES_INTERNAL pen_real_t pen_tanh(pen_real_t x);
LANES_INTERNAL pen_real_t pen_sigmoid(pen_real_t x);
LANES_INTERNAL pen_real_t pen_softplus(pen_real_t x);

#ifdef LANES_SIMPLE
#pragma GCC push_options
#pragma GCC optimize("O3")
#endif
#include "pen_math.c"
#ifdef LANES_SIMPLE
#pragma GCC pop_options
#endif

#if defined(__AVX512F__)
#define LANES_BYTES 64
#elif defined(__AVX__)
#define LANES_BYTES 32
#else
#define LANES_BYTES 16
#endif
#define LANES        (LANES_BYTES / sizeof(pen_real_t))
#define LANES_INLINE static inline __attribute__((always_inline, unused))
#define LANES_APART  static __attribute__((noinline)) /* one copy of long functions */

/* LANES_SIMPLE, with gcc: short to compile. There is one copy of what is long, and of that only functions of a number are optimised. */
#ifdef LANES_SIMPLE
#define LANES_FUNCTION static __attribute__((noinline, unused, optimize("O3")))
#define LANES_RATES    static __attribute__((noinline, unused))
#else
#define LANES_FUNCTION LANES_INLINE
#define LANES_RATES    LANES_INLINE
#endif

#ifdef PEN_REAL_DOUBLE
typedef int64_t integer_t; /* as wide as pen_real_t */
#define SIGN_BIT      INT64_MIN
#define MANTISSA_BITS 52
#define TRUNC         __builtin_trunc
#define UNITS         0x1p52 /* a whole number added to it stands in the lowest bits */
#define UNITS_MASK    INT64_C(0xFFFFFFFFFFFFF)
#define EXPONENT_ZERO 1023
#define POWER_SPLIT   256 /* 2^k is the product of 2^(k mod 256) and the rest, as in pen_math.c */
#else
typedef int32_t integer_t;
#define SIGN_BIT      INT32_MIN
#define MANTISSA_BITS 23
#define TRUNC         __builtin_truncf
#define UNITS         0x1p23F
#define UNITS_MASK    INT32_C(0x7FFFFF)
#define EXPONENT_ZERO 127
#define POWER_SPLIT   32
#endif

typedef pen_real_t lanes_t __attribute__((vector_size(LANES_BYTES)));
typedef lanes_t lanes_unaligned_t __attribute__((aligned(sizeof(pen_real_t)), may_alias)); /* in memory of callers */
typedef integer_t mask_t __attribute__((vector_size(LANES_BYTES))); /* -1: yes, 0: no */

#ifdef WEIGHTS_PER_RUN
typedef lanes_t weight_t __attribute__((aligned(sizeof(pen_real_t)))); /* as the caller has them */
#else
typedef pen_real_t weight_t; /* the same for all lanes */
#endif

/* ---- mode ---- */

/** With LANES_FLUSH: results and operands that are subnormal count as 0 from now on, for each of them costs as much as fifty
 * others (exp(-x) of a large x is one). What was before, for lanes_restore. */
LANES_INLINE unsigned lanes_flush(void)
{
#if defined(LANES_FLUSH) && defined(__SSE2__)
    const unsigned mode = __builtin_ia32_stmxcsr();

    __builtin_ia32_ldmxcsr(mode | 0x8040U); /* FTZ and DAZ */
    return mode;
#else
    return 0U;
#endif
}

LANES_INLINE void lanes_restore(unsigned mode)
{
#if defined(LANES_FLUSH) && defined(__SSE2__)
    __builtin_ia32_ldmxcsr(mode);
#else
    (void)mode;
#endif
}

/* ---- selection ---- */

/** The same number in all lanes; -0 stays -0. */
LANES_INLINE lanes_t lanes_wide(pen_real_t x)
{
    return x - (lanes_t){ 0 };
}

LANES_INLINE lanes_t lanes_weight(weight_t w)
{
    return w - (lanes_t){ 0 };
}

LANES_INLINE lanes_t lanes_pick(mask_t which, lanes_t yes, lanes_t no)
{
    return (lanes_t)((which & (mask_t)yes) | (~which & (mask_t)no));
}

LANES_INLINE bool lanes_all(mask_t mask)
{
    bool all = true;

    for (size_t l = 0U; l < LANES; l++) {
        all = all && (mask[l] != 0);
    }
    return all;
}

LANES_INLINE lanes_t lanes_abs(lanes_t x)
{
    return (lanes_t)((mask_t)x & ~SIGN_BIT);
}

/** pen_finite on lanes */
LANES_INLINE mask_t lanes_finite(size_t n, const lanes_t value[])
{
    const mask_t exponent = (mask_t)lanes_wide((pen_real_t)INFINITY);
    mask_t bad = { 0 };

    for (size_t i = 0U; i < n; i++) {
        bad |= ((mask_t)value[i] & exponent) == exponent;
    }
    return ~bad;
}

/* ---- pen_math ---- */

/* A polynomial in each lane: straight-line code, which the compiler vectorises. */
#define LANES_EACH(name) \
    LANES_FUNCTION lanes_t lanes_##name(lanes_t x) \
    { \
        lanes_t y = { 0 }; \
        for (size_t l = 0U; l < LANES; l++) { \
            y[l] = name(x[l]); \
        } \
        return y; \
    }
LANES_EACH(expm1_tail)
LANES_EACH(tanh_tail)
LANES_EACH(softplus_tail)
LANES_EACH(log1p_tail)

LANES_INLINE lanes_t lanes_trunc(lanes_t x)
{
    lanes_t y = { 0 };

    for (size_t l = 0U; l < LANES; l++) {
        y[l] = TRUNC(x[l]);
    }
    return y;
}

/* e^x = (1 + p) * low * high */
typedef struct {
    lanes_t p;
    lanes_t low;
    lanes_t high;
} lanes_power_t;

LANES_INLINE lanes_power_t lanes_power(lanes_t x, pen_real_t low, pen_real_t high, pen_real_t bias)
{
    const lanes_t above = lanes_pick(x < low, lanes_wide(low), x);
    const lanes_t c = lanes_pick(above > high, lanes_wide(high), above);
    const lanes_t shifted = (c * LOG2_E) + (bias + HALF);
    const lanes_t whole = lanes_trunc((lanes_t)((shifted > ZERO) & (mask_t)shifted));
    const mask_t k = (mask_t)(whole + UNITS) & UNITS_MASK; /* no register converts wide integers, on many processors */
    const lanes_t n = whole - bias;
    const lanes_t r = (c - (n * LN2_HIGH)) - (n * LN2_LOW);
    const mask_t rest = k & (POWER_SPLIT - 1);
    const mask_t least = (k < POWER_SPLIT) & 1; /* the bits of 2^-BIAS, which is subnormal */
    const mask_t exponent = (k - rest) - ((int)BIAS - EXPONENT_ZERO);
    lanes_power_t e;

    e.p = r + ((r * r) * lanes_expm1_tail(r));
    e.low = (lanes_t)((rest + EXPONENT_ZERO) << MANTISSA_BITS);
    e.high = (lanes_t)(((k >= POWER_SPLIT) & (exponent << MANTISSA_BITS)) | least);
    return e;
}

LANES_FUNCTION lanes_t lanes_exp(lanes_t x)
{
    const lanes_power_t e = lanes_power(x, EXP_LOW, EXP_HIGH, BIAS);

    return ((ONE + e.p) * e.low) * e.high;
}

LANES_FUNCTION lanes_t lanes_sigmoid(lanes_t x)
{
    const lanes_power_t e = lanes_power(-x, SIGMOID_LOW, -EXP_LOW, SIGMOID_BIAS);
    const lanes_t scale = e.low * e.high;
    const lanes_t sum = scale + SIGMOID_SCALE;
    const lanes_t lost = SIGMOID_SCALE - (sum - scale);

    return SIGMOID_SCALE / (sum + ((scale * e.p) + lost));
}

LANES_FUNCTION lanes_t lanes_tanh(lanes_t x)
{
    const lanes_t size = lanes_abs(x);
    const lanes_t z = x * x;
    const lanes_t inner = x + (x * (ZERO - (z * lanes_tanh_tail(z))));
    const lanes_power_t e = lanes_power(size + size, ZERO, TANH_HIGH, BIAS);
    const lanes_t scale = e.low * e.high;
    const lanes_t outer = ONE - (TWO / ((ONE + scale) + (scale * e.p)));

    return lanes_pick(size < TANH_NEAR, inner, lanes_pick(x > ZERO, outer, -outer));
}

LANES_FUNCTION lanes_t lanes_softplus(lanes_t x)
{
    const lanes_t size = lanes_abs(x);
    const lanes_t z = x * x;
    const lanes_t inner = LN2 + ((HALF * x) + (z * lanes_softplus_tail(z)));
    const lanes_power_t w = lanes_power(-size, EXP_LOW, ZERO, BIAS);
    const lanes_t e = ((ONE + w.p) * w.low) * w.high;
    const lanes_t ramp = (lanes_t)((x > ZERO) & (mask_t)x);
    const lanes_t outer = ramp + (e + ((e * e) * lanes_log1p_tail(e)));

    return lanes_pick(size < ONE, inner, outer);
}

LANES_INLINE lanes_t lanes_max(lanes_t a, lanes_t b)
{
    return lanes_pick(a > b, a, b) + (ZERO * (a + b));
}

LANES_INLINE lanes_t lanes_min(lanes_t a, lanes_t b)
{
    return lanes_pick(a < b, a, b) + (ZERO * (a + b));
}

LANES_INLINE lanes_t lanes_heaviside(lanes_t x)
{
    return lanes_pick(x > ZERO, lanes_wide(ONE), lanes_wide(ZERO)) + (ZERO * x);
}

LANES_INLINE lanes_t lanes_sign(lanes_t x)
{
    const lanes_t above = lanes_pick(x > ZERO, lanes_wide(ONE), lanes_wide(ZERO));
    const lanes_t below = lanes_pick(x < ZERO, lanes_wide(ONE), lanes_wide(ZERO));

    return (above - below) + (ZERO * x);
}

/* ---- pen_solve: a x = b in place, rows exchanged lane by lane; the lanes that are not singular ---- */

LANES_INLINE mask_t lanes_solve(size_t n, lanes_t a[], lanes_t b[])
{
    lanes_t inverse[n]; /* n is a constant where this is inlined */
    lanes_t nonfinite = { 0 };

    for (size_t k = 0U; k < n; k++) {
        lanes_t largest = lanes_abs(a[(k * n) + k]);
        mask_t row = (mask_t){ 0 } + (int)k;
        for (size_t i = k + 1U; i < n; i++) {
            const lanes_t size = lanes_abs(a[(i * n) + k]);
            const mask_t larger = size > largest;
            row = (larger & (int)i) | (~larger & row);
            largest = lanes_pick(larger, size, largest);
        }
        for (size_t i = k + 1U; i < n; i++) {
            const mask_t here = (row == (int)i);
            for (size_t j = k; j < n; j++) {
                const lanes_t kept = a[(k * n) + j];
                a[(k * n) + j] = lanes_pick(here, a[(i * n) + j], kept);
                a[(i * n) + j] = lanes_pick(here, kept, a[(i * n) + j]);
            }
            const lanes_t kept = b[k];
            b[k] = lanes_pick(here, b[i], kept);
            b[i] = lanes_pick(here, kept, b[i]);
        }
        inverse[k] = ONE / a[(k * n) + k];
        nonfinite += a[(k * n) + k] - a[(k * n) + k];
        for (size_t i = k + 1U; i < n; i++) {
            const lanes_t factor = a[(i * n) + k] * inverse[k];
            for (size_t j = k + 1U; j < n; j++) {
                a[(i * n) + j] -= factor * a[(k * n) + j];
            }
            b[i] -= factor * b[k];
        }
    }
    for (size_t k = n; k > 0U; k--) {
        lanes_t sum = b[k - 1U];
        for (size_t j = k; j < n; j++) {
            sum -= a[((k - 1U) * n) + j] * b[j];
        }
        b[k - 1U] = sum * inverse[k - 1U];
        nonfinite += b[k - 1U] - b[k - 1U];
    }
    return nonfinite < ONE;
}

#include "pen_lanes_net.h"
#include "pen_lanes_fold.h"

#endif
