/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * Bounds of value and slope of a network of one input with ReLU activations on an interval, for pen_promise_kept().
 *
 * They include rounding errors, so they hold for the network in exact arithmetic.
 */
#ifndef PEN_CELL_H
#define PEN_CELL_H

#include <stdbool.h>
#include <stddef.h>

#include "penode/pen_fold.h"
#include "penode/pen_real.h"

#ifdef __cplusplus
extern "C" {
#endif

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
