/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * For Frama-C: the check of promises and the ring of a trial, with any numbers in sets, promises and rings. Each array ends
 * where its function may still look.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "__fc_builtin.h"

#include "penode/pen_promise.h"
#include "penode/pen_trial.h"

extern volatile uint32_t any; /* each read gives any number */

#define WIDTH   21U /* blocks of 16, 4 and 1 rows; more neurons than are tried on and off */
#define NEURONS 21U
#define BENT    3U /* neurons of a network that ends in one */

volatile pen_real_t seen; /* results go here: nothing is left out */

static const pen_layer_t layer[] = {
    { PEN_LAYER_CENTRE, 1U, 1U },
    { PEN_LAYER_RELU, 1U, WIDTH },
    { PEN_LAYER_DENSE, WIDTH, 1U },
    { PEN_LAYER_RESCALE, 1U, 1U },
};
static const pen_layer_t bent[] = {
    { PEN_LAYER_RELU, 1U, 1U },   { PEN_LAYER_RESCALE, 1U, 1U }, { PEN_LAYER_RELU, 1U, 1U },
    { PEN_LAYER_CENTRE, 1U, 1U }, { PEN_LAYER_RELU, 1U, 1U },
};

static void fill(void *at, size_t bytes)
{
    Frama_C_make_unknown((char *)at, bytes);
}

static void check(const pen_chain_t *chain, const pen_real_t p[], pen_real_t work[], bool active[])
{
    pen_piece_t piece[4];
    pen_promise_t promise;
    pen_breach_t breach;

    fill(piece, sizeof piece);
    fill(&promise, sizeof promise);
    seen = (pen_real_t)pen_promise_kept(&promise, chain, p, (any != 0U), 4U, NULL, work, active, &breach);
    seen = (pen_real_t)pen_promise_kept(&promise, chain, p, (any != 0U), 4U, piece, work, active, &breach);
}

void promises(void)
{
    static const pen_chain_t straight = { layer, 4U, WIDTH, NEURONS };
    static const pen_chain_t ends_bent = { bent, 5U, 1U, BENT };
    static pen_real_t p[2U + 2U + (2U * WIDTH) + (WIDTH + 1U) + 2U];
    static pen_real_t q[2U + 2U + 2U + 2U + 2U + 2U];
    static pen_real_t work[8U * WIDTH];
    static bool active[NEURONS];

    fill(p, sizeof p);
    fill(q, sizeof q);
    check(&straight, p, work, active);
    check(&ends_bent, q, &work[8U * (WIDTH - 1U)], &active[NEURONS - BENT]);
}

void trial(void)
{
    pen_trial_t ring;
    pen_trial_span_t span;

    fill(&ring, sizeof ring);
    pen_trial_keep(&ring, (any != 0U));
    pen_trial_close(&ring, any, &span);
    seen = (pen_real_t)(span.last - span.first);
    pen_trial_open(&ring);
}
