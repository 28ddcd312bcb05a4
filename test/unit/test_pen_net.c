/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "penode/pen_math.h"
#include "penode/pen_net.h"
#include "penode/pen_net16.h"
#include "unity.h"

#define MAX_OUT 40U
#define MAX_IN  20U
#define POISON  (-(pen_real_t)99)

static pen_real_t weight[MAX_OUT][MAX_IN]; /* as a mathematician writes them */
static pen_real_t bias[MAX_OUT];
static pen_real_t stream[MAX_OUT * (MAX_IN + 1U)]; /* as the kernels read them */
static pen_real_t x[MAX_IN];
static pen_real_t y[MAX_OUT + 1U];
static pen_real_t nan_value;
static pen_real_t inf_value;
static uint32_t seed;

/* Eighths from -2 to 2: every product and sum below is exact in float, so expected values are exact, too. */
static pen_real_t eighth(void)
{
    seed = (seed * 1664525U) + 1013904223U;
    return ((pen_real_t)((seed >> 16U) % 33U) - (pen_real_t)16) / (pen_real_t)8;
}

void setUp(void)
{
    volatile pen_real_t zero = (pen_real_t)0;

    seed = 1U;
    nan_value = zero / zero;
    inf_value = (pen_real_t)1 / zero;
    for (size_t i = 0U; i <= MAX_OUT; i++) {
        y[i] = POISON;
    }
}

void tearDown(void) {}

/* Fill a layer and write its stream: blocks of 16, 4 and 1 rows; in each the biases, then column by column. */
static void make(size_t n_out, size_t n_in)
{
    static const size_t sizes[3] = { 16U, 4U, 1U };
    size_t row = 0U;
    size_t at = 0U;

    for (size_t r = 0U; r < n_out; r++) {
        bias[r] = eighth();
        for (size_t i = 0U; i < n_in; i++) {
            weight[r][i] = eighth();
        }
    }
    for (size_t i = 0U; i < n_in; i++) {
        x[i] = eighth();
    }
    for (size_t b = 0U; b < 3U; b++) {
        for (; (n_out - row) >= sizes[b]; row += sizes[b]) {
            for (size_t r = 0U; r < sizes[b]; r++) {
                stream[at] = bias[row + r];
                at++;
            }
            for (size_t i = 0U; i < n_in; i++) {
                for (size_t r = 0U; r < sizes[b]; r++) {
                    stream[at] = weight[row + r][i];
                    at++;
                }
            }
        }
    }
}

static pen_real_t positive(pen_real_t v)
{
    return (v > (pen_real_t)0) ? v : (pen_real_t)0;
}

static void expect_rows(size_t n_out, size_t n_in, int with_bias, int with_relu)
{
    for (size_t r = 0U; r < n_out; r++) {
        pen_real_t sum = with_bias ? bias[r] : (pen_real_t)0;
        for (size_t i = 0U; i < n_in; i++) {
            sum += weight[r][i] * (with_relu ? positive(x[i]) : x[i]);
        }
        TEST_ASSERT_TRUE(y[r] == sum);
    }
    TEST_ASSERT_TRUE(y[n_out] == POISON); /* nothing is written behind the end */
}

void test_dense_of_every_shape_is_exact(void)
{
    for (size_t n_out = 1U; n_out <= MAX_OUT; n_out++) {
        for (size_t n_in = 1U; n_in <= MAX_IN; n_in += 3U) {
            setUp();
            make(n_out, n_in);
            pen_dense(n_out, n_in, stream, x, y);
            expect_rows(n_out, n_in, 1, 0);
            pen_dense_relu(n_out, n_in, stream, x, y);
            expect_rows(n_out, n_in, 1, 1);
            pen_dense_tangent(n_out, n_in, stream, x, y);
            expect_rows(n_out, n_in, 0, 0);
        }
    }
}

void test_one_row(void)
{
    make(1U, 16U);
    y[0] = pen_dense1(16U, stream, x);
    y[1] = POISON;
    expect_rows(1U, 16U, 1, 0);
    y[0] = pen_dense1_relu(16U, stream, x);
    expect_rows(1U, 16U, 1, 1);
}

/* Value and derivative at once: each as from its own kernel, to the bit. */
void test_dense_dual(void)
{
    pen_real_t t[MAX_IN];
    pen_real_t s[MAX_OUT];
    pen_real_t expected[MAX_OUT];

    for (size_t n_out = 1U; n_out <= MAX_OUT; n_out++) {
        for (size_t n_in = 1U; n_in <= MAX_IN; n_in += 3U) {
            setUp();
            make(n_out, n_in);
            for (size_t i = 0U; i < n_in; i++) {
                t[i] = eighth();
            }
            pen_dense_dual(n_out, n_in, stream, x, t, y, s);
            expect_rows(n_out, n_in, 1, 0);
            pen_dense_tangent(n_out, n_in, stream, t, expected);
            for (size_t i = 0U; i < n_out; i++) {
                TEST_ASSERT_TRUE(s[i] == expected[i]);
            }
        }
    }
}

static uint32_t word(void)
{
    seed ^= seed << 13U;
    seed ^= seed >> 17U;
    seed ^= seed << 5U;
    return seed;
}

/* Any bits; what is special; all sizes; -1 to 1. */
static pen_real_t hostile(uint32_t kind)
{
    const pen_real_t special[] = { (pen_real_t)0, nan_value, inf_value, PEN_REAL_MAX, PEN_REAL_MIN, PEN_REAL_MIN * PEN_REAL_EPSILON };
    const uint32_t bits[2] = { word(), word() };
    const pen_real_t sign = ((bits[1] & 1U) != 0U) ? (pen_real_t)-1 : (pen_real_t)1;
    pen_real_t value = (pen_real_t)(int32_t)bits[0] / (pen_real_t)2147483648.0;

    if (kind == 0U) {
        memcpy(&value, bits, sizeof(value));
    } else if (kind == 1U) {
        value = sign * special[bits[0] % (sizeof(special) / sizeof(special[0]))];
    } else if (kind == 2U) {
        for (uint32_t k = bits[1] % 150U; k > 0U; k--) {
            value *= ((bits[1] & 256U) != 0U) ? (pen_real_t)0.5 : (pen_real_t)1.75;
        }
    } else {
        /* as it is */
    }
    return value;
}

#ifdef PEN_PORT_ROWS
#define ROUNDS 100000U
#else
#define ROUNDS 2000U
#endif

/* Sixteen rows side by side, by the port if it has a way of its own, and one after the other: the same bits. In each
 * round sixteen weights change, to -1 .. 1 or to all sizes; one may become anything, and so may every fourth row of
 * inputs. A NaN may be any NaN. */
void test_rows_side_by_side_or_one_by_one(void)
{
    static pen_real_t w[16U + (16U * MAX_IN)];
    const size_t length = sizeof(w) / sizeof(w[0]);
    size_t numbers = 0U;

    for (size_t round = 0U; round < ROUNDS; round++) {
        const uint32_t kind = (round / 4U) % 4U;
        const size_t n_in = 1U + (word() % MAX_IN);
        pen_real_t in[MAX_IN];
        pen_real_t expected[16];
        pen_real_t *const found = ((round % 2U) == 0U) ? in : y;
        for (size_t i = 0U; i < 16U; i++) {
            w[word() % length] = hostile(2U + ((round / 16U) % 2U));
        }
        w[word() % length] = hostile(kind);
        for (size_t i = 0U; i < MAX_IN; i++) {
            in[i] = hostile(((round % 4U) == 0U) ? kind : 3U);
        }
        for (size_t r = 0U; r < 16U; r++) {
            expected[r] = w[r];
            for (size_t i = 0U; i < n_in; i++) {
                expected[r] += w[(16U * i) + 16U + r] * ((pen_real_t)0.5 * (in[i] + pen_port_abs(in[i])));
            }
        }
        pen_rows_relu(n_in, w, in, found);
        for (size_t r = 0U; r < 16U; r++) {
            if (expected[r] == expected[r]) {
                TEST_ASSERT_EQUAL_MEMORY(&expected[r], &found[r], sizeof(pen_real_t));
                numbers++;
            } else {
                TEST_ASSERT_FALSE(found[r] == found[r]);
            }
        }
    }
    TEST_ASSERT_TRUE(numbers > (8U * ROUNDS));
    TEST_ASSERT_TRUE(numbers < (15U * ROUNDS));
}

/* 1-16-...-16-1 in one piece gives the bits of layer by layer, also where sums are not exact; so does its slope's value.
 * The slope against layer by layer: three sums of 16 terms, each rounding to the last digit of sums below 1000. */
void test_net16(void)
{
    static pen_real_t w[32U + (3U * 272U) + 17U];
    const pen_real_t third = (pen_real_t)1 / (pen_real_t)3;

    for (size_t i = 0U; i < (sizeof(w) / sizeof(w[0])); i++) {
        w[i] = eighth() * third;
    }
    for (size_t hidden = 1U; hidden <= 3U; hidden++) {
        for (size_t k = 0U; k < 100U; k++) {
            const pen_real_t in = eighth() * third;
            pen_real_t h[2][16];
            pen_real_t t[2][16];
            pen_real_t slope;
            pen_real_t expected;
            pen_real_t size;
            pen_dense(16U, 1U, w, &in, h[0]);
            for (size_t i = 0U; i < 16U; i++) {
                t[0][i] = w[i + 16U];
            }
            for (size_t layer = 0U; layer < hidden; layer++) {
                const pen_real_t *const p = &w[32U + (272U * layer)];
                pen_dense_relu(16U, 16U, p, h[layer & 1U], h[(layer + 1U) & 1U]);
                pen_slope_relu(16U, h[layer & 1U], t[layer & 1U]);
                pen_dense_tangent(16U, 16U, p, t[layer & 1U], t[(layer + 1U) & 1U]);
            }
            expected = pen_dense1_relu(16U, &w[32U + (272U * hidden)], h[hidden & 1U]);
            TEST_ASSERT_TRUE(pen_net16(hidden, w, in) == expected);
            TEST_ASSERT_TRUE(pen_net16_slope(hidden, w, in, &slope) == expected);
            pen_slope_relu(16U, h[hidden & 1U], t[hidden & 1U]);
            pen_dense_tangent(1U, 16U, &w[32U + (272U * hidden)], t[hidden & 1U], &expected);
            size = (pen_real_t)1000 * PEN_REAL_EPSILON;
            TEST_ASSERT_TRUE((slope - expected) <= size);
            TEST_ASSERT_TRUE((expected - slope) <= size);
        }
    }
}

/* A NaN or Inf anywhere in a network in one piece comes out as NaN or Inf. */
void test_net16_hides_nothing(void)
{
    static pen_real_t w[32U + 272U + 17U];
    const pen_real_t bad[3] = { nan_value, inf_value, -inf_value };

    for (size_t at = 0U; at < (sizeof(w) / sizeof(w[0])); at++) {
        for (size_t b = 0U; b < 3U; b++) {
            pen_real_t slope;
            seed = 7U;
            for (size_t i = 0U; i < (sizeof(w) / sizeof(w[0])); i++) {
                w[i] = eighth() + ((pen_real_t)1 / (pen_real_t)16); /* never 0 */
            }
            w[at] = bad[b];
            TEST_ASSERT_FALSE(pen_finite(1U, (const pen_real_t[1]){ pen_net16(1U, w, (pen_real_t)0.5F) }));
            TEST_ASSERT_FALSE(pen_finite(1U, (const pen_real_t[1]){ pen_net16_slope(1U, w, (pen_real_t)0.5F, &slope) }));
        }
    }
}

static void expect_nonfinite(size_t n, const pen_real_t value[])
{
    TEST_ASSERT_FALSE(pen_finite(n, value));
}

void test_nonfinite_input_of_relu_layer_reaches_every_row(void)
{
    pen_real_t bad[3];

    bad[0] = nan_value;
    bad[1] = inf_value;
    bad[2] = -inf_value; /* max(0, -Inf) would be 0 */
    for (size_t b = 0U; b < 3U; b++) {
        for (size_t i = 0U; i < 16U; i++) {
            make(21U, 16U);
            x[i] = bad[b];
            pen_dense_relu(21U, 16U, stream, x, y);
            for (size_t r = 0U; r < 21U; r++) {
                if (!(weight[r][i] == (pen_real_t)0) || (b != 1U)) {
                    expect_nonfinite(1U, &y[r]);
                }
            }
        }
    }
}

void test_activations_do_not_hide_inf(void)
{
    static void (*const act[5])(size_t, pen_real_t[]) = { pen_act_relu, pen_act_tanh, pen_act_sigmoid, pen_act_softplus, pen_act_step };

    for (size_t a = 0U; a < 5U; a++) {
        pen_real_t h[3];
        h[0] = nan_value;
        h[1] = inf_value;
        h[2] = -inf_value;
        act[a](3U, h);
        for (size_t i = 0U; i < 3U; i++) {
            expect_nonfinite(1U, &h[i]);
        }
    }
}

void test_relu_and_step_values(void)
{
    pen_real_t h[5] = { (pen_real_t)-2, (pen_real_t)-0.125, (pen_real_t)0, (pen_real_t)0.125, (pen_real_t)2 };

    pen_act_relu(5U, h);
    TEST_ASSERT_TRUE((h[0] == (pen_real_t)0) && (h[1] == (pen_real_t)0) && (h[2] == (pen_real_t)0));
    TEST_ASSERT_TRUE((h[3] == (pen_real_t)0.125) && (h[4] == (pen_real_t)2));
    h[0] = (pen_real_t)-0.5;
    h[1] = (pen_real_t)0;
    h[2] = (pen_real_t)0.5;
    pen_act_step(3U, h);
    TEST_ASSERT_TRUE((h[0] == (pen_real_t)0) && (h[1] == (pen_real_t)1) && (h[2] == (pen_real_t)1));
}

/* -5 to 5 and -0: to the bit. */
void test_smooth_activations_are_those_of_pen_math(void)
{
    static void (*const act[3])(size_t, pen_real_t[]) = { pen_act_tanh, pen_act_sigmoid, pen_act_softplus };
    static pen_real_t (*const function[3])(pen_real_t) = { pen_tanh, pen_sigmoid, pen_softplus };

    for (size_t a = 0U; a < 3U; a++) {
        pen_real_t in[82];
        pen_real_t h[83];
        for (int i = 0; i < 82; i++) {
            in[i] = (i < 81) ? ((pen_real_t)(i - 40) / (pen_real_t)8) : -(pen_real_t)0;
            h[i] = in[i];
        }
        h[82] = POISON;
        act[a](82U, h);
        for (size_t i = 0U; i < 82U; i++) {
            const pen_real_t expected = function[a](in[i]);
            TEST_ASSERT_EQUAL_MEMORY(&expected, &h[i], sizeof(expected));
        }
        TEST_ASSERT_TRUE(h[82] == POISON);
    }
}

#define SEVERAL 5U /* values, and one behind them that stays */

/* Derivatives from the value h after the activation, slope and bend:
 * tanh (1 - h^2) c, (1 - h^2) (c - 2 h a b); sigmoid h (1 - h) c, h (1 - h) (c + (1 - 2 h) a b).
 * In whole numbers, 16 h, 8 a, 8 b and 8 c from -16 to 16: everything is exact in float. */
void test_slopes_and_bends_of_tanh_and_sigmoid_are_exact(void)
{
    const pen_real_t one = (pen_real_t)1 / (pen_real_t)2048; /* 1 / (16^2 * 8) */

    for (size_t round = 0U; round < 200U; round++) {
        pen_real_t h[SEVERAL];
        pen_real_t a[SEVERAL];
        pen_real_t b[SEVERAL];
        pen_real_t c[4][SEVERAL + 1U];
        int32_t whole[4][SEVERAL]; /* of h, a, b, c */
        for (size_t i = 0U; i < SEVERAL; i++) {
            for (size_t k = 0U; k < 4U; k++) {
                whole[k][i] = (int32_t)(eighth() * (pen_real_t)8);
            }
            h[i] = (pen_real_t)whole[0][i] / (pen_real_t)16;
            a[i] = (pen_real_t)whole[1][i] / (pen_real_t)8;
            b[i] = (pen_real_t)whole[2][i] / (pen_real_t)8;
            for (size_t k = 0U; k < 4U; k++) {
                c[k][i] = (pen_real_t)whole[3][i] / (pen_real_t)8;
                c[k][SEVERAL] = POISON;
            }
        }
        pen_slope_tanh(SEVERAL, h, c[0]);
        pen_slope_sigmoid(SEVERAL, h, c[1]);
        pen_second_tanh(SEVERAL, h, a, b, c[2]);
        pen_second_sigmoid(SEVERAL, h, a, b, c[3]);
        for (size_t i = 0U; i < SEVERAL; i++) {
            const int32_t h16 = whole[0][i];
            const int32_t ab = whole[1][i] * whole[2][i];
            const int32_t c8 = whole[3][i];
            TEST_ASSERT_TRUE(c[0][i] == ((pen_real_t)((256 - (h16 * h16)) * c8) * one));
            TEST_ASSERT_TRUE(c[1][i] == ((pen_real_t)(h16 * (16 - h16) * c8) * one));
            TEST_ASSERT_TRUE(c[2][i] == ((pen_real_t)((256 - (h16 * h16)) * ((64 * c8) - (h16 * ab))) * one / (pen_real_t)64));
            TEST_ASSERT_TRUE(c[3][i] == ((pen_real_t)(h16 * (16 - h16) * ((64 * c8) + ((8 - h16) * ab))) * one / (pen_real_t)64));
        }
        for (size_t k = 0U; k < 4U; k++) {
            TEST_ASSERT_TRUE(c[k][SEVERAL] == POISON);
        }
    }
}

/*
 * softplus: slope (1 - r) t, bend (1 - r) (c + r a b) with r = e^-h, from mpmath. In units of EPSILON: r < 1 is off by 0.49
 * (0.98 ulp), 1 - r by 0.25 more, each of the other results by half of itself, as is the reference. So the slope is off by
 * (0.49 + 0.25 + 0.5 + 0.5) |t| < 2 |t|, the bend by 1.74 |c + r a b| + |a b| + 0.5 |c + r a b| < 4 (|c| + |a b|).
 */
void test_slopes_and_bends_of_softplus(void)
{
    const pen_real_t h[3] = { (pen_real_t)0.25, (pen_real_t)1, (pen_real_t)3 };
    const pen_real_t a[3] = { (pen_real_t)2, (pen_real_t)-1, (pen_real_t)1.5 };
    const pen_real_t b[3] = { (pen_real_t)3, (pen_real_t)2, (pen_real_t)1 };
    const pen_real_t c[3] = { (pen_real_t)8, (pen_real_t)1, (pen_real_t)-0.5 };
    const pen_real_t slope[3] = { (pen_real_t)1.769593735428761054, (pen_real_t)0.6321205588285576784,
                                  (pen_real_t)-0.47510646581606802851 };
    const pen_real_t bend[3] = { (pen_real_t)2.8032144755813897219, (pen_real_t)0.167032242958898419, (pen_real_t)-0.40414399152927165168 };
    pen_real_t sloped[4] = { c[0], c[1], c[2], POISON };
    pen_real_t bent[4] = { c[0], c[1], c[2], POISON };

    pen_slope_softplus(3U, h, sloped);
    pen_second_softplus(3U, h, a, b, bent);
    for (size_t i = 0U; i < 3U; i++) {
        const pen_real_t size = pen_port_abs(c[i]);
        const pen_real_t sizes = size + pen_port_abs(a[i] * b[i]);
        TEST_ASSERT_TRUE(pen_port_abs(sloped[i] - slope[i]) <= ((pen_real_t)2 * size * PEN_REAL_EPSILON));
        TEST_ASSERT_TRUE(pen_port_abs(bent[i] - bend[i]) <= ((pen_real_t)4 * sizes * PEN_REAL_EPSILON));
    }
    TEST_ASSERT_TRUE((sloped[3] == POISON) && (bent[3] == POISON));
}

/* After the activation h is 0 or 1. */
void test_slope_of_a_step_is_zero(void)
{
    const pen_real_t h[3] = { (pen_real_t)0, (pen_real_t)1, (pen_real_t)0 };
    pen_real_t t[4] = { (pen_real_t)5, (pen_real_t)-5, (pen_real_t)5, POISON };

    pen_slope_step(3U, h, t);
    TEST_ASSERT_TRUE((t[0] == (pen_real_t)0) && (t[1] == (pen_real_t)0) && (t[2] == (pen_real_t)0) && (t[3] == POISON));
}

void test_relu_slope_is_zero_at_and_below_the_kink(void)
{
    const pen_real_t h[3] = { (pen_real_t)-1, (pen_real_t)0, (pen_real_t)1 };
    pen_real_t t[3] = { (pen_real_t)5, (pen_real_t)5, (pen_real_t)5 };

    pen_slope_relu(3U, h, t);
    TEST_ASSERT_TRUE((t[0] == (pen_real_t)0) && (t[1] == (pen_real_t)0) && (t[2] == (pen_real_t)5));
}

void test_scaling_there_and_back(void)
{
    const pen_real_t p[4] = { (pen_real_t)1, (pen_real_t)-2, (pen_real_t)0.5, (pen_real_t)4 };
    const pen_real_t q[4] = { (pen_real_t)2, (pen_real_t)0.25, (pen_real_t)1, (pen_real_t)-2 };
    pen_real_t v[2] = { (pen_real_t)3, (pen_real_t)-1 };

    pen_centre(2U, p, v, v);
    TEST_ASSERT_TRUE((v[0] == (pen_real_t)1) && (v[1] == (pen_real_t)4));
    pen_rescale(2U, q, v, v);
    TEST_ASSERT_TRUE((v[0] == (pen_real_t)3) && (v[1] == (pen_real_t)-1));
    pen_centre_tangent(2U, p, v);
    TEST_ASSERT_TRUE((v[0] == (pen_real_t)1.5) && (v[1] == (pen_real_t)-4));
    pen_rescale_tangent(2U, q, v);
    TEST_ASSERT_TRUE((v[0] == (pen_real_t)3) && (v[1] == (pen_real_t)-1));
}

/* A PCA is centring and a dense layer with the components as rows: here the diagonals of a square, length sqrt(2). */
void test_pca_is_centring_and_a_dense_layer(void)
{
    const pen_real_t centre[4] = { (pen_real_t)1, (pen_real_t)1, (pen_real_t)1, (pen_real_t)1 };
    const pen_real_t component[6] = { (pen_real_t)0, (pen_real_t)0.5, (pen_real_t)0.5, (pen_real_t)0, (pen_real_t)0.5, (pen_real_t)-0.5 };
    const pen_real_t in[2] = { (pen_real_t)4, (pen_real_t)2 };
    pen_real_t h[2];

    pen_centre(2U, centre, in, h);
    pen_dense(2U, 2U, component, h, y);
    TEST_ASSERT_TRUE((y[0] == (pen_real_t)2) && (y[1] == (pen_real_t)1));
}

static const pen_real_t range[4] = { (pen_real_t)-1, (pen_real_t)10, (pen_real_t)3, (pen_real_t)20 };

void test_envelope_flag(void)
{
    const pen_real_t inside[2] = { (pen_real_t)-1, (pen_real_t)20 }; /* the edges belong to it */
    const pen_real_t low[2] = { (pen_real_t)0, (pen_real_t)9.5 };
    const pen_real_t high[2] = { (pen_real_t)3.5, (pen_real_t)15 };
    pen_real_t broken[2] = { (pen_real_t)0, (pen_real_t)15 };

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_outside(2U, range, inside));
    TEST_ASSERT_EQUAL_HEX32(PEN_OUTSIDE, pen_outside(2U, range, low));
    TEST_ASSERT_EQUAL_HEX32(PEN_OUTSIDE, pen_outside(2U, range, high));
    broken[1] = nan_value;
    TEST_ASSERT_EQUAL_HEX32(PEN_OUTSIDE, pen_outside(2U, range, broken));
}

/* What lies in its range stays as it is, to the bit, also a -0 at an edge of 0; the slope is 1 there, edges included. */
void test_clamp(void)
{
    const pen_real_t zeros[4] = { (pen_real_t)0, (pen_real_t)-1, (pen_real_t)1, (pen_real_t)0 };
    const pen_real_t inside[3][2] = { { (pen_real_t)1, (pen_real_t)15 },
                                      { (pen_real_t)-1, (pen_real_t)20 },
                                      { (pen_real_t)3, (pen_real_t)10 } };
    const pen_real_t negative_zero[2] = { -(pen_real_t)0, -(pen_real_t)0 };
    const pen_real_t low[2] = { (pen_real_t)-7, (pen_real_t)9 };
    const pen_real_t high[2] = { (pen_real_t)4, (pen_real_t)25 };
    pen_real_t v[2] = { nan_value, (pen_real_t)15 };
    pen_real_t w[2];

    for (size_t k = 0U; k < 3U; k++) {
        pen_clamp(2U, range, inside[k], w);
        TEST_ASSERT_EQUAL_MEMORY(inside[k], w, sizeof(w));
        TEST_ASSERT_TRUE(pen_clamp_slope(2U, range, inside[k], 0U) == (pen_real_t)1);
        TEST_ASSERT_TRUE(pen_clamp_slope(2U, range, inside[k], 1U) == (pen_real_t)1);
    }
    pen_clamp(2U, zeros, negative_zero, w);
    TEST_ASSERT_EQUAL_MEMORY(negative_zero, w, sizeof(w));
    pen_clamp(2U, range, low, w);
    TEST_ASSERT_TRUE((w[0] == (pen_real_t)-1) && (w[1] == (pen_real_t)10));
    pen_clamp(2U, range, high, w);
    TEST_ASSERT_TRUE((w[0] == (pen_real_t)3) && (w[1] == (pen_real_t)20));
    for (size_t i = 0U; i < 2U; i++) {
        TEST_ASSERT_TRUE(pen_clamp_slope(2U, range, low, i) == (pen_real_t)0);
        TEST_ASSERT_TRUE(pen_clamp_slope(2U, range, high, i) == (pen_real_t)0);
    }
    pen_clamp(2U, range, v, v);
    expect_nonfinite(1U, v);
    TEST_ASSERT_TRUE(v[1] == (pen_real_t)15);
}

/* Half a width of 4 and 10 is 2 and 5: trust falls from 1 to 0 over that distance, the worst input counts. */
void test_fade(void)
{
    const pen_real_t half = (pen_real_t)0.5;
    const pen_real_t inside[2] = { (pen_real_t)0, (pen_real_t)12 };
    const pen_real_t near_edge[2] = { (pen_real_t)-1.5, (pen_real_t)12 };
    const pen_real_t both[2] = { (pen_real_t)-1.5, (pen_real_t)22.5 };
    const pen_real_t far[2] = { (pen_real_t)0, (pen_real_t)30 };
    const pen_real_t edge[2] = { (pen_real_t)-1, (pen_real_t)20 };
    const pen_real_t end[2] = { (pen_real_t)-3, (pen_real_t)12 };
    pen_real_t broken[2] = { (pen_real_t)0, (pen_real_t)0 };

    TEST_ASSERT_TRUE(pen_fade(2U, range, half, inside) == (pen_real_t)1);
    TEST_ASSERT_TRUE(pen_fade(2U, range, half, near_edge) == (pen_real_t)0.75);
    TEST_ASSERT_TRUE(pen_fade(2U, range, half, both) == (pen_real_t)0.5);
    TEST_ASSERT_TRUE(pen_fade(2U, range, half, far) == (pen_real_t)0);
    TEST_ASSERT_TRUE(pen_fade(2U, range, half, edge) == (pen_real_t)1);
    TEST_ASSERT_TRUE(pen_fade(2U, range, half, end) == (pen_real_t)0);
    for (size_t i = 0U; i < 2U; i++) { /* at an edge as inside; where trust ends as beyond */
        TEST_ASSERT_TRUE(pen_fade_slope(2U, range, half, inside, i) == (pen_real_t)0);
        TEST_ASSERT_TRUE(pen_fade_slope(2U, range, half, edge, i) == (pen_real_t)0);
        TEST_ASSERT_TRUE(pen_fade_slope(2U, range, half, end, i) == (pen_real_t)0);
    }
    TEST_ASSERT_TRUE(pen_fade_slope(2U, range, half, near_edge, 0U) == (pen_real_t)0.5);
    TEST_ASSERT_TRUE(pen_fade_slope(2U, range, half, both, 0U) == (pen_real_t)0); /* the other input counts */
    TEST_ASSERT_TRUE(pen_fade_slope(2U, range, half, both, 1U) == (pen_real_t)-0.2);
    TEST_ASSERT_TRUE(pen_fade_slope(2U, range, half, far, 1U) == (pen_real_t)0);
    broken[0] = nan_value;
    expect_nonfinite(1U, (pen_real_t[1]){ pen_fade(2U, range, half, broken) });
}
