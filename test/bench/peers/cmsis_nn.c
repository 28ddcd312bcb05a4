/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* The network by CMSIS-NN's fully connected layer in float, which adds the bias and clamps to 0 and above for ReLU. */

#include "arm_nnfunctions.h"

#include "rk4.h"

static float network(const float w[], float input)
{
    static const int size[5] = { 1, 16, 16, 16, 1 };
    const cmsis_nn_context none = { 0, 0 };
    float buffer[2][16] = { { input } };

    for (int layer = 0; layer < 4; layer++) {
        const int columns = size[layer];
        const int rows = size[layer + 1];
        const cmsis_nn_fc_params_f32 how = { { (layer == 3) ? ARM_NN_F32_FINITE_LOWEST : 0.0F, ARM_NN_F32_FINITE_MAX },
                                             ARM_NN_WEIGHT_FORMAT_STANDARD };
        const cmsis_nn_dims in = { 1, 1, 1, columns };
        const cmsis_nn_dims matrix = { columns, 1, 1, rows };
        const cmsis_nn_dims out = { 1, 1, 1, rows };
        (void)arm_fully_connected_f32(&none, &how, &in, buffer[layer % 2], &matrix, w, &out, &w[rows * columns], &out,
                                      buffer[(layer + 1) % 2], ARM_NN_LAYOUT_NHWC);
        w += rows * (columns + 1);
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
