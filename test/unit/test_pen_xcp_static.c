/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "penode/pen_xcp_static.h"
#include "unity.h"

static uint32_t receive(pen_xcp_t *slave, const uint8_t in[], uint32_t n, uint8_t answer[]);
#define RECEIVE receive
#include "xcp_fixture.inc"
#include "xcp_daq_fixture.inc"

#define SLOTS 8U

static uint8_t ring[SLOTS * (MAX_CTO + 1U)];

/* 0: predefined, two ODTs, one entry of the second left out; 1: configurable, three ODTs of two entries. */
static const pen_xcp_entry_t constant[4] = { { &memory[0], 4U }, { &memory[4], 1U }, { text, 5U }, { NULL, 0U } };
static const pen_xcp_static_t two[2] = { { 2U, 2U, constant }, { 3U, 2U, NULL } };
static pen_xcp_statics_t statics;

static uint32_t receive(pen_xcp_t *slave, const uint8_t in[], uint32_t n, uint8_t answer[])
{
    return pen_xcp_static_receive(slave, &statics, in, n, answer);
}

static void begin(void)
{
    memset(&daq, 0x5a, sizeof(daq));
    pen_xcp_daq_init(&daq, ring, SLOTS, MAX_CTO, 1U, 6U);
    statics.lists = 2U;
    statics.list = two;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_xcp_static_init(&daq, &statics));
    config.daq = &daq;
    config.daq_command = pen_xcp_daq_command;
    start();
}

static uint32_t packet(void)
{
    return pen_xcp_daq_packet(&xcp, out);
}

static void expect_constants(void)
{
    TEST_ASSERT_EQUAL_UINT32(6U, packet());
    TEST_ASSERT_EQUAL_UINT8(0U, out[0]);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(memory, &out[1], 5U);
    TEST_ASSERT_EQUAL_UINT32(6U, packet());
    TEST_ASSERT_EQUAL_UINT8(1U, out[0]);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(text, &out[1], 5U);
}

void test_static_lists_are_reported(void)
{
    begin();
    GOOD(8U, 0xda);
    TEST_ASSERT_EQUAL_HEX8(0x92U, out[1]); /* static */
    TEST_ASSERT_EQUAL_UINT32(2U, number_of(2U, &out[2]));
    TEST_ASSERT_EQUAL_UINT32(1U, number_of(2U, &out[4]));
    TEST_ASSERT_EQUAL_UINT8(1U, out[6]); /* predefined */
    GOOD(6U, 0xd8, 0, HALF(0U));
    TEST_ASSERT_EQUAL_HEX8_ARRAY(((const uint8_t[]){ 0x07U, 2U, 2U, 0U, 0U }), &out[1], 5U);
    GOOD(6U, 0xd8, 0, HALF(1U));
    TEST_ASSERT_EQUAL_HEX8_ARRAY(((const uint8_t[]){ 0x06U, 3U, 2U, 0U, 0U }), &out[1], 5U);
    BAD(RANGE, 0xd8, 0, HALF(2U));
    BAD(RANGE, 0xd8, 0, HALF(0x100U));
    BAD(SYNTAX, 0xd8, 0, 0);
}

void test_other_commands_are_those_of_the_slave(void)
{
    begin();
    GOOD(8U, 0xd9);
    BAD(UNKNOWN, 0xd6);
    BAD(UNKNOWN, 0xd5, 0, HALF(1U));
    BAD(UNKNOWN, 0xd4, 0, HALF(0U), 1);
    BAD(UNKNOWN, 0xd3, 0, HALF(0U), 0, 1);
    BAD(UNKNOWN, 0xd2, 0);
    GOOD(6U, 0xfd);
    TEST_ASSERT_EQUAL_UINT32(0U, SEND(0U));
    TEST_ASSERT_EQUAL_UINT32(0U, send(0U, NULL));
    BAD(SYNTAX, 0xe2, 0, 0);
    BAD(SYNTAX, 0xe3, 0, 0);
    BAD(SYNTAX, 0xe1, 0xff, 1, 0);
}

void test_not_connected_or_locked(void)
{
    begin();
    pen_xcp_disconnect(&xcp);
    TEST_ASSERT_EQUAL_UINT32(0U, SEND(0xd8, 0, HALF(0U)));
    TEST_ASSERT_EQUAL_UINT32(0U, SEND(0xda));
    TEST_ASSERT_EQUAL_UINT32(0U, SEND(0xe2, 0, HALF(1U), 0, 0));
    config.protect = PEN_XCP_DAQ;
    start();
    BAD(ACCESS_LOCKED, 0xd8, 0, HALF(0U));
    BAD(ACCESS_LOCKED, 0xda);
    BAD(ACCESS_LOCKED, 0xd6);
    BAD(ACCESS_LOCKED, 0xe2, 0, HALF(0U), 0, 0);
    BAD(ACCESS_LOCKED, 0xe2, 0, HALF(1U), 0, 0);
}

void test_predefined_list_is_sampled_at_once(void)
{
    begin();
    GOOD(2U, 0xde, 1, HALF(0U));
    TEST_ASSERT_EQUAL_UINT8(0U, out[1]);
    pen_xcp_sample(&xcp, 7U);
    expect_constants();
    TEST_ASSERT_EQUAL_UINT32(0U, packet());
    GOOD(1U, 0xdd, 0);
    GOOD(1U, 0xe0, 0x10, HALF(0U), HALF(0U), 2, 0);
    GOOD(2U, 0xde, 1, HALF(0U));
    for (uint32_t k = 0U; k < 4U; k++) {
        pen_xcp_sample(&xcp, k);
        TEST_ASSERT_EQUAL_UINT32(((k % 2U) == 0U) ? 10U : 0U, packet());
        TEST_ASSERT_EQUAL_UINT32(((k % 2U) == 0U) ? k : 0U, ((k % 2U) == 0U) ? number_of(4U, &out[1]) : 0U);
        TEST_ASSERT_EQUAL_UINT32(((k % 2U) == 0U) ? 6U : 0U, packet());
    }
}

void test_predefined_entries_are_not_written(void)
{
    begin();
    GOOD(1U, 0xe2, 0, HALF(1U), 0, 0);
    BAD(WRITE_PROTECTED, 0xe2, 0, HALF(0U), 0, 0);
    BAD(DAQ_CONFIG, 0xe1, 0xff, 1, 0, 0, 0, 0, 0); /* the pointer is nowhere */
    BAD(SYNTAX, 0xe2, 0, HALF(0U));
    GOOD(1U, 0xe0, 0x10, HALF(0U), HALF(0U), 3, 0);
    GOOD(1U, 0xe3, 0, HALF(0U)); /* its mode is reset, its entries stay */
    GOOD(8U, 0xdf, 0, HALF(0U));
    TEST_ASSERT_EQUAL_HEX8(0U, out[1]);
    TEST_ASSERT_EQUAL_UINT8(1U, out[6]);
    GOOD(2U, 0xde, 1, HALF(0U));
    pen_xcp_sample(&xcp, 7U);
    expect_constants();
    BAD(ACTIVE, 0xe3, 0, HALF(0U));
    BAD(ACTIVE, 0xe2, 0, HALF(0U), 0, 0);
    pen_xcp_sample(&xcp, 7U);
    expect_constants();
}

/* Entries that are not written, and the ODTs behind the last one with any, are not sent. */
void test_configurable_list_sends_what_was_written(void)
{
    begin();
    BAD(DAQ_CONFIG, 0xde, 1, HALF(1U)); /* nothing yet */
    GOOD(1U, 0xe3, 0, HALF(1U));
    BAD(DAQ_CONFIG, 0xde, 1, HALF(1U));
    GOOD(1U, 0xe2, 0, HALF(1U), 0, 0);
    BAD(RANGE, 0xe1, 0xff, 0, 0, 0, 0, 0, 0); /* of no size */
    write_entry(2U, REGION);
    GOOD(1U, 0xe2, 0, HALF(1U), 1, 1);
    write_entry(3U, REGION + 4U);
    BAD(DAQ_CONFIG, 0xe1, 0xff, 1, 0, 0, 0, 0, 0); /* past the last entry of the ODT */
    BAD(RANGE, 0xe2, 0, HALF(1U), 3, 0);
    BAD(RANGE, 0xe2, 0, HALF(1U), 0, 2);
    BAD(RANGE, 0xe2, 0, HALF(2U), 0, 0);
    BAD(RANGE, 0xe3, 0, HALF(2U));
    GOOD(2U, 0xde, 1, HALF(1U));
    TEST_ASSERT_EQUAL_UINT8(2U, out[1]); /* its first ODT, counted through all lists */
    pen_xcp_sample(&xcp, 0U);
    BAD(ACTIVE, 0xe3, 0, HALF(1U));
    BAD(ACTIVE, 0xe2, 0, HALF(1U), 0, 0);
    pen_xcp_sample(&xcp, 1U);
    for (uint32_t k = 0U; k < 2U; k++) {
        TEST_ASSERT_EQUAL_UINT32(3U, packet());
        TEST_ASSERT_EQUAL_UINT8(2U, out[0]);
        TEST_ASSERT_EQUAL_HEX8_ARRAY(&memory[0], &out[1], 2U);
        TEST_ASSERT_EQUAL_UINT32(4U, packet());
        TEST_ASSERT_EQUAL_UINT8(3U, out[0]);
        TEST_ASSERT_EQUAL_HEX8_ARRAY(&memory[4], &out[1], 3U);
    }
    TEST_ASSERT_EQUAL_UINT32(0U, packet());
    GOOD(1U, 0xdd, 0);
    GOOD(1U, 0xe2, 0, HALF(1U), 2, 0); /* the third, of which no entry is written yet */
    GOOD(2U, 0xde, 1, HALF(1U));
    pen_xcp_sample(&xcp, 2U);
    TEST_ASSERT_EQUAL_UINT32(3U, packet());
    TEST_ASSERT_EQUAL_UINT32(4U, packet());
    TEST_ASSERT_EQUAL_UINT32(0U, packet());
    GOOD(1U, 0xdd, 0);
    write_entry(1U, REGION);
    GOOD(2U, 0xde, 1, HALF(1U));
    pen_xcp_sample(&xcp, 3U);
    TEST_ASSERT_EQUAL_UINT32(3U, packet());
    TEST_ASSERT_EQUAL_UINT32(4U, packet());
    TEST_ASSERT_EQUAL_UINT32(2U, packet());
    TEST_ASSERT_EQUAL_UINT8(4U, out[0]);
    GOOD(1U, 0xdd, 0);
    GOOD(1U, 0xe3, 0, HALF(1U));
    BAD(DAQ_CONFIG, 0xde, 1, HALF(1U));
}

/* Nothing about a list changes while the step is in the middle of a sample. */
void test_lists_keep_their_size_while_a_sample_is_taken(void)
{
    begin();
    GOOD(1U, 0xe2, 0, HALF(1U), 0, 0);
    write_entry(2U, REGION);
    daq.busy = 1U;
    BAD(BUSY, 0xe2, 0, HALF(1U), 0, 0);
    BAD(BUSY, 0xe3, 0, HALF(1U));
    TEST_ASSERT_EQUAL_UINT8(1U, daq.list[1].odts);
    TEST_ASSERT_EQUAL_UINT32(2U, daq.entry[4].size);
    daq.busy = 0U;
    xcp.sampling = 1U;
    BAD(ACTIVE, 0xe3, 0, HALF(1U));
    TEST_ASSERT_EQUAL_UINT8(1U, daq.list[1].odts);
    TEST_ASSERT_EQUAL_UINT32(2U, daq.entry[4].size);
    xcp.sampling = 0U;
    GOOD(1U, 0xe2, 0, HALF(1U), 1, 0);
    TEST_ASSERT_EQUAL_UINT8(1U, daq.list[1].odts);
}

static void with(uint32_t lists, const pen_xcp_static_t list[])
{
    begin();
    statics.lists = lists;
    statics.list = list;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_xcp_static_init(&daq, &statics));
}

/* Each command means the list of its number. */
void test_several_lists_of_a_kind(void)
{
    static const pen_xcp_static_t constants[3] = { { 1U, 1U, constant }, { 1U, 1U, constant }, { 1U, 1U, NULL } };
    static const pen_xcp_static_t open[3] = { { 1U, 1U, constant }, { 1U, 1U, NULL }, { 1U, 1U, NULL } };

    with(3U, constants);
    GOOD(1U, 0xe0, 0x10, HALF(0U), HALF(0U), 3, 0);
    GOOD(1U, 0xe0, 0x10, HALF(1U), HALF(0U), 3, 0);
    GOOD(1U, 0xe3, 0, HALF(1U));
    GOOD(8U, 0xdf, 0, HALF(1U));
    TEST_ASSERT_EQUAL_UINT8(1U, out[6]);
    GOOD(8U, 0xdf, 0, HALF(0U));
    TEST_ASSERT_EQUAL_UINT8(3U, out[6]);
    BAD(WRITE_PROTECTED, 0xe2, 0, HALF(1U), 0, 0);
    GOOD(1U, 0xe2, 0, HALF(2U), 0, 0);
    with(3U, open);
    for (uint16_t k = 1U; k < 3U; k++) {
        GOOD(1U, 0xe2, 0, HALF(k), 0, 0);
        write_entry(1U, REGION + k);
    }
    GOOD(2U, 0xde, 1, HALF(2U));
    pen_xcp_sample(&xcp, 0U);
    TEST_ASSERT_EQUAL_UINT32(2U, packet());
    TEST_ASSERT_EQUAL_UINT8(2U, out[0]);
    TEST_ASSERT_EQUAL_UINT8(memory[2], out[1]);
}

static void refused(uint32_t lists, const pen_xcp_static_t list[])
{
    const pen_xcp_statics_t wrong = { lists, list };
    const pen_xcp_daq_t before = daq;

    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_xcp_static_init(&daq, &wrong));
    TEST_ASSERT_EQUAL_MEMORY(&before, &daq, sizeof(daq));
}

void test_lists_that_do_not_fit_are_refused(void)
{
    static const pen_xcp_entry_t eleven[2] = { { memory, 8U }, { text, 3U } };
    static const pen_xcp_entry_t twelve[2] = { { memory, 8U }, { text, 4U } };
    static const pen_xcp_entry_t later[4] = { { memory, 1U }, { text, 1U }, { memory, 8U }, { memory, 8U } };
    static const pen_xcp_entry_t huge[2] = { { memory, 0xfffffff8U }, { memory, 8U } }; /* their sum is 0 */
    static const pen_xcp_entry_t edge[4] = { { memory, 8U }, { text, 3U }, { memory, 8U }, { memory, 7U } };
    static const pen_xcp_static_t many[5] = { { 1U, 1U, NULL }, { 1U, 1U, NULL }, { 1U, 1U, NULL }, { 1U, 1U, NULL }, { 1U, 1U, NULL } };
    static const pen_xcp_static_t odts[2] = { { 32U, 1U, NULL }, { 1U, 1U, NULL } };
    static const pen_xcp_static_t entries[2] = { { 32U, 2U, NULL }, { 1U, 65U, NULL } };
    static const pen_xcp_static_t sum[2] = { { 16U, 4U, NULL }, { 1U, 1U, NULL } };
    static const pen_xcp_static_t none[3] = { { 0U, 1U, NULL }, { 1U, 0U, NULL }, { 0U, 1U, eleven } };
    static const pen_xcp_static_t full[1] = { { 2U, 2U, edge } };
    static const pen_xcp_static_t order[2] = { { 1U, 1U, NULL }, { 1U, 2U, eleven } };
    static const pen_xcp_static_t room[4] = { { 1U, 2U, eleven }, { 1U, 2U, twelve }, { 2U, 2U, later }, { 1U, 2U, huge } };
    const pen_xcp_statics_t fitting[6] = { { 1U, room }, { 4U, many }, { 1U, odts }, { 1U, entries }, { 1U, sum }, { 1U, full } };

    begin();
    refused(5U, many);
    refused(2U, odts);
    refused(1U, &entries[1]);
    refused(1U, &none[0]);
    refused(1U, &none[1]);
    refused(1U, &none[2]);
    refused(2U, sum);
    refused(2U, order);
    refused(1U, &room[1]);
    refused(1U, &room[2]);
    refused(1U, &room[3]);
    for (uint32_t i = 0U; i < 6U; i++) {
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_xcp_static_init(&daq, &fitting[i]));
        TEST_ASSERT_EQUAL_UINT8(fitting[i].lists, daq.lists);
    }
}
