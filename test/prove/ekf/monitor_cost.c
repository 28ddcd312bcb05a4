/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * Prints kind of sample, least and most instructions of a step of the monitor, then bytes of its struct. Kinds: what is
 * measured, missing, not taken over, and while a test is raised. "wrong": samples not of their kind; "bits": checksum of the sums.
 */

#include <math.h>
#include <stddef.h>
#include <stdint.h>

#include "board.h"
#include "counting.h"
#include "monitored_monitor.h"
#include "monitored_sets.h"
#include "penode/pen_serial.h"

#define SAMPLES 400U
#define QUIET   300U /* from there on the innovations are too wide */

enum { MEASURED, NOT_OFFERED, MISSING, HOLDING, RAISED, KINDS };

static const char *const NAME[KINDS] = { "measured", "not offered", "missing", "holding", "raised" };

static monitored_ekf_t filter;
static monitored_monitor_t monitor;

int main(void)
{
    const monitored_u_t u = { (pen_real_t)0 };
    pen_real_t sum[MONITORED_MONITOR_TESTS];
    uint32_t least[KINDS];
    uint32_t most[KINDS];
    uint32_t wrong = monitored_ekf_init(&filter, &monitored_set_default, NULL) | monitored_monitor_init(&monitor);

    for (size_t k = 0U; k < KINDS; k++) {
        least[k] = UINT32_MAX;
        most[k] = 0U;
    }
    for (uint32_t sample = 0U; sample < SAMPLES; sample++) {
        const size_t kind = (sample < QUIET) ? (sample % (uint32_t)RAISED) : (size_t)RAISED;
        const pen_real_t wide = (kind == RAISED) ? (pen_real_t)10 : (pen_real_t)0.1;
        monitored_ekf_z_t z;
        volatile pen_status_t stepped; /* so that it is known before the count begins */
        pen_status_t status;
        pen_monitor_test_t test;
        uint32_t n;
        z.a_body = wide * (pen_real_t)0.05 * next();
        z.a_wheel = wide * (pen_real_t)0.25 * next();
        z.a_body = (kind == MISSING) ? NAN : z.a_body;
        stepped = monitored_ekf_step(&filter, &u, &z, (kind == NOT_OFFERED) ? 0U : MONITORED_EKF_ALL);
        wrong += ((stepped & PEN_EKF_MISSING) != ((kind == MISSING) ? PEN_EKF_MISSING : PEN_OK)) ? 1U : 0U;
        stepped |= (kind == HOLDING) ? PEN_EKF_NONFINITE : PEN_OK;
        board_count_start();
        status = monitored_monitor_step(&monitor, &filter, stepped);
        n = board_count_stop();
        least[kind] = (n < least[kind]) ? n : least[kind];
        most[kind] = (n > most[kind]) ? n : most[kind];
        (void)monitored_monitor_test(&monitor, MONITORED_MONITOR_OTHER, &test);
        wrong += ((sample < QUIET) && (test.raised != 0U)) ? 1U : 0U;
        wrong += ((sample == (SAMPLES - 1U)) && ((status & PEN_MONITOR_OTHER) == PEN_OK)) ? 1U : 0U;
    }
    for (size_t k = 0U; k < KINDS; k++) {
        line(NAME[k], least[k], most[k]);
    }
    for (uint32_t i = 0U; i < MONITORED_MONITOR_TESTS; i++) {
        sum[i] = monitor.test[i].sum;
    }
    line("struct", (uint32_t)sizeof(monitor), (uint32_t)sizeof(monitor));
    line("wrong", wrong, wrong);
    line("bits", pen_crc_values(PEN_CRC_START, MONITORED_MONITOR_TESTS, sum), 0U);
    return 0;
}
