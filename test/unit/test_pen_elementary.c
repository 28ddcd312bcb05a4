/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * The error over all floats is checked on the host (make accuracy). Here: special values, identities that hold to the bit, and
 * a hash that shows that every target computes the very same bits.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "penode/pen_elementary.h"
#include "unity.h"

#define SAMPLES UINT32_C(20000) /* of each of the two kinds in sample() */
#define WIDEST  100.0

#include "bits_fixture.inc"

#ifdef PEN_REAL_DOUBLE
#define HASHES { 0x2f1ce6edU, 0x633e0482U, 0x1052d733U, 0x104341f4U, 0x2824eb93U }
#else
#define HASHES { 0x98d21f59U, 0x416aa5ebU, 0x4cc35ecdU, 0x5c64afb2U, 0xe3c6cb88U }
#endif

#define FUNCTIONS 5U
#define ZERO      ((pen_real_t)0)
#define ONE       ((pen_real_t)1)

static const function_t FUNCTION[FUNCTIONS] = { pen_sin, pen_cos, pen_atan, pen_log, pen_sqrt };

void setUp(void) {}
void tearDown(void) {}

void test_results_are_the_same_bits_on_every_target(void)
{
    static const uint32_t expected[FUNCTIONS] = HASHES;
    for (size_t f = 0U; f < FUNCTIONS; f++) {
        TEST_ASSERT_EQUAL_HEX32(expected[f], hash_of(FUNCTION[f]));
    }
}

void test_sine_and_arctangent_are_odd_and_cosine_is_even_to_the_bit(void)
{
    for (uint32_t i = 0U; i < 2000U; i++) {
        const pen_real_t x = sample(i);
        if ((pen_sin(x) <= ONE) && (pen_sin(x) >= -ONE)) { /* no NaN */
            expect_bits(-pen_sin(x), pen_sin(-x));
            expect_bits(pen_cos(x), pen_cos(-x));
            expect_bits(-pen_atan(x), pen_atan(-x));
        }
    }
}

void test_zero_keeps_its_sign(void)
{
    static const size_t odd[3] = { 0U, 2U, 4U }; /* sin, atan, sqrt */
    for (size_t i = 0U; i < 3U; i++) {
        expect_bits(real_of(0U), FUNCTION[odd[i]](real_of(0U)));
        expect_bits(real_of(SIGN), FUNCTION[odd[i]](real_of(SIGN)));
    }
    expect_bits(ONE, pen_cos(real_of(SIGN)));
    expect_bits(real_of(0U), pen_log(ONE));
    expect_bits(-real_of(INFINITE), pen_log(real_of(0U)));
    expect_bits(-real_of(INFINITE), pen_log(real_of(SIGN)));
}

void test_subnormal_numbers_are_numbers(void)
{
    const pen_real_t least = real_of(1U);
    expect_bits(least, pen_sin(least));
    expect_bits(-least, pen_atan(-least));
    expect_bits(ONE, pen_cos(least));
#ifdef PEN_REAL_DOUBLE
    expect_bits(0x1p-537, pen_sqrt(least));
    expect_bits(-744.4400719213812, pen_log(least)); /* -1074 log(2) */
#else
    expect_bits(0x1.6a09e6p-75F, pen_sqrt(least)); /* sqrt(2^-149) */
    expect_bits(-103.27893F, pen_log(least));      /* -149 log(2) */
#endif
}

void test_angles_end_at_their_limit(void)
{
    const bits_t last = bits_of(PEN_ANGLE_MAX);
    for (size_t f = 0U; f < 2U; f++) {
        TEST_ASSERT_FALSE(is_nan(FUNCTION[f](PEN_ANGLE_MAX)));
        TEST_ASSERT_FALSE(is_nan(FUNCTION[f](-PEN_ANGLE_MAX)));
        TEST_ASSERT_TRUE(is_nan(FUNCTION[f](real_of(last + 1U))));
        TEST_ASSERT_TRUE(is_nan(FUNCTION[f](real_of(SIGN | (last + 1U)))));
        TEST_ASSERT_TRUE(is_nan(FUNCTION[f](PEN_REAL_MAX)));
    }
}

void test_nothing_that_is_no_number_is_hidden(void)
{
    const pen_real_t infinity = real_of(INFINITE);
    const bits_t quiet = INFINITE | (INFINITE >> 1U);
    for (size_t f = 0U; f < FUNCTIONS; f++) {
        TEST_ASSERT_TRUE(is_nan(FUNCTION[f](real_of(quiet))));
        TEST_ASSERT_TRUE(is_nan(FUNCTION[f](real_of(quiet | SIGN))));
        TEST_ASSERT_TRUE(is_nan(FUNCTION[f](real_of(INFINITE + 1U)))); /* signalling */
        TEST_ASSERT_TRUE(is_nan(FUNCTION[f](-infinity)));
    }
    for (size_t f = 0U; f < 3U; f++) {
        TEST_ASSERT_TRUE(is_nan(FUNCTION[f](infinity)));
    }
    expect_bits(infinity, pen_log(infinity));
    expect_bits(infinity, pen_sqrt(infinity));
    for (size_t f = 3U; f < FUNCTIONS; f++) {
        TEST_ASSERT_TRUE(is_nan(FUNCTION[f](-real_of(1U))));
        TEST_ASSERT_TRUE(is_nan(FUNCTION[f](-ONE)));
        TEST_ASSERT_TRUE(is_nan(FUNCTION[f](-PEN_REAL_MAX)));
    }
}

/* The square of a number of half the bits is exact, so its root is that number. */
void test_roots_of_squares_are_exact(void)
{
    for (uint32_t i = 1U; i < 4096U; i++) {
        const pen_real_t x = (pen_real_t)i * (pen_real_t)0x1p-20;
        expect_bits(x, pen_sqrt(x * x));
    }
}

void test_arctangent_ends_at_a_right_angle(void)
{
    expect_bits((pen_real_t)1.5707963267948966, pen_atan(PEN_REAL_MAX));
    expect_bits(-(pen_real_t)1.5707963267948966, pen_atan(-PEN_REAL_MAX));
    expect_bits((pen_real_t)0.78539816339744831, pen_atan(ONE));
}
