/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "penode/pen_port.h"
#include "penode/pen_solve.h"
#include "unity.h"

#ifdef PEN_REAL_DOUBLE
#define EPSILON  DBL_EPSILON
#define SMALLEST 0x1p-1074
#else
#define EPSILON  FLT_EPSILON
#define SMALLEST 0x1p-149F
#endif

#define N PEN_SOLVE_MAX

static pen_real_t a[(N + 1U) * (N + 1U)]; /* room for an order too many, should it not be refused */
static pen_real_t b[N + 1U];
static pen_real_t kept[N * N];
static pen_real_t wanted[N];
static uint32_t noise;

void setUp(void)
{
    noise = 1U;
    for (size_t i = 0U; i < ((N + 1U) * (N + 1U)); i++) {
        a[i] = (pen_real_t)-99;
    }
    for (size_t i = 0U; i <= N; i++) {
        b[i] = (pen_real_t)-99;
    }
}

void tearDown(void) {}

/* What lies behind a and b is not written to. */
static void expect_end(size_t n)
{
    for (size_t i = n * n; i < ((N + 1U) * (N + 1U)); i++) {
        TEST_ASSERT_TRUE(a[i] == (pen_real_t)-99);
    }
    for (size_t i = n; i <= N; i++) {
        TEST_ASSERT_TRUE(b[i] == (pen_real_t)-99);
    }
}

static void load(size_t n, const pen_real_t matrix[], const pen_real_t right[])
{
    for (size_t i = 0U; i < (n * n); i++) {
        a[i] = matrix[i];
    }
    for (size_t i = 0U; i < n; i++) {
        b[i] = right[i];
    }
}

/* Exact: the systems below are made so that no operation rounds. */
static void expect_solution(size_t n, const pen_real_t x[])
{
    for (size_t i = 0U; i < n; i++) {
        TEST_ASSERT_TRUE((b[i] >= x[i]) && (b[i] <= x[i]));
    }
}

/* In [-1, 1), the same on every target. */
static pen_real_t next_noise(void)
{
    noise = (noise * UINT32_C(1664525)) + UINT32_C(1013904223);
    return ((pen_real_t)(noise >> 8U) * (pen_real_t)0x1p-23) - (pen_real_t)1;
}

static bool is_finite(pen_real_t x)
{
    return (x >= -PEN_REAL_MAX) && (x <= PEN_REAL_MAX);
}

void test_order_one_divides(void)
{
    static const pen_real_t matrix[1] = { 4 };
    static const pen_real_t right[1] = { -10 };
    static const pen_real_t x[1] = { (pen_real_t)-2.5 };
    load(1U, matrix, right);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_solve(1U, a, b));
    expect_solution(1U, x);
}

void test_zero_on_the_diagonal_is_exchanged(void)
{
    static const pen_real_t matrix[4] = { 0, 2, 4, 1 };
    static const pen_real_t right[2] = { 6, 11 };
    static const pen_real_t x[2] = { 2, 3 };
    load(2U, matrix, right);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_solve(2U, a, b));
    expect_solution(2U, x);
}

/* Column 0 needs row 1, what is then left of column 1 needs row 2: pivots -4, 4, -0.25, all powers of two. */
void test_order_three_with_two_exchanges(void)
{
    static const pen_real_t matrix[9] = { 2, 1, 1, -4, 2, 2, 1, (pen_real_t)3.5, 4 };
    static const pen_real_t right[3] = { 7, 6, 20 }; /* matrix * (1, 2, 3) */
    static const pen_real_t x[3] = { 1, 2, 3 };
    load(3U, matrix, right);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_solve(3U, a, b));
    expect_solution(3U, x);
}

/* Row i holds 2^(i mod 5) in column 5 i + 3 mod n: every column needs an exchange; the solution is exact. */
void test_scaled_permutation_of_the_largest_order(void)
{
    pen_real_t x[N];
    for (size_t i = 0U; i < N; i++) {
        const size_t column = ((5U * i) + 3U) % N;
        const pen_real_t scale = (pen_real_t)(UINT32_C(1) << (i % 5U));
        for (size_t j = 0U; j < N; j++) {
            a[(i * N) + j] = (j == column) ? scale : (pen_real_t)0;
        }
        x[column] = (pen_real_t)i - (pen_real_t)7;
        b[i] = scale * x[column];
    }
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_solve(N, a, b));
    expect_solution(N, x);
}

/*
 * Without exchange the small pivot would swallow the second row and give x[0] = 0 (or 2). With it: multiplier e,
 * second pivot 1 - e, so each of the handful of operations errs by EPSILON / 2 at numbers near 1: 8 EPSILON.
 */
void test_small_pivot_does_not_swallow_the_other_row(void)
{
    static const pen_real_t matrix[4] = { EPSILON / 16, 1, 1, 1 }; /* e, 1, 1, 1 */
    static const pen_real_t right[2] = { 1, 2 };                   /* x = (1, 1) / (1 - e), up to e */
    load(2U, matrix, right);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_solve(2U, a, b));
    TEST_ASSERT_TRUE(pen_port_abs(b[0] - (pen_real_t)1) <= (8 * EPSILON));
    TEST_ASSERT_TRUE(pen_port_abs(b[1] - (pen_real_t)1) <= (8 * EPSILON));
}

/*
 * Full matrices with entries in [-1, 1) and n + 1 added to the diagonal: in each row and column the diagonal exceeds
 * the sum of the others by 1 at least, so |inverse| <= 1 and |A| <= 2 n + 1 in the maximum norm. Elimination solves
 * (A + E) x = b with |E| <= 3 n u |L| |U|, u = EPSILON / 2, and for such matrices |L| |U| <= (2 n - 1) |A| (Higham,
 * Accuracy and Stability of Numerical Algorithms, chapter 9). With |x| <= 1 the error is at most
 * 3 n (2 n - 1) (2 n + 1) u < 12 n^3 u; the products with a stored reciprocal and the rounding of b itself,
 * n (2 n + 1) u, stay below 4 n^3 u. In float at n = 16 the sum is 4e-3: any wrong term shows.
 */
void test_dominant_systems_of_every_order(void)
{
    for (size_t n = 1U; n <= N; n++) {
        const pen_real_t order = (pen_real_t)n;
        const pen_real_t bound = (16 * order * order * order) * (EPSILON / 2);
        for (size_t i = 0U; i < n; i++) {
            wanted[i] = next_noise();
        }
        for (size_t i = 0U; i < n; i++) {
            b[i] = 0;
            for (size_t j = 0U; j < n; j++) {
                a[(i * n) + j] = next_noise() + ((i == j) ? (order + 1) : (pen_real_t)0);
                b[i] += a[(i * n) + j] * wanted[j];
            }
        }
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_solve(n, a, b));
        for (size_t i = 0U; i < n; i++) {
            TEST_ASSERT_TRUE(pen_port_abs(b[i] - wanted[i]) <= bound);
        }
        expect_end(n);
    }
}

/* Exchanging equations exchanges nothing in the solution: the same pivots are found, so the same bits come out. */
void test_order_of_the_equations_does_not_matter(void)
{
    for (size_t shift = 0U; shift < 6U; shift++) {
        noise = 7U;
        for (size_t i = 0U; i < 6U; i++) {
            const size_t row = (i + shift) % 6U;
            for (size_t j = 0U; j < 6U; j++) {
                a[(row * 6U) + j] = next_noise();
            }
            b[row] = next_noise();
        }
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_solve(6U, a, b));
        for (size_t i = 0U; i < 6U; i++) {
            wanted[i] = (shift == 0U) ? b[i] : wanted[i];
        }
        expect_solution(6U, wanted);
    }
}

void test_singular_matrices_are_reported(void)
{
    static const pen_real_t right[3] = { 1, 2, 3 };
    static const pen_real_t zero[9] = { 0 };
    static const pen_real_t equal_rows[4] = { 2, 3, 2, 3 };
    static const pen_real_t dependent[9] = { 1, 2, 3, 2, 4, 6, 1, 0, 1 };
    static const pen_real_t zero_column[9] = { 1, 0, 3, 2, 0, 6, 1, 0, 1 };
    load(1U, zero, right);
    TEST_ASSERT_EQUAL_HEX32(PEN_SINGULAR, pen_solve(1U, a, b));
    load(3U, zero, zero); /* even with b = 0 */
    TEST_ASSERT_EQUAL_HEX32(PEN_SINGULAR, pen_solve(3U, a, b));
    load(2U, equal_rows, right);
    TEST_ASSERT_EQUAL_HEX32(PEN_SINGULAR, pen_solve(2U, a, b));
    load(3U, dependent, right);
    TEST_ASSERT_EQUAL_HEX32(PEN_SINGULAR, pen_solve(3U, a, b));
    load(3U, zero_column, right);
    TEST_ASSERT_EQUAL_HEX32(PEN_SINGULAR, pen_solve(3U, a, b));
}

void test_pivots_at_the_ends_of_the_range(void)
{
    static const pen_real_t right[1] = { 0 };
    static const pen_real_t smallest[1] = { SMALLEST }; /* 1 / it is no number */
    static const pen_real_t largest[1] = { PEN_REAL_MAX };
    load(1U, smallest, right);
    TEST_ASSERT_EQUAL_HEX32(PEN_SINGULAR, pen_solve(1U, a, b));
    load(1U, largest, right);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_solve(1U, a, b));
}

void test_overflow_inside_is_reported(void)
{
    static const pen_real_t matrix[4] = { 1, PEN_REAL_MAX, -1, PEN_REAL_MAX };
    static const pen_real_t right[2] = { 1, 1 };
    load(2U, matrix, right);
    TEST_ASSERT_EQUAL_HEX32(PEN_SINGULAR, pen_solve(2U, a, b));
}

/* One bad value in any place of A or b, of a full, a diagonal, and an upper and a lower triangular matrix. */
void test_nan_or_infinity_in_any_place_is_reported(void)
{
    const volatile pen_real_t zero = 0;
    const pen_real_t bad[3] = { 1 / zero, -1 / zero, zero / zero };
    for (size_t n = 1U; n <= 5U; n++) {
        for (size_t shape = 0U; shape < 4U; shape++) {
            for (size_t i = 0U; i < (n * n); i++) {
                const bool upper = (i % n) > (i / n);
                const bool lower = (i % n) < (i / n);
                const bool there = (!upper || ((shape % 2U) == 0U)) && (!lower || (shape < 2U));
                kept[i] = there ? (next_noise() + ((upper || lower) ? (pen_real_t)0 : (pen_real_t)2)) : (pen_real_t)0;
            }
            for (size_t place = 0U; place < ((n * n) + n); place++) {
                for (size_t kind = 0U; kind < 3U; kind++) {
                    static const pen_real_t right[5] = { 1, 0, -1, 0, 1 };
                    load(n, kept, right);
                    if (place < (n * n)) {
                        a[place] = bad[kind];
                    } else {
                        b[place - (n * n)] = bad[kind];
                    }
                    TEST_ASSERT_EQUAL_HEX32(PEN_SINGULAR, pen_solve(n, a, b));
                }
            }
            load(n, kept, wanted); /* and none of it was the matrix's own fault */
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_solve(n, a, b));
        }
    }
}

/* Whatever the bits, PEN_OK means numbers. Entries from a few kinds, so that many meet. */
void test_ok_never_comes_with_a_solution_that_is_no_number(void)
{
    const volatile pen_real_t zero = 0;
    const pen_real_t kind[8] = { zero, 1, -1, SMALLEST, PEN_REAL_MAX, -PEN_REAL_MAX, 1 / zero, zero / zero };
    uint32_t solved = 0U;
    for (uint32_t trial = 0U; trial < 3000U; trial++) {
        bool good = true;
        for (size_t i = 0U; i < 12U; i++) {
            (void)next_noise();
            const uint32_t choice = (noise >> 16U) % (((trial % 4U) == 0U) ? 8U : 6U);
            good = good && (choice < 6U);
            if (i < 9U) {
                a[i] = kind[choice];
            } else {
                b[i - 9U] = kind[choice];
            }
        }
        if (pen_solve(3U, a, b) == PEN_OK) {
            solved++;
            TEST_ASSERT_TRUE(good);
            TEST_ASSERT_TRUE(is_finite(b[0]) && is_finite(b[1]) && is_finite(b[2]));
        }
    }
    TEST_ASSERT_GREATER_THAN_UINT32(10U, solved); /* the test is not hollow */
}

void test_order_out_of_range_or_null_is_refused_and_nothing_written(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, pen_solve(0U, a, b));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, pen_solve(N + 1U, a, b));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, pen_solve((size_t)-1, a, b));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, pen_solve(2U, NULL, b));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, pen_solve(2U, a, NULL));
    TEST_ASSERT_TRUE((a[0] < -98) && (b[0] < -98));
}

/* The same as pen_solve, to the bit, whichever row comes first, and the same verdict on what has no solution. */
void test_order_two_in_place(void)
{
    volatile pen_real_t zero = (pen_real_t)0;
    const pen_real_t odd[6] = { zero, zero / zero, (pen_real_t)1 / zero, (pen_real_t)-1 / zero, PEN_REAL_MAX, SMALLEST };

    for (uint32_t round = 0U; round < 3000U; round++) {
        pen_real_t matrix[4];
        pen_real_t right[2];
        pen_status_t expected;
        for (size_t i = 0U; i < 4U; i++) {
            matrix[i] = next_noise();
        }
        right[0] = next_noise();
        right[1] = next_noise();
        if (round >= 1000U) { /* one or two of them out of the ordinary */
            matrix[round % 4U] = odd[(round / 4U) % 6U];
            matrix[(round / 24U) % 4U] = odd[(round / 96U) % 6U];
        }
        if ((round % 7U) == 6U) {
            right[round % 2U] = odd[(round / 7U) % 6U];
        }
        load(2U, matrix, right);
        expected = pen_solve(2U, a, b);
        TEST_ASSERT_EQUAL_HEX32(expected, pen_solve2(matrix, right));
        if (expected == PEN_OK) {
            expect_solution(2U, right);
        }
    }
}
