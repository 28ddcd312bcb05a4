/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* The whole step as CasADi generates it: the call it wants. */

#include "casadi_step.h"

#include "constants.h"

void peer_step(float x[4], float before, float now)
{
    static float work[step_SZ_W + 1];
    static int integers[step_SZ_IW + 1];
    float next[4];
    const float *in[step_SZ_ARG] = { x, &before, &now, peer_weights };
    float *out[step_SZ_RES] = { next };

    (void)step(in, out, integers, work, 0);
    for (int i = 0; i < 4; i++) {
        x[i] = next[i];
    }
}
