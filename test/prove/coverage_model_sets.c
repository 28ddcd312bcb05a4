/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* What coverage_model.c is to the step of a model, for its sets: copies, bytes, withdrawals, damage, saved instances. */

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include MODEL_HEADER

#include "unity.h"

#include "coverage_model.inc"

static void stage_bytes(MODEL(t) *self, uint32_t from, uint32_t n)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_write_bytes)(self, from, &((const uint8_t *)value)[from], n));
}

/* A set that runs from a bank; the rollback set lies in the other bank if `two`, else in flash. */
static void run_from_bank(bool two)
{
    for (uint32_t k = 0U; k < (two ? 2U : 1U); k++) {
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_begin)(&model, &set.head));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_write)(&model, 0U, value, LENGTH));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_commit)(&model));
        TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, MODEL(step)(&model, &u, &y));
    }
}

void test_copied_withdrawn_and_sent_in_bytes(void)
{
    pen_set_head_t head;
    bool pending = false;

    TEST_ASSERT_EQUAL_HEX32(PEN_SET_IDLE, MODEL(tune_withdraw)(&model));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, MODEL(tune_expect)(&model, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_begin_copy)(&model, 7U));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_expect)(&model, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CHECKSUM, MODEL(tune_commit)(&model));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_expect)(&model, set.head.checksum));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_commit)(&model));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_withdraw)(&model));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_pending)(&model, &pending));
    TEST_ASSERT_TRUE(pending);
    TEST_ASSERT_EQUAL_HEX32(PEN_WITHDRAWN, MODEL(step)(&model, &u, &y));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_pending)(&model, &pending));
    TEST_ASSERT_FALSE(pending);
    head = set.head;
    head.id = 8U;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_begin)(&model, &head));
    stage_bytes(&model, 0U, 5U);
    stage_bytes(&model, 5U, (uint32_t)sizeof value - 5U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_commit)(&model));
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, MODEL(step)(&model, &u, &y));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_running)(&model, &head));
    TEST_ASSERT_EQUAL_UINT32(8U, head.id);
}

/* Damage that is finite: found within a round from its start, and then what the model file says. */
static pen_status_t after_damage(bool idle)
{
    pen_real_t *const running = (pen_real_t *)model.head.tuning.slot[model.head.tuning.active].value;

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(verify)(&model, MODEL_SIZE(VERIFY)));
    running[LENGTH - 1U] += (pen_real_t)0.5;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_DAMAGED, MODEL(verify)(&model, MODEL_SIZE(VERIFY)));
    if (!idle || (ON_DAMAGE == PEN_DAMAGE_REPORT)) {
        running[LENGTH - 1U] -= (pen_real_t)0.5;
    }
    return MODEL(step)(&model, &u, &y) & ~PEN_OUTSIDE;
}

void test_damage_and_a_rollback_set(void)
{
    const pen_status_t follows = (ON_DAMAGE == PEN_DAMAGE_HOLD) ? PEN_HELD : (ON_DAMAGE == PEN_DAMAGE_ROLLBACK) ? PEN_ADOPTED : PEN_OK;

    run_from_bank(true);
    TEST_ASSERT_EQUAL_HEX32(follows, after_damage(true));
    if (ON_DAMAGE == PEN_DAMAGE_ROLLBACK) {
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(verify)(&model, MODEL_SIZE(VERIFY)));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(step)(&model, &u, &y));
    }
}

/* Given up for a set that was opened; the set given to init is what remains, or nothing. */
void test_damage_and_no_rollback_set(void)
{
    const pen_status_t follows = (ON_DAMAGE == PEN_DAMAGE_HOLD) ? PEN_HELD : (ON_DAMAGE == PEN_DAMAGE_ROLLBACK) ? PEN_ADOPTED : PEN_OK;

    for (uint32_t k = 0U; k < 2U; k++) {
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(init)(&model, &set, &banks));
        run_from_bank(true);
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_begin)(&model, &set.head));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_abort)(&model));
        value[4] += (k == 1U) ? (pen_real_t)1 : (pen_real_t)0;
        TEST_ASSERT_EQUAL_HEX32(((k == 1U) && (follows == PEN_ADOPTED)) ? PEN_HELD : follows, after_damage(true));
    }
}

/* The rollback set would need more pieces than there is room for: only where that refuses. */
void test_damage_and_a_rollback_set_that_cannot_be_folded(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_select)(&model, &MODEL(set_altered_friction)));
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, MODEL(step)(&model, &u, &y) & ~PEN_OUTSIDE);
    run_from_bank(false);
    make_saw(SPRING);
    model.head.tuning.previous = set; /* what no call does */
    (void)after_damage(true);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_hold)(&model, false));
}

void test_damage_while_a_set_is_open(void)
{
    run_from_bank(false);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_begin)(&model, &set.head));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, after_damage(false));
}

static void both_step(pen_status_t right)
{
    MODEL(x_t) mine;
    MODEL(x_t) its;

    TEST_ASSERT_EQUAL_HEX32(right, MODEL(step)(&model, &u, &y) & ~PEN_OUTSIDE);
    TEST_ASSERT_EQUAL_HEX32(right, MODEL(step)(&other, &u, &y) & ~PEN_OUTSIDE);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(get_state)(&model, &mine));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(get_state)(&other, &its));
    TEST_ASSERT_EQUAL_MEMORY(&mine, &its, sizeof its);
}

void test_saved_and_restored_in_the_middle_of_a_set(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(init)(&other, &MODEL(set_default), &other_banks));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_begin)(&model, &set.head));
    stage_bytes(&model, 0U, 6U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(save)(&model, saved));
    saved[40] ^= 1U;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CHECKSUM, MODEL(restore)(&other, saved));
    saved[40] ^= 1U;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(restore)(&other, saved));
    both_step(PEN_OK);
    stage_bytes(&model, 6U, (uint32_t)sizeof value - 6U);
    stage_bytes(&other, 6U, (uint32_t)sizeof value - 6U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_commit)(&model));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_commit)(&other));
    both_step(PEN_ADOPTED);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(save)(&model, saved));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(restore)(&other, saved));
    both_step(PEN_OK);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(verify)(&other, MODEL_SIZE(VERIFY)));
}
