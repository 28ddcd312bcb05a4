/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "penode/pen_exact.h"

#include "penode/pen_fold.h"

#include "penode/pen_net.h"

#define ZERO ((pen_real_t)0)
#define HALF ((pen_real_t)0.5F)
#define ONE  ((pen_real_t)1)

/* What is needed on the way: the network, its values and the work space. */
typedef struct {
    const pen_chain_t *chain;
    const pen_real_t *p; /* of the first layer */
    pen_real_t *line;    /* two rows of values, two of derivatives */
    bool *active;
} walk_t;

/* The network seen from one point along the pattern, and where the pattern ends. */
typedef struct {
    pen_real_t value;
    pen_real_t slope;
    pen_real_t ahead; /* distance to the next kink */
    size_t neuron;    /* whose kink it is; chain->neurons if there is none */
} view_t;

/* One side of the centre. */
typedef struct {
    pen_real_t way;   /* 1 or -1 */
    pen_real_t edge;  /* of the trust envelope */
    pen_real_t start; /* of the piece beyond the edge: the first number outside, or the edge itself going down */
    bool clamp;
} side_t;

/* The smallest number above a finite x. */
static pen_real_t above(pen_real_t x)
{
    const pen_real_t size = pen_port_abs(x) * PEN_REAL_EPSILON; /* 1 to 2 steps */
    const pen_real_t near = x + ((pen_real_t)0.375F * size);    /* 0.375 to 0.75 steps, 0.75 below a power of two */
    const pen_real_t far = x + ((pen_real_t)0.75F * size);      /* 0.75 to 1.5 steps */
    const pen_real_t tiny = x + (PEN_REAL_MIN * PEN_REAL_EPSILON);
    const pen_real_t larger = (far > x) ? far : tiny;

    return (near > x) ? near : larger;
}

/* Choose the pattern that holds at the point where it is seen. */
static void begin_pattern(size_t n, const pen_real_t y[], bool active[])
{
    for (size_t i = 0U; i < n; i++) {
        active[i] = (y[i] > ZERO);
    }
}

/* Apply the pattern to a layer's values y and derivatives s, and see which of its neurons switches next. */
static void follow_pattern(const walk_t *walk, size_t first, size_t n, pen_real_t way, pen_real_t y[], pen_real_t s[], view_t *view)
{
    for (size_t i = 0U; i < n; i++) {
        const bool on = walk->active[first + i];
        const pen_real_t change = way * s[i];
        const bool leaving = on ? (change < ZERO) : (change > ZERO);
        if (leaving) {
            const pen_real_t distance = -(y[i] / change);
            const pen_real_t ahead = (distance > ZERO) ? distance : ZERO; /* rounding may have put it behind */
            if ((view->neuron == walk->chain->neurons) || (ahead < view->ahead)) {
                view->ahead = ahead;
                view->neuron = first + i;
            }
        }
        y[i] = on ? y[i] : ZERO;
        s[i] = on ? s[i] : ZERO;
    }
}

static view_t view_from(const walk_t *walk, pen_real_t x, pen_real_t way, bool begin)
{
    const size_t width = walk->chain->width;
    const pen_real_t *p = walk->p;
    pen_real_t *h = &walk->line[0];
    pen_real_t *t = &walk->line[width];
    pen_real_t *y = &walk->line[2U * width];
    pen_real_t *s = &walk->line[3U * width];
    size_t first = 0U; /* neuron of the layer */
    view_t view = { ZERO, ZERO, ZERO, walk->chain->neurons };

    h[0] = x;
    t[0] = ONE;
    for (size_t i = 0U; i < walk->chain->layers; i++) {
        const pen_layer_t *const layer = &walk->chain->layer[i];
        const size_t n = layer->n_out;
        if (layer->kind == PEN_LAYER_CENTRE) {
            pen_centre(n, p, h, h);
            pen_centre_tangent(n, p, t);
            p = &p[2U * n];
        } else if (layer->kind == PEN_LAYER_RESCALE) {
            pen_rescale(n, p, h, h);
            pen_rescale_tangent(n, p, t);
            p = &p[2U * n];
        } else {
            pen_real_t *const h_before = h;
            pen_real_t *const t_before = t;
            pen_dense_dual(n, layer->n_in, p, h, t, y, s);
            p = &p[n * (layer->n_in + 1U)];
            if (layer->kind == PEN_LAYER_RELU) {
                if (begin) {
                    begin_pattern(n, y, &walk->active[first]);
                }
                follow_pattern(walk, first, n, way, y, s, &view);
                first += n;
            }
            h = y;
            t = s;
            y = h_before;
            s = t_before;
        }
    }
    view.value = h[0];
    view.slope = t[0];
    return view;
}

/*
 * Walk one way and store the pieces, at most `room` of them: going up the last room of piece[capacity], going down from
 * piece[room - 1] on, where a piece starts at its far end. *looks counts down. Returns the room from the last piece on, with
 * that piece; 0 if the pieces are more.
 */
static size_t go(const walk_t *walk, const side_t *side, pen_real_t centre, size_t capacity, pen_piece_t piece[], size_t room, bool down,
                 size_t *looks)
{
    pen_real_t x = centre;
    pen_real_t start = centre;
    pen_status_t status = PEN_OK;
    size_t left = room;
    bool begin = true;
    bool more = true;

    while (more && (left > 0U) && (*looks > 0U)) {
        pen_piece_t *const here = down ? &piece[left - 1U] : &piece[capacity - left];
        const view_t view = view_from(walk, x, side->way, begin);
        const pen_real_t next = x + (side->way * view.ahead);
        const size_t kink = (pen_port_abs(next) < PEN_REAL_MAX) ? view.neuron : walk->chain->neurons;
        /* is the edge beyond the kink? */
        const bool beyond = (kink < walk->chain->neurons) && ((side->way * (side->edge - next)) > ZERO);
        const bool leaving = (status == PEN_OK) && !beyond && (pen_port_abs(side->edge) < PEN_REAL_MAX);
        const bool flat = side->clamp && (status != PEN_OK);
        bool moved = false; /* else a piece without length, or the last one */

        here->start = start;
        here->slope = flat ? ZERO : view.slope;
        here->offset = view.value - (here->slope * (x - centre));
        here->status = status;
        begin = false;
        (*looks)--;
        if (leaving) {
            moved = true;
            status = PEN_OUTSIDE;
            start = side->start;
            x = side->edge;
        } else if ((kink < walk->chain->neurons) && !flat) {
            moved = ((side->way * (next - x)) > ZERO);
            walk->active[kink] = !walk->active[kink];
            start = moved ? next : start; /* a kink on the edge of the envelope leaves its start beyond the edge */
            x = next;
        } else {
            more = false;
        }
        here->start = (moved && down) ? start : here->start;
        left -= moved ? 1U : 0U;
    }
    return more ? 0U : left;
}

/* Member by member: takes no stack on a Cortex-M, and Frama-C sees that two pieces never overlap in part. */
static void copy_piece(pen_piece_t *to, const pen_piece_t *from)
{
    to->start = from->start;
    to->offset = from->offset;
    to->slope = from->slope;
    to->status = from->status;
}

pen_status_t pen_fold(const pen_chain_t *chain, const pen_real_t p[], bool clamp, pen_real_t line[], bool active[], size_t capacity,
                      pen_piece_t piece[])
{
    const walk_t walk = { chain, &p[2], line, active };
    const side_t low = { -ONE, p[0], p[0], clamp };
    const side_t high = { ONE, p[1], above(p[1]), clamp };
    const pen_real_t centre = (HALF * p[0]) + (HALF * p[1]);
    size_t looks = capacity + chain->neurons + 4U;
    const size_t room = capacity - 1U;
    size_t left = go(&walk, &low, centre, capacity, piece, room, true, &looks);

    if (left > 0U) {
        const size_t first = left - 1U;
        for (size_t i = first; i < room; i++) {
            copy_piece(&piece[i - first], &piece[i]);
        }
        left = go(&walk, &high, centre, capacity, piece, left, false, &looks);
    }
    if (left > 0U) {
        for (size_t i = (capacity - left) + 1U; i < capacity; i++) {
            copy_piece(&piece[i], &piece[capacity - left]);
        }
        piece[0].start = centre;
    }
    return (left > 0U) ? PEN_OK : PEN_SET_PIECES;
}
