/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "penode/pen_exact.h"

#include "penode/pen_solve.h"

#include <stdint.h>

#include "penode/pen_port.h"

#define ZERO ((pen_real_t)0)
#define ONE  ((pen_real_t)1)

/* The row, from k on, with the largest |a[row][k]|. A NaN is passed over unless it is in row k: then it stays. */
static size_t pivot_row(size_t n, const pen_real_t a[], size_t k)
{
    pen_real_t largest = pen_port_abs(a[(k * n) + k]);
    size_t row = k;

    for (size_t i = k + 1U; i < n; i++) {
        const pen_real_t size = pen_port_abs(a[(i * n) + k]);
        row = (size > largest) ? i : row;
        largest = (size > largest) ? size : largest;
    }
    return row;
}

static void exchange(pen_real_t *p, pen_real_t *q)
{
    const pen_real_t kept = *p;

    *p = *q;
    *q = kept;
}

/* Clear column k below the diagonal; what is cleared is not stored. */
static void eliminate(size_t n, pen_real_t a[], pen_real_t b[], size_t k, pen_real_t inverse)
{
    for (size_t i = k + 1U; i < n; i++) {
        const pen_real_t factor = a[(i * n) + k] * inverse;
        for (size_t j = k + 1U; j < n; j++) {
            a[(i * n) + j] -= factor * a[(k * n) + j];
        }
        b[i] -= factor * b[k];
    }
}

/*
 * `nonfinite` gathers v - v of every pivot and every x: it stays 0, or becomes NaN for good if a v is NaN or Inf. That is
 * enough: a pivot of 0 has an infinite reciprocal, which makes its x Inf or NaN; a NaN or Inf elsewhere in `a` spreads
 * to a pivot or to an x, because 0 * Inf and 0 * NaN are NaN. A pivot of Inf alone would pass as x = 0.
 */
pen_status_t pen_solve(size_t n, pen_real_t a[], pen_real_t b[])
{
    pen_status_t status = PEN_BADARG;

    if ((n >= 1U) && (n <= PEN_SOLVE_MAX) && (a != NULL) && (b != NULL)) {
        pen_real_t inverse[PEN_SOLVE_MAX];
        pen_real_t nonfinite = ZERO;

        for (size_t k = 0U; k < n; k++) {
            const size_t row = pivot_row(n, a, k);
            for (size_t j = k; j < n; j++) {
                exchange(&a[(k * n) + j], &a[(row * n) + j]);
            }
            exchange(&b[k], &b[row]);
            inverse[k] = ONE / a[(k * n) + k];
            nonfinite += a[(k * n) + k] - a[(k * n) + k];
            eliminate(n, a, b, k, inverse[k]);
        }
        for (size_t k = n; k > 0U; k--) {
            pen_real_t sum = b[k - 1U];
            for (size_t j = k; j < n; j++) {
                sum -= a[((k - 1U) * n) + j] * b[j];
            }
            b[k - 1U] = sum * inverse[k - 1U];
            nonfinite += b[k - 1U] - b[k - 1U];
        }
        status = (nonfinite < ONE) ? PEN_OK : PEN_SINGULAR; /* NaN is not < 1 */
    }
    return status;
}
