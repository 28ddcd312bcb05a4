/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* Every NaN there is through every function that makes an integer of a number; built with sanitizers that stop the program. */
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "penode/pen_elementary.h"
#include "penode/pen_math.h"

#define EXPONENT UINT32_C(0x7f800000)

int main(void)
{
    uint32_t lost = 0U;

    for (uint32_t mantissa = 1U; mantissa < UINT32_C(0x00800000); mantissa++) {
        for (uint32_t sign = 0U; sign < 2U; sign++) {
            const uint32_t bits = (sign << 31U) | EXPONENT | mantissa;
            float x;
            memcpy(&x, &bits, sizeof x);
            const float y[] = { pen_exp(x), pen_tanh(x), pen_sigmoid(x), pen_softplus(x), pen_sin(x),
                                pen_cos(x), pen_atan(x), pen_log(x),     pen_sqrt(x) };
            for (size_t i = 0U; i < (sizeof y / sizeof y[0]); i++) {
                lost += (y[i] == y[i]) ? 1U : 0U; /* it must stay NaN */
            }
        }
    }
    printf("%u lost\n", (unsigned)lost);
    return (lost == 0U) ? 0 : 1;
}
