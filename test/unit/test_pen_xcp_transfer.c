/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "penode/pen_serial.h"
#include "penode/pen_xcp.h"
#include "unity.h"

#include "xcp_fixture.inc"

#define WORKING   0U
#define REFERENCE 1U
#define ECU       1U
#define TOOL      2U
#define BOTH      0x83U

static void set_page(uint8_t mode, uint8_t page)
{
    GOOD(1U, 0xeb, mode, 0, page);
}

/* Value k of the set in force, after a step, is `value`; its id is `id`. */
static void expect_in_force(uint32_t id, uint32_t k, pen_real_t value)
{
    const pen_set_t *const set = step();

    TEST_ASSERT_EQUAL_UINT32(id, set->head.id);
    TEST_ASSERT_TRUE(set->value[k] == value);
}

/* -- transfers ---------------------------------------------------------------------------------------------------------- */

void test_download_sizes(void)
{
    at(SEGMENT + SIZE - 2U);
    BAD(ACCESS_DENIED, 0xf0, 3, 0, 0, 0);
    BAD(RANGE, 0xf0, 0);
    BAD(SYNTAX, 0xf0, 2, 0);
    TEST_ASSERT_FALSE(instance.tuning.open != 0U); /* nothing of it was written */
    GOOD(1U, 0xf0, 2, 1, 2);
    BAD(ACCESS_DENIED, 0xf0, 1, 0);
    at(REGION);
    BAD(ACCESS_DENIED, 0xf0, 1, 0);
    TEST_ASSERT_EQUAL_UINT8(10U, memory[0]);
}

void test_download_max(void)
{
    uint8_t in[16] = { 0xeeU };

    memcpy(&in[1], &first_value[1], 15U);
    at(SEGMENT);
    TEST_ASSERT_EQUAL_UINT32(1U, send(16U, in));
    TEST_ASSERT_TRUE(value_at(0U) == (pen_real_t)2);
    at(SEGMENT);
    TEST_ASSERT_EQUAL_UINT32(8U, send(15U, in));
    TEST_ASSERT_EQUAL_HEX8(SYNTAX, out[1]);
}

/* A block of n bytes from `byte` on, MAX_CTO - 2 a packet; the answer to packet k must be silence but to the last. */
static void block(uint32_t n, const uint8_t byte[])
{
    for (uint32_t done = 0U; done < n;) {
        const uint32_t now = ((n - done) < 14U) ? (n - done) : 14U;
        uint8_t in[16];
        in[0] = (done == 0U) ? 0xf0U : 0xefU;
        in[1] = (uint8_t)(n - done);
        memcpy(&in[2], &byte[done], now);
        done += now;
        TEST_ASSERT_EQUAL_UINT32((done == n) ? 1U : 0U, send(2U + now, in));
    }
}

void test_block_is_answered_once(void)
{
    pen_real_t value[N] = { 5, 6, 7, 8, 9 };

    at(SEGMENT);
    block(SIZE, (const uint8_t *)value);
    TEST_ASSERT_EQUAL_HEX8(0xff, out[0]);
    at(SEGMENT);
    TEST_ASSERT_EQUAL_UINT32(8U, send_word(0xf3U, 0U, SIZE));
    TEST_ASSERT_EQUAL_HEX32(pen_set_checksum(value, N), number_of(4U, &out[4]));
    set_page(ECU, WORKING);
    expect_in_force(FIRST, 3U, (pen_real_t)8);
}

void test_block_out_of_sequence(void)
{
    BAD(SEQUENCE, 0xef, 4, 0, 0, 0, 0);
    TEST_ASSERT_EQUAL_UINT8(0U, out[2]);
    BAD(RANGE, 0xef, 0);
    at(SEGMENT);
    TEST_ASSERT_EQUAL_UINT32(0U, SEND(0xf0, 16, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0));
    BAD(SEQUENCE, 0xef, 3, 0, 0, 0);
    TEST_ASSERT_EQUAL_UINT8(2U, out[2]);
    BAD(SEQUENCE, 0xef, 2, 0, 0); /* the block is over */
    BAD(SEQUENCE, 0xeb, ECU, 0, 0); /* what is half written is not committed */
    at(SEGMENT);
    GOOD(1U, 0xf0, 1, 0);
    set_page(ECU, WORKING);
}

void test_refused_block_is_answered_once(void)
{
    uint8_t in[16] = { 0xf0U, 30U };

    at(SEGMENT + SIZE - 4U);
    TEST_ASSERT_EQUAL_UINT32(8U, send(16U, in));
    TEST_ASSERT_EQUAL_HEX8(ACCESS_DENIED, out[1]);
    in[0] = 0xefU;
    in[1] = 16U;
    TEST_ASSERT_EQUAL_UINT32(0U, send(16U, in));
    in[1] = 2U;
    TEST_ASSERT_EQUAL_UINT32(0U, send(4U, in));
    BAD(SEQUENCE, 0xef, 2, 0, 0);
    TEST_ASSERT_FALSE(instance.tuning.open != 0U);
    set_page(ECU, WORKING); /* nothing is half written */
}

void test_block_that_is_cut_is_not_committed(void)
{
    at(SEGMENT);
    TEST_ASSERT_EQUAL_UINT32(0U, SEND(0xf0, 16, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0));
    BAD(SEQUENCE, 0xeb, ECU, 0, 0);
    GOOD(1U, 0xe4, 0, 1, 0, 0); /* a whole page again */
    set_page(ECU, WORKING);
    expect_in_force(FIRST + 1U, 0U, (pen_real_t)1);
}

/* -- sessions ------------------------------------------------------------------------------------------------------------ */

void test_reconnect_finds_the_running_set(void)
{
    write_value(0U, (pen_real_t)9);
    set_page(BOTH, WORKING);
    expect_in_force(FIRST, 0U, (pen_real_t)9);
    write_value(0U, (pen_real_t)10);
    GOOD(8U, 0xff, 0);
    TEST_ASSERT_TRUE(value_at(0U) == (pen_real_t)9);
    set_page(ECU, REFERENCE);
    (void)step();
    write_value(1U, (pen_real_t)10);
    pen_xcp_disconnect(&xcp);
    GOOD(8U, 0xff, 0);
    GOOD(4U, 0xea, TOOL, 0);
    TEST_ASSERT_EQUAL_UINT8(WORKING, out[3]);
    TEST_ASSERT_TRUE(value_at(0U) == (pen_real_t)1);
    TEST_ASSERT_TRUE(value_at(1U) == (pen_real_t)2);
}

/* -- quiet ---------------------------------------------------------------------------------------------------------------- */

static void with_quiet(void)
{
    config.quiet = 100U;
    start();
    set_page(ECU, WORKING);
    (void)step();
}

void test_quiet_commits_what_is_open(void)
{
    with_quiet();
    TEST_ASSERT_EQUAL_UINT32(0U, pen_xcp_elapse(&xcp, 100U, out)); /* nothing is open */
    write_value(0U, (pen_real_t)9);
    TEST_ASSERT_EQUAL_UINT32(0U, pen_xcp_elapse(&xcp, 60U, out));
    write_value(1U, (pen_real_t)9);
    TEST_ASSERT_EQUAL_UINT32(0U, pen_xcp_elapse(&xcp, 60U, out));
    expect_in_force(FIRST, 0U, (pen_real_t)1);
    TEST_ASSERT_EQUAL_UINT32(0U, pen_xcp_elapse(&xcp, 40U, out));
    expect_in_force(FIRST + 1U, 0U, (pen_real_t)9);
    TEST_ASSERT_EQUAL_UINT32(0U, pen_xcp_elapse(&xcp, UINT32_MAX, out));
    TEST_ASSERT_FALSE(pen_tuning_pending(&instance.tuning));
}

/* Counted from the last edit, to the millisecond; a copy of the reference is one. */
void test_quiet_is_counted_from_the_last_edit(void)
{
    with_quiet();
    for (uint32_t k = 0U; k < 3U; k++) {
        const uint32_t before = step()->head.id;
        write_value(0U, (pen_real_t)(50U + k));
        TEST_ASSERT_EQUAL_UINT32(0U, pen_xcp_elapse(&xcp, 60U, out));
        if (k == 0U) {
            write_value(1U, (pen_real_t)60);
        } else if (k == 1U) {
            GOOD(1U, 0xe4, 0, 1, 0, 0);
        } else {
            TEST_ASSERT_EQUAL_UINT32(0U, pen_xcp_elapse(&xcp, 0U, out));
            write_value(1U, (pen_real_t)61);
        }
        TEST_ASSERT_EQUAL_UINT32(0U, pen_xcp_elapse(&xcp, 99U, out));
        TEST_ASSERT_EQUAL_UINT32(before, step()->head.id);
        TEST_ASSERT_EQUAL_UINT32(0U, pen_xcp_elapse(&xcp, 1U, out));
        TEST_ASSERT_TRUE(step()->head.id != before);
    }
}

void test_quiet_refused_is_an_event_once(void)
{
    with_quiet();
    write_value(0U, (pen_real_t)NAN);
    TEST_ASSERT_EQUAL_UINT32(2U, pen_xcp_elapse(&xcp, UINT32_MAX, out));
    TEST_ASSERT_EQUAL_HEX8(0xfdU, out[0]);
    TEST_ASSERT_EQUAL_HEX8(0xfeU, out[1]);
    TEST_ASSERT_EQUAL_UINT32(0U, pen_xcp_elapse(&xcp, UINT32_MAX, out));
    expect_in_force(FIRST, 0U, (pen_real_t)1);
    write_value(0U, (pen_real_t)NAN);
    xcp.connected = false;
    TEST_ASSERT_EQUAL_UINT32(0U, pen_xcp_elapse(&xcp, 100U, out));
}

void test_quiet_leaves_reference_and_halves_alone(void)
{
    config.quiet = 100U;
    start();
    write_value(0U, (pen_real_t)9); /* while the reference runs */
    TEST_ASSERT_EQUAL_UINT32(0U, pen_xcp_elapse(&xcp, 200U, out));
    expect_in_force(1U, 0U, (pen_real_t)1);
    set_page(ECU, WORKING);
    (void)step();
    at(SEGMENT);
    TEST_ASSERT_EQUAL_UINT32(0U, SEND(0xf0, 16, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0));
    TEST_ASSERT_EQUAL_UINT32(0U, pen_xcp_elapse(&xcp, 200U, out));
    expect_in_force(FIRST, 0U, (pen_real_t)9);
}

void test_quiet_off(void)
{
    set_page(ECU, WORKING);
    (void)step();
    write_value(0U, (pen_real_t)9);
    TEST_ASSERT_EQUAL_UINT32(0U, pen_xcp_elapse(&xcp, UINT32_MAX, out));
    expect_in_force(FIRST, 0U, (pen_real_t)1);
}
