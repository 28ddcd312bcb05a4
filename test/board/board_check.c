/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* Asks a port for what it promises. The first argument says what to do; check.sh knows what must come of it. */

#include <float.h>
#include <stddef.h>

#include "board.h"

#define N 8U

static volatile uint32_t ticks;
static volatile float tiny[N];
static float product[N];

static bool same(const char *a, const char *b)
{
    size_t i = 0U;

    while ((a[i] == b[i]) && (a[i] != '\0')) {
        i++;
    }
    return a[i] == b[i];
}

static void report(const char *name, uint32_t value)
{
    board_print(name);
    board_print(" ");
    board_print_number(value);
    board_print("\n");
}

void board_timer(void)
{
    ticks++;
}

/* ---- counting ---- */

#ifdef __arm__

/* Between start and stop: mov, bl; in spin a mov, 2 instructions a round and bx. That is 2 * rounds + 4. */
__attribute__((naked, noinline)) static uint32_t cost_of(uint32_t rounds)
{
    __asm__ volatile("push {r4, lr}\n\t"
                     "mov r4, r0\n\t"
                     "bl board_count_start\n\t"
                     "mov r0, r4\n\t"
                     "bl 2f\n\t"
                     "bl board_count_stop\n\t"
                     "pop {r4, pc}\n"
                     "2: mov r1, r0\n"
                     "1: subs r1, r1, #1\n\t"
                     "bne 1b\n\t"
                     "bx lr");
    (void)rounds;
}

__attribute__((naked, noinline)) static uint32_t cost_of_nothing(void)
{
    __asm__ volatile("push {r4, lr}\n\t"
                     "bl board_count_start\n\t"
                     "bl board_count_stop\n\t"
                     "pop {r4, pc}");
}

#else

static uint32_t cost_of(uint32_t rounds)
{
    (void)rounds;
    board_count_start();
    return board_count_stop();
}

static uint32_t cost_of_nothing(void)
{
    return cost_of(0U);
}

#endif

static void count(void)
{
    report("nothing", cost_of_nothing());
    report("one", cost_of(1U));
    report("thousand", cost_of(1000U));
    report("million", cost_of(1000000U));
}

/* ---- stack ---- */

static uint32_t deep(uint32_t depth)
{
    volatile uint32_t frame[16];

    frame[0] = depth;
    if (depth > 0U) {
        frame[1] = deep(depth - 1U);
    }
    return frame[0] + frame[depth & 1U];
}

static void stack(void)
{
    board_stack_paint();
    report("untouched", board_stack_used());
    (void)deep(9U);
    report("ten-frames", board_stack_used());
}

/* ---- arithmetic: no flushing of subnormal numbers, in loops that a compiler may turn into vectors either ---- */

static void subnormal(void)
{
    float x[N];
    uint32_t good = 0U;

    for (size_t i = 0U; i < N; i++) {
        tiny[i] = FLT_MIN;
    }
    for (size_t i = 0U; i < N; i++) {
        x[i] = tiny[i];
    }
    for (size_t i = 0U; i < N; i++) {
        product[i] = (x[i] * 0.25f) + x[i];
    }
    for (size_t i = 0U; i < N; i++) {
        product[i] = product[i] - x[i];
    }
    for (size_t i = 0U; i < N; i++) {
        good += (product[i] > 0.0f) ? 1U : 0U;
    }
    report("subnormal", good);
}

/* ---- files and the timer ---- */

static void copy(void)
{
    char name[64];
    unsigned char data[256];
    uint32_t n = 0U;
    const int32_t from = board_argument(2U, name, sizeof(name)) ? board_open(name, false) : -1;
    const int32_t to = board_argument(3U, name, sizeof(name)) ? board_open(name, true) : -1;

    if ((from >= 0) && (to >= 0)) {
        n = board_read(from, data, sizeof(data));
        report("copied", board_write(to, data, n));
        board_close(from);
        board_close(to);
    } else {
        report("cannot-open", 0U);
    }
}

static void timer(void)
{
    board_timer_start(1000U);
    while (ticks < 10U) {
        /* until the tenth interrupt */
    }
    report("ticks", ticks);
}

/* ---- what must not go by unnoticed ---- */

static void fault_on_purpose(const char *what)
{
    if (same(what, "null-write")) {
        volatile uint32_t *volatile nothing = NULL;
        *nothing = 1U;
    } else if (same(what, "overflow")) {
        report("depth", deep(1000000U));
    } else if (same(what, "undefined")) {
#ifdef __arm__
        __asm__ volatile("udf #1");
#endif
    } else if (same(what, "wild-read")) {
        report("read", *(volatile uint32_t *)0x4F000000U);
    } else {
        board_print("asked for nothing known\n");
        board_exit(2U);
    }
}

int main(void)
{
    char what[16] = "";

    (void)board_argument(1U, what, sizeof(what));
    if (same(what, "count")) {
        count();
    } else if (same(what, "stack")) {
        stack();
    } else if (same(what, "subnormal")) {
        subnormal();
    } else if (same(what, "copy")) {
        copy();
    } else if (same(what, "timer")) {
        timer();
    } else {
        fault_on_purpose(what);
    }
    return 3;
}
