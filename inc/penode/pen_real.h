/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * The number type of the library, its version, and the numerical contract.
 *
 * Everything is computed in `pen_real_t`: float, or double if PEN_REAL_DOUBLE is defined for the library and for
 * everything that includes it. Results are bit-identical on every target that keeps IEEE 754 arithmetic in that type. A
 * compiler option that breaks this is refused here if a macro reveals it; contraction to FMA, which none reveals, is
 * prevented (penode/pen_exact.h). So no option is needed. The application sets rounding to nearest, no flush to zero.
 */
#ifndef PEN_REAL_H
#define PEN_REAL_H

#include <float.h>

#define PEN_VERSION       "0.1.0"
#define PEN_VERSION_MAJOR 0 /* the same for #if */
#define PEN_VERSION_MINOR 1
#define PEN_VERSION_PATCH 0
#define PEN_ABI           2 /* generated code names the ABI it was written for and stops the compiler on another one */

#ifdef __FAST_MATH__
#error "penode: -ffast-math removes the NaN and Inf checks that this library promises; compile without it"
#endif
#ifdef __FINITE_MATH_ONLY__ /* GCC and clang always define it */
#if __FINITE_MATH_ONLY__ > 0
#error "penode: -ffinite-math-only removes the NaN and Inf checks that this library promises; compile without it"
#endif
#endif
#ifdef __ASSOCIATIVE_MATH__
#error "penode: -fassociative-math reorders sums, which breaks bit-identity; compile without it"
#endif
#ifdef __RECIPROCAL_MATH__
#error "penode: -freciprocal-math divides by multiplying, which breaks bit-identity; compile without it"
#endif
#ifdef __NO_SIGNED_ZEROS__
#error "penode: -fno-signed-zeros changes the sign of results, which breaks bit-identity; compile without it"
#endif
#if defined(FLT_EVAL_METHOD) && (FLT_EVAL_METHOD != 0) && (FLT_EVAL_METHOD != 16) /* 16: half floats in hardware */
#error "penode: intermediate results wider than their type break bit-identity; x86: -mfpmath=sse, s390x: -fexcess-precision=fast"
#endif
#if defined(__ARM_FEATURE_MVE) && ((__ARM_FEATURE_MVE & 2) != 0)
#error "penode: float vectors (MVE) flush subnormal numbers, which breaks bit-identity; compile with -mcpu=cortex-m55+nomve.fp"
#endif

#ifdef PEN_REAL_DOUBLE
typedef double pen_real_t;
#define PEN_REAL_MAX     DBL_MAX
#define PEN_REAL_MIN     DBL_MIN
#define PEN_REAL_EPSILON DBL_EPSILON
#else
typedef float pen_real_t;
#define PEN_REAL_MAX     FLT_MAX
#define PEN_REAL_MIN     FLT_MIN
#define PEN_REAL_EPSILON FLT_EPSILON
#endif

#endif
