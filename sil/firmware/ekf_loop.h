/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/** SiL of a filter, NAME_ekf.h: a loop over many samples, and the sizes that a caller of the shared library needs. For sil.c. */
#ifndef EKF_LOOP_H
#define EKF_LOOP_H

#include <stddef.h>
#include <stdint.h>

#include EKF_HEADER

enum { EKF_SIZE_FILTER, EKF_SIZE_REAL, EKF_SIZE_STATES, EKF_SIZE_MEASURED, EKF_SIZE_ESTIMATE, EKF_SIZE_COUNT };

/** Sizes in bytes, in the order of the names above. */
const uint32_t sil_ekf_sizes[EKF_SIZE_COUNT] = {
    (uint32_t)sizeof(MODEL(ekf_t)),
    (uint32_t)sizeof(pen_real_t),
    (uint32_t)(MODEL_SIZE(EKF_N) * sizeof(pen_real_t)),
    (uint32_t)sizeof(MODEL(ekf_z_t)),
    (uint32_t)sizeof(MODEL(ekf_estimate_t)),
};

/* What a caller wants to see after a step, in row k of each. See sil_ekf_run. */
static void sil_ekf_look(const MODEL(ekf_t) *self, uint32_t k, pen_real_t x[], pen_real_t f[], MODEL(ekf_estimate_t) estimate[],
                         pen_ekf_test_t test[])
{
    const size_t states = MODEL_SIZE(EKF_N);
    const size_t measured = MODEL_SIZE(EKF_N_Z);

    if (estimate != NULL) {
        (void)MODEL(ekf_estimate)(self, &estimate[k]);
    }
    for (size_t i = 0U; (x != NULL) && (i < states); i++) {
        x[(k * states) + i] = self->x[0][i];
    }
    for (size_t i = 0U; (f != NULL) && (i < (states * states)); i++) {
        f[(k * states * states) + i] = self->f[0][i];
    }
    for (size_t i = 0U; i < measured; i++) {
        uint32_t count[PEN_EKF_VERDICTS];
        (void)MODEL(ekf_test)(self, (uint32_t)i, &test[(k * measured) + i], count);
    }
}

/**
 * Step through n samples.
 * @param u, z, mask  [n]
 * @param x, f        [n] states of the filter, and factors of their covariance; NULL: not wanted
 * @param estimate    [n]; NULL: not wanted
 * @param test        [n][EKF_N_Z]
 * @param status      [n]
 */
void sil_ekf_run(MODEL(ekf_t) *self, uint32_t n, const MODEL(u_t) u[], const MODEL(ekf_z_t) z[], const uint32_t mask[], pen_real_t x[],
                 pen_real_t f[], MODEL(ekf_estimate_t) estimate[], pen_ekf_test_t test[], uint32_t status[]);
void sil_ekf_run(MODEL(ekf_t) *self, uint32_t n, const MODEL(u_t) u[], const MODEL(ekf_z_t) z[], const uint32_t mask[], pen_real_t x[],
                 pen_real_t f[], MODEL(ekf_estimate_t) estimate[], pen_ekf_test_t test[], uint32_t status[])
{
    for (uint32_t k = 0U; k < n; k++) {
        status[k] = MODEL(ekf_step)(self, &u[k], &z[k], mask[k]);
        sil_ekf_look(self, k, x, f, estimate, test);
    }
}

/** How often each measurement was not offered, used, missing, refused: [EKF_N_Z][PEN_EKF_VERDICTS]. */
void sil_ekf_counts(const MODEL(ekf_t) *self, uint32_t count[]);
void sil_ekf_counts(const MODEL(ekf_t) *self, uint32_t count[])
{
    for (uint32_t i = 0U; i < MODEL_SIZE(EKF_N_Z); i++) {
        pen_ekf_test_t test;
        (void)MODEL(ekf_test)(self, i, &test, &count[i * PEN_EKF_VERDICTS]);
    }
}

#endif
