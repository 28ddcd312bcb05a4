/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * Check of a parameter set against the promises of the model file for networks of one input with ReLU activations: they
 * are proven for the weights of the set, on the target, in the tuning context, before the set is adopted.
 *
 * A promise is about the network F in exact arithmetic of its stored values, for all real inputs: with `clamp` about
 * the network behind the clamp, else about the network extrapolated along its last pieces. PEN_PROMISE_ZERO_AT_ZERO
 * alone is about the bits that the step computes at 0.
 *
 * How. From 0 outwards, both ways, in cells: at the start of a cell all layers are evaluated with their derivatives and
 * with bounds of both rounding errors (pen_cell). A neuron whose sign is certain on the whole cell is on or
 * off. One that may switch within the cell is undecided, and is tried on and off. So each cell gives an interval that
 * contains all exact slopes on it, whatever the order in which rounding lets neurons switch. No piece is stored.
 *
 * Margin. A set that breaks a promise is never accepted, by however little it breaks it. One that keeps its promises by
 * more than the margin is never refused; in between it may be refused. With EPS = PEN_REAL_EPSILON, and c the sum of
 * (inputs + 10) over the layers (12 for a scaling), the margin is
 *   of a slope  c EPS times the sum of |products of the weights| along all paths through neurons that are on;
 *   of a force  16 c EPS times that sum over all paths from the input and from each bias, times the sizes that enter there;
 *   of a kink   where neurons switch so close together that their values are below 6 of their own errors (which are as
 *               that of a force, without the 16), or within 8 EPS |x|: up to 4 of them count as on or off in every
 *               combination, more than 4 as every slope from 0 to their own.
 * The margin is 0 for a slope that is exactly 0 because all neurons of a layer are off. No margin is stated for
 * forces where slopes are as small as PEN_REAL_MIN / EPS. In float, for the networks of the nQVM
 * (1-16-16-16-1): damper, slopes up to 18 900 N*s/m are known to 0.1 N*s/m and forces up to 260 N to 0.12 N; spring,
 * slopes up to 120 000 N/m to 5 N/m and forces up to 2800 N to 0.8 N. In double 10^-9 of that.
 *
 * Dissipative. F(v) v >= -band |v|. With band 0 that asks for F(0) = 0 exactly, which is proven where all neurons of
 * one layer are off or exactly 0 at v = 0 and no bias follows; then F(v) / v has the margin of a slope. A trained
 * network misses 0 at least by rounding: promise a band, say 0.1 N. Then F has the margin of a force.
 *
 * Cost. Two cells a kink, and at most promise->looks evaluations, where the combinations of a cell count as half of one
 * each. A Cortex-M4F (-O2) takes 34 instructions a weight for an evaluation: 20 300 for a network of the nQVM, which
 * needs 163 to 262 of them, 3.3 to 5.3 million instructions (12 times what folding takes). Stack: 400 bytes, work[] apart.
 */
#ifndef PEN_PROMISE_H
#define PEN_PROMISE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "penode/pen_fold.h"
#include "penode/pen_real.h"

#ifdef __cplusplus
extern "C" {
#endif

#define PEN_PROMISE_INCREASING   0x1U  /* F' >= 0                    */
#define PEN_PROMISE_DECREASING   0x2U  /* F' <= 0                    */
#define PEN_PROMISE_DISSIPATIVE  0x4U  /* F(v) v >= -band |v|        */
#define PEN_PROMISE_MAX_SLOPE    0x8U  /* |F'| <= max_slope          */
#define PEN_PROMISE_MAX_FORCE    0x10U /* |F| <= max_force           */
#define PEN_PROMISE_ZERO_AT_ZERO 0x20U /* the step computes 0 at 0   */

/** What a model file promises of a network. Numbers whose kind is not promised are ignored. */
typedef struct {
    uint32_t kinds;       /* PEN_PROMISE_..., ORed                                  */
    uint32_t looks;       /* evaluations that a check may take: bounds its time     */
    pen_real_t band;      /* [unit of the output], >= 0                             */
    pen_real_t max_slope; /* [unit of the output / unit of the input], >= 0         */
    pen_real_t max_force; /* [unit of the output], >= 0                             */
} pen_promise_t;

/** Which promise a set breaks, and where. */
typedef struct {
    uint32_t network; /* which network of the model: written by the caller                                  */
    uint32_t kind;    /* PEN_PROMISE_..., ORed if several break there; all but ZERO_AT_ZERO if `looks` ran out */
    pen_real_t at;    /* input: the end nearer to 0 of the cell on which the promise is broken, or not proven */
} pen_breach_t;

/**
 * Check the promises of a network. Tuning context; writes work[], active[] and *breach only.
 * @param p         the network's values in a set, all finite: lowest and highest input, then the layers (penode/pen_fold.h)
 * @param clamp     true: outside of the trust envelope the value at its edge; false: extrapolate
 * @param capacity  of piece[]
 * @param piece     the pieces that the step uses, NULL if it evaluates the layers: for PEN_PROMISE_ZERO_AT_ZERO
 * @param work      [8 * chain->width]
 * @param active    [chain->neurons]
 * @param breach    kind and at are written when the result is false
 * @return true if every promise is kept
 */
bool pen_promise_kept(const pen_promise_t *promise, const pen_chain_t *chain, const pen_real_t p[], bool clamp, size_t capacity,
                      const pen_piece_t piece[], pen_real_t work[], bool active[], pen_breach_t *breach);

/* ---- for pen_promise_kept(): bounds of value and slope on an interval, which include rounding errors ---- */

#define PEN_CELL_OPEN 4U /* up to this many undecided neurons, every on/off pattern of a cell is evaluated */

/** A network with its values and work space. */
typedef struct {
    const pen_chain_t *chain;
    const pen_real_t *p; /* values of the first layer */
    pen_real_t *work;    /* [8 * chain->width]        */
    bool *active;        /* [chain->neurons]          */
} pen_line_t;

/** The network at x, and from there on along `way` for `length`. */
typedef struct {
    pen_real_t x;
    pen_real_t way;               /* direction: 1 or -1                                                        */
    pen_real_t guard;             /* shortest cell: more than the spacing of pen_real_t here                   */
    pen_real_t length;            /* PEN_REAL_MAX: no neuron switches any more                                 */
    size_t open;                  /* how many neurons are undecided; 0: the network is straight                */
    size_t neuron[PEN_CELL_OPEN]; /* the first of them                                                         */
    pen_real_t value;             /* the exact value at x is within value +- error                             */
    pen_real_t error;             /* 0 if the value is exact, else at least EPS |value|                        */
    pen_real_t least;             /* exact slopes on the cell are from least to most; NaN after an overflow    */
    pen_real_t most;
} pen_cell_t;

/**
 * The cell that starts at x. A neuron that may switch within it is undecided. Up to PEN_CELL_OPEN undecided neurons are
 * tried on and off in every combination; with more, each contributes every slope from 0 to its own.
 * Cost on a Cortex-M4F: 34 instructions a weight, and 17 for each combination.
 */
void pen_cell(const pen_line_t *line, pen_real_t x, pen_real_t way, pen_cell_t *part);

#ifdef __cplusplus
}
#endif

#endif
