/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * Correctly rounded. x = m 2^(2 h) with m from 1 to 4 (1 and 4 excluded on one side): a polynomial for 1/sqrt(m), error 0.72 %,
 * and Newton's steps, each of which squares the error (times 3/2); then one step for the root itself, which leaves it less
 * than 1.5 ulp away: 1/2 of m - s^2, 1/2 of the sum, and the polynomial's error to the fourth power in float (to the
 * sixteenth in double). So the root as a whole number of units, s, is at most 1 away from the right one, and that is found
 * exactly: with M = m in units squared, s is the nearest if and only if
 *
 *     s^2 - s < M <= s^2 + s,    because (s -+ 1/2)^2 = s^2 -+ s + 1/4 and M is whole
 *
 * M - s^2 is smaller than 4 s, so it may be computed modulo the size of the word. A root never lies midway between two numbers.
 *
 * The polynomial and its error come from test/accuracy/elementary_coefficients.py.
 */
#include "penode/pen_exact.h"

#include "penode/pen_elementary.h"

#include <stdint.h>

#include "penode/pen_math.h"
#include "penode/pen_parts.h"

#define ZERO         ((pen_real_t)0)
#define HALF         ((pen_real_t)0.5)
#define ONE          ((pen_real_t)1)
#define THREE_HALVES ((pen_real_t)1.5)

#ifdef PEN_REAL_DOUBLE

#define UNIT      0x1p-52 /* of a root of 1 to 2, as a whole number */
#define LIFT_ROOT 0x1p-27 /* root of 1 / PEN_PARTS_LIFT */
#define STEPS     3U

static pen_word_t whole_of(pen_real_t s) /* s from 1 to 2 in units */
{
    const pen_real_t scaled = s * 0x1p20;
    const uint32_t high = (uint32_t)scaled;
    const pen_real_t rest = (scaled - (pen_real_t)high) * 0x1p32;
    const uint32_t low = (uint32_t)rest;

    return ((pen_word_t)high << 32U) + low;
}

static pen_real_t power_of(uint32_t half) /* 2^(half - 512) */
{
    static const pen_real_t HIGH[5] = { 0x1p-512, 0x1p-256, 0x1p0, 0x1p256, 0x1p512 };
    static const pen_real_t MIDDLE[8] = { 0x1p0, 0x1p32, 0x1p64, 0x1p96, 0x1p128, 0x1p160, 0x1p192, 0x1p224 };
    const uint32_t shifted = UINT32_C(1) << (half & 31U);

    return ((pen_real_t)shifted * MIDDLE[(half >> 5U) & 7U]) * HIGH[half >> 8U];
}

/* 1/sqrt(m) = P(m); relative error 6.3e+13 * 2^-53 */
static pen_real_t root_tail(pen_real_t m)
{
    return 1.5561924392527453 + (m * (-0.7388689692747334 + (m * (0.19468725488171343 + (m * -0.019050508312304947)))));
}

#else

#define UNIT      0x1p-23F /* of a root of 1 to 2, as a whole number */
#define LIFT_ROOT 0x1p-12F /* root of 1 / PEN_PARTS_LIFT */
#define STEPS     1U

static pen_word_t whole_of(pen_real_t s) /* s from 1 to 2 in units */
{
    const pen_real_t units = s * 0x1p23F;

    return (pen_word_t)units;
}

static pen_real_t power_of(uint32_t half) /* 2^(half - 64) */
{
    static const pen_real_t HIGH[5] = { 0x1p-64F, 0x1p-32F, 0x1p0F, 0x1p32F, 0x1p64F };
    const uint32_t shifted = UINT32_C(1) << (half & 31U);

    return (pen_real_t)shifted * HIGH[half >> 5U];
}

/* 1/sqrt(m) = P(m); relative error 1.2e+5 * 2^-24 */
static pen_real_t root_tail(pen_real_t m)
{
    return 1.5561924F + (m * (-0.73886895F + (m * (0.19468726F + (m * -0.019050509F)))));
}

#endif

pen_real_t pen_sqrt(pen_real_t x)
{
    const pen_parts_t parts = pen_parts(x);
    const uint32_t even = 1U - (parts.exponent & 1U); /* of the exponent with its bias, which is odd */
    const pen_real_t m = pen_parts_real(parts.significand) * pen_where(even > 0U, UNIT + UNIT, UNIT);
    const pen_word_t square = parts.significand << (PEN_PARTS_BITS + even); /* M, modulo the size of the word */
    pen_real_t y = root_tail(m);

    for (uint32_t i = 0U; i < STEPS; i++) {
        y = y * (THREE_HALVES - (((HALF * m) * y) * y));
    }
    const pen_real_t near = m * y;
    const pen_word_t s = whole_of(near + ((HALF * y) * (m - (near * near))));
    const pen_word_t rest = (square - (s * s)) + (4U * s); /* M - s^2 + 4 s, which is positive */
    const pen_word_t up = (rest > (5U * s)) ? 1U : 0U;
    const pen_word_t down = (rest <= (3U * s)) ? 1U : 0U;
    const pen_real_t root = pen_parts_real((s + up) - down) * UNIT;
    const pen_real_t scale = power_of((parts.exponent + 1U) >> 1U) * pen_where(parts.lifted, LIFT_ROOT, ONE);
    const pen_real_t beyond = pen_where(x < ZERO, PEN_REAL_MAX, ZERO);
    const pen_real_t other = x - (ZERO * (beyond * beyond)); /* NaN below 0: 0 times infinity */

    return pen_where(x > ZERO, pen_where(x <= PEN_REAL_MAX, root * scale, other), other);
}
