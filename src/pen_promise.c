/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "penode/pen_exact.h"

#include "penode/pen_promise.h"

#include "penode/pen_net.h"

#define ZERO  ((pen_real_t)0)
#define HALF  ((pen_real_t)0.5F)
#define ONE   ((pen_real_t)1)
#define TWO   ((pen_real_t)2)
#define FOUR  ((pen_real_t)4)
#define EIGHT ((pen_real_t)8)
#define ALONG (~PEN_PROMISE_ZERO_AT_ZERO)                 /* what is promised all along the line */
#define TINY  (PEN_REAL_MIN * PEN_REAL_EPSILON)           /* the smallest number: twice what underflow may lose */
#define UP    (ONE + (FOUR * PEN_REAL_EPSILON))           /* for 8 roundings */
#define DOWN  (ONE - (EIGHT * PEN_REAL_EPSILON))

/* Where the cell ends: before its length, rounding included; at the edge if nothing ends it before. */
static pen_real_t end_of(const pen_cell_t *part, pen_real_t edge)
{
    const pen_real_t step = (part->length * DOWN) - (PEN_REAL_EPSILON * pen_port_abs(part->x));
    const pen_real_t next = part->x + (part->way * step);
    const bool ends = (part->length < PEN_REAL_MAX) && ((part->way * next) < (part->way * edge));

    return ends ? next : edge;
}

/* Which promises about slopes may be broken on the cell. */
static uint32_t steep(const pen_promise_t *promise, const pen_cell_t *part)
{
    const bool bounded = (part->most <= promise->max_slope) && (-part->least <= promise->max_slope);
    uint32_t broken = (part->least >= ZERO) ? 0U : PEN_PROMISE_INCREASING;

    broken |= (part->most <= ZERO) ? 0U : PEN_PROMISE_DECREASING;
    broken |= bounded ? 0U : PEN_PROMISE_MAX_SLOPE;
    return broken;
}

/*
 * How far the network may be from the straight line between the ends of a cell, rounded up: its slopes lie apart by
 * most - least, so it is off the line by that times the distance to the nearer end at most.
 */
static pen_real_t bulge_of(const pen_cell_t *part, pen_real_t distance)
{
    return (part->open == 0U) ? ZERO : (UP * ((HALF * (part->most - part->least)) * distance));
}

/* Is a force within its limit at x, and on the cells before and behind? An error is 0 or above EPS |value|, so twice the
 * error covers the rounding of adding it, too. */
static bool weak(const pen_promise_t *promise, const pen_cell_t *part, pen_real_t bulge)
{
    const pen_real_t most = pen_port_abs(part->value) + (TWO * part->error) + bulge;

    return (((bulge > ZERO) ? (UP * most) : most) <= promise->max_force);
}

/* May the force push along at x or behind? *low: below way * F(x); below that of the end of the cell afterwards; *bulge that
 * of the cell before, then of this one, where it counts. */
static uint32_t driving(const pen_promise_t *promise, const pen_cell_t *part, pen_real_t distance, bool endless, pen_real_t *low,
                        pen_real_t *bulge)
{
    const pen_real_t least = (part->way * part->value) - (TWO * part->error);
    const pen_real_t here = (least > *low) ? least : *low;
    const pen_real_t product = part->least * distance;
    const pen_real_t gain = (product - ((FOUR * PEN_REAL_EPSILON) * pen_port_abs(product))) - ((part->least < ZERO) ? TINY : ZERO);
    const pen_real_t sum = (here + gain) - ((TWO * PEN_REAL_EPSILON) * (pen_port_abs(here) + pen_port_abs(gain)));
    const pen_real_t there = ((gain >= ZERO) && (sum < here)) ? here : sum;
    const bool above = (part->least >= ZERO) || (!endless && (there >= -promise->band)); /* all along the cell */
    const pen_real_t ahead = above ? ZERO : bulge_of(part, distance);
    const pen_real_t largest = (ahead > *bulge) ? ahead : *bulge;
    const pen_real_t reserve = (largest > ZERO) ? (UP * (largest + (PEN_REAL_EPSILON * pen_port_abs(here)))) : ZERO;
    const bool kept = ((here - reserve) >= -promise->band) && ((part->least >= ZERO) || !endless);

    *low = there;
    *bulge = ahead;
    return kept ? 0U : PEN_PROMISE_DISSIPATIVE;
}

/* What is known of the cells before. */
typedef struct {
    pen_real_t low;     /* below way * F at the start of the next */
    pen_real_t pushing; /* bulges of the last cell, for each of two promises */
    pen_real_t bulge;
} past_t;

/* Which promises may be broken on a cell that ends at `next`? */
static uint32_t judge(const pen_promise_t *promise, const pen_cell_t *part, pen_real_t next, past_t *past)
{
    const pen_real_t distance = pen_port_abs(next - part->x);
    const bool endless = (pen_port_abs(next) >= PEN_REAL_MAX);
    const bool at_edge = !(distance > ZERO); /* from here on constant */
    const bool flat = (part->least >= ZERO) && (part->most <= ZERO);
    const pen_real_t bulge = bulge_of(part, endless ? ZERO : distance);
    const bool bounded = weak(promise, part, (bulge > past->bulge) ? bulge : past->bulge) && (flat || !endless);
    uint32_t broken = bounded ? 0U : PEN_PROMISE_MAX_FORCE;

    broken |= driving(promise, part, distance, endless, &past->low, &past->pushing);
    broken |= at_edge ? 0U : steep(promise, part);
    past->bulge = bulge;
    return broken & promise->kinds;
}

/* One side of the start, cell by cell. *looks counts down. Which promises may be broken, and *at which place? */
static uint32_t travel(const pen_line_t *line, const pen_promise_t *promise, pen_real_t start, pen_real_t way, pen_real_t edge,
                       uint32_t *looks, pen_real_t *at)
{
    past_t past = { -PEN_REAL_MAX, ZERO, ZERO };
    pen_real_t x = start;
    uint32_t broken = 0U;
    bool more = true;

    while (more && (broken == 0U) && (*looks > 0U)) {
        pen_cell_t part;
        pen_real_t next;
        uint32_t taken;
        pen_cell(line, x, way, &part);
        taken = ((part.open > 0U) && (part.open <= PEN_CELL_OPEN)) ? (1U + (((uint32_t)1U << part.open) / 2U)) : 1U;
        next = end_of(&part, edge);
        broken = judge(promise, &part, next, &past);
        *at = x;
        more = (pen_port_abs(next) < PEN_REAL_MAX) && (pen_port_abs(next - x) > ZERO);
        *looks -= (*looks < taken) ? *looks : taken;
        x = next;
    }
    return (more && (broken == 0U)) ? (promise->kinds & ALONG) : broken;
}

/* The layers as the step evaluates them, to the bit. */
static pen_real_t evaluate(const pen_line_t *line, pen_real_t x)
{
    const pen_real_t *p = line->p;
    pen_real_t *h = &line->work[0];
    pen_real_t *y = &line->work[line->chain->width];
    bool relu = false; /* the activation of the layer before is still to be applied */

    h[0] = x;
    for (size_t i = 0U; i < line->chain->layers; i++) {
        const pen_layer_t *const layer = &line->chain->layer[i];
        pen_real_t *const before = h;
        if (relu && ((layer->kind == PEN_LAYER_CENTRE) || (layer->kind == PEN_LAYER_RESCALE))) {
            pen_act_relu(layer->n_in, h);
        }
        if (layer->kind == PEN_LAYER_CENTRE) {
            pen_centre(layer->n_out, p, h, h);
            p = &p[2U * layer->n_out];
        } else if (layer->kind == PEN_LAYER_RESCALE) {
            pen_rescale(layer->n_out, p, h, h);
            p = &p[2U * layer->n_out];
        } else {
            if (relu) {
                pen_dense_relu(layer->n_out, layer->n_in, p, h, y);
            } else {
                pen_dense(layer->n_out, layer->n_in, p, h, y);
            }
            p = &p[layer->n_out * (layer->n_in + 1U)];
            h = y;
            y = before;
        }
        relu = (layer->kind == PEN_LAYER_RELU);
    }
    if (relu) {
        pen_act_relu(1U, h);
    }
    return h[0];
}

bool pen_promise_kept(const pen_promise_t *promise, const pen_chain_t *chain, const pen_real_t p[], bool clamp, size_t capacity,
                      const pen_piece_t piece[], pen_real_t work[], bool active[], pen_breach_t *breach)
{
    const pen_line_t line = { chain, &p[2], work, active };
    const pen_real_t lowest = clamp ? p[0] : -PEN_REAL_MAX;
    const pen_real_t highest = clamp ? p[1] : PEN_REAL_MAX;
    const pen_real_t raised = (lowest > ZERO) ? lowest : ZERO;
    const pen_real_t start = (highest < raised) ? highest : raised; /* what the network sees at 0 */
    uint32_t looks = promise->looks;
    uint32_t broken = 0U;
    pen_real_t at = ZERO;

    if ((promise->kinds & PEN_PROMISE_ZERO_AT_ZERO) != 0U) {
        pen_status_t status = PEN_OK;
        const pen_real_t zero = (piece != NULL) ? pen_fold_value(piece, pen_fold_find(capacity, piece, ZERO), ZERO, &status)
                                                : evaluate(&line, start);
        broken = (pen_port_abs(zero) <= ZERO) ? 0U : PEN_PROMISE_ZERO_AT_ZERO;
    }
    if ((broken == 0U) && ((promise->kinds & ALONG) != 0U)) {
        broken = travel(&line, promise, start, ONE, highest, &looks, &at);
    }
    if ((broken == 0U) && ((promise->kinds & ALONG) != 0U)) {
        broken = travel(&line, promise, start, -ONE, lowest, &looks, &at);
    }
    if (broken != 0U) {
        breach->kind = broken;
        breach->at = at;
    }
    return (broken == 0U);
}
