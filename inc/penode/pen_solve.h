/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * Solution of small dense linear systems with partial pivoting, in place.
 */
#ifndef PEN_SOLVE_H
#define PEN_SOLVE_H

#include <stdbool.h>
#include <stddef.h>

#include "penode/pen_port.h"
#include "penode/pen_real.h"
#include "penode/pen_status.h"

#ifdef __cplusplus
extern "C" {
#endif

#define PEN_SOLVE_MAX 16U /* largest n */

/**
 * Solve a x = b. PEN_OK means that every x is a number: NaN or Inf anywhere in a or b gives PEN_SINGULAR.
 * @param n  order, 1 .. PEN_SOLVE_MAX
 * @param a  [n*n] row-major; overwritten
 * @param b  [n] right-hand side; holds x on return
 * @return PEN_OK; PEN_SINGULAR if a pivot is zero, not finite, or so small that its reciprocal overflows, or if an x is
 *         not finite (b is then undefined); PEN_BADARG if n is out of range or a or b is NULL (nothing is written)
 * Cost: n^3/3 + n^2 multiply-adds and n divisions; the same instructions for every a and b (rows are exchanged even if
 * they are the same). Cortex-M4F, -O2: n = 2: 219, 4: 633, 8: 2605, 16: 14261. Stack: PEN_SOLVE_MAX reciprocals.
 */
pen_status_t pen_solve(size_t n, pen_real_t a[], pen_real_t b[]);

/** The same for n = 2, to the bit, in place of a call. a is not overwritten. Cost: about 60 instructions. */
static inline pen_status_t pen_solve2(const pen_real_t a[4], pen_real_t b[2])
{
    const pen_real_t *const row[2] = { &a[0], &a[2] };
    const size_t first = (pen_port_abs(a[2]) > pen_port_abs(a[0])) ? 1U : 0U; /* the larger pivot */
    const size_t second = 1U - first;
    const pen_real_t *const p = row[first];
    const pen_real_t *const q = row[second];
    const pen_real_t inverse = (pen_real_t)1 / p[0];
    const pen_real_t factor = q[0] * inverse;
    const pen_real_t pivot = q[1] - (factor * p[1]);
    const pen_real_t x1 = (b[second] - (factor * b[first])) * ((pen_real_t)1 / pivot);
    const pen_real_t x0 = (b[first] - (p[1] * x1)) * inverse;
    const pen_real_t nonfinite = ((p[0] - p[0]) + (pivot - pivot)) + ((x1 - x1) + (x0 - x0)); /* NaN if one is not finite */

    b[0] = x0;
    b[1] = x1;
    return (nonfinite < (pen_real_t)1) ? PEN_OK : PEN_SINGULAR;
}

#ifdef __cplusplus
}
#endif

#endif
