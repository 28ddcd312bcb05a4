/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/** The Runge-Kutta step of gen/nqvm/nqvm.toml around a peer's networks. The constants come with the weights. */
#ifndef RK4_H
#define RK4_H

#include "constants.h"

#ifdef PEER_INLINED
#define INLINED inline __attribute__((always_inline))
#else
#define INLINED
float peer_spring(float deflection);
float peer_damper(float rate);
#endif

static INLINED void rates(const float x[4], float road, float dx[4])
{
    const float force = (C * (x[0] - x[1])) + (D * (x[2] - x[3])) + peer_spring(x[0] - x[1]) + peer_damper(x[2] - x[3]);

    dx[0] = x[2];
    dx[1] = x[3];
    dx[2] = -M_B_INVERSE * force;
    dx[3] = M_W_INVERSE * (force - (C_T * (x[1] - road)));
}

void peer_step(float x[4], float before, float now)
{
    static const float share[4] = { 0.0F, 0.5F, 0.5F, 1.0F };
    float dx[4][4];
    float at[4] = { x[0], x[1], x[2], x[3] };

#ifdef PEER_INLINED
#pragma GCC unroll 4
#endif
    for (int stage = 0; stage < 4; stage++) {
        rates(at, before + (share[stage] * (now - before)), dx[stage]);
        for (int i = 0; (stage < 3) && (i < 4); i++) {
            at[i] = x[i] + ((H * share[stage + 1]) * dx[stage][i]);
        }
    }
    for (int i = 0; i < 4; i++) {
        x[i] += (H / 6.0F) * (dx[0][i] + (2.0F * dx[1][i]) + (2.0F * dx[2][i]) + dx[3][i]);
    }
}

#endif
