/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include <stddef.h>
#include <stdint.h>

#include "penode/pen_set.h"
#include "unity.h"

#include "set_fixture.inc"

/* The check value of CRC-32 is that of the nine characters "123456789"; here over whole numbers, by zlib in Python:
   zlib.crc32(numpy.array([1, 2, 3], dtype).tobytes()) */
void test_checksum_is_crc32(void)
{
    const pen_real_t value[3] = { (pen_real_t)1, (pen_real_t)2, (pen_real_t)3 };
    const uint32_t expected = (sizeof(pen_real_t) == 4U) ? 0xb20e96b1U : 0x5b25e824U;

    TEST_ASSERT_EQUAL_HEX32(expected, pen_set_checksum(value, 3U));
    TEST_ASSERT_EQUAL_HEX32(0U, pen_set_checksum(value, 0U));
}

void test_init_refuses_what_commit_would(void)
{
    pen_tuning_t untouched;

    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, pen_tuning_init(NULL, LAYOUT, N, &first, bank0, bank1));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, pen_tuning_init(&untouched, LAYOUT, N, NULL, bank0, bank1));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, pen_tuning_init(&untouched, LAYOUT, N, &first, bank0, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, pen_tuning_init(&untouched, LAYOUT, N, &first, NULL, bank1));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_LAYOUT, pen_tuning_init(&untouched, LAYOUT + 1U, N, &first, bank0, bank1));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_LAYOUT, pen_tuning_init(&untouched, LAYOUT, N - 1U, &first, bank0, bank1));
    first.head.checksum++;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CHECKSUM, pen_tuning_init(&untouched, LAYOUT, N, &first, bank0, bank1));
    first.value = NULL;
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, pen_tuning_init(&untouched, LAYOUT, N, &first, bank0, bank1));
}

void test_staged_set_runs_from_the_next_step_on(void)
{
    expect_running(1U);
    stage(3U);
    TEST_ASSERT_EQUAL_UINT32(1U, running_id()); /* committed is not yet running */
    expect_adoption(3U);
    expect_running(3U);
    stage(4U);
    expect_adoption(4U);
    stage(5U);
    expect_adoption(5U);
    expect_running(5U);
}

void test_nothing_can_be_staged_while_a_set_waits(void)
{
    pen_set_t set;
    pen_real_t value[N];

    fill(&set, value, 9U);
    stage(3U);
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BUSY, pen_tuning_begin(&tuning, LAYOUT, N, &set.head));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BUSY, choose(&other));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BUSY, roll_back());
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, pen_tuning_write(&tuning, N, 0U, value, 1U)); /* write after commit */
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, commit());
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, pen_tuning_abort(&tuning));
    expect_adoption(3U);
}

void test_short_set_is_refused_and_can_be_completed(void)
{
    pen_set_t set;
    pen_real_t value[N];

    fill(&set, value, 6U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_begin(&tuning, LAYOUT, N, &set.head));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_SHORT, commit());
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_write(&tuning, N, 0U, value, N - 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_SHORT, commit());
    expect_running(1U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_write(&tuning, N, N - 1U, &value[N - 1U], 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, commit());
    expect_adoption(6U);
}

/* What was written to the set before does not count for this one, even in the same bank. */
void test_each_set_is_written_from_the_start(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_begin(&tuning, LAYOUT, N, &other.head));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_write(&tuning, N, 0U, other_value, N));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_begin(&tuning, LAYOUT, N, &other.head));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_SHORT, commit());
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_RANGE, pen_tuning_write(&tuning, N, N - 1U, other_value, 1U));
    expect_running(1U);
}

void test_wrong_checksum_is_refused_and_the_chunk_can_be_sent_again(void)
{
    pen_set_t set;
    pen_real_t value[N];

    fill(&set, value, 6U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_begin(&tuning, LAYOUT, N, &set.head));
    value[2] += (pen_real_t)1;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_write(&tuning, N, 0U, value, N));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CHECKSUM, commit());
    expect_running(1U);
    value[2] -= (pen_real_t)1;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_write(&tuning, N, 2U, &value[2], 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, commit());
    expect_adoption(6U);
}

void test_nan_and_inf_are_refused_even_with_the_right_checksum(void)
{
    volatile pen_real_t zero = (pen_real_t)0;
    pen_real_t bad[3];

    bad[0] = zero / zero;
    bad[1] = (pen_real_t)1 / zero;
    bad[2] = (pen_real_t)-1 / zero;
    for (size_t b = 0U; b < 3U; b++) {
        for (uint32_t i = 0U; i < N; i++) {
            pen_set_t set;
            pen_real_t value[N];
            fill(&set, value, 6U);
            value[i] = bad[b];
            set.head.checksum = pen_set_checksum(value, N);
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_begin(&tuning, LAYOUT, N, &set.head));
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_write(&tuning, N, 0U, value, N));
            TEST_ASSERT_EQUAL_HEX32(PEN_SET_NONFINITE, commit());
            TEST_ASSERT_EQUAL_HEX32(PEN_SET_NONFINITE, choose(&set));
            expect_running(1U);
        }
    }
}

void test_other_layout_or_length_is_refused(void)
{
    pen_set_head_t head = first.head;

    head.layout ^= 1U;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_LAYOUT, pen_tuning_begin(&tuning, LAYOUT, N, &head));
    head = first.head;
    head.length--;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_LAYOUT, pen_tuning_begin(&tuning, LAYOUT, N, &head));
    other.head.layout ^= 1U;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_LAYOUT, choose(&other));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tuning_begin(&tuning, LAYOUT, N, NULL));
    expect_running(1U);
}

void test_chunks_may_not_leave_the_set(void)
{
    pen_set_t set;
    pen_real_t value[N];

    fill(&set, value, 6U);
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, pen_tuning_write(&tuning, N, 0U, value, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_begin(&tuning, LAYOUT, N, &set.head));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_RANGE, pen_tuning_write(&tuning, N, 1U, value, 1U)); /* a gap */
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_RANGE, pen_tuning_write(&tuning, N, 0U, value, N + 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_write(&tuning, N, 0U, value, N));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_RANGE, pen_tuning_write(&tuning, N, N, value, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_RANGE, pen_tuning_write(&tuning, N, 1U, value, UINT32_MAX)); /* offset + n wraps */
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_RANGE, pen_tuning_write(&tuning, N, UINT32_MAX, value, 2U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tuning_write(&tuning, N, 0U, NULL, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_write(&tuning, N, N, value, 0U));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, commit());
}

/* A flipped bit in `fill` must not open the way out of the bank. */
void test_damaged_fill_does_not_open_the_bank(void)
{
    pen_set_t set;
    pen_real_t value[N];

    fill(&set, value, 6U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_begin(&tuning, LAYOUT, N, &set.head));
    tuning.fill = 0x80000000U;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_RANGE, pen_tuning_write(&tuning, N, 0x7fffffffU, value, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_SHORT, commit());
}

void test_abort_drops_the_open_set(void)
{
    pen_set_t set;
    pen_real_t value[N];

    fill(&set, value, 6U);
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, pen_tuning_abort(&tuning));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_begin(&tuning, LAYOUT, N, &set.head));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_write(&tuning, N, 0U, value, N));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_abort(&tuning));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, commit());
    expect_running(1U);
}

void test_rollback_returns_to_the_set_before_and_forth_again(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_NO_PREVIOUS, roll_back());
    stage(3U);
    expect_adoption(3U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, roll_back());
    expect_adoption(1U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, roll_back());
    expect_adoption(3U);
    stage(4U);
    expect_adoption(4U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, roll_back()); /* two banks: 3 is still whole */
    expect_adoption(3U);
}

void test_rollback_is_kept_while_a_bank_is_free_and_given_up_when_not(void)
{
    pen_set_t set;
    pen_real_t value[N];

    fill(&set, value, 6U);
    stage(3U);
    expect_adoption(3U); /* 3 runs in a bank, 1 lies in flash: begin takes the free bank */
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_begin(&tuning, LAYOUT, N, &set.head));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_abort(&tuning));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, roll_back());
    expect_adoption(1U);
    stage(4U);
    expect_adoption(4U);
    stage(5U);
    expect_adoption(5U); /* both banks hold 4 and 5: begin must take that of 4 */
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_begin(&tuning, LAYOUT, N, &set.head));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_NO_PREVIOUS, roll_back());
    expect_running(5U);
}

/* Wherever in memory the banks and a set in flash lie, after any five exchanges: the rollback set is given up only if it and
 * the running set fill both banks. */
void test_the_rollback_set_wherever_sets_lie(void)
{
    static const uint32_t place[6][3] = { { 0U, 1U, 2U }, { 0U, 2U, 1U }, { 1U, 0U, 2U }, { 1U, 2U, 0U }, { 2U, 0U, 1U }, { 2U, 1U, 0U } };

    for (uint32_t at = 0U; at < (6U * 243U); at++) {
        pen_real_t *const flash = &memory[N * place[at % 6U][2]];
        uint32_t running = 2U; /* the id, and whether it lies in a bank */
        uint32_t previous = 0U;
        bool running_in_bank = false;
        bool previous_in_bank = false;
        uint32_t exchanges = at / 6U;

        fill(&other, flash, 2U);
        TEST_ASSERT_EQUAL_HEX32(
            PEN_OK, pen_tuning_init(&tuning, LAYOUT, N, &other, &memory[N * place[at % 6U][0]], &memory[N * place[at % 6U][1]]));
        for (uint32_t k = 0U; k < 5U; k++) {
            const uint32_t kind = (previous == 0U) ? (exchanges % 2U) : (exchanges % 3U); /* no rollback set at first */
            const uint32_t before = running;
            const bool before_in_bank = running_in_bank;
            if (kind == 0U) {
                stage(3U + k);
                running = 3U + k;
                running_in_bank = true;
            } else if (kind == 1U) {
                TEST_ASSERT_EQUAL_HEX32(PEN_OK, choose(&other));
                running = 2U;
                running_in_bank = false;
            } else {
                TEST_ASSERT_EQUAL_HEX32(PEN_OK, roll_back());
                running = previous;
                running_in_bank = previous_in_bank;
            }
            expect_adoption(running);
            previous = before;
            previous_in_bank = before_in_bank;
            exchanges /= 3U;
        }
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_begin(&tuning, LAYOUT, N, &first.head));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_write(&tuning, N, 0U, first_value, N));
        if (!running_in_bank || !previous_in_bank) {
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, roll_back());
            expect_adoption(previous);
        } else {
            TEST_ASSERT_EQUAL_HEX32(PEN_SET_NO_PREVIOUS, roll_back());
            expect_running(running);
        }
    }
}

void test_select_borrows_a_set_and_drops_an_open_one(void)
{
    pen_set_t set;
    pen_real_t value[N];

    fill(&set, value, 6U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_begin(&tuning, LAYOUT, N, &set.head));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, choose(&other));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, pen_tuning_write(&tuning, N, 0U, value, 1U));
    expect_adoption(2U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, choose(&first));
    expect_adoption(1U);
    other.head.checksum ^= 1U;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CHECKSUM, choose(&other));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, choose(NULL));
    other.value = NULL;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, choose(&other));
    expect_running(1U);
}

void test_without_banks_only_select_works(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_init(&tuning, LAYOUT, N, &first, NULL, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tuning_begin(&tuning, LAYOUT, N, &other.head));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, choose(&other));
    expect_adoption(2U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, roll_back());
    expect_adoption(1U);
}

void test_hold_does_not_keep_a_set_from_being_adopted(void)
{
    uint32_t id = 0U;

    pen_tuning_hold(&tuning, true);
    TEST_ASSERT_EQUAL_HEX32(PEN_HELD, adopt(&id));
    stage(3U);
    TEST_ASSERT_EQUAL_HEX32(PEN_HELD | PEN_ADOPTED, adopt(&id));
    TEST_ASSERT_EQUAL_UINT32(3U, id);
    pen_tuning_hold(&tuning, false);
    expect_running(3U);
}

/* What a bit that flips in the instance can do to its addresses: nothing is written, nothing is committed. */
void test_damaged_addresses_of_the_banks(void)
{
    pen_real_t *const elsewhere[2] = { below, above };
    pen_set_t set;
    pen_real_t value[N];

    fill(&set, value, 6U);
    for (size_t e = 0U; e < 2U; e++) {
        for (size_t i = 0U; i < 2U; i++) {
            pen_real_t *const kept = tuning.bank[i];
            tuning.bank[i] = elsewhere[e];
            TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tuning_begin(&tuning, LAYOUT, N, &set.head));
            tuning.bank[i] = kept;
        }
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_begin(&tuning, LAYOUT, N, &set.head));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_write(&tuning, N, 0U, value, N));
        tuning.bank[0] = elsewhere[e]; /* the open one */
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, pen_tuning_write(&tuning, N, 0U, value, N));
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, commit());
        tuning.bank[0] = bank0;
        tuning.slot[1].value = elsewhere[e];
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, pen_tuning_write(&tuning, N, 0U, value, N));
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, commit());
        for (size_t i = 0U; i < N; i++) {
            TEST_ASSERT_TRUE(elsewhere[e][i] == (pen_real_t)-1);
        }
        tuning.slot[1].value = bank0;
    }
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, commit());
    expect_adoption(6U);
}

/* Which of the banks lies lower in memory does not matter. */
void test_banks_in_either_order(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_init(&tuning, LAYOUT, N, &first, bank1, bank0));
    for (uint32_t id = 3U; id < 8U; id++) {
        stage(id);
        expect_adoption(id);
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, roll_back());
        expect_adoption((id == 3U) ? 1U : (id - 1U));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, roll_back());
        expect_adoption(id);
    }
}

/* Whatever the instance held: after init no set is open, none waits, nothing holds, and slot 0 runs. */
void test_init_leaves_nothing_of_what_was_there(void)
{
    uint32_t slot = 9U;

    stage(3U);
    expect_adoption(3U);
    tuning.slot[0].value = bank0;
    tuning.slot[1].value = bank0;
    tuning.open = 1U;
    tuning.pending = 1U;
    tuning.hold = PEN_HELD;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_init(&tuning, LAYOUT, N, &first, bank0, bank1));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, pen_tuning_abort(&tuning));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_NO_PREVIOUS, roll_back());
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_adopt(&tuning, &slot));
    TEST_ASSERT_EQUAL_UINT32(0U, slot);
    tuning.open = 1U; /* by a flipped bit: the set is not the caller's to write to */
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, pen_tuning_write(&tuning, N, 0U, first_value, N));
    TEST_ASSERT_TRUE(bank0[0] == (pen_real_t)300);
}

/* Words that are none of those the code writes: still one of two slots, nothing adopted, nothing open, one flag. */
void test_damaged_words(void)
{
    uint32_t slot = 9U;

    tuning.active = 0x80000000U;
    TEST_ASSERT_EQUAL_UINT32(1U, pen_tuning_inactive(&tuning));
    TEST_ASSERT_EQUAL_UINT32(1U, running_id());
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_adopt(&tuning, &slot));
    TEST_ASSERT_EQUAL_UINT32(0U, slot);
    tuning.active = 0U;
    for (uint32_t bit = 0U; bit < 32U; bit++) {
        tuning.pending = UINT32_C(1) << bit;
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_BUSY, pen_tuning_begin(&tuning, LAYOUT, N, &other.head));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_adopt(&tuning, &slot)); /* nothing was published: nothing is adopted */
        TEST_ASSERT_EQUAL_UINT32(0U, slot);
        TEST_ASSERT_FALSE(pen_tuning_pending(&tuning));
    }
    tuning.hold = UINT32_MAX;
    TEST_ASSERT_EQUAL_HEX32(PEN_HELD, pen_tuning_adopt(&tuning, &slot));
    pen_tuning_hold(&tuning, false);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_begin(&tuning, LAYOUT, N, &other.head));
    tuning.open = 2U;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, pen_tuning_write(&tuning, N, 0U, other_value, N));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, pen_tuning_abort(&tuning));
}

/* Layout and length count as the code names them, whatever lies in the instance. */
void test_damaged_heads_do_not_let_another_shape_pass(void)
{
    pen_set_t set;
    pen_real_t value[N];

    fill(&set, value, 6U);
    tuning.slot[0].head.length = N + 1U;
    tuning.slot[0].head.layout = 0U;
    other.head.length = N + 1U;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_LAYOUT, choose(&other));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_begin(&tuning, LAYOUT, N, &set.head));
    tuning.slot[1].head.length = N + 1U;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_RANGE, pen_tuning_write(&tuning, N, 0U, value, N + 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_write(&tuning, N, 0U, value, N));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_LAYOUT, commit());
}

void test_rollback_refuses_a_set_that_is_no_longer_what_it_was(void)
{
    stage(3U);
    expect_adoption(3U);
    first_value[1] += (pen_real_t)1;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CHECKSUM, roll_back());
    first_value[1] -= (pen_real_t)1;
    tuning.previous.head.length--;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_LAYOUT, roll_back());
    tuning.previous.head.length++;
    expect_running(3U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, roll_back());
    expect_adoption(1U);
}
