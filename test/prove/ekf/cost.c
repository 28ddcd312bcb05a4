/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * Prints kind of sample, least and most instructions of a step of the filter, then bytes of its struct and of the stack
 * that a step takes. Kinds: what is measured, missing, refused. "wrong": samples not of their kind; "bits": checksums.
 */

#include <math.h>
#include <stddef.h>
#include <stdint.h>

#include "board.h"
#include "counting.h"
#include "penode/pen_serial.h"

#include EKF_HEADER

#define SAMPLES 400U

enum { MEASURED, NOT_OFFERED, MISSING, INFINITE, REFUSED, ONE_OF_TWO, KINDS };

static const char *const NAME[KINDS] = { "measured", "not offered", "missing", "infinite", "refused", "one of two" };
static const pen_status_t WANTED[KINDS] = { PEN_OK, PEN_OK, PEN_EKF_MISSING, PEN_EKF_MISSING, PEN_EKF_REFUSED, PEN_OK };

static MODEL(ekf_t) filter;

int main(void)
{
    pen_real_t road = (pen_real_t)0;
    uint32_t least[KINDS];
    uint32_t most[KINDS];
    uint32_t wrong = MODEL(ekf_init)(&filter, &SET, NULL);

    for (size_t k = 0U; k < KINDS; k++) {
        least[k] = UINT32_MAX;
        most[k] = 0U;
    }
    for (uint32_t sample = 0U; sample < SAMPLES; sample++) {
        const size_t kind = (sample < 50U) ? MEASURED : (sample % KINDS);
        MODEL(z_t) seen;
        MODEL(u_t) u;
        MODEL(ekf_z_t) z;
        volatile uint32_t mask = MODEL_SIZE(EKF_ALL); /* so that it is computed before the count begins */
        pen_status_t status;
        uint32_t n;
        road += (pen_real_t)1e-4 * next();
        u.z_road = road;
        (void)STEPPED(sensors)(&filter.model, &seen);
        z.a_body = seen.a_body + ((pen_real_t)0.01 * next());
        z.a_wheel = seen.a_wheel + ((pen_real_t)0.05 * next()) + ((kind == REFUSED) ? (pen_real_t)1000 : (pen_real_t)0);
        z.a_body = (kind == MISSING) ? NAN : z.a_body;
        z.a_wheel = (kind == INFINITE) ? -INFINITY : z.a_wheel;
        mask = (kind == NOT_OFFERED) ? 0U : mask;
        mask = (kind == ONE_OF_TWO) ? 1U : mask;
        board_count_start();
        status = MODEL(ekf_step)(&filter, &u, &z, mask);
        n = board_count_stop();
        wrong += ((status & ~(PEN_EKF_LIMITED | PEN_EKF_REFUSED)) != (WANTED[kind] & ~PEN_EKF_REFUSED)) ? 1U : 0U;
        wrong += ((kind == REFUSED) && ((status & PEN_EKF_REFUSED) == PEN_OK)) ? 1U : 0U;
        if (sample > 1U) { /* the first sample does not integrate */
            least[kind] = (n < least[kind]) ? n : least[kind];
            most[kind] = (n > most[kind]) ? n : most[kind];
        }
    }
    for (size_t k = 0U; k < KINDS; k++) {
        line(NAME[k], least[k], most[k]);
    }
    line("struct", (uint32_t)sizeof(filter), (uint32_t)sizeof(filter.model));
    line("limited", filter.head.limited, filter.head.limited);
    line("wrong", wrong, wrong);
    line("bits", pen_crc_values(PEN_CRC_START, MODEL_SIZE(EKF_N), filter.x[0]),
         pen_crc_values(PEN_CRC_START, MODEL_SIZE(EKF_N) * MODEL_SIZE(EKF_N), filter.f[0]));
    return 0;
}
