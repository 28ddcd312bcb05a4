/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * Fault monitor on the innovations of an extended Kalman filter (penode/pen_ekf.h). For generated code: `[monitor]` of a
 * model file writes NAME_monitor.h, whose functions an application calls. Step context only; memory of the caller.
 *
 * Without a fault the innovation v of a measurement has mean 0 and the variance S that the filter states. A fault of the
 * named size moves its mean to m, which is known: s, the change of the true state less the estimated one that the fault
 * makes, goes through the error dynamics of the filter,
 *   prediction   s = phi s + h/2 (phi e + e'), with e, e' the change of the rates before and now
 *   measurement  m = d + h s, then s -= K m, with d the change of the measurement itself; only of one that is used
 * and the logarithm of the likelihood ratio of a measurement is l = m (v - m/2) / S. A last test, for anything else, has
 *   l = (1 - 1/c^2)/2 v^2/S - log(c): innovations that are c times as wide.
 * Each test sums l, from 0 to the threshold a (Page's CUSUM). It is raised once the sum reaches a, and falls once it is
 * back at 0: on as much evidence against the fault as there was for it. Without a fault the likelihood ratio e^l has the
 * mean 1, given all measurements before. So the mean number of samples until one of n tests is raised is at least e^a / n
 * (Lorden 1971), whatever the excitation: a = log(n T/h) for a mean time of T between false alarms. What holds for v holds as far as the noises of the filter are right.
 */
#ifndef PEN_MONITOR_H
#define PEN_MONITOR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "penode/pen_ekf.h"
#include "penode/pen_real.h"
#include "penode/pen_status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Returned by a step of a monitor, beside no flag of the filter. */
#define PEN_MONITOR_CAUSE     UINT32_C(0x20000000) /* the test for a named cause is raised                          */
#define PEN_MONITOR_OTHER     UINT32_C(0x40000000) /* the test for anything else is raised                          */
#define PEN_MONITOR_NONFINITE 0x80000000U          /* sums would be NaN or Inf; the last good ones are kept         */

/** What the runtime needs to know of a monitor. Constant, in flash. */
typedef struct {
    uint32_t layout;      /* fingerprint of the model file                        */
    size_t n_x;           /* states of the filter                                 */
    size_t n_z;           /* its measurements                                     */
    size_t n_causes;      /* named causes; there is one test more                 */
    pen_real_t half_time; /* half a sample time                                   */
    pen_real_t threshold; /* of all tests                                         */
    pen_real_t scale;     /* of the last test: (1 - 1/c^2)/2                      */
    pen_real_t offset;    /* and log(c)                                           */
} pen_monitor_model_t;

/** What a step of the filter leaves to its monitor. */
typedef struct {
    const pen_real_t *phi;      /* [n_x][n_x] derivatives of the state along the one before               */
    const pen_real_t *h;        /* [n_z][n_x] derivatives of the measurements                             */
    const pen_real_t *gain;     /* [n_z][n_x] K S of each measurement, when it was used                   */
    const pen_real_t *direct;   /* [n_causes][n_z] change of the measurements by each cause               */
    const pen_ekf_test_t *test; /* [n_z]                                                                  */
    bool advanced;              /* false: the step of the filter held, and the monitor holds with it      */
} pen_monitor_sample_t;

/** One test. */
typedef struct {
    pen_real_t sum;  /* of log likelihood ratios, 0 to the threshold */
    uint32_t raised; /* 1: found                                                      */
    uint32_t count;  /* how often it was raised; wraps                                */
} pen_monitor_test_t;

/** The head of a monitor. Owned by it. Counters wrap. */
typedef struct {
    uint32_t ready;     /* layout of the model once initialised   */
    uint32_t running;   /* 1 after the first good sample          */
    uint32_t nonfinite; /* steps with PEN_MONITOR_NONFINITE       */
} pen_monitor_t;

/** All sums and sensitivities 0. @param s, effect  [2][n_causes][n_x]; @param test  [n_causes + 1] */
void pen_monitor_start(const pen_monitor_model_t *model, pen_monitor_t *self, pen_real_t s[], pen_real_t effect[],
                       pen_monitor_test_t test[]);

/**
 * One step, after that of the filter.
 * @param s       [2][n_causes][n_x] sensitivities: of the last good sample, new
 * @param effect  [2][n_causes][n_x] change of the rates by each cause: of the last good sample, new (given)
 * @param test    [n_causes + 1]
 * @return PEN_OK; PEN_MONITOR_CAUSE, PEN_MONITOR_OTHER, PEN_MONITOR_NONFINITE
 * Cost: n_causes (n_x^2 + 2 n_x n_z) multiply-adds and (n_causes + 1) n_z divisions, the same for any values.
 */
pen_status_t pen_monitor_step(const pen_monitor_model_t *model, pen_monitor_t *self, const pen_monitor_sample_t *sample, pen_real_t s[],
                              pen_real_t effect[], pen_monitor_test_t test[]);

#ifdef __cplusplus
}
#endif

#endif
