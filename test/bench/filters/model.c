/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* No filter: what the functions of the model take, which all filters call. */

#include "rival.h"

static rival_model_t self;

void rival_init(void)
{
    rival_begin(&self);
}

void rival_step(const costly_u_t *u, const costly_ekf_z_t *z)
{
    float x[N];

    (void)rival_predict(&self, u, z, x);
    rival_correct(&self, x);
}

float rival_state(size_t i)
{
    (void)i;
    return VARIANCE[0];
}

float rival_variance(size_t i)
{
    return START[i];
}

uint32_t rival_bytes(void)
{
    return (uint32_t)(sizeof(self) - sizeof(self.model));
}
