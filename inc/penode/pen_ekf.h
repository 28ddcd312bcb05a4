/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * Extended Kalman filter on a generated model, with its exact discrete derivatives. For generated code: `[filter]` of a
 * model file writes NAME_ekf.h, whose functions an application calls. Step context only; memory of the caller.
 *
 * The covariance is kept as factors, P = U D U', with U unit upper triangular and D diagonal: in an array f [n][n], U(i, j)
 * in row j and column i, D on the diagonal, the rest not used. P is symmetric, and positive as long as D is. Nothing is
 * subtracted from D:
 *   prediction   weighted Gram-Schmidt (Thornton): D(j) is a sum of squares with weights that are not negative
 *   measurement  one after the other (Bierman): D(j) is multiplied by a(j-1)/a(j), where a(j) = a(j-1) + D(j) f(j)^2
 *                and a(0), the variance of the measurement, is above 0: so by a factor above 0 and at most 1
 * What remains is underflow, and rows of phi that depend on each other without noise. So D(j) is never less than a floor:
 * the square of PEN_REAL_EPSILON times the standard deviation at the start, but 2^24 PEN_REAL_MIN at least, so that its
 * reciprocal is a number. That is a standard deviation below what rounding leaves of a state of that size.
 *
 * A measurement that is not offered, missing (NaN or Inf), or refused takes the same instructions as one that is used:
 * its row of derivatives is replaced by 0, and with that Bierman's update gives every factor back to the bit.
 */
#ifndef PEN_EKF_H
#define PEN_EKF_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "penode/pen_real.h"
#include "penode/pen_status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Raised by a step of a filter besides those of a step (penode/pen_status.h), which has no flag at these bits. */
#define PEN_EKF_MISSING   UINT32_C(0x02000000) /* a measurement that was offered is NaN or Inf; not used                */
#define PEN_EKF_REFUSED   UINT32_C(0x04000000) /* the test ratio of a measurement is above its gate; not used           */
#define PEN_EKF_LIMITED   UINT32_C(0x08000000) /* the state left its limits, and was projected onto them                */
#define PEN_EKF_NONFINITE UINT32_C(0x10000000) /* state or covariance would be NaN or Inf; the last good ones are kept  */

/** The step of the filter did not advance: state, covariance and tests are those before. */
#define PEN_EKF_HOLDING (PEN_HOLDING | PEN_EKF_NONFINITE)

#define PEN_EKF_SWEEPS 2U /* projections onto each limit, one limit after the other */

/** What the runtime needs to know of a filter. Constant, in flash. */
typedef struct {
    uint32_t layout;             /* fingerprint of the model file                                               */
    size_t n_x;                  /* states: of the model, then errors of its inputs; from 1 on                  */
    size_t n_w;                  /* sources of process noise                                                    */
    size_t n_z;                  /* measurements, 1 to 32                                                       */
    size_t n_limits;             /* limits                                                                      */
    const pen_real_t *start;     /* [n_x] variances at the start                                                */
    const pen_real_t *floor;     /* [n_x] what D is never less than, above 0                                    */
    const pen_real_t *noise;     /* [n_w] variances of process noise in a sample                                */
    const size_t *from;          /* [n_x] sources before this one act on no state from here on; never falls     */
    const pen_real_t *variance;  /* [n_z] of measurement noise, above 0                                         */
    const pen_real_t *gate;      /* [n_z] largest test ratio; PEN_REAL_MAX: no gate                             */
    const pen_real_t *limit;     /* [n_limits][n_x] coefficients of a sum of states ...                         */
    const pen_real_t *least;     /* [n_limits] ... which has to be at least this, -PEN_REAL_MAX: any            */
    const pen_real_t *most;      /* [n_limits] ... and at most this, PEN_REAL_MAX: any                          */
    const pen_real_t *inside;    /* [n_x] a state that keeps all limits                                         */
} pen_ekf_model_t;

/** What became of a measurement. */
#define PEN_EKF_NOT_OFFERED 0U
#define PEN_EKF_USED        1U
#define PEN_EKF_IS_MISSING  2U
#define PEN_EKF_IS_REFUSED  3U
#define PEN_EKF_VERDICTS    4U

/** Test of one measurement. */
typedef struct {
    pen_real_t innovation; /* measured less predicted; 0 if not offered or missing   */
    pen_real_t variance;   /* that the filter expects of it                          */
    pen_real_t ratio;      /* innovation^2 / variance: 1 on average                  */
    uint32_t verdict;      /* one of the four above                                  */
} pen_ekf_test_t;

/** The head of a filter. Owned by it. Counters wrap. */
typedef struct {
    uint32_t ready;     /* layout of the filter once initialised */
    uint32_t running;   /* 1 after the first good sample         */
    uint32_t held;      /* steps that did not advance            */
    uint32_t limited;   /* steps with PEN_EKF_LIMITED            */
    uint32_t nonfinite; /* steps with PEN_EKF_NONFINITE          */
} pen_ekf_t;

/** Set factors to the variances at the start, and clear head and counters. @param f  [n_x][n_x]; @param count  as below */
void pen_ekf_start(const pen_ekf_model_t *model, pen_ekf_t *self, pen_real_t f[], uint32_t count[]);

/**
 * Factors of phi P phi' + share gamma Q gamma'.
 * @param phi    [n_x][n_x]; @param gamma  [n_x][n_w] effect of each source of noise; @param share  0 or 1
 * @param from   [n_x][n_x] factors of P; @param to  the new ones; may not overlap
 * @param work   [(n_x + 2)(n_x + n_w)]
 * Cost: at most n_x^2 (3 n_x/2 + n_w) multiply-adds and n_x divisions, the same for any values.
 */
void pen_ekf_predict(const pen_ekf_model_t *model, const pen_real_t phi[], const pen_real_t gamma[], pen_real_t share,
                     const pen_real_t from[], pen_real_t to[], pen_real_t work[]);

/**
 * Use one measurement.
 * @param i        which one, below n_z
 * @param h        [n_x] derivatives of the measurement
 * @param z        measured less predicted by the state before any measurement of this sample; NaN or Inf: missing
 * @param offered  false: there is none in this sample
 * @param f        [n_x][n_x] factors; @param dx  [n_x] correction of the state so far: both are updated
 * @param work     [2 n_x]
 * @return PEN_OK; PEN_EKF_MISSING; PEN_EKF_REFUSED
 * Cost: 3/2 n_x^2 + 5 n_x multiply-adds and 2 n_x + 1 divisions, the same for any values and verdict.
 */
pen_status_t pen_ekf_update(const pen_ekf_model_t *model, size_t i, const pen_real_t h[], pen_real_t z, bool offered, pen_real_t f[],
                            pen_real_t dx[], pen_real_t work[], pen_ekf_test_t *test);

/**
 * Move x onto the limits: PEN_EKF_SWEEPS rounds of projections in the metric of P, one limit after the other; what
 * does not keep all limits then is drawn towards `inside`, in a straight line, until it does. On return every sum
 * keeps its limits, as a number of pen_real_t summed in the order of the states, and exactly: each is aimed at from
 * inside by more than its rounding error. A state that keeps all limits is not changed.
 * @param f  [n_x][n_x] factors of P; @param x  [n_x]; @param work  [2 n_x]
 * @return PEN_OK; PEN_EKF_LIMITED
 * Cost: the same for any values.
 */
pen_status_t pen_ekf_limit(const pen_ekf_model_t *model, const pen_real_t f[], pen_real_t x[], pen_real_t work[]);

/**
 * Keep what was computed if it is good, else what was there; selected by index, always the same work. Counts.
 * @param status  of the step of the model and the calls above
 * @param f  [2][n_x][n_x] factors: of the last sample, new; @param x  [2][n_x] the same of the state
 * @param test  [2][n_z] the same of the tests; @param count  [n_z][PEN_EKF_VERDICTS]
 * @return status, and PEN_EKF_NONFINITE where it applies
 */
pen_status_t pen_ekf_finish(const pen_ekf_model_t *model, pen_ekf_t *self, pen_status_t status, pen_real_t f[], pen_real_t x[],
                            pen_ekf_test_t test[], uint32_t count[]);

/** Standard deviation of the sum of c [n_x] times the state. Cost: n_x^2/2 + 2 n_x multiply-adds and a root. */
pen_real_t pen_ekf_deviation(size_t n_x, const pen_real_t f[], const pen_real_t c[]);

#ifdef __cplusplus
}
#endif

#endif
