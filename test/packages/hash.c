/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * Prints the state hash of 1000 steps of the nQVM: CRC-32 of all states, little endian, as port/README.md does on a target. It
 * includes the model only and has a CRC of its own, so that it can be built against any package.
 */

#include <stdio.h>
#include <string.h>

#include "nqvm.h"

#ifdef PEN_REAL_DOUBLE
typedef uint64_t bits_t;
#else
typedef uint32_t bits_t;
#endif

static uint32_t crc = UINT32_MAX;

static void take(pen_real_t value)
{
    bits_t bits;

    memcpy(&bits, &value, sizeof(bits));
    for (size_t i = 0U; i < (8U * sizeof(bits)); i++) {
        const uint32_t bit = (uint32_t)(bits >> i) & 1U;
        crc = (crc >> 1U) ^ ((((crc ^ bit) & 1U) != 0U) ? UINT32_C(0xedb88320) : 0U);
    }
}

int main(void)
{
    static nqvm_t model;
    pen_status_t held = nqvm_init(&model, &nqvm_set_default, NULL);

    for (uint32_t k = 0U; k < 1000U; k++) {
        const nqvm_u_t u = { (pen_real_t)(k % 250U) * (pen_real_t)0.0001 };
        nqvm_y_t y;
        nqvm_x_t x;

        if (!pen_advanced(nqvm_step(&model, &u, &y)) || (nqvm_get_state(&model, &x) != PEN_OK)) {
            held = PEN_HELD;
        }
        take(x.z_b);
        take(x.z_w);
        take(x.v_b);
        take(x.v_w);
    }
    printf("state hash 0x%08x %s\n", (unsigned)~crc, (held == PEN_OK) ? "good" : "held");
    return 0;
}
