/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * Error and monotonicity of pen_exp, pen_tanh, pen_sigmoid and pen_softplus, over all floats or over every n-th one; with
 * -DPEN_ELEMENTARY of the functions of pen_elementary.h.
 *
 *     pen_math_accuracy STRIDE [THREADS]     STRIDE 1: all 2^32 floats; exit code 1 beyond BOUND
 *
 * Inputs are taken in ascending order from -Inf to +Inf (-0 and +0 are two inputs); each result is compared with the
 * one before it, and the NaNs are checked apart. The error is |result - exact| divided by the distance of neighbouring
 * numbers of the type in the binade of the exact value (below the smallest normal number: the smallest subnormal one).
 * Infinity counts as the power of two that follows the largest number. So correct rounding gives at most 0.5.
 *
 * The exact value comes from the C library in a wider type: double for float (29 more bits, so an error of 1 ulp there
 * is 2e-9 here), with PEN_REAL_DOUBLE long double, which must have 64 bits (x86; 11 more bits, 5e-4). In double "every
 * STRIDE-th" means in steps of STRIDE * 2^32 in the order of all doubles, and each result is also compared with the
 * one of the next double.
 */
#include <float.h>
#include <math.h>
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "penode/pen_real.h"

#define MAX_THREADS 64U

#ifdef PEN_REAL_DOUBLE
typedef uint64_t bits_t;
typedef long double wide_t;
#define SIGNIFICAND  DBL_MANT_DIG
#define EXPONENT_MIN DBL_MIN_EXP
#define EXPONENT_MAX DBL_MAX_EXP
#define WIDE(name)   name##l
#define TOP          0x1p1024L /* follows the largest number */
#define STEP         (UINT64_C(1) << 32)
#define SIGN         (UINT64_C(1) << 63)
#define INFINITE     UINT64_C(0x7ff0000000000000)
#if LDBL_MANT_DIG < 64
#error "the double build needs a long double of at least 64 bits as its reference"
#endif
#else
typedef uint32_t bits_t;
typedef double wide_t;
#define SIGNIFICAND  FLT_MANT_DIG
#define EXPONENT_MIN FLT_MIN_EXP
#define EXPONENT_MAX FLT_MAX_EXP
#define WIDE(name)   name
#define TOP          0x1p128 /* follows the largest number */
#define STEP         UINT32_C(1)
#define SIGN         (UINT32_C(1) << 31)
#define INFINITE     UINT32_C(0x7f800000)
#endif

#ifdef PEN_ELEMENTARY
#include "elementary_subjects.h"
#else
#include "math_subjects.h"
#endif

typedef struct {
    double error; /* largest, ulp */
    pen_real_t where;
    uint64_t falls;  /* results below the one before */
    pen_real_t fall; /* the first of them            */
    uint64_t nan;    /* NaN where there must be none, or none where there must be one */
} finding_t;

typedef struct {
    bits_t first; /* order of the first input */
    bits_t last;
    uint64_t stride;
    uint64_t inputs;
    finding_t finding[FUNCTIONS];
} job_t;

static pen_real_t from_bits(bits_t bits)
{
    pen_real_t x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* The numbers in ascending order: 0 is -Inf, then all finite ones, LAST is +Inf. */
#define LAST ((bits_t)(2 * INFINITE + 1))

static pen_real_t in_order(bits_t order)
{
    const bits_t bits = (order > INFINITE) ? (order - INFINITE - 1) : (SIGN | (INFINITE - order));
    return from_bits(bits);
}

/* 1 / distance of the numbers of the type in the binade of x. A power of two, so multiplying by it is exact. */
static wide_t numbers_per_unit(wide_t x)
{
    int exponent; /* |x| in [2^(exponent - 1), 2^exponent) */
#ifdef PEN_REAL_DOUBLE
    (void)frexpl(x, &exponent);
#else
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits); /* frexp and ldexp would take half of the run time */
    exponent = (int)((bits >> 52) & 0x7ffU) - 1022;
#endif
    exponent = (exponent < EXPONENT_MIN) ? EXPONENT_MIN : ((exponent > EXPONENT_MAX) ? EXPONENT_MAX : exponent);
#ifdef PEN_REAL_DOUBLE
    return ldexpl(1, SIGNIFICAND - exponent);
#else
    bits = (uint64_t)(1023 + SIGNIFICAND - exponent) << 52;
    memcpy(&x, &bits, sizeof x);
    return x;
#endif
}

static double ulps(pen_real_t result, wide_t exact)
{
    wide_t value = (wide_t)result;
    wide_t target = exact;
    if (isinf(result)) { /* right if the exact value is past TOP, else as far away as TOP is */
        value = WIDE(copysign)(TOP, value);
        target = (WIDE(fabs)(exact) > TOP) ? WIDE(copysign)(TOP, exact) : exact;
    } else if (isinf(exact)) {
        target = WIDE(copysign)(TOP * TOP, exact);
    }
    return (double)(WIDE(fabs)(value - target) * numbers_per_unit(target));
}

static void compare(finding_t *finding, pen_real_t x, pen_real_t result, wide_t exact)
{
    const double error = ulps(result, exact);
    if (isnan(result) != isnan(exact)) {
        finding->nan++;
    }
    if (error > finding->error) {
        finding->error = error;
        finding->where = x;
    }
}

/* Is a result below the one before it, where it must not be? A NaN that must be there is below nothing. */
static int falls(int f, pen_real_t before, pen_real_t y)
{
    return MONOTONE[f] && (y < before);
}

static void *run(void *argument)
{
    job_t *const job = argument;
    pen_real_t before[FUNCTIONS];
    for (int f = 0; f < FUNCTIONS; f++) {
        before[f] = -INFINITY;
    }
    for (bits_t order = job->first;;) {
        const pen_real_t x = in_order(order);
        pen_real_t y[FUNCTIONS];
        wide_t exact[FUNCTIONS];
        evaluate(x, y);
        reference((wide_t)x, exact);
        job->inputs++;
        for (int f = 0; f < FUNCTIONS; f++) {
            finding_t *const finding = &job->finding[f];
            compare(finding, x, y[f], exact[f]);
            if (falls(f, before[f], y[f]) && (finding->falls++ == 0)) {
                finding->fall = x;
            }
            before[f] = y[f];
        }
#ifdef PEN_REAL_DOUBLE
        if (order < LAST) {
            evaluate(in_order(order + 1), before);
            for (int f = 0; f < FUNCTIONS; f++) {
                if (falls(f, y[f], before[f]) && (job->finding[f].falls++ == 0)) {
                    job->finding[f].fall = in_order(order + 1);
                }
            }
        }
#endif
        if ((job->last - order) < (job->stride * STEP)) {
            break;
        }
        order = (bits_t)(order + (job->stride * STEP));
    }
    return NULL;
}

/* Every NaN (or every stride-th), both signs, must give NaN. */
static uint64_t nan_failures(uint64_t stride)
{
    uint64_t failures = 0;
    for (bits_t bits = INFINITE + 1; bits < SIGN;) {
        for (int sign = 0; sign < 2; sign++) {
            pen_real_t y[FUNCTIONS];
            evaluate(from_bits((sign == 0) ? bits : (bits | SIGN)), y);
            for (int f = 0; f < FUNCTIONS; f++) {
                failures += isnan(y[f]) ? 0U : 1U;
            }
        }
        if ((SIGN - 1 - bits) < (stride * STEP)) {
            break;
        }
        bits = (bits_t)(bits + (stride * STEP));
    }
    return failures;
}

int main(int argc, char **argv)
{
    const uint64_t stride = (argc > 1) ? strtoull(argv[1], NULL, 10) : 0;
    const uint64_t threads = (argc > 2) ? strtoull(argv[2], NULL, 10) : 2;
    static job_t jobs[MAX_THREADS];
    pthread_t thread[MAX_THREADS];
    uint64_t inputs = 0;
    uint64_t failures;
    if ((stride < 1) || (stride > UINT32_MAX / 2) || (threads < 1) || (threads > MAX_THREADS)) {
        fprintf(stderr, "usage: pen_math_accuracy STRIDE [THREADS], 1 <= THREADS <= %u\n", MAX_THREADS);
        return 2;
    }
    for (uint64_t t = 0; t < threads; t++) { /* neighbours share their border, so no pair is left out */
        const bits_t width = (bits_t)(LAST / threads);
        jobs[t].first = (bits_t)(t * width);
        jobs[t].last = (t + 1 == threads) ? LAST : (bits_t)((t + 1) * width);
        jobs[t].stride = stride;
        if (pthread_create(&thread[t], NULL, run, &jobs[t]) != 0) {
            fprintf(stderr, "pen_math_accuracy: no thread to be had\n");
            return 2;
        }
    }
    failures = nan_failures(stride);
    for (uint64_t t = 0; t < threads; t++) {
        (void)pthread_join(thread[t], NULL);
        inputs += jobs[t].inputs;
    }
    printf("%llu inputs, NaN failures %llu\n", (unsigned long long)inputs, (unsigned long long)failures);
    for (int f = 0; f < FUNCTIONS; f++) {
        finding_t all = jobs[0].finding[f];
        for (uint64_t t = 1; t < threads; t++) {
            const finding_t *const other = &jobs[t].finding[f];
            all.where = (other->error > all.error) ? other->where : all.where;
            all.error = fmax(other->error, all.error);
            all.fall = (all.falls == 0) ? other->fall : all.fall;
            all.falls += other->falls;
            all.nan += other->nan;
        }
        printf("%-13s max error %.4f ulp at %.*g (%a), not monotone at %llu", NAME[f], all.error, 17, (double)all.where, (double)all.where,
               (unsigned long long)all.falls);
        if (all.falls > 0) {
            printf(" (first %a)", (double)all.fall);
        }
        printf("\n");
        failures += all.falls + all.nan + ((all.error <= BOUND) ? 0U : 1U);
    }
    return (failures == 0) ? 0 : 1;
}
