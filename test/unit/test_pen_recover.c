/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include <stddef.h>
#include <stdint.h>

#include "penode/pen_saved.h"
#include "penode/pen_serial.h"
#include "unity.h"

#include "saved_fixture.inc"

void setUp(void)
{
    fill(&first, first_value, 1U);
    fill(&other, other_value, 2U);
    fill(&foreign, foreign_value, 3U);
    start(&a, &first, true);
}

void tearDown(void) {}

/* What a model with on_damage = "rollback" does, from rank 0 on. */
static pen_status_t verify_and_recover(void)
{
    const pen_status_t status = pen_verify(&model, &a.head, NULL, N);

    if (status == PEN_SET_DAMAGED) {
        pen_set_t ready;
        pen_status_t found = pen_fallback(&model, &a.head, 0U, &ready);
        if (found != PEN_OK) {
            found = pen_fallback(&model, &a.head, 1U, &ready);
        }
        pen_recover(&model, &a.head, NULL, &ready, found);
    }
    return status;
}

/* Each of the four addresses: one recovery, then peace; nothing can be staged any more, a set in flash can be selected. */
void test_banks_with_a_damaged_address_are_given_up(void)
{
    for (uint32_t i = 0U; i < 4U; i++) {
        pen_tuning_t *const tuning = &a.head.tuning;
        pen_real_t **const address = (i < 2U) ? &tuning->bank[i] : &tuning->bank_check[i - 2U];

        start(&a, &first, true);
        stage(&a, 5U);
        TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step(&a));
        *address = other_value;
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_DAMAGED, verify_and_recover());
        TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step(&a));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, verify_and_recover());
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, step(&a)); /* not published again and again */
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tune_begin(&model, &a.head, &first.head));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, choose(&a, &other));
        TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step(&a));
    }
}

void test_whole_banks_are_kept(void)
{
    stage(&a, 5U);
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step(&a));
    a.bank[0][1] += (pen_real_t)1; /* of the running set */
    a.bank[1][1] += (pen_real_t)1;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_DAMAGED, verify_and_recover());
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step(&a));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, verify_and_recover());
    stage(&a, 6U);
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step(&a));
}
