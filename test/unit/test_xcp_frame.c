/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "../../port/xcp/xcp_frame.c" /* a port: not among the sources of the runtime */
#include "penode/pen_serial.h"
#include "penode/pen_xcp.h"
#include "unity.h"

#include "xcp_fixture.inc"

#define MAX 16U

static uint8_t frame[XCP_FRAME_HEAD + MAX + XCP_FRAME_TAIL + 1U];
static uint8_t message[512];
static xcp_stream_t stream;

static void use(uint32_t checksum)
{
    stream = (xcp_stream_t){ .max = MAX, .checksum = checksum, .frame = frame };
    frame[sizeof(frame) - 1U] = 0x5aU;
    xcp_stream_begin(&stream);
}

/* Packet of n bytes 1, 2, ... as a message. */
static uint32_t message_of(uint32_t n)
{
    for (uint32_t i = 0U; i < n; i++) {
        message[XCP_FRAME_HEAD + i] = (uint8_t)(i + 1U);
    }
    return xcp_stream_frame(&stream, n, message);
}

/* The packet comes with the last byte, not before. */
static uint32_t take(uint32_t bytes)
{
    uint32_t n = 0U;

    for (uint32_t i = 0U; i < bytes; i++) {
        TEST_ASSERT_EQUAL_UINT32(0U, n);
        n = xcp_stream_take(&stream, message[i]);
    }
    TEST_ASSERT_EQUAL_HEX8(0x5a, frame[sizeof(frame) - 1U]);
    return n;
}

void test_messages_have_length_and_counter(void)
{
    use(0U);
    for (uint32_t k = 0U; k < 300U; k++) {
        TEST_ASSERT_EQUAL_UINT32(7U, message_of(3U));
        TEST_ASSERT_EQUAL_HEX8(3U, message[0]);
        TEST_ASSERT_EQUAL_HEX8(0U, message[1]);
        TEST_ASSERT_EQUAL_HEX8(k & 0xffU, message[2]);
        TEST_ASSERT_EQUAL_HEX8(k >> 8U, message[3]);
        TEST_ASSERT_EQUAL_UINT32(3U, take(7U));
        TEST_ASSERT_EQUAL_HEX8_ARRAY(&message[4], &frame[4], 3U);
    }
}

void test_every_length_with_every_checksum(void)
{
    for (uint32_t checksum = 0U; checksum <= 2U; checksum++) {
        use(checksum);
        for (uint32_t n = 1U; n <= MAX; n++) {
            const uint32_t bytes = message_of(n);
            TEST_ASSERT_EQUAL_UINT32(4U + n + checksum + ((checksum == 2U) ? (n & 1U) : 0U), bytes);
            TEST_ASSERT_EQUAL_UINT32(n, take(bytes));
            TEST_ASSERT_EQUAL_HEX8_ARRAY(&message[4], &frame[4], n);
        }
    }
}

/* Known answers: LEN 3, CTR 0, packet 1 2 3. */
void test_checksums(void)
{
    use(1U);
    TEST_ASSERT_EQUAL_UINT32(8U, message_of(3U));
    TEST_ASSERT_EQUAL_HEX8(9U, message[7]);
    use(2U);
    TEST_ASSERT_EQUAL_UINT32(10U, message_of(3U));
    TEST_ASSERT_EQUAL_HEX8(0U, message[7]); /* fill */
    TEST_ASSERT_EQUAL_HEX8(7U, message[8]); /* 0x0003 + 0x0201 + 0x0003 */
    TEST_ASSERT_EQUAL_HEX8(2U, message[9]);
}

void test_wrong_checksums_are_skipped(void)
{
    for (uint32_t checksum = 1U; checksum <= 2U; checksum++) {
        for (uint32_t i = 2U; i < 10U; i++) { /* the length aside: that needs xcp_stream_begin after a pause */
            uint32_t bytes;
            use(checksum);
            bytes = message_of(4U);
            if (i < bytes) {
                message[i] ^= 0x10U;
                TEST_ASSERT_EQUAL_UINT32(0U, take(bytes));
            }
            bytes = message_of(4U);
            TEST_ASSERT_EQUAL_UINT32(4U, take(bytes));
        }
    }
}

void test_messages_that_are_empty_or_too_long_are_skipped(void)
{
    use(0U);
    TEST_ASSERT_EQUAL_UINT32(0U, take(message_of(0U)));
    TEST_ASSERT_EQUAL_UINT32(0U, take(message_of(MAX + 1U)));
    TEST_ASSERT_EQUAL_UINT32(0U, take(message_of(400U)));
    TEST_ASSERT_EQUAL_UINT32(MAX, take(message_of(MAX)));
}

void test_a_message_can_be_given_up(void)
{
    use(0U);
    TEST_ASSERT_EQUAL_UINT32(0U, take(message_of(5U) - 1U));
    xcp_stream_begin(&stream);
    TEST_ASSERT_EQUAL_UINT32(6U, take(message_of(6U)));
}

void test_can_lengths(void)
{
    static const uint8_t length[16] = { 0U, 1U, 2U, 3U, 4U, 5U, 6U, 7U, 8U, 12U, 16U, 20U, 24U, 32U, 48U, 64U };
    uint8_t data[64];

    for (uint32_t dlc = 0U; dlc < 16U; dlc++) {
        TEST_ASSERT_EQUAL_UINT32(length[dlc], xcp_can_length(dlc));
        TEST_ASSERT_EQUAL_UINT32(dlc, xcp_can_dlc(length[dlc]));
    }
    TEST_ASSERT_EQUAL_UINT32(15U, xcp_can_dlc(100U));
    for (uint32_t n = 1U; n <= 64U; n++) {
        memset(data, 0xff, sizeof(data));
        const uint32_t sent = xcp_can_fill(n, 64U, false, data);
        TEST_ASSERT_EQUAL_UINT32(xcp_can_length(xcp_can_dlc(sent)), sent);
        TEST_ASSERT_TRUE((sent >= n) && ((n <= 8U) ? (sent == n) : (sent < (n + 16U))));
        for (uint32_t i = 0U; i < sizeof(data); i++) {
            TEST_ASSERT_EQUAL_HEX8(((i >= n) && (i < sent)) ? 0U : 0xffU, data[i]);
        }
    }
    TEST_ASSERT_EQUAL_UINT32(8U, xcp_can_fill(2U, 8U, true, data));
    TEST_ASSERT_EQUAL_UINT32(64U, xcp_can_fill(9U, 64U, true, data));
}

/* -- a transfer that is cut --------------------------------------------------------------------------------------------- */

static uint8_t bulk[256];

static uint32_t append(uint32_t to, uint32_t n, const uint8_t packet[])
{
    uint8_t one[64];
    uint32_t bytes;

    memcpy(&one[XCP_FRAME_HEAD], packet, n);
    bytes = xcp_stream_frame(&stream, n, one);
    memcpy(&bulk[to], one, bytes);
    return to + bytes;
}

/* SET_MTA, a whole page in blocks, SET_CAL_PAGE(ECU, 0), as a stream. */
static uint32_t make_bulk(void)
{
    const uint32_t segment = SEGMENT;
    uint8_t packet[MAX] = { 0xf6U };
    pen_real_t value[N] = { 11, 12, 13, 14, 15 };
    uint32_t n;

    memcpy(&packet[4], &segment, 4U);
    n = append(0U, 8U, packet);
    for (uint32_t done = 0U; done < SIZE;) {
        const uint32_t now = ((SIZE - done) < (MAX - 2U)) ? (SIZE - done) : (MAX - 2U);
        packet[0] = (done == 0U) ? 0xf0U : 0xefU;
        packet[1] = (uint8_t)(SIZE - done);
        memcpy(&packet[2], &((const uint8_t *)value)[done], now);
        n = append(n, 2U + now, packet);
        done += now;
    }
    return append(n, 4U, (const uint8_t[]){ 0xebU, 0x83U, 0U, 0U });
}

static void feed(uint32_t bytes)
{
    for (uint32_t i = 0U; i < bytes; i++) {
        const uint32_t n = xcp_stream_take(&stream, bulk[i]);
        if (n > 0U) {
            (void)pen_xcp_receive(&xcp, &frame[XCP_FRAME_HEAD], n, out);
        }
    }
}

void test_transfer_that_is_cut_at_every_byte(void)
{
    uint32_t all;

    use(0U);
    all = make_bulk();
    for (uint32_t cut = 0U; cut < all; cut++) {
        for (uint32_t noticed = 0U; noticed < 2U; noticed++) { /* by the slave's side, or by the master alone */
            xcp_stream_begin(&stream);
            feed(cut);
            if (noticed == 1U) {
                pen_xcp_disconnect(&xcp);
            }
            TEST_ASSERT_EQUAL_UINT32(1U, step()->head.id);
            xcp_stream_begin(&stream);
            GOOD(8U, 0xff, 0);
            at(SEGMENT);
            TEST_ASSERT_EQUAL_UINT32(8U, send_word(0xf3U, 0U, SIZE));
            TEST_ASSERT_EQUAL_HEX32(first.head.checksum, number_of(4U, &out[4]));
            TEST_ASSERT_FALSE(instance.tuning.open != 0U);
        }
    }
    xcp_stream_begin(&stream);
    feed(all);
    TEST_ASSERT_TRUE(step()->value[4] == (pen_real_t)15);
    TEST_ASSERT_TRUE(step()->head.id >= FIRST);
}
