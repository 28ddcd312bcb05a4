/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* A master for the Windows binary of an FMU, FMI_VERSION 2 or 3: loads it, holds an input over each step, selects a set on the way.
 *
 * Arguments: library, token, then value references: input, set, first output, second output; sample after which the set is selected, its
 * number, file with the inputs (double), file for outputs (2 double for a sample). Result: 0, else the line of the call that was refused. */

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <windows.h>

#if FMI_VERSION == 3
#include "fmi3_api.h"
#define FMI(name) fmi3##name
#else
#include "fmi2_api.h"
#define FMI(name) fmi2##name
#endif

#define CALL(type, name) ((type)(void *)GetProcAddress(library, name))
#define TRY(call) \
    do { \
        if ((call) != 0) { \
            return __LINE__; \
        } \
    } while (0)

typedef FMI(ValueReference) reference_t;
typedef int (*plain_t)(void *);
#if FMI_VERSION == 3
typedef void *(*instantiate_t)(const char *, const char *, const char *, bool, bool, bool, bool, const reference_t *, size_t, void *,
                               void *, void *);
typedef int (*enter_t)(void *, bool, double, double, bool, double);
typedef int (*reals_t)(void *, const reference_t *, size_t, double *, size_t);
typedef int (*whole_t)(void *, const reference_t *, size_t, const int64_t *, size_t);
typedef int (*step_t)(void *, double, double, bool, bool *, bool *, bool *, double *);
#else
typedef struct {
    void *log, *allocate, *release, *finished, *environment;
} callbacks_t;
typedef void *(*instantiate_t)(const char *, int, const char *, const char *, const callbacks_t *, int, int);
typedef int (*setup_t)(void *, int, double, double, int, double);
typedef int (*reals_t)(void *, const reference_t *, size_t, double *);
typedef int (*whole_t)(void *, const reference_t *, size_t, const int *);
typedef int (*step_t)(void *, double, double, int);
#endif

static void *opened(HMODULE library, const char *token)
{
#if FMI_VERSION == 3
    return CALL(instantiate_t, "fmi3InstantiateCoSimulation")("one", token, NULL, false, false, false, false, NULL, 0U, NULL, NULL, NULL);
#else
    static callbacks_t callbacks;
    callbacks.allocate = (void *)calloc;
    callbacks.release = (void *)free;
    return CALL(instantiate_t, "fmi2Instantiate")("one", 1, token, "", &callbacks, 0, 0);
#endif
}

static int entered(HMODULE library, void *fmu)
{
#if FMI_VERSION == 3
    return CALL(enter_t, "fmi3EnterInitializationMode")(fmu, false, 0.0, 0.0, false, 0.0);
#else
    const int status = CALL(setup_t, "fmi2SetupExperiment")(fmu, 0, 0.0, 0.0, 0, 0.0);
    return (status != 0) ? status : CALL(plain_t, "fmi2EnterInitializationMode")(fmu);
#endif
}

static int reals(HMODULE library, const char *name, void *fmu, const reference_t *references, size_t n, double *values)
{
#if FMI_VERSION == 3
    return CALL(reals_t, name)(fmu, references, n, values, n);
#else
    return CALL(reals_t, name)(fmu, references, n, values);
#endif
}

static int selected(HMODULE library, void *fmu, reference_t reference, int number)
{
#if FMI_VERSION == 3
    const int64_t value = number;
    return CALL(whole_t, "fmi3SetInt64")(fmu, &reference, 1U, &value, 1U);
#else
    return CALL(whole_t, "fmi2SetInteger")(fmu, &reference, 1U, &number);
#endif
}

static int stepped(HMODULE library, void *fmu, long k)
{
#if FMI_VERSION == 3
    bool event = false;
    bool end = false;
    bool early = false;
    double last = 0.0;
    return CALL(step_t, "fmi3DoStep")(fmu, (double)k * 1e-3, 1e-3, true, &event, &end, &early, &last);
#else
    return CALL(step_t, "fmi2DoStep")(fmu, (double)k * 1e-3, 1e-3, 1);
#endif
}

#if FMI_VERSION == 3
#define SET     "fmi3SetFloat64"
#define GET     "fmi3GetFloat64"
#define EXIT    "fmi3ExitInitializationMode"
#define RELEASE "fmi3FreeInstance"
#else
#define SET     "fmi2SetReal"
#define GET     "fmi2GetReal"
#define EXIT    "fmi2ExitInitializationMode"
#define RELEASE "fmi2FreeInstance"
#endif

int main(int n, char **words)
{
    const HMODULE library = (n == 11) ? LoadLibraryA(words[1]) : NULL;
    void *fmu = NULL;
    FILE *in = NULL;
    FILE *out = NULL;
    double u = 0.0;
    double y[2];

    if (library == NULL) {
        return __LINE__;
    }
    const reference_t input = (reference_t)atol(words[3]);
    const reference_t outputs[2] = { (reference_t)atol(words[5]), (reference_t)atol(words[6]) };
    in = fopen(words[9], "rb");
    out = fopen(words[10], "wb");
    fmu = opened(library, words[2]);
    if ((fmu == NULL) || (in == NULL) || (out == NULL) || (fread(&u, sizeof u, 1U, in) != 1U)) {
        return __LINE__;
    }
    TRY(entered(library, fmu));
    TRY(reals(library, SET, fmu, &input, 1U, &u));
    TRY(CALL(plain_t, EXIT)(fmu));
    TRY(reals(library, GET, fmu, outputs, 2U, y));
    (void)fwrite(y, sizeof y, 1U, out);
    for (long k = 0; (k == 0) || (fread(&u, sizeof u, 1U, in) == 1U); k++) {
        if (k == atol(words[7])) {
            TRY(selected(library, fmu, (reference_t)atol(words[4]), atoi(words[8])));
        }
        TRY(reals(library, SET, fmu, &input, 1U, &u));
        TRY(stepped(library, fmu, k));
        TRY(reals(library, GET, fmu, outputs, 2U, y));
        (void)fwrite(y, sizeof y, 1U, out);
    }
    (void)CALL(plain_t, RELEASE)(fmu);
    return fclose(out);
}
