/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* needs: gen/nqvm/c/nqvm.c gen/nqvm/c/nqvm_params.c */

/* The generated interface as an application meets it. Numbers are checked elsewhere (test/sil); here it is behaviour:
   what is refused, what is held, what is kept. */

#include <stddef.h>
#include <stdint.h>

#include "nqvm.h"
#include "penode/pen_serial.h"
#include "unity.h"

#define WARM 50U

static nqvm_t model;
static nqvm_banks_t banks;
static nqvm_u_t u;
static nqvm_y_t y;
static pen_real_t bad[3]; /* NaN, Inf, -Inf */
static uint8_t saved[NQVM_SAVED];

static pen_real_t road(uint32_t k)
{
    const pen_real_t along = (pen_real_t)(k % 100U) * (pen_real_t)0.01;

    return (pen_real_t)0.04 * along * ((pen_real_t)1 - along);
}

static void drive(uint32_t from, uint32_t n)
{
    for (uint32_t k = from; k < (from + n); k++) {
        u.z_road = road(k);
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_step(&model, &u, &y) & ~PEN_ADOPTED);
    }
}

void setUp(void)
{
    volatile pen_real_t zero = (pen_real_t)0;

    bad[0] = zero / zero;
    bad[1] = (pen_real_t)1 / zero;
    bad[2] = (pen_real_t)-1 / zero;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_init(&model, &nqvm_set_default, &banks));
    drive(0U, WARM);
}

void tearDown(void) {}

static nqvm_x_t state(void)
{
    nqvm_x_t x = { (pen_real_t)-9, (pen_real_t)-9, (pen_real_t)-9, (pen_real_t)-9 };

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_get_state(&model, &x));
    return x;
}

static void expect_same_state(const nqvm_x_t *a, const nqvm_x_t *b)
{
    TEST_ASSERT_EQUAL_MEMORY(a, b, sizeof(*a));
}

static void expect_running(const pen_set_t *set)
{
    pen_set_head_t head;

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_running(&model, &head));
    TEST_ASSERT_EQUAL_MEMORY(&set->head, &head, sizeof(head));
}

void test_init_refuses_other_sets(void)
{
    pen_set_t set = nqvm_set_default;
    nqvm_t other;

    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, nqvm_init(NULL, &set, &banks));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, nqvm_init(&other, NULL, &banks));
    set.head.layout++;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_LAYOUT, nqvm_init(&other, &set, &banks));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, nqvm_step(&other, &u, &y)); /* refused is not initialised */
    set = nqvm_set_default;
    set.head.checksum++;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CHECKSUM, nqvm_init(&other, &set, &banks));
}

void test_null_and_uninitialised_are_refused_and_nothing_is_written(void)
{
    nqvm_t raw = { .head.ready = 0U };
    nqvm_x_t x = { (pen_real_t)1, (pen_real_t)2, (pen_real_t)3, (pen_real_t)4 };
    nqvm_z_t z;
    nqvm_jacobian_t j;
    pen_status_report_t report;
    pen_set_head_t head;
    const nqvm_y_t before = y;
    const nqvm_x_t kept = state();

    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, nqvm_step(NULL, &u, &y));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, nqvm_step(&raw, &u, &y));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, nqvm_step(&model, NULL, &y));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, nqvm_step(&model, &u, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, nqvm_step_jacobian(&model, &u, &y, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, nqvm_step_jacobian(&raw, &u, &y, &j));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, nqvm_get_state(&raw, &x));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, nqvm_get_state(&model, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, nqvm_set_state(&raw, &x));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, nqvm_set_state(&model, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, nqvm_sensors(&raw, &z));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, nqvm_sensors(&model, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, nqvm_status(&raw, &report));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, nqvm_status(&model, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, nqvm_tune_begin(&raw, &nqvm_set_default.head));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, nqvm_tune_write(NULL, 0U, nqvm_set_default.value, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, nqvm_tune_commit(&raw));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, nqvm_tune_abort(&raw));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, nqvm_tune_select(&raw, &nqvm_set_default));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, nqvm_tune_rollback(NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, nqvm_tune_hold(&raw, true));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, nqvm_tune_running(&raw, &head));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, nqvm_tune_running(&model, NULL));
    TEST_ASSERT_EQUAL_MEMORY(&before, &y, sizeof(y));
    x = state();
    expect_same_state(&kept, &x);
}

void test_first_sample_gives_outputs_without_a_step(void)
{
    const nqvm_x_t start = { (pen_real_t)0.01, (pen_real_t)0.02, (pen_real_t)0.3, (pen_real_t)-0.4 };
    nqvm_x_t now;

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_init(&model, &nqvm_set_default, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_set_state(&model, &start));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_step(&model, &u, &y));
    now = state();
    expect_same_state(&start, &now);
    TEST_ASSERT_TRUE((y.z_b == start.z_b) && (y.z_w == start.z_w));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_step(&model, &u, &y));
    now = state();
    TEST_ASSERT_FALSE(now.z_b == start.z_b);
}

void test_bad_input_holds_and_the_next_good_one_goes_on(void)
{
    for (size_t b = 0U; b < 3U; b++) {
        const nqvm_x_t before = state();
        const nqvm_y_t kept = y;
        nqvm_x_t after;
        pen_status_t status;

        u.z_road = bad[b];
        status = nqvm_step(&model, &u, &y);
        TEST_ASSERT_EQUAL_HEX32(PEN_INPUT_NONFINITE, status & PEN_INPUT_NONFINITE);
        TEST_ASSERT_FALSE(pen_advanced(status));
        after = state();
        expect_same_state(&before, &after);
        TEST_ASSERT_EQUAL_MEMORY(&kept, &y, sizeof(y));
        drive(WARM + b, 1U);
        after = state();
        TEST_ASSERT_FALSE(after.z_w == before.z_w);
    }
}

void test_bad_state_is_refused(void)
{
    for (size_t b = 0U; b < 3U; b++) {
        const nqvm_x_t before = state();
        nqvm_x_t after = before;

        after.v_b = bad[b];
        TEST_ASSERT_EQUAL_HEX32(PEN_STATE_NONFINITE, nqvm_set_state(&model, &after));
        after = state();
        expect_same_state(&before, &after);
    }
    drive(WARM, 1U);
}

void test_damaged_state_comes_back_from_its_copy(void)
{
    for (size_t i = 0U; i < NQVM_N_X; i++) {
        for (size_t b = 0U; b < 3U; b++) {
            const nqvm_x_t before = state();
            nqvm_x_t after;
            pen_status_t status;

            model.row[1][i] = bad[b];
            u.z_road = road(WARM);
            status = nqvm_step(&model, &u, &y);
            TEST_ASSERT_EQUAL_HEX32(PEN_STATE_NONFINITE, status & PEN_STATE_NONFINITE);
            TEST_ASSERT_FALSE(pen_advanced(status));
            after = state();
            expect_same_state(&before, &after);
            drive(WARM, 1U);
        }
    }
}

/* Every weight of the running set, one after the other: none may be NaN or Inf without a flag, at once or from the scrub. */
void test_damaged_weight_holds_until_it_is_mended(void)
{
    for (uint32_t i = 0U; i < NQVM_SET_LENGTH; i++) {
        const bool envelope = (i == NQVM_AT_SPRING_NET) || (i == (NQVM_AT_SPRING_NET + 1U)) || (i == NQVM_AT_DAMPER_NET) ||
                              (i == (NQVM_AT_DAMPER_NET + 1U));
        const nqvm_x_t before = state();
        nqvm_x_t after;
        pen_status_t status;

        /* stage a good copy, run it, then damage it where it lies */
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_begin(&model, &nqvm_set_default.head));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_write(&model, 0U, nqvm_set_default.value, NQVM_SET_LENGTH));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_commit(&model));
        nqvm_tune_hold(&model, true);
        u.z_road = road(WARM + i);
        TEST_ASSERT_EQUAL_HEX32(PEN_HELD | PEN_ADOPTED, nqvm_step(&model, &u, &y));
        nqvm_tune_hold(&model, false);
        banks.value[0][i] = bad[i % 3U];
        banks.value[1][i] = bad[i % 3U];
        status = nqvm_step(&model, &u, &y);
        if (envelope) {
            /* a bound of the envelope is compared, never computed with: NaN reads as outside, -Inf below as no bound */
            for (uint32_t k = 1U; (k < NQVM_SCRUB) && ((status & PEN_WEIGHT_NONFINITE) == PEN_OK); k++) {
                TEST_ASSERT_TRUE(pen_advanced(status));
                status = nqvm_step(&model, &u, &y);
            }
            TEST_ASSERT_EQUAL_HEX32(PEN_WEIGHT_NONFINITE, status & PEN_WEIGHT_NONFINITE);
            TEST_ASSERT_TRUE(pen_advanced(status));
        } else {
            TEST_ASSERT_EQUAL_HEX32(PEN_STEP_NONFINITE, status & PEN_STEP_NONFINITE);
            after = state();
            expect_same_state(&before, &after);
        }
        banks.value[0][i] = nqvm_set_default.value[i];
        banks.value[1][i] = nqvm_set_default.value[i];
        drive(WARM + i, 1U);
    }
}

/* Whatever became of the place it has come to: the scrub stays within the set, and goes on. */
void test_damaged_place_of_the_scrub(void)
{
    static const uint32_t places[] = { NQVM_SCRUB - 1U, NQVM_SCRUB, 0x80000000U, UINT32_MAX };

    for (size_t i = 0U; i < (sizeof(places) / sizeof(places[0])); i++) {
        model.head.scrub = places[i];
        drive(WARM, 1U);
        TEST_ASSERT_EQUAL_UINT32((places[i] % NQVM_SCRUB) + 1U, model.head.scrub);
    }
}

void test_exchange_keeps_the_state_and_misses_no_sample(void)
{
    nqvm_t twin;
    nqvm_banks_t twin_banks;
    nqvm_y_t twin_y;
    nqvm_x_t a;
    nqvm_x_t b;

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_init(&twin, &nqvm_set_default, &twin_banks));
    for (uint32_t k = 0U; k < WARM; k++) {
        u.z_road = road(k);
        (void)nqvm_step(&twin, &u, &twin_y);
    }
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_begin(&model, &nqvm_set_altered_friction.head));
    for (uint32_t at = 0U; at < NQVM_SET_LENGTH; at += 100U) { /* in chunks, while both run */
        const uint32_t left = NQVM_SET_LENGTH - at;
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_write(&model, at, &nqvm_set_altered_friction.value[at], (left < 100U) ? left : 100U));
        u.z_road = road(WARM + at);
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_step(&model, &u, &y));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_step(&twin, &u, &twin_y));
        TEST_ASSERT_EQUAL_MEMORY(&twin_y, &y, sizeof(y));
    }
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_commit(&model));
    expect_running(&nqvm_set_default);
    a = state();
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_get_state(&twin, &b));
    expect_same_state(&a, &b); /* up to the bit, until the step that adopts */
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, nqvm_step(&model, &u, &y));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_step(&twin, &u, &twin_y));
    expect_running(&nqvm_set_altered_friction);
    a = state();
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_get_state(&twin, &b));
    TEST_ASSERT_FALSE(a.v_b == b.v_b);
}

void test_two_instances_do_not_know_of_each_other(void)
{
    nqvm_t other;
    nqvm_y_t first_y[20];

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_init(&model, &nqvm_set_default, &banks));
    for (uint32_t k = 0U; k < 20U; k++) {
        u.z_road = road(k);
        (void)nqvm_step(&model, &u, &first_y[k]);
    }
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_init(&model, &nqvm_set_default, &banks));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_init(&other, &nqvm_set_altered_friction, NULL));
    for (uint32_t k = 0U; k < 20U; k++) {
        u.z_road = road(3U * k);
        (void)nqvm_step(&other, &u, &y);
        u.z_road = road(k);
        (void)nqvm_step(&model, &u, &y);
        TEST_ASSERT_EQUAL_MEMORY(&first_y[k], &y, sizeof(y));
    }
}

void test_status_is_sticky_counted_and_cleared_by_reading(void)
{
    pen_status_report_t report;

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_status(&model, &report));
    u.z_road = bad[0];
    (void)nqvm_step(&model, &u, &y);
    (void)nqvm_step(&model, &u, &y);
    drive(WARM, 3U);
    (void)nqvm_tune_commit(&model);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_status(&model, &report));
    TEST_ASSERT_EQUAL_HEX32(PEN_INPUT_NONFINITE | PEN_SET_CLOSED, report.flags & (PEN_INPUT_NONFINITE | PEN_SET_CLOSED | PEN_HELD));
    TEST_ASSERT_EQUAL_UINT32(2U, pen_status_times(&report, PEN_INPUT_NONFINITE));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_status(&model, &report));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, report.flags);
}

void test_far_outside_of_training_is_reported(void)
{
    const nqvm_x_t far = { (pen_real_t)0.2, (pen_real_t)0, (pen_real_t)0, (pen_real_t)0 };

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_set_state(&model, &far));
    TEST_ASSERT_EQUAL_HEX32(PEN_OUTSIDE, nqvm_step(&model, &u, &y));
}

/* ---- counted and reported ---- */

static uint32_t times(pen_status_t flag)
{
    pen_status_report_t report;

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_status(&model, &report));
    TEST_ASSERT_EQUAL_HEX32((pen_status_times(&report, flag) > 0U) ? flag : PEN_OK, report.flags & flag);
    return pen_status_times(&report, flag);
}

void test_bad_arguments_of_a_step_are_counted_and_reported(void)
{
    nqvm_jacobian_t j;
    nqvm_sensors_jacobian_t jz;

    (void)times(PEN_OK);
    (void)nqvm_step(&model, NULL, &y);
    (void)nqvm_step(&model, &u, NULL);
    (void)nqvm_step_jacobian(&model, NULL, &y, &j);
    (void)nqvm_step_jacobian(&model, &u, NULL, &j);
    (void)nqvm_step_jacobian(&model, &u, &y, NULL);
    (void)nqvm_set_state(&model, NULL);
    (void)nqvm_set_input(&model, NULL);
    TEST_ASSERT_EQUAL_UINT32(7U, times(PEN_BADARG));
    (void)nqvm_get_state(&model, NULL); /* of a constant instance: not counted, as the header says */
    (void)nqvm_get_input(&model, NULL);
    (void)nqvm_sensors(&model, NULL);
    (void)nqvm_sensors_jacobian(&model, NULL);
    (void)nqvm_sensors_jacobian(&model, &jz);
    TEST_ASSERT_EQUAL_UINT32(0U, times(PEN_BADARG));
    (void)nqvm_tune_begin(&model, NULL);
    (void)nqvm_tune_select(&model, NULL);
    TEST_ASSERT_EQUAL_UINT32(2U, times(PEN_SET_BADARG));
    TEST_ASSERT_EQUAL_UINT32(0U, times(PEN_BADARG));
}

void test_new_calls_refuse_null_and_uninitialised(void)
{
    nqvm_t raw = { .head.ready = 0U };
    nqvm_sensors_jacobian_t jz;
    nqvm_u_t was = { (pen_real_t)0.125F };
    bool pending = true;

    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, nqvm_get_input(&raw, &was));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, nqvm_get_input(NULL, &was));
    TEST_ASSERT_TRUE(was.z_road == (pen_real_t)0.125F);
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, nqvm_set_input(&raw, &was));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, nqvm_set_input(NULL, &was));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, nqvm_sensors_jacobian(&raw, &jz));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, nqvm_sensors_jacobian(NULL, &jz));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, nqvm_tune_begin_copy(&raw, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, nqvm_tune_expect(NULL, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, nqvm_tune_write_bytes(&raw, 0U, saved, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, nqvm_tune_withdraw(&raw));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, nqvm_tune_pending(&raw, &pending));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, nqvm_tune_pending(&model, NULL));
    TEST_ASSERT_TRUE(pending);
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, nqvm_verify(&raw, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, nqvm_verify(NULL, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, nqvm_save(&raw, saved));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, nqvm_save(&model, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, nqvm_restore(&raw, saved));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, nqvm_restore(NULL, saved));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, nqvm_restore(&model, NULL));
}

/* The model file says -0.3 to 0.3 m, and that an input outside is used all the same. */
void test_input_out_of_its_range_is_reported_and_used(void)
{
    static const pen_real_t inside[3] = { (pen_real_t)-0.3, (pen_real_t)0, (pen_real_t)0.3 };
    static const pen_real_t outside[4] = { (pen_real_t)-0.30001, (pen_real_t)0.30001, (pen_real_t)-0.35, (pen_real_t)0.35 };

    (void)times(PEN_OK);
    for (size_t i = 0U; i < 3U; i++) {
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_init(&model, &nqvm_set_default, &banks));
        u.z_road = inside[i];
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_step(&model, &u, &y));
    }
    for (size_t i = 0U; i < 4U; i++) {
        nqvm_u_t was;
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_init(&model, &nqvm_set_default, &banks));
        u.z_road = outside[i];
        TEST_ASSERT_EQUAL_HEX32(PEN_INPUT_RANGE, nqvm_step(&model, &u, &y));
        TEST_ASSERT_TRUE(pen_advanced(PEN_INPUT_RANGE));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_get_input(&model, &was));
        TEST_ASSERT_TRUE(was.z_road == outside[i]);
        TEST_ASSERT_EQUAL_UINT32(1U, times(PEN_INPUT_RANGE));
    }
    u.z_road = bad[0];
    /* NaN is outside of any envelope, and of no range */
    TEST_ASSERT_EQUAL_HEX32(PEN_INPUT_NONFINITE | PEN_OUTSIDE, nqvm_step(&model, &u, &y));
}

/* ---- the input of the sample before ---- */

/* As an FMI master steps: the input it set holds over the whole step. A twin sees the same input twice. */
void test_input_held_over_the_step(void)
{
    nqvm_t twin;
    nqvm_y_t twin_y;
    nqvm_u_t was;

    for (uint32_t k = 0U; k < 20U; k++) {
        const nqvm_x_t x = state();
        nqvm_x_t a;
        nqvm_x_t b;
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_init(&twin, &nqvm_set_default, NULL));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_set_state(&twin, &x));
        u.z_road = (pen_real_t)0.01 * (pen_real_t)(k % 5U);
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_step(&twin, &u, &twin_y)); /* its first sample: it stays where it is */
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_step(&twin, &u, &twin_y));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_set_input(&model, &u));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_get_input(&model, &was));
        TEST_ASSERT_TRUE(was.z_road == u.z_road);
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_step(&model, &u, &y));
        a = state();
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_get_state(&twin, &b));
        expect_same_state(&b, &a);
        TEST_ASSERT_EQUAL_MEMORY(&twin_y, &y, sizeof(y));
    }
}

/* Given the input before, the first sample after init is a step like any other. */
void test_first_sample_with_an_input_before_it_integrates(void)
{
    const nqvm_x_t x = { (pen_real_t)0.01, (pen_real_t)0.02, (pen_real_t)0.3, (pen_real_t)-0.4 };
    const nqvm_u_t before = { (pen_real_t)0.015625F };
    nqvm_t twin;
    nqvm_x_t a;
    nqvm_x_t b;

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_init(&twin, &nqvm_set_default, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_step(&twin, &before, &y));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_set_state(&twin, &x));
    u.z_road = (pen_real_t)0.03125F;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_step(&twin, &u, &y));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_get_state(&twin, &b));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_init(&model, &nqvm_set_default, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_set_state(&model, &x));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_set_input(&model, &before));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_step(&model, &u, &y));
    a = state();
    expect_same_state(&b, &a);
    TEST_ASSERT_FALSE(a.z_b == x.z_b);
}

void test_bad_input_before_is_refused_and_counted(void)
{
    nqvm_u_t was;
    nqvm_u_t wrong;

    (void)times(PEN_OK);
    for (size_t b = 0U; b < 3U; b++) {
        wrong.z_road = bad[b];
        TEST_ASSERT_EQUAL_HEX32(PEN_INPUT_NONFINITE, nqvm_set_input(&model, &wrong));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_get_input(&model, &was));
        TEST_ASSERT_TRUE(was.z_road == road(WARM - 1U));
    }
    TEST_ASSERT_EQUAL_UINT32(3U, times(PEN_INPUT_NONFINITE));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_init(&model, &nqvm_set_default, &banks));
    TEST_ASSERT_EQUAL_HEX32(PEN_INPUT_NONFINITE, nqvm_set_input(&model, &wrong));
    u.z_road = (pen_real_t)0.1;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_step(&model, &u, &y)); /* still the first sample */
    TEST_ASSERT_TRUE((y.z_b == (pen_real_t)0) && (y.z_w == (pen_real_t)0));
}

/* ---- derivatives of the sensors; against differences in test/gen ---- */

void test_derivatives_of_the_sensors(void)
{
    const nqvm_x_t far = { (pen_real_t)0.2, (pen_real_t)0, (pen_real_t)0, (pen_real_t)0 };
    nqvm_sensors_jacobian_t j;
    pen_real_t ratio;

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_sensors_jacobian(&model, &j));
    TEST_ASSERT_TRUE((j.z_x[2][0] == (pen_real_t)1) && (j.z_x[2][1] == (pen_real_t)-1)); /* z_b - z_w */
    TEST_ASSERT_TRUE((j.z_x[2][2] == (pen_real_t)0) && (j.z_x[2][3] == (pen_real_t)0) && (j.z_u[2][0] == (pen_real_t)0));
    TEST_ASSERT_TRUE(j.z_u[0][0] == (pen_real_t)0); /* the road moves the wheel only: by c_t / m_w */
    ratio = j.z_u[1][0] * (pen_real_t)90 / (pen_real_t)300000;
    /* four operations, each within half an epsilon */
    TEST_ASSERT_TRUE((ratio > ((pen_real_t)1 - ((pen_real_t)2 * PEN_REAL_EPSILON))) &&
                     (ratio < ((pen_real_t)1 + ((pen_real_t)2 * PEN_REAL_EPSILON))));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_set_state(&model, &far));
    TEST_ASSERT_EQUAL_HEX32(PEN_OUTSIDE, nqvm_sensors_jacobian(&model, &j));
}

/* ---- a set on a wire, and a calibrator ---- */

void test_set_from_a_wire(void)
{
    static uint8_t wire[PEN_SERIAL_HEAD + (NQVM_SET_LENGTH * sizeof(pen_real_t)) + 1U];
    uint8_t *const byte = &wire[1]; /* aligned to nothing */
    const uint32_t size = NQVM_SET_LENGTH * (uint32_t)sizeof(pen_real_t);
    pen_set_head_t head;
    bool pending = false;

    pen_serial_write(&nqvm_set_altered_friction.head, byte);
    pen_serial_put_bytes(nqvm_set_altered_friction.value, 0U, size, &byte[PEN_SERIAL_HEAD]);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_serial_read(byte, &head));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_begin(&model, &head));
    for (uint32_t at = 0U; at < size; at += 61U) {
        const uint32_t n = ((size - at) < 61U) ? (size - at) : 61U;
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_write_bytes(&model, at, &byte[PEN_SERIAL_HEAD + at], n));
    }
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_commit(&model));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_pending(&model, &pending));
    TEST_ASSERT_TRUE(pending);
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, nqvm_step(&model, &u, &y));
    expect_running(&nqvm_set_altered_friction);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_pending(&model, &pending));
    TEST_ASSERT_FALSE(pending);
}

void test_three_values_of_the_running_set(void)
{
    static const uint32_t at[3] = { 600U, 3U, NQVM_SET_LENGTH - 1U };
    pen_set_head_t head;
    uint32_t checksum;

    for (uint32_t i = 0U; i < NQVM_SET_LENGTH; i++) {
        banks.value[1][i] = nqvm_set_default.value[i]; /* the caller's own copy, for the checksum */
    }
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_begin_copy(&model, 42U));
    for (size_t i = 0U; i < 3U; i++) {
        const pen_real_t value = nqvm_set_default.value[at[i]] + (pen_real_t)0.0625F;
        banks.value[1][at[i]] = value;
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_write(&model, at[i], &value, 1U));
    }
    checksum = pen_set_checksum(banks.value[1], NQVM_SET_LENGTH);
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CHECKSUM, nqvm_tune_commit(&model));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_expect(&model, checksum));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_commit(&model));
    drive(WARM, 1U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_running(&model, &head));
    TEST_ASSERT_EQUAL_UINT32(42U, head.id);
    TEST_ASSERT_EQUAL_HEX32(checksum, head.checksum);
}

void test_withdrawn_set_is_never_run(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_IDLE, nqvm_tune_withdraw(&model));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_select(&model, &nqvm_set_altered_friction));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_withdraw(&model));
    TEST_ASSERT_EQUAL_HEX32(PEN_WITHDRAWN, nqvm_step(&model, &u, &y));
    TEST_ASSERT_TRUE(pen_advanced(PEN_WITHDRAWN));
    expect_running(&nqvm_set_default);
    TEST_ASSERT_EQUAL_UINT32(1U, times(PEN_WITHDRAWN));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_NO_PREVIOUS, nqvm_tune_rollback(&model));
}

/* ---- the guard ---- */

/* Finite damage, that no step sees: every thirteenth value, and both ends. */
void test_finite_damage_is_found_within_a_round(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_begin_copy(&model, 42U));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_commit(&model));
    drive(WARM, 1U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_verify(&model, NQVM_VERIFY));
    for (uint32_t i = 0U; i < NQVM_SET_LENGTH; i += ((i < 1183U) ? 13U : 1U)) {
        pen_real_t *const value = &banks.value[0][i];
        const pen_real_t kept = *value;
        *value += (pen_real_t)0.5F * ((kept < (pen_real_t)1) ? (pen_real_t)1 : kept);
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_DAMAGED, nqvm_verify(&model, NQVM_VERIFY));
        *value = kept;
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_verify(&model, NQVM_VERIFY));
    }
    drive(WARM, 1U); /* the model file says report: nothing holds */
}

/* ---- saved and restored ---- */

/* Into an instance that has done something else: the same samples, the same bits, also when a set is under way. */
void test_restored_instance_goes_on_to_the_bit(void)
{
    nqvm_t twin;
    nqvm_banks_t twin_banks;
    nqvm_y_t twin_y;
    nqvm_x_t a;
    nqvm_x_t b;

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_init(&twin, &nqvm_set_default, &twin_banks));
    (void)nqvm_step(&twin, &u, &twin_y);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_begin(&model, &nqvm_set_altered_friction.head));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_write(&model, 0U, nqvm_set_altered_friction.value, 700U));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_save(&model, saved));
    saved[99] ^= 1U;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CHECKSUM, nqvm_restore(&twin, saved));
    saved[99] ^= 1U;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_restore(&twin, saved));
    for (uint32_t k = 0U; k < 200U; k++) {
        pen_status_t status;
        if (k == 20U) {
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_write(&model, 700U, &nqvm_set_altered_friction.value[700], NQVM_SET_LENGTH - 700U));
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_write(&twin, 700U, &nqvm_set_altered_friction.value[700], NQVM_SET_LENGTH - 700U));
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_commit(&model));
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_tune_commit(&twin));
        }
        u.z_road = road(k);
        status = nqvm_step(&model, &u, &y);
        TEST_ASSERT_EQUAL_HEX32((k == 20U) ? PEN_ADOPTED : PEN_OK, status);
        TEST_ASSERT_EQUAL_HEX32(status, nqvm_step(&twin, &u, &twin_y));
        TEST_ASSERT_EQUAL_MEMORY(&twin_y, &y, sizeof(y));
        a = state();
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_get_state(&twin, &b));
        expect_same_state(&a, &b);
    }
    TEST_ASSERT_EQUAL_MEMORY(&twin_banks, &banks, sizeof(banks));
}
