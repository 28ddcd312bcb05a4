/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * board.h for a user-mode emulator of a core that no other port has: start-up and system calls of Linux, no C library.
 * Files are streams of 32-bit words in little-endian order, whatever the order of the core. Nothing is counted.
 */

#include "board.h"

#include <stddef.h>

#define AT_FDCWD (-100L)
#define O_RDONLY 0L
#define O_MAKE   01101L /* write only, create, truncate */

int main(void);
void begin(const uintptr_t stack[]) __attribute__((noreturn));

#if defined(__riscv)
enum { CLOSE = 57, READ = 63, WRITE = 64, EXIT = 93, OPENAT = 56 };
__asm__(".globl _start\n_start: .option push\n .option norelax\n la gp, __global_pointer$\n .option pop\n"
        "mv a0, sp\n andi sp, sp, -16\n call begin");

static long call(long number, long a, long b, long c, long d)
{
    register long r0 __asm__("a0") = a;
    register long r1 __asm__("a1") = b;
    register long r2 __asm__("a2") = c;
    register long r3 __asm__("a3") = d;
    register long n __asm__("a7") = number;

    __asm__ volatile("ecall" : "+r"(r0) : "r"(r1), "r"(r2), "r"(r3), "r"(n) : "memory");
    return r0;
}
#elif defined(__s390x__)
enum { CLOSE = 6, READ = 3, WRITE = 4, EXIT = 1, OPENAT = 288 };
__asm__(".globl _start\n_start: lgr %r2, %r15\n aghi %r15, -160\n brasl %r14, begin");

static long call(long number, long a, long b, long c, long d)
{
    register long r0 __asm__("r2") = a;
    register long r1 __asm__("r3") = b;
    register long r2 __asm__("r4") = c;
    register long r3 __asm__("r5") = d;
    register long n __asm__("r1") = number;

    __asm__ volatile("svc 0" : "+d"(r0) : "d"(r1), "d"(r2), "d"(r3), "d"(n) : "memory");
    return r0;
}
#endif

static const uintptr_t *arguments; /* count, then pointers */

void begin(const uintptr_t stack[])
{
    arguments = stack;
    board_exit((uint32_t)main());
    for (;;) {
    }
}

void board_exit(uint32_t code)
{
    (void)call(EXIT, (long)code, 0, 0, 0);
}

bool board_argument(uint32_t index, char text[], uint32_t size)
{
    const char *const word = (index < arguments[0]) ? (const char *)arguments[index + 1U] : NULL;
    uint32_t i = 0U;

    while ((word != NULL) && (i < size)) {
        text[i] = word[i];
        if (word[i] == '\0') {
            return true;
        }
        i++;
    }
    return false;
}

void board_print(const char *text)
{
    uint32_t n = 0U;

    while (text[n] != '\0') {
        n++;
    }
    (void)call(WRITE, 1, (long)text, (long)n, 0);
}

int32_t board_open(const char *name, bool write)
{
    return (int32_t)call(OPENAT, AT_FDCWD, (long)name, write ? O_MAKE : O_RDONLY, 0644);
}

/* Into the order of a file, and back. */
static void turn(uint32_t word[], size_t words)
{
#if __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
    for (size_t i = 0U; i < words; i++) {
        word[i] = __builtin_bswap32(word[i]);
    }
#else
    (void)word;
    (void)words;
#endif
}

uint32_t board_read(int32_t file, void *data, uint32_t bytes)
{
    uint32_t done = 0U;
    long got = 1;

    while ((got > 0) && (done < bytes)) {
        got = call(READ, file, (long)((char *)data + done), (long)(bytes - done), 0);
        done += (got > 0) ? (uint32_t)got : 0U;
    }
    turn(data, done / 4U);
    return done;
}

uint32_t board_write(int32_t file, const void *data, uint32_t bytes)
{
    uint32_t word[256];
    uint32_t done = 0U;
    bool good = true;

    while (good && (done < bytes)) {
        const uint32_t left = (bytes - done) / 4U;
        const uint32_t n = (left < 256U) ? left : 256U;

        for (uint32_t i = 0U; i < n; i++) {
            word[i] = ((const uint32_t *)data)[(done / 4U) + i];
        }
        turn(word, n);
        good = (n > 0U) && (call(WRITE, file, (long)word, (long)(4U * n), 0) == (long)(4U * n));
        done += good ? (4U * n) : 0U;
    }
    return done;
}

void board_close(int32_t file)
{
    (void)call(CLOSE, file, 0, 0, 0);
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
