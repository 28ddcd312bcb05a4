/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* The network as a textbook has it: loops over layers, rows and columns. Weights of a layer: rows, then biases. */

#include "rk4.h"

static float network(const float w[], float input)
{
    static const int size[5] = { 1, 16, 16, 16, 1 };
    float in[16] = { input };

    for (int layer = 0; layer < 4; layer++) {
        const int columns = size[layer];
        const int rows = size[layer + 1];
        float out[16];
        for (int row = 0; row < rows; row++) {
            float sum = w[(rows * columns) + row];
            for (int column = 0; column < columns; column++) {
                sum += w[(row * columns) + column] * in[column];
            }
            out[row] = ((layer == 3) || (sum > 0.0F)) ? sum : 0.0F;
        }
        for (int row = 0; row < rows; row++) {
            in[row] = out[row];
        }
        w += rows * (columns + 1);
    }
    return in[0];
}

float peer_spring(float deflection)
{
    return network(&peer_weights[0], deflection);
}

float peer_damper(float rate)
{
    return network(&peer_weights[WEIGHTS], rate);
}
