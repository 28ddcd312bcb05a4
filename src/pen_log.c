/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * x = 2^k (1 + f) with 1 + f from sqrt(1/2) to sqrt(2), s = f / (2 + f), z = s^2:
 *
 *     log(1 + f) = log((1 + s)/(1 - s)) = 2 s + s z P(z) = f - (h - s (h + z P(z))),   h = f^2 / 2
 *
 * and k log(2) is added in two parts, of which k times the first is exact. f is exact. Error in ulp: 1/2 of the last sum, and
 * at k = -1, where the sum is as small as half of f, 1/4 of the one before.
 *
 * The polynomial, its error and the constants come from test/accuracy/elementary_coefficients.py.
 */
#include "penode/pen_exact.h"

#include "penode/pen_elementary.h"

#include <stdbool.h>
#include <stdint.h>

#include "penode/pen_math.h"
#include "penode/pen_parts.h"

#define ZERO ((pen_real_t)0)
#define HALF ((pen_real_t)0.5)
#define ONE  ((pen_real_t)1)
#define TWO  ((pen_real_t)2)

#ifdef PEN_REAL_DOUBLE

#define LOG_2_HIGH 0.6931471805598903
#define LOG_2_LOW  5.497923018708371e-14
#define ROOT_2     UINT64_C(0x16a09e667f3bcd) /* sqrt(2) as a significand */
#define UNIT       0x1p-52                    /* of a significand */

/* clang-format off */ /* as test/accuracy/elementary_coefficients.py prints them */
/* log((1 + s)/(1 - s)) = 2 s + s z P(z), z = s^2; relative error 0.013 * 2^-53 */
static pen_real_t log_tail(pen_real_t z)
{
    return 0.6666666666666734 + (z * (0.3999999999941636 + (z * (0.28571428742016036 + (z * (0.22222198610804886 +
           (z * (0.18183562404338233 + (z * (0.1531409879307027 + (z * 0.147954764673815)))))))))));
}
/* clang-format on */
#else

#define LOG_2_HIGH 0.69314575F
#define LOG_2_LOW  1.4286068e-06F
#define ROOT_2     UINT32_C(0xb504f3) /* sqrt(2) as a significand */
#define UNIT       0x1p-23F           /* of a significand */

/* log((1 + s)/(1 - s)) = 2 s + s z P(z), z = s^2; relative error 0.014 * 2^-24 */
static pen_real_t log_tail(pen_real_t z)
{
    return 0.66666776F + (z * (0.39977577F + (z * 0.29870906F)));
}

#endif

/* What x is if it has no logarithm: NaN below 0, -Inf at 0, infinity and NaN themselves. */
static pen_real_t without(pen_real_t x)
{
    const pen_real_t at_zero = pen_where(x > ZERO, x, x - ONE); /* NaN stays */
    const pen_real_t share = pen_where(x < ZERO, ZERO, at_zero);
    const volatile pen_real_t most = PEN_REAL_MAX;

    return share * (most + most); /* times infinity: 0 gives NaN */
}

pen_real_t pen_log(pen_real_t x)
{
    const pen_parts_t parts = pen_parts(x);
    const bool upper = parts.significand > ROOT_2;
    const pen_real_t lift = pen_where(parts.lifted, (pen_real_t)PEN_PARTS_LIFT_BITS, ZERO);
    const pen_real_t whole = ((pen_real_t)parts.exponent - (pen_real_t)PEN_PARTS_BIAS) - lift;
    const pen_real_t k = whole + pen_where(upper, ONE, ZERO);
    const pen_real_t f = (pen_parts_real(parts.significand) * pen_where(upper, HALF * UNIT, UNIT)) - ONE;
    const pen_real_t s = f / (TWO + f);
    const pen_real_t z = s * s;
    const pen_real_t h = HALF * (f * f);
    const pen_real_t bend = (s * (h + (z * log_tail(z)))) + (k * LOG_2_LOW);
    const pen_real_t value = (k * LOG_2_HIGH) - ((h - bend) - f);
    const pen_real_t other = without(x);

    return pen_where(x > ZERO, pen_where(x <= PEN_REAL_MAX, value, other), other);
}
