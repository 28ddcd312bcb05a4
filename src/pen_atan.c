/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * atan(x) = offset + atan(t), for which of three ranges |x| lies in: t = x and 0 below tan(1/2), t = (x - 1) / (x + 1) and pi/4,
 * t = -1 / x and pi/2 above 1 / tan(1/2). All are evaluated with one division, its two sides picked from a table. Sides and
 * offset have the sign of x, so each operation is the mirror image of that for -x.
 *
 * From 1/2 on an ulp of the result is at least twice that of t in the middle range (|t| < 0.293), which takes up the rounding
 * of x + 1 and of the quotient: 0.19 + 0.25 ulp of the result, and 0.25 and 0.5 of the two sums.
 *
 * The polynomial, its error and the constants come from test/accuracy/elementary_coefficients.py.
 */
#include "penode/pen_exact.h"

#include "penode/pen_elementary.h"

#include <stddef.h>

#include "penode/pen_math.h"
#include "penode/pen_port.h"

#define ZERO       ((pen_real_t)0)
#define ONE        ((pen_real_t)1)
#define NEAR_ANGLE ((pen_real_t)0.5463) /* tan(1/2) */
#define FAR_ANGLE  ((pen_real_t)1.8304) /* and 1 by it */

#ifdef PEN_REAL_DOUBLE

#define HALF_PI_HIGH    1.5707963267948966
#define HALF_PI_LOW     6.123233995736766e-17
#define QUARTER_PI_HIGH 0.7853981633974483
#define QUARTER_PI_LOW  3.061616997868383e-17

/* clang-format off */ /* as test/accuracy/elementary_coefficients.py prints them */
/* atan(t) = t - t z P(z), z = t^2; relative error 0.042 * 2^-53 */
static pen_real_t atan_tail(pen_real_t z)
{
    return 0.3333333333333333 + (z * (-0.1999999999999973 + (z * (0.14285714285680806 + (z * (-0.11111111109019174 +
           (z * (0.09090909012915448 + (z * (-0.07692305793970378 + (z * (0.06666634781823635 + (z * (-0.05881969991376627 +
           (z * (0.05259794228830514 + (z * (-0.047400176274711776 + (z * (0.04241784571096471 + (z * (-0.0361810618718513 +
           (z * (0.026888148678514433 + (z * (-0.014769908557299096 + (z * 0.0042758966669498326)))))))))))))))))))))))))));
}
/* clang-format on */
#else

#define HALF_PI_HIGH    1.5707964F
#define HALF_PI_LOW     -4.371139e-08F
#define QUARTER_PI_HIGH 0.7853982F
#define QUARTER_PI_LOW  -2.1855694e-08F

/* atan(t) = t - t z P(z), z = t^2; relative error 0.041 * 2^-24 */
static pen_real_t atan_tail(pen_real_t z)
{
    return 0.33333316F + (z * (-0.1999891F + (z * (0.14261164F + (z * (-0.108522594F + (z * (0.076592214F + (z * -0.03432499F)))))))));
}

#endif

pen_real_t pen_atan(pen_real_t x)
{
    static const pen_real_t HIGH[3] = { ZERO, QUARTER_PI_HIGH, HALF_PI_HIGH };
    static const pen_real_t LOW[3] = { ZERO, QUARTER_PI_LOW, HALF_PI_LOW };
    const pen_real_t size = pen_port_abs(x);
    const pen_real_t sign = pen_where(x < ZERO, -ONE, ONE);
    const pen_real_t above[3] = { x, x - sign, -sign };
    const pen_real_t below[3] = { ONE, size + ONE, size };
    const size_t range = ((size > NEAR_ANGLE) ? (size_t)1 : (size_t)0) + ((size > FAR_ANGLE) ? (size_t)1 : (size_t)0);
    const pen_real_t t = above[range] / below[range];
    const pen_real_t z = t * t;
    const pen_real_t bend = ZERO - (z * atan_tail(z)); /* +0 at 0: the sums keep the sign of -0 */
    const pen_real_t low = ZERO - (sign * LOW[range]);
    const pen_real_t high = ZERO - (sign * HIGH[range]);

    return ((t + ((t * bend) - low)) - high) + (ZERO * x); /* infinity is not hidden */
}
