/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* The functions of pen_elementary.h, for pen_math_accuracy.c compiled with -DPEN_ELEMENTARY. */
#include "penode/pen_elementary.h"

#define BOUND     1.5 /* what is asked of them, in ulp; pen_elementary.h promises less */
#define FUNCTIONS 5

static const char *const NAME[FUNCTIONS] = { "pen_sin", "pen_cos", "pen_atan", "pen_log", "pen_sqrt" };
static const int MONOTONE[FUNCTIONS] = { 0, 0, 1, 1, 1 };

static void evaluate(pen_real_t x, pen_real_t y[FUNCTIONS])
{
    y[0] = pen_sin(x);
    y[1] = pen_cos(x);
    y[2] = pen_atan(x);
    y[3] = pen_log(x);
    y[4] = pen_sqrt(x);
}

/* NaN where there must be one. */
static void reference(wide_t x, wide_t y[FUNCTIONS])
{
    const int inside = WIDE(fabs)(x) <= (wide_t)PEN_ANGLE_MAX;
    y[0] = inside ? WIDE(sin)(x) : (wide_t)NAN;
    y[1] = inside ? WIDE(cos)(x) : (wide_t)NAN;
    y[2] = isinf(x) ? (wide_t)NAN : WIDE(atan)(x);
    y[3] = WIDE(log)(x);
    y[4] = WIDE(sqrt)(x);
}
