/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * x = n pi/2 + r with the whole number n nearest to x / (pi/2), |r| <= pi/4 and a little. pi/2 is a sum of parts so short that
 * n times each of them is exact for all n up to 5215 (13 bits), but for the last. As long as r is large, x minus the first
 * product is exact too, because both are multiples of the last bit of x or of the part; where r is small, all differences are
 * exact. What rounding leaves of a later difference is kept (`less`), so r - less is the rest to some 2^-60, and no float up
 * to 8192 is nearer to a multiple of pi/2 than 2^-30: relative to r the reduction is exact to far below an ulp.
 *
 * Then one polynomial each for sine and cosine of r, both evaluated, and the quadrant n mod 4 picks one of them and its sign.
 * n has the sign of x, so each operation is the mirror image of that for -x.
 *
 * The polynomials, their errors and the constants come from test/accuracy/elementary_coefficients.py. Error of the sine, in
 * ulp: 1/2 of the last sum, 0.15 of the polynomial, 0.1 of what is added, 0.15 of leaving out that the slope at r is not 1.
 * Of the cosine: 1/2 of the last sum, and 0.3 of what is added.
 */
#include "penode/pen_exact.h"

#include "penode/pen_elementary.h"

#include <stdbool.h>
#include <stdint.h>

#include "penode/pen_math.h"
#include "penode/pen_port.h"

#define ZERO ((pen_real_t)0)
#define HALF ((pen_real_t)0.5)
#define ONE  ((pen_real_t)1)

/* The angle is r - less. */
typedef struct {
    pen_real_t r;
    pen_real_t less;
} angle_t;

/* a - b with what rounding leaves of it (Knuth) */
static angle_t difference(pen_real_t a, pen_real_t b)
{
    angle_t d;

    d.r = a - b;
    const pen_real_t taken = d.r - a; /* -b, rounded */
    d.less = (b + taken) - (a - (d.r - taken));
    return d;
}

#ifdef PEN_REAL_DOUBLE

#define RIGHT_ANGLE_1 1.5707963267941523
#define RIGHT_ANGLE_2 7.443547480488527e-13
#define RIGHT_ANGLE_3 -1.9034889620193266e-25
#define TWO_BY_PI     0.6366197723675814

/* clang-format off */ /* as test/accuracy/elementary_coefficients.py prints them */
/* sin(r) = r + r z P(z), z = r^2; relative error 0.063 * 2^-53 */
static pen_real_t sin_tail(pen_real_t z)
{
    return -0.1666666666666663 + (z * (0.008333333333321955 + (z * (-0.00019841269829453035 + (z * (2.7557313572349685e-06 +
           (z * (-2.5050739837089412e-08 + (z * 1.5895757124752342e-10)))))))));
}

/* cos(r) = 1 - z/2 + z^2 P(z), z = r^2; relative error 0.016 * 2^-53 */
static pen_real_t cos_tail(pen_real_t z)
{
    return 0.041666666666666595 + (z * (-0.0013888888888872822 + (z * (2.4801587288700546e-05 + (z * (-2.755731413448845e-07 +
           (z * (2.0875694603749284e-09 + (z * -1.135820622186774e-11)))))))));
}
/* clang-format on */

/* x - n pi/2 */
static angle_t rest_of(pen_real_t x, pen_real_t n)
{
    const angle_t d = difference(x - (n * RIGHT_ANGLE_1), n * RIGHT_ANGLE_2);
    const pen_real_t less = d.less + (n * RIGHT_ANGLE_3);
    angle_t rest;

    rest.r = d.r - less;
    rest.less = (rest.r - d.r) + less;
    return rest;
}

#else

#define RIGHT_ANGLE_1 1.5703125F
#define RIGHT_ANGLE_2 0.0004837513F
#define RIGHT_ANGLE_3 7.5495336e-08F
#define RIGHT_ANGLE_4 2.563283e-12F
#define RIGHT_ANGLE_5 6.123234e-17F
#define TWO_BY_PI     0.63661975F

/* sin(r) = r + r z P(z), z = r^2; relative error 0.15 * 2^-24 */
static pen_real_t sin_tail(pen_real_t z)
{
    return -0.16666655F + (z * (0.008332154F + (z * -0.00019514316F)));
}

/* cos(r) = 1 - z/2 + z^2 P(z), z = r^2; relative error 0.0027 * 2^-24 */
static pen_real_t cos_tail(pen_real_t z)
{
    return 0.041666646F + (z * (-0.0013887307F + (z * 2.4432149e-05F)));
}

/* x - n pi/2 */
static angle_t rest_of(pen_real_t x, pen_real_t n)
{
    const angle_t c = difference((x - (n * RIGHT_ANGLE_1)) - (n * RIGHT_ANGLE_2), n * RIGHT_ANGLE_3);
    const angle_t d = difference(c.r, n * RIGHT_ANGLE_4);
    const pen_real_t less = (c.less + d.less) + (n * RIGHT_ANGLE_5);
    angle_t rest;

    rest.r = d.r - less;
    rest.less = (rest.r - d.r) + less;
    return rest;
}

#endif

/* sin(x + turn pi/2) */
static pen_real_t sine(pen_real_t x, uint32_t turn)
{
    const bool inside = pen_port_abs(x) <= PEN_ANGLE_MAX; /* false for NaN */
    const pen_real_t c = pen_where(inside, x, ZERO);
    const pen_real_t shifted = (pen_port_abs(c) * TWO_BY_PI) + HALF;
    const uint32_t k = (uint32_t)shifted;
    const uint32_t turns[2] = { k, 0U - k };
    const pen_real_t size = (pen_real_t)k;
    const angle_t a = rest_of(c, pen_where(c < ZERO, ZERO - size, size));
    const pen_real_t z = a.r * a.r;
    const pen_real_t s = a.r - (a.less - (a.r * (z * sin_tail(z))));
    const pen_real_t half = HALF * z;
    const pen_real_t w = ONE - half;
    const pen_real_t t = w + (((ONE - w) - half) + (((z * z) * cos_tail(z)) + (a.r * a.less)));
    const pen_real_t quadrant[4] = { s, t, -s, -t };
    const pen_real_t beyond = pen_where(inside, ZERO, PEN_REAL_MAX);
    const uint32_t q = turns[(c < ZERO) ? 1U : 0U] + turn;

    return quadrant[q & 3U] - (ZERO * (beyond * beyond)); /* 0 times infinity */
}

pen_real_t pen_sin(pen_real_t x)
{
    return sine(x, 0U);
}

pen_real_t pen_cos(pen_real_t x)
{
    return sine(x, 1U);
}
