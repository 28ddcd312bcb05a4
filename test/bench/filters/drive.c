/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* Prints of a filter: least and most instructions of a step, bytes of stack and struct, then state and variances as bits. */

#include "board.h"

#include "rival.h"

#define SAMPLES 400U
#define PAINTED 8U /* samples whose stack is measured: painting is slow */

static costly_t plant;
static uint32_t noise = 1U;

static float next(void)
{
    noise = (noise * UINT32_C(1664525)) + UINT32_C(1013904223);
    return ((float)(noise >> 8U) * 0x1p-23F) - 1.0F;
}

static void line(const char *name, uint32_t value)
{
    board_print(name);
    board_print(" ");
    board_print_number(value);
    board_print("\n");
}

static uint32_t bits(float value)
{
    union {
        float value;
        uint32_t bits;
    } both = { value };

    return both.bits;
}

int main(void)
{
    float road = 0.0F;
    uint32_t least = UINT32_MAX;
    uint32_t most = 0U;
    uint32_t stack = 0U;

    (void)costly_init(&plant, &SET, NULL);
    rival_init();
    for (uint32_t sample = 0U; sample < SAMPLES; sample++) {
        costly_y_t y;
        costly_z_t seen;
        costly_u_t u;
        costly_ekf_z_t z;
        uint32_t n;
        road += 1e-4F * next();
        u.z_road = road;
        (void)costly_step(&plant, &u, &y);
        (void)costly_sensors(&plant, &seen);
        z.a_body = seen.a_body + (0.01F * next());
        z.a_wheel = seen.a_wheel + (0.05F * next());
        if (sample < PAINTED) {
            board_stack_paint();
            rival_step(&u, &z);
            n = board_stack_used();
            stack = (n > stack) ? n : stack;
        } else {
            board_count_start();
            rival_step(&u, &z);
            n = board_count_stop();
            least = (n < least) ? n : least;
            most = (n > most) ? n : most;
        }
    }
    line("least", least);
    line("most", most);
    line("stack", stack);
    line("bytes", rival_bytes());
    for (size_t i = 0U; i < N; i++) {
        line("state", bits(rival_state(i)));
        line("variance", bits(rival_variance(i)));
    }
    return 0;
}
