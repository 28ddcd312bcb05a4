/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * The error bound over all floats and the monotonicity are checked on the host by test/accuracy/pen_math_accuracy.c.
 * Here: reference values, special values, and a hash that shows that every target computes the very same bits.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "penode/pen_math.h"
#include "unity.h"

#define SAMPLES UINT32_C(50000) /* of each of the two kinds in sample() */
#define WIDEST  20.0

#include "bits_fixture.inc"

#ifdef PEN_REAL_DOUBLE
#define HASHES     { 0x6f15dae5U, 0x2a235e75U, 0x7b4e2349U, 0x50a6789cU }
#define EXP_LAST   0x1.62e42fefa39efp+9 /* the largest x with e^x in range  */
#define EXP_OVER   0x1.62e42fefa39fp+9  /* its successor                    */
#define EXP_TINY   -744.75              /* e^x = 0.7 2^-1074                */
#define EXP_ZERO   -745.25              /* e^x = 0.4 2^-1074                */
#define TINY_EXP   -720.0               /* a subnormal result ...           */
#define TINY_VALUE 2.0322308024242932e-313
#else
#define HASHES     { 0x515812efU, 0x11ef4ebbU, 0xdcbf802bU, 0xffbd4786U }
#define EXP_LAST   0x1.62e42ep+6F
#define EXP_OVER   0x1.62e43p+6F
#define EXP_TINY   -103.75F /* e^x = 0.6 2^-149 */
#define EXP_ZERO   -104.25F /* e^x = 0.4 2^-149 */
#define TINY_EXP   -100.0F
#define TINY_VALUE 3.7200759760208361e-44
#endif

#define FUNCTIONS 4U
#define FAR       1000U

static const function_t FUNCTION[FUNCTIONS] = { pen_exp, pen_tanh, pen_sigmoid, pen_softplus };

/* Printed by test/accuracy/golden.py: x, e^x, tanh(x), 1 / (1 + e^-x), log(1 + e^x). */
static const double GOLDEN[][1U + FUNCTIONS] = {
    { -86.9375, 1.751957148810752785e-38, -1.0, 1.751957148810752785e-38, 1.751957148810752785e-38 },
    { -50.0, 1.928749847963917783e-22, -1.0, 1.928749847963917783e-22, 1.928749847963917783e-22 },
    { -25.25, 1.081594155728569231e-11, -1.0, 1.081594155716870772e-11, 1.081594155722720001e-11 },
    { -17.5, 2.510999155743981804e-8, -9.99999999999998739e-1, 2.510999092692815785e-8, 2.510999124218398531e-8 },
    { -16.625, 6.023573837886479029e-8, -9.999999999999927433e-1, 6.02357347505208308e-8, 6.023573656469277412e-8 },
    { -12.34375, 4.356898965953270539e-6, -9.999999999620348628e-1, 4.356879983467375788e-6, 4.356889474696539065e-6 },
    { -9.0, 1.234098040866795495e-4, -9.999999695400409745e-1, 1.233945759862317297e-4, 1.234021897232588164e-4 },
    { -8.8125, 1.488606387644698376e-4, -9.999999556810214354e-1, 1.488384825728813041e-4, 1.488495601190190093e-4 },
    { -5.0, 6.737946999085467097e-3, -9.999092042625951312e-1, 6.692850924284855559e-3, 6.715348489118068616e-3 },
    { -2.71875, 6.595714935553816859e-2, -9.913369959588720203e-1, 6.187598572364271835e-2, 6.387312733302286992e-2 },
    { -1.5, 2.231301601484298289e-1, -9.051482536448664382e-1, 1.824255238063563404e-1, 2.014132779827524095e-1 },
    { -1.2578125, 2.842751988422877102e-1, -8.504599141840772651e-1, 2.213506879978279749e-1, 2.50194511618946301e-1 },
    { -1.0, 3.678794411714423216e-1, -7.615941559557648881e-1, 2.689414213699951207e-1, 3.13261687518222834e-1 },
    { -0.9921875, 3.70764755388803704e-1, -7.582935350190586495e-1, 2.704802220302490866e-1, 3.153687997079207365e-1 },
    { -0.75, 4.723665527410147071e-1, -6.351489523872873192e-1, 3.208213008246070268e-1, 3.868710061148999437e-1 },
    { -0.625, 5.35261428518990242e-1, -5.54599722349382294e-1, 3.486451353339457564e-1, 4.287006782765186372e-1 },
    { -0.62109375, 5.373563825172994097e-1, -5.518891015366106036e-1, 3.495327359537941748e-1, 4.300643065907280569e-1 },
    { -0.5, 6.065306597126334236e-1, -4.621171572600097585e-1, 3.775406687981454354e-1, 4.740769841801066809e-1 },
    { -0.34765625, 7.063416394256195334e-1, -3.342953499741476245e-1, 4.1395088949677442e-1, 5.343516865971802615e-1 },
    { -0.3359375, 7.146677711559481612e-1, -3.238457516999883874e-1, 4.167966431620469824e-1, 5.392193424092725907e-1 },
    { -0.03125, 9.692332344763440818e-1, -3.123983144603125677e-2, 4.921881357207955674e-1, 6.776442459057149301e-1 },
    { -0.000244140625, 9.997558891748972165e-1, -2.441406201493617062e-4, 4.999389648440531649e-1, 6.930251176980258878e-1 },
    { -9.094947017729282e-13, 9.999999999990905053e-1, -9.094947017729282379e-13, 4.999999999997726263e-1, 6.931471805594905621e-1 },
    { 9.094947017729282e-13, 1.000000000000909495, 9.094947017729282379e-13, 5.000000000002273737e-1, 6.931471805604000568e-1 },
    { 0.000244140625, 1.000244170429747855, 2.441406201493617062e-4, 5.000610351559468351e-1, 6.932692583230258878e-1 },
    { 0.03125, 1.031743407499102671, 3.123983144603125677e-2, 5.078118642792044326e-1, 7.088942459057149301e-1 },
    { 0.3359375, 1.399251568854906836, 3.238457516999883874e-1, 5.832033568379530176e-1, 8.751568424092725907e-1 },
    { 0.34765625, 1.415745503568466618, 3.342953499741476245e-1, 5.8604911050322558e-1, 8.820079365971802615e-1 },
    { 0.5, 1.648721270700128147, 4.621171572600097585e-1, 6.224593312018545646e-1, 9.740769841801066809e-1 },
    { 0.62109375, 1.860962356705247564, 5.518891015366106036e-1, 6.504672640462058252e-1, 1.051158056590728057 },
    { 0.625, 1.868245957432222407, 5.54599722349382294e-1, 6.513548646660542436e-1, 1.053700678276518637 },
    { 0.75, 2.117000016612674669, 6.351489523872873192e-1, 6.791786991753929732e-1, 1.136871006114899944 },
    { 0.9921875, 2.697127991443918791, 7.582935350190586495e-1, 7.295197779697509134e-1, 1.307556299707920737 },
    { 1.0, 2.718281828459045235, 7.615941559557648881e-1, 7.310585786300048793e-1, 1.313261687518222834 },
    { 1.2578125, 3.517718056561055717, 8.504599141840772651e-1, 7.786493120021720251e-1, 1.508007011618946301 },
    { 1.5, 4.481689070338064823, 9.051482536448664382e-1, 8.175744761936436596e-1, 1.701413277982752409 },
    { 2.71875, 1.516135869683449016e+1, 9.913369959588720203e-1, 9.381240142763572817e-1, 2.78262312733302287 },
    { 5.0, 1.484131591025766034e+2, 9.999092042625951312e-1, 9.933071490757151444e-1, 5.006715348489118069 },
    { 8.8125, 6.717692523019595602e+3, 9.999999556810214354e-1, 9.998511615174271187e-1, 8.812648849560119019 },
    { 9.0, 8.103083927575384008e+3, 9.999999695400409745e-1, 9.998766054240137683e-1, 9.000123402189723259 },
    { 12.34375, 2.295210441679829843e+5, 9.999999999620348628e-1, 9.999956431200165326e-1, 1.23437543568894747e+1 },
    { 16.625, 1.660144005723477471e+7, 9.999999999999927433e-1, 9.999999397642652495e-1, 1.662500006023573656e+1 },
    { 17.5, 3.982478439757622502e+7, 9.99999999999998739e-1, 9.999999748900090731e-1, 1.750000002510999124e+1 },
    { 25.25, 9.245612087524577565e+10, 1.0, 9.999999999891840584e-1, 2.525000000001081594e+1 },
    { 50.0, 5.184705528587072464e+21, 1.0, 1.0, 5.0e+1 },
    { 86.9375, 5.707902163467928854e+37, 1.0, 1.0, 8.69375e+1 },
};

#define GOLDENS (sizeof GOLDEN / sizeof GOLDEN[0])

void setUp(void) {}
void tearDown(void) {}

/* How many numbers y is away from x; FAR if that is a lot, if the signs differ or if one is NaN. */
static uint32_t steps(pen_real_t x, pen_real_t y)
{
    const bits_t p = bits_of(x);
    const bits_t q = bits_of(y);
    const bits_t distance = (p > q) ? (p - q) : (q - p);
    return (is_nan(x) || is_nan(y) || (distance > FAR)) ? FAR : (uint32_t)distance;
}

/* The promise is 2 ulp from the exact value; the reference is rounded, 0.5; so 2.5, and steps are whole. */
void test_each_function_is_within_two_steps_of_the_reference(void)
{
    for (size_t i = 0U; i < GOLDENS; i++) {
        for (size_t f = 0U; f < FUNCTIONS; f++) {
            const pen_real_t y = FUNCTION[f]((pen_real_t)GOLDEN[i][0]);
            TEST_ASSERT_LESS_OR_EQUAL_UINT32(2U, steps((pen_real_t)GOLDEN[i][f + 1U], y));
        }
    }
}

void test_results_are_the_same_bits_on_every_target(void)
{
    static const uint32_t expected[FUNCTIONS] = HASHES;
    for (size_t f = 0U; f < FUNCTIONS; f++) {
        TEST_ASSERT_EQUAL_HEX32(expected[f], hash_of(FUNCTION[f]));
    }
}

void test_tanh_is_odd_to_the_bit(void)
{
    for (uint32_t i = 0U; i < 2000U; i++) {
        const pen_real_t x = sample(i);
        if (!is_nan(x)) {
            expect_bits(-pen_tanh(x), pen_tanh(-x));
        }
    }
    expect_bits(real_of(0U), pen_tanh(real_of(0U)));
    expect_bits(real_of(SIGN), pen_tanh(real_of(SIGN)));
}

void test_neighbours_never_fall(void)
{
    for (uint32_t i = 0U; i < 5000U; i++) {
        const bits_t bits = bits_of(sample(i)) & ~SIGN;
        if (bits < INFINITE) {
            for (size_t f = 0U; f < FUNCTIONS; f++) {
                TEST_ASSERT_TRUE(FUNCTION[f](real_of(bits + 1U)) >= FUNCTION[f](real_of(bits)));
                TEST_ASSERT_TRUE(FUNCTION[f](-real_of(bits)) >= FUNCTION[f](-real_of(bits + 1U)));
            }
        }
    }
}

void test_nan_gives_nan_whatever_its_bits(void)
{
    const bits_t quiet = INFINITE | (INFINITE >> 1U); /* and many of its payload bits */
    for (size_t f = 0U; f < FUNCTIONS; f++) {
        TEST_ASSERT_TRUE(is_nan(FUNCTION[f](real_of(quiet))));
        TEST_ASSERT_TRUE(is_nan(FUNCTION[f](real_of(quiet | SIGN))));
        TEST_ASSERT_TRUE(is_nan(FUNCTION[f](real_of(INFINITE + 1U)))); /* signalling */
        TEST_ASSERT_TRUE(is_nan(FUNCTION[f](real_of(SIGN | (INFINITE + 1U)))));
    }
}

void test_infinity_and_the_largest_number_give_the_limits(void)
{
    const pen_real_t zero = real_of(0U);
    const pen_real_t infinity = real_of(INFINITE);
    const pen_real_t ends[2] = { PEN_REAL_MAX, infinity };
    for (size_t i = 0U; i < 2U; i++) {
        expect_bits(infinity, pen_exp(ends[i]));
        expect_bits(zero, pen_exp(-ends[i]));
        expect_bits((pen_real_t)1, pen_tanh(ends[i]));
        expect_bits((pen_real_t)-1, pen_tanh(-ends[i]));
        expect_bits((pen_real_t)1, pen_sigmoid(ends[i]));
        expect_bits(zero, pen_sigmoid(-ends[i]));
        expect_bits(ends[i], pen_softplus(ends[i]));
        expect_bits(zero, pen_softplus(-ends[i]));
    }
}

void test_zero_and_subnormal_numbers_are_exact(void)
{
    const pen_real_t tiny[2] = { real_of(1U), real_of(INFINITE / 3U & 0xfffffU) }; /* subnormal in both types */
    expect_bits((pen_real_t)1, pen_exp(real_of(0U)));
    expect_bits((pen_real_t)1, pen_exp(real_of(SIGN)));
    expect_bits((pen_real_t)0.5, pen_sigmoid(real_of(SIGN)));
    for (size_t i = 0U; i < 2U; i++) {
        expect_bits((pen_real_t)1, pen_exp(tiny[i]));
        expect_bits(tiny[i], pen_tanh(tiny[i]));
        expect_bits(-tiny[i], pen_tanh(-tiny[i]));
        expect_bits((pen_real_t)0.5, pen_sigmoid(-tiny[i]));
        expect_bits((pen_real_t)0.69314718055994531, pen_softplus(tiny[i])); /* log 2 */
    }
}

void test_kinks_choose_and_hide_nothing(void)
{
    const pen_real_t two = (pen_real_t)2;
    const pen_real_t three = (pen_real_t)3;
    const pen_real_t one = (pen_real_t)1;
    const pen_real_t zero = real_of(0U);
    const pen_real_t bad[3] = { real_of(INFINITE), -real_of(INFINITE), real_of(INFINITE | 1U) };

    expect_bits(three, pen_max(two, three));
    expect_bits(three, pen_max(three, two));
    expect_bits(-three, pen_min(-three, two));
    expect_bits(-three, pen_min(two, -three));
    expect_bits(one, pen_sign(two));
    expect_bits(-one, pen_sign(-real_of(1U)));
    expect_bits(zero, pen_sign(zero));
    expect_bits(one, pen_heaviside(real_of(1U)));
    expect_bits(zero, pen_heaviside(zero));
    expect_bits(two, pen_where(true, two, bad[2])); /* what is not chosen does not matter */
    expect_bits(two, pen_where(false, bad[0], two));
    for (size_t i = 0U; i < 3U; i++) {
        TEST_ASSERT_TRUE(is_nan(pen_max(bad[i], two)));
        TEST_ASSERT_TRUE(is_nan(pen_min(two, bad[i])));
        TEST_ASSERT_TRUE(is_nan(pen_sign(bad[i])));
        TEST_ASSERT_TRUE(is_nan(pen_heaviside(bad[i])));
    }
}

void test_exp_overflows_and_underflows_where_e_to_the_x_does(void)
{
    TEST_ASSERT_TRUE(pen_exp(EXP_LAST) <= PEN_REAL_MAX);
    expect_bits(real_of(INFINITE), pen_exp(EXP_OVER));
    expect_bits(real_of(1U), pen_exp(EXP_TINY));
    expect_bits(real_of(0U), pen_exp(EXP_ZERO));
}

/* log(1 + e^x) and 1 / (1 + e^-x) differ from e^x by a factor of 1 + e^x, which is nothing at -100. */
void test_tails_follow_exp_down_to_subnormal_numbers(void)
{
    const pen_real_t tiny = (pen_real_t)TINY_VALUE;
    TEST_ASSERT_LESS_OR_EQUAL_UINT32(1U, steps(tiny, pen_exp(TINY_EXP)));
    TEST_ASSERT_LESS_OR_EQUAL_UINT32(1U, steps(tiny, pen_sigmoid(TINY_EXP)));
    TEST_ASSERT_LESS_OR_EQUAL_UINT32(1U, steps(tiny, pen_softplus(TINY_EXP)));
    expect_bits(real_of(1U), pen_sigmoid(EXP_TINY));
    expect_bits(real_of(1U), pen_softplus(EXP_TINY));
}
