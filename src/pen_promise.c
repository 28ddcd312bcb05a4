/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "penode/pen_promise.h"

#include "penode/pen_net.h"

#define ZERO  ((pen_real_t)0)
#define HALF  ((pen_real_t)0.5F)
#define ONE   ((pen_real_t)1)
#define TWO   ((pen_real_t)2)
#define THREE ((pen_real_t)3)
#define FOUR  ((pen_real_t)4)
#define EIGHT ((pen_real_t)8)
#define ALONG (~PEN_PROMISE_ZERO_AT_ZERO)                 /* what is promised all along the line */
#define TINY  (PEN_REAL_MIN * PEN_REAL_EPSILON) /* the smallest number: twice what underflow may lose */

/*
 * k roundings err by at most k EPS/2 / (1 - k EPS/2) of their result (Higham, gamma_k): below 17/32 k EPS for k EPS < 1/9, so
 * for layers of 900 000 inputs in float. Bounds are sums of terms >= 0: computed in k operations they are low by that at most.
 */
#define ROUNDING ((pen_real_t)0.53125F * PEN_REAL_EPSILON)
#define UP       (ONE + (FOUR * PEN_REAL_EPSILON)) /* for 8 roundings */
#define DOWN     (ONE - (EIGHT * PEN_REAL_EPSILON))

/* The network, its values and the work space. */
typedef struct {
    const pen_chain_t *chain;
    const pen_real_t  *p; /* of the first layer */
    pen_real_t        *work;
} network_t;

/* A layer's numbers: exact values are within value +- error, on the whole cell exact slopes are within slope +- spread. */
typedef struct {
    pen_real_t *value;
    pen_real_t *error;
    pen_real_t *slope;
    pen_real_t *spread;
} rows_t;

/* The network on a cell from x on: its value at x, its slopes on the whole cell. */
typedef struct {
    pen_real_t x;
    pen_real_t way;   /* 1 or -1 */
    pen_real_t guard; /* no cell is shorter: numbers lie closer together than that */
    pen_real_t length;
    bool       straight; /* no neuron is undecided */
    pen_real_t value;
    pen_real_t error;
    pen_real_t slope;
    pen_real_t spread;
} cell_t;

static rows_t rows_of(pen_real_t *work, size_t width)
{
    const rows_t rows = { &work[0], &work[width], &work[2U * width], &work[3U * width] };

    return rows;
}

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

/* y = (x - p) q or y = x p + q, in place: two roundings for the value, one for the slope. */
static void scale(size_t n, bool centre, const pen_real_t p[], const rows_t *h)
{
    for (size_t i = 0U; i < n; i++) {
        const pen_real_t from = centre ? (h->value[i] - p[i]) : h->value[i];
        const pen_real_t factor = centre ? p[n + i] : p[i];
        const pen_real_t shift = centre ? ZERO : p[n + i];
        const pen_real_t product = from * factor;
        const pen_real_t slope = h->slope[i] * factor;
        const pen_real_t size = pen_port_abs(product) + pen_port_abs(shift);
        const pen_real_t error = (pen_port_abs(factor) * h->error[i]) + (ROUNDING * (TWO * size));
        const pen_real_t spread = (pen_port_abs(factor) * h->spread[i]) + (ROUNDING * pen_port_abs(slope));
        h->error[i] = safe(is_zero(from, h->error[i]), error, 2U);
        h->spread[i] = safe(is_zero(h->slope[i], h->spread[i]), spread, 2U);
        h->value[i] = product + shift;
        h->slope[i] = slope;
    }
}

/* y = W x + b with its slopes and both bounds; the inputs' bounds are used up. Blocks as in penode/pen_net.h. */
static void dense(size_t n_out, size_t n_in, const pen_real_t w[], const rows_t *h, const rows_t *y)
{
    const size_t k = n_in + 1U;
    const bool exact = burden(n_in, k, h->value, h->error);
    const bool flat = burden(n_in, k, h->slope, h->spread);

    for (size_t row = 0U; row < n_out; row++) {
        const size_t narrow = (row < (n_out - (n_out % 4U))) ? 4U : 1U;
        const size_t stride = (row < (n_out - (n_out % 16U))) ? 16U : narrow;
        const size_t first = row - (row % stride);
        const pen_real_t *at = &w[(first * k) + (row - first)];
        pen_real_t value = at[0];
        pen_real_t error = (ROUNDING * (pen_real_t)k) * pen_port_abs(value);
        pen_real_t slope = ZERO;
        pen_real_t spread = ZERO;
        for (size_t i = 0U; i < n_in; i++) {
            const pen_real_t weight = at[stride * (i + 1U)];
            const pen_real_t size = pen_port_abs(weight);
            value += weight * h->value[i];
            slope += weight * h->slope[i];
            error += size * h->error[i];
            spread += size * h->spread[i];
        }
        y->value[row] = value;
        y->slope[row] = slope;
        y->error[row] = safe(exact, error, k);
        y->spread[row] = safe(flat, spread, k);
    }
}

/*
 * One neuron's activation on the cell. Decided is a neuron whose value cannot come to zero within the cell, or that starts on
 * its side of zero or at it and does not go back; the cell ends before any decided neuron can switch. So the cell before a
 * kink ends where the value is as small as its error; below twice its error a neuron is undecided, and the cell goes on
 * until it has three times its error on the other side.
 */
static void rectify(const rows_t *y, size_t i, cell_t *cell)
{
    const pen_real_t value = y->value[i];
    const pen_real_t error = y->error[i];
    const pen_real_t spread = y->spread[i];
    const pen_real_t rate = cell->way * y->slope[i];
    const pen_real_t size = pen_port_abs(value);
    const bool positive = (value > ZERO) || (!(value < ZERO) && (rate > ZERO));
    const pen_real_t closing = positive ? (spread - rate) : (spread + rate); /* how fast it comes to zero, at most */
    const bool leaves = (closing <= ZERO) && (size >= error);
    const bool stays = (size > (TWO * error)) && ((size - error) > (closing * cell->guard));
    const bool decided = (leaves || stays) && (size <= PEN_REAL_MAX);
    pen_real_t reach = PEN_REAL_MAX;

    if (decided) {
        reach = (closing > ZERO) ? ((size - error) / closing) : PEN_REAL_MAX;
        y->value[i] = positive ? value : ZERO;
        y->error[i] = positive ? error : ZERO;
        y->slope[i] = positive ? y->slope[i] : ZERO;
        y->spread[i] = positive ? spread : ZERO;
    } else {
        const pen_real_t low = y->slope[i] - spread;
        const pen_real_t high = y->slope[i] + spread;
        const pen_real_t least = (low < ZERO) ? low : ZERO;
        const pen_real_t most = (high > ZERO) ? high : ZERO;
        const pen_real_t leaving = pen_port_abs(rate) - spread;
        const pen_real_t to_go = (THREE * error) - ((rate > ZERO) ? value : -value);
        const pen_real_t end = to_go / leaving;
        const pen_real_t later = (end > cell->guard) ? end : cell->guard;
        reach = (leaving > ZERO) ? later : PEN_REAL_MAX;
        y->value[i] = (value > ZERO) ? value : ZERO;
        y->slope[i] = HALF * (least + most);
        y->spread[i] = safe(false, HALF * (most - least), 4U);
        cell->straight = false;
    }
    cell->length = (reach < cell->length) ? reach : cell->length;
}

/* The cell that starts at x. */
static cell_t look(const network_t *network, pen_real_t x, pen_real_t way)
{
    const size_t width = network->chain->width;
    const pen_real_t *p = network->p;
    rows_t h = rows_of(network->work, width);
    rows_t y = rows_of(&network->work[4U * width], width);
    const pen_real_t guard = (FOUR * (PEN_REAL_EPSILON * pen_port_abs(x))) + PEN_REAL_MIN;
    cell_t cell = { x, way, guard, PEN_REAL_MAX, true, ZERO, ZERO, ZERO, ZERO };

    h.value[0] = x;
    h.error[0] = ZERO;
    h.slope[0] = ONE;
    h.spread[0] = ZERO;
    for (size_t i = 0U; i < network->chain->layers; i++) {
        const pen_layer_t *const layer = &network->chain->layer[i];
        if ((layer->kind == PEN_LAYER_CENTRE) || (layer->kind == PEN_LAYER_RESCALE)) {
            scale(layer->n_out, layer->kind == PEN_LAYER_CENTRE, p, &h);
            p = &p[2U * layer->n_out];
        } else {
            const rows_t before = h;
            dense(layer->n_out, layer->n_in, p, &h, &y);
            p = &p[layer->n_out * (layer->n_in + 1U)];
            h = y;
            y = before;
            for (size_t n = 0U; (layer->kind == PEN_LAYER_RELU) && (n < layer->n_out); n++) {
                rectify(&h, n, &cell);
            }
        }
    }
    cell.value = h.value[0];
    cell.error = h.error[0];
    cell.slope = h.slope[0];
    cell.spread = h.spread[0];
    return cell;
}

/* Where the cell ends: before its length, rounding included; at the edge if nothing ends it before. */
static pen_real_t end_of(const cell_t *cell, pen_real_t edge)
{
    const pen_real_t step = (cell->length * DOWN) - (PEN_REAL_EPSILON * pen_port_abs(cell->x));
    const pen_real_t next = cell->x + (cell->way * step);
    const bool ends = (cell->length < PEN_REAL_MAX) && ((cell->way * next) < (cell->way * edge));

    return ends ? next : edge;
}

/* Which promises about slopes may be broken on the cell. */
static uint32_t steep(const pen_promise_t *promise, const cell_t *cell)
{
    const bool rises = (cell->slope >= cell->spread);
    const bool falls = (-cell->slope >= cell->spread);
    const bool bounded = (((pen_port_abs(cell->slope) + cell->spread) * UP) <= promise->max_slope);
    uint32_t broken = rises ? 0U : PEN_PROMISE_INCREASING;

    broken |= falls ? 0U : PEN_PROMISE_DECREASING;
    broken |= bounded ? 0U : PEN_PROMISE_MAX_SLOPE;
    return broken;
}

/*
 * How far the network may be from the straight line between the ends of a cell, rounded up: its slopes are within spread of
 * their middle, so it is off the line by 2 spread times the distance to the nearer end at most.
 */
static pen_real_t bulge_of(const cell_t *cell, pen_real_t distance)
{
    return cell->straight ? ZERO : (UP * (cell->spread * distance));
}

/* Is a force within its limit at x, and on the cells before and behind? An error is 0 or above EPS |value|, so twice the
 * error covers the rounding of adding it, too. */
static bool weak(const pen_promise_t *promise, const cell_t *cell, pen_real_t bulge)
{
    const pen_real_t most = pen_port_abs(cell->value) + (TWO * cell->error) + bulge;

    return (((bulge > ZERO) ? (UP * most) : most) <= promise->max_force);
}

/* May the force push along at x or behind? *low: below way * F(x); below that of the end of the cell afterwards; *bulge that
 * of the cell before, then of this one, where it counts. */
static uint32_t driving(const pen_promise_t *promise, const cell_t *cell, pen_real_t distance, bool endless, pen_real_t *low,
                        pen_real_t *bulge)
{
    const pen_real_t least = (cell->way * cell->value) - (TWO * cell->error);
    const pen_real_t here = (least > *low) ? least : *low;
    const pen_real_t rate = (cell->slope - cell->spread) - ((TWO * PEN_REAL_EPSILON) * (pen_port_abs(cell->slope) + cell->spread));
    const pen_real_t product = rate * distance;
    const pen_real_t gain = (product - ((FOUR * PEN_REAL_EPSILON) * pen_port_abs(product))) - ((rate < ZERO) ? TINY : ZERO);
    const pen_real_t there = (here + gain) - ((TWO * PEN_REAL_EPSILON) * (pen_port_abs(here) + pen_port_abs(gain)));
    const bool above = (rate >= ZERO) || (!endless && (there >= -promise->band)); /* all along the cell */
    const pen_real_t ahead = above ? ZERO : bulge_of(cell, distance);
    const pen_real_t largest = (ahead > *bulge) ? ahead : *bulge;
    const pen_real_t reserve = (largest > ZERO) ? (UP * (largest + (PEN_REAL_EPSILON * pen_port_abs(here)))) : ZERO;
    const bool kept = ((here - reserve) >= -promise->band) && ((rate >= ZERO) || !endless);

    *low = there;
    *bulge = ahead;
    return kept ? 0U : PEN_PROMISE_DISSIPATIVE;
}

/* One side of the start, cell by cell. *looks counts down. Which promises may be broken, and *at which place? */
static uint32_t travel(const network_t *network, const pen_promise_t *promise, pen_real_t start, pen_real_t way, pen_real_t edge,
                       uint32_t *looks, pen_real_t *at)
{
    pen_real_t x = start;
    pen_real_t low = -PEN_REAL_MAX;
    pen_real_t pushing = ZERO; /* bulge of the cell before, for each of two promises */
    pen_real_t before = ZERO;
    uint32_t broken = 0U;
    bool more = true;

    while (more && (broken == 0U) && (*looks > 0U)) {
        const cell_t cell = look(network, x, way);
        const pen_real_t next = end_of(&cell, edge);
        const pen_real_t distance = pen_port_abs(next - x);
        const bool endless = (pen_port_abs(next) >= PEN_REAL_MAX);
        const bool at_edge = !(distance > ZERO); /* from here on constant */
        const bool flat = ((pen_port_abs(cell.slope) + cell.spread) <= ZERO);
        const pen_real_t ahead = bulge_of(&cell, endless ? ZERO : distance);
        const bool bounded = weak(promise, &cell, (ahead > before) ? ahead : before) && (flat || !endless);

        broken = bounded ? 0U : PEN_PROMISE_MAX_FORCE;
        broken |= driving(promise, &cell, distance, endless, &low, &pushing);
        broken |= at_edge ? 0U : steep(promise, &cell);
        broken &= promise->kinds;
        *at = x;
        before = ahead;
        more = !endless && !at_edge;
        (*looks)--;
        x = next;
    }
    return (more && (broken == 0U)) ? (promise->kinds & ALONG) : broken;
}

/* The layers as the step evaluates them, to the bit. */
static pen_real_t evaluate(const network_t *network, pen_real_t x)
{
    const pen_real_t *p = network->p;
    pen_real_t *h = &network->work[0];
    pen_real_t *y = &network->work[network->chain->width];
    bool relu = false; /* the activation of the layer before is still to be applied */

    h[0] = x;
    for (size_t i = 0U; i < network->chain->layers; i++) {
        const pen_layer_t *const layer = &network->chain->layer[i];
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
                      const pen_piece_t piece[], pen_real_t work[], pen_breach_t *breach)
{
    const network_t network = { chain, &p[2], work };
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
                                                : evaluate(&network, start);
        broken = (pen_port_abs(zero) <= ZERO) ? 0U : PEN_PROMISE_ZERO_AT_ZERO;
    }
    if ((broken == 0U) && ((promise->kinds & ALONG) != 0U)) {
        broken = travel(&network, promise, start, ONE, highest, &looks, &at);
    }
    if ((broken == 0U) && ((promise->kinds & ALONG) != 0U)) {
        broken = travel(&network, promise, start, -ONE, lowest, &looks, &at);
    }
    breach->kind = broken;
    breach->at = at;
    return (broken == 0U);
}
