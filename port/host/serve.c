/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * A virtual controller: a thread steps in real time, the main thread serves one XCP master after the other (serve_line.h).
 *
 *   serve tcp|udp|frames HOST PORT MAX_CTO QUIET STIMULUS A2L
 *
 * PORT 0: any that is free. STIMULUS: a file with the inputs of all samples, pen_real_t[n][N_U], played again and again;
 * A2L: the file that GET_ID offers, or "-". Ends with its standard input. Prints its port, and `fifo` or `shared`: whether it may step
 * before all other programs; then, each second that has added late steps, and at the end, the number of steps, and of late ones: more
 * than a period after their time.
 */
#define _GNU_SOURCE

#include <errno.h>
#include <pthread.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "controller.h"
#include "serve_line.h"

#define SLOTS  8192U
#define ROOM   256U /* bytes of a slot */
#define SECOND 1000000000LL

enum { WORD_KIND = 1, WORD_HOST, WORD_PORT, WORD_CTO, WORD_QUIET, WORD_STIMULUS, WORD_A2L, WORDS };

static uint8_t ring[SLOTS * ROOM];
static MODEL(u_t) *stimulus;
static uint32_t stimuli;

/* -- stepping ------------------------------------------------------------------------------------------------------- */

static int64_t nanoseconds(void)
{
    struct timespec now;

    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return ((int64_t)now.tv_sec * SECOND) + now.tv_nsec;
}

static void *stepping(void *unused)
{
    const int64_t period = (int64_t)CONTROLLER_PERIOD; /* ns */
    const struct sched_param none = { .sched_priority = 0 };
    int64_t due = nanoseconds();
    bool hopeless = false;

    for (uint32_t k = 0U;; k++) {
        const int64_t behind = nanoseconds() - due;
        if (!hopeless && (behind > SECOND)) { /* others would never run */
            hopeless = true;
            (void)pthread_setschedparam(pthread_self(), SCHED_OTHER, &none);
        }
        controller_step(&stimulus[k % stimuli], behind > period);
        due += period;
        const struct timespec next = { due / SECOND, due % SECOND };
        (void)clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, NULL);
    }
    return unused;
}

/* Prints the numbers of steps and of late ones, at most once a second, if there are more late ones than were printed. */
static void print_late(void)
{
    static int64_t printed;
    static uint32_t before;
    const uint32_t late = controller_late();
    const int64_t now = nanoseconds();

    if ((late != before) && ((now - printed) >= SECOND)) {
        printf("%u %u\n", (unsigned)controller_samples(), (unsigned)late);
        (void)fflush(stdout);
        printed = now;
        before = late;
    }
}

/* The thread that steps; before all other programs where that is permitted, until it is a second behind. @return false: there is none */
static bool start_stepping(bool *first)
{
    const struct sched_param least = { .sched_priority = sched_get_priority_min(SCHED_FIFO) };
    pthread_t thread;

    if (pthread_create(&thread, NULL, stepping, NULL) != 0) {
        return false;
    }
    *first = pthread_setschedparam(thread, SCHED_FIFO, &least) == 0;
    return true;
}

/* -- beginning ------------------------------------------------------------------------------------------------------ */

/* All of a file; ends the program if it cannot be read. */
static void *read_file(const char *name, size_t *size)
{
    FILE *const file = fopen(name, "rb");
    void *byte = NULL;
    long end = -1L;

    if ((file != NULL) && (fseek(file, 0L, SEEK_END) == 0)) {
        end = ftell(file);
    }
    if (end >= 0L) {
        *size = (size_t)end;
        byte = malloc(*size + 1U);
    }
    if ((byte == NULL) || (fseek(file, 0L, SEEK_SET) != 0) || (fread(byte, 1U, *size, file) != *size)) {
        perror(name);
        exit(1);
    }
    (void)fclose(file);
    return byte;
}

int main(int count, char *word[])
{
    static controller_config_t config = { .ring = ring, .slots = SLOTS };
    bool first = false;
    size_t size = 0U;

    if (count != WORDS) {
        return 2;
    }
    config.max_cto = (uint32_t)strtoul(word[WORD_CTO], NULL, 10);
    config.quiet = (uint32_t)strtoul(word[WORD_QUIET], NULL, 10);
    stimulus = read_file(word[WORD_STIMULUS], &size);
    stimuli = (uint32_t)(size / sizeof(*stimulus));
    if (strcmp(word[WORD_A2L], "-") != 0) {
        config.a2l = read_file(word[WORD_A2L], &size);
        config.a2l_size = (uint32_t)size;
    }
    if ((stimuli == 0U) || !controller_start(&config)) {
        return 2;
    }
    const uint16_t port = line_open(word[WORD_KIND], word[WORD_HOST], word[WORD_PORT], config.max_cto);
    if (port == 0U) {
        perror("serve");
        return 3;
    }
    if (!start_stepping(&first)) {
        return 1;
    }
    printf("%u %s\n", (unsigned)port, first ? "fifo" : "shared");
    (void)fflush(stdout);
    line_serve(print_late);
    printf("%u %u\n", (unsigned)controller_samples(), (unsigned)controller_late());
    return 0;
}
