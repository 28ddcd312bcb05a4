/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * flip EVERY: flips one bit of an instance, or of the sets in its banks, then takes 1000 steps, in which sets are
 * staged, selected, withdrawn, rolled back and verified. Every EVERY-th bit of the banks, ten times as many of the instance, in three
 * situations: nothing open, a set half written, a set published. Each in a process of its own. Instance and banks lie
 * between poisoned memory, so that AddressSanitizer meets whatever goes beside; further away is no memory. Printed: how
 * often what became of it.
 */

#include <sanitizer/asan_interface.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <ucontext.h>
#include <unistd.h>

#include MODEL_HEADER

#define N       MODEL_SIZE(SET_LENGTH)
#define N_U     MODEL_SIZE(N_U)
#define STEPS   1000U
#define ARENA   (1U << 20U)
#define SECONDS 2 /* of the processor: a thousand times what a run takes */

enum { NO_EFFECT, REFUSED, FLAGGED, READ_OUTSIDE, OTHER_RESULT, WRITE_OUTSIDE, HANG, BROKEN, OUTCOMES };
enum { QUIET, HALF_WRITTEN, PUBLISHED, SITUATIONS };

static const char *const outcome_name[OUTCOMES] = { "no effect",    "refused",       "flagged", "read outside",
                                                    "other result", "write outside", "hang",    "broken" };
static const pen_set_t *const sets[] = { MODEL_SETS };
#define SETS (sizeof(sets) / sizeof(sets[0]))

typedef struct {
    uint64_t digest;
    pen_status_t calls; /* all that the tuning calls returned */
    pen_status_t steps; /* all that the steps reported    */
    uint32_t done;
} result_t;

typedef struct {
    MODEL(t) model;
    uint8_t between[4096];
    MODEL(banks_t) banks;
} memory_t;

static uint8_t *arena;
static memory_t *memory;
static result_t *result; /* shared with the process that runs */

void __asan_on_error(void);

/* What AddressSanitizer has seen ends the run: a read or a write. */
void __asan_on_error(void)
{
    _exit((__asan_get_report_access_type() == 1) ? (int)WRITE_OUTSIDE : (int)READ_OUTSIDE);
}

static void on_fault(int number, siginfo_t *info, void *context)
{
    const ucontext_t *const at = context;

    (void)number;
    (void)info;
    _exit(((at->uc_mcontext.gregs[REG_ERR] & 2) != 0) ? (int)WRITE_OUTSIDE : (int)READ_OUTSIDE);
}

static void step(uint32_t k)
{
    pen_real_t u[N_U];
    MODEL(u_t) input;
    MODEL(y_t) y;
    pen_status_t status;

    for (uint32_t i = 0U; i < N_U; i++) {
        u[i] = (pen_real_t)0.0004 * (pen_real_t)((k * (7U + i)) % 101U);
    }
    memcpy(&input, u, sizeof(input));
    memset(&y, 0, sizeof(y));
    status = MODEL(step)(&memory->model, &input, &y);
    result->steps |= status & ~(PEN_ADOPTED | PEN_WITHDRAWN);
    for (size_t i = 0U; i < sizeof(y); i++) {
        result->digest = (result->digest ^ ((const uint8_t *)&y)[i]) * UINT64_C(0x100000001B3);
    }
}

static void tune(pen_status_t status)
{
    result->calls |= status;
}

static void write_part(const pen_set_t *set, uint32_t from, uint32_t n)
{
    tune(MODEL(tune_write)(&memory->model, from, &set->value[from], n));
}

static void stage(const pen_set_t *set)
{
    tune(MODEL(tune_begin)(&memory->model, &set->head));
    write_part(set, 0U, N / 2U);
    write_part(set, N / 2U, N - (N / 2U));
    tune(MODEL(tune_commit)(&memory->model));
}

static void before(uint32_t situation)
{
    const pen_set_t *const other = sets[SETS - 1U];

    tune(MODEL(init)(&memory->model, sets[0], &memory->banks));
    for (uint32_t k = 0U; k < 20U; k++) {
        step(k);
    }
    stage(other);
    for (uint32_t k = 0U; k < 20U; k++) {
        step(k);
    }
    if (situation == HALF_WRITTEN) {
        tune(MODEL(tune_begin)(&memory->model, &sets[0]->head));
        write_part(sets[0], 0U, N / 2U);
    } else if (situation == PUBLISHED) {
        stage(sets[0]);
    } else {
        /* nothing open */
    }
}

static void after(uint32_t situation)
{
    pen_status_report_t report;

    for (uint32_t k = 0U; k < STEPS; k++) {
        if ((k == 0U) && (situation == HALF_WRITTEN)) {
            write_part(sets[0], N / 2U, N - (N / 2U));
            tune(MODEL(tune_commit)(&memory->model));
        } else if (k == 300U) {
            stage(sets[SETS - 1U]);
        } else if (k == 500U) {
            tune(MODEL(tune_select)(&memory->model, sets[0]));
            tune(MODEL(tune_withdraw)(&memory->model));
        } else if (k == 600U) {
            tune(MODEL(tune_rollback)(&memory->model));
        } else if (k == 700U) {
            stage(sets[0]);
        } else if (k == 800U) {
            tune(MODEL(tune_select)(&memory->model, sets[0]));
        } else {
            /* the step alone */
        }
        if ((k % 8U) == 7U) {
            tune(MODEL(verify)(&memory->model, 1U + (MODEL_SIZE(VERIFY) / 10U)));
        }
        step(k);
    }
    (void)MODEL(status)(&memory->model, &report);
    result->done = 1U;
}

/* The bits of the instance, then those of both banks. */
static void flip(size_t bit)
{
    const size_t own = 8U * sizeof(memory->model);
    uint8_t *const bytes = (bit < own) ? (uint8_t *)&memory->model : (uint8_t *)&memory->banks;
    const size_t at = (bit < own) ? bit : (bit - own);

    bytes[at / 8U] ^= (uint8_t)(1U << (at % 8U));
}

static uint32_t run(uint32_t situation, size_t bit, bool flips, const result_t *right)
{
    int status = 0;
    uint32_t outcome;
    pid_t child;

    memset(result, 0, sizeof(*result));
    child = fork();
    if (child == 0) {
        const struct itimerval limit = { { 0, 0 }, { SECONDS, 0 } };
        (void)setitimer(ITIMER_PROF, &limit, NULL);
        before(situation);
        if (flips) {
            flip(bit);
        }
        after(situation);
        _exit(NO_EFFECT);
    }
    (void)waitpid(child, &status, 0);
    if (WIFSIGNALED(status)) {
        outcome = (WTERMSIG(status) == SIGPROF) ? HANG : BROKEN;
    } else if (WEXITSTATUS(status) != (int)NO_EFFECT) {
        outcome = (uint32_t)WEXITSTATUS(status) % OUTCOMES;
    } else if (result->done == 0U) {
        outcome = BROKEN;
    } else if (!flips) {
        outcome = NO_EFFECT;
    } else if ((result->calls & ~right->calls) != PEN_OK) {
        outcome = REFUSED;
    } else if ((result->steps & ~right->steps) != PEN_OK) {
        outcome = FLAGGED;
    } else {
        outcome = (result->digest == right->digest) ? NO_EFFECT : OTHER_RESULT;
    }
    return outcome;
}

int main(int argc, char **argv)
{
    const size_t every = (argc > 1) ? strtoul(argv[1], NULL, 10) : 97U;
    const size_t own = 8U * sizeof(MODEL(t));
    const size_t bits = own + (8U * sizeof(MODEL(banks_t)));
    unsigned long count[OUTCOMES] = { 0 };
    struct sigaction action;

    memset(&action, 0, sizeof(action));
    action.sa_sigaction = on_fault;
    action.sa_flags = SA_SIGINFO;
    (void)sigaction(SIGSEGV, &action, NULL);
    (void)sigaction(SIGBUS, &action, NULL);
    (void)freopen("/dev/null", "w", stderr); /* what AddressSanitizer has to say about each */
    result = mmap(NULL, sizeof(*result), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    arena = malloc(ARENA);
    memory = (memory_t *)&arena[ARENA / 2U];
    __asan_poison_memory_region(arena, ARENA);
    __asan_unpoison_memory_region(&memory->model, sizeof(memory->model));
    __asan_unpoison_memory_region(&memory->banks, sizeof(memory->banks));
    for (uint32_t situation = QUIET; situation < SITUATIONS; situation++) {
        result_t right;
        if (run(situation, 0U, false, NULL) != NO_EFFECT) {
            printf("broken without a flip\n");
            return 1;
        }
        right = *result;
        for (size_t bit = 0U; bit < bits; bit += (bit < own) ? ((every + 9U) / 10U) : every) {
            const uint32_t outcome = run(situation, bit, true, &right);
            count[outcome]++;
            if ((outcome >= WRITE_OUTSIDE) && (count[outcome] <= 5U)) {
                printf("bit %lu of byte %lu in situation %u: %s\n", (unsigned long)(bit % 8U), (unsigned long)(bit / 8U), situation,
                       outcome_name[outcome]);
            }
        }
    }
    for (uint32_t k = 0U; k < OUTCOMES; k++) {
        printf("%s: %lu\n", outcome_name[k], count[k]);
    }
    return ((count[WRITE_OUTSIDE] + count[HANG] + count[BROKEN]) == 0U) ? 0 : 1;
}
