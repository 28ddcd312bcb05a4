/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* The self-test of a model whose set `default` is not what it should be: linked in place of the sets of the model file. */

#include <stddef.h>
#include <stdint.h>

#include MODEL_HEADER

#include "unity.h"

static MODEL(t) model;
static pen_real_t value[MODEL_SIZE(SET_LENGTH)];

/* All zeros, with the checksum of that. */
const pen_set_t SET(default) = { { MODEL_SIZE(LAYOUT), MODEL_SIZE(SET_LENGTH), 1U, ZEROS }, value };
const pen_set_t SET(altered_friction) = { { MODEL_SIZE(LAYOUT), MODEL_SIZE(SET_LENGTH), 2U, ZEROS }, value };

void setUp(void)
{
    value[4] = (pen_real_t)0;
}

void tearDown(void) {}

void test_other_values(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_SELFTEST_ANSWER, MODEL(selftest)(&model));
}

void test_a_set_that_is_refused(void)
{
    value[4] = (pen_real_t)1;
    TEST_ASSERT_EQUAL_HEX32(PEN_SELFTEST_SET, MODEL(selftest)(&model));
    TEST_ASSERT_EQUAL_HEX32(PEN_SELFTEST_BADARG, MODEL(selftest)(NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_SELFTEST_REAL, MODEL(selftest_of)(&model, PEN_SELFTEST_TYPE ^ 1U));
}
