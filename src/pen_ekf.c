/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "penode/pen_exact.h"

#include "penode/pen_ekf.h"

#include "penode/pen_elementary.h"
#include "penode/pen_math.h"
#include "penode/pen_port.h"

#define ZERO ((pen_real_t)0)
#define ONE  ((pen_real_t)1)

void pen_ekf_start(const pen_ekf_model_t *model, pen_ekf_t *self, pen_real_t f[], uint32_t count[])
{
    const size_t n = model->n_x;

    for (size_t j = 0U; j < n; j++) {
        for (size_t i = 0U; i < n; i++) {
            f[(j * n) + i] = pen_where(i == j, pen_ekf_at_least(model->start[j], model->floor[j]), ZERO);
        }
    }
    for (size_t i = 0U; i < (model->n_z * PEN_EKF_VERDICTS); i++) {
        pen_port_store(&count[i], 0U); /* a plain loop would become a call of memset */
    }
    self->running = 0U;
    self->held = 0U;
    self->limited = 0U;
    self->nonfinite = 0U;
    self->ready = model->layout;
}

/* How far the sum of a limit has to move to lie within it, from inside by more than its rounding error; 0 if it does. */
static pen_real_t way_in(const pen_ekf_model_t *model, size_t limit, const pen_real_t x[])
{
    const size_t n = model->n_x;
    const pen_real_t *const c = &model->limit[limit * n];
    const size_t roundings = 4U * (n + 2U);
    const pen_real_t unit = (pen_real_t)roundings * PEN_REAL_EPSILON;
    const pen_real_t least = model->least[limit];
    const pen_real_t most = model->most[limit];
    pen_real_t sum = ZERO;
    pen_real_t size = ZERO;

    for (size_t i = 0U; i < n; i++) {
        sum += c[i] * x[i];
        size += pen_port_abs(c[i] * x[i]);
    }
    const pen_real_t raised = pen_where(sum < least, least + (unit * (size + pen_port_abs(least))), sum);
    return pen_where(sum > most, most - (unit * (size + pen_port_abs(most))), raised) - sum;
}

/* Move x by the shortest way, in the metric of P, that moves the sum of a limit by `way`. */
static void project(const pen_ekf_model_t *model, size_t limit, pen_real_t way, const pen_real_t f[], pen_real_t x[], pen_real_t work[])
{
    const size_t n = model->n_x;
    pen_real_t *const gain = &work[n];
    const pen_real_t share = way / pen_ekf_spread(n, f, &model->limit[limit * n], work, gain);

    for (size_t i = 0U; i < n; i++) {
        pen_real_t sum = gain[i];
        for (size_t j = i + 1U; j < n; j++) {
            sum += f[(j * n) + i] * gain[j];
        }
        x[i] += sum * share;
    }
}

/* The largest part of the way from `inside` to x, 0 to 1, on which limit is kept. */
static pen_real_t part_of(const pen_ekf_model_t *model, size_t limit, const pen_real_t x[])
{
    const pen_real_t *const c = &model->limit[limit * model->n_x];
    const pen_real_t way = way_in(model, limit, x);
    const pen_real_t whole = pen_ekf_sum(model->n_x, c, x) - pen_ekf_sum(model->n_x, c, model->inside);
    const pen_real_t part = ONE + (way / whole);
    const pen_real_t some = pen_where(part > ZERO, part, ZERO);

    return pen_where(pen_port_abs(way) > ZERO, some, ONE);
}

/* Draw x towards `inside` until it keeps all limits. */
static void draw_in(const pen_ekf_model_t *model, pen_real_t x[])
{
    pen_real_t part = ONE;
    pen_real_t out = ZERO;

    for (size_t l = 0U; l < model->n_limits; l++) {
        const pen_real_t own = part_of(model, l, x);
        part = pen_where(own < part, own, part);
    }
    for (size_t i = 0U; i < model->n_x; i++) {
        x[i] = pen_where(part < ONE, model->inside[i] + (part * (x[i] - model->inside[i])), x[i]);
    }
    for (size_t l = 0U; l < model->n_limits; l++) {
        out += pen_port_abs(way_in(model, l, x));
    }
    for (size_t i = 0U; i < model->n_x; i++) {
        x[i] = pen_where(out > ZERO, model->inside[i], x[i]);
    }
}

pen_status_t pen_ekf_limit(const pen_ekf_model_t *model, const pen_real_t f[], pen_real_t x[], pen_real_t work[])
{
    pen_real_t moved = ZERO;

    for (size_t round = 0U; round < PEN_EKF_SWEEPS; round++) {
        for (size_t l = 0U; l < model->n_limits; l++) {
            const pen_real_t way = way_in(model, l, x);
            moved += pen_port_abs(way);
            project(model, l, way, f, x, work);
        }
    }
    draw_in(model, x);
    return (moved > ZERO) ? PEN_EKF_LIMITED : PEN_OK;
}

/* 0, or NaN if a number of the state or the factors is not finite. */
static pen_real_t doubt(size_t n, const pen_real_t f[], const pen_real_t x[])
{
    pen_real_t sum = ZERO;

    for (size_t i = 0U; i < n; i++) {
        sum += ZERO * x[i];
        for (size_t j = 0U; j <= i; j++) {
            sum += ZERO * f[(i * n) + j];
        }
    }
    return sum;
}

pen_status_t pen_ekf_finish(const pen_ekf_model_t *model, pen_ekf_t *self, pen_status_t status, pen_real_t f[], pen_real_t x[],
                            pen_ekf_test_t test[], uint32_t count[])
{
    /* Flags of measurements and limits mean nothing in a step that holds. */
    static const pen_status_t of_held[2] = { PEN_EKF_MISSING | PEN_EKF_REFUSED | PEN_EKF_LIMITED, PEN_OK };
    const size_t n = model->n_x;
    const pen_status_t found = (doubt(n, &f[n * n], &x[n]) >= ZERO) ? PEN_OK : PEN_EKF_NONFINITE;
    const uint32_t good = (((status | found) & PEN_EKF_HOLDING) == PEN_OK) ? 1U : 0U;
    const pen_status_t result = (status | found) & ~of_held[good];
    const pen_real_t *const new_f = &f[good * n * n];
    const pen_real_t *const new_x = &x[good * n];
    const pen_ekf_test_t *const new_test = &test[good * model->n_z];

    for (size_t i = 0U; i < n; i++) {
        x[i] = new_x[i];
        for (size_t j = 0U; j <= i; j++) {
            f[(i * n) + j] = new_f[(i * n) + j];
        }
    }
    for (size_t i = 0U; i < model->n_z; i++) {
        test[i].innovation = new_test[i].innovation;
        test[i].variance = new_test[i].variance;
        test[i].ratio = new_test[i].ratio;
        test[i].verdict = new_test[i].verdict;
        count[(i * PEN_EKF_VERDICTS) + (test[i].verdict % PEN_EKF_VERDICTS)] += good;
    }
    self->running |= good;
    self->held += 1U - good;
    self->limited += ((result & PEN_EKF_LIMITED) != PEN_OK) ? 1U : 0U;
    self->nonfinite += ((result & PEN_EKF_NONFINITE) != PEN_OK) ? 1U : 0U;
    return result;
}

pen_real_t pen_ekf_deviation(size_t n_x, const pen_real_t f[], const pen_real_t c[])
{
    pen_real_t variance = ZERO;

    for (size_t j = 0U; j < n_x; j++) {
        pen_real_t sum = c[j];
        for (size_t i = 0U; i < j; i++) {
            sum += f[(j * n_x) + i] * c[i];
        }
        variance += (f[(j * n_x) + j] * sum) * sum;
    }
    return pen_sqrt(variance);
}
