/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* What a set goes through before it is published, on a model made by hand: two networks of |x|, one, both or none with a promise. */

#include <stddef.h>
#include <stdint.h>

#include "penode/pen_instance.h"
#include "unity.h"

#define LAYOUT   0x13579bdU
#define SOURCE   0x2468ace0U
#define NETWORK  9U
#define N        (2U * NETWORK)
#define ROOM     8U
#define NETWORKS 2U

static const pen_layer_t layer[2] = { { PEN_LAYER_RELU, 1U, 2U }, { PEN_LAYER_DENSE, 2U, 1U } };
static const pen_promise_t promise = { PEN_PROMISE_MAX_SLOPE, 100U, (pen_real_t)0, (pen_real_t)1.5F, (pen_real_t)0 };
static const pen_promise_t rising = { PEN_PROMISE_INCREASING, 100U, (pen_real_t)0, (pen_real_t)0, (pen_real_t)0 };
static const pen_real_t bow[NETWORK] = {
    (pen_real_t)-3, (pen_real_t)2, (pen_real_t)0, (pen_real_t)1, (pen_real_t)0, (pen_real_t)-1, (pen_real_t)0, (pen_real_t)1, (pen_real_t)1,
};

static pen_network_t network[NETWORKS];
static pen_model_t model;
static pen_instance_t instance;
static pen_piece_t piece[NETWORKS * ROOM];
static pen_real_t value[N];
static pen_breach_t breach;

void setUp(void)
{
    for (uint32_t i = 0U; i < NETWORKS; i++) {
        const pen_network_t bare = { { layer, 2U, 2U, 2U }, i * NETWORK, NULL };
        network[i] = bare;
    }
    for (uint32_t i = 0U; i < N; i++) {
        value[i] = bow[i % NETWORK];
    }
    const pen_model_t plain = { LAYOUT, N, SOURCE, PEN_DAMAGE_REPORT, true, false, 0U, NETWORKS, network, 0U, NULL };
    model = plain;
    breach.network = 9U;
    breach.kind = 9U;
}

void tearDown(void) {}

static pen_status_t prepare(void)
{
    pen_real_t work[8U * 2U];
    bool active[2];

    return pen_prepare(&model, value, work, active, piece, &breach);
}

void test_nothing_promised_and_nothing_folded(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, prepare());
    TEST_ASSERT_EQUAL_UINT32(9U, breach.network);
}

void test_the_network_that_breaks_its_promise_is_named(void)
{
    for (uint32_t pieces = 0U; pieces <= ROOM; pieces += ROOM) { /* layer by layer, folded */
        for (uint32_t i = 0U; i < NETWORKS; i++) {
            setUp();
            model.pieces = pieces;
            network[i].promise = &promise;
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, prepare());
            TEST_ASSERT_EQUAL_UINT32(9U, breach.network);
            value[((1U - i) * NETWORK) + 8U] = (pen_real_t)2; /* of the other: nothing was promised */
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, prepare());
            value[(i * NETWORK) + 8U] = (pen_real_t)2;
            TEST_ASSERT_EQUAL_HEX32(PEN_SET_PROMISE, prepare());
            TEST_ASSERT_EQUAL_UINT32(i, breach.network);
            TEST_ASSERT_EQUAL_HEX32(PEN_PROMISE_MAX_SLOPE, breach.kind);
        }
    }
}

void test_too_many_pieces_and_a_broken_promise(void)
{
    model.pieces = 2U; /* two pieces and the ends outside do not fit */
    network[1].promise = &rising;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_PIECES | PEN_SET_PROMISE, prepare());
    model.layers = true;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_PROMISE, prepare());
    TEST_ASSERT_EQUAL_UINT32(1U, breach.network);
    TEST_ASSERT_EQUAL_HEX32(PEN_PROMISE_INCREASING, breach.kind);
    network[1].promise = &promise;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, prepare());
}

void test_the_breach_is_told(void)
{
    const pen_set_head_t head = { LAYOUT, N, 1U, pen_set_checksum(value, N) };
    const pen_set_t set = { head, value };
    pen_breach_t told = { 9U, 9U, (pen_real_t)9 };

    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tune_breach(&model, NULL, &told));
    instance.ready = 0U;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tune_breach(&model, &instance, &told));
    TEST_ASSERT_EQUAL_UINT32(9U, told.network);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_ready(&model, &instance, NULL, pen_init(&model, &instance, &set, NULL, NULL)));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tune_breach(&model, &instance, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tune_breach(&model, &instance, &told)); /* none so far */
    TEST_ASSERT_EQUAL_UINT32(0U, told.network | told.kind);
    instance.breach.network = 1U;
    instance.breach.kind = PEN_PROMISE_MAX_FORCE;
    instance.breach.at = (pen_real_t)-2;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tune_breach(&model, &instance, &told));
    TEST_ASSERT_EQUAL_UINT32(1U, told.network);
    TEST_ASSERT_EQUAL_HEX32(PEN_PROMISE_MAX_FORCE, told.kind);
    TEST_ASSERT_TRUE((told.at <= (pen_real_t)-2) && (told.at >= (pen_real_t)-2));
}
