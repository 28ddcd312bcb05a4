/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * Bad on purpose and never linked. If the MISRA check did not complain about this file, its silence about the library
 * would mean nothing: test/misra/check wants many different rules to be broken here. // nested /* 3.1
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <math.h>

#undef UNUSED_MACRO
#define UNUSED_MACRO 1
#define TWICE(x) x + x
#define PASTE(a, b) a##b##a
#define TEXT(a) #a

union both { int whole; float real; };
enum colour { red = 1, green, blue = 2 };
struct unused_tag { int member; };
typedef int unused_type;
typedef struct { unsigned char flag : 3; int sign : 1; short odd : 2; } bits_t;

int global = 010;
int shared_but_here_only;
extern int array_without_size[];
static int hidden;
char *literal = "not const";
int undeclared_function();

int printf_like(const char *text, ...)
{
    va_list list;
    va_start(list, text);
    int hidden = va_arg(list, int);
    va_end(list);
    return hidden;
}

int factorial(int n)
{
    if (n < 2)
        return 1;
    return n * factorial(n - 1);
}

static inline int jumps(int a, int b)
{
    int unused_value = 3;
    if (a == 1) goto out;
again:
    a++;
    if (a > b && b > a || a == 3) goto again;
    while (a < 4) { if (a == 2) break; if (b == 3) break; a++; }
    for (float f = 0; f < 1.0f; f += 0.1f) a = a + 1;
    for (a = 0, b = 0; a < b; a++, b--) ;
    for (;;) { continue; }
out:
    return a, b;
}

int switches(int a)
{
    switch (a) {
        int lost;
        case 1: a = 2;
        case 2: { a = 3; }
        default: a = 4;
        case 3: break;
    }
    switch (a) { default: break; }
    switch (a == 1) { case 0: a = 1; break; case 1: a = 2; break; }
    if (a == 1) { a = 2; } else if (a == 2) { a = 3; }
    return a;
}

double types(unsigned char small, unsigned int big, int sign, float real, char letter, bits_t *bits)
{
    unsigned short narrow = big;
    unsigned int   wide = small + narrow;
    int            octal = '\01' + 0x1l + 5u;
    void          *any = &big;
    int           *alias = (int *)any;
    float         *other = (float *)alias;
    const int      fixed = 3;
    int           *cast_away = (int *)&fixed;
    int            address = (int)(long)alias;
    int           *null = 0;
    int            data[2][2] = { 1, 2, [1][1] = 3, [1][1] = 4 };
    int          (*function)(int) = factorial;
    long           odd = (long)function;
    union both     mix;

    mix.real = real;
    wide = big << 40;
    wide = ~small;
    wide += sign;
    sign = sign + big;
    sign = (int)(real * 2.0f) + letter;
    letter = letter * 2;
    if (sign = 3) { sign = !sign + !!big; }
    if (big > 1 == 1) { sign++; }
    if (real == 1.0f) { }
    sign = sign++ + sign--;
    sign = (sign > 0) && (sign++ > 1);
    sizeof(sign++);
    wide = (unsigned int)(small + small);
    small = (unsigned char)-1;
    *(&data[0][0] + 1) = *(alias + 1);
    alias -= 1;
    narrow ? sign : wide;
    bits->flag = 9;
    wide = 1U - 2U;
    factorial(3);
    memcpy(&real, &sign, sizeof sign);
    if (memcmp(literal, "a", 1)) { literal[0] = 'b'; }
    odd = atoi("3") + (long)strtol("3", 0, 10) + system("true") + rand() + (long)time(NULL) + (getenv("A") != NULL);
    free(malloc(3));
    printf("%d" "\x41g", TWICE(octal) + odd + address + mix.whole + fixed + *cast_away + (null == 0) + (int)*other);
    return real + 1.0;
}

void leave(FILE *file, int *restrict pointer, int sized[static 2])
{
    jmp_buf place;
    int     n = *pointer;
    int     variable[n];

    variable[0] = sized[0];
    if (setjmp(place) == 0) { longjmp(place, 1); }
    for (int i = 0; i < 3; i++) { i = i + n; }
    if (n) { abort(); }
    *file = *file;
    file = fopen("a", "r");
    sized = &variable[0];
    do n--; while (n);
    exit(EXIT_SUCCESS);
    n = 1;
    undeclared_before_use(n);
}

int undeclared_before_use(int a) { return jumps(a, PASTE(0, 1)) + hidden + (int)sizeof(TEXT(a)); }
