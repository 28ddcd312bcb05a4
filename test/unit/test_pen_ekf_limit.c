/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "ekf_fixture.inc"

/* ---- limits ---- */

static pen_real_t sum_of_limit(size_t l)
{
    pen_real_t sum = (pen_real_t)0;

    for (size_t i = 0U; i < N; i++) {
        sum += limit[(l * N) + i] * x[i];
    }
    return sum;
}

static void expect_within(void)
{
    for (size_t l = 0U; l < model.n_limits; l++) {
        TEST_ASSERT_TRUE((sum_of_limit(l) >= least[l]) && (sum_of_limit(l) <= most[l]));
    }
}

void test_state_within_its_limits_stays_as_it_is(void)
{
    random_factors(f);
    for (size_t l = 0U; l < LIMITS; l++) {
        least[l] = x[l]; /* on the limit, too */
        most[l] = x[l];
    }
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_ekf_limit(&model, f, x, work));
    TEST_ASSERT_TRUE(same((pen_real_t)0, x[0]) && same((pen_real_t)1, x[1]) && same((pen_real_t)2, x[2]));
}

void test_no_limits(void)
{
    model.n_limits = 0U;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_ekf_limit(&model, f, x, work));
    TEST_ASSERT_TRUE(same((pen_real_t)2, x[2]));
}

/* P = 4, 16, 64 without correlation: 3 = 0 + 1 + 2 has to fall by 1, shared out as 4 to 16 to 64. */
void test_projection_is_the_shortest_in_the_metric_of_the_covariance(void)
{
    pen_ekf_start(&model, &filter, f, count);
    for (size_t i = 0U; i < N; i++) {
        limit[i] = (pen_real_t)1;
    }
    model.n_limits = 1U;
    most[0] = (pen_real_t)2;
    TEST_ASSERT_EQUAL_HEX32(PEN_EKF_LIMITED, pen_ekf_limit(&model, f, x, work));
    expect_within();
    /* aimed at from inside: (n + 2) 4 EPSILON (3 + 2) = 100 EPSILON, of which 32 EPSILON * 8 allows */
    expect_close((pen_real_t)-4 / (pen_real_t)84, x[0], (pen_real_t)8);
    expect_close((pen_real_t)1 - ((pen_real_t)16 / (pen_real_t)84), x[1], (pen_real_t)8);
    expect_close((pen_real_t)2 - ((pen_real_t)64 / (pen_real_t)84), x[2], (pen_real_t)8);
    TEST_ASSERT_TRUE(sum_of_limit(0U) < most[0]);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_ekf_limit(&model, f, x, work)); /* and then stays */
}

/* U(0, 2) = 1/2, D = 1: P c = (1/2, 0, 1) for c = (0, 0, 1), which moves by +3: the first state by half of that. */
void test_projection_moves_what_is_correlated(void)
{
    for (size_t j = 0U; j < N; j++) {
        for (size_t i = 0U; i < N; i++) {
            f[(j * N) + i] = (i == j) ? (pen_real_t)1 : (pen_real_t)0;
        }
    }
    f[2U * N] = (pen_real_t)0.5;
    least[2] = (pen_real_t)5;
    TEST_ASSERT_EQUAL_HEX32(PEN_EKF_LIMITED, pen_ekf_limit(&model, f, x, work));
    expect_within();
    expect_close((pen_real_t)1.5, x[0], (pen_real_t)8);
    expect_close((pen_real_t)1, x[1], (pen_real_t)1);
    expect_close((pen_real_t)5, x[2], (pen_real_t)8);
}

/* Whatever limits cut each other, they hold to the bit, in any order of sizes. */
void test_limits_hold_to_the_bit(void)
{
    uint32_t drawn = 0U;

    for (uint32_t round = 0U; round < 3000U; round++) {
        const pen_real_t size = (pen_real_t)((round % 3U) == 0U) + ((pen_real_t)100 * (pen_real_t)((round % 3U) == 1U)) + (pen_real_t)1e-3;
        random_factors(f);
        for (size_t l = 0U; l < LIMITS; l++) {
            for (size_t i = 0U; i < N; i++) {
                limit[(l * N) + i] = next_noise();
            }
            least[l] = (size * (next_noise() - (pen_real_t)1.25)) * (pen_real_t)0.5;
            most[l] = (size * (next_noise() + (pen_real_t)1.25)) * (pen_real_t)0.5;
        }
        for (size_t i = 0U; i < N; i++) {
            x[i] = ((pen_real_t)10 * size) * next_noise();
        }
        drawn += (pen_ekf_limit(&model, f, x, work) == PEN_EKF_LIMITED) ? 1U : 0U;
        expect_within();
    }
    TEST_ASSERT_GREATER_THAN_UINT32(2500U, drawn);
}

/* The same with a unit covariance, in the words of the header: rounds of projections, then a straight line to `inside`. */
static void by_hand(pen_real_t y[N])
{
    pen_real_t part = (pen_real_t)1;

    for (size_t turn = 0U; turn < (PEN_EKF_SWEEPS * model.n_limits); turn++) {
        const pen_real_t *const c = &limit[(turn % model.n_limits) * N];
        const pen_real_t over = ((c[0] * y[0]) + (c[1] * y[1]) + (c[2] * y[2])) - most[turn % model.n_limits];
        const pen_real_t share = (over > (pen_real_t)0) ? (over / ((c[0] * c[0]) + (c[1] * c[1]) + (c[2] * c[2]))) : (pen_real_t)0;
        for (size_t i = 0U; i < N; i++) {
            y[i] -= share * c[i];
        }
    }
    for (size_t l = 0U; l < model.n_limits; l++) {
        const pen_real_t *const c = &limit[l * N];
        const pen_real_t at = (c[0] * y[0]) + (c[1] * y[1]) + (c[2] * y[2]);
        const pen_real_t from_at = (c[0] * inside[0]) + (c[1] * inside[1]) + (c[2] * inside[2]);
        const pen_real_t own = (at > most[l]) ? ((most[l] - from_at) / (at - from_at)) : (pen_real_t)1;
        part = (own < part) ? own : part;
    }
    for (size_t i = 0U; i < N; i++) {
        y[i] = inside[i] + (part * (y[i] - inside[i]));
    }
}

/*
 * Two limits that cut each other at a sharp angle: after PEN_EKF_SWEEPS projections on each x is not within both. It is drawn
 * towards `inside`, no further than needed: rounding of terms of 250 is allowed for.
 */
void test_what_projections_do_not_reach_is_drawn_to_the_point_inside(void)
{
    for (size_t j = 0U; j < N; j++) {
        for (size_t i = 0U; i < N; i++) {
            f[(j * N) + i] = (i == j) ? (pen_real_t)1 : (pen_real_t)0;
            limit[(j * N) + i] = (pen_real_t)0;
        }
    }
    model.n_limits = 2U;
    limit[0] = (pen_real_t)1;
    limit[1] = (pen_real_t)-0.125;
    limit[N] = (pen_real_t)-1;
    limit[N + 1U] = (pen_real_t)-0.125;
    most[0] = (pen_real_t)1;
    most[1] = (pen_real_t)1;
    inside[0] = (pen_real_t)0.25;
    inside[1] = (pen_real_t)4; /* where the sums are -0.25 and -0.75 */
    inside[2] = (pen_real_t)2;
    x[0] = (pen_real_t)0;
    x[1] = (pen_real_t)-1000;
    x[2] = (pen_real_t)2;
    pen_real_t wanted[N] = { x[0], x[1], x[2] };
    by_hand(wanted);
    TEST_ASSERT_EQUAL_HEX32(PEN_EKF_LIMITED, pen_ekf_limit(&model, f, x, work));
    expect_within();
    for (size_t i = 0U; i < N; i++) {
        expect_close(wanted[i], x[i], (pen_real_t)1000);
    }
    TEST_ASSERT_TRUE(x[1] < (pen_real_t)0);
    expect_close((pen_real_t)1, (sum_of_limit(0U) > sum_of_limit(1U)) ? sum_of_limit(0U) : sum_of_limit(1U), (pen_real_t)256);
    expect_close((pen_real_t)2, x[2], (pen_real_t)2);
}

/* A room narrower than rounding: only the point inside is known to be in it. */
void test_room_narrower_than_rounding_ends_at_the_point_inside(void)
{
    pen_ekf_start(&model, &filter, f, count);
    for (size_t i = 0U; i < N; i++) {
        inside[i] = (pen_real_t)0.25;
        limit[i] = (pen_real_t)1;
        x[i] = (pen_real_t)9;
    }
    model.n_limits = 1U;
    least[0] = (pen_real_t)0.75;
    most[0] = (pen_real_t)0.75;
    TEST_ASSERT_EQUAL_HEX32(PEN_EKF_LIMITED, pen_ekf_limit(&model, f, x, work));
    for (size_t i = 0U; i < N; i++) {
        TEST_ASSERT_TRUE(same((pen_real_t)0.25, x[i]));
    }
}

/* From inside by 4 (n + 2) EPSILON of the sizes of sum and bound: 20 EPSILON (2 + 1), and the same from below. */
void test_a_bound_is_aimed_at_from_inside(void)
{
    start[0] = (pen_real_t)1;
    pen_ekf_start(&model, &filter, f, count);
    model.n_limits = 1U;
    most[0] = (pen_real_t)1;
    x[0] = (pen_real_t)2;
    TEST_ASSERT_EQUAL_HEX32(PEN_EKF_LIMITED, pen_ekf_limit(&model, f, x, work));
    TEST_ASSERT_TRUE(same((pen_real_t)1 - ((pen_real_t)60 * PEN_REAL_EPSILON), x[0]));
    least[0] = (pen_real_t)2;
    most[0] = (pen_real_t)9;
    inside[0] = (pen_real_t)3;
    x[0] = (pen_real_t)1;
    TEST_ASSERT_EQUAL_HEX32(PEN_EKF_LIMITED, pen_ekf_limit(&model, f, x, work));
    TEST_ASSERT_TRUE(same((pen_real_t)2 + ((pen_real_t)60 * PEN_REAL_EPSILON), x[0]));
}

/* The last resort. No limit that can be kept leads there; the second of these cannot be, as `inside` is outside. */
void test_where_nothing_else_is_known_the_state_is_the_point_inside(void)
{
    pen_ekf_start(&model, &filter, f, count);
    for (size_t i = 0U; i < N; i++) {
        inside[i] = (pen_real_t)1;
        limit[N + i] = (pen_real_t)1;
        x[i] = (pen_real_t)9;
    }
    least[1] = (pen_real_t)2;
    most[1] = (pen_real_t)2;
    TEST_ASSERT_EQUAL_HEX32(PEN_EKF_LIMITED, pen_ekf_limit(&model, f, x, work));
    for (size_t i = 0U; i < N; i++) {
        TEST_ASSERT_TRUE(same((pen_real_t)1, x[i]));
    }
}

void test_what_is_no_number_is_not_called_limited(void)
{
    pen_ekf_start(&model, &filter, f, count);
    x[1] = PEN_REAL_MAX * (pen_real_t)2;
    x[1] -= x[1];
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_ekf_limit(&model, f, x, work));
}

/* ---- finish ---- */

static void prepare_finish(void)
{
    pen_ekf_start(&model, &filter, f, count);
    random_factors(&f[N * N]);
    for (size_t i = 0U; i < TESTS; i++) {
        test[i].verdict = PEN_EKF_USED;
        test[TESTS + i].innovation = (pen_real_t)i;
        test[TESTS + i].variance = (pen_real_t)10;
        test[TESTS + i].ratio = (pen_real_t)20;
        test[TESTS + i].verdict = (i == 0U) ? PEN_EKF_USED : PEN_EKF_IS_REFUSED;
    }
    keep();
}

static void expect_held(pen_status_t wanted, pen_status_t status)
{
    TEST_ASSERT_EQUAL_HEX32(wanted, pen_ekf_finish(&model, &filter, status, f, x, test, count));
    for (size_t i = 0U; i < N; i++) {
        TEST_ASSERT_TRUE(same((pen_real_t)i, x[i]));
        for (size_t k = 0U; k < N; k++) {
            TEST_ASSERT_TRUE(same(kept[(i * N) + k], f[(i * N) + k]));
        }
    }
    TEST_ASSERT_TRUE(same(POISON, test[0].ratio) && same(POISON, test[1].innovation));
    TEST_ASSERT_EQUAL_UINT32(0U, count[PEN_EKF_USED]);
    TEST_ASSERT_EQUAL_UINT32(0U, filter.limited);
}

void test_finish_keeps_what_is_good_and_counts(void)
{
    const pen_status_t status = PEN_EKF_REFUSED | PEN_EKF_LIMITED | PEN_OUTSIDE;
    prepare_finish();
    TEST_ASSERT_EQUAL_HEX32(status, pen_ekf_finish(&model, &filter, status, f, x, test, count));
    for (size_t j = 0U; j < N; j++) {
        TEST_ASSERT_TRUE(same((pen_real_t)(N + j), x[j]));
        for (size_t i = 0U; i <= j; i++) {
            TEST_ASSERT_TRUE(same(kept[(N * N) + (j * N) + i], f[(j * N) + i]));
        }
    }
    for (size_t i = 0U; i < TESTS; i++) {
        TEST_ASSERT_TRUE(same((pen_real_t)i, test[i].innovation) && same((pen_real_t)10, test[i].variance));
        TEST_ASSERT_TRUE(same((pen_real_t)20, test[i].ratio));
    }
    TEST_ASSERT_EQUAL_UINT32(PEN_EKF_IS_REFUSED, test[1].verdict);
    TEST_ASSERT_EQUAL_UINT32(1U, count[PEN_EKF_USED]);
    TEST_ASSERT_EQUAL_UINT32(1U, count[PEN_EKF_VERDICTS + PEN_EKF_IS_REFUSED]);
    TEST_ASSERT_EQUAL_UINT32(0U, count[PEN_EKF_VERDICTS + PEN_EKF_USED]);
    TEST_ASSERT_EQUAL_UINT32(1U, filter.running);
    TEST_ASSERT_EQUAL_UINT32(0U, filter.held);
    TEST_ASSERT_EQUAL_UINT32(1U, filter.limited);
    TEST_ASSERT_EQUAL_UINT32(0U, filter.nonfinite);
    (void)pen_ekf_finish(&model, &filter, PEN_OK, f, x, test, count);
    TEST_ASSERT_EQUAL_UINT32(1U, filter.running);
    TEST_ASSERT_EQUAL_UINT32(1U, filter.limited);
    TEST_ASSERT_EQUAL_UINT32(2U, count[PEN_EKF_USED]);
}

void test_finish_holds_with_the_step(void)
{
    prepare_finish();
    expect_held(PEN_INPUT_NONFINITE, PEN_INPUT_NONFINITE | PEN_EKF_MISSING | PEN_EKF_REFUSED | PEN_EKF_LIMITED);
    TEST_ASSERT_EQUAL_UINT32(1U, filter.held);
    TEST_ASSERT_EQUAL_UINT32(0U, filter.running);
    TEST_ASSERT_EQUAL_UINT32(0U, filter.nonfinite);
}

/* In any place that counts; what no factor uses does not. */
void test_finish_holds_if_anything_is_no_number(void)
{
    const volatile pen_real_t zero = 0;

    for (size_t place = 0U; place < (N + (N * N)); place++) {
        const bool unused = (place >= N) && (((place - N) % N) > ((place - N) / N));
        pen_real_t *const at = (place < N) ? &x[N + place] : &f[(N * N) + (place - N)];
        setUp();
        prepare_finish();
        *at = ((place % 2U) == 0U) ? (zero / zero) : ((pen_real_t)1 / zero);
        if (unused) {
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_ekf_finish(&model, &filter, PEN_OK, f, x, test, count));
        } else {
            kept[(N * N) - 1U] = f[(N * N) - 1U];
            expect_held(PEN_EKF_NONFINITE, PEN_OK);
            TEST_ASSERT_EQUAL_UINT32(1U, filter.nonfinite);
            TEST_ASSERT_EQUAL_UINT32(1U, filter.held);
            (void)pen_ekf_finish(&model, &filter, PEN_EKF_NONFINITE, f, x, test, count);
            TEST_ASSERT_EQUAL_UINT32(2U, filter.nonfinite);
            TEST_ASSERT_EQUAL_UINT32(2U, filter.held);
        }
    }
}

/* A verdict that memory has changed counts somewhere, and writes nowhere else. */
void test_finish_with_a_damaged_verdict_stays_within_its_counters(void)
{
    prepare_finish();
    test[TESTS + 1U].verdict = UINT32_MAX;
    (void)pen_ekf_finish(&model, &filter, PEN_OK, f, x, test, count);
    TEST_ASSERT_EQUAL_UINT32(1U, count[PEN_EKF_VERDICTS + PEN_EKF_IS_REFUSED]);
}
