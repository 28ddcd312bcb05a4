/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* The functions of pen_math.h, for pen_math_accuracy.c. */
#include "penode/pen_math.h"

#define BOUND     2.0 /* what pen_math.h promises, in ulp */
#define FUNCTIONS 4

static const char *const NAME[FUNCTIONS] = { "pen_exp", "pen_tanh", "pen_sigmoid", "pen_softplus" };
static const int MONOTONE[FUNCTIONS] = { 1, 1, 1, 1 };

static void evaluate(pen_real_t x, pen_real_t y[FUNCTIONS])
{
    y[0] = pen_exp(x);
    y[1] = pen_tanh(x);
    y[2] = pen_sigmoid(x);
    y[3] = pen_softplus(x);
}

/* Written for speed: each of the shortcuts loses 2 ulp of the wide type at most. */
static void reference(wide_t x, wide_t y[FUNCTIONS])
{
    const wide_t e = WIDE(exp)(x);
    const wide_t inverse = 1 / e;
    y[0] = e;
    y[1] = (WIDE(fabs)(x) < 1) ? WIDE(tanh)(x) : (1 - (2 / (1 + (e * e))));
    y[2] = 1 / (1 + inverse);
    y[3] = (x > 0) ? (x + WIDE(log1p)(inverse)) : WIDE(log1p)(e);
}
