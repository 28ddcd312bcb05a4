/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * The interface of any generated quarter vehicle, whatever its method and networks: what it refuses, what it holds, what
 * it keeps, and that a step and a step with derivatives are one. coverage.py builds it once for each model; REFUSED(i) is
 * what the model says to a set with more pieces than it has room for, in its first network, the second, or both; UNFELT a
 * number in memory that no step here meets, OUT_OF_RANGE what a step raises for an input out of its range, ON_DAMAGE what
 * follows when verify finds damage.
 */
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include MODEL_HEADER

#include "unity.h"

#include "coverage_model.inc"

static void refuse_all(MODEL(t) *self)
{
    pen_status_report_t report;
    pen_set_head_t head = set.head;
    MODEL(sensors_jacobian_t) s;
    bool pending = false;

    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, MODEL(step)(self, &u, &y));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, MODEL(step_jacobian)(self, &u, &y, &j));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, MODEL(get_state)(self, &x));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, MODEL(set_state)(self, &x));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, MODEL(sensors)(self, &z));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, MODEL(status)(self, &report));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, MODEL(tune_begin)(self, &head));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, MODEL(tune_write)(self, 0U, value, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, MODEL(tune_commit)(self));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, MODEL(tune_abort)(self));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, MODEL(tune_select)(self, &set));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, MODEL(tune_rollback)(self));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, MODEL(tune_hold)(self, true));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, MODEL(tune_running)(self, &head));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, MODEL(sensors_jacobian)(self, &s));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, MODEL(get_input)(self, &u));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, MODEL(set_input)(self, &u));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, MODEL(tune_begin_copy)(self, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, MODEL(tune_write_bytes)(self, 0U, saved, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, MODEL(tune_expect)(self, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, MODEL(tune_withdraw)(self));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, MODEL(tune_pending)(self, &pending));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, MODEL(verify)(self, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, MODEL(save)(self, saved));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, MODEL(restore)(self, saved));
}

void test_no_instance_and_one_that_was_not_initialised(void)
{
    static MODEL(t) blank;
    static MODEL(t) untouched;

    refuse_all(NULL);
    refuse_all(&blank);
    TEST_ASSERT_EQUAL_MEMORY(&untouched, &blank, sizeof blank);
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, MODEL(init)(NULL, &MODEL(set_default), &banks));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, MODEL(init)(&model, NULL, &banks));
    refuse_all(&model);
    value[3] += (pen_real_t)1;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CHECKSUM, MODEL(init)(&model, &set, &banks));
    refuse_all(&model);
}

void test_the_model_tests_itself(void)
{
    TEST_ASSERT_EQUAL_HEX32(0U, MODEL(selftest)(&model));
}

void test_missing_arguments(void)
{
    MODEL(x_t) kept;
    pen_status_report_t report;

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(get_state)(&model, &kept));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, MODEL(step)(&model, NULL, &y));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, MODEL(step)(&model, &u, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, MODEL(step_jacobian)(&model, NULL, &y, &j));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, MODEL(step_jacobian)(&model, &u, NULL, &j));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, MODEL(step_jacobian)(&model, &u, &y, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, MODEL(get_state)(&model, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, MODEL(set_state)(&model, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, MODEL(sensors)(&model, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, MODEL(status)(&model, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, MODEL(tune_begin)(&model, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, MODEL(tune_select)(&model, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, MODEL(tune_running)(&model, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, MODEL(sensors_jacobian)(&model, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, MODEL(get_input)(&model, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, MODEL(set_input)(&model, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, MODEL(tune_pending)(&model, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, MODEL(save)(&model, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, MODEL(restore)(&model, NULL));
    expect_state(&kept);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(status)(&model, &report));
    TEST_ASSERT_EQUAL_UINT32(7U, pen_status_times(&report, PEN_BADARG)); /* of steps, set_state and set_input */
    TEST_ASSERT_EQUAL_UINT32(2U, pen_status_times(&report, PEN_SET_BADARG)); /* of begin and select */
}

void test_a_step_with_derivatives_is_the_same_step(void)
{
    for (uint32_t k = 0U; k < 50U; k++) {
        u.z_road = (pen_real_t)(k % 9U) * (pen_real_t)0.005;
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, step_both());
    }
    TEST_ASSERT_TRUE(!(j.y_x[0][0] < (pen_real_t)1) && !(j.y_x[0][0] > (pen_real_t)1)); /* the output is the state */
}

/* Outside of the trained range of the networks, on either side, near and far: reported, and the state still advances. */
void test_outside_of_the_envelope(void)
{
    for (int32_t side = -1; side <= 1; side += 2) {
        for (int32_t size = 1; size <= 8; size *= 2) {
            step_away(side * size);
        }
    }
}

void test_what_is_not_finite_changes_nothing(void)
{
    for (size_t i = 0U; i < 3U; i++) {
        const MODEL(jacobian_t) kept_j = j;
        MODEL(x_t) kept;
        MODEL(x_t) broken;

        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(get_state)(&model, &kept));
        u.z_road = bad[i];
        TEST_ASSERT_EQUAL_HEX32(PEN_INPUT_NONFINITE, step_both() & ~(PEN_OUTSIDE | PEN_SINGULAR | OUT_OF_RANGE));
        expect_state(&kept);
        u.z_road = (pen_real_t)0;
        broken = kept;
        broken.v_w = bad[i];
        TEST_ASSERT_EQUAL_HEX32(PEN_STATE_NONFINITE, MODEL(set_state)(&model, &broken));
        expect_state(&kept);
        model.row[1][0] = bad[i]; /* what no call does: memory that went bad */
        twin.row[1][0] = bad[i];
        TEST_ASSERT_EQUAL_HEX32(PEN_STATE_NONFINITE, step_both() & ~(PEN_OUTSIDE | PEN_SINGULAR));
        expect_state(&kept);
        TEST_ASSERT_EQUAL_MEMORY(&kept_j, &j, sizeof j);
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, step_both());
    }
}

static pen_real_t *unfelt(MODEL(t) *self)
{
    (void)self;
    return &UNFELT;
}

/* A bound of an envelope is not met by a step, nor a piece far away: the scrub finds it, once a round. */
void test_the_scrub_comes_round(void)
{
    uint32_t times = 0U;
    pen_real_t good;

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_select)(&model, &set));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_select)(&twin, &set));
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step_both());
    good = *unfelt(&model);
    *unfelt(&model) = bad[2];
    *unfelt(&twin) = bad[2];
    for (uint32_t k = 0U; k < (2U * MODEL_SIZE(SCRUB)); k++) {
        const pen_status_t status = step_both();
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, status & ~PEN_WEIGHT_NONFINITE);
        times += (status == PEN_WEIGHT_NONFINITE) ? 1U : 0U;
    }
    TEST_ASSERT_EQUAL_UINT32(2U, times);
    *unfelt(&model) = good;
    *unfelt(&twin) = good;
    for (uint32_t k = 0U; k < MODEL_SIZE(SCRUB); k++) {
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, step_both());
    }
}

void test_overflow_inside_changes_nothing(void)
{
    const MODEL(x_t) huge = { PEN_REAL_MAX, -PEN_REAL_MAX, PEN_REAL_MAX, -PEN_REAL_MAX };
    const MODEL(z_t) kept = z;

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(set_state)(&model, &huge));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(set_state)(&twin, &huge));
    TEST_ASSERT_BITS(PEN_STEP_NONFINITE, PEN_STEP_NONFINITE, MODEL(sensors)(&model, &z));
    TEST_ASSERT_EQUAL_MEMORY(&kept, &z, sizeof z);
    TEST_ASSERT_FALSE(pen_advanced(step_both()));
    expect_state(&huge);
}

/* Weights that are finite and overflow on the way: in the value, or in the matrix of a linear solve. */
void test_weights_that_overflow_change_nothing(void)
{
    MODEL(x_t) kept;

    for (size_t i = 4U; i < 599U; i++) {
        value[SPRING + i] = PEN_REAL_MAX * (pen_real_t)0.5F;
        value[DAMPER + i] = ((i % 2U) == 0U) ? PEN_REAL_MAX : -PEN_REAL_MAX;
    }
    seal();
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(get_state)(&model, &kept));
    if (MODEL(tune_select)(&model, &set) == PEN_OK) { /* a folded model may find too many pieces */
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_select)(&twin, &set));
        TEST_ASSERT_FALSE(pen_advanced(step_both()));
        expect_state(&kept);
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_rollback)(&model));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_rollback)(&twin));
        TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step_both());
    }
}

void test_sets_come_and_go(void)
{
    pen_set_head_t head = set.head;
    pen_status_report_t report;

    head.id = 77U;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, MODEL(tune_begin)(&twin, &head)); /* it has no banks */
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, MODEL(tune_write)(&model, 0U, value, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, MODEL(tune_commit)(&model));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, MODEL(tune_abort)(&model));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_NO_PREVIOUS, MODEL(tune_rollback)(&model));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_begin)(&model, &head));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_abort)(&model));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_begin)(&model, &head));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_write)(&model, 0U, value, LENGTH));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_commit)(&model));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BUSY, MODEL(tune_select)(&model, &set));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_hold)(&model, true));
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED | PEN_HELD, MODEL(step)(&model, &u, &y));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_hold)(&model, false));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_running)(&model, &head));
    TEST_ASSERT_EQUAL_UINT32(77U, head.id);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(status)(&model, &report));
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED | PEN_HELD | PEN_SET_CLOSED | PEN_SET_NO_PREVIOUS | PEN_SET_BUSY, report.flags);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(step)(&model, &u, &y));
}

void test_more_pieces_than_room(void)
{
    static const size_t at[3] = { SPRING, DAMPER, SPRING };

    for (size_t i = 0U; i < 3U; i++) { /* one network, the other one, both */
        if (i < 2U) {
            memcpy(value, MODEL(set_default).value, sizeof value);
        }
        make_saw(at[i]);
        TEST_ASSERT_EQUAL_HEX32(REFUSED(i), MODEL(tune_select)(&model, &set));
        TEST_ASSERT_EQUAL_HEX32(REFUSED(i), MODEL(tune_select)(&twin, &set));
        TEST_ASSERT_EQUAL_HEX32((REFUSED(i) == PEN_OK) ? PEN_ADOPTED : PEN_OK, step_both() & ~PEN_OUTSIDE);
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(sensors)(&model, &z) & ~PEN_OUTSIDE);
        step_away(1);
        step_away(-1);
    }
    TEST_ASSERT_EQUAL_HEX32(REFUSED(2U), MODEL(init)(&model, &set, NULL));
}

void test_an_input_out_of_its_range(void)
{
    for (int32_t side = -1; side <= 1; side += 2) {
        MODEL(u_t) before;
        MODEL(u_t) now;
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(get_input)(&model, &before));
        u.z_road = (pen_real_t)side * (pen_real_t)0.5;
        TEST_ASSERT_EQUAL_HEX32(OUT_OF_RANGE, step_both() & ~PEN_OUTSIDE);
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(get_input)(&model, &now));
        if ((OUT_OF_RANGE & PEN_HELD) != PEN_OK) {
            TEST_ASSERT_EQUAL_MEMORY(&before, &now, sizeof now);
        } else {
            TEST_ASSERT_TRUE((side > 0) == (now.z_road > (pen_real_t)0.25));
        }
    }
}

void test_an_input_is_put_in(void)
{
    MODEL(u_t) now;

    for (size_t i = 0U; i < 3U; i++) {
        u.z_road = bad[i];
        TEST_ASSERT_EQUAL_HEX32(PEN_INPUT_NONFINITE, MODEL(set_input)(&model, &u) & ~PEN_INPUT_RANGE);
    }
    for (int32_t side = -1; side <= 1; side += 2) { /* where it is only reported, the step reports it */
        u.z_road = (pen_real_t)side;
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(set_input)(&model, &u) & ~PEN_INPUT_RANGE);
    }
    u.z_road = (pen_real_t)0.125;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(set_input)(&model, &u));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(set_input)(&twin, &u));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(get_input)(&model, &now));
    TEST_ASSERT_EQUAL_MEMORY(&u, &now, sizeof now);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, step_both() & ~PEN_OUTSIDE);
}

void test_derivatives_of_sensors(void)
{
    MODEL(sensors_jacobian_t) s;

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(sensors_jacobian)(&model, &s));
    TEST_ASSERT_TRUE((s.z_x[2][0] > (pen_real_t)0.999) && (s.z_x[2][1] < (pen_real_t)-0.999)); /* the deflection */
}
