/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "penode/pen_exact.h"

#include "penode/pen_monitor.h"

#include "penode/pen_math.h"
#include "penode/pen_port.h"

#define ZERO ((pen_real_t)0)
#define ONE  ((pen_real_t)1)
#define HALF ((pen_real_t)0.5)

void pen_monitor_start(const pen_monitor_model_t *model, pen_monitor_t *self, pen_real_t s[], pen_real_t effect[],
                       pen_monitor_test_t test[])
{
    const pen_real_t none[2] = { ZERO, ZERO };

    for (size_t i = 0U; i < (2U * model->n_causes * model->n_x); i++) {
        s[i] = none[i % 2U]; /* a plain loop would become a call of memset */
        effect[i] = none[i % 2U];
    }
    for (size_t i = 0U; i <= model->n_causes; i++) {
        test[i].sum = ZERO;
        test[i].raised = 0U;
        test[i].count = 0U;
    }
    self->running = 0U;
    self->nonfinite = 0U;
    self->ready = model->layout;
}

/* The sensitivity `to` before the measurements of a sample, from the one after those of the last. */
static void carry(const pen_monitor_model_t *model, const pen_real_t phi[], pen_real_t half, const pen_real_t s[],
                  const pen_real_t before[], const pen_real_t now[], pen_real_t to[])
{
    const size_t n = model->n_x;

    for (size_t i = 0U; i < n; i++) {
        pen_real_t sum = half * now[i];
        for (size_t j = 0U; j < n; j++) {
            sum += phi[(i * n) + j] * (s[j] + (half * before[j]));
        }
        to[i] = sum;
    }
}

/* Log likelihood ratio of the measurements of a sample for a cause; s becomes the sensitivity after them. */
static pen_real_t score_of(const pen_monitor_model_t *model, const pen_monitor_sample_t *sample, const pen_real_t direct[], pen_real_t s[])
{
    const size_t n = model->n_x;
    pen_real_t score = ZERO;

    for (size_t i = 0U; i < model->n_z; i++) {
        const pen_ekf_test_t *const test = &sample->test[i];
        const bool used = test->verdict == PEN_EKF_USED;
        pen_real_t mean = direct[i];
        for (size_t k = 0U; k < n; k++) {
            mean += sample->h[(i * n) + k] * s[k];
        }
        const pen_real_t share = pen_where(used, mean, ZERO) / pen_where(used, test->variance, ONE);
        score += share * (pen_where(used, test->innovation, ZERO) - (HALF * mean));
        for (size_t k = 0U; k < n; k++) {
            s[k] -= pen_where(used, sample->gain[(i * n) + k], ZERO) * share;
        }
    }
    return score;
}

/* The same for anything else. */
static pen_real_t score_of_rest(const pen_monitor_model_t *model, const pen_ekf_test_t test[])
{
    pen_real_t score = ZERO;

    for (size_t i = 0U; i < model->n_z; i++) {
        score += pen_where(test[i].verdict == PEN_EKF_USED, (model->scale * test[i].ratio) - model->offset, ZERO);
    }
    return score;
}

/* One step of a test; `good`: 1, else it stays. 1 if it is raised. */
static uint32_t take(const pen_monitor_model_t *model, pen_real_t score, uint32_t good, pen_monitor_test_t *test)
{
    const pen_real_t whole = test->sum + pen_where(good != 0U, score, ZERO);
    const pen_real_t above = pen_where(whole > ZERO, whole, ZERO);
    const pen_real_t sum = pen_where(above > model->threshold, model->threshold, above);
    const uint32_t up = (sum >= model->threshold) ? 1U : 0U;
    const uint32_t stays = (sum > ZERO) ? (test->raised & 1U) : 0U;
    const uint32_t raised = up | stays;

    test->count += raised & ~test->raised;
    test->sum = sum;
    test->raised = raised;
    return raised;
}

/* 1 if all n values are finite. */
static uint32_t sound(size_t n, const pen_real_t value[])
{
    return pen_finite(n, value) ? 1U : 0U;
}

pen_status_t pen_monitor_step(const pen_monitor_model_t *model, pen_monitor_t *self, const pen_monitor_sample_t *sample, pen_real_t s[],
                              pen_real_t effect[], pen_monitor_test_t test[])
{
    static const pen_status_t of_cause[2] = { PEN_OK, PEN_MONITOR_CAUSE };
    static const pen_status_t of_rest[2] = { PEN_OK, PEN_MONITOR_OTHER };
    static const pen_status_t of_held[2] = { PEN_MONITOR_NONFINITE, PEN_OK };
    const size_t n = model->n_x;
    const size_t total = model->n_causes * n;
    const uint32_t advanced = sample->advanced ? 1U : 0U;
    const pen_real_t half = pen_where(self->running != 0U, model->half_time, ZERO);
    const pen_real_t rest = score_of_rest(model, sample->test);
    uint32_t finite = sound(1U, &rest) & sound(total, &effect[total]);
    uint32_t found = 0U;

    for (size_t c = 0U; c < model->n_causes; c++) {
        const size_t at = c * n;
        carry(model, sample->phi, half, &s[at], &effect[at], &effect[total + at], &s[total + at]);
        const pen_real_t score = score_of(model, sample, &sample->direct[c * model->n_z], &s[total + at]);
        const uint32_t own = sound(1U, &score) & sound(n, &s[total + at]);
        finite &= own;
        found |= take(model, score, advanced & own, &test[c]);
    }
    const uint32_t others = take(model, rest, advanced & sound(1U, &rest), &test[model->n_causes]);
    const uint32_t good = advanced & finite;
    const pen_real_t *const new_s = &s[good * total];
    const pen_real_t *const new_effect = &effect[good * total];
    for (size_t i = 0U; i < total; i++) {
        s[i] = new_s[i];
        effect[i] = new_effect[i];
    }
    self->running |= good;
    self->nonfinite += advanced & ~finite;
    return of_cause[found] | of_rest[others] | of_held[good | (1U - advanced)];
}
