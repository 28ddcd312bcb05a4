/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "penode/pen_exact.h"

#include "penode/pen_selftest.h"

#include "penode/pen_math.h"
#include "penode/pen_net.h"
#include "penode/pen_solve.h"

#define ZERO ((pen_real_t)0)
#define HALF ((pen_real_t)0.5F)
#define ONE  ((pen_real_t)1)
#define EPS  PEN_REAL_EPSILON

#define WIDE      21U /* rows of a layer: a block of 16, of 4 and of 1 */
#define ARGUMENTS 8U
#define ORDER     3U /* of a linear system */

/* Of answer(), by penode_gen/emission/selftest.py. */
#ifdef PEN_REAL_DOUBLE
#define SOME   0x1.0c68612285642p-33 /* libgcc for Arm: the difference to 1 is 1 ulp too small */
#define REST   0x1.fffffffef397ap-1
#define ANSWER 0x3710667bU
#else
#define SOME   0x1.0c686p-9F
#define REST   0x1.fef398p-1F
#define ANSWER 0x9c423b29U
#endif

static bool same(pen_real_t a, pen_real_t b)
{
    return (a >= b) && (a <= b);
}

/* Everything below goes through volatile: else the compiler computes it, on another machine. */

static uint32_t flush(void)
{
    const volatile pen_real_t given[4] = { PEN_REAL_MIN, HALF, PEN_REAL_MIN * HALF, ONE / EPS };
    const volatile pen_real_t result = given[0] * given[1]; /* subnormal */
    const volatile pen_real_t normal = given[2] * given[3]; /* from a subnormal */

    uint32_t found = (result > ZERO) ? 0U : PEN_SELFTEST_FLUSH;

    found |= (normal > ZERO) ? 0U : PEN_SELFTEST_FLUSH;
    return found;
}

/* Ties to even, upwards and downwards, on both sides of zero; and a difference that a software double gets wrong. */
static uint32_t rounding(void)
{
    const volatile pen_real_t given[4] = { ONE, EPS * HALF, ONE + EPS, SOME };
    const pen_real_t one = given[0];
    const pen_real_t tie = given[1];
    const pen_real_t odd = given[2];
    const pen_real_t some = given[3];
    const bool even = same(one + tie, ONE) && same(-one - tie, -ONE);
    const bool next = same(odd + tie, ONE + (EPS + EPS)) && same(-odd - tie, -ONE - (EPS + EPS));
    uint32_t found = same(one - some, REST) ? 0U : PEN_SELFTEST_ROUNDING;

    found |= (even && next) ? 0U : PEN_SELFTEST_ROUNDING;
    return found;
}

/* n numbers from -1/2 on, below 1/2, of 24 bits: their products have to be rounded. */
static uint32_t fill(uint32_t number, size_t n, pen_real_t value[])
{
    uint32_t last = number;

    for (size_t i = 0U; i < n; i++) {
        last = pen_selftest_next(last);
        const uint32_t high = last >> 8U;
        value[i] = ((pen_real_t)high * (pen_real_t)0x1p-24F) - HALF;
    }
    return last;
}

/* from 1/256 */
static pen_real_t scaled(int16_t argument)
{
    return (pen_real_t)argument * (pen_real_t)0x1p-8F;
}

/* Hash over what functions, layers and a linear solve give. */
static uint32_t answer(void)
{
    /* In 1/256: where one rounding less in a function changes its result, in float or in double; and two more of tanh. */
    static const int16_t exp_argument[ARGUMENTS] = { -4865, -2019, 1831, 4169, -4528, -1319, 1377, 4362 };
    static const int16_t tanh_argument[ARGUMENTS] = { -141, 126, -300, 700, -132, 115, -180, 1000 };
    static const int16_t sigmoid_argument[ARGUMENTS] = { -3264, -1324, 101, 591, -2774, -1359, 252, 4000 };
    static const int16_t softplus_argument[ARGUMENTS] = { -2379, -395, 395, 411, -2571, -565, 257, 443 };
    pen_real_t w[3U * WIDE];
    pen_real_t x[5];
    pen_real_t y[WIDE];
    pen_real_t a[ORDER * ORDER];
    const volatile uint32_t seed = 1U;
    uint32_t number = seed;
    uint32_t hash = PEN_SELFTEST_SEED;

    for (size_t i = 0U; i < ARGUMENTS; i++) {
        const pen_real_t found[4] = { pen_exp(scaled(exp_argument[i])), pen_tanh(scaled(tanh_argument[i])),
                                      pen_sigmoid(scaled(sigmoid_argument[i])), pen_softplus(scaled(softplus_argument[i])) };
        hash = pen_selftest_hash(hash, 4U, found);
    }
    number = fill(number, 2U, x);
    number = fill(number, 3U * WIDE, w);
    pen_dense(WIDE, 2U, w, x, y);
    hash = pen_selftest_hash(hash, WIDE, y);
    pen_dense_relu(2U, WIDE, w, y, x);
    pen_dense(3U, WIDE - 1U, w, y, &x[2]); /* as many weights as the first layer has */
    hash = pen_selftest_hash(hash, 5U, x);
    (void)fill(number, ORDER * ORDER, a);
    hash ^= pen_solve(ORDER, a, y);
    return pen_selftest_hash(hash, ORDER, y);
}

uint32_t pen_selftest_hash(uint32_t hash, size_t n, const pen_real_t value[])
{
    const uint32_t one = 1U;
    const uint8_t *const low = (const uint8_t *)&one; /* 1: the low byte lies first */
    const uint8_t *const byte = (const uint8_t *)value;
    const size_t size = sizeof(pen_real_t);
    const size_t turn = ((size_t)1U - low[0]) * (size - 1U); /* 0, or what turns the bytes of a number round */
    uint32_t result = hash;

    for (size_t i = 0U; i < n; i++) {
        for (size_t b = 0U; b < size; b++) {
            result = (result ^ byte[(i * size) + (b ^ turn)]) * 0x01000193U; /* NOLINT(clang-analyzer-core*): turn is 0 or size - 1 */
        }
    }
    return result;
}

uint32_t pen_selftest_of(uint32_t type)
{
    uint32_t found = (flush() | rounding()) | pen_selftest_contracted();

    found |= (type == PEN_SELFTEST_TYPE) ? 0U : PEN_SELFTEST_REAL;
    found |= (answer() == ANSWER) ? 0U : PEN_SELFTEST_ANSWER;
    return found;
}
