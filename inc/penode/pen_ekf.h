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

#include "penode/pen_math.h"
#include "penode/pen_port.h"
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
    const pen_real_t *variance;  /* [n_z] of measurement noise, above 0                                         */
    const pen_real_t *gate;      /* [n_z] largest test ratio; PEN_REAL_MAX: no gate                             */
    const pen_real_t *limit;     /* [n_limits][n_x] coefficients of a sum of states ...                         */
    const pen_real_t *least;     /* [n_limits] ... which has to be at least this, -PEN_REAL_MAX: any            */
    const pen_real_t *most;      /* [n_limits] ... and at most this, PEN_REAL_MAX: any                          */
    const pen_real_t *inside;    /* [n_x] a state that keeps all limits                                         */
} pen_ekf_model_t;

/** Result for a measurement. */
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

/* Prediction and measurement are inline, so that all sizes are constants and short loops are written out. */

/* d, or `least` if that is more; NaN stays NaN. */
static inline pen_real_t pen_ekf_at_least(pen_real_t d, pen_real_t least)
{
    return pen_where(d < least, least, d);
}

static inline pen_real_t pen_ekf_sum(size_t n, const pen_real_t c[], const pen_real_t x[])
{
    pen_real_t sum = (pen_real_t)0;

    PEN_PORT_UNROLL
    for (size_t i = 0U; i < n; i++) {
        sum += c[i] * x[i];
    }
    return sum;
}

/* along = U' c, gain = D U' c; the variance c' P c. */
static inline pen_real_t pen_ekf_spread(size_t n, const pen_real_t f[], const pen_real_t c[], pen_real_t along[], pen_real_t gain[])
{
    pen_real_t variance = (pen_real_t)0;

    PEN_PORT_UNROLL
    for (size_t j = 0U; j < n; j++) {
        pen_real_t sum = c[j];
        PEN_PORT_UNROLL
        for (size_t i = 0U; i < j; i++) {
            sum += f[(j * n) + i] * c[i];
        }
        along[j] = sum;
        gain[j] = f[(j * n) + j] * sum;
        variance += sum * gain[j];
    }
    return variance;
}

/* rows = [gamma, phi U], n of them, and their weights, [share Q, D]. */
static inline void pen_ekf_join(const pen_ekf_model_t *model, const pen_real_t phi[], const pen_real_t gamma[], pen_real_t share,
                                const pen_real_t f[], pen_real_t rows[], pen_real_t weight[])
{
    const size_t n = model->n_x;
    const size_t first = model->n_w;
    const size_t wide = first + n;

    PEN_PORT_UNROLL
    for (size_t k = 0U; k < first; k++) {
        weight[k] = share * model->noise[k];
    }
    PEN_PORT_UNROLL
    for (size_t j = 0U; j < n; j++) {
        weight[first + j] = f[(j * n) + j];
    }
    for (size_t i = 0U; i < n; i++) {
        pen_real_t *const row = &rows[i * wide];
        const pen_real_t *const own = &phi[i * n];
        PEN_PORT_UNROLL
        for (size_t k = 0U; k < first; k++) {
            row[k] = gamma[(i * first) + k];
        }
        PEN_PORT_UNROLL
        for (size_t j = 0U; j < n; j++) {
            pen_real_t sum = own[j];
            PEN_PORT_UNROLL
            for (size_t k = 0U; k < j; k++) {
                sum += own[k] * f[(j * n) + k];
            }
            row[first + j] = sum;
        }
    }
}

/* Take out of a row what it has along `last`; how much that was. By last times its weights, and 1 / D of it. */
static inline pen_real_t pen_ekf_take_out(size_t wide, const pen_real_t last[], const pen_real_t weighted[], pen_real_t inverse,
                                          pen_real_t row[])
{
    const pen_real_t share = pen_ekf_sum(wide, weighted, row) * inverse;

    PEN_PORT_UNROLL
    for (size_t k = 0U; k < wide; k++) {
        row[k] -= share * last[k];
    }
    return share;
}

/**
 * Factors of phi P phi' + share gamma Q gamma'.
 * @param phi    [n_x][n_x]; @param gamma  [n_x][n_w] effect of each source of noise; @param share  0 or 1
 * @param from   [n_x][n_x] factors of P; @param to  the new ones; may not overlap
 * @param work   [(n_x + 2)(n_x + n_w)]
 * Cost: n_x (n_x + 1)(n_x + n_w) + n_x^2 (n_x - 1)/2 multiply-adds and n_x divisions, the same for any values.
 */
static inline void pen_ekf_predict(const pen_ekf_model_t *model, const pen_real_t phi[], const pen_real_t gamma[], pen_real_t share,
                                   const pen_real_t from[], pen_real_t to[], pen_real_t work[])
{
    const size_t n = model->n_x;
    const size_t wide = n + model->n_w;
    pen_real_t *const weight = &work[n * wide];
    pen_real_t *const weighted = &work[(n + 1U) * wide];

    pen_ekf_join(model, phi, gamma, share, from, work, weight);
    for (size_t left = n; left > 0U; left--) {
        const size_t j = left - 1U;
        const pen_real_t *const last = &work[j * wide];
        pen_real_t sum = (pen_real_t)0;
        PEN_PORT_UNROLL
        for (size_t k = 0U; k < wide; k++) {
            weighted[k] = last[k] * weight[k];
            sum += weighted[k] * last[k];
        }
        const pen_real_t d = pen_ekf_at_least(sum, model->floor[j]);
        const pen_real_t inverse = (pen_real_t)1 / d;
        to[(j * n) + j] = d;
        for (size_t i = 0U; i < j; i++) {
            to[(j * n) + i] = pen_ekf_take_out(wide, last, weighted, inverse, &work[i * wide]);
        }
    }
}

/*
 * Bierman's update with along = U' h and gain = D U' h, which becomes P h. With both 0 every factor stays, to the bit:
 * the quotient is 1, and -0 is added. The variance of the innovation.
 */
static inline pen_real_t pen_ekf_correct(const pen_ekf_model_t *model, pen_real_t variance, const pen_real_t along[], pen_real_t gain[],
                                         pen_real_t f[])
{
    const size_t n = model->n_x;
    pen_real_t before = variance;

    PEN_PORT_UNROLL
    for (size_t j = 0U; j < n; j++) {
        const pen_real_t own = gain[j];
        const pen_real_t now = before + (along[j] * own);
        const pen_real_t lambda = -(along[j] / before);
        f[(j * n) + j] = pen_ekf_at_least(f[(j * n) + j] * (before / now), model->floor[j]);
        PEN_PORT_UNROLL
        for (size_t i = 0U; i < j; i++) {
            const pen_real_t u = f[(j * n) + i];
            f[(j * n) + i] = u + (gain[i] * lambda);
            gain[i] += u * own;
        }
        before = now;
    }
    return before;
}

/**
 * Use one measurement.
 * @param i        which one, below n_z
 * @param h        [n_x] derivatives of the measurement
 * @param z        measured less predicted by the state before any measurement of this sample; NaN or Inf: missing
 * @param offered  false: there is none in this sample
 * @param f        [n_x][n_x] factors; @param dx  [n_x] correction of the state so far: both are updated
 * @param work     [2 n_x]; then from n_x on P h of a measurement that was used, 0 of any other
 * @return PEN_OK; PEN_EKF_MISSING; PEN_EKF_REFUSED
 * Cost: 3/2 n_x^2 + 5 n_x multiply-adds and 2 n_x + 1 divisions, the same for any values and verdict.
 */
static inline pen_status_t pen_ekf_update(const pen_ekf_model_t *model, size_t i, const pen_real_t h[], pen_real_t z, bool offered,
                                          pen_real_t f[], pen_real_t dx[], pen_real_t work[], pen_ekf_test_t *test)
{
    static const uint32_t verdicts[8] = {
                                          /* by offered, sound and within its gate */
        PEN_EKF_NOT_OFFERED, PEN_EKF_NOT_OFFERED, PEN_EKF_NOT_OFFERED, PEN_EKF_NOT_OFFERED,
        PEN_EKF_IS_MISSING,  PEN_EKF_IS_MISSING,  PEN_EKF_IS_REFUSED,  PEN_EKF_USED,
    };
    static const pen_status_t flags[PEN_EKF_VERDICTS] = { PEN_OK, PEN_OK, PEN_EKF_MISSING, PEN_EKF_REFUSED };
    const pen_real_t zero = (pen_real_t)0;
    const size_t n = model->n_x;
    pen_real_t *const along = work;
    pen_real_t *const gain = &work[n];
    const pen_real_t variance = model->variance[i] + pen_ekf_spread(n, f, h, along, gain);
    const uint32_t there = offered ? 4U : 0U;
    const uint32_t sound = ((zero * z) >= zero) ? 2U : 0U;
    const pen_real_t innovation = pen_where((there + sound) == 6U, z - pen_ekf_sum(n, h, dx), zero);
    const pen_real_t ratio = (innovation * innovation) / variance;
    const uint32_t within = (ratio <= model->gate[i]) ? 1U : 0U;
    const uint32_t number = (variance <= PEN_REAL_MAX) ? 1U : 0U;
    const uint32_t verdict = verdicts[there + sound + (within & number)];
    const bool used = verdict == PEN_EKF_USED;

    PEN_PORT_UNROLL
    for (size_t k = 0U; k < n; k++) {
        along[k] = pen_where(used, along[k], zero);
        gain[k] = pen_where(used, gain[k], zero);
    }
    const pen_real_t share = pen_where(used, innovation, zero) / pen_ekf_correct(model, model->variance[i], along, gain, f);
    PEN_PORT_UNROLL
    for (size_t k = 0U; k < n; k++) {
        dx[k] += gain[k] * share;
    }
    test->innovation = innovation;
    test->variance = variance;
    test->ratio = ratio;
    test->verdict = verdict;
    return flags[verdict];
}

/**
 * Move x onto the limits: PEN_EKF_SWEEPS rounds of projections in the metric of P, one limit after the other; a
 * state that then breaks a limit is moved towards `inside`, in a straight line, until it keeps all. On return every sum
 * keeps its limits, as a number of pen_real_t summed in the order of the states, and exactly: each is aimed at from
 * inside by more than its rounding error. A state that keeps all limits is not changed.
 * @param f  [n_x][n_x] factors of P; @param x  [n_x]; @param work  [2 n_x]
 * @return PEN_OK; PEN_EKF_LIMITED
 * Cost: the same for any values.
 */
pen_status_t pen_ekf_limit(const pen_ekf_model_t *model, const pen_real_t f[], pen_real_t x[], pen_real_t work[]);

/**
 * Keep the new values if they are good, else the previous ones; selected by index, always the same work. Counts.
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
