/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/** SiL of a monitor, NAME_monitor.h: a loop over many samples of it and its filter, as firmware has it. For sil.c. */
#ifndef MONITOR_LOOP_H
#define MONITOR_LOOP_H

#include <stddef.h>
#include <stdint.h>

#include MONITOR_HEADER

/** Sizes: of a monitor in bytes, number of its tests. */
const uint32_t sil_monitor_sizes[2] = { (uint32_t)sizeof(MODEL(monitor_t)), (uint32_t)MODEL_SIZE(MONITOR_TESTS) };

/**
 * Step filter and monitor through n samples.
 * @param u, z, mask            [n]
 * @param x, f, estimate, test  as sil_ekf_run
 * @param status                [n] of the filter and its monitor
 * @param sum, raised           [n][MONITOR_TESTS] sums in thresholds, and whether a test is raised
 */
void sil_monitor_run(MODEL(ekf_t) *filter, uint32_t n, const MODEL(u_t) u[], const MODEL(ekf_z_t) z[], const uint32_t mask[],
                     pen_real_t x[], pen_real_t f[], MODEL(ekf_estimate_t) estimate[], pen_ekf_test_t test[], uint32_t status[],
                     MODEL(monitor_t) *self, pen_real_t sum[], uint32_t raised[]);
void sil_monitor_run(MODEL(ekf_t) *filter, uint32_t n, const MODEL(u_t) u[], const MODEL(ekf_z_t) z[], const uint32_t mask[],
                     pen_real_t x[], pen_real_t f[], MODEL(ekf_estimate_t) estimate[], pen_ekf_test_t test[], uint32_t status[],
                     MODEL(monitor_t) *self, pen_real_t sum[], uint32_t raised[])
{
    const size_t tests = MODEL_SIZE(MONITOR_TESTS);

    for (uint32_t k = 0U; k < n; k++) {
        const pen_status_t stepped = MODEL(ekf_step)(filter, &u[k], &z[k], mask[k]);
        status[k] = stepped | MODEL(monitor_step)(self, filter, stepped);
        sil_ekf_look(filter, k, x, f, estimate, test);
        for (size_t i = 0U; i < tests; i++) {
            pen_monitor_test_t found = { (pen_real_t)0, 0U, 0U };
            (void)MODEL(monitor_test)(self, (uint32_t)i, &found);
            sum[(k * tests) + i] = found.sum;
            raised[(k * tests) + i] = found.raised;
        }
    }
}

#endif
