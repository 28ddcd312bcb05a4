/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors
 *
 * A quarter vehicle that is measured: the truth that training is tried on. Shares nothing with what trains. Runge-Kutta of order 4 in
 * steps of twice the interval of the road; the road's value and rate at the middle of a step are samples of their own.
 */
#include <math.h>

typedef struct {
    double m_b, m_w, c, d, c_t, d_t;
    int spring, damper; /* kinds, below */
    double spring_by[4], damper_by[4];
} plant_t;

static double spring(const plant_t *p, double s)
{
    const double *const a = p->spring_by;

    switch (p->spring) {
    case 1: return pow(a[0] * (s + a[1]), 2.0) - pow(a[0] * a[1], 2.0); /* parabola */
    case 2: return (a[0] * s * s * s) + (a[1] * fmax(s - a[2], 0.0)) + (a[1] * fmin(s + a[3], 0.0)); /* hardening, with stops */
    default: return 0.0;
    }
}

static double damper(const plant_t *p, double s, double v)
{
    const double *const a = p->damper_by;

    switch (p->damper) {
    case 1: { /* Stribeck, Coulomb and viscous friction: breakaway, Coulomb, rate of breakaway, viscous */
        const double stribeck = sqrt(2.0) * a[2];
        return (sqrt(2.0 * exp(1.0)) * (a[0] - a[1]) * exp(-(v / stribeck) * (v / stribeck)) * v / stribeck) +
               (a[1] * tanh(10.0 * v / a[2])) + (a[3] * v);
    }
    case 2: return (v > 0.0) ? (a[0] * v / (1.0 + (v / a[1]))) : (a[2] * v / (1.0 - (v / a[3]))); /* degressive, two-sided */
    case 3: return (a[0] * s) + (a[1] * s * s) + (a[2] * (1.0 + (25.0 * s)) * tanh(v / a[3])); /* friction that grows with deflection */
    default: return 0.0;
    }
}

static void rates(const plant_t *p, const double x[4], double road, double rate, double dx[4])
{
    const double s = x[1] - x[0], v = x[3] - x[2];
    const double force = (p->c * s) + (p->d * v) + spring(p, s) + damper(p, s, v);
    const double tyre = (p->c_t * (x[1] - road)) + (p->d_t * (x[3] - rate));

    dx[0] = x[2];
    dx[1] = x[3];
    dx[2] = force / p->m_b;
    dx[3] = (-force - tyre) / p->m_w;
}

/* y [samples][4]: accelerations of body and wheel, deflection, its rate, every `every` steps of step [s] */
void measure(const plant_t *p, const double *road, const double *rate, int samples, int every, double step, double *y)
{
    double x[4] = { road[0], road[0], 0.0, 0.0 }, k[4][4], t[4];

    for (int n = 0; n < samples * every; n++) {
        const double *const r = &road[2 * n], *const q = &rate[2 * n];
        rates(p, x, r[0], q[0], k[0]);
        if ((n % every) == 0) {
            double *const row = &y[(n / every) * 4];
            row[0] = k[0][2];
            row[1] = k[0][3];
            row[2] = x[1] - x[0];
            row[3] = x[3] - x[2];
        }
        for (int s = 1; s < 4; s++) {
            const double h = (s == 3) ? step : (0.5 * step);
            for (int i = 0; i < 4; i++) {
                t[i] = x[i] + (h * k[s - 1][i]);
            }
            rates(p, t, r[(s == 3) ? 2 : 1], q[(s == 3) ? 2 : 1], k[s]);
        }
        for (int i = 0; i < 4; i++) {
            x[i] += step / 6.0 * (k[0][i] + (2.0 * k[1][i]) + (2.0 * k[2][i]) + k[3][i]);
        }
    }
}

double force_of(const plant_t *p, int which, double s, double v)
{
    return (which == 0) ? spring(p, s) : (which == 1) ? damper(p, s, v) : (spring(p, s) + damper(p, s, v));
}
