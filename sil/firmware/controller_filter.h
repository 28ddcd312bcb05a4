/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * What a controller steps where the model file has a filter: the filter, and its monitor if there is one. A second instance of the
 * model, with the set default, stands for the plant: its sensors, without noise, are the measurements. For controller.c.
 *
 * Compiler options: -DEKF_HEADER='"NAME_ekf.h"', -DMONITOR_HEADER='"NAME_monitor.h"', -DCORE(name)=..., the prefix of the model that the
 * filter steps, and -DMODEL_MEASURED=0U,2U, the sensors that it uses, in its order.
 */
#ifndef CONTROLLER_FILTER_H
#define CONTROLLER_FILTER_H

#include <stddef.h>
#include <stdint.h>

#include EKF_HEADER
#ifdef MONITOR_HEADER
#include MONITOR_HEADER
#endif

static MODEL(t) plant;
static MODEL(ekf_t) filter;
#ifdef MONITOR_HEADER
static MODEL(monitor_t) monitor;
#endif

static pen_status_t filter_start(CORE(banks_t) * banks)
{
    pen_status_t status = MODEL(init)(&plant, &MODEL(set_default), NULL) | MODEL(ekf_init)(&filter, &MODEL(set_default), banks);

#ifdef MONITOR_HEADER
    status |= MODEL(monitor_init)(&monitor);
#endif
    return status;
}

/* A sample: measure, filter, monitor. The flags of filter and monitor. */
static pen_status_t filter_step(const MODEL(u_t) *u, MODEL(z_t) *sensors, MODEL(ekf_estimate_t) *estimate)
{
    static const size_t measured[MODEL_SIZE(EKF_N_Z)] = { MODEL_MEASURED };
    union { /* a structure of sensors as an array, and back */
        MODEL(z_t) z;
        pen_real_t value[sizeof(MODEL(z_t)) / sizeof(pen_real_t)];
    } seen;
    union {
        MODEL(ekf_z_t) z;
        pen_real_t value[MODEL_SIZE(EKF_N_Z)];
    } offered;
    MODEL(y_t) y;
    pen_status_t status;

    (void)MODEL(step)(&plant, u, &y);
    (void)MODEL(sensors)(&plant, sensors);
    seen.z = *sensors;
    for (size_t i = 0U; i < MODEL_SIZE(EKF_N_Z); i++) {
        offered.value[i] = seen.value[measured[i]];
    }
    status = MODEL(ekf_step)(&filter, u, &offered.z, MODEL_SIZE(EKF_ALL));
#ifdef MONITOR_HEADER
    status |= MODEL(monitor_step)(&monitor, &filter, status);
#endif
    (void)MODEL(ekf_estimate)(&filter, estimate);
    return status;
}

#endif
