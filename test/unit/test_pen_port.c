/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* The functions of the port in use: values only. Their order is tested in test/cmock and test/prove. */

#include <math.h>
#include <stddef.h>
#include <stdint.h>

#include "penode/pen_port.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

void test_a_word_comes_back_and_its_neighbours_stay(void)
{
    static const uint32_t values[] = { 0U, 1U, 0x80000000U, 0xffffffffU, 0x01020304U };
    volatile uint32_t word[3] = { 0x55555555U, 0U, 0xaaaaaaaaU };

    for (size_t i = 0U; i < (sizeof(values) / sizeof(values[0])); i++) {
        pen_port_store(&word[1], values[i]);
        pen_port_barrier();
        TEST_ASSERT_EQUAL_HEX32(values[i], pen_port_load(&word[1]));
    }
    TEST_ASSERT_EQUAL_HEX32(0x55555555U, word[0]);
    TEST_ASSERT_EQUAL_HEX32(0xaaaaaaaaU, word[2]);
}

void test_abs_is_exact_and_without_a_sign(void)
{
    static const pen_real_t size[] = { (pen_real_t)1, PEN_REAL_MIN, PEN_REAL_MAX, PEN_REAL_MIN * PEN_REAL_EPSILON };

    for (size_t i = 0U; i < (sizeof(size) / sizeof(size[0])); i++) {
        TEST_ASSERT_TRUE(pen_port_abs(size[i]) == size[i]);
        TEST_ASSERT_TRUE(pen_port_abs(-size[i]) == size[i]);
    }
    TEST_ASSERT_TRUE(pen_port_abs(-(pen_real_t)INFINITY) > PEN_REAL_MAX);
    TEST_ASSERT_TRUE(((pen_real_t)1 / pen_port_abs(-(pen_real_t)0)) > (pen_real_t)0);
}

void test_abs_of_nan_is_nan(void)
{
    const pen_real_t nan = pen_port_abs((pen_real_t)NAN);
    const pen_real_t negative = pen_port_abs(-(pen_real_t)NAN);

    TEST_ASSERT_TRUE(nan != nan);
    TEST_ASSERT_TRUE(negative != negative);
}

void test_cycles_go_on_or_stand_at_zero(void)
{
    const uint32_t before = pen_port_cycles();

    for (volatile uint32_t k = 0U; k < 1000U; k++) {
        /* some time */
    }
    if (before == 0U) {
        TEST_ASSERT_TRUE(pen_port_cycles() < 0x80000000U);
    } else {
        TEST_ASSERT_TRUE((pen_port_cycles() - before - 1U) < 0x7fffffffU);
    }
}
