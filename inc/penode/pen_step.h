/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * The part of a step that is the same for all generated models: inline, so that all sizes are constants. For generated
 * code; step context only. Only the exchange of sets branches on data.
 *
 * Rows of an instance, n_last values each (states, then outputs): KEPT a second copy of the last good ones, LAST the
 * last good ones, NOW those being computed. Inputs, n_kept values each: [0] of the last sample, [1] of this one.
 */
#ifndef PEN_STEP_H
#define PEN_STEP_H

#include <stddef.h>
#include <stdint.h>

#include "penode/pen_instance.h"
#include "penode/pen_math.h"
#include "penode/pen_port.h"
#include "penode/pen_real.h"
#include "penode/pen_status.h"

#ifdef __cplusplus
extern "C" {
#endif

#define PEN_ROW_KEPT 0U
#define PEN_ROW_LAST 1U
#define PEN_ROW_NOW  2U

/** n >= 1, here and in pen_step_check. */
static inline void pen_step_copy(size_t n, const pen_real_t from[], pen_real_t to[])
{
    size_t i = 0U;

    PEN_PORT_UNROLL
    do {
        to[i] = from[i];
        i++;
    } while (i < n);
}

/** PEN_OK, or `flag` if a value is NaN or Inf, as pen_finite. */
static inline pen_status_t pen_step_check(size_t n, const pen_real_t *value, pen_status_t flag)
{
    pen_real_t sum = (pen_real_t)0;
    size_t i = 0U;

    PEN_PORT_UNROLL
    do {
        sum += (pen_real_t)0 * value[i];
        i++;
    } while (i < n);
    return (sum >= (pen_real_t)0) ? PEN_OK : flag;
}

/** 1 after more than `samples` good samples (0, 1 or 2), else 0: a factor of the integration and of input curves. */
static inline pen_real_t pen_step_history(const pen_instance_t *self, uint32_t samples)
{
    const uint32_t more = (self->running >> samples) & 1U;

    return (pen_real_t)more;
}

/** Initial derivatives: dx/dx = 1, all others 0. @param d  [n_x * n_columns] */
static inline void pen_step_unit(size_t n_x, size_t n_columns, pen_real_t d[])
{
    for (size_t n = 0U; n < n_x; n++) {
        for (size_t c = 0U; c < n_columns; c++) {
            d[(n * n_columns) + c] = (n == c) ? (pen_real_t)1 : (pen_real_t)0;
        }
    }
}

/**
 * Check one value of the set in force and one piece of each folded network; the next step checks the next ones.
 * @param round   NAME_SCRUB
 * @param length  of value[]; 0 if steps read pieces only
 * @param piece   [networks * pieces] of the slot in force
 */
static inline pen_status_t pen_step_scrub(pen_instance_t *self, uint32_t round, uint32_t length, const pen_real_t value[],
                                          uint32_t networks, uint32_t pieces, const pen_piece_t piece[])
{
    const uint32_t at = self->scrub % round; /* in range even if scrub is damaged; no branch, unlike a comparison */
    pen_real_t nonfinite = (pen_real_t)0;    /* 0, or NaN once a number is not finite */

    if (length > 0U) {
        const pen_real_t looked_at = value[(length == round) ? at : (at % length)];
        nonfinite = looked_at - looked_at;
    }
    PEN_PORT_UNROLL
    for (uint32_t i = 0U; i < networks; i++) {
        const pen_piece_t *const looked_at = &piece[(i * pieces) + ((pieces == round) ? at : (at % pieces))];
        nonfinite *= looked_at->start;
        nonfinite *= looked_at->offset;
        nonfinite *= looked_at->slope;
    }
    self->scrub = at + 1U;
    return (nonfinite >= (pen_real_t)0) ? PEN_OK : PEN_WEIGHT_NONFINITE;
}

/** `flags` if u is a number outside of its declared range. */
static inline pen_status_t pen_step_range(pen_real_t u, pen_real_t least, pen_real_t most, pen_status_t flags)
{
    pen_status_t status = (u < least) ? flags : PEN_OK;

    status |= (u > most) ? flags : PEN_OK;
    return status;
}

/** u moved into its range; NaN stays NaN. */
static inline pen_real_t pen_step_clamp(pen_real_t u, pen_real_t least, pen_real_t most)
{
    const pen_real_t raised = (u < least) ? least : u;

    return (raised > most) ? most : raised;
}

/** Sum of a[i] b[i], in this order. @param a, b [n] */
static inline pen_real_t pen_step_inner(size_t n, const pen_real_t a[], const pen_real_t b[])
{
    pen_real_t sum = (pen_real_t)0;

    for (size_t i = 0U; i < n; i++) {
        sum += a[i] * b[i];
    }
    return sum;
}

/**
 * Keep the new row if it is good, else the last one, else the second copy; selected by index, always the same work.
 * @param row  [3 * n_last]; @param u  [2 * n_kept]
 * @param past     good samples to remember: 1, and more where inputs have rates or curves
 * @param refused  an input with one of these flags is not taken over
 */
static inline pen_status_t pen_step_finish(pen_instance_t *self, size_t n_last, pen_real_t row[], size_t n_kept, pen_real_t u[],
                                           uint32_t past, pen_status_t refused, pen_status_t status)
{
    const pen_status_t follows = (status << 2U) | (status << 1U); /* from a bad input or state: not reported twice */
    const pen_status_t found = pen_step_check(n_last, &row[PEN_ROW_NOW * n_last], PEN_STEP_NONFINITE) & ~follows;
    const pen_status_t result = status | found;
    const uint32_t good = pen_advanced(result) ? 1U : 0U;
    const uint32_t whole = ((result & PEN_STATE_NONFINITE) == PEN_OK) ? 1U : 0U;
    const uint32_t received = ((result & refused) == PEN_OK) ? 1U : 0U;

    const pen_real_t *const from = &row[(good + whole) * n_last];

    PEN_PORT_UNROLL
    for (size_t i = 0U; i < n_last; i++) {
        const pen_real_t value = from[i];
        row[(PEN_ROW_LAST * n_last) + i] = value;
        row[(PEN_ROW_KEPT * n_last) + i] = value;
    }
    PEN_PORT_UNROLL
    for (size_t i = 0U; i < n_kept; i++) {
        u[i] = u[(received * n_kept) + i];
    }
    if (past == 1U) {
        self->running |= good;
    } else {
        self->running = ((self->running << good) | good) & ((UINT32_C(1) << past) - 1U);
    }
    pen_status_note_step(&self->log, result);
    return result;
}

#ifdef __cplusplus
}
#endif

#endif
