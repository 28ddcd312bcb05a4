/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "penode/pen_xcp_daq.h"
#include "unity.h"

#include "xcp_fixture.inc"
#include "xcp_daq_fixture.inc"

#define SLOTS    6U
#define OVERFLOW 0x30

static uint8_t ring[(SLOTS * (MAX_CTO + 1U)) + 1U];

/* A connected slave with DAQ. */
static void begin(void)
{
    memset(&daq, 0x5a, sizeof(daq));
    ring[SLOTS * (MAX_CTO + 1U)] = 0xa5U;
    pen_xcp_daq_init(&daq, ring, SLOTS, MAX_CTO, 1U, 6U);
    config.daq = &daq;
    config.daq_command = pen_xcp_daq_command;
    start();
}

static void pointer(uint8_t list, uint8_t odt, uint8_t entry)
{
    GOOD(1U, 0xe2, 0, HALF(list), odt, entry);
}

/* Two lists: 0 with ODTs of 1 and 2 entries, 1 with one of 1. */
static void two_lists(void)
{
    begin();
    GOOD(1U, 0xd6);
    GOOD(1U, 0xd5, 0, HALF(2U));
    GOOD(1U, 0xd4, 0, HALF(0U), 2);
    GOOD(1U, 0xd4, 0, HALF(1U), 1);
    GOOD(1U, 0xd3, 0, HALF(0U), 0, 1);
    GOOD(1U, 0xd3, 0, HALF(0U), 1, 2);
    GOOD(1U, 0xd3, 0, HALF(1U), 0, 1);
    pointer(0U, 0U, 0U);
    write_entry(4U, REGION);
    pointer(0U, 1U, 0U);
    write_entry(1U, REGION + 4U);
    write_entry(3U, REGION + 5U);
    pointer(1U, 0U, 0U);
    write_entry(2U, REGION + 8U);
    GOOD(1U, 0xe0, 0x10, HALF(0U), HALF(0U), 1, 0);
    GOOD(1U, 0xe0, 0x00, HALF(1U), HALF(0U), 3, 0);
}

static uint32_t packet(void)
{
    const uint32_t n = pen_xcp_daq_packet(&xcp, out);

    TEST_ASSERT_EQUAL_HEX8(0xa5U, ring[SLOTS * (MAX_CTO + 1U)]);
    return n;
}

static void expect_sample_of_list_0(uint32_t time)
{
    TEST_ASSERT_EQUAL_UINT32(9U, packet());
    TEST_ASSERT_EQUAL_UINT8(0U, out[0]);
    TEST_ASSERT_EQUAL_UINT32(time, number_of(4U, &out[1]));
    TEST_ASSERT_EQUAL_HEX8_ARRAY(&memory[0], &out[5], 4U);
    TEST_ASSERT_EQUAL_UINT32(5U, packet());
    TEST_ASSERT_EQUAL_UINT8(1U, out[0]);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(&memory[4], &out[1], 4U);
}

static void expect_sample_of_list_1(void)
{
    TEST_ASSERT_EQUAL_UINT32(3U, packet());
    TEST_ASSERT_EQUAL_UINT8(2U, out[0]);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(text, &out[1], 2U);
}

void test_connect_offers_daq(void)
{
    begin();
    GOOD(8U, 0xff, 0);
    TEST_ASSERT_EQUAL_HEX8(PEN_XCP_CAL | PEN_XCP_DAQ, out[1]);
}

void test_processor_resolution_event(void)
{
    two_lists();
    GOOD(8U, 0xda);
    TEST_ASSERT_EQUAL_HEX8(0x93U, out[1]);
    TEST_ASSERT_EQUAL_UINT32(2U, number_of(2U, &out[2]));
    TEST_ASSERT_EQUAL_UINT32(1U, number_of(2U, &out[4]));
    GOOD(8U, 0xd9);
    TEST_ASSERT_EQUAL_UINT8(1U, out[1]);
    TEST_ASSERT_EQUAL_UINT8(15U, out[2]);
    TEST_ASSERT_EQUAL_HEX8(0x34U, out[5]);
    TEST_ASSERT_EQUAL_UINT32(1U, number_of(2U, &out[6]));
    GOOD(7U, 0xd7, 0, HALF(0U));
    TEST_ASSERT_EQUAL_HEX8(4U, out[1]);
    TEST_ASSERT_EQUAL_UINT8(4U, out[3]);
    TEST_ASSERT_EQUAL_UINT8(1U, out[4]);
    TEST_ASSERT_EQUAL_UINT8(6U, out[5]);
    GOOD(5U, 0xf5, 4);
    TEST_ASSERT_EQUAL_HEX8_ARRAY("step", &out[1], 4U);
    BAD(ACCESS_DENIED, 0xf5, 1);
    BAD(RANGE, 0xd7, 0, HALF(1U));
}

void test_sample_with_time_stamp_and_prescaler(void)
{
    two_lists();
    GOOD(2U, 0xde, 1, HALF(0U));
    TEST_ASSERT_EQUAL_UINT8(0U, out[1]);
    GOOD(2U, 0xde, 2, HALF(1U));
    TEST_ASSERT_EQUAL_UINT8(2U, out[1]);
    GOOD(8U, 0xdf, 0, HALF(1U));
    TEST_ASSERT_EQUAL_HEX8(0x01U, out[1]);
    TEST_ASSERT_EQUAL_UINT8(3U, out[6]);
    GOOD(1U, 0xdd, 1);
    GOOD(8U, 0xdf, 0, HALF(1U));
    TEST_ASSERT_EQUAL_HEX8(0x40U, out[1]);
    GOOD(8U, 0xdf, 0, HALF(0U));
    TEST_ASSERT_EQUAL_HEX8(0x50U, out[1]);
    GOOD(6U, 0xfd);
    TEST_ASSERT_EQUAL_HEX8(0x40U, out[1]);
    for (uint32_t k = 0U; k < 14U; k++) {
        memory[0] = (uint8_t)k;
        pen_xcp_sample(&xcp, 1000U * k);
        expect_sample_of_list_0(1000U * k);
        if ((k % 3U) == 0U) {
            expect_sample_of_list_1();
        }
        TEST_ASSERT_EQUAL_UINT32(0U, packet());
    }
    memory[0] = 10U;
    GOOD(8U, 0xdc);
    TEST_ASSERT_EQUAL_UINT32(13000U, number_of(4U, &out[4]));
}

void test_stop(void)
{
    two_lists();
    GOOD(2U, 0xde, 1, HALF(0U));
    GOOD(2U, 0xde, 1, HALF(1U));
    GOOD(2U, 0xde, 0, HALF(0U));
    pen_xcp_sample(&xcp, 0U);
    expect_sample_of_list_1();
    TEST_ASSERT_EQUAL_UINT32(0U, packet());
    GOOD(2U, 0xde, 1, HALF(1U)); /* runs already: its prescaler goes on */
    pen_xcp_sample(&xcp, 1U);
    TEST_ASSERT_EQUAL_UINT32(0U, packet());
    GOOD(2U, 0xde, 1, HALF(0U));
    GOOD(2U, 0xde, 2, HALF(1U));
    GOOD(1U, 0xdd, 2); /* the selected ones */
    pen_xcp_sample(&xcp, 2U);
    expect_sample_of_list_0(2U);
    TEST_ASSERT_EQUAL_UINT32(0U, packet());
    GOOD(1U, 0xdd, 0);
    BAD(MODE_NOT_VALID, 0xdd, 3);
    pen_xcp_sample(&xcp, 3U);
    TEST_ASSERT_EQUAL_UINT32(0U, packet());
    GOOD(2U, 0xde, 1, HALF(0U));
    pen_xcp_disconnect(&xcp);
    pen_xcp_sample(&xcp, 4U);
    TEST_ASSERT_EQUAL_UINT32(0U, packet());
}

/* Two samples of list 0 leave one of six slots, and one is always free. */
void test_overload_leaves_out_whole_samples(void)
{
    two_lists();
    GOOD(2U, 0xde, 1, HALF(0U));
    for (uint32_t round = 0U; round < 7U; round++) { /* the ring begins anew at each of its places */
        for (uint32_t k = 0U; k < 4U; k++) {
            pen_xcp_sample(&xcp, k);
        }
        TEST_ASSERT_EQUAL_UINT32(2U, packet());
        TEST_ASSERT_EQUAL_HEX8(0xfdU, out[0]);
        TEST_ASSERT_EQUAL_HEX8(0x06U, out[1]);
        expect_sample_of_list_0(0U);
        expect_sample_of_list_0(1U);
        TEST_ASSERT_EQUAL_UINT32(0U, packet());
    }
}

/* One slot more than is left is as bad as many. */
void test_sample_of_two_packets_needs_two_slots(void)
{
    two_lists();
    GOOD(2U, 0xde, 1, HALF(1U));
    pen_xcp_sample(&xcp, 0U); /* one slot */
    GOOD(2U, 0xde, 0, HALF(1U));
    GOOD(2U, 0xde, 1, HALF(0U));
    for (uint32_t k = 1U; k < 4U; k++) { /* two each: the third has none */
        pen_xcp_sample(&xcp, k);
    }
    TEST_ASSERT_EQUAL_UINT32(2U, packet());
    TEST_ASSERT_EQUAL_HEX8(0xfdU, out[0]);
    expect_sample_of_list_1();
    expect_sample_of_list_0(1U);
    expect_sample_of_list_0(2U);
    TEST_ASSERT_EQUAL_UINT32(0U, packet());
}

void test_ring_of_an_odd_number_of_slots(void)
{
    two_lists();
    GOOD(2U, 0xde, 1, HALF(1U));
    pen_xcp_sample(&xcp, 0U);
    expect_sample_of_list_1();
    GOOD(2U, 0xde, 1, HALF(0U));
    for (uint32_t k = 0U; k < 9U; k++) {
        GOOD(2U, 0xde, 0, HALF(1U));
        pen_xcp_sample(&xcp, k);
        pen_xcp_sample(&xcp, k + 1U);
        expect_sample_of_list_0(k);
        expect_sample_of_list_0(k + 1U);
    }
}

void test_lists_change_only_at_rest(void)
{
    static const uint8_t changing[] = { 0xd3U, 0xd4U, 0xd5U, 0xe0U, 0xe1U, 0xe2U, 0xe3U };

    two_lists();
    GOOD(2U, 0xde, 1, HALF(0U));
    for (uint32_t i = 0U; i < sizeof(changing); i++) {
        BAD(ACTIVE, changing[i], 0, 0, 0, 0, 0, 0, 0);
    }
    daq.busy = 1U; /* the step is in the middle of a sample */
    BAD(BUSY, 0xd6);
    daq.busy = 0U;
    pen_xcp_sample(&xcp, 0U);
    TEST_ASSERT_EQUAL_UINT32(0U, packet()); /* FREE_DAQ has stopped them */
    GOOD(1U, 0xd6);
    GOOD(8U, 0xda);
    TEST_ASSERT_EQUAL_UINT32(0U, number_of(2U, &out[2]));
}

void test_allocation_in_order_and_within_memory(void)
{
    begin();
    BAD(OVERFLOW, 0xd5, 0, HALF(PEN_XCP_LISTS + 1U));
    GOOD(1U, 0xd5, 0, HALF(PEN_XCP_LISTS));
    BAD(SEQUENCE, 0xd5, 0, HALF(1U));
    BAD(RANGE, 0xd4, 0, HALF(PEN_XCP_LISTS), 1);
    BAD(OVERFLOW, 0xd4, 0, HALF(0U), PEN_XCP_ODTS + 1U);
    GOOD(1U, 0xd4, 0, HALF(0U), PEN_XCP_ODTS - 1U);
    BAD(SEQUENCE, 0xd4, 0, HALF(0U), 1);
    BAD(OVERFLOW, 0xd4, 0, HALF(1U), 2);
    GOOD(1U, 0xd4, 0, HALF(1U), 1);
    BAD(RANGE, 0xd3, 0, HALF(1U), 1, 1);
    BAD(OVERFLOW, 0xd3, 0, HALF(1U), 0, PEN_XCP_ENTRIES + 1U);
    GOOD(1U, 0xd3, 0, HALF(1U), 0, PEN_XCP_ENTRIES);
    BAD(SEQUENCE, 0xd3, 0, HALF(1U), 0, 1);
    BAD(OVERFLOW, 0xd3, 0, HALF(0U), 0, 1);
    BAD(RANGE, 0xd3, 0, HALF(0xffffU), 0, 1);
}

void test_entries_are_written_within_their_odt(void)
{
    two_lists();
    BAD(DAQ_CONFIG, 0xe1, 0xff, 1, 0, 0, 0, 0, 0); /* past the last entry */
    BAD(RANGE, 0xe2, 0, HALF(0U), 2, 0);
    BAD(RANGE, 0xe2, 0, HALF(0U), 1, 2);
    BAD(RANGE, 0xe2, 0, HALF(0U), 1, 3);
    BAD(RANGE, 0xe2, 0, HALF(2U), 0, 0);
    pointer(0U, 1U, 1U);
    write_entry(2U, REGION);
    BAD(DAQ_CONFIG, 0xe1, 0xff, 1, 0, 0, 0, 0, 0);
    pointer(0U, 1U, 0U);
    BAD(RANGE, 0xe1, 0, 1, 0, 0, 0, 0, 0);
    BAD(RANGE, 0xe1, 0xff, 0, 0, 0, 0, 0, 0);
    BAD(ACCESS_DENIED, 0xe1, 0xff, 1, 1, 0, 0, 0, 0);
    BAD(ACCESS_DENIED, 0xe1, 0xff, 1, 0, 0, 0, 0, 0);
    TEST_ASSERT_EQUAL_UINT32(8U, send_word(0xe1U, 0xffU, SEGMENT)); /* size 0; pages cannot be measured either */
}

void test_modes_of_lists(void)
{
    two_lists();
    BAD(MODE_NOT_VALID, 0xe0, 0x02, HALF(0U), HALF(0U), 1, 0); /* STIM */
    BAD(RANGE, 0xe0, 0x10, HALF(0U), HALF(1U), 1, 0);
    BAD(RANGE, 0xe0, 0x10, HALF(0U), HALF(0U), 0, 0);
    BAD(MODE_NOT_VALID, 0xde, 3, HALF(0U));
    BAD(RANGE, 0xde, 1, HALF(2U));
    BAD(RANGE, 0xdf, 0, HALF(2U));
}

/* A list that is empty, has an entry without address, or an ODT that no packet has room for, does not start. */
void test_incomplete_lists_do_not_start(void)
{
    two_lists();
    GOOD(1U, 0xe3, 0, HALF(0U));
    BAD(DAQ_CONFIG, 0xde, 1, HALF(0U));
    BAD(DAQ_CONFIG, 0xde, 2, HALF(0U));
    GOOD(2U, 0xde, 0, HALF(0U));
    pointer(0U, 0U, 0U);
    write_entry(8U, REGION);
    pointer(0U, 1U, 0U);
    write_entry(8U, REGION);
    BAD(DAQ_CONFIG, 0xde, 1, HALF(0U));
    write_entry(7U, REGION);
    GOOD(2U, 0xde, 1, HALF(0U)); /* 5 + 8 and 1 + 15 bytes */
    GOOD(1U, 0xdd, 0);
    pointer(0U, 1U, 1U);
    write_entry(8U, REGION);
    BAD(DAQ_CONFIG, 0xde, 1, HALF(0U));
    GOOD(1U, 0xd6);
    GOOD(1U, 0xd5, 0, HALF(1U));
    BAD(DAQ_CONFIG, 0xde, 1, HALF(0U));
}

/* Lists that are allocated again know nothing of those before. */
void test_lists_begin_anew(void)
{
    two_lists();
    GOOD(1U, 0xd6);
    GOOD(1U, 0xd5, 0, HALF(2U));
    for (uint16_t k = 0U; k < 2U; k++) {
        GOOD(8U, 0xdf, 0, HALF(k));
        TEST_ASSERT_EQUAL_HEX8(0U, out[1]);
        TEST_ASSERT_EQUAL_UINT8(1U, out[6]);
    }
    GOOD(1U, 0xd4, 0, HALF(0U), PEN_XCP_ODTS - 1U); /* all room is there */
    GOOD(1U, 0xd4, 0, HALF(1U), 1);
    BAD(RANGE, 0xd3, 0, HALF(1U), 2, 1);
    GOOD(1U, 0xd3, 0, HALF(1U), 0, 2);
    BAD(DAQ_CONFIG, 0xde, 1, HALF(1U));
    pointer(1U, 0U, 0U);
    write_entry(1U, REGION);
    BAD(DAQ_CONFIG, 0xde, 1, HALF(1U)); /* the second has no address yet */
    write_entry(1U, REGION);
    GOOD(2U, 0xde, 1, HALF(1U));
}

void test_whole_entries_and_events_are_looked_at(void)
{
    uint8_t in[8] = { 0xe1U, 0xffU, 3U, 0U };
    const uint32_t address = REGION + 6U;

    two_lists();
    pointer(0U, 0U, 0U);
    memcpy(&in[4], &address, 4U);
    TEST_ASSERT_EQUAL_UINT32(8U, send(8U, in)); /* one byte of it is behind the region */
    TEST_ASSERT_EQUAL_HEX8(ACCESS_DENIED, out[1]);
    in[2] = 2U;
    TEST_ASSERT_EQUAL_UINT32(1U, send(8U, in));
    BAD(RANGE, 0xe0, 0x10, HALF(0U), HALF(0x100U), 1, 0);
}
