/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * A master in C for an FMU of FMI_VERSION 2 or 3, linked with its sources: fast enough for 10^9 steps.
 *
 *   master count TOKEN OUTPUT KIND START STEP SAMPLES N   N steps of STEP s from START; the FMU's output counts its samples, SAMPLES a step.
 *       KIND: add (t += STEP), grid (START + k STEP), differences (grid, and steps that are differences of it). Prints the number of
 *       steps that were refused, and of those after which the output or the FMU's time was wrong; the first few of each on stderr.
 *   master cost TOKEN INPUT BLOCKS                        Prints the time of a step of the FMU by that of plain C: the median of BLOCKS
 *       pairs of blocks, each pair taken in turn, so that whatever else runs on the machine slows both.
 */
#define _POSIX_C_SOURCE 200809L

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#if FMI_VERSION == 3
#include "fmi3_api.h"
typedef fmi3Instance instance_t;
typedef fmi3ValueReference reference_t;
#else
#include "fmi2_api.h"
typedef fmi2Component instance_t;
typedef fmi2ValueReference reference_t;
#endif
#include "plain.h"

#define CHECK 65536UL /* outputs are compared every so many steps, and at the end */
#define TOLD  3UL

static instance_t started(const char *token, double start)
{
#if FMI_VERSION == 3
    const instance_t one = fmi3InstantiateCoSimulation("one", token, NULL, false, false, false, false, NULL, 0U, NULL, NULL, NULL);
    const int bad = (one == NULL) || fmi3EnterInitializationMode(one, false, 0.0, start, false, 0.0) || fmi3ExitInitializationMode(one);
#else
    static const fmi2CallbackFunctions none;
    const instance_t one = fmi2Instantiate("one", fmi2CoSimulation, token, "", &none, 0, 0);
    const int bad = (one == NULL) || fmi2SetupExperiment(one, 0, 0.0, start, 0, 0.0) || fmi2EnterInitializationMode(one) ||
                    fmi2ExitInitializationMode(one);
#endif
    if (bad) {
        exit(2);
    }
    return one;
}

/* does it succeed, and where is the FMU then? */
static bool step(instance_t one, double from, double size, double *reached)
{
#if FMI_VERSION == 3
    bool event, end, early;
    return fmi3DoStep(one, from, size, true, &event, &end, &early, reached) == fmi3OK;
#else
    return (fmi2DoStep(one, from, size, 1) == fmi2OK) && (fmi2GetRealStatus(one, fmi2LastSuccessfulTime, reached) == fmi2OK);
#endif
}

static double got(instance_t one, reference_t reference)
{
    double value = NAN;
#if FMI_VERSION == 3
    (void)fmi3GetFloat64(one, &reference, 1U, &value, 1U);
#else
    (void)fmi2GetReal(one, &reference, 1U, &value);
#endif
    return value;
}

static void set(instance_t one, reference_t reference, double value)
{
#if FMI_VERSION == 3
    (void)fmi3SetFloat64(one, &reference, 1U, &value, 1U);
#else
    (void)fmi2SetReal(one, &reference, 1U, &value);
#endif
}

static int count(char *word[])
{
    const instance_t one = started(word[0], strtod(word[3], NULL));
    const reference_t output = (reference_t)strtoul(word[1], NULL, 10);
    const char kind = word[2][0];
    const double start = strtod(word[3], NULL), size = strtod(word[4], NULL), samples = strtod(word[5], NULL);
    const unsigned long n = strtoul(word[6], NULL, 10);
    unsigned long refused = 0U, wrong = 0U;
    double t = start;

    for (unsigned long k = 0U; k < n; k++) {
        const double next = (kind == 'a') ? t + size : start + ((double)(k + 1U) * size);
        const double taken = (kind == 'd') ? next - t : size;
        double reached = NAN;
        if (!step(one, t, taken, &reached)) {
            refused++;
            if (refused <= TOLD) {
                fprintf(stderr, "step %lu: refused from %.17g s, %.17g s\n", k, t, taken);
            }
        }
        t = next;
        if ((((k + 1U) % CHECK) == 0U) || (k + 1U == n)) {
            const double value = got(one, output);
            if (!(fabs(value - ((double)(k + 1U) * samples)) < 0.5) ||
                !(fabs(reached - t) <= (0.01 * size) + (2.0 * DBL_EPSILON * fabs(t)))) {
                wrong++;
                if (wrong <= TOLD) {
                    fprintf(stderr, "step %lu: %.17g samples, at %.17g s instead of %.17g s\n", k, value, reached, t);
                }
            }
        }
    }
    printf("%lu %lu\n", refused, wrong);
    return 0;
}

static double nanoseconds(void)
{
    struct timespec now;

    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return ((double)now.tv_sec * 1e9) + (double)now.tv_nsec;
}

static int by_size(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

static int cost(char *word[])
{
    enum { STEPS = 50, MOST = 10000 };
    static double ratio[MOST];
    const instance_t one = started(word[0], 0.0);
    const reference_t input = (reference_t)strtoul(word[1], NULL, 10);
    const unsigned long blocks = strtoul(word[2], NULL, 10);
    double t = 0.0, reached;
    unsigned long k = 0U;

    if ((blocks == 0U) || (blocks > MOST)) {
        return 2;
    }
    plain_begin();
    for (unsigned long b = 0U; b < blocks; b++) {
        const double begin = nanoseconds();
        for (unsigned long i = 0U; i < STEPS; i++) {
            set(one, input, 0.01 * sin(0.01 * (double)(k + i)));
            if (!step(one, t, PLAIN_STEP, &reached)) {
                return 3;
            }
            t += PLAIN_STEP;
        }
        const double middle = nanoseconds();
        for (unsigned long i = 0U; i < STEPS; i++) {
            plain_step(0.01 * sin(0.01 * (double)(k + i)));
        }
        ratio[b] = (middle - begin) / (nanoseconds() - middle);
        k += STEPS;
    }
    qsort(ratio, blocks, sizeof ratio[0], by_size);
    printf("%.3f\n", ratio[blocks / 2U]);
    return 0;
}

int main(int words, char *word[])
{
    if ((words == 9) && (strcmp(word[1], "count") == 0)) {
        return count(&word[2]);
    }
    return ((words == 5) && (strcmp(word[1], "cost") == 0)) ? cost(&word[2]) : 2;
}
