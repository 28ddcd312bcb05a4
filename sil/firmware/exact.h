/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* The reference simulation's view of a model, for the host: equations that penode prints in float64 (penode_gen/twins/exact_c.py), and
 * what they call. Nothing of the runtime. */

#ifndef EXACT_H
#define EXACT_H

#include <math.h>
#include <stddef.h>

/** Numbers of one parameter set, in the order of the printed equations. */
typedef struct {
    const double *parameters;
    const double *const *networks; /**< see exact_network */
} exact_set_t;

/* x [n_x], u [n_u] with the signals of actuators behind the inputs, v = du/dt [n_u]; out [n_x], [n_y], [n_z]. */
void exact_rates(const exact_set_t *set, const double x[], const double u[], const double v[], double out[]);
void exact_outputs(const exact_set_t *set, const double x[], const double u[], const double v[], double out[]);
void exact_sensors(const exact_set_t *set, const double x[], const double u[], const double v[], double out[]);

/** First output of a network whose layers stand in `w` (weights_of in exact_c.py) at the inputs `in`. */
double exact_network(const double w[], const double in[]);

/** log(1 + e^x). */
static inline double exact_softplus(double x)
{
    return fmax(x, 0.0) + log1p(exp(-fabs(x)));
}

/** 1 / (1 + e^-x). */
static inline double exact_sigmoid(double x)
{
    return (x < 0.0) ? (exp(x) / (1.0 + exp(x))) : (1.0 / (1.0 + exp(-x)));
}

/** -1, 0 or 1; NaN of NaN. */
static inline double exact_sign(double x)
{
    return (x > 0.0) ? 1.0 : ((x < 0.0) ? -1.0 : x);
}

/** The larger one; NaN if one is. */
static inline double exact_larger(double a, double b)
{
    return ((a > b) || isnan(a)) ? a : b;
}

/** The smaller one; NaN if one is. */
static inline double exact_smaller(double a, double b)
{
    return ((a < b) || isnan(a)) ? a : b;
}

#endif
