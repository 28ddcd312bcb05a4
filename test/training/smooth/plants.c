/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors
 *
 * Plants with smooth forces, none of which is a chain of straight pieces: the truth that training is tried on. Shares nothing with what
 * trains. Runge-Kutta of order 4 on a road that is known at the middle of each step too; explicit Euler in small steps for the tank.
 */
#include <math.h>

typedef struct {
    double m_b, m_w, c_t, d_t;
    double spring[6];  /* N/m, N/m^3, N/m beyond [3] m, m, N, by [5] m */
    double damper[5];  /* N s/m, N, by [2] m/s, N s/m beyond [4] m/s */
    double coupled[2]; /* N/m, by [1] m/s */
} car_t;

/* what softplus adds to a slope beyond a place, 0 at 0 */
static double beyond(double x, double place, double wide)
{
    return wide * (log1p(exp((x - place) / wide)) - log1p(exp(-place / wide)));
}

double spring(const car_t *c, double s)
{
    const double *const a = c->spring;
    return (a[0] * s) + (a[1] * s * s * s) + (a[2] * beyond(s, a[3], 0.006)) + (a[4] * tanh(s / a[5]));
}

double damper(const car_t *c, double v)
{
    const double *const a = c->damper;
    return (a[0] * v) + (a[1] * tanh(v / a[2])) + (a[3] * beyond(v, a[4], 0.1));
}

double both(const car_t *c, double s, double v)
{
    return spring(c, s) + damper(c, v) + (c->coupled[0] * s * tanh(v / c->coupled[1]));
}

static void rates(const car_t *c, const double x[4], double road, double rate, double dx[4])
{
    const double force = both(c, x[1] - x[0], x[3] - x[2]);
    dx[0] = x[2];
    dx[1] = x[3];
    dx[2] = force / c->m_b;
    dx[3] = (-force - (c->c_t * (x[1] - road)) - (c->d_t * (x[3] - rate))) / c->m_w;
}

/* y [rows][4]: accelerations of body and wheel, deflection, its rate, every `every` steps; road and its rate at steps and middles */
void drive(const car_t *c, const double *road, const double *rate, int rows, int every, double step, double *y)
{
    double x[4] = { road[0], road[0], 0.0, 0.0 };

    for (int n = 0; n < rows * every; n++) {
        double k[4][4], t[4];
        for (int s = 0; s < 4; s++) {
            const double h = (s == 0) ? 0.0 : ((s == 3) ? step : (0.5 * step));
            const int at = (2 * n) + ((s + 1) / 2);
            for (int i = 0; i < 4; i++) {
                t[i] = x[i] + ((s == 0) ? 0.0 : (h * k[s - 1][i]));
            }
            rates(c, t, road[at], rate[at], k[s]);
        }
        if ((n % every) == 0) {
            double *const row = &y[(n / every) * 4];
            row[0] = k[0][2];
            row[1] = k[0][3];
            row[2] = x[1] - x[0];
            row[3] = x[3] - x[2];
        }
        for (int i = 0; i < 4; i++) {
            x[i] += step / 6.0 * (k[0][i] + (2.0 * k[1][i]) + (2.0 * k[2][i]) + k[3][i]);
        }
    }
}

/* heat that a tank loses at d kelvin above the room */
double lost(const double a[4], double d)
{
    return (a[0] * d) + (a[1] * d * fabs(d)) + (a[2] * beyond(d, a[3], 4.0));
}

/* temperatures above the room [rows] of a tank of `capacity` that is heated by power [rows], rows of `step` s, straight between them */
void heat(const double a[4], double capacity, const double *power, int rows, double step, double *d)
{
    const int parts = 60;
    double x = 0.0;
    for (int n = 0; n < rows; n++) {
        d[n] = x;
        for (int j = 0; (n + 1 < rows) && (j < parts); j++) {
            x += step / parts * (power[n] + ((power[n + 1] - power[n]) * (j + 0.5) / parts) - lost(a, x)) / capacity;
        }
    }
}
