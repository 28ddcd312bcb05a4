/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "penode/pen_serial.h"
#include "penode/pen_xcp.h"
#include "unity.h"

#include "xcp_fixture.inc"

/* -- session --------------------------------------------------------------------------------------------------------- */

void test_init_needs_an_initialised_instance_and_a_packet_size(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_xcp_init(NULL, &config));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_xcp_init(&xcp, NULL));
    config.max_cto = 7U;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_xcp_init(&xcp, &config));
    config.max_cto = 256U;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_xcp_init(&xcp, &config));
    config.max_cto = 255U;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_xcp_init(&xcp, &config));
    instance.ready = 0U;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_xcp_init(&xcp, &config));
    instance.ready = LAYOUT + 1U; /* of another model */
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_xcp_init(&xcp, &config));
}

void test_connect_reports_resources_order_and_sizes(void)
{
    const uint16_t probe = 1U;
    uint8_t lowest;

    memcpy(&lowest, &probe, 1U);
    GOOD(8U, 0xff, 0);
    TEST_ASSERT_EQUAL_HEX8(0x01, out[1]);
    TEST_ASSERT_EQUAL_HEX8((lowest == 1U) ? 0x80 : 0x81, out[2]);
    TEST_ASSERT_EQUAL_UINT8(16U, out[3]);
    TEST_ASSERT_EQUAL_UINT32(16U, number_of(2U, &out[4]));
    TEST_ASSERT_EQUAL_HEX8(1U, out[6]);
    TEST_ASSERT_EQUAL_HEX8(1U, out[7]);
}

void test_silent_unless_connected(void)
{
    GOOD(1U, 0xfe);
    TEST_ASSERT_EQUAL_UINT32(0U, SEND(0xfd));
    TEST_ASSERT_EQUAL_UINT32(0U, SEND(0xfc));
    GOOD(8U, 0xff, 0);
    GOOD(6U, 0xfd);
    pen_xcp_disconnect(&xcp);
    TEST_ASSERT_EQUAL_UINT32(0U, SEND(0xfd));
}

void test_silent_to_nothing_and_to_stimulation(void)
{
    TEST_ASSERT_EQUAL_UINT32(0U, send(0U, memory));
    TEST_ASSERT_EQUAL_UINT32(0U, SEND(0xbf, 0, 0));
    TEST_ASSERT_EQUAL_UINT32(0U, SEND(0x00));
}

void test_unknown_commands(void)
{
    static const uint8_t unknown[] = { 0xc0U, 0xcfU, 0xd0U, 0xd2U, 0xd3U, 0xe3U, 0xecU, 0xedU,
                                       0xf1U, 0xf2U, 0xe5U, 0xe6U, 0xf7U, 0xf8U, 0xf9U };

    for (uint32_t i = 0U; i < sizeof(unknown); i++) {
        BAD(UNKNOWN, unknown[i], 0, 0, 0, 0, 0, 0, 0);
    }
}

void test_packets_that_are_too_short_or_too_long(void)
{
    static const uint8_t needs[48] = { 0, 0, 0, 6, 5, 4, 1, 4, 0, 1, 1, 0, 1, 2, 4, 4, 8, 8, 6, 4, 5, 3, 3, 4,
                                       4, 1, 3, 4, 0, 0, 1, 2, 2, 0, 0, 8, 8, 2, 8, 2, 3, 2, 2, 1, 1, 1, 1, 2 };
    uint8_t in[17] = { 0U };

    for (uint32_t command = 0xd0U; command <= 0xffU; command++) {
        for (uint32_t n = 1U; n < needs[command - 0xd0U]; n++) {
            in[0] = (uint8_t)command;
            TEST_ASSERT_EQUAL_UINT32(8U, send(n, in));
            TEST_ASSERT_EQUAL_HEX8(SYNTAX, out[1]);
        }
    }
    in[0] = 0xfdU;
    TEST_ASSERT_EQUAL_UINT32(6U, send(16U, in)); /* filled */
    TEST_ASSERT_EQUAL_UINT32(8U, send(17U, in));
    TEST_ASSERT_EQUAL_HEX8(SYNTAX, out[1]);
}

void test_status_synch_and_comm_mode(void)
{
    GOOD(6U, 0xfd);
    TEST_ASSERT_EQUAL_HEX8(0U, out[1]);
    TEST_ASSERT_EQUAL_HEX8(0U, out[2]);
    xcp.sampling = 2U;
    GOOD(6U, 0xfd);
    TEST_ASSERT_EQUAL_HEX8(0x40U, out[1]);
    BAD(0, 0xfc);
    GOOD(8U, 0xfb);
    TEST_ASSERT_EQUAL_HEX8(1U, out[2]);
    TEST_ASSERT_EQUAL_HEX8(255U, out[4]);
}

void test_protected_resources_are_locked(void)
{
    config.protect = PEN_XCP_CAL;
    start();
    GOOD(6U, 0xfd);
    TEST_ASSERT_EQUAL_HEX8(PEN_XCP_CAL, out[2]);
    BAD(ACCESS_LOCKED, 0xf0, 1, 0);
    BAD(ACCESS_LOCKED, 0xeb, 1, 0, 0);
    BAD(UNKNOWN, 0xd6);
    BAD(UNKNOWN, 0xe3, 0, 0, 0);
    BAD(ACCESS_LOCKED, 0xe4, 0, 1, 0, 0);
    at(REGION);
    config.protect = PEN_XCP_DAQ;
    start();
    BAD(ACCESS_LOCKED, 0xd6);
    BAD(ACCESS_LOCKED, 0xe3, 0, 0, 0);
    GOOD(1U, 0xe4, 0, 1, 0, 0);
    GOOD(4U, 0xea, 1, 0);
}

/* -- reading ---------------------------------------------------------------------------------------------------------- */

void test_upload_reads_regions_and_goes_on(void)
{
    at(REGION + 1U);
    GOOD(4U, 0xf5, 3);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(&memory[1], &out[1], 3U);
    GOOD(5U, 0xf5, 4);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(&memory[4], &out[1], 4U);
    at(REGION + 7U);
    BAD(ACCESS_DENIED, 0xf5, 2); /* from one region into the next */
    TEST_ASSERT_EQUAL_UINT32(3U, send_word(0xf4U, 2U, REGION + 8U));
    TEST_ASSERT_EQUAL_HEX8('n', out[1]);
    at(REGION + 8U);
    GOOD(3U, 0xf5, 2);
    BAD(ACCESS_DENIED, 0xf5, 1); /* behind what has been read */
}

void test_upload_sizes(void)
{
    at(SEGMENT);
    BAD(RANGE, 0xf5, 0);
    BAD(RANGE, 0xf5, 16);
    GOOD(16U, 0xf5, 15);
    TEST_ASSERT_EQUAL_MEMORY(first_value, &out[1], 15U);
}

void test_addresses_outside_are_denied(void)
{
    static const uint32_t outside[] = { 0U,           REGION - 1U,         REGION + 9U,    REGION + 10U, SEGMENT - 1U,
                                        SEGMENT - 2U, SEGMENT + SIZE - 1U, SEGMENT + SIZE, 0xffffffffU,  0xfffffffeU };

    for (uint32_t i = 0U; i < (sizeof(outside) / sizeof(outside[0])); i++) {
        TEST_ASSERT_EQUAL_UINT32(8U, send_word(0xf4U, 2U, outside[i]));
        TEST_ASSERT_EQUAL_HEX8(ACCESS_DENIED, out[1]);
    }
    BAD(ACCESS_DENIED, 0xf6, 0, 0, 1, 0, 0, 0, 0);
    BAD(ACCESS_DENIED, 0xf4, 1, 0, 1, 0, 0, 0, 0);
}

void test_texts_end_where_they_end(void)
{
    at(SEGMENT); /* which no longer counts */
    GOOD(8U, 0xfa, 1);
    TEST_ASSERT_EQUAL_UINT32(5U, number_of(4U, &out[4]));
    GOOD(3U, 0xf5, 2);
    TEST_ASSERT_EQUAL_HEX8_ARRAY("na", &out[1], 2U);
    BAD(ACCESS_DENIED, 0xf5, 4);
    TEST_ASSERT_EQUAL_UINT32(8U, send_word(0xf3U, 0U, 1U));
    TEST_ASSERT_EQUAL_HEX8(ACCESS_DENIED, out[1]);
    BAD(ACCESS_DENIED, 0xf0, 1, 0);
    GOOD(4U, 0xf5, 3);
    TEST_ASSERT_EQUAL_HEX8_ARRAY("me!", &out[1], 3U);
    BAD(ACCESS_DENIED, 0xf5, 1);
    at(REGION);
    GOOD(2U, 0xf5, 1);
    TEST_ASSERT_EQUAL_HEX8(10U, out[1]);
}

void test_texts_that_are_not_there(void)
{
    static const uint8_t types[] = { 0U, 2U, 5U, 6U, 255U };

    at(REGION);
    for (uint32_t i = 0U; i < sizeof(types); i++) {
        GOOD(8U, 0xfa, types[i]);
        TEST_ASSERT_EQUAL_UINT32(0U, number_of(4U, &out[4]));
    }
    GOOD(2U, 0xf5, 1);
}

/* -- checksums -------------------------------------------------------------------------------------------------------- */

void test_checksum_is_that_of_the_serial_form(void)
{
    at(SEGMENT);
    TEST_ASSERT_EQUAL_UINT32(8U, send_word(0xf3U, 0U, SIZE));
    TEST_ASSERT_EQUAL_HEX8(0xff, out[0]);
    TEST_ASSERT_EQUAL_UINT8(9U, out[1]);
    TEST_ASSERT_EQUAL_HEX32(first.head.checksum, number_of(4U, &out[4]));
    at(SEGMENT + (uint32_t)sizeof(pen_real_t));
    TEST_ASSERT_EQUAL_UINT32(8U, send_word(0xf3U, 0U, 2U * (uint32_t)sizeof(pen_real_t)));
    TEST_ASSERT_EQUAL_HEX32(pen_set_checksum(&first_value[1], 2U), number_of(4U, &out[4]));
    GOOD(1U + (uint32_t)sizeof(pen_real_t), 0xf5, (uint8_t)sizeof(pen_real_t)); /* behind what was checked */
    TEST_ASSERT_EQUAL_MEMORY(&first_value[3], &out[1], sizeof(pen_real_t));
}

void test_checksum_of_a_region_and_of_nothing(void)
{
    at(REGION + 1U);
    TEST_ASSERT_EQUAL_UINT32(8U, send_word(0xf3U, 0U, 7U));
    TEST_ASSERT_EQUAL_HEX32(~pen_crc_bytes(PEN_CRC_START, 7U, &memory[1]), number_of(4U, &out[4]));
    at(REGION + 1U);
    TEST_ASSERT_EQUAL_UINT32(8U, send_word(0xf3U, 0U, 0U));
    TEST_ASSERT_EQUAL_HEX8(RANGE, out[1]);
    TEST_ASSERT_EQUAL_UINT32(8U, send_word(0xf3U, 0U, 8U));
    TEST_ASSERT_EQUAL_HEX8(ACCESS_DENIED, out[1]);
    TEST_ASSERT_EQUAL_UINT32(8U, send_word(0xf3U, 0U, 0xffffffffU));
    TEST_ASSERT_EQUAL_HEX8(ACCESS_DENIED, out[1]);
}

/* -- the number formats of packets ------------------------------------------------------------------------------------ */

void test_segment_and_processor_info(void)
{
    GOOD(8U, 0xe8, 0, 0, 0, 0);
    TEST_ASSERT_EQUAL_HEX32(SEGMENT, number_of(4U, &out[4]));
    GOOD(8U, 0xe8, 0, 0, 1, 0);
    TEST_ASSERT_EQUAL_UINT32(SIZE, number_of(4U, &out[4]));
    GOOD(6U, 0xe8, 1, 0, 0, 0);
    TEST_ASSERT_EQUAL_UINT8(2U, out[1]);
    BAD(RANGE, 0xe8, 0, 0, 2, 0);
    BAD(RANGE, 0xe8, 2, 0, 0, 0);
    BAD(SEGMENT_NOT_VALID, 0xe8, 1, 1, 0, 0);
    GOOD(3U, 0xe9);
    TEST_ASSERT_EQUAL_UINT8(1U, out[1]);
    TEST_ASSERT_EQUAL_UINT8(0U, out[2]);
    GOOD(3U, 0xe7, 0, 0, 0);
    TEST_ASSERT_EQUAL_HEX8(0x3f, out[1]);
    GOOD(3U, 0xe7, 0, 0, 1);
    TEST_ASSERT_EQUAL_HEX8(0x0f, out[1]);
    BAD(PAGE_NOT_VALID, 0xe7, 0, 0, 2);
    BAD(SEGMENT_NOT_VALID, 0xe7, 0, 1, 1);
}

/* -- options ---------------------------------------------------------------------------------------------------------- */

static uint32_t seed(uint8_t resource, uint8_t to[])
{
    to[0] = resource;
    to[1] = 0x55U;
    return 2U;
}

static bool unlock(uint8_t resource, uint32_t n, const uint8_t key[])
{
    return (n == 1U) && (key[0] == (uint8_t)(resource ^ 0x55U));
}

static pen_xcp_options_t options;

static void with_options(void)
{
    options = (pen_xcp_options_t){ .seed = seed, .unlock = unlock, .freeze = true };
    config.options = &options;
    config.options_command = pen_xcp_options_command;
    config.protect = PEN_XCP_CAL | PEN_XCP_DAQ;
    start();
}

void test_seed_and_key(void)
{
    with_options();
    BAD(SEQUENCE, 0xf7, 1, 0x54); /* no seed yet */
    BAD(RANGE, 0xf8, 1, PEN_XCP_CAL);
    GOOD(4U, 0xf8, 0, PEN_XCP_CAL);
    TEST_ASSERT_EQUAL_HEX8(2U, out[1]);
    TEST_ASSERT_EQUAL_HEX8(PEN_XCP_CAL, out[2]);
    BAD(SYNTAX, 0xf7, 2, 0x54);
    BAD(SEQUENCE, 0xf7, 1, 0x54); /* a seed is good for one key */
    GOOD(4U, 0xf8, 0, PEN_XCP_CAL);
    GOOD(2U, 0xf7, 1, 0x54, 0, 0, 0, 0, 0); /* fill behind the key */
    TEST_ASSERT_EQUAL_HEX8(PEN_XCP_DAQ, out[1]);
    GOOD(2U, 0xf8, 0, PEN_XCP_CAL); /* open already */
    TEST_ASSERT_EQUAL_HEX8(0U, out[1]);
    GOOD(4U, 0xea, 1, 0);
    GOOD(4U, 0xf8, 0, PEN_XCP_DAQ);
    BAD(ACCESS_LOCKED, 0xf7, 1, 0x00);
    TEST_ASSERT_EQUAL_UINT32(0U, SEND(0xfd)); /* disconnected */
    GOOD(8U, 0xff, 0);
    BAD(ACCESS_LOCKED, 0xf0, 1, 0); /* and locked again */
}

void test_no_keys(void)
{
    with_options();
    options.unlock = NULL;
    BAD(UNKNOWN, 0xf8, 0, PEN_XCP_CAL);
    options.seed = NULL;
    options.unlock = unlock;
    BAD(UNKNOWN, 0xf8, 0, PEN_XCP_CAL);
}

void test_what_memory_holds_before_is_not_stored(void)
{
    memset(&xcp, 0x5a, sizeof(xcp));
    config.options = &options;
    config.options_command = pen_xcp_options_command;
    config.protect = 0U;
    start();
    GOOD(3U, 0xe5, 0, 0);
    TEST_ASSERT_EQUAL_UINT8(0U, out[2]);
    GOOD(6U, 0xfd);
    TEST_ASSERT_EQUAL_HEX8(0U, out[1]);
    TEST_ASSERT_NULL(pen_xcp_to_store(&xcp));
}

void test_store_only_what_is_frozen(void)
{
    with_options();
    config.protect = 0U;
    start();
    BAD(MODE_NOT_VALID, 0xe6, 2, 0);
    BAD(MODE_NOT_VALID, 0xe6, 3, 0);
    GOOD(3U, 0xe9);
    TEST_ASSERT_EQUAL_UINT8(1U, out[2]);
    GOOD(1U, 0xf9, 1, 0, 0);
    TEST_ASSERT_NULL(pen_xcp_to_store(&xcp));
    TEST_ASSERT_EQUAL_UINT32(0U, pen_xcp_stored(&xcp, out));
    GOOD(1U, 0xe6, 1, 0);
    GOOD(3U, 0xe5, 0, 0);
    TEST_ASSERT_EQUAL_UINT8(1U, out[2]);
    write_value(0U, (pen_real_t)7);
    GOOD(1U, 0xeb, 1, 0, 0);
    (void)step();
    write_value(0U, (pen_real_t)8);
    GOOD(1U, 0xeb, 1, 0, 0);
    GOOD(1U, 0xf9, 1, 0, 0);
    GOOD(6U, 0xfd);
    TEST_ASSERT_EQUAL_HEX8(1U, out[1]);
    TEST_ASSERT_NULL(pen_xcp_to_store(&xcp)); /* not in force yet */
    (void)step();
    TEST_ASSERT_NOT_NULL(pen_xcp_to_store(&xcp));
    TEST_ASSERT_TRUE(pen_xcp_to_store(&xcp)->value[0] == (pen_real_t)8);
    TEST_ASSERT_EQUAL_UINT32(2U, pen_xcp_stored(&xcp, out));
    TEST_ASSERT_EQUAL_HEX8(0xfdU, out[0]);
    TEST_ASSERT_EQUAL_HEX8(3U, out[1]);
    TEST_ASSERT_NULL(pen_xcp_to_store(&xcp));
    GOOD(1U, 0xf9, 1, 0, 0);
    pen_xcp_disconnect(&xcp);
    TEST_ASSERT_EQUAL_UINT32(0U, pen_xcp_stored(&xcp, out)); /* stored all the same, nobody to tell */
}

void test_no_storing(void)
{
    with_options();
    config.protect = 0U;
    options.freeze = false;
    start();
    GOOD(3U, 0xe9);
    TEST_ASSERT_EQUAL_UINT8(0U, out[2]);
    BAD(RANGE, 0xf9, 1, 0, 0);
    BAD(RANGE, 0xf9, 4, 0, 0);
    BAD(MODE_NOT_VALID, 0xe6, 1, 0);
    BAD(MODE_NOT_VALID, 0xe6, 2, 0);
    GOOD(1U, 0xe6, 0, 0);
    BAD(SEGMENT_NOT_VALID, 0xe6, 0, 1);
    BAD(SEGMENT_NOT_VALID, 0xe5, 0, 1);
}
