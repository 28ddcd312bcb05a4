/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * Elementary functions with the same bits on every target. No libm.
 *
 * Any argument is allowed; NaN gives NaN. Largest error in ulp, the distance of neighbouring numbers at the exact value
 * (correct rounding: 0.5): in float over all 2^32 arguments, where each function is also monotone; in double over some
 * 10^7 arguments (test/accuracy/ measures both):
 *
 *                    float   double   instructions on a Cortex-M4F, -O2 / -Os
 *   pen_exp           0.98     0.92    60 /  61
 *   pen_tanh          1.20     1.15   113 /  98
 *   pen_sigmoid       1.71     1.61    75 /  65
 *   pen_softplus      1.72     1.59   135 / 114
 *
 * No branch depends on the argument, so the count is the same for every one (soft float libraries do branch). Together
 * 0.9 KB of code and constants at -Os, no RAM.
 *
 * "Every target" means IEEE 754 arithmetic with subnormal numbers. The software double of GCC's libgcc for Arm is not
 * that: a subtraction from a power of two may be 1 ulp off. So the double build is the same bits only where doubles are
 * computed by hardware (x86-64, Cortex-M7 with fpv5-d16, Cortex-M55); the float build everywhere.
 */
#ifndef PEN_MATH_H
#define PEN_MATH_H

#include <stdbool.h>
#include <stddef.h>

#include "penode/pen_port.h"
#include "penode/pen_real.h"

#ifdef __cplusplus
extern "C" {
#endif

pen_real_t pen_exp(pen_real_t x);      /* e^x; +Inf above log(PEN_REAL_MAX), gradual underflow to 0 below            */
pen_real_t pen_tanh(pen_real_t x);     /* odd: pen_tanh(-x) == -pen_tanh(x)                                          */
pen_real_t pen_sigmoid(pen_real_t x);  /* 1 / (1 + e^-x)                                                             */
pen_real_t pen_softplus(pen_real_t x); /* log(1 + e^x); never overflows for finite x                                 */

/**
 * True if all n values are finite. No branch on the data: 0 * v is NaN for NaN and Inf alike, and NaN stays in the sum.
 * Cost: one multiplication and one addition a value.
 */
static inline bool pen_finite(size_t n, const pen_real_t value[])
{
    pen_real_t sum = (pen_real_t)0;
    PEN_PORT_UNROLL
    for (size_t i = 0U; i < n; i++) {
        sum += (pen_real_t)0 * value[i];
    }
    return sum >= (pen_real_t)0; /* false for NaN; -0 >= 0 is true */
}

/** `yes` or `no`, both evaluated; selected through memory, so that no compiler branches around the unused one. */
static inline pen_real_t pen_where(bool condition, pen_real_t yes, pen_real_t no)
{
    const pen_real_t both[2] = { no, yes };

    return both[condition ? 1U : 0U];
}

/** The larger one; NaN for NaN, and where the result would hide an Inf. */
static inline pen_real_t pen_max(pen_real_t a, pen_real_t b)
{
    return pen_where(a > b, a, b) + ((pen_real_t)0 * (a + b));
}

/** The smaller one; NaN as pen_max. */
static inline pen_real_t pen_min(pen_real_t a, pen_real_t b)
{
    return pen_where(a < b, a, b) + ((pen_real_t)0 * (a + b));
}

/** -1, 0 or 1 */
static inline pen_real_t pen_sign(pen_real_t x)
{
    const pen_real_t above = pen_where(x > (pen_real_t)0, (pen_real_t)1, (pen_real_t)0);
    const pen_real_t below = pen_where(x < (pen_real_t)0, (pen_real_t)1, (pen_real_t)0);

    return (above - below) + ((pen_real_t)0 * x);
}

/** 0 below and at zero, 1 above: the slope of pen_max(x, 0) */
static inline pen_real_t pen_heaviside(pen_real_t x)
{
    return pen_where(x > (pen_real_t)0, (pen_real_t)1, (pen_real_t)0) + ((pen_real_t)0 * x);
}

#ifdef __cplusplus
}
#endif

#endif
