/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * What a filter of the comparison gives, and what all of them get: the functions of one generated model. test/bench/filters.py
 * compiles drive.c with one of the others.
 */
#ifndef RIVAL_H
#define RIVAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "costly_ekf.h"

#define N COSTLY_N_X
#define M COSTLY_EKF_N_Z

void rival_init(void);
void rival_step(const costly_u_t *u, const costly_ekf_z_t *z); /* predict, then use both measurements */
float rival_state(size_t i);
float rival_variance(size_t i);
uint32_t rival_bytes(void); /* of the filter, beside its model */

/* variances at the start, of process noise and of measurements: as test/filter/models/cost.toml has them */
static const float START[N] = { 4e-4F, 4e-4F, 4e-2F, 4e-2F };
static const float NOISE[N] = { 1e-11F, 1e-11F, 1e-7F, 1e-7F };
static const float NONE[N] = { 0.0F, 0.0F, 0.0F, 0.0F };
static const float VARIANCE[M] = { 4e-4F, 1e-2F };

typedef struct {
    costly_t model;
    costly_jacobian_t step;
    costly_sensors_jacobian_t sense;
    float miss[M]; /* measured less predicted */
    bool running;
} rival_model_t;

/* The next state with its derivatives, and the same of the measurements; the variances of process noise in this sample. */
static inline const float *rival_predict(rival_model_t *self, const costly_u_t *u, const costly_ekf_z_t *z, float x[N])
{
    const float *const noise = self->running ? NOISE : NONE;
    costly_x_t at;
    costly_y_t y;
    costly_z_t seen;

    (void)costly_step_jacobian(&self->model, u, &y, &self->step);
    (void)costly_sensors(&self->model, &seen);
    (void)costly_sensors_jacobian(&self->model, &self->sense);
    (void)costly_get_state(&self->model, &at);
    x[0] = at.z_b;
    x[1] = at.z_w;
    x[2] = at.v_b;
    x[3] = at.v_w;
    self->miss[0] = z->a_body - seen.a_body;
    self->miss[1] = z->a_wheel - seen.a_wheel;
    self->running = true;
    return noise;
}

static inline void rival_correct(rival_model_t *self, const float x[N])
{
    const costly_x_t at = { x[0], x[1], x[2], x[3] };

    (void)costly_set_state(&self->model, &at);
}

static inline void rival_begin(rival_model_t *self)
{
    (void)costly_init(&self->model, &SET, NULL);
    self->running = false;
}

#endif
