/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* The ring of a trial, with a step that comes in between the reads of the tuning context: at a barrier of a port made for this. */

#include <stddef.h>
#include <stdint.h>

#include "penode/pen_real.h"

#define PEN_PORT_H /* in place of the port */

static void at_barrier(void);

static inline uint32_t pen_port_load(const volatile uint32_t *word)
{
    return *word;
}
static inline void pen_port_store(volatile uint32_t *word, uint32_t value)
{
    *word = value;
}
static inline void pen_port_barrier(void)
{
    at_barrier();
}

#include "penode/pen_trial.h"

#include "unity.h"

static pen_trial_t trial;
static pen_trial_span_t span;
static uint32_t barriers; /* until the step comes in; 0: it does not */
static bool advances;

static void at_barrier(void)
{
    if (barriers > 0U) {
        barriers--;
        if (barriers == 0U) {
            pen_trial_keep(&trial, advances);
        }
    }
}

void setUp(void)
{
    const pen_trial_t empty = { UINT32_MAX - 3U, UINT32_MAX - 3U, 0U }; /* the count is about to wrap */

    trial = empty;
    barriers = 0U;
}

void tearDown(void) {}

static void keep(uint32_t n)
{
    for (uint32_t i = 0U; i < n; i++) {
        pen_trial_keep(&trial, true);
    }
}

static uint32_t used(uint32_t most)
{
    pen_trial_close(&trial, most, &span);
    pen_trial_open(&trial);
    return span.last - span.first;
}

void test_the_last_samples_are_used_and_no_more_than_there_are(void)
{
    TEST_ASSERT_EQUAL_UINT32(0U, used(5U));
    keep(4U);
    TEST_ASSERT_EQUAL_UINT32(4U, used(5U));
    keep(3U);
    TEST_ASSERT_EQUAL_UINT32(5U, used(5U));
    TEST_ASSERT_EQUAL_UINT32(3U, span.last);
}

void test_a_step_that_did_not_advance_begins_anew(void)
{
    keep(4U);
    pen_trial_keep(&trial, false);
    TEST_ASSERT_EQUAL_UINT32(0U, used(5U));
    keep(2U);
    TEST_ASSERT_EQUAL_UINT32(2U, used(5U));
}

void test_a_sample_during_a_trial_is_not_kept(void)
{
    keep(4U);
    pen_trial_close(&trial, 5U, &span);
    keep(1U);
    TEST_ASSERT_EQUAL_UINT32(0U, trial.written); /* it wrapped */
    pen_trial_open(&trial);
    TEST_ASSERT_EQUAL_UINT32(0U, used(5U));
    keep(1U);
    TEST_ASSERT_EQUAL_UINT32(1U, used(5U));
}

/* A step that comes in during the close: the samples there were may be used, or none. */
void test_a_step_at_each_barrier_of_a_close(void)
{
    for (uint32_t at = 1U; at <= 3U; at++) {
        for (uint32_t good = 0U; good < 2U; good++) {
            setUp();
            keep(4U);
            barriers = at;
            advances = (good == 1U);
            pen_trial_close(&trial, 5U, &span);
            TEST_ASSERT_EQUAL_UINT32(0U, barriers);
            TEST_ASSERT_EQUAL_UINT32(0U, span.last);
            TEST_ASSERT_EQUAL_UINT32(0U, span.last - span.first); /* the ring was closed: a gap in any case */
        }
    }
}
