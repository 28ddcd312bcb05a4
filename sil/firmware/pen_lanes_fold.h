/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/** pen_fold.h on lanes. Part of pen_lanes.h, which includes it; LANES_PIECES, the room for pieces, is defined before, or nothing is folded. */
#ifndef PEN_LANES_FOLD_H
#define PEN_LANES_FOLD_H

#ifdef LANES_PIECES
#include "penode/pen_fold.h"

#ifdef WEIGHTS_PER_RUN

typedef struct {
    pen_piece_t piece[LANES][LANES_PIECES];
    mask_t folded; /* the lanes whose pieces found room */
} lanes_pieces_t;

LANES_INLINE void lanes_fold(const pen_chain_t *chain, size_t length, const weight_t w[], bool clamp, pen_real_t line[], bool active[],
                             lanes_pieces_t *f)
{
    for (size_t l = 0U; l < LANES; l++) {
        pen_real_t own[length];
        for (size_t i = 0U; i < length; i++) {
            own[i] = w[i][l];
        }
        f->folded[l] = (pen_fold(chain, own, clamp, line, active, LANES_PIECES, f->piece[l]) == PEN_OK) ? -1 : 0;
    }
}

LANES_INLINE mask_t lanes_find(const lanes_pieces_t *f, lanes_t x, lanes_t *y, lanes_t *slope)
{
    mask_t outside = { 0 };

    for (size_t l = 0U; l < LANES; l++) {
        pen_status_t status = PEN_OK;
        const pen_piece_t *const at = pen_fold_find(LANES_PIECES, f->piece[l], x[l]);
        (*y)[l] = pen_fold_value(f->piece[l], at, x[l], &status);
        (*slope)[l] = at->slope;
        outside[l] = (status == PEN_OK) ? 0 : -1;
    }
    return outside;
}

#else

#define LANES_ROWS ((LANES_PIECES + LANES - 1U) / LANES)

/** Piece c * LANES_ROWS + j stands in lane c of row j: found by its first row, then down its lane. */
typedef struct {
    lanes_t start[LANES_ROWS];
    lanes_t offset[LANES_ROWS];
    lanes_t slope[LANES_ROWS];
    pen_real_t centre;
    pen_real_t low;  /* outside of the trust envelope below this... */
    pen_real_t high; /* ...and from this on, */
    bool nan;        /* and so is NaN */
    mask_t folded;   /* all lanes, if the pieces found room */
} lanes_pieces_t;

LANES_INLINE void lanes_fold(const pen_chain_t *chain, size_t length, const weight_t w[], bool clamp, pen_real_t line[], bool active[],
                             lanes_pieces_t *f)
{
    pen_piece_t piece[LANES_PIECES];
    const bool folded = (pen_fold(chain, w, clamp, line, active, LANES_PIECES, piece) == PEN_OK);

    (void)length;
    f->folded = (mask_t){ 0 } - (integer_t)(folded ? 1 : 0);
    if (folded) {
        f->centre = piece[0].start;
        f->low = -(pen_real_t)INFINITY;
        f->high = (pen_real_t)INFINITY;
        f->nan = (piece[LANES_PIECES - 1U].status != PEN_OK);
        for (size_t i = 1U; i < LANES_PIECES; i++) {
            const bool enters = (piece[i - 1U].status != PEN_OK) && (piece[i].status == PEN_OK);
            const bool leaves = (piece[i - 1U].status == PEN_OK) && (piece[i].status != PEN_OK);
            f->low = enters ? piece[i].start : f->low;
            f->high = leaves ? piece[i].start : f->high;
        }
        for (size_t i = 0U; i < (LANES * LANES_ROWS); i++) {
            const pen_piece_t *const from = &piece[(i < LANES_PIECES) ? i : (LANES_PIECES - 1U)];
            f->start[i % LANES_ROWS][i / LANES_ROWS] = from->start;
            f->offset[i % LANES_ROWS][i / LANES_ROWS] = from->offset;
            f->slope[i % LANES_ROWS][i / LANES_ROWS] = from->slope;
        }
    }
}

/** pen_fold_find and pen_fold_value; the lanes outside of the trust envelope. Cost: LANES + LANES_ROWS comparisons. */
LANES_INLINE mask_t lanes_find(const lanes_pieces_t *f, lanes_t x, lanes_t *y, lanes_t *slope)
{
    mask_t column = { 0 };
    lanes_t offset;

#pragma GCC unroll 16
    for (size_t c = 1U; c < LANES; c++) {
        column -= ~(x < f->start[0][c]);
    }
    offset = __builtin_shuffle(f->offset[0], column);
    *slope = __builtin_shuffle(f->slope[0], column);
#pragma GCC unroll 16
    for (size_t j = 1U; j < LANES_ROWS; j++) {
        const mask_t reached = ~(x < __builtin_shuffle(f->start[j], column));
        offset = lanes_pick(reached, __builtin_shuffle(f->offset[j], column), offset);
        *slope = lanes_pick(reached, __builtin_shuffle(f->slope[j], column), *slope);
    }
    *y = offset + (*slope * (x - f->centre));
    return (x < f->low) | (x >= f->high) | (~(x == x) & (integer_t)(f->nan ? -1 : 0));
}

#endif
#endif

#endif
