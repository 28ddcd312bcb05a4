/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * drive INPUTS RECORD [ROUNDS]: steps through the inputs of a file, ROUNDS times (1), and records the last round. It is
 * our own step if options select a model as for sample.h, else a peer's.
 *
 * record  the state after each step; then words: most stack of a step [bytes], fewest and most instructions of a step
 */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "board.h"

#define STEPS   2048U
#define PAINTED 4U /* steps whose stack is measured: painting is slow */

#ifdef MODEL_HEADER
#include MODEL_HEADER
#define N_X MODEL_SIZE(N_X)
#define N_U MODEL_SIZE(N_U)
static const pen_set_t *const sets[] = { MODEL_SETS };
static MODEL(t) model;
#else
#define N_X 4U
#define N_U 1U
typedef float pen_real_t;
void peer_step(float x[N_X], float before, float now);
static float state[N_X];
#endif

static pen_real_t u[STEPS + 1U][N_U]; /* the first one is before the first step */
static pen_real_t x[STEPS][N_X];
static uint32_t least = UINT32_MAX;
static uint32_t most;
static uint32_t stack;

static bool begin(void)
{
#ifdef MODEL_HEADER
    return MODEL(init)(&model, sets[0], NULL) == PEN_OK;
#else
    return true;
#endif
}

/* Nothing but the step between the two counts. */
__attribute__((noinline)) static uint32_t measured(size_t k)
{
#ifdef MODEL_HEADER
    static MODEL(y_t) y;

    board_count_start();
    (void)MODEL(step)(&model, (const MODEL(u_t) *)u[k + 1U], &y);
#else
    board_count_start();
    peer_step(state, u[k][0], u[k + 1U][0]);
#endif
    return board_count_stop();
}

static void look(size_t k)
{
#ifdef MODEL_HEADER
    (void)MODEL(get_state)(&model, (MODEL(x_t) *)x[k]);
#else
    for (size_t i = 0U; i < N_X; i++) {
        x[k][i] = state[i];
    }
#endif
}

static void play(size_t steps)
{
    for (size_t k = 0U; k < steps; k++) {
        const bool paint = (k < PAINTED);
        uint32_t instructions;

        if (paint) {
            board_stack_paint();
        }
        instructions = measured(k);
        look(k);
        if (paint) {
            const uint32_t used = board_stack_used();
            stack = (used > stack) ? used : stack;
        }
        least = (instructions < least) ? instructions : least;
        most = (instructions > most) ? instructions : most;
    }
}

static uint32_t number(const char text[])
{
    uint32_t value = 0U;

    for (size_t k = 0U; (text[k] >= '0') && (text[k] <= '9'); k++) {
        value = (10U * value) + (uint32_t)(text[k] - '0');
    }
    return value;
}

int main(void)
{
    char name[128];
    const int32_t from = board_argument(1U, name, sizeof(name)) ? board_open(name, false) : -1;
    const size_t steps = ((from >= 0) ? board_read(from, u, sizeof(u)) : 0U) / sizeof(u[0]);
    const int32_t to = board_argument(2U, name, sizeof(name)) ? board_open(name, true) : -1;
    const uint32_t rounds = board_argument(3U, name, sizeof(name)) ? number(name) : 1U;
    bool good = (steps > 1U) && (to >= 0) && begin();

    for (uint32_t k = 0U; good && (k < rounds); k++) {
        play(steps - 1U);
    }
    if (good) {
        const uint32_t figures[] = { stack, least, most };
        const uint32_t bytes = (uint32_t)((steps - 1U) * sizeof(x[0]));
        good = (board_write(to, x, bytes) == bytes) && (board_write(to, figures, sizeof(figures)) == sizeof(figures));
        board_close(to);
    }
    return good ? 0 : 1;
}
