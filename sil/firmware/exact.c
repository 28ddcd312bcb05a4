/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* The reference simulation's integrator, for the host: an explicit embedded Runge-Kutta pair of order 8 with error control
 * (Hairer, Norsett, Wanner: Solving Ordinary Differential Equations I, II.5), from sample to sample. Inputs are Chebyshev series. */

#include "exact.h"

enum { STAGES = 12 };                             /* of the pair; one more for its error, which is the first of the next step */
enum { DONE, PAUSED, STUCK };                     /* what exact_run returns */
enum { CENTRE, RESCALE, RELU, IDENTITY, TANH, SIGMOID, SOFTPLUS, STEP }; /* kinds of layers */

static const double SAFETY = 0.9, SHRINK = 0.2, GROW = 10.0; /* next step by this one, least and most */

/** Inputs, and the samples at which states are wanted. */
typedef struct {
    const double *a, *b, *c, *e3, *e5; /**< of the pair: [STAGES, STAGES], [STAGES], [STAGES], [STAGES + 1], [STAGES + 1] */
    double rtol, atol;
    size_t n_x, n_u, terms;
    const double *bounds;        /**< [segments + 1] s */
    const double *value, *slope; /**< [segments, n_u, terms], Chebyshev coefficients over a segment */
    size_t pieces;               /**< the inputs are smooth within a piece; no step goes beyond */
    const size_t *first;         /**< [pieces + 1] segments */
    size_t rows;
    const double *times; /**< [rows] s, increasing */
    double *kept;        /**< [rows, n_x] */
    double *work;        /**< [(STAGES + 3) n_x + 2 n_u] */
} exact_job_t;

/** Where it is. All 0 at the start, but t and h: time and the next step to try [s]. */
typedef struct {
    double t, h;
    size_t piece, row, segment;
} exact_place_t;

int exact_run(const exact_job_t *job, const exact_set_t *set, exact_place_t *at, double x[], size_t steps);
void exact_look(const exact_set_t *set, size_t rows, const size_t n[4], const double *x, const double *u, const double *v, double *y,
                double *z);

static double activated(int kind, double z)
{
    switch (kind) {
    case RELU: return exact_larger(z, 0.0);
    case TANH: return tanh(z);
    case SIGMOID: return exact_sigmoid(z);
    case SOFTPLUS: return exact_softplus(z);
    case STEP: return isnan(z) ? z : ((z >= 0.0) ? 1.0 : 0.0);
    default: return z;
    }
}

double exact_network(const double w[], const double in[])
{
    double h[2][EXACT_WIDTH] = { { 0.0 } };
    const size_t layers = (size_t)w[0];
    const double *from = in;
    w++;
    for (size_t l = 0U; l < layers; l++) {
        const int kind = (int)w[0];
        const size_t n = (size_t)w[1], m = (size_t)w[2];
        double *to = h[l % 2U];
        w += 3;
        if (kind == CENTRE || kind == RESCALE) {
            for (size_t i = 0U; i < m; i++) {
                to[i] = (kind == CENTRE) ? ((from[i] - w[i]) * w[m + i]) : ((from[i] * w[m + i]) + w[i]);
            }
            w += 2U * m;
        } else {
            for (size_t i = 0U; i < m; i++) {
                to[i] = 0.0;
            }
            for (size_t j = 0U; j < n; j++, w += m) {
                for (size_t i = 0U; i < m; i++) {
                    to[i] += w[i] * from[j];
                }
            }
            for (size_t i = 0U; i < m; i++) {
                to[i] = activated(kind, to[i] + w[i]);
            }
            w += m;
        }
        from = to;
    }
    return from[0];
}

/** A Chebyshev series at s in [-1, 1] (Clenshaw). */
static double series(const double c[], size_t terms, double s)
{
    double before = 0.0, last = 0.0;
    for (size_t k = terms - 1U; k > 0U; k--) {
        const double next = (2.0 * s * last) - before + c[k];
        before = last;
        last = next;
    }
    return (s * last) - before + c[0];
}

/** dx/dt at time t within the piece. */
static void rates(const exact_job_t *job, const exact_set_t *set, exact_place_t *at, double t, const double x[], double out[])
{
    double *u = &job->work[(STAGES + 3U) * job->n_x], *v = &u[job->n_u];
    const size_t first = job->first[at->piece], last = job->first[at->piece + 1U] - 1U;
    size_t k = at->segment;
    while (k < last && t > job->bounds[k + 1U]) {
        k++;
    }
    while (k > first && t < job->bounds[k]) {
        k--;
    }
    at->segment = k;
    const double width = job->bounds[k + 1U] - job->bounds[k], s = (2.0 * (t - job->bounds[k]) / width) - 1.0;
    for (size_t i = 0U; i < job->n_u; i++) {
        const size_t c = ((k * job->n_u) + i) * job->terms;
        u[i] = series(&job->value[c], job->terms, s);
        v[i] = series(&job->slope[c], job->terms, s);
    }
    exact_rates(set, x, u, v, out);
}

/** x plus h times the weighted sum of the first `stages` rates k. */
static void advance(size_t n, const double x[], double h, const double weights[], size_t stages, const double k[], double out[])
{
    for (size_t i = 0U; i < n; i++) {
        double sum = 0.0;
        for (size_t j = 0U; j < stages; j++) {
            sum += weights[j] * k[(j * n) + i];
        }
        out[i] = x[i] + (h * sum);
    }
}

/** Tries a step of h; the rates at its start are in work. Returns its error, 1 being what is allowed. */
static double try_step(const exact_job_t *job, const exact_set_t *set, exact_place_t *at, double h, const double x[])
{
    const size_t n = job->n_x;
    double *k = job->work, *next = &k[(STAGES + 1U) * n], *point = &next[n];
    double five = 0.0, three = 0.0;
    for (size_t s = 1U; s < STAGES; s++) {
        advance(n, x, h, &job->a[s * STAGES], s, k, point);
        rates(job, set, at, at->t + (job->c[s] * h), point, &k[s * n]);
    }
    advance(n, x, h, job->b, STAGES, k, next);
    rates(job, set, at, at->t + h, next, &k[STAGES * n]);
    for (size_t i = 0U; i < n; i++) {
        const double scale = job->atol + (job->rtol * exact_larger(fabs(x[i]), fabs(next[i])));
        double e5 = 0.0, e3 = 0.0;
        for (size_t j = 0U; j <= STAGES; j++) {
            e5 += job->e5[j] * k[(j * n) + i];
            e3 += job->e3[j] * k[(j * n) + i];
        }
        five += (e5 / scale) * (e5 / scale);
        three += (e3 / scale) * (e3 / scale);
    }
    return (five > 0.0 || isnan(five)) ? (h * five / sqrt((five + (0.01 * three)) * (double)n)) : 0.0;
}

/** Keeps the state for each sample at the present time. */
static void keep(const exact_job_t *job, exact_place_t *at, const double x[])
{
    while (at->row < job->rows && job->times[at->row] <= at->t) {
        for (size_t i = 0U; i < job->n_x; i++) {
            job->kept[(at->row * job->n_x) + i] = x[i];
        }
        at->row++;
    }
}

/**
 * Integrate from at->t to the end of the last piece, or for a number of steps.
 * @param x  [n_x] state at at->t, moved along
 * @return   DONE, PAUSED: call again to go on, STUCK: no step is small enough
 */
int exact_run(const exact_job_t *job, const exact_set_t *set, exact_place_t *at, double x[], size_t steps)
{
    const size_t n = job->n_x;
    double *k = job->work, *next = &k[(STAGES + 1U) * n];
    int fresh = 1; /* the rates at the start of the next step are not known */
    keep(job, at, x);
    while (at->piece < job->pieces) {
        const double end = job->bounds[job->first[at->piece + 1U]];
        if (at->t >= end) {
            at->piece++;
            fresh = 1;
            continue;
        }
        if (steps-- == 0U) {
            return PAUSED;
        }
        if (fresh) {
            at->segment = job->first[at->piece];
            rates(job, set, at, at->t, x, k);
            fresh = 0;
        }
        const double target = (at->row < job->rows && job->times[at->row] < end) ? job->times[at->row] : end;
        const int whole = at->t + (1.0001 * at->h) >= target; /* rather than to leave a step that is next to nothing */
        const double h = whole ? (target - at->t) : at->h;
        const double error = try_step(job, set, at, h, x);
        double factor = isfinite(error) ? (SAFETY * pow(error, -0.125)) : SHRINK; /* order 7 of the error */
        factor = (factor < SHRINK) ? SHRINK : factor;
        if (error < 1.0) {
            const double grown = h * ((factor > GROW) ? GROW : factor);
            at->h = (whole && grown < at->h) ? ((error > 0.5) ? grown : at->h) : grown;
            at->t = whole ? target : (at->t + h);
            for (size_t i = 0U; i < n; i++) {
                x[i] = next[i];
                k[i] = k[(STAGES * n) + i];
            }
            keep(job, at, x);
        } else {
            at->h = h * ((factor > SAFETY) ? SAFETY : factor);
            if (at->t + at->h <= nextafter(at->t, end)) {
                return STUCK;
            }
        }
    }
    return DONE;
}

/** Outputs y [rows, n_y] and sensors z [rows, n_z] at states x [rows, n_x] and inputs u, v [rows, n_u]; n: those four numbers. */
void exact_look(const exact_set_t *set, size_t rows, const size_t n[4], const double *x, const double *u, const double *v, double *y,
                double *z)
{
    for (size_t k = 0U; k < rows; k++) {
        exact_outputs(set, &x[k * n[0]], &u[k * n[1]], &v[k * n[1]], &y[k * n[2]]);
        exact_sensors(set, &x[k * n[0]], &u[k * n[1]], &v[k * n[1]], &z[k * n[3]]);
    }
}
