/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* A model with promises and a trial: which sets are refused, and with which breach. */

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include MODEL_HEADER

#include "unity.h"

#include "coverage_model.inc"

#define FACTOR 597U /* of a network's output */
#define SHIFT  598U /* and what is added then */

static pen_status_t select_with(size_t at, pen_real_t factor)
{
    memcpy(value, MODEL(set_default).value, sizeof value);
    value[at] *= factor;
    seal();
    return MODEL(tune_select)(&model, &set);
}

void test_a_broken_promise_is_told(void)
{
    static MODEL(t) blank;
    pen_breach_t breach;

    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, MODEL(tune_breach)(NULL, &breach));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, MODEL(tune_breach)(&blank, &breach));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, MODEL(tune_breach)(&model, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_PROMISE, select_with(DAMPER + FACTOR, (pen_real_t)-1)); /* a damper that drives */
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_breach)(&model, &breach));
    TEST_ASSERT_EQUAL_UINT32(MODEL_SIZE(NETWORK_DAMPER_NET), breach.network);
    TEST_ASSERT_EQUAL_HEX32(PEN_PROMISE_DISSIPATIVE, breach.kind);
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_PROMISE, select_with(SPRING + FACTOR, (pen_real_t)1000));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_breach)(&model, &breach));
    TEST_ASSERT_EQUAL_UINT32(MODEL_SIZE(NETWORK_SPRING_NET), breach.network);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(step)(&model, &u, &y)); /* nothing was published */
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_PROMISE, MODEL(init)(&twin, &set, NULL));
}

/* 400 kN more move the body of 350 kg by 28 mm within 7 ms: more than 10 mm. */
void test_a_trial_that_leads_too_far(void)
{
    memcpy(value, MODEL(set_default).value, sizeof value);
    value[SPRING + SHIFT] += (pen_real_t)400000;
    seal();
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_TRIAL, MODEL(tune_select)(&model, &set));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(step)(&model, &u, &y));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, select_with(SPRING + FACTOR, (pen_real_t)1.01F));
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, MODEL(step)(&model, &u, &y));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(tune_rollback)(&model)); /* not tried */
}

/* Neither of the two copies can be stepped: the new set is not better. */
void test_a_trial_from_where_nothing_is_finite(void)
{
    for (size_t k = 0U; k < MODEL_SIZE(TRIAL_ROOM); k++) {
        model.sample[k].x[0] = PEN_REAL_MAX;
        model.sample[k].x[1] = -PEN_REAL_MAX;
    }
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_TRIAL, MODEL(tune_select)(&model, &MODEL(set_altered_friction)));
}

/* A sample during a trial is not kept, nor what comes before it used again; a step that was held begins anew as well. */
void test_samples_with_a_gap(void)
{
    const uint32_t written = model.trial.written;

    TEST_ASSERT_EQUAL_UINT32(20U, written - model.trial.first);
    model.trial.closed = 1U; /* what a trial in another context does */
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(step)(&model, &u, &y));
    model.trial.closed = 0U;
    TEST_ASSERT_EQUAL_UINT32(written, model.trial.written);
    TEST_ASSERT_EQUAL_UINT32(written, model.trial.first);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, MODEL(step)(&model, &u, &y));
    TEST_ASSERT_EQUAL_UINT32(1U, model.trial.written - model.trial.first);
    u.z_road = bad[0];
    TEST_ASSERT_EQUAL_HEX32(PEN_INPUT_NONFINITE, MODEL(step)(&model, &u, &y) & ~PEN_OUTSIDE);
    TEST_ASSERT_EQUAL_UINT32(model.trial.written, model.trial.first);
    u.z_road = (pen_real_t)0.01;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, select_with(SPRING + FACTOR, (pen_real_t)1.01F)); /* nothing to try it on */
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, MODEL(step)(&model, &u, &y));
}
