/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "ekf_fixture.inc"

/* P = U D U' of factors. */
static void covariance(const pen_real_t factors[], pen_real_t p[N][N])
{
    for (size_t i = 0U; i < N; i++) {
        for (size_t k = 0U; k < N; k++) {
            p[i][k] = (pen_real_t)0;
            for (size_t j = (i > k) ? i : k; j < N; j++) {
                const pen_real_t a = (i == j) ? (pen_real_t)1 : factors[(j * N) + i];
                const pen_real_t b = (k == j) ? (pen_real_t)1 : factors[(j * N) + k];
                p[i][k] += (a * factors[(j * N) + j]) * b;
            }
        }
    }
}

static void expect_kept(void)
{
    for (size_t i = 0U; i < (2U * N * N); i++) {
        TEST_ASSERT_TRUE(same(kept[i], f[i]));
    }
}

/* ---- start ---- */

void test_start_sets_factors_and_clears_head_and_counters(void)
{
    start[1] = (pen_real_t)0;
    pen_ekf_start(&model, &filter, f, count);
    for (size_t j = 0U; j < N; j++) {
        for (size_t i = 0U; i < N; i++) {
            const pen_real_t wanted = (j == 1U) ? least_d[1] : start[j];
            TEST_ASSERT_TRUE(same((i == j) ? wanted : (pen_real_t)0, f[(j * N) + i]));
        }
    }
    TEST_ASSERT_TRUE(same(POISON, f[N * N]));
    TEST_ASSERT_EQUAL_UINT32(77U, filter.ready);
    TEST_ASSERT_EQUAL_UINT32(0U, filter.running + filter.held + filter.limited + filter.nonfinite);
    for (size_t i = 0U; i < (TESTS * PEN_EKF_VERDICTS); i++) {
        TEST_ASSERT_EQUAL_UINT32(0U, count[i]);
    }
}

/* ---- prediction ---- */

/* 0.5^2 * 4 + 2 = 3 */
void test_predict_one_state(void)
{
    static const pen_real_t phi[1] = { (pen_real_t)0.5 };
    static const pen_real_t gamma[1] = { 1 };
    model.n_x = 1U;
    model.n_w = 1U;
    q[0] = (pen_real_t)2;
    f[0] = (pen_real_t)4;
    pen_ekf_predict(&model, phi, gamma, (pen_real_t)1, f, &f[N * N], work);
    TEST_ASSERT_TRUE(same((pen_real_t)3, f[N * N]));
    pen_ekf_predict(&model, phi, gamma, (pen_real_t)0, f, &f[N * N], work);
    TEST_ASSERT_TRUE(same((pen_real_t)1, f[N * N]));
    TEST_ASSERT_TRUE(same((pen_real_t)4, f[0]));
}

/* Against phi P phi' + gamma Q gamma', term by term. */
static void expect_prediction(pen_real_t phi[N][N], pen_real_t gamma[N][SOURCES], pen_real_t share)
{
    pen_real_t p[N][N];
    pen_real_t found[N][N];

    covariance(f, p);
    pen_ekf_predict(&model, &phi[0][0], &gamma[0][0], share, f, &f[N * N], work);
    covariance(&f[N * N], found);
    for (size_t i = 0U; i < N; i++) {
        for (size_t k = 0U; k < N; k++) {
            pen_real_t wanted = (pen_real_t)0;
            for (size_t a = 0U; a < N; a++) {
                for (size_t b = 0U; b < N; b++) {
                    wanted += (phi[i][a] * p[a][b]) * phi[k][b];
                }
                wanted += share * ((gamma[i][a] * q[a]) * gamma[k][a]);
            }
            expect_close(wanted, found[i][k], (pen_real_t)32);
        }
        TEST_ASSERT_TRUE(f[(N * N) + (i * N) + i] >= least_d[i]);
    }
}

void test_predict_is_that_of_the_whole_matrix(void)
{
    pen_real_t phi[N][N];
    pen_real_t gamma[N][SOURCES];

    for (uint32_t round = 0U; round < 200U; round++) {
        random_factors(f);
        for (size_t i = 0U; i < N; i++) {
            for (size_t k = 0U; k < N; k++) {
                phi[i][k] = next_noise();
                gamma[i][k] = next_noise();
            }
            q[i] = (pen_real_t)1 + next_noise();
        }
        expect_prediction(phi, gamma, ((round % 2U) == 0U) ? (pen_real_t)1 : (pen_real_t)0);
    }
}

/* Sources 0 and 1 disturb states 0 and 1 alone, source 2 all. */
void test_predict_with_sources_that_act_on_one_state(void)
{
    pen_real_t phi[N][N];
    pen_real_t gamma[N][SOURCES] = { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 0 } };

    for (uint32_t round = 0U; round < 50U; round++) {
        random_factors(f);
        for (size_t i = 0U; i < N; i++) {
            for (size_t k = 0U; k < N; k++) {
                phi[i][k] = next_noise();
            }
            gamma[i][2] = next_noise();
            q[i] = (pen_real_t)1 + next_noise();
        }
        expect_prediction(phi, gamma, (pen_real_t)1);
    }
}

void test_predict_without_sources(void)
{
    pen_real_t phi[N][N] = { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } };

    model.n_w = 0U;
    random_factors(f);
    pen_ekf_predict(&model, &phi[0][0], NULL, (pen_real_t)1, f, &f[N * N], work);
    for (size_t j = 0U; j < N; j++) {
        for (size_t i = 0U; i <= j; i++) {
            expect_close(f[(j * N) + i], f[(N * N) + (j * N) + i], (pen_real_t)4);
        }
    }
}

/* All states become one, and then none: D stays at its floor. */
void test_predict_of_states_that_depend_on_each_other_stays_above_the_floor(void)
{
    pen_real_t phi[N][N] = { { 1, 1, 1 }, { 1, 1, 1 }, { 1, 1, 1 } };
    const pen_real_t gamma[N][SOURCES] = { { 0 } };

    random_factors(f);
    pen_ekf_predict(&model, &phi[0][0], &gamma[0][0], (pen_real_t)1, f, &f[N * N], work);
    TEST_ASSERT_TRUE(f[(2U * N * N) - 1U] > (pen_real_t)0.5);
    for (size_t i = 0U; i < (N * N); i++) {
        phi[i / N][i % N] = (pen_real_t)0;
    }
    pen_ekf_predict(&model, &phi[0][0], &gamma[0][0], (pen_real_t)1, f, &f[N * N], work);
    for (size_t i = 0U; i < N; i++) {
        TEST_ASSERT_TRUE(same(least_d[i], f[(N * N) + (i * N) + i]));
    }
}

/* ---- measurement ---- */

/* P = 1 and r = 1: S = 2, gain 1/2, P = 1/2. */
void test_update_of_one_state(void)
{
    static const pen_real_t h[1] = { 1 };
    model.n_x = 1U;
    f[0] = (pen_real_t)1;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_ekf_update(&model, 0U, h, (pen_real_t)3, true, f, dx, work, test));
    TEST_ASSERT_TRUE(same((pen_real_t)0.5, f[0]));
    TEST_ASSERT_TRUE(same((pen_real_t)1.5, dx[0]));
    TEST_ASSERT_TRUE(same((pen_real_t)3, test[0].innovation));
    TEST_ASSERT_TRUE(same((pen_real_t)2, test[0].variance));
    TEST_ASSERT_TRUE(same((pen_real_t)4.5, test[0].ratio));
    TEST_ASSERT_EQUAL_UINT32(PEN_EKF_USED, test[0].verdict);
    /* the next one is measured less what the first has corrected: 3 - 1.5, with S = 1.5 */
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_ekf_update(&model, 1U, h, (pen_real_t)3, true, f, dx, work, test));
    TEST_ASSERT_TRUE(same((pen_real_t)1.5, test[0].innovation));
    expect_close((pen_real_t)2, dx[0], (pen_real_t)2);
    expect_close((pen_real_t)1 / (pen_real_t)3, f[0], (pen_real_t)1);
}

/* Against P - P h h' P / S and P h z / S. */
void test_update_is_that_of_the_whole_matrix(void)
{
    for (uint32_t round = 0U; round < 200U; round++) {
        pen_real_t p[N][N];
        pen_real_t found[N][N];
        pen_real_t h[N];
        pen_real_t gain[N];
        const pen_real_t z = next_noise();
        random_factors(f);
        covariance(f, p);
        r[1] = (pen_real_t)1.25 + next_noise();
        pen_real_t s = r[1];
        for (size_t i = 0U; i < N; i++) {
            h[i] = next_noise();
            dx[i] = (pen_real_t)0;
        }
        for (size_t i = 0U; i < N; i++) {
            gain[i] = (pen_real_t)0;
            for (size_t k = 0U; k < N; k++) {
                gain[i] += p[i][k] * h[k];
            }
            s += h[i] * gain[i];
        }
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_ekf_update(&model, 1U, h, z, true, f, dx, work, test));
        covariance(f, found);
        expect_close(s, test[0].variance, (pen_real_t)16);
        expect_close((z * z) / s, test[0].ratio, (pen_real_t)16);
        for (size_t i = 0U; i < N; i++) {
            expect_close((gain[i] * z) / s, dx[i], (pen_real_t)16);
            for (size_t k = 0U; k < N; k++) {
                expect_close(p[i][k] - ((gain[i] * gain[k]) / s), found[i][k], (pen_real_t)16);
            }
        }
    }
}

/* With a measurement that is far better than all the rest, and no noise, D ends at its floor, not at 0. */
void test_update_stays_above_the_floor(void)
{
    static const pen_real_t h[N] = { 1, 1, 1 };
    pen_ekf_start(&model, &filter, f, count);
    r[0] = (pen_real_t)0x1p-90;
    for (uint32_t round = 0U; round < 200U; round++) {
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_ekf_update(&model, 0U, h, (pen_real_t)0, true, f, dx, work, test));
    }
    TEST_ASSERT_TRUE(same(least_d[0], f[0]));
}

static void expect_unused(bool offered, pen_real_t z, pen_status_t flag, uint32_t verdict)
{
    static const pen_real_t h[N] = { 1, -2, (pen_real_t)0.5 };
    random_factors(f);
    f[N] = -(pen_real_t)0; /* so is the sign of 0 */
    keep();
    dx[0] = (pen_real_t)7;
    TEST_ASSERT_EQUAL_HEX32(flag, pen_ekf_update(&model, 0U, h, z, offered, f, dx, work, test));
    TEST_ASSERT_EQUAL_UINT32(verdict, test[0].verdict);
    expect_kept();
    TEST_ASSERT_TRUE(((pen_real_t)1 / f[N]) < (pen_real_t)0);
    TEST_ASSERT_TRUE(same((pen_real_t)7, dx[0]) && same((pen_real_t)0, dx[1]) && same((pen_real_t)0, dx[2]));
}

void test_measurement_that_is_not_used_changes_no_bit(void)
{
    const volatile pen_real_t zero = 0;

    expect_unused(false, (pen_real_t)1, PEN_OK, PEN_EKF_NOT_OFFERED);
    TEST_ASSERT_TRUE(same((pen_real_t)0, test[0].innovation) && same((pen_real_t)0, test[0].ratio));
    expect_unused(false, zero / zero, PEN_OK, PEN_EKF_NOT_OFFERED);
    expect_unused(true, zero / zero, PEN_EKF_MISSING, PEN_EKF_IS_MISSING);
    TEST_ASSERT_TRUE(same((pen_real_t)0, test[0].innovation) && same((pen_real_t)0, test[0].ratio));
    expect_unused(true, (pen_real_t)1 / zero, PEN_EKF_MISSING, PEN_EKF_IS_MISSING);
    expect_unused(true, (pen_real_t)-1 / zero, PEN_EKF_MISSING, PEN_EKF_IS_MISSING);
    expect_unused(true, (pen_real_t)1000, PEN_EKF_REFUSED, PEN_EKF_IS_REFUSED);
    TEST_ASSERT_TRUE(same((pen_real_t)993, test[0].innovation)); /* less what was corrected before */
    gate[0] = PEN_REAL_MAX; /* no gate, but a square beyond all numbers */
    expect_unused(true, PEN_REAL_MAX, PEN_EKF_REFUSED, PEN_EKF_IS_REFUSED);
}

/* S = 4 and z = 10: ratio 25 */
void test_gate_is_the_largest_ratio_that_is_used(void)
{
    static const pen_real_t h[1] = { 1 };
    model.n_x = 1U;
    f[0] = (pen_real_t)3;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_ekf_update(&model, 0U, h, (pen_real_t)10, true, f, dx, work, test));
    f[0] = (pen_real_t)3;
    dx[0] = (pen_real_t)0;
    gate[0] = (pen_real_t)25 * ((pen_real_t)1 - PEN_REAL_EPSILON);
    TEST_ASSERT_EQUAL_HEX32(PEN_EKF_REFUSED, pen_ekf_update(&model, 0U, h, (pen_real_t)10, true, f, dx, work, test));
}

void test_variance_that_is_no_number_refuses(void)
{
    const volatile pen_real_t zero = 0;
    const pen_real_t h[1] = { 1 };
    const pen_real_t bad[1] = { zero / zero };
    model.n_x = 1U;
    f[0] = (pen_real_t)1 / zero;
    TEST_ASSERT_EQUAL_HEX32(PEN_EKF_REFUSED, pen_ekf_update(&model, 0U, h, (pen_real_t)1, true, f, dx, work, test));
    f[0] = (pen_real_t)1;
    TEST_ASSERT_EQUAL_HEX32(PEN_EKF_REFUSED, pen_ekf_update(&model, 0U, bad, (pen_real_t)1, true, f, dx, work, test));
    TEST_ASSERT_TRUE(same((pen_real_t)1, f[0]));
}

/* ---- deviation ---- */

/* P = 4, 16, 64: 3^2 4 + 1 16 + 0.25 64 = 68; with U(0, 1) = 2, P(0, 0) is 4 + 4 * 16 */
void test_deviation(void)
{
    static const pen_real_t c[N] = { 3, -1, (pen_real_t)0.5 };
    static const pen_real_t first[N] = { 1, 0, 0 };
    pen_ekf_start(&model, &filter, f, count);
    expect_close((pen_real_t)68, pen_ekf_deviation(N, f, c) * pen_ekf_deviation(N, f, c), (pen_real_t)68);
    f[N] = (pen_real_t)2;
    expect_close((pen_real_t)68, pen_ekf_deviation(N, f, first) * pen_ekf_deviation(N, f, first), (pen_real_t)68);
    f[2U * N] = (pen_real_t)0.5;
    f[(2U * N) + 1U] = (pen_real_t)0.25; /* U' c = 3, 5, 1.75 */
    expect_close((pen_real_t)632, pen_ekf_deviation(N, f, c) * pen_ekf_deviation(N, f, c), (pen_real_t)632);
}
