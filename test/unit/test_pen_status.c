/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include <stddef.h>
#include <stdint.h>

#include "penode/pen_status.h"
#include "unity.h"

#define ALL        UINT32_C(0xffffffff)
#define STEP_FLAGS 0x000007ffU
#define TUNE_FLAGS 0x01fff800U

static pen_status_log_t status_log;
static pen_status_report_t report;

void setUp(void)
{
    for (size_t i = 0U; i < PEN_STATUS_FLAGS; i++) {
        status_log.count[i] = 0xaaaaaaaaU;
        status_log.seen[i] = 0x55555555U;
        report.times[i] = 0xccccccccU;
    }
    report.flags = ALL;
    pen_status_clear(&status_log);
}

void tearDown(void) {}

static void expect_nothing(void)
{
    pen_status_read(&status_log, &report);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, report.flags);
    TEST_ASSERT_EACH_EQUAL_UINT32(0U, report.times, PEN_STATUS_FLAGS);
}

void test_cleared_log_reports_nothing(void)
{
    expect_nothing();
}

void test_good_steps_count_nothing(void)
{
    pen_status_note_step(&status_log, PEN_OK);
    pen_status_note_tune(&status_log, PEN_OK);
    expect_nothing();
}

void test_each_step_flag_has_its_own_counter(void)
{
    for (uint32_t flag = 0U; flag < PEN_STATUS_STEP; flag++) {
        pen_status_note_step(&status_log, UINT32_C(1) << flag);
        pen_status_read(&status_log, &report);
        TEST_ASSERT_EQUAL_HEX32(UINT32_C(1) << flag, report.flags);
        for (uint32_t i = 0U; i < PEN_STATUS_FLAGS; i++) {
            TEST_ASSERT_EQUAL_UINT32((i == flag) ? 1U : 0U, report.times[i]);
        }
    }
}

void test_each_tune_flag_has_its_own_counter(void)
{
    for (uint32_t flag = PEN_STATUS_STEP; flag < PEN_STATUS_FLAGS; flag++) {
        pen_status_note_tune(&status_log, UINT32_C(1) << flag);
        pen_status_read(&status_log, &report);
        TEST_ASSERT_EQUAL_HEX32(UINT32_C(1) << flag, report.flags);
        for (uint32_t i = 0U; i < PEN_STATUS_FLAGS; i++) {
            TEST_ASSERT_EQUAL_UINT32((i == flag) ? 1U : 0U, report.times[i]);
        }
    }
}

void test_flags_add_up_and_are_counted_one_by_one(void)
{
    pen_status_note_step(&status_log, PEN_OUTSIDE | PEN_ADOPTED);
    pen_status_note_step(&status_log, PEN_OUTSIDE);
    pen_status_note_step(&status_log, PEN_OK);
    pen_status_note_step(&status_log, PEN_OUTSIDE | PEN_STEP_NONFINITE);
    pen_status_note_tune(&status_log, PEN_SET_BUSY);
    pen_status_note_tune(&status_log, PEN_SET_BUSY);
    pen_status_read(&status_log, &report);
    TEST_ASSERT_EQUAL_HEX32(PEN_OUTSIDE | PEN_ADOPTED | PEN_STEP_NONFINITE | PEN_SET_BUSY, report.flags);
    TEST_ASSERT_EQUAL_UINT32(3U, pen_status_times(&report, PEN_OUTSIDE));
    TEST_ASSERT_EQUAL_UINT32(1U, pen_status_times(&report, PEN_ADOPTED));
    TEST_ASSERT_EQUAL_UINT32(1U, pen_status_times(&report, PEN_STEP_NONFINITE));
    TEST_ASSERT_EQUAL_UINT32(2U, pen_status_times(&report, PEN_SET_BUSY));
}

/* One writer per counter: a step must not touch a counter of the tuning context, whatever the status, nor reversely. */
void test_each_context_writes_its_own_counters_only(void)
{
    pen_status_note_step(&status_log, ALL);
    pen_status_read(&status_log, &report);
    TEST_ASSERT_EQUAL_HEX32(STEP_FLAGS, report.flags);
    pen_status_note_tune(&status_log, ALL);
    pen_status_read(&status_log, &report);
    TEST_ASSERT_EQUAL_HEX32(TUNE_FLAGS, report.flags);
}

void test_reading_clears_for_the_reader_and_leaves_the_counters(void)
{
    pen_status_note_step(&status_log, PEN_SINGULAR);
    pen_status_read(&status_log, &report);
    TEST_ASSERT_EQUAL_HEX32(PEN_SINGULAR, report.flags);
    TEST_ASSERT_EQUAL_UINT32(1U, status_log.count[3]);
    expect_nothing();
    pen_status_note_step(&status_log, PEN_SINGULAR);
    pen_status_note_step(&status_log, PEN_SINGULAR);
    pen_status_read(&status_log, &report);
    TEST_ASSERT_EQUAL_UINT32(2U, pen_status_times(&report, PEN_SINGULAR));
    TEST_ASSERT_EQUAL_UINT32(3U, status_log.count[3]);
}

void test_counters_wrap_and_the_difference_stays_right(void)
{
    status_log.count[0] = ALL - 1U;
    status_log.seen[0] = ALL - 1U;
    status_log.count[18] = ALL;
    status_log.seen[18] = ALL;
    for (uint32_t i = 0U; i < 5U; i++) {
        pen_status_note_step(&status_log, PEN_INPUT_NONFINITE);
        pen_status_note_tune(&status_log, PEN_SET_NO_PREVIOUS);
    }
    TEST_ASSERT_EQUAL_UINT32(3U, status_log.count[0]);
    pen_status_read(&status_log, &report);
    TEST_ASSERT_EQUAL_HEX32(PEN_INPUT_NONFINITE | PEN_SET_NO_PREVIOUS, report.flags);
    TEST_ASSERT_EQUAL_UINT32(5U, pen_status_times(&report, PEN_INPUT_NONFINITE));
    TEST_ASSERT_EQUAL_UINT32(5U, pen_status_times(&report, PEN_SET_NO_PREVIOUS));
    expect_nothing();
}

void test_times_of_no_flag_or_several_are_none(void)
{
    pen_status_note_step(&status_log, ALL);
    pen_status_read(&status_log, &report);
    TEST_ASSERT_EQUAL_UINT32(0U, pen_status_times(&report, PEN_OK));
    TEST_ASSERT_EQUAL_UINT32(0U, pen_status_times(&report, PEN_HELD | PEN_ADOPTED));
    TEST_ASSERT_EQUAL_UINT32(0U, pen_status_times(&report, UINT32_C(1) << PEN_STATUS_FLAGS));
}

void test_each_flag_of_a_step_and_damage_are_of_one_kind(void)
{
    TEST_ASSERT_EQUAL_HEX32(0U, (PEN_FAULTS & PEN_WARNINGS) | (PEN_FAULTS & PEN_EVENTS) | (PEN_WARNINGS & PEN_EVENTS));
    TEST_ASSERT_EQUAL_HEX32(STEP_FLAGS | PEN_SET_DAMAGED, PEN_FAULTS | PEN_WARNINGS | PEN_EVENTS);
}

void test_clear_forgets_what_was_not_read(void)
{
    pen_status_note_step(&status_log, ALL);
    pen_status_note_tune(&status_log, ALL);
    pen_status_clear(&status_log);
    expect_nothing();
}

void test_a_step_advanced_unless_something_held_it(void)
{
    static const pen_status_t holding[] = {
        PEN_INPUT_NONFINITE, PEN_STATE_NONFINITE, PEN_STEP_NONFINITE, PEN_SINGULAR, PEN_HELD, PEN_BADARG
    };
    TEST_ASSERT_TRUE(pen_advanced(PEN_OK));
    TEST_ASSERT_TRUE(pen_advanced(PEN_OUTSIDE | PEN_ADOPTED | PEN_WEIGHT_NONFINITE));
    for (size_t i = 0U; i < (sizeof holding / sizeof holding[0]); i++) {
        TEST_ASSERT_FALSE(pen_advanced(holding[i]));
        TEST_ASSERT_FALSE(pen_advanced(holding[i] | PEN_OUTSIDE | PEN_ADOPTED));
    }
}
