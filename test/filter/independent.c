/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * plant.py in C, for hours of samples: the quarter vehicle on an unknown road, and its Kalman filter with whole matrices in
 * double. Nothing of penode is in it. States: z_b, z_w, v_b, v_w, road. Compiled and called by independent.py.
 */

#include <math.h>
#include <stddef.h>

#define N     5 /* states of the filter, of which the last is the road */
#define X     4 /* states of the vehicle */
#define Z     2 /* accelerations of body and wheel */
#define WIDTH 64
#define H     1e-3

static const double NOMINAL = 350.0, M_W = 90.0, C = 10000.0, D = 800.0, C_T = 300000.0;

/* Networks of one input, as numbers: shift and factor of the input, layers, of each n_in, n_out, 1 for ReLU, weights, biases;
 * then factor and shift of the output. */
typedef struct {
    const double *spring;
    const double *damper;
} nets_t;

typedef struct {
    nets_t nets;
    double decay;
    double q[N];
    double r[Z];
    double x[N];
    double p[N][N];
    double running; /* 0 before the first sample */
} filter_t;

static double m_b = 350.0; /* NOMINAL but while a vehicle of another mass drives */
static double slopes[16]; /* of all networks evaluated since `seen` was 0 */
static int seen;
static double rounding;       /* of the arithmetic that is compared with this one, relative */
static unsigned char touched; /* 1: a neuron came so near to its kink since it was 0 */

static double network(const double *at, double input, double *slope)
{
    double value[WIDTH];
    double tangent[WIDTH];
    const int layers = (int)at[2];

    value[0] = (input - at[0]) * at[1];
    tangent[0] = at[1];
    at += 3;
    for (int l = 0; l < layers; l++) {
        const int n_in = (int)at[0];
        const int n_out = (int)at[1];
        const double *const w = &at[3];
        const double *const b = &w[n_in * n_out];
        double new_value[WIDTH];
        double new_tangent[WIDTH];
        for (int i = 0; i < n_out; i++) {
            double v = 0.0;
            double t = 0.0;
            double size = fabs(b[i]);
            for (int k = 0; k < n_in; k++) {
                v += value[k] * w[(i * n_in) + k];
                size += fabs(value[k] * w[(i * n_in) + k]);
                t += tangent[k] * w[(i * n_in) + k];
            }
            v += b[i];
            const int off = (at[2] > 0.0) && !(v > 0.0);
            touched |= ((at[2] > 0.0) && (fabs(v) < (rounding * size))) ? 1 : 0;
            new_value[i] = off ? 0.0 : v;
            new_tangent[i] = off ? 0.0 : t;
        }
        for (int i = 0; i < n_out; i++) {
            value[i] = new_value[i];
            tangent[i] = new_tangent[i];
        }
        at = &b[n_out];
    }
    *slope = tangent[0] * at[0];
    slopes[seen % 16] = *slope;
    seen++;
    return (value[0] * at[0]) + at[1];
}

static void rates(const nets_t *nets, const double x[X], double u, double dx[X], double fx[X][X], double fu[X])
{
    double k;
    double d;
    const double s = x[0] - x[1];
    const double v = x[2] - x[3];
    const double force = (C * s) + (D * v) + network(nets->spring, s, &k) + network(nets->damper, v, &d);
    const double row[X] = { k + C, -(k + C), d + D, -(d + D) };

    dx[0] = x[2];
    dx[1] = x[3];
    dx[2] = -force / m_b;
    dx[3] = (force - (C_T * (x[1] - u))) / M_W;
    for (int j = 0; j < X; j++) {
        fx[0][j] = (j == 2) ? 1.0 : 0.0;
        fx[1][j] = (j == 3) ? 1.0 : 0.0;
        fx[2][j] = -row[j] / m_b;
        fx[3][j] = row[j] / M_W;
        fu[j] = (j == 3) ? (C_T / M_W) : 0.0;
    }
    fx[3][1] -= C_T / M_W;
}

/* Runge-Kutta of order 4 on a straight line from `before` to `now`; its derivatives: along x, before, now in columns. */
static void step(const nets_t *nets, double x[X], double before, double now, double d[X][X + 2])
{
    static const double share[4] = { 0.0, 0.5, 0.5, 1.0 };
    static const double weight[4] = { 1.0, 2.0, 2.0, 1.0 };
    double k[X] = { 0.0 };
    double dk[X][X + 2] = { { 0.0 } };
    double sum[X] = { 0.0 };
    double d_sum[X][X + 2] = { { 0.0 } };

    for (int s = 0; s < 4; s++) {
        double at[X];
        double d_at[X][X + 2];
        double fx[X][X];
        double fu[X];
        for (int i = 0; i < X; i++) {
            at[i] = x[i] + (H * share[s] * k[i]);
            for (int c = 0; c < (X + 2); c++) {
                d_at[i][c] = ((i == c) ? 1.0 : 0.0) + (H * share[s] * dk[i][c]);
            }
        }
        rates(nets, at, before + (share[s] * (now - before)), k, fx, fu);
        for (int i = 0; i < X; i++) {
            sum[i] += weight[s] * k[i];
            for (int c = 0; c < (X + 2); c++) {
                dk[i][c] = fu[i] * ((c == X) ? (1.0 - share[s]) : ((c == (X + 1)) ? share[s] : 0.0));
                for (int j = 0; j < X; j++) {
                    dk[i][c] += fx[i][j] * d_at[j][c];
                }
                d_sum[i][c] += weight[s] * dk[i][c];
            }
        }
    }
    for (int i = 0; i < X; i++) {
        x[i] += (H / 6.0) * sum[i];
        for (int c = 0; c < (X + 2); c++) {
            d[i][c] = ((i == c) ? 1.0 : 0.0) + ((H / 6.0) * d_sum[i][c]);
        }
    }
}

/* Samples of the vehicle from x on: `drawn` [n][N] is added to states and road, `noise` [n][Z] to what is measured; body mass [n].
 * The first one of all, if not `begun`, is at x. */
void reference_drive(const nets_t *nets, double decay, int begun, size_t n, double x[N], const double drawn[][N], const double noise[][Z],
                     const double mass[], double truth[][N], double z[][Z])
{
    for (size_t k = 0; k < n; k++) {
        double d[X][X + 2];
        double dx[X];
        double fx[X][X];
        double fu[X];
        const double now = (decay * x[X]) + drawn[k][X];
        m_b = mass[k];
        if ((begun != 0) || (k > 0U)) {
            step(nets, x, x[X], now, d);
            x[X] = now;
            for (int i = 0; i < X; i++) {
                x[i] += drawn[k][i];
            }
        }
        for (int i = 0; i < N; i++) {
            truth[k][i] = x[i];
        }
        rates(nets, x, x[X], dx, fx, fu);
        for (int i = 0; i < Z; i++) {
            z[k][i] = dx[2 + i] + noise[k][i];
        }
    }
    m_b = NOMINAL;
}

static void predict(filter_t *self)
{
    double d[X][X + 2];
    double phi[N][N] = { { 0.0 } };
    double g[N] = { 0.0 }; /* derivatives of the states by the noise of the road */
    double part[N][N];
    const double before = self->x[X];
    const double now = self->decay * before;

    step(&self->nets, self->x, before, now, d);
    self->x[X] = now;
    for (int i = 0; i < X; i++) {
        for (int j = 0; j < X; j++) {
            phi[i][j] = d[i][j];
        }
        phi[i][X] = d[i][X] + (self->decay * d[i][X + 1]);
        g[i] = d[i][X + 1];
    }
    phi[X][X] = self->decay;
    g[X] = 1.0;
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            part[i][j] = 0.0;
            for (int k = 0; k < N; k++) {
                part[i][j] += phi[i][k] * self->p[k][j];
            }
        }
    }
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            self->p[i][j] = (g[i] * self->q[X] * g[j]) + (((i == j) && (i < X)) ? self->q[i] : 0.0);
            for (int k = 0; k < N; k++) {
                self->p[i][j] += part[i][k] * phi[j][k];
            }
        }
    }
}

static void slopes_of(const nets_t *nets, double decay, const double from[N], double found[10])
{
    double x[X];
    double d[X][X + 2];
    double dx[X];
    double fx[X][X];
    double fu[X];

    for (int i = 0; i < X; i++) {
        x[i] = from[i];
    }
    seen = 0;
    step(nets, x, from[X], decay * from[X], d);
    rates(nets, x, decay * from[X], dx, fx, fu);
    for (int i = 0; i < 10; i++) {
        found[i] = slopes[i];
    }
}

/* Does a kink of a network lie between the steps from two states, or as near as rounding? By n states each. */
void reference_kinks(const nets_t *nets, double decay, double within, size_t n, const double a[][N], const double b[][N],
                     unsigned char between[])
{
    rounding = within;
    for (size_t k = 0; k < n; k++) {
        double left[10];
        double right[10];
        touched = 0;
        slopes_of(nets, decay, a[k], left);
        slopes_of(nets, decay, b[k], right);
        between[k] = touched;
        for (int i = 0; i < 10; i++) {
            between[k] |= (fabs(left[i] - right[i]) > (1e-6 * (fabs(left[i]) + fabs(right[i])))) ? 1 : 0;
        }
    }
    rounding = 0.0;
}

/* Joseph's form: P = (1 - k h') P (1 - k h')' + r k k'. */
static void use(filter_t *self, const double h[N], double miss, double r, double dx[N])
{
    double gain[N];
    double keep[N][N];
    double part[N][N];
    double s = r;
    double nu = miss;

    for (int i = 0; i < N; i++) {
        gain[i] = 0.0;
        for (int j = 0; j < N; j++) {
            gain[i] += self->p[i][j] * h[j];
        }
        s += h[i] * gain[i];
        nu -= h[i] * dx[i];
    }
    for (int i = 0; i < N; i++) {
        gain[i] /= s;
        for (int j = 0; j < N; j++) {
            keep[i][j] = ((i == j) ? 1.0 : 0.0) - (gain[i] * h[j]);
        }
    }
    for (int i = 0; i < N; i++) {
        dx[i] += gain[i] * nu;
        for (int j = 0; j < N; j++) {
            part[i][j] = 0.0;
            for (int k = 0; k < N; k++) {
                part[i][j] += keep[i][k] * self->p[k][j];
            }
        }
    }
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            self->p[i][j] = r * gain[i] * gain[j];
            for (int k = 0; k < N; k++) {
                self->p[i][j] += part[i][k] * keep[j][k];
            }
        }
    }
}

/* The filter through n samples; NaN: missing. State and covariance after each. */
void reference_run(filter_t *self, size_t n, const double z[][Z], double x[][N], double p[][N][N])
{
    for (size_t k = 0; k < n; k++) {
        double seen[X];
        double fx[X][X];
        double fu[X];
        double dx[N] = { 0.0 };
        if (self->running > 0.0) {
            predict(self);
        }
        self->running = 1.0;
        rates(&self->nets, self->x, self->x[X], seen, fx, fu);
        for (int i = 0; i < Z; i++) {
            const double h[N] = { fx[2 + i][0], fx[2 + i][1], fx[2 + i][2], fx[2 + i][3], fu[2 + i] };
            if (isfinite(z[k][i])) {
                use(self, h, z[k][i] - seen[2 + i], self->r[i], dx);
            }
        }
        for (int i = 0; i < N; i++) {
            self->x[i] += dx[i];
            x[k][i] = self->x[i];
            for (int j = 0; j < N; j++) {
                p[k][i][j] = self->p[i][j];
            }
        }
    }
}
