/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * tsan SETS: one thread steps as fast as it can, one exchanges sets as fast as they are adopted: staged, selected and
 * rolled back, with refused, dropped and withdrawn ones in between. Made with ThreadSanitizer, which reports each access that is
 * not ordered. The k-th set is known to both beforehand, so nothing but the instance is shared. Exit code 1 if a step
 * was not one whole set's, or a set was lost, came twice or out of order, or a counter is wrong.
 */

#include <pthread.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include MODEL_HEADER

#define N        MODEL_SIZE(SET_LENGTH)
#define PATIENCE 5000000U /* steps without a new set: it is lost */
#define WAIT     10 /* [s] for the tuning thread when all its sets have come; still busy: one came twice */

static const pen_set_t *const set[] = { &MODEL(set_default), &MODEL(set_stiff), &MODEL(set_kinked) };
static MODEL(t) model;
static MODEL(banks_t) banks;
static pen_real_t expected[3];
static unsigned long sets;
static unsigned long granted; /* withdrawals, as the thread that tunes sees them */

/* The set published as number k; 0 runs first. Every fourth is a rollback, to the one before the last. */
static unsigned int which(unsigned long k)
{
    static const unsigned int turn[4] = { 2U, 0U, 1U, 0U };

    return (k == 0U) ? 0U : turn[(k - 1U) % 4U];
}

static pen_status_t stage(const pen_set_t *from)
{
    pen_set_head_t head = from->head;
    pen_status_t status = MODEL(tune_begin)(&model, &head);

    if (status == PEN_OK) {
        status = MODEL(tune_write)(&model, 0U, &from->value[1], N / 2U); /* wrong ones: refused, then sent again */
        status |= MODEL(tune_write)(&model, N / 2U, &from->value[N / 2U], N - (N / 2U));
        status |= MODEL(tune_commit)(&model) ^ PEN_SET_CHECKSUM;
        status |= MODEL(tune_write)(&model, 0U, from->value, N);
        status |= MODEL(tune_abort)(&model);
        status |= MODEL(tune_begin)(&model, &head);
        status |= MODEL(tune_write)(&model, 0U, from->value, N);
        status |= MODEL(tune_commit)(&model);
    }
    return status;
}

static pen_status_t exchange(unsigned long k)
{
    pen_status_t status;

    if ((k % 4U) == 0U) {
        status = MODEL(tune_rollback)(&model);
    } else if ((k % 4U) == 2U) {
        status = MODEL(tune_select)(&model, set[which(k)]);
    } else {
        status = stage(set[which(k)]);
    }
    return status;
}

/* Withdraw the k-th set: true if the step has granted it. */
static bool withdrawn(unsigned long k)
{
    pen_set_head_t head = { 0U, 0U, 0U, 0U };
    bool pending = (MODEL(tune_withdraw)(&model) == PEN_OK);

    while (pending) {
        (void)sched_yield();
        (void)MODEL(tune_pending)(&model, &pending);
    }
    (void)MODEL(tune_withdraw)(&model); /* nothing to withdraw: learns its result */
    (void)MODEL(tune_running)(&model, &head);
    return head.id != set[which(k)]->head.id;
}

static void *tune(void *nothing)
{
    unsigned long bad = 0U;
    bool again = false;
    pen_status_report_t report;

    (void)nothing;
    for (unsigned long k = 1U; (k <= sets) && (bad == 0U); k++) {
        pen_status_t status = exchange(k);
        while (status == PEN_SET_BUSY) {
            (void)sched_yield();
            status = exchange(k);
        }
        bad += (status != PEN_OK) ? 1U : 0U;
        again = ((k % 3U) == 0U) && !again && withdrawn(k);
        if (again) { /* once more, and that counts */
            granted++;
            k--;
        } else {
            bad += (MODEL(verify)(&model, N) == PEN_OK) ? 0U : 1U;
        }
        if ((k % 64U) == 0U) {
            (void)MODEL(status)(&model, &report);
        }
    }
    return (void *)bad;
}

static bool same(pen_real_t a, pen_real_t b)
{
    return memcmp(&a, &b, sizeof(a)) == 0;
}

static pen_status_t step(pen_real_t *v)
{
    static const MODEL(x_t) x = { (pen_real_t)0.75, (pen_real_t)0.25 };
    static const MODEL(u_t) u = { (pen_real_t)0.5 };
    MODEL(y_t) y = { 0 };
    pen_status_t status;

    (void)MODEL(set_state)(&model, &x);
    status = MODEL(step)(&model, &u, &y);
    *v = y.v;
    return status;
}

int main(int argc, char **argv)
{
    unsigned long adopted = 0U;
    unsigned long steps = 0U;
    unsigned long torn = 0U;
    unsigned long idle = 0U;
    unsigned long left = 0U;
    pthread_t tuner;
    void *bad = NULL;
    pen_real_t v;

    sets = (argc > 1) ? strtoul(argv[1], NULL, 10) : 1000U;
    for (unsigned int s = 0U; s < 3U; s++) {
        (void)MODEL(init)(&model, set[s], &banks);
        (void)step(&v);
        (void)step(&expected[s]);
    }
    (void)MODEL(init)(&model, set[0], &banks);
    (void)step(&v);
    if (same(expected[0], expected[1]) || same(expected[0], expected[2]) || same(expected[1], expected[2])) {
        return 2;
    }
    (void)pthread_create(&tuner, NULL, tune, NULL);
    while ((adopted < sets) && (torn == 0U) && (idle < PATIENCE)) {
        const pen_status_t status = step(&v);
        left += ((status & PEN_WITHDRAWN) != 0U) ? 1U : 0U;
        idle++;
        if ((status & PEN_ADOPTED) != 0U) {
            adopted++;
            idle = 0U;
        }
        torn += (same(v, expected[which(adopted)]) && ((status & ~(PEN_ADOPTED | PEN_WITHDRAWN)) == PEN_OK)) ? 0U : 1U;
        steps++;
    }
    if (adopted == sets) {
        struct timespec until;
        (void)clock_gettime(CLOCK_REALTIME, &until);
        until.tv_sec += WAIT;
        torn += (pthread_timedjoin_np(tuner, &bad, &until) == 0) ? 0U : 1U;
        torn += (left == granted) ? 0U : 1U;
    }
    printf("%lu adopted, %lu steps, %lu torn, %lu withdrawn, %lu refused\n", adopted, steps, torn, left, (unsigned long)bad);
    return ((torn == 0U) && (bad == NULL) && (adopted == sets)) ? 0 : 1;
}
