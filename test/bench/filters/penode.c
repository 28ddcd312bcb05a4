/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* The generated filter. */

#include "rival.h"

static costly_ekf_t filter;

void rival_init(void)
{
    (void)costly_ekf_init(&filter, &SET, NULL);
}

void rival_step(const costly_u_t *u, const costly_ekf_z_t *z)
{
    (void)costly_ekf_step(&filter, u, z, COSTLY_EKF_ALL);
}

float rival_state(size_t i)
{
    return filter.x[0][i];
}

float rival_variance(size_t i)
{
    float sum = filter.f[0][(i * N) + i];

    for (size_t j = i + 1U; j < N; j++) {
        sum += filter.f[0][(j * N) + i] * filter.f[0][(j * N) + i] * filter.f[0][(j * N) + j];
    }
    return sum;
}

uint32_t rival_bytes(void)
{
    return (uint32_t)(sizeof(filter) - sizeof(filter.model));
}
