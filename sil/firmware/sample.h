/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * One sample of any generated model, and what tests need of it. For the SiL library and the PiL program.
 *
 * Options of the compiler select the model; for nqvm:
 *   -DMODEL_HEADER='"nqvm.h"'  '-DMODEL(name)=nqvm_##name'  '-DMODEL_SIZE(name)=NQVM_##name'
 *   -DMODEL_STATES  if it has states    -DMODEL_SENSORS  if it has sensors
 */
#ifndef SAMPLE_H
#define SAMPLE_H

#include MODEL_HEADER

#ifdef MODEL_STATES
#define SAMPLE_X sizeof(MODEL(x_t))
#else
#define SAMPLE_X 0U
#endif
#ifdef MODEL_SENSORS
#define SAMPLE_Z sizeof(MODEL(z_t))
#else
#define SAMPLE_Z 0U
#endif

/** A sample after the step. Nothing but pen_real_t, so that it is read as an array. */
typedef struct {
#ifdef MODEL_STATES
    MODEL(x_t) x; /* state                                                    */
#endif
    MODEL(y_t) y; /* outputs; those of the last good sample if the step holds */
#ifdef MODEL_SENSORS
    MODEL(z_t) z; /* sensors at that state and input                          */
#endif
} sample_t;

/** Look at an instance after a step: state and sensors, whatever the status of the step was. */
static inline void sample_look(const MODEL(t) *self, sample_t *sample)
{
#ifdef MODEL_STATES
    (void)MODEL(get_state)(self, &sample->x);
#endif
#ifdef MODEL_SENSORS
    (void)MODEL(sensors)(self, &sample->z);
#endif
    (void)self;
    (void)sample;
}

#endif
