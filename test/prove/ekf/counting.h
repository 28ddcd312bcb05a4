/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* What the programs that count instructions of filter and monitor share: the same noise at each run, and a line of their output. */
#ifndef EKF_COUNTING_H
#define EKF_COUNTING_H

#include <stdint.h>

#include "board.h"
#include "penode/pen_real.h"

static uint32_t noise = 1U;

/* From -1 to 1, by the generator of Numerical Recipes. */
static pen_real_t next(void)
{
    noise = (noise * UINT32_C(1664525)) + UINT32_C(1013904223);
    return ((pen_real_t)(noise >> 8U) * (pen_real_t)0x1p-23) - (pen_real_t)1;
}

static void line(const char *name, uint32_t least, uint32_t most)
{
    board_print(name);
    board_print(" ");
    board_print_number(least);
    board_print(" ");
    board_print_number(most);
    board_print("\n");
}

#endif
