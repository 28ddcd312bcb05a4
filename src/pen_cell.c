/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "penode/pen_exact.h"

#include "penode/pen_promise.h"

#define ZERO ((pen_real_t)0)
#define HALF ((pen_real_t)0.5F)
#define ONE  ((pen_real_t)1)
#define TWO  ((pen_real_t)2)
#define TINY (PEN_REAL_MIN * PEN_REAL_EPSILON) /* the smallest number: twice what underflow may lose */

/*
 * k roundings err by at most k EPS/2 / (1 - k EPS/2) of their result (Higham, gamma_k): below 17/32 k EPS for k EPS < 1/9, so
 * for layers of 900 000 inputs in float. Bounds are sums of terms >= 0: computed in k operations they are low by that at most.
 */
#define ROUNDING ((pen_real_t)0.53125F * PEN_REAL_EPSILON)

/* Numbers of a layer: exact ones are within x +- error. */
typedef struct {
    pen_real_t *x;
    pen_real_t *error;
} row_t;

/* A bound that was computed in a sum of k terms, made safe. What is known to be exact stays so. */
static pen_real_t safe(bool exact, pen_real_t bound, size_t k)
{
    const pen_real_t terms = (pen_real_t)k;

    return exact ? ZERO : ((bound * (ONE + (ROUNDING * (terms + (pen_real_t)12)))) + (TINY * (terms + TWO)));
}

static bool is_zero(pen_real_t x, pen_real_t error)
{
    return (pen_port_abs(x) <= ZERO) && (error <= ZERO);
}

/* The least number within x +- error, rounded down. */
static pen_real_t lowest(pen_real_t x, pen_real_t error)
{
    return (x - error) - ((TWO * PEN_REAL_EPSILON) * (pen_port_abs(x) + error));
}

/* The smaller of two numbers; NaN if one is, or infinite. */
static pen_real_t smaller(pen_real_t a, pen_real_t b)
{
    return ((a < b) ? a : b) + (ZERO * a);
}

/* What each of n inputs brings in: its own error, and the rounding of its product and of k sums. Are they all exactly 0? */
static bool burden(size_t n, size_t k, const pen_real_t x[], pen_real_t error[])
{
    const pen_real_t rounding = ROUNDING * (pen_real_t)k;
    bool exact = true;

    for (size_t i = 0U; i < n; i++) {
        const bool zero = is_zero(x[i], error[i]);
        error[i] = zero ? ZERO : (error[i] + (rounding * pen_port_abs(x[i])) + (TWO * TINY));
        exact = exact && zero;
    }
    return exact;
}

/* y = (x - p) q or y = x p + q, in place, in two roundings; for slopes y = x q or y = x p, in one. */
static void scale(const pen_layer_t *layer, const pen_real_t p[], bool slopes, const row_t *h)
{
    const size_t n = layer->n_out;
    const bool centre = (layer->kind == PEN_LAYER_CENTRE);

    for (size_t i = 0U; i < n; i++) {
        const pen_real_t factor = centre ? p[n + i] : p[i];
        const pen_real_t shift = centre ? p[i] : p[n + i];
        const pen_real_t from = (centre && !slopes) ? (h->x[i] - shift) : h->x[i];
        const pen_real_t added = (centre || slopes) ? ZERO : shift;
        const pen_real_t product = from * factor;
        const pen_real_t size = pen_port_abs(product) + pen_port_abs(added);
        const pen_real_t error = (pen_port_abs(factor) * h->error[i]) + (ROUNDING * (TWO * size));
        h->error[i] = safe(is_zero(from, h->error[i]), error, 2U);
        h->x[i] = product + added;
    }
}

/* y = W x + b, for slopes y = W x, with its bounds; those of x are used up. Blocks as in penode/pen_net.h. */
static void dense(const pen_layer_t *layer, const pen_real_t w[], bool slopes, const row_t *h, const row_t *y)
{
    const size_t n_out = layer->n_out;
    const size_t n_in = layer->n_in;
    const size_t k = n_in + 1U;
    const bool exact = burden(n_in, k, h->x, h->error);

    for (size_t row = 0U; row < n_out; row++) {
        const size_t narrow = (row < (n_out - (n_out % 4U))) ? 4U : 1U;
        const size_t stride = (row < (n_out - (n_out % 16U))) ? 16U : narrow;
        const size_t first = row - (row % stride);
        const pen_real_t *const at = &w[(first * k) + (row - first)];
        pen_real_t x = slopes ? ZERO : at[0];
        pen_real_t error = (ROUNDING * (pen_real_t)k) * pen_port_abs(x);
        for (size_t i = 0U; i < n_in; i++) {
            const pen_real_t weight = at[stride * (i + 1U)];
            x += weight * h->x[i];
            error += pen_port_abs(weight) * h->error[i];
        }
        y->x[row] = x;
        y->error[row] = safe(exact, error, k);
    }
}

/* How many values a layer has in a set. */
static size_t values_of(const pen_layer_t *layer)
{
    const bool scales = (layer->kind == PEN_LAYER_CENTRE) || (layer->kind == PEN_LAYER_RESCALE);

    return scales ? (2U * (size_t)layer->n_out) : ((size_t)layer->n_out * ((size_t)layer->n_in + 1U));
}

/* A layer without its activation: from `from` to `to`, or in place. Where does the result stand? */
static const row_t *pass(const pen_layer_t *layer, const pen_real_t p[], bool slopes, const row_t *from, const row_t *to)
{
    const bool scales = (layer->kind == PEN_LAYER_CENTRE) || (layer->kind == PEN_LAYER_RESCALE);

    if (scales) {
        scale(layer, p, slopes, from);
    } else {
        dense(layer, p, slopes, from, to);
    }
    return scales ? from : to;
}

/*
 * One neuron's activation on the cell. Decided is a neuron whose value cannot come to zero within the cell, or that starts on
 * its side of zero or at it and does not go back; the cell ends before any decided neuron can switch. So the cell before a
 * kink ends where the value is as small as its error; below twice its error a neuron is undecided, and the cell goes on
 * until it has three times its error on the other side.
 */
static void rectify(pen_cell_t *part, bool active[], size_t neuron, const row_t *y, const row_t *s, size_t i)
{
    const pen_real_t value = y->x[i];
    const pen_real_t error = y->error[i];
    const pen_real_t spread = s->error[i];
    const pen_real_t rate = part->way * s->x[i];
    const pen_real_t size = pen_port_abs(value);
    const bool positive = (value > ZERO) || (!(value < ZERO) && (rate > ZERO));
    const pen_real_t closing = positive ? (spread - rate) : (spread + rate); /* how fast it comes to zero, at most */
    const bool leaves = (closing <= ZERO) && (size >= error);
    const bool stays = (size > (TWO * error)) && ((size - error) > (closing * part->guard));
    pen_real_t reach = PEN_REAL_MAX;

    if ((leaves || stays) && (size <= PEN_REAL_MAX)) {
        reach = (closing > ZERO) ? ((size - error) / closing) : PEN_REAL_MAX;
        y->x[i] = positive ? value : ZERO;
        y->error[i] = positive ? error : ZERO;
        s->x[i] = positive ? s->x[i] : ZERO;
        s->error[i] = positive ? spread : ZERO;
    } else {
        const pen_real_t low = s->x[i] - spread;
        const pen_real_t high = s->x[i] + spread;
        const pen_real_t least = (low < ZERO) ? low : ZERO;
        const pen_real_t most = (high > ZERO) ? high : ZERO;
        const pen_real_t leaving = pen_port_abs(rate) - spread;
        const pen_real_t to_go = ((pen_real_t)3 * error) - ((rate > ZERO) ? value : -value);
        const pen_real_t end = to_go / leaving;
        reach = (leaving > ZERO) ? ((end > part->guard) ? end : part->guard) : PEN_REAL_MAX;
        y->x[i] = (value > ZERO) ? value : ZERO;
        s->x[i] = HALF * (least + most);
        s->error[i] = safe(false, HALF * (most - least), 4U);
        part->neuron[(part->open < PEN_CELL_OPEN) ? part->open : 0U] = neuron;
        part->open++;
    }
    active[neuron] = positive;
    part->length = (reach < part->length) ? reach : part->length;
}

/* The slope of the network along the pattern, with its bound. */
static const row_t *slope_along(const pen_line_t *line, const row_t *a, const row_t *b)
{
    const pen_real_t *p = line->p;
    const row_t *h = a;
    size_t first = 0U; /* neuron of the layer */

    h->x[0] = ONE;
    h->error[0] = ZERO;
    for (size_t i = 0U; i < line->chain->layers; i++) {
        const pen_layer_t *const layer = &line->chain->layer[i];
        h = pass(layer, p, true, h, (h == a) ? b : a);
        p = &p[values_of(layer)];
        for (size_t n = 0U; (layer->kind == PEN_LAYER_RELU) && (n < layer->n_out); n++) {
            h->x[n] = line->active[first] ? h->x[n] : ZERO;
            h->error[n] = line->active[first] ? h->error[n] : ZERO;
            first++;
        }
    }
    return h;
}

/* All slopes that the undecided neurons of a cell, each on or off, let the network have. */
static void go_through(const pen_line_t *line, const row_t *a, const row_t *b, pen_cell_t *part)
{
    pen_real_t least = PEN_REAL_MAX;
    pen_real_t most = -PEN_REAL_MAX;

    for (uint32_t pattern = 0U; pattern < ((uint32_t)1U << part->open); pattern++) {
        const row_t *slope;
        for (size_t i = 0U; i < part->open; i++) {
            line->active[part->neuron[i]] = (((pattern >> i) & 1U) != 0U);
        }
        slope = slope_along(line, a, b);
        least = smaller(lowest(slope->x[0], slope->error[0]), least);
        most = -smaller(lowest(-slope->x[0], slope->error[0]), -most);
    }
    part->least = least;
    part->most = most;
}

/* The cell that starts at x. */
void pen_cell(const pen_line_t *line, pen_real_t x, pen_real_t way, pen_cell_t *part)
{
    const size_t width = line->chain->width;
    pen_real_t *const work = line->work;
    const row_t value[2] = { { &work[0], &work[width] }, { &work[2U * width], &work[3U * width] } };
    const row_t slope[2] = { { &work[4U * width], &work[5U * width] }, { &work[6U * width], &work[7U * width] } };
    const pen_real_t *p = line->p;
    const row_t *h = &value[0];
    const row_t *t = &slope[0];
    size_t first = 0U; /* neuron of the layer */

    part->x = x;
    part->way = way;
    part->guard = ((pen_real_t)4 * (PEN_REAL_EPSILON * pen_port_abs(x))) + PEN_REAL_MIN;
    part->length = PEN_REAL_MAX;
    part->open = 0U;
    for (size_t i = 0U; i < PEN_CELL_OPEN; i++) {
        part->neuron[i] = 0U;
    }
    h->x[0] = x;
    h->error[0] = ZERO;
    t->x[0] = ONE;
    t->error[0] = ZERO;
    for (size_t i = 0U; i < line->chain->layers; i++) {
        const pen_layer_t *const layer = &line->chain->layer[i];
        h = pass(layer, p, false, h, (h == &value[0]) ? &value[1] : &value[0]);
        t = pass(layer, p, true, t, (t == &slope[0]) ? &slope[1] : &slope[0]);
        p = &p[values_of(layer)];
        for (size_t n = 0U; (layer->kind == PEN_LAYER_RELU) && (n < layer->n_out); n++) {
            rectify(part, line->active, first, h, t, n);
            first++;
        }
    }
    part->value = h->x[0];
    part->error = h->error[0];
    part->least = lowest(t->x[0], t->error[0]);
    part->most = -lowest(-t->x[0], t->error[0]);
    if ((part->open > 0U) && (part->open <= PEN_CELL_OPEN)) {
        go_through(line, &slope[0], &slope[1], part);
    }
}
