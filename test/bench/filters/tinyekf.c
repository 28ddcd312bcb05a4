/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* TinyEKF, from a checkout: whole matrices, both measurements at once with the inverse of their covariance. */

#define EKF_N 4
#define EKF_M 2
#include "tinyekf.h"

#include "rival.h"

static rival_model_t self;
static ekf_t filter;
static float q[N * N];

void rival_init(void)
{
    rival_begin(&self);
    ekf_initialize(&filter, START);
}

void rival_step(const costly_u_t *u, const costly_ekf_z_t *z)
{
    static const float r[M * M] = { 4e-4F, 0.0F, 0.0F, 1e-2F };
    static const float none[M] = { 0.0F };
    float x[N];
    const float *const noise = rival_predict(&self, u, z, x);

    for (size_t i = 0U; i < N; i++) {
        q[i * (N + 1U)] = noise[i];
    }
    ekf_predict(&filter, x, &self.step.x_x[0][0], q);
    (void)ekf_update(&filter, self.miss, none, &self.sense.z_x[0][0], r);
    rival_correct(&self, filter.x);
}

float rival_state(size_t i)
{
    return filter.x[i];
}

float rival_variance(size_t i)
{
    return filter.P[i * (N + 1U)];
}

uint32_t rival_bytes(void)
{
    return (uint32_t)((sizeof(self) - sizeof(self.model)) + sizeof(filter) + sizeof(q));
}
