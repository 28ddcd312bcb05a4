/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * More elementary functions with the same bits on every target, for models that use them. No libm, no FMA; in the float
 * build no double.
 *
 * Each stands in a source of its own (pen_trig.c, pen_atan.c, pen_log.c, pen_root.c), so that a program without it is not
 * larger. Largest error in ulp, as in penode/pen_math.h: in float over all 2^32 arguments, in double over some 10^7
 * (test/accuracy/ measures both):
 *
 *                    float   double
 *   pen_sin           0.97     0.79
 *   pen_cos           0.98     0.81
 *   pen_atan          1.16     0.97
 *   pen_log           0.84     0.77
 *   pen_sqrt          0.50     0.50   correctly rounded
 *
 * pen_atan, pen_log and pen_sqrt are monotone. No branch depends on the argument.
 *
 * Sine and cosine take angles up to PEN_ANGLE_MAX either way, in float as in double: that is 1303 turns, where two
 * neighbouring floats are 1 mrad apart. Beyond it they give NaN, so that the step reports it (PEN_STEP_NONFINITE) and holds:
 * an angle that grows without end belongs wrapped, or counted in turns, before it loses its digits.
 *
 * NaN gives NaN. Infinity gives NaN in pen_sin, pen_cos and pen_atan, which would hide it, and itself in the others.
 */
#ifndef PEN_ELEMENTARY_H
#define PEN_ELEMENTARY_H

#include "penode/pen_real.h"

#ifdef __cplusplus
extern "C" {
#endif

#define PEN_ANGLE_MAX ((pen_real_t)8192) /* rad */

pen_real_t pen_sin(pen_real_t x);  /* odd; NaN beyond +-PEN_ANGLE_MAX                                */
pen_real_t pen_cos(pen_real_t x);  /* even; NaN beyond +-PEN_ANGLE_MAX                               */
pen_real_t pen_atan(pen_real_t x); /* odd; rad                                                       */
pen_real_t pen_log(pen_real_t x);  /* natural; -Inf at 0, NaN below                                  */
pen_real_t pen_sqrt(pen_real_t x); /* NaN below 0; -0 stays -0                                       */

#ifdef __cplusplus
}
#endif

#endif
