/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* Prints a hash over the bits of exp, tanh, sigmoid and softplus at a million floats, spread over all 2^32. NaN is NaN. */

#include <stdint.h>

#include "board.h"
#include "penode/pen_math.h"

#define SAMPLES 1000000U
#define SPREAD  2654435769U /* odd, near 2^32 divided by the golden ratio: each sample another float, spread evenly */

static uint32_t bits_of(pen_real_t value)
{
    const uint32_t bits = *(const uint32_t *)(const void *)&value;

    return ((bits & 0x7FFFFFFFU) > 0x7F800000U) ? 0x7FC00000U : bits;
}

int main(void)
{
    static uint64_t hash[4]; /* not on the stack: clearing it there would be a call of memset */

    for (uint32_t k = 0U; k < SAMPLES; k++) {
        const uint32_t bits = k * SPREAD;
        const pen_real_t x = *(const pen_real_t *)(const void *)&bits;
        const pen_real_t y[4] = { pen_exp(x), pen_tanh(x), pen_sigmoid(x), pen_softplus(x) };
        for (uint32_t i = 0U; i < 4U; i++) {
            hash[i] = (hash[i] ^ bits_of(y[i])) * UINT64_C(0x100000001B3);
        }
    }
    for (uint32_t i = 0U; i < 4U; i++) {
        board_print_hex((uint32_t)(hash[i] >> 32U));
        board_print_hex((uint32_t)hash[i]);
        board_print("\n");
    }
    return 0;
}
