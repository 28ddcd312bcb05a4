/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* board.h on an emulated Cortex-M: semihosting for text and files, SysTick for counts and the timer. */

#include "board.h"
#include "cortex_m.h"

#include <stddef.h>

#define PAINT      0xA5C3F00DU
#define SYST_TOP   0x00FFFFFFU
#define SYST_START 0x5U /* core clock, on    */
#define SYST_INT   0x2U /* with an interrupt */
#define EXIT_CAUSE 0x20026U /* ADP_Stopped_ApplicationExit */

/* ---- text, surroundings, files ---- */

static uint32_t length_of(const char *text)
{
    uint32_t n = 0U;

    while (text[n] != '\0') {
        n++;
    }
    return n;
}

void board_print(const char *text)
{
    (void)host_call(HOST_WRITE0, text);
}

void board_print_number(uint32_t value)
{
    char text[11];
    uint32_t at = sizeof(text) - 1U;

    text[at] = '\0';
    do {
        at--;
        text[at] = (char)('0' + (value % 10U));
        value /= 10U;
    } while (value > 0U);
    board_print(&text[at]);
}

void board_print_hex(uint32_t value)
{
    static const char digit[] = "0123456789abcdef";
    char text[11] = "0x";

    for (uint32_t i = 0U; i < 8U; i++) {
        text[2U + i] = digit[(value >> (28U - (4U * i))) & 0xFU];
    }
    text[10] = '\0';
    board_print(text);
}

bool board_argument(uint32_t index, char text[], uint32_t size)
{
    static char line[512];
    struct {
        char *text;
        uint32_t size;
    } block = { line, sizeof(line) };
    const bool known = (host_call(HOST_CMDLINE, &block) == 0U);
    uint32_t at = 0U;
    uint32_t n = 0U;

    for (uint32_t word = 0U; known && (word < index); word++) {
        while ((line[at] != '\0') && (line[at] != ' ')) {
            at++;
        }
        at += (line[at] == ' ') ? 1U : 0U;
    }
    while (known && (line[at] != '\0') && (line[at] != ' ') && (n < size)) {
        text[n] = line[at];
        n++;
        at++;
    }
    if (n < size) {
        text[n] = '\0';
    }
    return (n > 0U) && (n < size);
}

void board_exit(uint32_t code)
{
    const uint32_t block[2] = { EXIT_CAUSE, code };

    for (;;) {
        (void)host_call(HOST_EXIT, block);
    }
}

int32_t board_open(const char *name, bool write)
{
    const struct {
        const char *name;
        uint32_t mode;
        uint32_t length;
    } block = { name, write ? 5U : 1U, length_of(name) }; /* modes "wb" and "rb" */

    return (int32_t)host_call(HOST_OPEN, &block);
}

typedef struct {
    int32_t file;
    const void *data;
    uint32_t bytes;
} transfer_t;

uint32_t board_read(int32_t file, void *data, uint32_t bytes)
{
    const transfer_t block = { file, data, bytes };

    return bytes - host_call(HOST_READ, &block);
}

uint32_t board_write(int32_t file, const void *data, uint32_t bytes)
{
    const transfer_t block = { file, data, bytes };

    return bytes - host_call(HOST_WRITE, &block);
}

void board_close(int32_t file)
{
    (void)host_call(HOST_CLOSE, &file);
}

/* ---- instructions ---- */

/*
 * The emulator lets 2^shift ns pass with each instruction (see run), SysTick counts BOARD_TICK_MHZ a microsecond. The
 * shift is found by timing a loop of known length, so a program can be run with any; without one nothing fits it.
 */
#define LOOP_TIMES  2048U
#define LOOP_LENGTH (2U * LOOP_TIMES)

static uint32_t thousandths; /* ticks of 1000 instructions; 0 if unknown           */
static uint32_t overhead;    /* instructions between the readings of an empty pair */
static uint32_t started;

static uint32_t ticks_since(uint32_t start)
{
    const uint32_t now = SYST_CVR;
    const uint32_t period = SYST_RVR + 1U;

    return (start >= now) ? (start - now) : ((start + period) - now);
}

static uint32_t instructions(uint32_t ticks)
{
    uint32_t n = 0U;

    if (thousandths > 0U) {
        n = (uint32_t)((((uint64_t)ticks * 1000U) + (thousandths / 2U)) / thousandths);
    }
    return n;
}

__attribute__((noinline)) void board_count_start(void)
{
    started = SYST_CVR;
}

__attribute__((noinline)) uint32_t board_count_stop(void)
{
    const uint32_t n = instructions(ticks_since(started));

    return (n > overhead) ? (n - overhead) : 0U;
}

/* Does a loop of LOOP_LENGTH instructions and a few (loads, stores, set-up: fewer than 40) take that many ticks? */
static bool clock_fits(uint32_t ticks, uint32_t candidate)
{
    const uint32_t most = ((ticks + 1U) * 1000U) / candidate;
    const uint32_t least = ((ticks - 1U) * 1000U) / candidate;

    return (most >= LOOP_LENGTH) && (least < (LOOP_LENGTH + 40U));
}

void board_count_init(void)
{
    uint32_t left = LOOP_TIMES;
    uint32_t start;
    uint32_t ticks;

    SYST_RVR = SYST_TOP;
    SYST_CVR = 0U;
    SYST_CSR = SYST_START;
    while (SYST_CVR == 0U) {
        /* the first tick loads the counter */
    }
    start = SYST_CVR;
    __asm__ volatile("1: subs %0, %0, #1\n\t"
                     "bne 1b"
                     : "+l"(left)
                     :
                     : "cc");
    ticks = ticks_since(start);
    for (uint32_t shift = 0U; shift <= 10U; shift++) {
        const uint32_t candidate = BOARD_TICK_MHZ << shift;
        if (clock_fits(ticks, candidate)) {
            thousandths = candidate;
        }
    }
    __asm__ volatile("bl board_count_start\n\t" /* not in C: the compiler would put instructions in between */
                     "bl board_count_stop\n\t"
                     "mov %0, r0"
                     : "=r"(left)
                     :
                     : "r0", "r1", "r2", "r3", "r12", "lr", "cc", "memory");
    overhead = left;
}

/* ---- stack ---- */

__attribute__((used)) static uint32_t *painted_below; /* stack pointer of the caller of board_stack_paint */

/* No stack of its own, so that it can paint right up to its caller's. */
__attribute__((naked)) void board_stack_paint(void)
{
    __asm__ volatile("ldr r0, =painted_below\n\t"
                     "mov r1, sp\n\t"
                     "str r1, [r0]\n\t"
                     "ldr r0, =board_stack_limit\n\t"
                     "ldr r2, =%c0\n"
                     "1: cmp r0, r1\n\t"
                     "it lo\n\t"
                     "strlo r2, [r0], #4\n\t"
                     "blo 1b\n\t"
                     "bx lr\n\t"
                     ".ltorg"
                     :
                     : "i"(PAINT));
}

uint32_t board_stack_used(void)
{
    const uint32_t *at = board_stack_limit;

    while ((at < painted_below) && (*at == PAINT)) {
        at++;
    }
    return (painted_below == NULL) ? 0U : (uint32_t)((uintptr_t)painted_below - (uintptr_t)at);
}

/* ---- timer ---- */

__attribute__((weak)) void board_timer(void) {}

void board_tick(void)
{
    board_timer();
}

void board_timer_start(uint32_t rate)
{
    SYST_RVR = ((BOARD_TICK_MHZ * 1000000U) / rate) - 1U;
    SYST_CVR = 0U;
    SYST_CSR = SYST_START | SYST_INT;
}
