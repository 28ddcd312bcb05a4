/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors
 *
 * Right-hand sides of the rigs, and the classical Runge-Kutta method of order 4 on the times of a recording.
 * x: states, u: inputs, p: parameters in the order of the rig, d: rates of the states. */
#include <math.h>

#define STATES 8

typedef void plant_t(const double *x, const double *u, const double *p, double *d);

/* Dry friction of size 1, rounded below the rate vs. */
static double dry(double v, double vs)
{
    return v / sqrt(v * v + vs * vs);
}

static double dead_zone(double u, double w)
{
    return u > w ? u - w : u < -w ? u + w : 0.0;
}

static double limited(double u, double a)
{
    return u > a ? a : u < -a ? -a : u;
}

/* p: J mgl d Tc vs drag kc */
static void pendulum(const double *x, const double *u, const double *p, double *d)
{
    (void)u;
    d[0] = x[1];
    d[1] = (-p[1] * sin(x[0]) - p[2] * x[1] - p[3] * dry(x[1], p[4]) - p[5] * x[1] * fabs(x[1]) - p[6] * x[0]) / p[0];
}

/* p: J k b Kt Tc vs klow preload rounding cogging; x[0] from the limp-home position */
static void throttle(const double *x, const double *u, const double *p, double *d)
{
    double springs = p[1] * x[0] + (x[0] < 0.0 ? p[6] * x[0] : 0.0) + p[7] * dry(x[0], p[8]);
    d[0] = x[1];
    d[1] = (p[3] * u[0] - springs - p[2] * x[1] - p[4] * dry(x[1], p[5]) - p[9] * sin(20.0 * x[0])) / p[0];
}

/* p: m Km b w kc Fs vs */
static void cart(const double *x, const double *u, const double *p, double *d)
{
    d[0] = x[1];
    d[1] = (p[1] * dead_zone(u[0], p[3]) - p[2] * x[1] - p[4] * x[0] - p[5] * dry(x[1], p[6])) / p[0];
}

/* p: M m l b dr Fc dF vs closed kp kd kc; x: cart and angle of the rope, with their rates; u: set point of the position, or force */
static void crane(const double *x, const double *u, const double *p, double *d)
{
    double force = p[8] > 0.5 ? p[9] * (u[0] - x[0]) - p[10] * x[1] : u[0];
    double f = dry(x[1], p[7]), c = cos(x[2]), s = sin(x[2]);
    double a = force - p[3] * x[1] - p[5] * f - p[6] * fabs(f) - p[11] * x[0] + p[1] * p[2] * x[3] * x[3] * s;
    double b = -9.81 * s - p[4] * p[2] * x[3] / p[1];
    /* (M + m) x'' + m l c angle'' = a; c x'' + l angle'' = b */
    d[0] = x[1];
    d[1] = (a - p[1] * c * b) / (p[0] + p[1] - p[1] * c * c);
    d[2] = x[3];
    d[3] = (b - c * d[1]) / p[2];
}

/* p: J1 J2 k c b1 b2 gap Tc vs closed kp kd cogging; u: set point of the motor's angle, or torque */
static void axis(const double *x, const double *u, const double *p, double *d)
{
    double torque = p[9] > 0.5 ? p[10] * (u[0] - x[0]) - p[11] * x[1] : u[0];
    double twist = x[0] - x[2];
    double contact = p[6] > 0.0 ? 1.0 / (1.0 + exp(-(fabs(twist) - p[6]) / (0.02 * p[6] + 1e-9))) : 1.0;
    double belt = p[2] * dead_zone(twist, p[6]) + p[3] * contact * (x[1] - x[3]);
    d[0] = x[1];
    d[1] = (torque - belt - p[4] * x[1] - p[12] * sin(14.0 * x[0])) / p[0];
    d[2] = x[3];
    d[3] = (belt - p[5] * x[3] - p[7] * dry(x[3], p[8])) / p[1];
}

/* p: m k d k3 Fs vs */
static void oscillator(const double *x, const double *u, const double *p, double *d)
{
    d[0] = x[1];
    d[1] = (u[0] - p[1] * x[0] - p[2] * x[1] - p[3] * x[0] * x[0] * x[0] - p[4] * dry(x[1], p[5])) / p[0];
}

/* p: J kt ke R b umax Tc vs cogging */
static void motor(const double *x, const double *u, const double *p, double *d)
{
    double torque = p[1] * (limited(u[0], p[5]) - p[2] * x[1]) / p[3];
    d[0] = x[1];
    d[1] = (torque - p[4] * x[1] - p[6] * dry(x[1], p[7]) - p[8] * sin(7.0 * x[0])) / p[0];
}

/* p: mb mw c d ct das ks gap Fs vs; x: body and wheel, with their rates; u: road */
static void quarter(const double *x, const double *u, const double *p, double *d)
{
    double s = x[0] - x[2], v = x[1] - x[3];
    double f = p[2] * s + p[3] * v + p[5] * (v > 0.0 ? v : 0.0) + (s < -p[7] ? p[6] * (s + p[7]) : 0.0) + p[8] * dry(v, p[9]);
    d[0] = x[1];
    d[1] = -f / p[0];
    d[2] = x[3];
    d[3] = (f - p[4] * (x[2] - u[0])) / p[1];
}

/* p: A1 A2 c12 co root bend; x: levels; u: flow of the pump */
static void tanks(const double *x, const double *u, const double *p, double *d)
{
    double between = p[2] * (x[0] - x[1]) * (1.0 + p[5] * (x[0] - x[1]));
    double out = p[4] > 0.5 ? p[3] * sqrt(x[1] > 0.0 ? x[1] : 0.0) : p[3] * x[1];
    d[0] = (u[0] - between) / p[0];
    d[1] = (between - out) / p[1];
}

/* p: J k d rate Tc vs; x[2]: set point as far as the limit of its rate lets it follow; none where rate is 0 */
static void servo(const double *x, const double *u, const double *p, double *d)
{
    double set_point = p[3] > 0.0 ? x[2] : u[0];
    d[0] = x[1];
    d[1] = (p[1] * (set_point - x[0]) - p[2] * x[1] - p[4] * dry(x[1], p[5])) / p[0];
    d[2] = p[3] > 0.0 ? limited((u[0] - x[2]) / 2e-3, p[3]) : 0.0;
}

/* p: C1 C2 G12 G1 G2 bend; x: temperatures; u: heater, temperature of the air */
static void thermal(const double *x, const double *u, const double *p, double *d)
{
    double over = x[0] - u[1];
    d[0] = (u[0] - p[2] * (x[0] - x[1]) - p[3] * over - p[5] * over * over) / p[0];
    d[1] = (p[2] * (x[0] - x[1]) - p[4] * (x[1] - u[1])) / p[1];
}

static plant_t *const plants[] = { pendulum, throttle, cart, crane, axis, oscillator, motor, quarter, tanks, servo, thermal };

void rates(int plant, const double *x, const double *u, const double *p, double *d)
{
    plants[plant](x, u, p, d);
}

/* One step of h from x; u: inputs at its begin, middle and end. */
static void step(plant_t *f, int nx, int nu, double h, const double *u, const double *p, double *x)
{
    double y[STATES], a[STATES], b[STATES], c[STATES], e[STATES];
    f(x, u, p, a);
    for (int i = 0; i < nx; i++) y[i] = x[i] + h / 2 * a[i];
    f(y, u + nu, p, b);
    for (int i = 0; i < nx; i++) y[i] = x[i] + h / 2 * b[i];
    f(y, u + nu, p, c);
    for (int i = 0; i < nx; i++) y[i] = x[i] + h * c[i];
    f(y, u + 2 * nu, p, e);
    for (int i = 0; i < nx; i++) x[i] += h / 6 * (a[i] + 2 * b[i] + 2 * c[i] + e[i]);
}

/* States and their rates at the n times t; `steps` steps in each interval; u: inputs at half steps, 2 * steps + 1 in each interval. */
void simulate(int plant, int n, int steps, int nx, int nu, const double *t, const double *u, const double *p, const double *start,
              double *states, double *rate)
{
    plant_t *f = plants[plant];
    double x[STATES];
    for (int i = 0; i < nx; i++) x[i] = states[i] = start[i];
    for (int k = 0; k + 1 < n; k++) {
        const double *now = u + (long)k * (2 * steps + 1) * nu;
        double h = (t[k + 1] - t[k]) / steps;
        f(x, now, p, rate + (long)k * nx);
        for (int j = 0; j < steps; j++, now += 2 * nu) step(f, nx, nu, h, now, p, x);
        for (int i = 0; i < nx; i++) states[(long)(k + 1) * nx + i] = x[i];
        if (k + 2 == n) f(x, now, p, rate + (long)(k + 1) * nx);
    }
}
