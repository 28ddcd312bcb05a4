/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * The interface of any generated quarter vehicle, whatever its method and networks: what it refuses, what it holds, what
 * it keeps, and that a step and a step with derivatives are one. coverage.py builds it once for each model; REFUSED is
 * what the model says to a set with more pieces than it has room for, UNFELT a number in memory that no step here meets,
 * OUT_OF_RANGE what a step raises for an input out of its range, ON_DAMAGE what follows when verify finds damage.
 */
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include MODEL_HEADER

#include "unity.h"

#define LENGTH MODEL_SIZE(SET_LENGTH)
#define SPRING MODEL_SIZE(AT_SPRING_NET)
#define DAMPER MODEL_SIZE(AT_DAMPER_NET)

static MODEL(t)          model;
static MODEL(t)          twin;
static MODEL(t)          other;
static MODEL(banks_t)    banks;
static MODEL(banks_t)    other_banks;
static uint8_t           saved[MODEL_SIZE(SAVED)];
static MODEL(u_t)        u;
static MODEL(y_t)        y;
static MODEL(x_t)        x;
static MODEL(z_t)        z;
static MODEL(jacobian_t) j;
static pen_real_t        value[LENGTH];
static pen_set_t         set;
static pen_real_t        bad[3]; /* NaN, Inf, -Inf */

void setUp(void)
{
    volatile pen_real_t zero = (pen_real_t)0;

    bad[0] = zero / zero;
    bad[1] = (pen_real_t)1 / zero;
    bad[2] = (pen_real_t)-1 / zero;
    u.z_road = (pen_real_t)0.01;
    memcpy(value, MODEL(set_default).value, sizeof value);
    set = MODEL(set_default);
    set.value = value;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(init)(&model, &MODEL(set_default), &banks));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(init)(&twin, &MODEL(set_default), NULL));
    for (uint32_t k = 0U; k < 20U; k++) {
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(step)(&model, &u, &y));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(step)(&twin, &u, &y));
    }
}

void tearDown(void) {}

static void seal(void)
{
    set.head.checksum = pen_set_checksum(value, LENGTH);
}

static void expect_state(const MODEL(x_t) *expected)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(get_state)(&model, &x));
    TEST_ASSERT_EQUAL_MEMORY(expected, &x, sizeof x);
}

/* One sample of both, the twin with derivatives: the same bits, the same status. */
static pen_status_t step_both(void)
{
    MODEL(y_t) other = y;
    MODEL(x_t) mine;
    const pen_status_t status = MODEL(step)(&model, &u, &y);

    TEST_ASSERT_EQUAL_HEX32(status, MODEL(step_jacobian)(&twin, &u, &other, &j));
    TEST_ASSERT_EQUAL_MEMORY(&y, &other, sizeof y);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(get_state)(&model, &mine));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(get_state)(&twin, &x));
    TEST_ASSERT_EQUAL_MEMORY(&mine, &x, sizeof x);
    return status;
}

/* A sample from a state outside of the envelope of both networks. */
static void step_away(int32_t size)
{
    const MODEL(x_t) away = { (pen_real_t)size, (pen_real_t)0, (pen_real_t)(size * 4), (pen_real_t)0 };

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(set_state)(&model, &away));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(set_state)(&twin, &away));
    TEST_ASSERT_EQUAL_HEX32(PEN_OUTSIDE, MODEL(sensors)(&model, &z));
    TEST_ASSERT_EQUAL_HEX32(PEN_OUTSIDE, step_both());
}

/* A saw of 15 teeth that 16 neurons cut: about 240 kinks, more than any room here. */
static void make_saw(size_t at)
{
    pen_real_t *const p = &value[at + 4U];

    value[at + 2U] = (pen_real_t)0.5F * (value[at] + value[at + 1U]); /* teeth from end to end of the envelope */
    value[at + 3U] = (pen_real_t)2 / (value[at + 1U] - value[at]);
    memset(p, 0, (32U + 272U + 272U + 17U) * sizeof *p);
    for (size_t i = 0U; i < 16U; i++) {
        p[i] = (pen_real_t)1 - ((pen_real_t)i * (pen_real_t)0.125F);
        p[16U + i] = (pen_real_t)1;
        p[32U + i] = -(pen_real_t)0.0078125F * ((pen_real_t)i - (pen_real_t)0.5F);
        for (size_t k = 0U; k < 16U; k++) {
            const pen_real_t turn = ((i % 2U) == 0U) ? (pen_real_t)2 : (pen_real_t)-2;
            p[48U + (16U * i) + k] = (i == 0U) ? (pen_real_t)1 : turn;
        }
        p[304U + i] = (pen_real_t)1;
        p[320U + (16U * i) + i] = (pen_real_t)1;
        p[577U + i] = (pen_real_t)1;
    }
    seal();
}

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

/* Far outside of what the networks were trained on, either way, near and far: said, and the state still advances. */
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
        TEST_ASSERT_EQUAL_HEX32(REFUSED, MODEL(tune_select)(&model, &set));
        TEST_ASSERT_EQUAL_HEX32(REFUSED, MODEL(tune_select)(&twin, &set));
        TEST_ASSERT_EQUAL_HEX32((REFUSED == PEN_OK) ? PEN_ADOPTED : PEN_OK, step_both() & ~PEN_OUTSIDE);
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(sensors)(&model, &z) & ~PEN_OUTSIDE);
        step_away(1);
        step_away(-1);
    }
    TEST_ASSERT_EQUAL_HEX32(REFUSED, MODEL(init)(&model, &set, NULL));
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

static void stage_bytes(MODEL(t) *self, uint32_t from, uint32_t n)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_write_bytes)(self, from, &((const uint8_t *)value)[from], n));
}

/* A set that runs from a bank; the rollback set lies in the other bank if `two`, else in flash. */
static void run_from_bank(bool two)
{
    for (uint32_t k = 0U; k < (two ? 2U : 1U); k++) {
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_begin)(&model, &set.head));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_write)(&model, 0U, value, LENGTH));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_commit)(&model));
        TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, MODEL(step)(&model, &u, &y));
    }
}

void test_copied_withdrawn_and_sent_in_bytes(void)
{
    pen_set_head_t head;
    bool pending = false;

    TEST_ASSERT_EQUAL_HEX32(PEN_SET_IDLE, MODEL(tune_withdraw)(&model));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, MODEL(tune_expect)(&model, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_begin_copy)(&model, 7U));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_expect)(&model, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CHECKSUM, MODEL(tune_commit)(&model));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_expect)(&model, set.head.checksum));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_commit)(&model));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_withdraw)(&model));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_pending)(&model, &pending));
    TEST_ASSERT_TRUE(pending);
    TEST_ASSERT_EQUAL_HEX32(PEN_WITHDRAWN, MODEL(step)(&model, &u, &y));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_pending)(&model, &pending));
    TEST_ASSERT_FALSE(pending);
    head = set.head;
    head.id = 8U;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_begin)(&model, &head));
    stage_bytes(&model, 0U, 5U);
    stage_bytes(&model, 5U, (uint32_t)sizeof value - 5U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_commit)(&model));
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, MODEL(step)(&model, &u, &y));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_running)(&model, &head));
    TEST_ASSERT_EQUAL_UINT32(8U, head.id);
}

/* Damage that is finite: found within a round from its start, and then what the model file says. */
static pen_status_t after_damage(bool idle)
{
    pen_real_t *const running = (pen_real_t *)model.head.tuning.slot[model.head.tuning.active].value;

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(verify)(&model, MODEL_SIZE(VERIFY)));
    running[LENGTH - 1U] += (pen_real_t)0.5;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_DAMAGED, MODEL(verify)(&model, MODEL_SIZE(VERIFY)));
    if (!idle || (ON_DAMAGE == PEN_DAMAGE_REPORT)) {
        running[LENGTH - 1U] -= (pen_real_t)0.5;
    }
    return MODEL(step)(&model, &u, &y) & ~PEN_OUTSIDE;
}

void test_damage_and_a_rollback_set(void)
{
    const pen_status_t follows = (ON_DAMAGE == PEN_DAMAGE_HOLD) ? PEN_HELD : (ON_DAMAGE == PEN_DAMAGE_ROLLBACK) ? PEN_ADOPTED : PEN_OK;

    run_from_bank(true);
    TEST_ASSERT_EQUAL_HEX32(follows, after_damage(true));
    if (ON_DAMAGE == PEN_DAMAGE_ROLLBACK) {
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(verify)(&model, MODEL_SIZE(VERIFY)));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(step)(&model, &u, &y));
    }
}

/* Given up for a set that was opened; the set given to init is what remains, or nothing. */
void test_damage_and_no_rollback_set(void)
{
    const pen_status_t follows = (ON_DAMAGE == PEN_DAMAGE_HOLD) ? PEN_HELD : (ON_DAMAGE == PEN_DAMAGE_ROLLBACK) ? PEN_ADOPTED : PEN_OK;

    for (uint32_t k = 0U; k < 2U; k++) {
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(init)(&model, &set, &banks));
        run_from_bank(true);
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_begin)(&model, &set.head));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_abort)(&model));
        value[4] += (k == 1U) ? (pen_real_t)1 : (pen_real_t)0;
        TEST_ASSERT_EQUAL_HEX32(((k == 1U) && (follows == PEN_ADOPTED)) ? PEN_HELD : follows, after_damage(true));
    }
}

/* The rollback set would need more pieces than there is room for: only where that refuses. */
void test_damage_and_a_rollback_set_that_cannot_be_folded(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_select)(&model, &MODEL(set_altered_friction)));
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, MODEL(step)(&model, &u, &y) & ~PEN_OUTSIDE);
    run_from_bank(false);
    make_saw(SPRING);
    model.head.tuning.previous = set; /* what no call does */
    (void)after_damage(true);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_hold)(&model, false));
}

void test_damage_while_a_set_is_open(void)
{
    run_from_bank(false);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_begin)(&model, &set.head));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, after_damage(false));
}

static void both_step(pen_status_t right)
{
    MODEL(x_t) mine;
    MODEL(x_t) its;

    TEST_ASSERT_EQUAL_HEX32(right, MODEL(step)(&model, &u, &y) & ~PEN_OUTSIDE);
    TEST_ASSERT_EQUAL_HEX32(right, MODEL(step)(&other, &u, &y) & ~PEN_OUTSIDE);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(get_state)(&model, &mine));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(get_state)(&other, &its));
    TEST_ASSERT_EQUAL_MEMORY(&mine, &its, sizeof its);
}

void test_saved_and_restored_in_the_middle_of_a_set(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(init)(&other, &MODEL(set_default), &other_banks));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_begin)(&model, &set.head));
    stage_bytes(&model, 0U, 6U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(save)(&model, saved));
    saved[40] ^= 1U;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CHECKSUM, MODEL(restore)(&other, saved));
    saved[40] ^= 1U;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(restore)(&other, saved));
    both_step(PEN_OK);
    stage_bytes(&model, 6U, (uint32_t)sizeof value - 6U);
    stage_bytes(&other, 6U, (uint32_t)sizeof value - 6U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_commit)(&model));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_commit)(&other));
    both_step(PEN_ADOPTED);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(save)(&model, saved));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(restore)(&other, saved));
    both_step(PEN_OK);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(verify)(&other, MODEL_SIZE(VERIFY)));
}
