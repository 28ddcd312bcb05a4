/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * Known-answer self-test, for power-on: does this build, on this core, keep the numerical contract of penode/pen_real.h?
 *
 * What the preprocessor can see is refused by #error. The rest is reported here: start-up code that sets flush to zero
 * or another rounding mode, a library built for another real type, a compiler that contracts a * b + c, and anything
 * else that changes a bit of the kernels. The known answers come from an evaluation in Python in the order of the C,
 * never from a run of the C; they are the same on every core and in both byte orders.
 *
 * pen_selftest() covers the runtime. Contraction is a matter of each file: NAME_selftest() of a generated model
 * (NAME_selftest.c) covers the code of the model too, and calls pen_selftest() itself.
 *
 * The double build: a software double that does not round as IEEE 754 says is reported like any other breach. That of
 * GCC's libgcc for Arm (cores without an FPU for doubles) gives PEN_SELFTEST_ROUNDING: see penode/pen_math.h.
 *
 * Thread context: any, no state is kept. Floating-point modes belong to a context: run it in the one that steps.
 * Cost on a Cortex-M4F, -O2 / -Os:
 *   pen_selftest     7291 / 7132 instructions, 1176 / 976 bytes of code and constants, 0.5 KB of stack, no RAM
 *   NAME_selftest    400 / 400 bytes for gen/nqvm; instructions: those of an init and 200 steps, and of the hash
 */
#ifndef PEN_SELFTEST_H
#define PEN_SELFTEST_H

#include <float.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "penode/pen_real.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What is broken; 0: nothing. */
#define PEN_SELFTEST_FLUSH      UINT32_C(0x01) /* subnormal results or operands become 0                             */
#define PEN_SELFTEST_ROUNDING   UINT32_C(0x02) /* not rounded to nearest, ties to even                               */
#define PEN_SELFTEST_REAL       UINT32_C(0x04) /* pen_real_t of the caller is not that of the library                */
#define PEN_SELFTEST_CONTRACTED UINT32_C(0x08) /* a * b + c is rounded once: compile with -ffp-contract=off          */
#define PEN_SELFTEST_ANSWER     UINT32_C(0x10) /* a known answer is missed; alone: a compiler bug, or damaged code     */
#define PEN_SELFTEST_SET        UINT32_C(0x20) /* of a model: its set `default` is refused (pen_selftest() never)    */
#define PEN_SELFTEST_BADARG     UINT32_C(0x40) /* of a model: the instance is NULL (pen_selftest() never)            */

/* The real type in one number: digits, range and size. */
#ifdef PEN_REAL_DOUBLE
#define PEN_SELFTEST_TYPE ((((uint32_t)DBL_MANT_DIG << 16U) | ((uint32_t)DBL_MAX_EXP << 4U)) | (uint32_t)sizeof(pen_real_t))
#else
#define PEN_SELFTEST_TYPE ((((uint32_t)FLT_MANT_DIG << 16U) | ((uint32_t)FLT_MAX_EXP << 4U)) | (uint32_t)sizeof(pen_real_t))
#endif

/** The test for a caller whose real type is `type`. @return flags above */
uint32_t pen_selftest_of(uint32_t type);

/** The test. @return 0, or PEN_SELFTEST_FLUSH, _ROUNDING, _REAL, _CONTRACTED, _ANSWER, any of them together */
static inline uint32_t pen_selftest(void)
{
    return pen_selftest_of(PEN_SELFTEST_TYPE);
}

/** Is one of these, 0 with two roundings, +eps^2 or -eps^2? @return 0 or PEN_SELFTEST_CONTRACTED */
static inline uint32_t pen_selftest_fused(pen_real_t sum, pen_real_t difference)
{
    const pen_real_t square = PEN_REAL_EPSILON * PEN_REAL_EPSILON;
    const bool fused = (sum >= square) && (sum <= square);
    const bool fused_minus = (difference <= -square) && (difference >= -square);

    return (fused || fused_minus) ? PEN_SELFTEST_CONTRACTED : 0U;
}

/** Does the file that includes this contract a * b + c, or c - a * b? @return 0 or PEN_SELFTEST_CONTRACTED */
static inline uint32_t pen_selftest_contracted(void)
{
    const volatile pen_real_t given[2] = { (pen_real_t)1 + PEN_REAL_EPSILON, (pen_real_t)-1 - ((pen_real_t)2 * PEN_REAL_EPSILON) };
    const pen_real_t a = given[0];
    const pen_real_t c = given[1];

    return pen_selftest_fused((a * a) + c, -c - (a * a));
}

/* ---- for the self-tests of the models ---- */

#define PEN_SELFTEST_SEED 0x811c9dc5U /* of the hash */

/** FNV-1a over the bits of n values, low byte first on every core. @return the hash, to go on from */
uint32_t pen_selftest_hash(uint32_t hash, size_t n, const pen_real_t value[]);

/** The next of 2^32 numbers in a fixed order; the high bits are the random ones. */
static inline uint32_t pen_selftest_next(uint32_t number)
{
    return (number * 1664525U) + 1013904223U;
}

#ifdef __cplusplus
}
#endif

#endif
