/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "penode/pen_step.h"

#include "unity.h"

#define LAST 3U /* states and outputs */
#define KEPT 2U /* inputs */

static pen_instance_t self;
static pen_real_t row[3U * LAST];
static pen_real_t u[2U * KEPT];
static pen_real_t bad[3]; /* NaN, Inf, -Inf */

void setUp(void)
{
    volatile pen_real_t zero = (pen_real_t)0;

    bad[0] = zero / zero;
    bad[1] = (pen_real_t)1 / zero;
    bad[2] = (pen_real_t)-1 / zero;
    memset(&self, 0, sizeof self);
    for (uint32_t i = 0U; i < (3U * LAST); i++) {
        row[i] = (pen_real_t)i;
    }
    for (uint32_t i = 0U; i < (2U * KEPT); i++) {
        u[i] = (pen_real_t)(100U + i);
    }
}

void tearDown(void) {}

/* The same number; a sum of small integers has no rounding. */
static void expect(int32_t right, pen_real_t value)
{
    TEST_ASSERT_TRUE(value >= (pen_real_t)right);
    TEST_ASSERT_TRUE(value <= (pen_real_t)right);
}

static void expect_row(uint32_t which, int32_t first)
{
    for (uint32_t i = 0U; i < LAST; i++) {
        expect(first + (int32_t)i, row[(which * LAST) + i]);
    }
}

void test_copy_unit_and_inner(void)
{
    static const pen_real_t a[3] = { (pen_real_t)1, (pen_real_t)2, (pen_real_t)3 };
    pen_real_t d[2U * 3U];

    pen_step_copy(3U, a, d);
    TEST_ASSERT_EQUAL_MEMORY(a, d, sizeof a);
    expect(14, pen_step_inner(3U, a, d));
    pen_step_unit(2U, 3U, d);
    for (int32_t n = 0; n < 2; n++) {
        for (int32_t c = 0; c < 3; c++) {
            expect((n == c) ? 1 : 0, d[(n * 3) + c]);
        }
    }
}

void test_history_begins_with_good_samples(void)
{
    static const uint32_t samples[] = { 0U, 1U, 3U, 7U };

    for (uint32_t k = 0U; k < 4U; k++) {
        self.running = samples[k];
        for (uint32_t past = 0U; past < 3U; past++) {
            expect((k > past) ? 1 : 0, pen_step_history(&self, past));
        }
    }
}

void test_range_and_clamp(void)
{
    const pen_real_t least = (pen_real_t)-2;
    const pen_real_t most = (pen_real_t)3;
    const pen_status_t flags = PEN_INPUT_RANGE | PEN_HELD;

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_step_range(least, least, most, flags));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_step_range(most, least, most, flags));
    TEST_ASSERT_EQUAL_HEX32(flags, pen_step_range((pen_real_t)-2.000001F, least, most, flags));
    TEST_ASSERT_EQUAL_HEX32(flags, pen_step_range((pen_real_t)3.000001F, least, most, flags));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_step_range(bad[0], least, most, flags));
    TEST_ASSERT_EQUAL_HEX32(flags, pen_step_range(bad[1], least, most, flags));
    expect(-2, pen_step_clamp((pen_real_t)-5, least, most));
    expect(3, pen_step_clamp((pen_real_t)5, least, most));
    expect(1, pen_step_clamp((pen_real_t)1, least, most));
    expect(3, pen_step_clamp(bad[1], least, most));
    TEST_ASSERT_FALSE(pen_finite(1U, (const pen_real_t[]){ pen_step_clamp(bad[0], least, most) }));
}

/* A round of `round` steps: each place that is damaged is found once in it. */
static void scrub(uint32_t round, uint32_t length, pen_real_t value[], uint32_t pieces, pen_piece_t piece[], pen_real_t *place)
{
    const pen_real_t kept = (place == NULL) ? (pen_real_t)0 : *place;
    const uint32_t networks = (piece == NULL) ? 0U : 2U;

    for (uint32_t k = 0U; k < 3U; k++) {
        uint32_t found = 0U;
        if (place != NULL) {
            *place = bad[k];
        }
        for (uint32_t i = 0U; i < round; i++) {
            found += (pen_step_scrub(&self, round, length, value, networks, pieces, piece) == PEN_WEIGHT_NONFINITE) ? 1U : 0U;
        }
        TEST_ASSERT_EQUAL_UINT32((place != NULL) ? 1U : 0U, (found > 0U) ? 1U : 0U);
    }
    if (place != NULL) {
        *place = kept;
    }
}

void test_scrub_meets_each_value_and_piece_within_a_round(void)
{
    static pen_real_t value[5];
    static pen_piece_t piece[2U * 8U];

    memset(value, 0, sizeof value);
    memset(piece, 0, sizeof piece);
    for (uint32_t i = 0U; i < 5U; i++) {
        scrub(5U, 5U, value, 1U, NULL, &value[i]);  /* values only */
        scrub(8U, 5U, value, 8U, piece, &value[i]); /* more pieces than values */
        scrub(5U, 5U, value, 4U, piece, &value[i]); /* more values than pieces */
    }
    for (uint32_t i = 0U; i < 16U; i++) {
        pen_real_t *const number[] = { &piece[i].start, &piece[i].offset, &piece[i].slope };
        for (uint32_t k = 0U; k < 3U; k++) {
            scrub(8U, 0U, NULL, 8U, piece, number[k]); /* pieces only */
            scrub(8U, 5U, value, 8U, piece, number[k]);
            if (i < 8U) {
                scrub(5U, 5U, value, 4U, piece, number[k]);
            }
        }
    }
    scrub(8U, 5U, value, 8U, piece, NULL);
    self.scrub = UINT32_MAX; /* damaged */
    scrub(8U, 5U, value, 8U, piece, NULL);
}

void test_a_good_step_is_kept_twice(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_OUTSIDE, pen_step_finish(&self, LAST, row, KEPT, u, 1U, PEN_INPUT_NONFINITE, PEN_OUTSIDE));
    expect_row(PEN_ROW_LAST, 6);
    expect_row(PEN_ROW_KEPT, 6);
    expect(102, u[0]);
    TEST_ASSERT_EQUAL_UINT32(1U, self.running);
    TEST_ASSERT_EQUAL_UINT32(1U, self.log.count[4]);
}

void test_a_bad_step_leaves_the_last_one(void)
{
    row[8] = bad[0];
    TEST_ASSERT_EQUAL_HEX32(PEN_STEP_NONFINITE, pen_step_finish(&self, LAST, row, KEPT, u, 1U, PEN_INPUT_NONFINITE, PEN_OK));
    expect_row(PEN_ROW_LAST, 3);
    expect_row(PEN_ROW_KEPT, 3);
    expect(102, u[0]);
    TEST_ASSERT_EQUAL_UINT32(0U, self.running);
}

void test_a_bad_state_comes_back_from_its_copy(void)
{
    row[8] = bad[0]; /* follows from it: not reported twice */
    row[3] = bad[1];
    TEST_ASSERT_EQUAL_HEX32(PEN_STATE_NONFINITE, pen_step_finish(&self, LAST, row, KEPT, u, 1U, PEN_INPUT_NONFINITE, PEN_STATE_NONFINITE));
    expect_row(PEN_ROW_LAST, 0);
    expect_row(PEN_ROW_KEPT, 0);
}

void test_a_refused_input_is_not_taken_over(void)
{
    const pen_status_t refused = PEN_INPUT_NONFINITE | PEN_INPUT_RANGE;

    row[8] = bad[0];
    TEST_ASSERT_EQUAL_HEX32(PEN_INPUT_NONFINITE, pen_step_finish(&self, LAST, row, KEPT, u, 1U, refused, PEN_INPUT_NONFINITE));
    expect(100, u[0]);
    TEST_ASSERT_EQUAL_HEX32(refused & PEN_INPUT_RANGE, pen_step_finish(&self, 0U, row, KEPT, u, 1U, refused, PEN_INPUT_RANGE));
    expect(100, u[0]);
    TEST_ASSERT_EQUAL_HEX32(PEN_INPUT_RANGE, pen_step_finish(&self, 0U, row, KEPT, u, 1U, PEN_INPUT_NONFINITE, PEN_INPUT_RANGE));
    expect(102, u[0]);
}

void test_history_counts_good_samples_only(void)
{
    static const uint32_t right[] = { 1U, 3U, 7U, 7U };

    for (uint32_t k = 0U; k < 4U; k++) {
        (void)pen_step_finish(&self, LAST, row, KEPT, u, 3U, PEN_INPUT_NONFINITE, PEN_OK);
        (void)pen_step_finish(&self, LAST, row, KEPT, u, 3U, PEN_INPUT_NONFINITE, PEN_HELD);
        TEST_ASSERT_EQUAL_UINT32(right[k], self.running);
    }
}
