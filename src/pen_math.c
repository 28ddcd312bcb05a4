/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * Every function rests on e^x = 2^n (1 + p): n is the whole number nearest to x / log(2), r = x - n log(2) is what
 * remains, p = e^r - 1 comes from a polynomial. Only + - * / and exact conversions are used, so every IEEE 754 machine
 * gives the same bits. Ranges are chosen by selection among computed values, never by a branch.
 *
 * 2^n is built from numbers that the type holds exactly: 2^n = low * high, low = 2^(k mod 32) from an integer shift,
 * high from a short table, k = n + bias. (1 + p) * low is exact, so the last multiplication rounds once: to a normal or
 * a subnormal number, to 0 or to infinity, whichever is right.
 *
 * The polynomials, their errors and the constants come from test/accuracy/coefficients.py.
 */
#include "penode/pen_exact.h"

#include "penode/pen_math.h"

#include <stdint.h>

#include "penode/pen_port.h"

#define ZERO      ((pen_real_t)0)
#define HALF      ((pen_real_t)0.5)
#define ONE       ((pen_real_t)1)
#define TWO       ((pen_real_t)2)
#define TANH_NEAR ((pen_real_t)0.625) /* below: the polynomial */

/* Where e^x is evaluated. Volatile, because a compiler that knows a limit likes to branch around what follows. */
typedef struct {
    volatile pen_real_t low;
    volatile pen_real_t high;
    volatile pen_real_t zero;
} range_t;

#ifdef PEN_REAL_DOUBLE

#define BIAS          1074.0 /* 2^-1074 is the smallest number of the type */
#define LOG2_E        1.4426950408889634
#define LN2           0.6931471805599453
#define LN2_HIGH      0.6931471805598903 /* 42 bits: n * LN2_HIGH is exact */
#define LN2_LOW       5.497923018708371e-14
#define EXP_LOW       -746.0  /* e^x rounds to 0 from here down       */
#define EXP_HIGH      710.5   /* e^x rounds to infinity from here up  */
#define SIGMOID_LOW   -40.0   /* 1 + e^x rounds to 1 from here down   */
#define TANH_HIGH     40.0    /* tanh(x / 2) rounds to 1 from here up */
#define SIGMOID_SCALE 0x1p-64 /* keeps 1 + e^x in range wherever the quotient is above 0 */
#define SIGMOID_BIAS  (BIAS - 64.0)

static pen_real_t power_high(uint32_t k) /* 2^(k - k mod 256 - BIAS) */
{
    static const pen_real_t POWER[9] = { 0x1p-1074, 0x1p-818, 0x1p-562, 0x1p-306, 0x1p-50, 0x1p206, 0x1p462, 0x1p718, 0x1p974 };

    return POWER[k >> 8U];
}

static pen_real_t power_low(uint32_t k) /* 2^(k mod 256) */
{
    static const pen_real_t MIDDLE[8] = { 0x1p0, 0x1p32, 0x1p64, 0x1p96, 0x1p128, 0x1p160, 0x1p192, 0x1p224 };
    const uint32_t shifted = UINT32_C(1) << (k & 31U);

    return (pen_real_t)shifted * MIDDLE[(k >> 5U) & 7U];
}

/* clang-format off */ /* as test/accuracy/coefficients.py prints them */
/* e^r = 1 + r + r^2 P(r); relative error 0.0067 * 2^-53 */
static pen_real_t expm1_tail(pen_real_t r)
{
    return 0.5 + (r * (0.16666666666666682 + (r * (0.041666666666666095 + (r * (0.008333333333317032 + (r * (0.0013888888889114991 +
           (r * (0.00019841269896386885 + (r * (2.480158692750757e-05 + (r * (2.755723485954443e-06 + (r * (2.7557581282573863e-07 +
           (r * (2.5112037509909843e-08 + (r * 2.082676814174302e-09)))))))))))))))))));
}

/* tanh(x) = x - x z P(z), z = x^2; relative error 0.12 * 2^-53 */
static pen_real_t tanh_tail(pen_real_t z)
{
    return 0.33333333333332854 + (z * (-0.13333333333262098 + (z * (0.05396825393127061 + (z * (-0.02186948757614324 +
           (z * (0.008863221003104155 + (z * (-0.0035919891767519415 + (z * (0.0014549588900635909 + (z * (-0.0005863165733756665 +
           (z * (0.00022856426912142304 + (z * (-7.714442580121259e-05 + (z * 1.6072596278844078e-05)))))))))))))))))));
}

/* softplus(x) = log(2) + x/2 + z P(z), z = x^2; relative error 0.043 * 2^-53 */
static pen_real_t softplus_tail(pen_real_t z)
{
    return 0.125 + (z * (-0.005208333333333238 + (z * (0.0003472222222203724 + (z * (-2.635168648995422e-05 + (z * (2.135692137405735e-06 +
           (z * (-1.803226186049191e-07 + (z * (1.5659553771485343e-08 + (z * (-1.3869811515592502e-09 + (z * (1.2353516280036983e-10 +
           (z * (-1.0357182777278308e-11 + (z * 6.109447901174064e-13)))))))))))))))))));
}

/* log(1 + e) = e + e^2 P(e); relative error 0.095 * 2^-53 */
static pen_real_t log1p_tail(pen_real_t e)
{
    return -0.5 + (e * (0.3333333333333272 + (e * (-0.24999999999931094 + (e * (0.1999999999604232 + (e * (-0.16666666530519922 +
           (e * (0.14285711212839042 + (e * (-0.12499951829330479 + (e * (0.11110566663353447 + (e * (-0.0999545190600923 +
           (e * (0.0906237989589187 + (e * (-0.08197734535786168 + (e * (0.07202223010857473 + (e * (-0.057967567559433025 +
           (e * (0.038633535507900364 + (e * (-0.01814256789569002 + (e * 0.004333531766514295)))))))))))))))))))))))))))));
}
/* clang-format on */
#else

#define BIAS          149.0F /* 2^-149 is the smallest number of the type */
#define LOG2_E        1.442695F
#define LN2           0.6931472F
#define LN2_HIGH      0.69314575F /* 16 bits: n * LN2_HIGH is exact */
#define LN2_LOW       1.4286068e-06F
#define EXP_LOW       -104.0F  /* e^x rounds to 0 from here down       */
#define EXP_HIGH      89.0F    /* e^x rounds to infinity from here up  */
#define SIGMOID_LOW   -20.0F   /* 1 + e^x rounds to 1 from here down   */
#define TANH_HIGH     20.0F    /* tanh(x / 2) rounds to 1 from here up */
#define SIGMOID_SCALE 0x1p-32F /* keeps 1 + e^x in range wherever the quotient is above 0 */
#define SIGMOID_BIAS  (BIAS - 32.0F)

static pen_real_t power_high(uint32_t k) /* 2^(k - k mod 32 - BIAS) */
{
    static const pen_real_t POWER[9] = { 0x1p-149F, 0x1p-117F, 0x1p-85F, 0x1p-53F, 0x1p-21F, 0x1p11F, 0x1p43F, 0x1p75F, 0x1p107F };

    return POWER[k >> 5U];
}

static pen_real_t power_low(uint32_t k) /* 2^(k mod 32) */
{
    const uint32_t shifted = UINT32_C(1) << (k & 31U);

    return (pen_real_t)shifted;
}

/* e^r = 1 + r + r^2 P(r); relative error 0.063 * 2^-24 */
static pen_real_t expm1_tail(pen_real_t r)
{
    return 0.49999994F + (r * (0.16666521F + (r * (0.04166839F + (r * (0.0083687175F + (r * 0.001381455F)))))));
}

/* tanh(x) = x - x z P(z), z = x^2; relative error 0.18 * 2^-24 */
static pen_real_t tanh_tail(pen_real_t z)
{
    return 0.3333328F + (z * (-0.13331443F + (z * (0.053739727F + (z * (-0.020639114F + (z * 0.0057050097F)))))));
}

/* softplus(x) = log(2) + x/2 + z P(z), z = x^2; relative error 0.17 * 2^-24 */
static pen_real_t softplus_tail(pen_real_t z)
{
    return 0.12499999F + (z * (-0.0052082767F + (z * (0.00034697095F + (z * (-2.5853244e-05F + (z * 1.6702256e-06F)))))));
}

/* log(1 + e) = e + e^2 P(e); relative error 0.098 * 2^-24 */
static pen_real_t log1p_tail(pen_real_t e)
{
    return -0.4999999F +
           (e *
            (0.3333276F + (e * (-0.24986029F + (e * (0.19836731F + (e * (-0.1561845F + (e * (0.10384731F + (e * -0.039698943F)))))))))));
}

#endif

/* e^x = (1 + p) * low * high */
typedef struct {
    pen_real_t p;
    pen_real_t low;
    pen_real_t high;
} power_t;

/* e^x * 2^(bias - BIAS), with x limited to the range; NaN stays NaN, in p. */
static power_t power(pen_real_t x, const range_t *range, pen_real_t bias)
{
    const pen_real_t low = range->low;
    const pen_real_t high = range->high;
    const pen_real_t zero = range->zero;
    const pen_real_t above = (x < low) ? low : x; /* so written that NaN passes both limits */
    const pen_real_t c = (above > high) ? high : above;
    const pen_real_t shifted = (c * LOG2_E) + (bias + HALF);
    const pen_real_t whole = (shifted > zero) ? shifted : zero; /* no integer holds NaN: 0 instead */
    const uint32_t k = (uint32_t)whole;
    const pen_real_t n = (pen_real_t)k - bias;
    const pen_real_t r = (c - (n * LN2_HIGH)) - (n * LN2_LOW);
    power_t e;

    e.p = r + ((r * r) * expm1_tail(r));
    e.low = power_low(k);
    e.high = power_high(k);
    return e;
}

pen_real_t pen_exp(pen_real_t x)
{
    static const range_t RANGE = { EXP_LOW, EXP_HIGH, ZERO };
    const power_t e = power(x, &RANGE, BIAS);

    return ((ONE + e.p) * e.low) * e.high;
}

/* 1 / (1 + e^-x), scaled on both sides so that the denominator stays finite as long as the quotient is above 0. */
pen_real_t pen_sigmoid(pen_real_t x)
{
    static const range_t RANGE = { SIGMOID_LOW, -EXP_LOW, ZERO };
    const power_t e = power(-x, &RANGE, SIGMOID_BIAS);
    const pen_real_t scale = e.low * e.high;
    const pen_real_t sum = scale + SIGMOID_SCALE;
    const pen_real_t lost = SIGMOID_SCALE - (sum - scale); /* of the 1, if e^-x is too large for it */

    return SIGMOID_SCALE / (sum + ((scale * e.p) + lost));
}

/* Near 0 a polynomial; else 1 - 2 / (1 + e^2|x|), which is monotone because each of its operations is. */
pen_real_t pen_tanh(pen_real_t x)
{
    static const range_t RANGE = { ZERO, TANH_HIGH, ZERO };
    const pen_real_t size = pen_port_abs(x);
    const pen_real_t z = x * x;
    const pen_real_t bend = ZERO - (z * tanh_tail(z)); /* +0 at 0, so that the sum below keeps the sign of -0 */
    const pen_real_t inner = x + (x * bend);
    const power_t e = power(size + size, &RANGE, BIAS);
    const pen_real_t scale = e.low * e.high;
    const pen_real_t outer = ONE - (TWO / ((ONE + scale) + (scale * e.p)));
    const pen_real_t outer_signed = (x > ZERO) ? outer : -outer;

    return pen_where(size < TANH_NEAR, inner, outer_signed);
}

/* Near 0 a polynomial; else max(x, 0) + log(1 + e^-|x|). */
pen_real_t pen_softplus(pen_real_t x)
{
    static const range_t RANGE = { EXP_LOW, ZERO, ZERO };
    const pen_real_t size = pen_port_abs(x);
    const pen_real_t z = x * x;
    const pen_real_t inner = LN2 + ((HALF * x) + (z * softplus_tail(z)));
    const power_t w = power(-size, &RANGE, BIAS);
    const pen_real_t e = ((ONE + w.p) * w.low) * w.high;
    const pen_real_t zero = RANGE.zero;
    const pen_real_t ramp = (x > zero) ? x : zero;
    const pen_real_t outer = ramp + (e + ((e * e) * log1p_tail(e)));

    return pen_where(size < ONE, inner, outer);
}
