/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * In which order the parameter sets use the port. A missing or misplaced barrier passes every test that runs on one
 * core, here it does not. The mocked port works on memory and records what another context could see:
 * "p" pending is read, "A" "P" "H" active, pending, hold are written, "|" a barrier.
 */
#include <stddef.h>
#include <string.h>

#include "mock_pen_port_target.h"
#include "penode/pen_set.h"
#include "unity.h"

#define LENGTH 3U
#define LAYOUT UINT32_C(0x1234)

static const pen_real_t first_value[LENGTH] = { 1, 2, 3 };
static const pen_real_t other_value[LENGTH] = { 4, 5, 6 };
static pen_real_t bank[2][LENGTH];
static pen_set_t first;
static pen_set_t other;
static pen_tuning_t tuning;
static char trace[32];
static bool whole_at_barrier; /* when the last barrier came, the inactive slot held all of `other` */

static void note(char event)
{
    const size_t n = strlen(trace);

    TEST_ASSERT_TRUE(n < (sizeof(trace) - 1U));
    trace[n] = event;
}

static uint32_t load(const volatile uint32_t *word, int calls)
{
    (void)calls;
    if (word == &tuning.pending) {
        note('p');
    }
    return *word;
}

static void store(volatile uint32_t *word, uint32_t value, int calls)
{
    (void)calls;
    note((word == &tuning.active) ? 'A' : (word == &tuning.pending) ? 'P' : (word == &tuning.hold) ? 'H' : '?');
    *word = value;
}

static void barrier(int calls)
{
    const pen_set_t *const slot = &tuning.slot[tuning.active ^ 1U];

    (void)calls;
    note('|');
    whole_at_barrier = (memcmp(&slot->head, &other.head, sizeof(other.head)) == 0) &&
                       (memcmp(slot->value, other_value, sizeof(other_value)) == 0);
}

static void forget(void)
{
    memset(trace, 0, sizeof(trace));
    whole_at_barrier = false;
}

static pen_set_t set_of(const pen_real_t value[], uint32_t id)
{
    const pen_set_t set = { { LAYOUT, LENGTH, id, pen_set_checksum(value, LENGTH) }, value };

    return set;
}

void setUp(void)
{
    pen_port_load_Stub(load);
    pen_port_store_Stub(store);
    pen_port_barrier_Stub(barrier);
    first = set_of(first_value, 1U);
    other = set_of(other_value, 2U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_init(&tuning, LAYOUT, LENGTH, &first, bank[0], bank[1]));
    forget();
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

    return published(pen_tuning_commit(&tuning, LAYOUT, LENGTH, &ready), &ready);
}

static pen_status_t choose(const pen_set_t *set)
{
    pen_set_t ready;

    return published(pen_tuning_select(&tuning, LAYOUT, LENGTH, set, &ready), &ready);
}

void test_begin_looks_at_pending_and_then_waits_for_its_view_of_active(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_begin(&tuning, LAYOUT, LENGTH, &other.head));
    TEST_ASSERT_EQUAL_STRING("p|", trace);
}

void test_commit_publishes_a_whole_set_before_the_barrier(void)
{
    (void)pen_tuning_begin(&tuning, LAYOUT, LENGTH, &other.head);
    (void)pen_tuning_write(&tuning, LENGTH, 0U, other_value, LENGTH);
    forget();
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, commit());
    TEST_ASSERT_EQUAL_STRING("|P", trace);
    TEST_ASSERT_TRUE(whole_at_barrier);
    TEST_ASSERT_EQUAL_UINT32(1U, tuning.pending);
}

void test_select_publishes_a_whole_set_before_the_barrier(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, choose(&other));
    TEST_ASSERT_EQUAL_STRING("p||P", trace);
    TEST_ASSERT_TRUE(whole_at_barrier);
}

void test_adopt_flips_between_two_barriers_and_gives_way_last(void)
{
    uint32_t slot = 9U;

    (void)choose(&other);
    forget();
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, pen_tuning_adopt(&tuning, &slot));
    TEST_ASSERT_EQUAL_STRING("p|A|P", trace);
    TEST_ASSERT_EQUAL_PTR(other_value, tuning.slot[slot].value);
    TEST_ASSERT_EQUAL_UINT32(0U, tuning.pending);
}

void test_adopt_without_a_set_waiting_writes_nothing(void)
{
    uint32_t slot = 9U;

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tuning_adopt(&tuning, &slot));
    TEST_ASSERT_EQUAL_STRING("p", trace);
}

void test_a_refused_set_is_not_published(void)
{
    other.head.checksum ^= 1U;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CHECKSUM, choose(&other));
    TEST_ASSERT_EQUAL_STRING("p|", trace);
}

void test_hold_is_one_store(void)
{
    pen_tuning_hold(&tuning, true);
    TEST_ASSERT_EQUAL_STRING("H", trace);
}
