/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* board.h on a POSIX host. The timer is a signal, the nearest thing to an interrupt. Nothing is counted or painted. */

#define _XOPEN_SOURCE 700

#include "board.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/time.h>

#define FILES 8

static FILE *files[FILES];

void board_print(const char *text)
{
    (void)fputs(text, stdout);
    (void)fflush(stdout);
}

void board_print_number(uint32_t value)
{
    (void)printf("%lu", (unsigned long)value);
}

void board_print_hex(uint32_t value)
{
    (void)printf("0x%08lx", (unsigned long)value);
}

/* The C library keeps the arguments for main() alone, but the system shows them in a file. */
bool board_argument(uint32_t index, char text[], uint32_t size)
{
    FILE *const words = fopen("/proc/self/cmdline", "rb");
    uint32_t word = 0U;
    uint32_t length = 0U;
    bool ended = false;

    if (words != NULL) {
        int byte = fgetc(words);
        while ((byte != EOF) && !ended) {
            if ((word == index) && (length < size)) {
                text[length] = (char)byte;
                length++;
            }
            ended = (word == index) && (byte == 0);
            word += (byte == 0) ? 1U : 0U;
            byte = fgetc(words);
        }
        (void)fclose(words);
    }
    return ended && (text[length - 1U] == '\0');
}

void board_exit(uint32_t code)
{
    exit((int)code);
}

int32_t board_open(const char *name, bool write)
{
    int32_t handle = -1;

    for (int32_t i = 0; (i < FILES) && (handle < 0); i++) {
        if (files[i] == NULL) {
            files[i] = fopen(name, write ? "wb" : "rb");
            handle = i;
        }
    }
    return ((handle >= 0) && (files[handle] != NULL)) ? handle : -1;
}

uint32_t board_read(int32_t file, void *data, uint32_t bytes)
{
    return (uint32_t)fread(data, 1U, bytes, files[file]);
}

uint32_t board_write(int32_t file, const void *data, uint32_t bytes)
{
    return (uint32_t)fwrite(data, 1U, bytes, files[file]);
}

void board_close(int32_t file)
{
    (void)fclose(files[file]);
    files[file] = NULL;
}

void board_count_start(void) {}

uint32_t board_count_stop(void)
{
    return 0U;
}

void board_stack_paint(void) {}

uint32_t board_stack_used(void)
{
    return 0U;
}

__attribute__((weak)) void board_timer(void) {}

static void on_signal(int number)
{
    (void)number;
    board_timer();
}

void board_timer_start(uint32_t rate)
{
    const suseconds_t microseconds = (suseconds_t)(1000000U / rate);
    const struct timeval period = { microseconds / 1000000, microseconds % 1000000 };
    const struct itimerval timer = { period, period };
    struct sigaction action;

    memset(&action, 0, sizeof(action));
    action.sa_handler = on_signal;
    action.sa_flags = SA_RESTART;
    (void)sigaction(SIGALRM, &action, NULL);
    (void)setitimer(ITIMER_REAL, &timer, NULL);
}
