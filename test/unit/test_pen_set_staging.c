/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include <stddef.h>
#include <stdint.h>

#include "penode/pen_serial.h"
#include "penode/pen_set.h"
#include "unity.h"

#include "set_fixture.inc"

/* -- withdrawing a committed set --------------------------------------------------------------------------------------- */

/* A step that runs with `expected` and grants a withdrawal. */
static void expect_withdrawal(uint32_t expected)
{
    uint32_t id = 0U;

    TEST_ASSERT_EQUAL_HEX32(PEN_WITHDRAWN, adopt(&id));
    TEST_ASSERT_EQUAL_UINT32(expected, id);
}

void test_withdrawal_is_a_request_that_the_next_step_grants(void)
{
    stage(3U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_withdraw(&tuning));
    TEST_ASSERT_TRUE(pen_tuning_pending(&tuning)); /* asked is not granted: the slot still belongs to the step */
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BUSY, pen_tuning_begin(&tuning, LAYOUT, N, &other.head));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BUSY, choose(&other));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BUSY, roll_back());
    expect_withdrawal(1U);
    TEST_ASSERT_FALSE(pen_tuning_pending(&tuning));
    expect_running(1U);
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_NO_PREVIOUS, roll_back()); /* 3 never ran */
    stage(4U);
    expect_adoption(4U);
}

/* The step comes between the tuning context's look and its store: it has adopted the set, the request comes too late. */
void test_withdrawal_that_the_step_has_overtaken(void)
{
    pen_tuning_t twin;

    stage(3U);
    twin = tuning;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_withdraw(&twin));
    expect_adoption(3U);
    tuning.pending = twin.pending; /* the store, late */
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BUSY, pen_tuning_begin(&tuning, LAYOUT, N, &other.head));
    expect_running(3U);
    TEST_ASSERT_FALSE(pen_tuning_pending(&tuning));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, roll_back());
    expect_adoption(1U);
}

void test_withdrawing_twice_or_nothing(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_IDLE, pen_tuning_withdraw(&tuning));
    TEST_ASSERT_FALSE(pen_tuning_pending(&tuning));
    stage(3U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_withdraw(&tuning));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_withdraw(&tuning));
    expect_withdrawal(1U);
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_IDLE, pen_tuning_withdraw(&tuning));
    stage(4U);
    expect_adoption(4U);
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_IDLE, pen_tuning_withdraw(&tuning));
    expect_running(4U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_begin(&tuning, LAYOUT, N, &other.head)); /* open is not committed */
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_IDLE, pen_tuning_withdraw(&tuning));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_write(&tuning, N, 0U, other_value, N));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, commit());
    expect_adoption(2U);
}

/* Of a set staged, selected or rolled back to, from either slot: what could be rolled back to before, can be again. */
void test_rollback_set_after_a_withdrawal(void)
{
    stage(3U);
    expect_adoption(3U);
    for (uint32_t turn = 0U; turn < 4U; turn++) { /* 3 runs, 1 is the rollback set */
        stage(4U);
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_withdraw(&tuning));
        expect_withdrawal(3U);
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, choose(&other));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_withdraw(&tuning));
        expect_withdrawal(3U);
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, roll_back());
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_withdraw(&tuning));
        expect_withdrawal(3U);
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, roll_back());
        expect_adoption(1U);
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, roll_back());
        expect_adoption(3U);
    }
    stage(4U);
    expect_adoption(4U);
    stage(5U); /* takes the bank of 3, the rollback set: withdrawn, there is none */
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_withdraw(&tuning));
    expect_withdrawal(4U);
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_NO_PREVIOUS, roll_back());
}

/* One bit of a command that waits: nothing is adopted, and the tuning context finds out. */
void test_bits_that_flip_in_a_command(void)
{
    for (uint32_t bit = 0U; bit < 64U; bit++) {
        const bool withdrawn = (bit >= 32U);
        uint32_t id = 0U;
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_init(&tuning, LAYOUT, N, &first, bank0, bank1));
        stage(3U);
        expect_adoption(3U);
        stage(4U);
        if (withdrawn) {
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_withdraw(&tuning));
        }
        tuning.pending ^= UINT32_C(1) << (bit % 32U);
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, adopt(&id));
        TEST_ASSERT_EQUAL_UINT32(3U, id);
        TEST_ASSERT_FALSE(pen_tuning_pending(&tuning));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, roll_back());
        expect_adoption(1U);
    }
}

/* A word that comes from nowhere is no set: it cannot be withdrawn into one either. */
void test_withdrawing_a_bit_that_flipped(void)
{
    for (uint32_t bit = 0U; bit < 32U; bit++) {
        uint32_t slot = 9U;
        tuning.pending = UINT32_C(1) << bit;
        (void)pen_tuning_withdraw(&tuning);
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_adopt(&tuning, &slot) & ~PEN_WITHDRAWN);
        TEST_ASSERT_EQUAL_UINT32(0U, slot);
        TEST_ASSERT_FALSE(pen_tuning_pending(&tuning));
    }
    stage(3U);
    expect_adoption(3U);
}

/* -- a copy of the running set ------------------------------------------------------------------------------------------ */

/* A calibrator changes three values, in any order, and says what the whole is to be. */
void test_copy_of_the_running_set_with_three_values_changed(void)
{
    static const uint32_t at[3] = { 3U, 0U, 4U };
    pen_real_t expected[N];
    pen_set_head_t head;
    uint32_t slot = 9U;

    stage(3U);
    expect_adoption(3U);
    for (uint32_t i = 0U; i < N; i++) {
        expected[i] = (pen_real_t)(300U + i);
    }
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_begin_copy(&tuning, LAYOUT, N, 77U));
    for (uint32_t i = 0U; i < 3U; i++) {
        expected[at[i]] = (pen_real_t)-1 - (pen_real_t)i;
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_write(&tuning, N, at[i], &expected[at[i]], 1U));
    }
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CHECKSUM, commit()); /* that of the running set until another is given */
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_expect(&tuning, pen_set_checksum(expected, N) ^ 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CHECKSUM, commit());
    expect_running(3U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_expect(&tuning, pen_set_checksum(expected, N)));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, commit());
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, pen_tuning_adopt(&tuning, &slot));
    for (uint32_t i = 0U; i < N; i++) {
        TEST_ASSERT_TRUE(tuning.slot[slot].value[i] == expected[i]);
    }
    pen_tuning_running(&tuning, &head);
    TEST_ASSERT_EQUAL_UINT32(77U, head.id);
    TEST_ASSERT_EQUAL_HEX32(pen_set_checksum(expected, N), head.checksum);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, roll_back());
    expect_adoption(3U);
}

void test_unchanged_copy_is_the_same_set(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_begin_copy(&tuning, LAYOUT, N, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, commit());
    expect_adoption(1U);
    TEST_ASSERT_EQUAL_PTR(bank0, tuning.slot[1].value);
}

void test_copy_and_expect_refused(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, pen_tuning_expect(&tuning, 0U));
    first_value[2] += (pen_real_t)1; /* damage is copied, and found */
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_begin_copy(&tuning, LAYOUT, N, 9U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CHECKSUM, commit());
    first_value[2] -= (pen_real_t)1;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_abort(&tuning));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, pen_tuning_expect(&tuning, 0U));
    stage(3U);
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BUSY, pen_tuning_begin_copy(&tuning, LAYOUT, N, 9U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, pen_tuning_expect(&tuning, 0U));
    expect_adoption(3U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_init(&tuning, LAYOUT, N, &first, NULL, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tuning_begin_copy(&tuning, LAYOUT, N, 9U));
}

/* -- a set in bytes ----------------------------------------------------------------------------------------------------- */

/* In chunks of every size from every alignment. */
void test_bytes_in_chunks_of_every_size(void)
{
    const uint32_t size = N * (uint32_t)sizeof(pen_real_t);
    uint8_t byte[(N * sizeof(pen_real_t)) + 8U];

    for (uint32_t shift = 0U; shift < 8U; shift++) {
        pen_serial_put_bytes(other_value, 0U, size, &byte[shift]);
        for (uint32_t chunk = 1U; chunk <= size; chunk++) {
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_init(&tuning, LAYOUT, N, &first, bank0, bank1));
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_begin(&tuning, LAYOUT, N, &other.head));
            for (uint32_t at = 0U; at < size; at += chunk) {
                const uint32_t n = (chunk < (size - at)) ? chunk : (size - at);
                TEST_ASSERT_EQUAL_HEX32(PEN_SET_SHORT, commit());
                TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_write_bytes(&tuning, N, at, &byte[shift + at], n));
            }
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, commit());
            expect_adoption(2U);
            TEST_ASSERT_TRUE((below[N - 1U] == (pen_real_t)-1) && (above[0] == (pen_real_t)-1));
        }
    }
}

void test_bytes_may_not_leave_the_set(void)
{
    const uint32_t size = N * (uint32_t)sizeof(pen_real_t);
    uint8_t byte[N * sizeof(pen_real_t)];

    pen_serial_put_bytes(other_value, 0U, size, byte);
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, pen_tuning_write_bytes(&tuning, N, 0U, byte, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_begin(&tuning, LAYOUT, N, &other.head));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tuning_write_bytes(&tuning, N, 0U, NULL, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_RANGE, pen_tuning_write_bytes(&tuning, N, 1U, byte, 1U)); /* a gap */
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_RANGE, pen_tuning_write_bytes(&tuning, N, 0U, byte, size + 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_RANGE, pen_tuning_write_bytes(&tuning, N, UINT32_MAX, byte, 2U));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_write_bytes(&tuning, N, 0U, byte, 5U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_RANGE, pen_tuning_write_bytes(&tuning, N, 3U, byte, UINT32_MAX)); /* offset + n wraps */
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_write_bytes(&tuning, N, 3U, &byte[3], size - 3U)); /* overlaps */
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_RANGE, pen_tuning_write_bytes(&tuning, N, size, byte, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_write_bytes(&tuning, N, size, byte, 0U));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_write(&tuning, N, 1U, &other_value[1], 2U)); /* both ways mix */
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, commit());
    expect_adoption(2U);
    TEST_ASSERT_TRUE((below[N - 1U] == (pen_real_t)-1) && (above[0] == (pen_real_t)-1));
}

/* A flipped bit in `fill` must not open the way out of the bank. */
void test_bytes_behind_a_damaged_fill(void)
{
    const uint8_t byte[1] = { 0U };

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_begin(&tuning, LAYOUT, N, &other.head));
    tuning.fill = 0x80000000U;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_RANGE, pen_tuning_write_bytes(&tuning, N, 0x7fffffffU, byte, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_SHORT, commit());
}

/* 4 or 8 times such an offset is 0 again: it must not count as the start of the set. */
void test_values_far_beyond_do_not_come_round(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_begin(&tuning, LAYOUT, N, &other.head));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_RANGE, pen_tuning_write(&tuning, N, 0x40000000U, other_value, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_RANGE, pen_tuning_write(&tuning, N, 0x20000000U, other_value, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_RANGE, pen_tuning_write(&tuning, N, 0U, other_value, 0x40000001U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_RANGE, pen_tuning_write(&tuning, N, 0U, other_value, 0x20000001U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_SHORT, commit());
}
