/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* SiL: a loop over many samples, and the sizes that a caller of the shared library needs. See sample.h. */

#include <stddef.h>
#include <stdint.h>

#include "sample.h"
#ifdef EKF_HEADER /* the model file has a filter */
#include "ekf_loop.h"
#endif
#ifdef MONITOR_HEADER /* and a monitor */
#include "monitor_loop.h"
#endif

enum { SIZE_INSTANCE, SIZE_BANKS, SIZE_REAL, SIZE_X, SIZE_U, SIZE_Y, SIZE_Z, SIZE_SAVED, SIZE_COUNT };

/** Sizes in bytes, in the order of the names above. */
const uint32_t sil_sizes[SIZE_COUNT] = {
    (uint32_t)sizeof(MODEL(t)),   (uint32_t)sizeof(MODEL(banks_t)), (uint32_t)sizeof(pen_real_t), (uint32_t)SAMPLE_X,
    (uint32_t)sizeof(MODEL(u_t)), (uint32_t)sizeof(MODEL(y_t)),     (uint32_t)SAMPLE_Z,           (uint32_t)MODEL_SIZE(SAVED),
};

/**
 * Step through n inputs.
 * @param u       [n]
 * @param sample  [n]; sample[k].y keeps the outputs of k - 1 (of `y` for k = 0) where step k holds
 * @param y       outputs before the first step; those after the last on return
 * @param status  [n]
 */
void sil_run(MODEL(t) *self, uint32_t n, const MODEL(u_t) u[], sample_t sample[], MODEL(y_t) *y, uint32_t status[]);
void sil_run(MODEL(t) *self, uint32_t n, const MODEL(u_t) u[], sample_t sample[], MODEL(y_t) *y, uint32_t status[])
{
    for (uint32_t k = 0U; k < n; k++) {
        sample[k].y = *y;
        status[k] = MODEL(step)(self, &u[k], &sample[k].y);
        sample_look(self, &sample[k]);
        *y = sample[k].y;
    }
}
