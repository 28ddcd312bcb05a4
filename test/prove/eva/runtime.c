/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * For Frama-C: the functions of the runtime that a generated model may call, with any numbers in any array. Each array
 * ends where its function may still look; sizes are those at which the kernels change their way, and the limits.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "__fc_builtin.h"

#include "penode/pen_ekf.h"
#include "penode/pen_elementary.h"
#include "penode/pen_fold.h"
#include "penode/pen_math.h"
#include "penode/pen_monitor.h"
#include "penode/pen_net.h"
#include "penode/pen_net16.h"
#include "penode/pen_selftest.h"
#include "penode/pen_serial.h"
#include "penode/pen_set.h"
#include "penode/pen_solve.h"

extern volatile uint32_t any; /* each read gives any number */

#define WIDE 37U /* two blocks of 16 rows, one of 4, one row */
#define ROOM (WIDE * (WIDE + 1U))

static pen_real_t w[ROOM];
static pen_real_t x[WIDE];
static pen_real_t t[WIDE];
static pen_real_t y[WIDE];
static pen_real_t s[WIDE];
volatile pen_real_t seen; /* results go here: nothing is left out */

static void fill(void *at, size_t bytes)
{
    Frama_C_make_unknown((char *)at, bytes);
}

static void fill_all(void)
{
    fill(w, sizeof w);
    fill(x, sizeof x);
    fill(t, sizeof t);
    fill(y, sizeof y);
    fill(s, sizeof s);
}

/* The last n numbers of w, and of the others. */
#define W(n)          (&w[ROOM - (n)])
#define END(array, n) (&array[WIDE - (n)])

static void layers(size_t n_out, size_t n_in)
{
    const size_t n = n_out * (n_in + 1U);

    fill_all();
    pen_dense(n_out, n_in, W(n), END(x, n_in), END(y, n_out));
    pen_dense_relu(n_out, n_in, W(n), END(x, n_in), END(y, n_out));
    pen_dense_tangent(n_out, n_in, W(n), END(t, n_in), END(s, n_out));
    pen_dense_dual(n_out, n_in, W(n), END(x, n_in), END(t, n_in), END(y, n_out), END(s, n_out));
    seen = pen_dense1(n_in, W(n_in + 1U), END(x, n_in));
    seen = pen_dense1_relu(n_in, W(n_in + 1U), END(x, n_in));
}

void all_layers(void)
{
    static const size_t rows[] = { 1U, 3U, 4U, 5U, 15U, 16U, 17U, 32U, WIDE };

    for (size_t i = 0U; i < (sizeof rows / sizeof rows[0]); i++) {
        layers(rows[i], 1U);
        layers(rows[i], WIDE);
    }
}

/* Any but NaN: Frama-C 25 thinks that NaN > 0 may hold. nan.c tries every NaN instead. */
static pen_real_t number(void)
{
    pen_real_t value = (pen_real_t)0;
    pen_real_t bits;

    fill(&bits, sizeof bits);
    if (bits == bits) {
        value = bits;
    }
    return value;
}

static void smooth(void)
{
    const size_t n = 4U;
    pen_real_t h[5][4];

    fill_all();
    for (size_t k = 0U; k < 5U; k++) {
        for (size_t i = 0U; i < n; i++) {
            h[k][i] = number();
        }
    }
    pen_act_tanh(n, h[0]);
    pen_act_sigmoid(n, h[1]);
    pen_act_softplus(n, h[2]);
    pen_slope_softplus(n, h[3], END(t, n));
    pen_second_softplus(n, h[4], END(t, n), END(y, n), END(s, n));
    seen = pen_exp(number());
    seen = pen_tanh(number());
    seen = pen_sigmoid(number());
    seen = pen_softplus(number());
}

void elements(void)
{
    const size_t n = 5U;

    smooth();
    fill_all();
    pen_act_relu(n, END(x, n));
    pen_act_step(n, END(x, n));
    pen_slope_relu(n, END(x, n), END(t, n));
    pen_slope_tanh(n, END(x, n), END(t, n));
    pen_slope_sigmoid(n, END(x, n), END(t, n));
    pen_slope_step(n, END(x, n), END(t, n));
    pen_second_tanh(n, END(x, n), END(t, n), END(y, n), END(s, n));
    pen_second_sigmoid(n, END(x, n), END(t, n), END(y, n), END(s, n));
    fill_all();
    pen_centre(n, W(2U * n), END(x, n), END(y, n));
    pen_rescale(n, W(2U * n), END(x, n), END(y, n));
    pen_centre_tangent(n, W(2U * n), END(t, n));
    pen_rescale_tangent(n, W(2U * n), END(t, n));
    pen_clamp(n, W(2U * n), END(x, n), END(y, n));
    seen = (pen_real_t)pen_outside(n, W(2U * n), END(x, n));
    seen = pen_fade(n, W(2U * n), s[0], END(x, n));
    for (size_t i = 0U; i < n; i++) {
        seen = pen_clamp_slope(n, W(2U * n), END(x, n), i);
        seen = pen_fade_slope(n, W(2U * n), s[0], END(x, n), i);
    }
    seen = pen_finite(n, END(x, n)) ? x[0] : y[0];
    seen = pen_max(x[0], x[1]);
    seen = pen_min(x[0], x[1]);
    seen = pen_sign(x[0]);
    seen = pen_heaviside(x[0]);
    seen = pen_where(x[0] > x[1], x[0], x[1]);
    seen = (pen_real_t)pen_port_cycles();
}

#define BEYOND (3.4028235e38F * 2.0F) /* infinity */

static void sines(pen_real_t x)
{
    seen = pen_sin(x);
    seen = pen_cos(x);
}

/* Those that a program links only if a model calls them. Eva does not relate an argument to whether it is in range: one range
 * after the other. 8192.001 is the float above 8192. */
void elementary(void)
{
    sines((pen_real_t)Frama_C_float_interval(-8192.0F, 8192.0F));
    sines((pen_real_t)Frama_C_float_interval(8192.001F, 3.4028235e38F));
    sines((pen_real_t)Frama_C_float_interval(-3.4028235e38F, -8192.001F));
    sines(BEYOND);
    sines(-BEYOND);
    seen = pen_atan(number());
    seen = pen_log(number());
    seen = pen_sqrt(number());
}

/* Also for the kernels of a size build. */
void networks_of_16(void)
{
    for (size_t hidden = 1U; hidden <= 4U; hidden++) {
        const size_t n = 32U + (272U * hidden) + 17U;
        fill_all();
        seen = pen_net16(hidden, W(n), x[0]);
        seen = pen_net16_slope(hidden, W(n), x[0], END(s, 1U));
    }
}

void systems(void)
{
    for (size_t n = 0U; n <= 4U; n++) {
        fill_all();
        seen = (pen_real_t)pen_solve(n, W(n * n), END(x, n));
    }
    fill_all();
    seen = (pen_real_t)pen_solve(any, NULL, x);
    seen = (pen_real_t)pen_solve(any, w, NULL);
    seen = (pen_real_t)pen_solve(PEN_SOLVE_MAX, W(PEN_SOLVE_MAX * PEN_SOLVE_MAX), END(x, PEN_SOLVE_MAX));
    seen = (pen_real_t)pen_solve(PEN_SOLVE_MAX + 1U, w, x);
    seen = (pen_real_t)pen_solve2(W(4U), END(x, 2U));
}

/* Rooms that the pieces need not fit in, with and without a layer that has kinks. */
void folding(void)
{
    static const pen_layer_t layer[] = {
        { PEN_LAYER_CENTRE, 1U, 1U }, { PEN_LAYER_RELU, 1U, 4U },    { PEN_LAYER_RELU, 4U, 3U },
        { PEN_LAYER_DENSE, 3U, 1U },  { PEN_LAYER_RESCALE, 1U, 1U },
    };
    static const pen_chain_t kinked = { layer, 5U, 4U, 7U };
    static const pen_chain_t straight = { layer, 1U, 1U, 0U };
    static const size_t room[] = { 4U, 6U, 8U, 12U };
    static pen_real_t line[16];
    static bool active[7];
    static pen_piece_t piece[12];
    pen_status_t status = any;

    fill_all();
    seen = (pen_real_t)pen_fold(&kinked, W(2U + 2U + 8U + 15U + 4U + 2U), (any != 0U), line, active, 12U, piece);
    seen = (pen_real_t)pen_fold(&straight, W(2U + 2U), (any != 0U), &line[12], active, 4U, &piece[8]);
    fill(piece, sizeof piece);
    for (size_t i = 0U; i < (sizeof room / sizeof room[0]); i++) {
        const pen_piece_t *const first = &piece[12U - room[i]];
        seen = pen_fold_value(first, pen_fold_find(room[i], first, x[0]), x[0], &status);
    }
}

void sets(void)
{
    pen_tuning_t tuning;
    pen_set_t set;

    fill_all();
    fill(&tuning, sizeof tuning);
    fill(&set.head, sizeof set.head);
    set.value = (any == 0U) ? NULL : x;
    seen = (pen_real_t)pen_tuning_init(NULL, any, WIDE, &set, t, y);
    seen = (pen_real_t)pen_tuning_init(&tuning, any, WIDE, NULL, t, y);
    seen = (pen_real_t)pen_tuning_init(&tuning, any, WIDE, &set, (any == 0U) ? NULL : t, (any == 0U) ? NULL : y);
}

void serial(void)
{
    static uint8_t byte[PEN_SERIAL_HEAD];
    pen_set_head_t head;
    pen_status_report_t report;

    fill(byte, sizeof byte);
    fill(&head, sizeof head);
    fill(&report, sizeof report);
    seen = (pen_real_t)pen_serial_read(byte, &head);
    pen_serial_write(&head, byte);
    seen = (pen_real_t)pen_serial_read(byte, &head);
    fill_all();
    for (size_t n = 0U; n <= (4U * sizeof(pen_real_t)); n++) {
        pen_serial_put_bytes(W(4U), (4U * sizeof(pen_real_t)) - n, n, &byte[PEN_SERIAL_HEAD - n]);
        pen_serial_get_bytes(W(4U), (4U * sizeof(pen_real_t)) - n, n, &byte[PEN_SERIAL_HEAD - n]);
        seen = (pen_real_t)pen_crc_bytes(any, n, &byte[PEN_SERIAL_HEAD - n]);
    }
    {
        const uint32_t n = (uint32_t)any % (uint32_t)(sizeof x + 1U);
        const uint8_t *const bytes = (const uint8_t *)y;
        pen_serial_get_bytes(x, 0U, n, bytes);
        pen_serial_put_bytes(x, 0U, n, (uint8_t *)t);
    }
    seen = (pen_real_t)pen_crc_word(pen_crc_values(any, WIDE, x), any);
    seen = (pen_real_t)pen_status_times(&report, any);
}

#define STATES  3U
#define SOURCES 2U
#define TESTS   2U

/* Any numbers in a filter of fixed sizes, damaged verdicts among them; each array ends where its function may still look. */
void filters(void)
{
    static pen_real_t table[6][STATES];
    static pen_real_t limit[TESTS * STATES];
    static pen_real_t f[2U * STATES * STATES];
    static pen_real_t state[2U * STATES];
    static pen_real_t phi[STATES * STATES];
    static pen_real_t gamma[STATES * SOURCES];
    static pen_real_t work[(STATES + 2U) * (STATES + SOURCES)];
    static pen_ekf_test_t test[2U * TESTS];
    static uint32_t count[TESTS * PEN_EKF_VERDICTS];
    static pen_ekf_t self;
    const pen_ekf_model_t model = { 1U,       STATES,   SOURCES, TESTS,    TESTS,    table[0],      table[1], END(x, SOURCES),
                                    table[2], table[3], limit,   table[4], table[5], END(s, STATES) };

    fill_all();
    fill(table, sizeof table);
    fill(limit, sizeof limit);
    fill(f, sizeof f);
    fill(state, sizeof state);
    fill(phi, sizeof phi);
    fill(gamma, sizeof gamma);
    fill(work, sizeof work);
    fill(test, sizeof test);
    fill(&self, sizeof self);
    pen_ekf_predict(&model, phi, gamma, t[0], f, &f[STATES * STATES], work);
    for (size_t i = 0U; i < TESTS; i++) {
        const bool offered = (any & 1U) != 0U;
        seen = (pen_real_t)pen_ekf_update(&model, i, END(y, STATES), t[1], offered, f, state,
                                          &work[((STATES + 2U) * (STATES + SOURCES)) - (2U * STATES)], &test[i]);
    }
    fill(test, sizeof test);
    seen = (pen_real_t)pen_ekf_limit(&model, f, state, &work[((STATES + 2U) * (STATES + SOURCES)) - (2U * STATES)]);
    seen = (pen_real_t)pen_ekf_finish(&model, &self, any, f, state, test, count);
    fill(f, sizeof f);
    for (size_t j = 0U; j < STATES; j++) {
        f[(j * STATES) + j] = number();
    }
    pen_ekf_start(&model, &self, f, count);
    seen = pen_ekf_deviation(STATES, f, END(y, STATES));
}

#define CAUSES 2U

/* Any numbers in a monitor of fixed sizes, damaged verdicts and tests among them. */
void monitors(void)
{
    static pen_real_t phi[STATES * STATES];
    static pen_real_t row[2U * TESTS * STATES];
    static pen_real_t direct[CAUSES * TESTS];
    static pen_real_t sensed[2U * CAUSES * STATES];
    static pen_real_t effect[2U * CAUSES * STATES];
    static pen_ekf_test_t test[TESTS];
    static pen_monitor_test_t sum[CAUSES + 1U];
    static pen_monitor_t self;
    const pen_monitor_model_t model = { 1U, STATES, TESTS, CAUSES, number(), number(), number(), number() };
    const pen_monitor_sample_t sample = { phi, row, &row[TESTS * STATES], direct, test, (any & 1U) != 0U };

    fill(phi, sizeof phi);
    fill(row, sizeof row);
    fill(direct, sizeof direct);
    fill(sensed, sizeof sensed);
    fill(effect, sizeof effect);
    fill(test, sizeof test);
    fill(sum, sizeof sum);
    fill(&self, sizeof self);
    seen = (pen_real_t)pen_monitor_step(&model, &self, &sample, sensed, effect, sum);
    pen_monitor_start(&model, &self, sensed, effect, sum);
    seen = (pen_real_t)pen_monitor_step(&model, &self, &sample, sensed, effect, sum);
}

void selftest(void)
{
    seen = (pen_real_t)pen_selftest_of(any);
    fill_all();
    seen = (pen_real_t)pen_selftest_hash(any, WIDE, x);
}

void runtime(void)
{
    all_layers();
    elements();
    elementary();
    networks_of_16();
    systems();
    filters();
    monitors();
    folding();
    sets();
    serial();
    selftest();
}
