/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* Networks whose pieces are known by hand; `make prove-promise` takes random ones in exact arithmetic. */

#include "penode/pen_promise.h"

#include "unity.h"

#define LOOKS 400U

static pen_real_t work[8U * 17U];
static bool active[17];
static pen_breach_t breach;

void setUp(void) {}
void tearDown(void) {}

/* max(0, x) a + max(0, -x) b + c: two pieces that meet at 0. */
static const pen_layer_t bow_layer[2] = { { PEN_LAYER_RELU, 1U, 2U }, { PEN_LAYER_DENSE, 2U, 1U } };
static const pen_chain_t bow = { bow_layer, 2U, 2U, 2U };

static bool kept(const pen_chain_t *chain, const pen_real_t p[], bool clamp, uint32_t kind, pen_real_t limit)
{
    const pen_promise_t promise = { kind, LOOKS, limit, limit, limit };
    bool good;

    breach.kind = 0U;
    good = pen_promise_kept(&promise, chain, p, clamp, 0U, NULL, work, active, &breach);
    TEST_ASSERT_EQUAL_HEX32(good ? 0U : kind, breach.kind);
    return good;
}

static bool bow_keeps(double a, double b, double c, bool clamp, uint32_t kind, double limit)
{
    const pen_real_t p[9] = { (pen_real_t)-2, (pen_real_t)4, (pen_real_t)0, (pen_real_t)1, (pen_real_t)0,
                              (pen_real_t)-1, (pen_real_t)c, (pen_real_t)a, (pen_real_t)b };

    return kept(&bow, p, clamp, kind, (pen_real_t)limit);
}

void test_directions(void)
{
    TEST_ASSERT_TRUE(bow_keeps(3.0, -2.0, 1.0, false, PEN_PROMISE_INCREASING, 0.0));
    TEST_ASSERT_FALSE(bow_keeps(3.0, -2.0, 1.0, false, PEN_PROMISE_DECREASING, 0.0));
    TEST_ASSERT_TRUE(bow_keeps(-3.0, 2.0, 1.0, true, PEN_PROMISE_DECREASING, 0.0));
    TEST_ASSERT_FALSE(bow_keeps(3.0, 1e-30, 1.0, false, PEN_PROMISE_INCREASING, 0.0));
    TEST_ASSERT_FALSE(bow_keeps(-1e-30, -1.0, 1.0, false, PEN_PROMISE_INCREASING, 0.0));
}

void test_slopes(void)
{
    TEST_ASSERT_TRUE(bow_keeps(3.0, -2.0, 1.0, false, PEN_PROMISE_MAX_SLOPE, 3.0001));
    TEST_ASSERT_FALSE(bow_keeps(3.0, -2.0, 1.0, false, PEN_PROMISE_MAX_SLOPE, 2.9999));
    TEST_ASSERT_FALSE(bow_keeps(3.0, 4.0, 1.0, false, PEN_PROMISE_MAX_SLOPE, 3.9999));
    TEST_ASSERT_TRUE(bow_keeps(3.0, 4.0, 1.0, true, PEN_PROMISE_MAX_SLOPE, 4.0001));
}

/* Going on, a force is bounded only where the outer pieces are flat; clamped at -2 and 4 always. */
void test_forces(void)
{
    TEST_ASSERT_FALSE(bow_keeps(3.0, -2.0, 1.0, false, PEN_PROMISE_MAX_FORCE, 1e6));
    TEST_ASSERT_TRUE(bow_keeps(3.0, -2.0, 1.0, true, PEN_PROMISE_MAX_FORCE, 13.001));
    TEST_ASSERT_FALSE(bow_keeps(3.0, -2.0, 1.0, true, PEN_PROMISE_MAX_FORCE, 12.999));
    TEST_ASSERT_FALSE(bow_keeps(1.0, 9.0, 1.0, true, PEN_PROMISE_MAX_FORCE, 18.999));
    TEST_ASSERT_TRUE(bow_keeps(1.0, 9.0, 1.0, true, PEN_PROMISE_MAX_FORCE, 19.001));
}

void test_dissipation(void)
{
    TEST_ASSERT_TRUE(bow_keeps(3.0, -2.0, 0.0, false, PEN_PROMISE_DISSIPATIVE, 0.0));
    TEST_ASSERT_FALSE(bow_keeps(3.0, -2.0, 1e-30, false, PEN_PROMISE_DISSIPATIVE, 0.0));
    TEST_ASSERT_TRUE(bow_keeps(3.0, -2.0, 0.5, false, PEN_PROMISE_DISSIPATIVE, 0.51));
    TEST_ASSERT_FALSE(bow_keeps(3.0, -2.0, 0.5, false, PEN_PROMISE_DISSIPATIVE, 0.49));
    TEST_ASSERT_FALSE(bow_keeps(3.0, -2.0, -0.5, false, PEN_PROMISE_DISSIPATIVE, 0.49));
    TEST_ASSERT_FALSE(bow_keeps(-1e-6, -2.0, 0.0, false, PEN_PROMISE_DISSIPATIVE, 1.0)); /* far outside */
    TEST_ASSERT_TRUE(bow_keeps(-1e-6, -2.0, 0.0, true, PEN_PROMISE_DISSIPATIVE, 1.0));
    TEST_ASSERT_FALSE(bow_keeps(-1.0, -2.0, 0.0, true, PEN_PROMISE_DISSIPATIVE, 3.9));
}

/* The step sees the edge of the envelope at 0 if 0 lies outside. */
void test_an_envelope_without_zero(void)
{
    pen_real_t p[9] = { (pen_real_t)1,  (pen_real_t)4,  (pen_real_t)0, (pen_real_t)1, (pen_real_t)0,
                        (pen_real_t)-1, (pen_real_t)-1, (pen_real_t)1, (pen_real_t)0 };

    TEST_ASSERT_TRUE(kept(&bow, p, true, PEN_PROMISE_ZERO_AT_ZERO, (pen_real_t)0));
    TEST_ASSERT_TRUE(kept(&bow, p, true, PEN_PROMISE_DISSIPATIVE, (pen_real_t)0.001F));
    TEST_ASSERT_FALSE(kept(&bow, p, false, PEN_PROMISE_ZERO_AT_ZERO, (pen_real_t)0));
    TEST_ASSERT_FALSE(kept(&bow, p, false, PEN_PROMISE_DISSIPATIVE, (pen_real_t)0.001F));
    p[0] = (pen_real_t)-4;
    p[1] = (pen_real_t)-1;
    p[6] = (pen_real_t)1;
    p[7] = (pen_real_t)0;
    p[8] = (pen_real_t)-1;
    TEST_ASSERT_TRUE(kept(&bow, p, true, PEN_PROMISE_ZERO_AT_ZERO, (pen_real_t)0));
    TEST_ASSERT_TRUE(kept(&bow, p, true, PEN_PROMISE_DISSIPATIVE, (pen_real_t)0.001F));
    TEST_ASSERT_TRUE(breach.kind == 0U);
}

void test_the_place(void)
{
    TEST_ASSERT_FALSE(bow_keeps(1.0, 9.0, 1.0, false, PEN_PROMISE_MAX_SLOPE, 8.0)); /* below 0 */
    TEST_ASSERT_TRUE(breach.at <= (pen_real_t)0);
    TEST_ASSERT_FALSE(bow_keeps(1.0, -1.0, 0.0, true, PEN_PROMISE_MAX_FORCE, 3.5)); /* at the edge, 4 */
    TEST_ASSERT_TRUE((breach.at >= (pen_real_t)4) && (breach.at <= (pen_real_t)4));
}

/* A network that keeps its promises leaves what was found of another. */
void test_a_kept_promise_writes_no_breach(void)
{
    TEST_ASSERT_FALSE(bow_keeps(1.0, -1.0, 0.0, true, PEN_PROMISE_MAX_FORCE, 3.5));
    {
        static const pen_promise_t promise = { PEN_PROMISE_INCREASING, LOOKS, (pen_real_t)0, (pen_real_t)0, (pen_real_t)0 };
        static const pen_real_t p[9] = { (pen_real_t)-2, (pen_real_t)4, (pen_real_t)1, (pen_real_t)1, (pen_real_t)1,
                                         (pen_real_t)-1, (pen_real_t)0, (pen_real_t)1, (pen_real_t)-1 };
        const pen_real_t at = breach.at;
        TEST_ASSERT_TRUE(pen_promise_kept(&promise, &bow, p, false, 0U, NULL, work, active, &breach));
        TEST_ASSERT_EQUAL_HEX32(PEN_PROMISE_MAX_FORCE, breach.kind);
        TEST_ASSERT_TRUE((breach.at >= at) && (breach.at <= at));
    }
}

/* The folded form: what the piece at 0 gives. */
void test_zero_of_a_folded_network(void)
{
    static const pen_promise_t promise = { PEN_PROMISE_ZERO_AT_ZERO, 0U, (pen_real_t)0, (pen_real_t)0, (pen_real_t)0 };
    pen_piece_t piece[4];
    const pen_real_t p[9] = { (pen_real_t)-2, (pen_real_t)4, (pen_real_t)0, (pen_real_t)1, (pen_real_t)0,
                              (pen_real_t)-1, (pen_real_t)0, (pen_real_t)1, (pen_real_t)1 };

    for (size_t i = 0U; i < 4U; i++) {
        piece[i].start = (pen_real_t)0;
        piece[i].offset = (pen_real_t)0;
        piece[i].slope = (pen_real_t)1;
        piece[i].status = PEN_OK;
    }
    TEST_ASSERT_TRUE(pen_promise_kept(&promise, &bow, p, false, 4U, piece, work, active, &breach));
    piece[3].offset = (pen_real_t)1e-30F;
    TEST_ASSERT_FALSE(pen_promise_kept(&promise, &bow, p, false, 4U, piece, work, active, &breach));
    TEST_ASSERT_EQUAL_HEX32(PEN_PROMISE_ZERO_AT_ZERO, breach.kind);
}

/* Scaled there and back, an activation at the end: max(0, ((x + 1) 2 - 2) / 2 3) = max(0, 3 x). */
void test_scaled_and_rectified(void)
{
    static const pen_layer_t layer[4] = {
        { PEN_LAYER_CENTRE, 1U, 1U }, { PEN_LAYER_RELU, 1U, 1U }, { PEN_LAYER_RESCALE, 1U, 1U }, { PEN_LAYER_RELU, 1U, 1U }
    };
    static const pen_chain_t chain = { layer, 4U, 1U, 2U };
    static const pen_real_t p[10] = { (pen_real_t)-1, (pen_real_t)1,    (pen_real_t)-1, (pen_real_t)2, (pen_real_t)0,
                                      (pen_real_t)1,  (pen_real_t)0.5F, (pen_real_t)-1, (pen_real_t)0, (pen_real_t)3 };
    static const pen_layer_t back_layer[3] = { { PEN_LAYER_RELU, 1U, 1U }, { PEN_LAYER_CENTRE, 1U, 1U }, { PEN_LAYER_DENSE, 1U, 1U } };
    static const pen_chain_t back = { back_layer, 3U, 1U, 1U };
    static const pen_real_t q[8] = { (pen_real_t)-1, (pen_real_t)1,    (pen_real_t)0, (pen_real_t)1,
                                     (pen_real_t)2,  (pen_real_t)0.5F, (pen_real_t)1, (pen_real_t)1 };

    TEST_ASSERT_TRUE(kept(&chain, p, false, PEN_PROMISE_ZERO_AT_ZERO, (pen_real_t)0));
    TEST_ASSERT_TRUE(kept(&chain, p, false, PEN_PROMISE_MAX_SLOPE, (pen_real_t)3.001F));
    TEST_ASSERT_FALSE(kept(&chain, p, false, PEN_PROMISE_MAX_SLOPE, (pen_real_t)2.999F));
    TEST_ASSERT_TRUE(kept(&chain, p, false, PEN_PROMISE_INCREASING, (pen_real_t)0));
    TEST_ASSERT_TRUE(kept(&back, q, false, PEN_PROMISE_ZERO_AT_ZERO, (pen_real_t)0)); /* (0 - 2) / 2 + 1 */
    TEST_ASSERT_TRUE(kept(&back, q, false, PEN_PROMISE_MAX_SLOPE, (pen_real_t)0.501F));
}

/*
 * n steps up and down, a number apart at 1: sum of (-1)^i max(0, x - 1 - i EPS) for i < n, and 0.3 x against them. Three kinks lie
 * closer than their errors: every combination is gone through; nine: each counts as any slope.
 */
static bool stairs_keep(size_t n, uint32_t kind, pen_real_t limit)
{
    const size_t all = n + 2U;
    const pen_layer_t layer[2] = { { PEN_LAYER_RELU, 1U, (uint32_t)all }, { PEN_LAYER_DENSE, (uint32_t)all, 1U } };
    const pen_chain_t chain = { layer, 2U, (uint32_t)all, (uint32_t)all };
    pen_real_t p[2U + 22U + 12U] = { (pen_real_t)-2, (pen_real_t)4 };

    for (size_t i = 0U; i < all; i++) {
        const size_t block = (i < (all - (all % 4U))) ? 4U : 1U;
        const size_t first = i - (i % block);
        const size_t at = 2U + (first * 2U) + (i - first);
        const bool pass = (i >= n);
        p[at] = pass ? (pen_real_t)0 : ((pen_real_t)-1 - ((pen_real_t)i * PEN_REAL_EPSILON));
        p[at + block] = (i == (n + 1U)) ? (pen_real_t)-1 : (pen_real_t)1;
        p[2U + (2U * all) + 1U + i] = ((i % 2U) == 0U) ? (pen_real_t)1 : (pen_real_t)-1;
    }
    p[2U + (2U * all)] = (pen_real_t)0;
    p[2U + (2U * all) + 1U + n] = (pen_real_t)-0.3F;
    p[2U + (2U * all) + 2U + n] = (pen_real_t)0.3F;
    return kept(&chain, p, true, kind, limit);
}

void test_kinks_closer_than_their_errors(void)
{
    TEST_ASSERT_FALSE(stairs_keep(2U, PEN_PROMISE_DECREASING, (pen_real_t)0)); /* 0.7 between two kinks, -0.3 elsewhere */
    TEST_ASSERT_FALSE(stairs_keep(8U, PEN_PROMISE_DECREASING, (pen_real_t)0));
    TEST_ASSERT_FALSE(stairs_keep(2U, PEN_PROMISE_MAX_SLOPE, (pen_real_t)0.69F));
    TEST_ASSERT_FALSE(stairs_keep(8U, PEN_PROMISE_MAX_SLOPE, (pen_real_t)0.69F));
    TEST_ASSERT_TRUE(stairs_keep(2U, PEN_PROMISE_MAX_SLOPE, (pen_real_t)1.31F)); /* only the second on */
    TEST_ASSERT_TRUE(stairs_keep(8U, PEN_PROMISE_MAX_SLOPE, (pen_real_t)4.31F)); /* every other one */
}

/* 17 neurons, a block of 16 rows and one of its own: sum of i max(0, x + i + 1) for i < 16, and 100 max(0, x + 17). */
void test_a_layer_of_seventeen(void)
{
    static const pen_layer_t layer[2] = { { PEN_LAYER_RELU, 1U, 17U }, { PEN_LAYER_DENSE, 17U, 1U } };
    static const pen_chain_t chain = { layer, 2U, 17U, 17U };
    pen_real_t p[2U + 34U + 18U] = { (pen_real_t)-2, (pen_real_t)4 };

    for (size_t i = 0U; i < 17U; i++) {
        const size_t at = (i < 16U) ? (2U + i) : (2U + 32U);
        p[at] = (pen_real_t)(i + 1U);
        p[at + ((i < 16U) ? 16U : 1U)] = (pen_real_t)1;
        p[2U + 34U + 1U + i] = (i < 16U) ? (pen_real_t)i : (pen_real_t)100;
    }
    TEST_ASSERT_TRUE(kept(&chain, p, false, PEN_PROMISE_MAX_SLOPE, (pen_real_t)220.01F)); /* 0 + 1 + ... + 15 + 100 */
    TEST_ASSERT_FALSE(kept(&chain, p, false, PEN_PROMISE_MAX_SLOPE, (pen_real_t)219.99F));
    TEST_ASSERT_TRUE(kept(&chain, p, true, PEN_PROMISE_MAX_FORCE, (pen_real_t)3940.1F)); /* 120 * 4 + 1360 + 100 * 21 */
    TEST_ASSERT_FALSE(kept(&chain, p, true, PEN_PROMISE_MAX_FORCE, (pen_real_t)3939.9F));
}

/* A neuron whose input cancels, to within its rounding: it may go either way, and a large weight shows it. */
void test_slopes_that_cancel(void)
{
    static const pen_layer_t layer[3] = { { PEN_LAYER_RELU, 1U, 2U }, { PEN_LAYER_RELU, 2U, 1U }, { PEN_LAYER_DENSE, 1U, 1U } };
    static const pen_chain_t chain = { layer, 3U, 2U, 3U };
    const pen_real_t p[11] = { (pen_real_t)-2, (pen_real_t)4, (pen_real_t)3,  (pen_real_t)1, (pen_real_t)3,
                               (pen_real_t)1, /* twice x + 3 */
                               (pen_real_t)0,  (pen_real_t)1, (pen_real_t)-1, (pen_real_t)0, (pen_real_t)1 / PEN_REAL_EPSILON };

    TEST_ASSERT_TRUE(kept(&chain, p, true, PEN_PROMISE_MAX_SLOPE, (pen_real_t)50)); /* (4 + 12 + 11) EPS times 2 / EPS */
    TEST_ASSERT_FALSE(kept(&chain, p, true, PEN_PROMISE_MAX_SLOPE, (pen_real_t)0.5F));
}

/* Infinite intermediate results prove nothing. */
void test_overflow(void)
{
    const pen_real_t big = PEN_REAL_MAX * (pen_real_t)0.5F;
    const pen_real_t p[9] = { (pen_real_t)-2, (pen_real_t)4, (pen_real_t)0, big, (pen_real_t)0, -big, (pen_real_t)0, big, -big };

    TEST_ASSERT_FALSE(kept(&bow, p, true, PEN_PROMISE_MAX_FORCE, PEN_REAL_MAX));
    TEST_ASSERT_FALSE(kept(&bow, p, true, PEN_PROMISE_MAX_SLOPE, PEN_REAL_MAX));
}

void test_no_more_evaluations_than_allowed(void)
{
    static const pen_real_t p[9] = { (pen_real_t)-2, (pen_real_t)4, (pen_real_t)1, (pen_real_t)1, (pen_real_t)1,
                                     (pen_real_t)-1, (pen_real_t)0, (pen_real_t)1, (pen_real_t)-1 };
    pen_promise_t promise = { PEN_PROMISE_INCREASING, 0U, (pen_real_t)0, (pen_real_t)0, (pen_real_t)0 };
    bool good = false;

    for (uint32_t looks = 0U; looks < 20U; looks++) {
        promise.looks = looks;
        breach.kind = 0U;
        good = pen_promise_kept(&promise, &bow, p, false, 0U, NULL, work, active, &breach);
        TEST_ASSERT_EQUAL_HEX32(good ? 0U : PEN_PROMISE_INCREASING, breach.kind);
        TEST_ASSERT_TRUE(!good || (looks >= 6U)); /* two kinks, two ends: six cells */
    }
    TEST_ASSERT_TRUE(good);
    promise.kinds = 0U; /* nothing promised, nothing looked at */
    promise.looks = 0U;
    TEST_ASSERT_TRUE(pen_promise_kept(&promise, &bow, p, false, 0U, NULL, work, active, &breach));
}
