/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * longrun SECONDS RHO0 RHO1 RHO2 RHO3: the folded quarter vehicle at 1 kHz with a new set every second, staged, selected
 * or rolled back, now and then withdrawn first, beside the same discrete step written down here in double, S, with the pieces that the set in force
 * was folded to. x is the float state, d the one of the run in double, e = x - d.
 *
 * Each step       |x(k+1) - S(x(k))| <= RHO, what rounding can do in one step: longrun_check.py derives it
 * Each minute     e(k+1) = A(k) e(k) + r(k) with |r| <= RHO, where A is S with the networks' slopes between x and d, stage by
 *                 stage: S(x) - S(d) = A e, exactly. So |e(k)| <= sum of |A(k-1) .. A(j+1)| RHO over the last WINDOW
 *                 steps j, and the product of all of them times e before the window. It must be: no drift.
 *
 * Printed: the largest share of each bound that was used, and what RHO was derived for.
 */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "nqvm_folded.h"

#define RATE   1000U
#define X      4U
#define WINDOW 20000U /* steps */

static const pen_set_t *const set[2] = { &nqvm_folded_set_default, &nqvm_folded_set_altered_friction };
static unsigned long wrong, adopted, outside, withdrawn;
static nqvm_folded_t model;
static nqvm_folded_banks_t banks;

/* ---- the road: waves that never repeat together, of 3 mm, 8 mm and 0.5 mm ---- */

static pen_real_t road(unsigned long k)
{
    const double t = (double)k / RATE;

    return (pen_real_t)((0.003 * sin(9.42477 * t)) + (0.008 * sin(1.31 * t)) + (0.0005 * sin(77.7 * t)));
}

/* ---- the step in double; its constants are those of the float code, as exact numbers ---- */

typedef struct {
    double s[4]; /* by stage: input and output of both networks */
    double v[4];
    double of_s[4];
    double of_v[4];
    double slope_s[4];
    double slope_v[4];
} stages_t;

typedef struct {
    double z, rate, s, v, tyre, a, net_s, net_v, anchor_s, anchor_v, slope_s, slope_v;
} largest_t;

static largest_t most;

static void note(double *largest, double value)
{
    *largest = (fabs(value) > *largest) ? fabs(value) : *largest;
}

static double net(const pen_piece_t piece[], double x, double *anchor, double *slope)
{
    size_t k = 0U;

    while (((k + 1U) < NQVM_FOLDED_PIECES) && (x >= (double)piece[k + 1U].start)) {
        k++;
    }
    *slope = (double)piece[k].slope;
    note(anchor, *slope * (x - (double)piece[0].start));
    return (double)piece[k].offset + (*slope * (x - (double)piece[0].start));
}

static void rates(const double x[X], double z_road, double dx[X], stages_t *at, size_t stage)
{
    const pen_piece_t *const f = model.piece[model.head.tuning.active];
    const double s = x[0] - x[1];
    const double v = x[2] - x[3];
    const double of_s = net(&f[0], s, &most.anchor_s, &at->slope_s[stage]);
    const double of_v = net(&f[NQVM_FOLDED_PIECES], v, &most.anchor_v, &at->slope_v[stage]);
    const double force = (STIFFNESS * s) + (DAMPING * v) + of_s + of_v;
    const double tyre = TYRE * (x[1] - z_road);

    dx[0] = x[2];
    dx[1] = x[3];
    dx[2] = -(double)(float)(1.0 / BODY) * force;
    dx[3] = (double)(float)(1.0 / WHEEL) * (force - tyre);
    at->s[stage] = s;
    at->v[stage] = v;
    at->of_s[stage] = of_s;
    at->of_v[stage] = of_v;
    note(&most.z, x[0]);
    note(&most.z, x[1]);
    note(&most.z, z_road);
    note(&most.rate, x[2]);
    note(&most.rate, x[3]);
    note(&most.s, s);
    note(&most.v, v);
    note(&most.tyre, x[1] - z_road);
    note(&most.a, dx[2]);
    note(&most.a, dx[3]);
    note(&most.net_s, of_s);
    note(&most.net_v, of_v);
    note(&most.slope_s, at->slope_s[stage]);
    note(&most.slope_v, at->slope_v[stage]);
}

static const double node[4] = { 0.0, 0.5, 0.5, 1.0 };
static const double weight[4] = { 1.0, 2.0, 2.0, 1.0 };
static const double h = (double)0.001F;

static void reference(double x[X], double u0, double u1, stages_t *at)
{
    double k[X] = { 0.0, 0.0, 0.0, 0.0 };
    double sum[X] = { 0.0, 0.0, 0.0, 0.0 };

    for (size_t s = 0U; s < 4U; s++) {
        double xs[X];
        for (size_t n = 0U; n < X; n++) {
            xs[n] = x[n] + (h * node[s] * k[n]);
        }
        rates(xs, u0 + (node[s] * (u1 - u0)), k, at, s);
        for (size_t n = 0U; n < X; n++) {
            sum[n] += weight[s] * k[n];
        }
    }
    for (size_t n = 0U; n < X; n++) {
        x[n] += h / 6.0 * sum[n];
    }
}

/* ---- how errors go on ---- */

static double between(double x, double d, double of_x, double of_d, double slope)
{
    return (fabs(x - d) > 1e-14) ? ((of_x - of_d) / (x - d)) : slope;
}

static void times(double left[X][X], double right[X][X], double product[X][X])
{
    for (size_t i = 0U; i < X; i++) {
        for (size_t j = 0U; j < X; j++) {
            product[i][j] = 0.0;
            for (size_t n = 0U; n < X; n++) {
                product[i][j] += left[i][n] * right[n][j];
            }
        }
    }
}

/* The matrix of S between two states, from what the networks did in their stages. */
static void matrix(const stages_t *x, const stages_t *d, double a[X][X])
{
    double k[X][X] = { { 0.0 } };

    for (size_t i = 0U; i < X; i++) {
        for (size_t j = 0U; j < X; j++) {
            a[i][j] = (i == j) ? 1.0 : 0.0;
        }
    }
    for (size_t s = 0U; s < 4U; s++) {
        const double c = STIFFNESS + between(x->s[s], d->s[s], x->of_s[s], d->of_s[s], d->slope_s[s]);
        const double b = DAMPING + between(x->v[s], d->v[s], x->of_v[s], d->of_v[s], d->slope_v[s]);
        const double body = (double)(float)(1.0 / BODY);
        const double wheel = (double)(float)(1.0 / WHEEL);
        double f[X][X] = { { 0.0, 0.0, 1.0, 0.0 },
                           { 0.0, 0.0, 0.0, 1.0 },
                           { -c * body, c * body, -b * body, b * body },
                           { c * wheel, -(c + TYRE) * wheel, b * wheel, -b * wheel } };
        double from[X][X];
        for (size_t i = 0U; i < X; i++) {
            for (size_t j = 0U; j < X; j++) {
                from[i][j] = ((i == j) ? 1.0 : 0.0) + (h * node[s] * k[i][j]);
            }
        }
        times(f, from, k);
        for (size_t i = 0U; i < X; i++) {
            for (size_t j = 0U; j < X; j++) {
                a[i][j] += h / 6.0 * weight[s] * k[i][j];
            }
        }
    }
}

static double step_matrix[WINDOW][X][X]; /* of the last steps, in turn */
static double error[WINDOW][X];          /* before each */

/* |e| that rounding can have made, after step `last` of at least WINDOW. */
static void drift(unsigned long last, const double rho[X], double bound[X])
{
    double product[X][X] = { { 0.0 } };

    for (size_t i = 0U; i < X; i++) {
        product[i][i] = 1.0;
        bound[i] = 0.0;
    }
    for (unsigned long j = 0U; j < WINDOW; j++) {
        const unsigned long at = (last - j) % WINDOW;
        double next[X][X];
        for (size_t i = 0U; i < X; i++) {
            for (size_t n = 0U; n < X; n++) {
                bound[i] += fabs(product[i][n]) * rho[n];
            }
        }
        times(product, step_matrix[at], next);
        for (size_t i = 0U; i < X; i++) {
            for (size_t n = 0U; n < X; n++) {
                product[i][n] = next[i][n];
                bound[i] += (j == (WINDOW - 1U)) ? (fabs(next[i][n]) * fabs(error[at][n])) : 0.0;
            }
        }
    }
}

/* ---- a set every second ---- */

/* In these seconds a set is withdrawn before the one that comes; not while that one is being staged. */
static bool withdraws(unsigned long second)
{
    return ((second % 5U) == 3U) && (((second / 2U) % 3U) != 0U);
}

static pen_status_t tune(unsigned long second, unsigned int millisecond)
{
    const pen_set_t *const next = set[second % 2U];
    const unsigned int chunk = NQVM_FOLDED_SET_LENGTH / 100U;
    const unsigned int way = (unsigned int)((second / 2U) % 3U);
    pen_status_t status = PEN_OK;

    if ((way == 0U) && (millisecond == 0U)) {
        status = nqvm_folded_tune_begin(&model, &next->head);
    } else if ((way == 0U) && (millisecond <= 100U)) {
        const unsigned int from = (millisecond - 1U) * chunk;
        const unsigned int n = (millisecond < 100U) ? chunk : (NQVM_FOLDED_SET_LENGTH - from);
        status = nqvm_folded_tune_write(&model, from, &next->value[from], n);
    } else if (withdraws(second) && (millisecond == 898U)) {
        status = nqvm_folded_tune_select(&model, next);
        status |= nqvm_folded_tune_withdraw(&model);
    } else if (millisecond == 899U) {
        status = nqvm_folded_verify(&model, NQVM_FOLDED_VERIFY);
    } else if (millisecond != 900U) {
        /* the step alone */
    } else if (way == 0U) {
        status = nqvm_folded_tune_commit(&model);
    } else if ((way == 1U) || (second < 4U)) {
        status = nqvm_folded_tune_select(&model, next);
    } else {
        status = nqvm_folded_tune_rollback(&model);
    }
    return status;
}

/* The flags of step k: counted, and those that must come, and no others. */
static void take(unsigned long k, pen_status_t status)
{
    adopted += ((status & PEN_ADOPTED) != PEN_OK) ? 1U : 0U;
    outside += ((status & PEN_OUTSIDE) != PEN_OK) ? 1U : 0U;
    withdrawn += ((status & PEN_WITHDRAWN) != PEN_OK) ? 1U : 0U;
    wrong += ((status & ~(PEN_ADOPTED | PEN_OUTSIDE | PEN_WITHDRAWN)) == PEN_OK) ? 0U : 1U;
    wrong += (((status & PEN_WITHDRAWN) != PEN_OK) == (((k % RATE) == 898U) && withdraws(k / RATE))) ? 0U : 1U;
    wrong += (((status & PEN_ADOPTED) != PEN_OK) == ((k % RATE) == 900U)) ? 0U : 1U;
}

/* What the model has counted since the last time. */
static void read_counters(unsigned long counted[3])
{
    pen_status_report_t report;

    (void)nqvm_folded_status(&model, &report);
    counted[0] += pen_status_times(&report, PEN_OUTSIDE);
    counted[1] += pen_status_times(&report, PEN_ADOPTED);
    counted[2] += pen_status_times(&report, PEN_WITHDRAWN);
}

static void print_most(void)
{
    printf("z %.9g\nrate %.9g\ns %.9g\nv %.9g\ntyre %.9g\na %.9g\nnet_s %.9g\nnet_v %.9g\nanchor_s %.9g\nanchor_v %.9g\n", most.z,
           most.rate, most.s, most.v, most.tyre, most.a, most.net_s, most.net_v, most.anchor_s, most.anchor_v);
    printf("slope_s %.9g\nslope_v %.9g\n", most.slope_s, most.slope_v);
}

int main(int argc, char **argv)
{
    const unsigned long seconds = (argc > 5) ? strtoul(argv[1], NULL, 10) : 0U;
    unsigned long counted[3] = { 0U, 0U, 0U };
    double rho[X];
    double x[X] = { 0.0, 0.0, 0.0, 0.0 };
    double d[X] = { 0.0, 0.0, 0.0, 0.0 };
    double apart[X] = { 0.0, 0.0, 0.0, 0.0 };
    double step_share = 0.0;
    double drift_share = 0.0;

    for (size_t n = 0U; n < X; n++) {
        rho[n] = strtod(argv[2U + n], NULL);
    }
    wrong += (nqvm_folded_init(&model, set[0], &banks) == PEN_OK) ? 0U : 1U;
    for (unsigned long k = 0U; k < (seconds * RATE); k++) {
        const nqvm_folded_u_t u = { road(k) };
        const unsigned long at = k % WINDOW;
        nqvm_folded_y_t y;
        nqvm_folded_x_t now;
        stages_t of_x;
        stages_t of_d;
        pen_status_t status;

        wrong += (tune(k / RATE, (unsigned int)(k % RATE)) == PEN_OK) ? 0U : 1U;
        status = nqvm_folded_step(&model, &u, &y);
        take(k, status);
        (void)nqvm_folded_get_state(&model, &now);
        if (k > 0U) {
            const double state[X] = { (double)now.z_b, (double)now.z_w, (double)now.v_b, (double)now.v_w };
            for (size_t n = 0U; n < X; n++) {
                error[at][n] = x[n] - d[n];
            }
            reference(x, (double)road(k - 1U), (double)u.z_road, &of_x);
            reference(d, (double)road(k - 1U), (double)u.z_road, &of_d);
            matrix(&of_x, &of_d, step_matrix[at]);
            for (size_t n = 0U; n < X; n++) {
                note(&step_share, (state[n] - x[n]) / rho[n]);
                x[n] = state[n];
                note(&apart[n], x[n] - d[n]);
                wrong += (fabs(x[n] - d[n]) < INFINITY) ? 0U : 1U;
            }
        }
        if ((((k + 1U) % (60U * RATE)) == 0U) && (k > WINDOW)) {
            double bound[X];
            drift(k, rho, bound);
            for (size_t n = 0U; n < X; n++) {
                note(&drift_share, (x[n] - d[n]) / bound[n]);
            }
            read_counters(counted);
        }
    }
    wrong += (counted[0] == outside) ? 0U : 1U;
    wrong += ((counted[1] == adopted) && (adopted == seconds)) ? 0U : 1U;
    wrong += (counted[2] == withdrawn) ? 0U : 1U;
    wrong += ((step_share <= 1.0) && (drift_share <= 1.0)) ? 0U : 1U;
    printf("step %.3g\ndrift %.3g\napart %.3g %.3g %.3g %.3g\n", step_share, drift_share, apart[0], apart[1], apart[2], apart[3]);
    print_most();
    printf("adopted %lu\nwithdrawn %lu\noutside %lu\nwrong %lu\n", adopted, withdrawn, outside, wrong);
    return (wrong == 0U) ? 0 : 1;
}
