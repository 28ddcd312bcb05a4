/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "penode/pen_monitor.h"
#include "penode/pen_port.h"
#include "unity.h"

#define N      3U
#define TESTS  2U
#define CAUSES 2U
#define ALL    (CAUSES * N)
#define POISON ((pen_real_t) - 99)

static pen_monitor_model_t model;
static pen_monitor_t monitor;
static pen_monitor_sample_t sample;
static pen_real_t phi[N * N];
static pen_real_t h[TESTS * N];
static pen_real_t gain[TESTS * N];
static pen_real_t direct[CAUSES * TESTS];
static pen_ekf_test_t test[TESTS];
static pen_real_t s[(2U * ALL) + 1U];
static pen_real_t effect[(2U * ALL) + 1U];
static pen_monitor_test_t sums[CAUSES + 2U];

static bool same(pen_real_t a, pen_real_t b)
{
    return (a <= b) && (a >= b);
}

void setUp(void)
{
    const pen_monitor_model_t whole = { 77U, N, TESTS, CAUSES, (pen_real_t)0.5, (pen_real_t)4, (pen_real_t)0.25, (pen_real_t)1 };
    const pen_monitor_sample_t given = { phi, h, gain, direct, test, true };
    model = whole;
    sample = given;
    for (size_t i = 0U; i < (N * N); i++) {
        phi[i] = (pen_real_t)0;
    }
    for (size_t i = 0U; i < N; i++) {
        phi[(i * N) + i] = (pen_real_t)1;
    }
    for (size_t i = 0U; i < (TESTS * N); i++) {
        h[i] = (pen_real_t)0;
        gain[i] = (pen_real_t)0;
    }
    for (size_t i = 0U; i < (CAUSES * TESTS); i++) {
        direct[i] = (pen_real_t)0;
    }
    for (size_t i = 0U; i < TESTS; i++) {
        test[i].innovation = (pen_real_t)0;
        test[i].variance = (pen_real_t)1;
        test[i].ratio = (pen_real_t)0;
        test[i].verdict = PEN_EKF_USED;
    }
    for (size_t i = 0U; i <= (2U * ALL); i++) {
        s[i] = POISON;
        effect[i] = POISON;
    }
    for (size_t i = 0U; i <= CAUSES; i++) {
        sums[i].sum = POISON;
        sums[i].raised = 9U;
        sums[i].count = 9U;
    }
    sums[CAUSES + 1U].count = 99U;
    monitor.ready = 9U;
    monitor.running = 9U;
    monitor.nonfinite = 9U;
    pen_monitor_start(&model, &monitor, s, effect, sums);
}

void tearDown(void)
{
    TEST_ASSERT_TRUE(same(POISON, s[2U * ALL]) && same(POISON, effect[2U * ALL])); /* what lies behind is not written to */
    TEST_ASSERT_EQUAL_UINT32(99U, sums[CAUSES + 1U].count);
}

static pen_status_t step(void)
{
    return pen_monitor_step(&model, &monitor, &sample, s, effect, sums);
}

void test_start_is_at_rest(void)
{
    TEST_ASSERT_EQUAL_UINT32(77U, monitor.ready);
    TEST_ASSERT_EQUAL_UINT32(0U, monitor.running);
    TEST_ASSERT_EQUAL_UINT32(0U, monitor.nonfinite);
    for (size_t i = 0U; i < (2U * ALL); i++) {
        TEST_ASSERT_TRUE(same((pen_real_t)0, s[i]) && same((pen_real_t)0, effect[i]));
    }
    for (size_t i = 0U; i <= CAUSES; i++) {
        TEST_ASSERT_TRUE(same((pen_real_t)0, sums[i].sum));
        TEST_ASSERT_EQUAL_UINT32(0U, sums[i].raised | sums[i].count);
    }
}

/* m = 2 of the first cause, 0 of the other: l = 2 (3 - 1) / 4 = 1. */
void test_score_is_the_log_likelihood_ratio(void)
{
    direct[0] = (pen_real_t)2;
    test[0].innovation = (pen_real_t)3;
    test[0].variance = (pen_real_t)4;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, step());
    TEST_ASSERT_TRUE(same((pen_real_t)1, sums[0].sum));
    TEST_ASSERT_TRUE(same((pen_real_t)0, sums[1].sum));
    test[0].innovation = (pen_real_t)-9; /* 2 (-9 - 1) / 4 = -5: the sum ends at 0 */
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, step());
    TEST_ASSERT_TRUE(same((pen_real_t)0, sums[0].sum));
}

/* m = 2 and 1 of the second cause: l = 2 (3 - 1) / 4 + 1 (1.5 - 0.5) / 1. */
void test_each_cause_has_a_change_of_the_measurements(void)
{
    direct[TESTS] = (pen_real_t)2;
    direct[TESTS + 1U] = (pen_real_t)1;
    test[0].innovation = (pen_real_t)3;
    test[0].variance = (pen_real_t)4;
    test[1].innovation = (pen_real_t)1.5;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, step());
    TEST_ASSERT_TRUE(same((pen_real_t)0, sums[0].sum));
    TEST_ASSERT_TRUE(same((pen_real_t)2, sums[1].sum));
}

/* l = 0.25 * 12 - 1, and 0.25 * 8 - 1: 2 + 1; then the threshold of 4. */
void test_score_of_anything_else(void)
{
    test[0].ratio = (pen_real_t)12;
    test[1].ratio = (pen_real_t)8;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, step());
    TEST_ASSERT_TRUE(same((pen_real_t)3, sums[2].sum));
    TEST_ASSERT_EQUAL_HEX32(PEN_MONITOR_OTHER, step());
    TEST_ASSERT_TRUE(same((pen_real_t)4, sums[2].sum));
}

/* First sample: no time has passed. Then s = phi (s + e/2) + e'/2 of the second cause. */
void test_sensitivity_goes_through_the_step(void)
{
    phi[1] = (pen_real_t)2; /* s0 + 2 s1 */
    effect[ALL + N] = (pen_real_t)4;
    effect[ALL + N + 1U] = (pen_real_t)8;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, step());
    TEST_ASSERT_EQUAL_UINT32(1U, monitor.running);
    TEST_ASSERT_TRUE(same((pen_real_t)0, s[N]) && same((pen_real_t)0, s[N + 1U]));
    TEST_ASSERT_TRUE(same((pen_real_t)4, effect[N]) && same((pen_real_t)8, effect[N + 1U]));
    effect[ALL + N] = (pen_real_t)2;
    effect[ALL + N + 1U] = (pen_real_t)6;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, step()); /* before: 2, 4: 2 + 8 + 1 and 4 + 3 */
    TEST_ASSERT_TRUE(same((pen_real_t)11, s[N]) && same((pen_real_t)7, s[N + 1U]));
    TEST_ASSERT_TRUE(same((pen_real_t)0, s[0]) && same((pen_real_t)0, s[1]));
}

/* s = 2, 4 of the first cause; h = 1, 0.5 then 0, 2 of the state that the first measurement has corrected. */
void test_sensitivity_goes_through_the_measurements(void)
{
    model.threshold = (pen_real_t)10;
    s[0] = (pen_real_t)2;
    s[1] = (pen_real_t)4;
    h[0] = (pen_real_t)1;
    h[1] = (pen_real_t)0.5;
    h[N + 1U] = (pen_real_t)2;
    gain[0] = (pen_real_t)1;
    gain[1] = (pen_real_t)2;
    gain[N] = (pen_real_t)4;
    test[0].variance = (pen_real_t)8;
    test[0].innovation = (pen_real_t)10;
    test[1].innovation = (pen_real_t)4;
    TEST_ASSERT_EQUAL_HEX32(PEN_MONITOR_CAUSE, step());
    /* m = 4, share 0.5, l = 0.5 (10 - 2) = 4; s = 1.5, 3; then m = 6, l = 6 (4 - 3) = 6; s = 1.5 - 24, 3 */
    TEST_ASSERT_TRUE(same((pen_real_t)10, sums[0].sum));
    TEST_ASSERT_TRUE(same((pen_real_t)-22.5, s[0]) && same((pen_real_t)3, s[1]));
}

void test_measurement_that_is_not_used_says_nothing(void)
{
    static const uint32_t verdicts[3] = { PEN_EKF_NOT_OFFERED, PEN_EKF_IS_MISSING, PEN_EKF_IS_REFUSED };

    for (size_t k = 0U; k < 3U; k++) {
        s[0] = (pen_real_t)2;
        h[0] = (pen_real_t)1;
        gain[0] = PEN_REAL_MAX;
        direct[0] = (pen_real_t)5;
        test[0].innovation = PEN_REAL_MAX;
        test[0].variance = (pen_real_t)0;
        test[0].ratio = PEN_REAL_MAX;
        test[0].verdict = verdicts[k];
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, step());
        TEST_ASSERT_TRUE(same((pen_real_t)0, sums[0].sum) && same((pen_real_t)0, sums[2].sum));
        TEST_ASSERT_TRUE(same((pen_real_t)2, s[0]));
    }
}

/* Raised at the threshold of 4, which no sum exceeds, until the sum is back at 0. */
void test_a_test_is_raised_and_falls(void)
{
    direct[0] = (pen_real_t)2;
    test[0].innovation = (pen_real_t)3; /* 2 (3 - 1) = 4 */
    TEST_ASSERT_EQUAL_HEX32(PEN_MONITOR_CAUSE, step());
    TEST_ASSERT_EQUAL_UINT32(1U, sums[0].raised);
    TEST_ASSERT_EQUAL_UINT32(1U, sums[0].count);
    (void)step();
    TEST_ASSERT_EQUAL_HEX32(PEN_MONITOR_CAUSE, step());
    TEST_ASSERT_TRUE(same((pen_real_t)4, sums[0].sum));
    TEST_ASSERT_EQUAL_UINT32(1U, sums[0].count);
    test[0].innovation = (pen_real_t)0; /* -2 */
    TEST_ASSERT_EQUAL_HEX32(PEN_MONITOR_CAUSE, step());
    TEST_ASSERT_TRUE(same((pen_real_t)2, sums[0].sum));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, step());
    TEST_ASSERT_EQUAL_UINT32(0U, sums[0].raised);
    test[0].innovation = (pen_real_t)3;
    TEST_ASSERT_EQUAL_HEX32(PEN_MONITOR_CAUSE, step());
    TEST_ASSERT_EQUAL_UINT32(2U, sums[0].count);
}

/* Only the lowest bit says whether a test is raised: another one is damage. */
void test_a_damaged_flag_is_not_kept(void)
{
    direct[0] = (pen_real_t)2;
    test[0].innovation = (pen_real_t)2; /* 2 */
    sums[0].raised = 6U;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, step());
    TEST_ASSERT_EQUAL_UINT32(0U, sums[0].raised);
    TEST_ASSERT_EQUAL_UINT32(0U, sums[0].count);
}

void test_monitor_holds_with_the_filter(void)
{
    direct[0] = (pen_real_t)2;
    test[0].innovation = (pen_real_t)2; /* 2 */
    (void)step();
    sample.advanced = false;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, step());
    TEST_ASSERT_TRUE(same((pen_real_t)2, sums[0].sum));
    s[0] = (pen_real_t)3;
    phi[0] = (pen_real_t)7;
    effect[ALL] = (pen_real_t)9;
    test[0].innovation = PEN_REAL_MAX * (pen_real_t)2; /* flagged by the filter */
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, step());
    TEST_ASSERT_TRUE(same((pen_real_t)2, sums[0].sum) && same((pen_real_t)3, s[0]) && same((pen_real_t)0, effect[0]));
    TEST_ASSERT_EQUAL_UINT32(0U, monitor.nonfinite);
}

void test_what_is_no_number_is_not_taken_over(void)
{
    const pen_real_t big = PEN_REAL_MAX * (pen_real_t)2;

    for (size_t k = 0U; k < 4U; k++) {
        effect[ALL] = (k == 0U) ? big : (pen_real_t)0;
        phi[N + 1U] = (k == 1U) ? (big - big) : (pen_real_t)1;
        direct[2] = (k == 2U) ? big : (pen_real_t)0;
        test[1].ratio = (k == 3U) ? big : (pen_real_t)0;
        s[0] = (pen_real_t)3;
        TEST_ASSERT_EQUAL_HEX32(PEN_MONITOR_NONFINITE, step());
        TEST_ASSERT_EQUAL_UINT32((uint32_t)k + 1U, monitor.nonfinite);
        TEST_ASSERT_EQUAL_UINT32(0U, monitor.running);
        for (size_t i = 0U; i <= CAUSES; i++) {
            TEST_ASSERT_TRUE(same((pen_real_t)0, sums[i].sum));
        }
        TEST_ASSERT_TRUE(same((pen_real_t)3, s[0]) && same((pen_real_t)0, s[N]) && same((pen_real_t)0, effect[0]));
    }
}

/* A score that overflows, of a sensitivity that is finite. */
void test_a_score_that_overflows_is_not_added(void)
{
    direct[0] = (pen_real_t)4;
    direct[TESTS] = (pen_real_t)0.5;
    test[0].innovation = PEN_REAL_MAX;
    test[0].variance = (pen_real_t)1;
    test[1].verdict = PEN_EKF_IS_MISSING;
    TEST_ASSERT_EQUAL_HEX32(PEN_MONITOR_CAUSE | PEN_MONITOR_NONFINITE, step()); /* the other cause is right */
    TEST_ASSERT_TRUE(same((pen_real_t)0, sums[0].sum) && same((pen_real_t)4, sums[1].sum));
    TEST_ASSERT_EQUAL_UINT32(0U, sums[0].raised);
}

/* A sensitivity that overflows in the last measurement, which the score does not meet any more. */
void test_a_score_without_a_sensitivity_is_not_added(void)
{
    direct[TESTS + 1U] = (pen_real_t)2;
    test[1].innovation = (pen_real_t)3; /* 4 */
    gain[N] = PEN_REAL_MAX;
    TEST_ASSERT_EQUAL_HEX32(PEN_MONITOR_NONFINITE, step());
    TEST_ASSERT_TRUE(same((pen_real_t)0, sums[1].sum) && same((pen_real_t)0, s[N]));
}

/* A sensitivity that overflows while nothing is measured. */
void test_a_sensitivity_that_overflows_is_not_taken_over(void)
{
    test[0].verdict = PEN_EKF_IS_MISSING;
    test[1].verdict = PEN_EKF_NOT_OFFERED;
    phi[0] = (pen_real_t)2;
    s[N] = PEN_REAL_MAX;
    TEST_ASSERT_EQUAL_HEX32(PEN_MONITOR_NONFINITE, step());
    TEST_ASSERT_TRUE(same(PEN_REAL_MAX, s[N]));
    TEST_ASSERT_EQUAL_UINT32(1U, monitor.nonfinite);
}

void test_no_cause_at_all(void)
{
    model.n_causes = 0U;
    pen_monitor_start(&model, &monitor, s, effect, sums);
    test[0].ratio = (pen_real_t)40; /* 10 - 1 - 1 */
    TEST_ASSERT_EQUAL_HEX32(PEN_MONITOR_OTHER, step());
    TEST_ASSERT_TRUE(same((pen_real_t)4, sums[0].sum));
}
