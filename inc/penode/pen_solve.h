/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * Small dense linear systems, partial pivoting, in place.
 */
#ifndef PEN_SOLVE_H
#define PEN_SOLVE_H

#include <stddef.h>

#include "penode/pen_real.h"
#include "penode/pen_status.h"

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

#endif
