/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include <stddef.h>
#include <stdint.h>

#include "penode/pen_serial.h"
#include "penode/pen_set.h"
#include "unity.h"

#define N      5U
#define LAYOUT 0x12345678U

static pen_tuning_t tuning;
static pen_real_t   memory[4U * N]; /* below the banks, the banks, above them */
static pen_real_t   first_value[N];
static pen_real_t   other_value[N];
static pen_set_t    first;
static pen_set_t    other;

static pen_real_t *const below = &memory[0];
static pen_real_t *const bank0 = &memory[N];
static pen_real_t *const bank1 = &memory[2U * N];
static pen_real_t *const above = &memory[3U * N];

static void fill(pen_set_t *set, pen_real_t value[], uint32_t id)
{
    for (uint32_t i = 0U; i < N; i++) {
        value[i] = (pen_real_t)((100U * id) + i);
    }
    set->head.layout = LAYOUT;
    set->head.length = N;
    set->head.id = id;
    set->head.checksum = pen_set_checksum(value, N);
    set->value = value;
}

void setUp(void)
{
    fill(&first, first_value, 1U);
    fill(&other, other_value, 2U);
    for (uint32_t i = 0U; i < (4U * N); i++) {
        memory[i] = (pen_real_t)-1;
    }
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_init(&tuning, LAYOUT, N, &first, bank0, bank1));
}

void tearDown(void) {}

/* What a tuning call does once a set is ready: hand it over. */
static pen_status_t published(pen_status_t status, const pen_set_t *ready)
{
    if (status == PEN_OK) {
        pen_tuning_publish(&tuning, ready);
    }
    return status;
}

static pen_status_t commit(void)
{
    pen_set_t ready;

    return published(pen_tuning_commit(&tuning, LAYOUT, N, &ready), &ready);
}

static pen_status_t choose(const pen_set_t *set)
{
    pen_set_t ready;

    return published(pen_tuning_select(&tuning, LAYOUT, N, set, &ready), &ready);
}

static pen_status_t roll_back(void)
{
    pen_set_t ready;

    return published(pen_tuning_rollback(&tuning, LAYOUT, N, &ready), &ready);
}

static uint32_t running_id(void)
{
    pen_set_head_t head;

    pen_tuning_running(&tuning, &head);
    return head.id;
}

/* What a step would run with now. */
static pen_status_t adopt(uint32_t *id)
{
    uint32_t slot = 9U;
    const pen_status_t status = pen_tuning_adopt(&tuning, &slot);
    const pen_real_t *const value = tuning.slot[slot].value;

    *id = (uint32_t)value[0] / 100U;
    for (uint32_t i = 0U; i < N; i++) {
        TEST_ASSERT_TRUE(value[i] == (pen_real_t)((100U * *id) + i)); /* never torn */
    }
    TEST_ASSERT_EQUAL_UINT32(*id, running_id());
    return status;
}

static void expect_running(uint32_t expected)
{
    uint32_t id = 0U;

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, adopt(&id));
    TEST_ASSERT_EQUAL_UINT32(expected, id);
}

static void expect_adoption(uint32_t expected)
{
    uint32_t id = 0U;

    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, adopt(&id));
    TEST_ASSERT_EQUAL_UINT32(expected, id);
}

static void stage(uint32_t id)
{
    pen_set_t set;
    pen_real_t value[N];

    fill(&set, value, id);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_begin(&tuning, LAYOUT, N, &set.head));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_write(&tuning, N, 0U, value, 2U));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_write(&tuning, N, 2U, &value[2], N - 2U));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, commit());
}

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
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_init(&tuning, LAYOUT, N, &other, &memory[N * place[at % 6U][0]],
                                                        &memory[N * place[at % 6U][1]]));
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
