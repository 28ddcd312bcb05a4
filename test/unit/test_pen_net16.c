/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* The network in one piece, by the port if it has a way of its own, and neuron by neuron: the same bits. */

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "penode/pen_net16.h"
#include "unity.h"

#define HIDDEN 3U
#define LENGTH (32U + (272U * HIDDEN) + 17U)

#ifdef PEN_PORT_NET16
#define ROUNDS 20000U
#else
#define ROUNDS 2000U
#endif

static pen_real_t w[LENGTH];
static pen_real_t nan_value;
static pen_real_t inf_value;
static uint32_t seed;

void setUp(void)
{
    volatile pen_real_t zero = (pen_real_t)0;

    seed = 1U;
    nan_value = zero / zero;
    inf_value = (pen_real_t)1 / zero;
}

void tearDown(void) {}

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

/* Neuron by neuron, each sum from its bias on. */
static pen_real_t one_by_one(size_t hidden, pen_real_t x)
{
    const pen_real_t *p = &w[32];
    pen_real_t h[16];
    pen_real_t twice;

    for (size_t r = 0U; r < 16U; r++) {
        h[r] = w[r] + (w[16U + r] * x);
    }
    for (size_t layer = 0U; layer < hidden; layer++) {
        pen_real_t next[16];
        for (size_t r = 0U; r < 16U; r++) {
            next[r] = p[r];
            for (size_t i = 0U; i < 16U; i++) {
                next[r] += p[(16U * i) + 16U + r] * ((pen_real_t)0.5 * (h[i] + pen_port_abs(h[i])));
            }
        }
        memcpy(h, next, sizeof(h));
        p = &p[272];
    }
    twice = p[0] + p[0];
    for (size_t i = 0U; i < 16U; i++) {
        twice += p[i + 1U] * (h[i] + pen_port_abs(h[i]));
    }
    return (pen_real_t)0.5 * twice;
}

/* In every round all weights are -1 to 1 or, every fourth, of all sizes down to subnormal ones; one of them and the input
 * may become anything. A NaN may be any NaN. */
void test_one_piece_or_one_by_one(void)
{
    size_t numbers = 0U;

    for (size_t round = 0U; round < ROUNDS; round++) {
        const size_t hidden = 1U + (round % HIDDEN);
        const pen_real_t x = hostile((word() % 8U == 0U) ? (word() % 3U) : 3U);
        pen_real_t expected;
        pen_real_t found;
        if ((round % 50U) == 0U) {
            for (size_t i = 0U; i < LENGTH; i++) {
                w[i] = hostile(((round % 200U) == 0U) ? 2U : 3U);
            }
        }
        const size_t at = word() % (32U + (272U * hidden) + 17U);
        const pen_real_t kept = w[at];
        w[at] = hostile(word() % 4U);
        expected = one_by_one(hidden, x);
        found = pen_net16(hidden, w, x);
        w[at] = kept;
        if (expected == expected) {
            TEST_ASSERT_EQUAL_MEMORY(&expected, &found, sizeof(pen_real_t));
            numbers++;
        } else {
            TEST_ASSERT_FALSE(found == found);
        }
    }
    TEST_ASSERT_TRUE(numbers > (ROUNDS / 2U));
    TEST_ASSERT_TRUE(numbers < ((19U * ROUNDS) / 20U));
}

/* One weight at a time has its part in the result: no two may be mixed up, none left out. */
void test_every_weight_is_at_its_place(void)
{
    for (size_t hidden = 1U; hidden <= HIDDEN; hidden++) {
        const size_t length = 32U + (272U * hidden) + 17U;
        for (size_t at = 0U; at < length; at++) {
            pen_real_t expected;
            pen_real_t found;
            for (size_t i = 0U; i < length; i++) {
                w[i] = (pen_real_t)(1U + (word() % 1024U)) / (pen_real_t)1024;
            }
            found = pen_net16(hidden, w, (pen_real_t)0.75F);
            w[at] += (pen_real_t)1;
            TEST_ASSERT_FALSE(pen_net16(hidden, w, (pen_real_t)0.75F) == found);
            expected = one_by_one(hidden, (pen_real_t)0.75F);
            found = pen_net16(hidden, w, (pen_real_t)0.75F);
            TEST_ASSERT_EQUAL_MEMORY(&expected, &found, sizeof(pen_real_t));
        }
    }
}
