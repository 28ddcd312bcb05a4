/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "penode/pen_fold.h"
#include "penode/pen_net.h"
#include "unity.h"

#define ROOM 96U

static pen_piece_t piece[ROOM];
static pen_real_t line[4U * 16U];
static bool active[48];
static uint32_t seed = 1U;

void setUp(void) {}
void tearDown(void) {}

/* A number from -1 to 1. */
static pen_real_t draw(void)
{
    seed = (1664525U * seed) + 1013904223U;
    return ((pen_real_t)(seed >> 8U) / (pen_real_t)8388608) - (pen_real_t)1;
}

static pen_real_t value(size_t capacity, pen_real_t x, pen_status_t *status)
{
    *status = PEN_OK;
    return pen_fold_value(piece, pen_fold_find(capacity, piece, x), x, status);
}

static void expect(size_t capacity, pen_real_t x, pen_real_t expected, pen_status_t expected_status)
{
    pen_status_t status;
    const pen_real_t y = value(capacity, x, &status);

    TEST_ASSERT_TRUE(!(y > expected) && !(y < expected));
    TEST_ASSERT_EQUAL_HEX32(expected_status, status);
}

/* max(0, x + 1) - 2 max(0, x) + max(0, x - 1): a tent from -1 to 1 of height 1. Then envelope and layers. */
static const pen_layer_t tent_layer[2] = { { PEN_LAYER_RELU, 1U, 3U }, { PEN_LAYER_DENSE, 3U, 1U } };
static const pen_chain_t tent = { tent_layer, 2U, 3U, 3U };
/* clang-format off */ /* one row of a layer a line */
static const pen_real_t tent_value[12] = {
    (pen_real_t)-3, (pen_real_t)2,                  /* envelope */
    (pen_real_t)1, (pen_real_t)1,                   /* one row at a time: bias, weight */
    (pen_real_t)0, (pen_real_t)1, (pen_real_t)-1, (pen_real_t)1,
    (pen_real_t)0, (pen_real_t)1, (pen_real_t)-2, (pen_real_t)1,
};
/* clang-format on */

/* Whole numbers and halves: no rounding, so the result is exact. */
void test_a_tent(void)
{
    static const pen_real_t x[9] = { (pen_real_t)-5,    (pen_real_t)-3, (pen_real_t)-1, (pen_real_t)-0.5F, (pen_real_t)0,
                                     (pen_real_t)0.25F, (pen_real_t)1,  (pen_real_t)2,  (pen_real_t)7 };
    static const pen_real_t expected[9] = { (pen_real_t)0,     (pen_real_t)0, (pen_real_t)0, (pen_real_t)0.5F, (pen_real_t)1,
                                            (pen_real_t)0.75F, (pen_real_t)0, (pen_real_t)0, (pen_real_t)0 };

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_fold(&tent, tent_value, false, line, active, 12U, piece));
    TEST_ASSERT_TRUE(!(piece[0].start > (pen_real_t)-0.5F) && !(piece[0].start < (pen_real_t)-0.5F)); /* the centre */
    for (size_t i = 0U; i < 9U; i++) {
        pen_status_t status;
        const pen_real_t y = value(12U, x[i], &status);
        TEST_ASSERT_TRUE(!(y > expected[i]) && !(y < expected[i]));
        TEST_ASSERT_EQUAL_HEX32(((i == 0U) || (i == 8U)) ? PEN_OUTSIDE : PEN_OK, status);
    }
}

void test_clamped_outside_of_the_envelope(void)
{
    pen_real_t p[12];
    pen_status_t status;
    pen_real_t y;

    for (size_t i = 0U; i < 12U; i++) {
        p[i] = tent_value[i];
    }
    p[0] = (pen_real_t)-0.5F;
    p[1] = (pen_real_t)0.75F;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_fold(&tent, p, true, line, active, 8U, piece));
    y = value(8U, (pen_real_t)-9, &status);
    TEST_ASSERT_TRUE(!(y > (pen_real_t)0.5F) && !(y < (pen_real_t)0.5F));
    TEST_ASSERT_EQUAL_HEX32(PEN_OUTSIDE, status);
    y = value(8U, (pen_real_t)1, &status);
    TEST_ASSERT_TRUE(!(y > (pen_real_t)0.25F) && !(y < (pen_real_t)0.25F));
    TEST_ASSERT_EQUAL_HEX32(PEN_OUTSIDE, status);
}

/* The smallest number above the highest trained input is outside, that input is not: for numbers of every size and sign.
 * A network that only passes its input on; going up by bits is going up by numbers. */
void test_the_envelope_ends_at_the_last_number(void)
{
    static const pen_layer_t pass_layer[1] = { { PEN_LAYER_DENSE, 1U, 1U } };
    static const pen_chain_t pass = { pass_layer, 1U, 1U, 0U };

    for (uint32_t i = 0U; i < 2000U; i++) {
        pen_real_t high = draw();
        pen_real_t step;
        pen_real_t p[4] = { (pen_real_t)0, (pen_real_t)0, (pen_real_t)0, (pen_real_t)1 };
        pen_status_t status;
        for (uint32_t k = 0U; k < (i % 120U); k++) {
            high *= ((i & 1U) == 0U) ? (pen_real_t)2 : (pen_real_t)0.5F;
        }
        p[0] = (high < (pen_real_t)0) ? (high * (pen_real_t)4) : -high;
        p[1] = high;
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_fold(&pass, p, false, line, active, 4U, piece));
        (void)value(4U, high, &status);
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, status);
        step = pen_port_abs(high) * PEN_REAL_EPSILON; /* 1 to 2 numbers up, halved until adding it does nothing */
        while ((high + (step * (pen_real_t)0.5F)) > high) {
            step *= (pen_real_t)0.5F;
        }
        (void)value(4U, high + step, &status);
        TEST_ASSERT_EQUAL_HEX32(PEN_OUTSIDE, status);
    }
}

void test_too_many_pieces(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_PIECES, pen_fold(&tent, tent_value, false, line, active, 4U, piece));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_PIECES, pen_fold(&tent, tent_value, false, line, active, 6U, piece));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_fold(&tent, tent_value, false, line, active, 8U, piece)); /* 4, 2 edges, the centre */
}

/* The tent in an envelope from kink to kink, with a kink at its centre: four pieces, so room for four is enough. */
void test_kinks_on_the_edges_and_at_the_centre_take_no_room(void)
{
    pen_real_t p[12];

    for (size_t i = 0U; i < 12U; i++) {
        p[i] = tent_value[i];
    }
    p[0] = (pen_real_t)-1;
    p[1] = (pen_real_t)1;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_fold(&tent, p, false, line, active, 4U, piece));
    expect(4U, (pen_real_t)-2, (pen_real_t)0, PEN_OUTSIDE);
    expect(4U, (pen_real_t)-1, (pen_real_t)0, PEN_OK);
    expect(4U, (pen_real_t)-0.5F, (pen_real_t)0.5F, PEN_OK);
    expect(4U, (pen_real_t)0, (pen_real_t)1, PEN_OK);
    expect(4U, (pen_real_t)0.75F, (pen_real_t)0.25F, PEN_OK);
    expect(4U, (pen_real_t)1, (pen_real_t)0, PEN_OK);
    expect(4U, (pen_real_t)2, (pen_real_t)0, PEN_OUTSIDE);
}

/* max(0, x + 1) - max(0, x) - max(0, x): five pieces and the centre, not six, although three neurons switch. */
void test_neurons_that_switch_at_one_place_end_one_piece(void)
{
    static const pen_real_t p[12] = {
        (pen_real_t)-3, (pen_real_t)2, (pen_real_t)1, (pen_real_t)1, (pen_real_t)0,  (pen_real_t)1,
        (pen_real_t)0,  (pen_real_t)1, (pen_real_t)0, (pen_real_t)1, (pen_real_t)-1, (pen_real_t)-1,
    };

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_fold(&tent, p, false, line, active, 6U, piece));
    expect(6U, (pen_real_t)-5, (pen_real_t)0, PEN_OUTSIDE);
    expect(6U, (pen_real_t)-2, (pen_real_t)0, PEN_OK);
    expect(6U, (pen_real_t)-0.75F, (pen_real_t)0.25F, PEN_OK);
    expect(6U, (pen_real_t)-0.25F, (pen_real_t)0.75F, PEN_OK);
    expect(6U, (pen_real_t)2, (pen_real_t)-1, PEN_OK);
    expect(6U, (pen_real_t)5, (pen_real_t)-4, PEN_OUTSIDE);
}

/* The look-up against going through the table, for every capacity it is made for. */
void test_find(void)
{
    static const size_t capacity[8] = { 4U, 6U, 8U, 12U, 16U, 48U, 64U, 96U };

    for (size_t c = 0U; c < 8U; c++) {
        for (size_t i = 0U; i < capacity[c]; i++) {
            piece[i].start = (pen_real_t)i;
        }
        for (size_t i = 0U; i <= (2U * capacity[c]); i++) {
            const pen_real_t x = ((pen_real_t)i * (pen_real_t)0.5F) - (pen_real_t)0.5F;
            size_t expected = 0U;
            while (((expected + 1U) < capacity[c]) && !(x < piece[expected + 1U].start)) {
                expected++;
            }
            TEST_ASSERT_EQUAL_PTR(&piece[expected], pen_fold_find(capacity[c], piece, x));
        }
    }
}

void test_nan_stays_nan(void)
{
    const pen_real_t zero = tent_value[4];
    pen_status_t status;
    pen_real_t y;

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_fold(&tent, tent_value, false, line, active, 12U, piece));
    y = value(12U, zero / zero, &status);
    TEST_ASSERT_FALSE(y <= PEN_REAL_MAX);
    TEST_ASSERT_EQUAL_HEX32(PEN_OUTSIDE, status);
    y = value(12U, (pen_real_t)1 / zero, &status);
    TEST_ASSERT_FALSE(y <= PEN_REAL_MAX);
}

/* 1-16-16-16-1 with random weights, some dead and some the same: against layer by layer. Sums of 17 terms of size 1 in three
 * layers: rounding errors are below 200 of the largest output's last digit; typically 2. */
void test_random_networks_against_their_layers(void)
{
    static const pen_layer_t layer[4] = {
        { PEN_LAYER_RELU, 1U, 16U }, { PEN_LAYER_RELU, 16U, 16U }, { PEN_LAYER_RELU, 16U, 16U }, { PEN_LAYER_DENSE, 16U, 1U }
    };
    static const pen_chain_t chain = { layer, 4U, 16U, 48U };
    uint32_t folded = 0U;

    for (uint32_t n = 0U; n < 40U; n++) {
        pen_real_t p[2U + 32U + 272U + 272U + 17U];
        for (size_t i = 2U; i < 595U; i++) {
            p[i] = draw() * (pen_real_t)0.5F;
        }
        p[3] = p[2]; /* twins */
        p[19] = p[18];
        p[20] = (pen_real_t)0; /* dead */
        p[0] = (pen_real_t)-1;
        p[1] = (pen_real_t)1;
        if (pen_fold(&chain, p, false, line, active, ROOM, piece) == PEN_OK) {
            folded++;
            for (uint32_t i = 0U; i < 100U; i++) {
                const pen_real_t x = draw() * (pen_real_t)3;
                pen_real_t h[16];
                pen_real_t g[16];
                pen_status_t status;
                const pen_real_t y = value(ROOM, x, &status);
                pen_dense(16U, 1U, &p[2], &x, h);
                pen_dense_relu(16U, 16U, &p[34], h, g);
                pen_dense_relu(16U, 16U, &p[306], g, h);
                pen_dense_relu(1U, 16U, &p[578], h, g);
                TEST_ASSERT_TRUE(pen_port_abs(y - g[0]) <= ((pen_real_t)200 * PEN_REAL_EPSILON));
            }
        }
    }
    TEST_ASSERT_GREATER_THAN_UINT32(30U, folded);
}

/* The tent between a scaling of the input and one of the output: 4 tent((x - 2) / 2) + 1, a tent from 0 to 4. Between its
 * layers, three values are scaled there and back. */
void test_scaled_input_and_output(void)
{
    static const pen_layer_t layer[6] = { { PEN_LAYER_CENTRE, 1U, 1U },  { PEN_LAYER_RELU, 1U, 3U },  { PEN_LAYER_CENTRE, 3U, 3U },
                                          { PEN_LAYER_RESCALE, 3U, 3U }, { PEN_LAYER_DENSE, 3U, 1U }, { PEN_LAYER_RESCALE, 1U, 1U } };
    static const pen_chain_t chain = { layer, 6U, 3U, 3U };
    static const pen_real_t there_and_back[12] = { (pen_real_t)1, (pen_real_t)2,    (pen_real_t)3,    (pen_real_t)2,
                                                   (pen_real_t)4, (pen_real_t)0.5F, (pen_real_t)0.5F, (pen_real_t)0.25F,
                                                   (pen_real_t)2, (pen_real_t)1,    (pen_real_t)2,    (pen_real_t)3 };
    static const pen_real_t x[5] = { (pen_real_t)-1, (pen_real_t)1, (pen_real_t)2, (pen_real_t)3.5F, (pen_real_t)5 };
    static const pen_real_t expected[5] = { (pen_real_t)1, (pen_real_t)3, (pen_real_t)5, (pen_real_t)2, (pen_real_t)1 };
    pen_real_t p[28] = { (pen_real_t)-4, (pen_real_t)8, (pen_real_t)2, (pen_real_t)0.5F };

    for (size_t i = 0U; i < 6U; i++) {
        p[4U + i] = tent_value[2U + i];
        p[10U + i] = there_and_back[i];
        p[16U + i] = there_and_back[6U + i];
    }
    for (size_t i = 0U; i < 4U; i++) {
        p[22U + i] = tent_value[8U + i];
    }
    p[26] = (pen_real_t)4;
    p[27] = (pen_real_t)1;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_fold(&chain, p, false, line, active, 12U, piece));
    for (size_t i = 0U; i < 5U; i++) {
        expect(12U, x[i], expected[i], PEN_OK);
    }
}

/* Nothing is lost at 0, where the numbers are closest together. */
void test_an_envelope_that_ends_at_zero(void)
{
    pen_real_t p[12];
    pen_status_t status;

    for (size_t i = 0U; i < 12U; i++) {
        p[i] = tent_value[i];
    }
    p[1] = (pen_real_t)0;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_fold(&tent, p, false, line, active, 12U, piece));
    (void)value(12U, (pen_real_t)0, &status);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, status);
    (void)value(12U, PEN_REAL_MIN * PEN_REAL_EPSILON, &status); /* the smallest number */
    TEST_ASSERT_EQUAL_HEX32(PEN_OUTSIDE, status);
}

/* An envelope of all numbers has no edges; a kink at the largest number, or beyond, is none. */
void test_without_edges_and_without_an_end(void)
{
    static const pen_layer_t one_layer[2] = { { PEN_LAYER_RELU, 1U, 1U }, { PEN_LAYER_DENSE, 1U, 1U } };
    static const pen_chain_t one = { one_layer, 2U, 1U, 1U };
    const pen_real_t last[6] = { (pen_real_t)-1, (pen_real_t)1, PEN_REAL_MAX, (pen_real_t)-1, (pen_real_t)0, (pen_real_t)1 };
    const pen_real_t beyond[6] = { (pen_real_t)-1, (pen_real_t)1, PEN_REAL_MAX * (pen_real_t)0.5F,
                                   -PEN_REAL_MIN,  (pen_real_t)0, (pen_real_t)1 };
    pen_real_t p[12];

    for (size_t i = 0U; i < 12U; i++) {
        p[i] = tent_value[i];
    }
    p[0] = -PEN_REAL_MAX;
    p[1] = PEN_REAL_MAX;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_fold(&tent, p, false, line, active, 4U, piece)); /* 3 kinks, one at the centre */
    expect(4U, (pen_real_t)-1e30F, (pen_real_t)0, PEN_OK);
    expect(4U, (pen_real_t)0.25F, (pen_real_t)0.75F, PEN_OK);
    expect(4U, (pen_real_t)1e30F, (pen_real_t)0, PEN_OK);

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_fold(&one, last, false, line, active, 4U, piece)); /* 2 edges, the centre */
    expect(4U, (pen_real_t)9, last[2], PEN_OUTSIDE);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_fold(&one, beyond, false, line, active, 4U, piece));
    expect(4U, (pen_real_t)9, beyond[2], PEN_OUTSIDE);
}

/* All kinks on one side of the centre: the room is used up on the way down, or on the way up. */
void test_too_many_pieces_on_one_side(void)
{
    pen_real_t p[12];

    for (size_t i = 0U; i < 12U; i++) {
        p[i] = tent_value[i];
    }
    p[1] = (pen_real_t)9; /* the centre is 3: 3 kinks and an edge below */
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_PIECES, pen_fold(&tent, p, false, line, active, 4U, piece));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_fold(&tent, p, false, line, active, 8U, piece));
    p[0] = (pen_real_t)-9;
    p[1] = (pen_real_t)3;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_PIECES, pen_fold(&tent, p, false, line, active, 4U, piece));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_fold(&tent, p, false, line, active, 8U, piece));
}

/*
 * A saw of 16 teeth between 1 and the next number, which 16 neurons cut: 256 kinks without any number between them. The walk
 * gives up in time, after as many looks as there is room and neurons.
 */
void test_kinks_closer_than_numbers(void)
{
    static const pen_layer_t layer[4] = {
        { PEN_LAYER_CENTRE, 1U, 1U }, { PEN_LAYER_RELU, 1U, 16U }, { PEN_LAYER_RELU, 16U, 16U }, { PEN_LAYER_DENSE, 16U, 1U }
    };
    static const pen_chain_t chain = { layer, 4U, 16U, 32U };
    const pen_real_t tooth = PEN_REAL_EPSILON / (pen_real_t)64;
    pen_real_t p[2U + 2U + 32U + 272U + 17U] = { (pen_real_t)0, (pen_real_t)2, (pen_real_t)1, (pen_real_t)1 };

    for (size_t i = 0U; i < 16U; i++) {
        p[4U + i] = -tooth * (pen_real_t)i; /* kinks at 1, 1 + tooth, ... */
        p[20U + i] = (pen_real_t)1;
        p[36U + i] = -tooth * (((pen_real_t)i + (pen_real_t)0.5F) / (pen_real_t)17); /* where the saw is cut */
        for (size_t k = 0U; k < 16U; k++) {
            const pen_real_t turn = ((i % 2U) == 0U) ? (pen_real_t)2 : (pen_real_t)-2;
            p[52U + (16U * i) + k] = (i == 0U) ? (pen_real_t)1 : turn;
        }
        p[309U + i] = (pen_real_t)1;
    }
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_PIECES, pen_fold(&chain, p, false, line, active, 12U, piece));
}

/*
 * Two neurons cut a zigzag of four kinks four times each: twelve kinks between 1 and the next number. With two edges and two
 * ends that takes 16 evaluations, which is what is allowed for six pieces and six neurons; for five pieces it is one too many,
 * although only four have a length.
 */
void test_no_more_evaluations_than_allowed(void)
{
    static const pen_layer_t layer[4] = {
        { PEN_LAYER_CENTRE, 1U, 1U }, { PEN_LAYER_RELU, 1U, 4U }, { PEN_LAYER_RELU, 4U, 2U }, { PEN_LAYER_DENSE, 2U, 1U }
    };
    static const pen_chain_t chain = { layer, 4U, 4U, 6U };
    const pen_real_t tooth = PEN_REAL_EPSILON / (pen_real_t)64;
    /* clang-format off */ /* one row of a layer a line */
    const pen_real_t p[25] = {
        (pen_real_t)0, (pen_real_t)2, (pen_real_t)1, (pen_real_t)1,
        -tooth, (pen_real_t)-2 * tooth, (pen_real_t)-3 * tooth, (pen_real_t)-4 * tooth,
        (pen_real_t)1, (pen_real_t)1, (pen_real_t)1, (pen_real_t)1,
        (pen_real_t)-0.25F * tooth, (pen_real_t)1, (pen_real_t)-2, (pen_real_t)2, (pen_real_t)-2,
        (pen_real_t)-0.5F * tooth, (pen_real_t)1, (pen_real_t)-2, (pen_real_t)2, (pen_real_t)-2,
        (pen_real_t)3, (pen_real_t)1, (pen_real_t)1,
    };
    /* clang-format on */

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_fold(&chain, p, false, line, active, 6U, piece));
    expect(6U, (pen_real_t)0.5F, (pen_real_t)3, PEN_OK);
    expect(6U, (pen_real_t)1.5F, (pen_real_t)3, PEN_OK);
    expect(6U, (pen_real_t)3, (pen_real_t)3, PEN_OUTSIDE);
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_PIECES, pen_fold(&chain, p, false, line, active, 5U, piece));
}
