/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* The network by CMSIS-DSP's matrix times vector; bias and ReLU are what it leaves to its user. */

#include "dsp/matrix_functions.h"

#include "rk4.h"

static float network(const float w[], float input)
{
    static const unsigned short size[5] = { 1, 16, 16, 16, 1 };
    float buffer[2][16] = { { input } };

    for (int layer = 0; layer < 4; layer++) {
        const unsigned short rows = size[layer + 1];
        const arm_matrix_instance_f32 matrix = { rows, size[layer], (float *)w };
        const float *const bias = &w[rows * size[layer]];
        float *const out = buffer[(layer + 1) % 2];
        arm_mat_vec_mult_f32(&matrix, buffer[layer % 2], out);
        for (int row = 0; row < rows; row++) {
            const float sum = out[row] + bias[row];
            out[row] = ((layer == 3) || (sum > 0.0F)) ? sum : 0.0F;
        }
        w = &bias[rows];
    }
    return buffer[0][0];
}

float peer_spring(float deflection)
{
    return network(&peer_weights[0], deflection);
}

float peer_damper(float rate)
{
    return network(&peer_weights[WEIGHTS], rate);
}
