/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * Folding: a network of one input with ReLU activations is piecewise linear. When its weights are staged, the tuning
 * context finds all pieces; the step then looks up the current one instead of evaluating the layers.
 *
 * How. From the centre of the trust envelope outwards, both ways: at a point, all layers are evaluated together with
 * their derivatives; the neuron whose sign changes next along the straight line ends the piece; that neuron alone is
 * switched, and the walk continues there. The pattern of active neurons is stored, so rounding cannot confuse the walk.
 *
 * Accuracy. On each piece value and slope are those of the layers with that pattern. The difference from the evaluation
 * layer by layer stays within twice the forward rounding error of those layers (test/gen/test_fold.py derives
 * it, and tests it at the ends of all pieces and their neighbours). At a kink the slope is that of the piece above it.
 *
 * Pieces also end at the edges of the trust envelope and carry PEN_OUTSIDE beyond it: the step needs no other check.
 */
#ifndef PEN_FOLD_H
#define PEN_FOLD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "penode/pen_port.h"
#include "penode/pen_real.h"
#include "penode/pen_status.h"

#ifdef __cplusplus
extern "C" {
#endif

/** One straight piece: y = offset + slope * (x - centre) from `start` on. 16 bytes (double: 32). */
typedef struct {
    pen_real_t start; /* in the first piece, which has no start: the centre of all pieces */
    pen_real_t offset;
    pen_real_t slope;
    pen_status_t status; /* PEN_OK, or PEN_OUTSIDE beyond the trust envelope */
} pen_piece_t;

/** What one layer does, as the values of a set hold it (penode/pen_net.h). */
typedef struct {
    uint32_t kind; /* one of PEN_LAYER_... */
    uint32_t n_in;
    uint32_t n_out;
} pen_layer_t;

#define PEN_LAYER_DENSE   0U /* W x + b                 */
#define PEN_LAYER_RELU    1U /* max(0, W x + b)         */
#define PEN_LAYER_CENTRE  2U /* (x - p) * q, each value */
#define PEN_LAYER_RESCALE 3U /* x * p + q, each value   */

/** A network that can be folded: one input, one output. */
typedef struct {
    const pen_layer_t *layer;
    uint32_t layers;
    uint32_t width;   /* values of the widest layer         */
    uint32_t neurons; /* of all layers of PEN_LAYER_RELU    */
} pen_chain_t;

/**
 * Find the pieces of a network.
 * @param p         its values in a set, all finite: lowest and highest input seen in training, then the layers
 * @param clamp     true: outside of the trust envelope the value at its edge; false: extrapolate
 * @param line      [4 * chain->width] work space
 * @param active    [chain->neurons] work space
 * @param capacity  of piece[], at least 4; all of it is written
 * @return PEN_OK; PEN_SET_PIECES if there are more pieces than capacity (piece[] is undefined)
 * Cost: one evaluation with its derivative for each piece; at most capacity + chain->neurons + 4 for any weights. A
 * network that would take more, because neurons switch between two neighbouring numbers, is refused as well.
 */
pen_status_t pen_fold(const pen_chain_t *chain, const pen_real_t p[], bool clamp, pen_real_t line[], bool active[], size_t capacity,
                      pen_piece_t piece[]);

/**
 * The piece that x lies on; the last one for NaN. No branch on the data.
 * @param capacity  of piece[]: a power of two from 4 on, or three times one
 * Cost on a Cortex-M4F: 5 instructions for each halving of capacity, 7 halvings for 96 and 128 pieces.
 */
static inline const pen_piece_t *pen_fold_find(size_t capacity, const pen_piece_t piece[], pen_real_t x)
{
    const pen_piece_t *at = piece;
    const pen_piece_t *upper;
    size_t n = capacity;

    PEN_PORT_UNROLL
    for (; n > 3U; n /= 2U) {
        const pen_piece_t *const middle = &at[n / 2U];
        at = (x < middle->start) ? at : middle;
    }
    upper = (x < at[n - 1U].start) ? &at[1] : &at[n - 1U]; /* of the two or three that are left */
    return (x < at[1].start) ? at : upper;
}

/** The network's output at x; NaN for NaN. @param at  of pen_fold_find; @param status  PEN_OUTSIDE is added */
static inline pen_real_t pen_fold_value(const pen_piece_t piece[], const pen_piece_t *at, pen_real_t x, pen_status_t *status)
{
    *status |= at->status;
    return at->offset + (at->slope * (x - piece[0].start));
}

#ifdef __cplusplus
}
#endif

#endif
