/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* needs: gen/nqvm/c/nqvm.c gen/nqvm/c/nqvm_params.c */

/* The generated interface as an application meets it. Numbers are checked elsewhere (test/sil); here it is behaviour:
   what is refused, what is held, what is kept. */

#include <stddef.h>
#include <stdint.h>

#include "nqvm.h"
#include "unity.h"

#define WARM 50U

static nqvm_t       model;
static nqvm_banks_t banks;
static nqvm_u_t     u;
static nqvm_y_t     y;
static pen_real_t   bad[3]; /* NaN, Inf, -Inf */

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
    nqvm_t                    raw = { .head.ready = 0U };
    nqvm_x_t                  x = { (pen_real_t)1, (pen_real_t)2, (pen_real_t)3, (pen_real_t)4 };
    nqvm_z_t                  z;
    nqvm_jacobian_t           j;
    pen_status_report_t       report;
    pen_set_head_t            head;
    const nqvm_y_t            before = y;
    const nqvm_x_t            kept = state();

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
    nqvm_x_t       now;

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
        nqvm_x_t       after;
        pen_status_t   status;

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
        nqvm_x_t       after = before;

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
            nqvm_x_t       after;
            pen_status_t   status;

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
        const bool     envelope = (i == NQVM_AT_SPRING_NET) || (i == (NQVM_AT_SPRING_NET + 1U)) || (i == NQVM_AT_DAMPER_NET) ||
                              (i == (NQVM_AT_DAMPER_NET + 1U));
        const nqvm_x_t before = state();
        nqvm_x_t       after;
        pen_status_t   status;

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
    nqvm_t       twin;
    nqvm_banks_t twin_banks;
    nqvm_y_t     twin_y;
    nqvm_x_t     a;
    nqvm_x_t     b;

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
    nqvm_t   other;
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
