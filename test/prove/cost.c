/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * Prints name, least and most instructions of functions whose headers name a count. Each is called through a function
 * that is not inlined; what an empty one takes is subtracted. Arguments of many sizes, NaN and Inf among them.
 */

#include <float.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>

#include "board.h"
#include "penode/pen_fold.h"
#include "penode/pen_math.h"
#include "penode/pen_net16.h"
#include "penode/pen_selftest.h"
#include "penode/pen_solve.h"
#include "penode/pen_status.h"

#define NOINLINE __attribute__((noinline))
#define WEIGHTS  (32U + (2U * 272U) + 17U)
#define PIECES   128U

static const pen_real_t argument[] = { 0.0F, 0.3F, -0.3F, 0.7F, -3.0F, 30.0F, -200.0F, FLT_MAX, 1e-40F, INFINITY, NAN };
#define ARGUMENTS (sizeof(argument) / sizeof(argument[0]))

static pen_real_t weight[WEIGHTS];
static pen_real_t a[PEN_SOLVE_MAX * PEN_SOLVE_MAX];
static pen_real_t b[PEN_SOLVE_MAX];
static pen_piece_t piece[PIECES];
static pen_status_log_t status_log;
static volatile pen_real_t sink;

NOINLINE static pen_real_t nothing(pen_real_t x)
{
    return x;
}
NOINLINE static pen_real_t exp_of(pen_real_t x)
{
    return pen_exp(x);
}
NOINLINE static pen_real_t tanh_of(pen_real_t x)
{
    return pen_tanh(x);
}
NOINLINE static pen_real_t sigmoid_of(pen_real_t x)
{
    return pen_sigmoid(x);
}
NOINLINE static pen_real_t softplus_of(pen_real_t x)
{
    return pen_softplus(x);
}
NOINLINE static pen_real_t net(pen_real_t x)
{
    return pen_net16(2U, weight, x);
}
NOINLINE static pen_real_t find96(pen_real_t x)
{
    return pen_fold_find(96U, piece, x)->start;
}
NOINLINE static pen_real_t find128(pen_real_t x)
{
    return pen_fold_find(128U, piece, x)->start;
}

NOINLINE static pen_real_t slope(pen_real_t x)
{
    pen_real_t change;
    const pen_real_t y = pen_net16_slope(2U, weight, x, &change);

    return y + change;
}

NOINLINE static pen_real_t solve(size_t n, pen_real_t x)
{
    b[0] = x;
    return (pen_real_t)pen_solve(n, a, b);
}

NOINLINE static pen_real_t solve2(pen_real_t x)
{
    b[0] = x;
    return (pen_real_t)pen_solve2(a, b);
}

NOINLINE static pen_real_t solve_2(pen_real_t x)
{
    return solve(2U, x);
}
NOINLINE static pen_real_t solve_4(pen_real_t x)
{
    return solve(4U, x);
}
NOINLINE static pen_real_t solve_8(pen_real_t x)
{
    return solve(8U, x);
}
NOINLINE static pen_real_t solve_16(pen_real_t x)
{
    return solve(16U, x);
}

NOINLINE static pen_real_t note(pen_real_t x)
{
    pen_status_note_step(&status_log, (x > 0.0F) ? ((UINT32_C(1) << PEN_STATUS_STEP) - 1U) : PEN_OK);
    return x;
}

NOINLINE static pen_real_t test(pen_real_t x)
{
    return x + (pen_real_t)pen_selftest();
}

static const struct {
    const char *name;
    pen_real_t (*call)(pen_real_t);
} measured[] = {
    { "pen_exp", exp_of },      { "pen_tanh", tanh_of },          { "pen_sigmoid", sigmoid_of },  { "pen_softplus", softplus_of },
    { "pen_net16", net },       { "pen_net16_slope", slope },     { "pen_fold_find_96", find96 }, { "pen_fold_find_128", find128 },
    { "pen_solve_2", solve_2 }, { "pen_solve_4", solve_4 },       { "pen_solve_8", solve_8 },     { "pen_solve_16", solve_16 },
    { "pen_solve2", solve2 },   { "pen_status_note_step", note }, { "pen_selftest", test },
};

static uint32_t cost(pen_real_t (*call)(pen_real_t), pen_real_t x)
{
    for (size_t i = 0U; i < (PEN_SOLVE_MAX * PEN_SOLVE_MAX); i++) {
        a[i] = (pen_real_t)((i * 7U) % 11U) - 4.0F;
    }
    for (size_t i = 0U; i < PEN_SOLVE_MAX; i++) {
        b[i] = (pen_real_t)i;
    }
    board_count_start();
    sink = call(x);
    return board_count_stop();
}

int main(void)
{
    for (size_t i = 0U; i < WEIGHTS; i++) {
        weight[i] = ((pen_real_t)((i * 13U) % 29U) / 29.0F) - 0.5F;
    }
    for (size_t i = 0U; i < PIECES; i++) {
        piece[i].start = ((pen_real_t)i / 16.0F) - 4.0F;
    }
    for (size_t k = 0U; k < (sizeof(measured) / sizeof(measured[0])); k++) {
        uint32_t least = UINT32_MAX;
        uint32_t most = 0U;
        for (size_t i = 0U; i < ARGUMENTS; i++) {
            const uint32_t n = cost(measured[k].call, argument[i]) - cost(nothing, argument[i]);
            least = (n < least) ? n : least;
            most = (n > most) ? n : most;
        }
        board_print(measured[k].name);
        board_print(" ");
        board_print_number(least);
        board_print(" ");
        board_print_number(most);
        board_print("\n");
    }
    return 0;
}
