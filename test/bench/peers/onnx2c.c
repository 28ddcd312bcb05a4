/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* The network as onnx2c generates it: tensors in, tensors out. */

#include "rk4.h"

void peer_spring_entry(const float x[1][1], float y[1][1]);
void peer_damper_entry(const float x[1][1], float y[1][1]);

float peer_spring(float deflection)
{
    const float x[1][1] = { { deflection } };
    float y[1][1];

    peer_spring_entry(x, y);
    return y[0][0];
}

float peer_damper(float rate)
{
    const float x[1][1] = { { rate } };
    float y[1][1];

    peer_damper_entry(x, y);
    return y[0][0];
}
