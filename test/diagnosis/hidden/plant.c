/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors
 */
/* Masses on one axis, force laws between them, Runge-Kutta of order 4 at a fixed high rate, in double. It only makes test
 * data: every static force is a table (the table is the law), every law with memory has one state of its own. */
#include <math.h>
#include <stddef.h>

enum { LINEAR, RATE_CURVE, DEFLECTION_CURVE, BRISTLE, LUGRE, SLIDER, SERIES, HEATED, TRACK, SKYHOOK, TRACK_SPRING, CONTACT };
enum { GROUND = -1, MOTION = -2, AUXILIARY = -3 };      /* ends that are not masses */
enum { MAX_MASSES = 8, MAX_LAWS = 32, MAX_STATES = 2 * MAX_MASSES + MAX_LAWS, TABLE_HALF = 4096 };

typedef struct {
    int kind, a, b, unused;                             /* a positive force pulls the ends a and b together */
    double p[4];
    const double *table;                                /* [2 TABLE_HALF + 1] over asinh(x / scale), or NULL */
    double scale, per_step;                             /* of the table: unit of x, points per unit of asinh */
} law_t;

typedef struct {
    int masses, laws;
    const double *inverse;                              /* [masses][masses], of the mass matrix */
    const law_t *law;                                   /* [laws] */
    const double *motion, *auxiliary;                   /* [knots] road, motion or force; anything else that is a function of time */
    double knot_rate;                                   /* Hz */
    size_t knots;
} plant_t;

typedef struct {
    double value, rate;
} sample_t;

/* Cubic through the knots, with the slopes of central differences: error of order 4, continuous rate. */
static sample_t track(const double *y, size_t n, double x, double rate)
{
    if (x < 1.0) {
        x = 1.0;
    }
    if (x > (double)n - 2.000001) {
        x = (double)n - 2.000001;
    }
    const size_t i = (size_t)x;
    const double u = x - (double)i, m0 = 0.5 * (y[i + 1] - y[i - 1]), m1 = 0.5 * (y[i + 2] - y[i]), step = y[i + 1] - y[i];
    const double c2 = 3.0 * step - 2.0 * m0 - m1, c3 = m0 + m1 - 2.0 * step;
    return (sample_t){ y[i] + u * (m0 + u * (c2 + u * c3)), rate * (m0 + u * (2.0 * c2 + u * 3.0 * c3)) };
}

static double curve(const law_t *l, double x)
{
    return track(l->table, 2 * TABLE_HALF + 1, TABLE_HALF + l->per_step * asinh(x / l->scale), 0.0).value;
}

/* Force of a law at deflection s, rate v and its own state q; *dq is the rate of that state. */
static double force(const law_t *l, double s, double v, double v_a, double q, double time_value, double *dq)
{
    const double *p = l->p;
    double f = 0.0;
    *dq = 0.0;
    switch (l->kind) {
        /* clang-format off */ /* one law a line */
    case LINEAR: f = p[0] * s + p[1] * v; break;                            /* stiffness, damping */
    case RATE_CURVE: f = curve(l, v); break;
    case DEFLECTION_CURVE: f = curve(l, s); break;
    case BRISTLE: {                                                         /* stiffness, slip deflection, exponent, share */
        const double full = pow(fabs(q) / p[1], p[2]);                      /* share 1: loads along, unloads against the bend */
        *dq = v * (1.0 - full * (p[3] * ((v * q > 0.0) - (v * q < 0.0)) + 1.0 - p[3]));
        f = p[0] * q;
        break;
    }
    case LUGRE: *dq = v - fabs(v) * q * p[0] / curve(l, v); f = p[0] * q + p[1] * *dq; break; /* bristle stiffness, damping */
    case SLIDER: *dq = (fabs(q) >= p[1] && v * q > 0.0) ? 0.0 : v; f = p[0] * q; break;       /* stiffness, slip deflection */
    case SERIES: f = curve(l, s - q); *dq = f / p[0]; break;                /* a spring law in series with damping p0 */
    case HEATED: f = p[0] * v * curve(l, q); *dq = f * v - q / p[1]; break; /* damping when cold, time constant; q in J */
    case TRACK: f = p[0] * time_value; break;
    case SKYHOOK: f = v * (p[0] + p[1] * tanh(500.0 * v_a * v)); break;     /* mean damping, half of the swing */
    case TRACK_SPRING: f = p[0] * time_value * s + p[1] * time_value * v; break;
    case CONTACT: f = curve(l, s) * fmax(0.0, 1.0 + p[0] * v); break;       /* loss of the contact, s/m */
    /* clang-format on */
    default: break;
    }
    return f;
}

/* Rates of the state x at knot position k, and the force that the motion feels. x: positions, velocities, states of the laws. */
static void rates(const plant_t *m, double k, const double *x, double *dx, double *reaction)
{
    const int n = m->masses;
    const sample_t motion = track(m->motion, m->knots, k, m->knot_rate), aux = track(m->auxiliary, m->knots, k, m->knot_rate);
    double pull[MAX_MASSES] = { 0.0 };
    *reaction = 0.0;
    for (int i = 0; i < m->laws; i++) {
        const law_t *l = &m->law[i];
        const int end[2] = { l->a, l->b };
        double z[2] = { 0.0, 0.0 }, v[2] = { 0.0, 0.0 };
        for (int e = 0; e < 2; e++) {
            if (end[e] >= 0) {
                z[e] = x[end[e]];
                v[e] = x[n + end[e]];
            }
            if (end[e] == MOTION) {
                z[e] = motion.value;
                v[e] = motion.rate;
            }
            if (end[e] == AUXILIARY) {
                z[e] = aux.value;
                v[e] = aux.rate;
            }
        }
        const double now = l->p[3] > 0.0 ? motion.value : aux.value; /* TRACK: p3 = 1 takes the motion as a force */
        const double f = force(l, z[0] - z[1], v[0] - v[1], v[0], x[2 * n + i], now, &dx[2 * n + i]);
        if (end[0] >= 0) {
            pull[end[0]] -= f;
        }
        if (end[1] >= 0) {
            pull[end[1]] += f;
        }
        if (end[0] == MOTION) {
            *reaction += f;
        }
    }
    for (int i = 0; i < n; i++) {
        dx[i] = x[n + i];
        dx[n + i] = 0.0;
        for (int j = 0; j < n; j++) {
            dx[n + i] += m->inverse[i * n + j] * pull[j];
        }
    }
}

/* Integrates `outputs` intervals of `steps` steps from x and writes out[outputs][3 masses + 1]: positions, velocities,
 * accelerations, reaction. Knot 2 is time 0. Returns 0, or 1 if the sizes do not fit or the state is no longer finite. */
int simulate(const plant_t *m, double *x, double output_rate, size_t outputs, int steps, double *out)
{
    const int n = m->masses, states = 2 * n + m->laws;
    const double h = 1.0 / (output_rate * steps), part[4] = { 0.0, 0.5, 0.5, 1.0 }, weight[4] = { 1.0, 2.0, 2.0, 1.0 };
    double dx[4][MAX_STATES], at[MAX_STATES], reaction;
    if (n > MAX_MASSES || m->laws > MAX_LAWS) {
        return 1;
    }
    for (size_t k = 0; k < outputs; k++) {
        double *row = &out[k * (3 * (size_t)n + 1)];
        rates(m, 2.0 + (double)k / output_rate * m->knot_rate, x, dx[0], &row[3 * n]);
        for (int i = 0; i < n; i++) {
            row[i] = x[i];
            row[n + i] = x[n + i];
            row[2 * n + i] = dx[0][n + i];
        }
        for (int step = 0; step < steps; step++) {
            const double time = (double)k / output_rate + step * h;
            for (int r = 0; r < 4; r++) {
                for (int i = 0; i < states; i++) {
                    at[i] = x[i] + (r > 0 ? part[r] * h * dx[r - 1][i] : 0.0);
                }
                rates(m, 2.0 + (time + part[r] * h) * m->knot_rate, at, dx[r], &reaction);
            }
            for (int i = 0; i < states; i++) {
                for (int r = 0; r < 4; r++) {
                    x[i] += h / 6.0 * weight[r] * dx[r][i];
                }
            }
            for (int i = 0; i < m->laws; i++) {                             /* what a step of a slider went too far */
                const law_t *l = &m->law[i];
                if (l->kind == SLIDER) {
                    x[2 * n + i] = fmax(-l->p[1], fmin(l->p[1], x[2 * n + i]));
                }
            }
        }
        if (!isfinite(row[3 * n]) || (n > 0 && !isfinite(x[0]))) {
            return 1;
        }
    }
    return 0;
}
