/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "xcp_frame.h"

#include <stddef.h>

#define FILL 0U

static uint32_t word_at(const uint8_t byte[])
{
    return (uint32_t)byte[0] | ((uint32_t)byte[1] << 8U);
}

static void put_word(uint8_t byte[], uint32_t word)
{
    byte[0] = (uint8_t)(word & 0xffU);
    byte[1] = (uint8_t)((word >> 8U) & 0xffU);
}

/* Bytes before the checksum; a checksum of words stands at an even place. */
static uint32_t body(const xcp_stream_t *stream, uint32_t n)
{
    return XCP_FRAME_HEAD + n + ((stream->checksum == 2U) ? (n & 1U) : 0U);
}

/* Sum over header, packet and fill. */
static uint32_t sum(uint32_t size, uint32_t n, const uint8_t byte[])
{
    uint32_t total = 0U;

    for (uint32_t i = 0U; i < n; i++) {
        total += (uint32_t)byte[i] << (8U * (i & (size - 1U)));
    }
    return total & ((size == 1U) ? 0xffU : 0xffffU);
}

static bool good(const xcp_stream_t *stream, uint32_t n)
{
    const uint32_t end = body(stream, n);
    bool same = true;

    if (stream->checksum == 1U) {
        same = (sum(1U, end, stream->frame) == stream->frame[end]);
    } else if (stream->checksum == 2U) {
        same = (sum(2U, end, stream->frame) == word_at(&stream->frame[end]));
    } else {
        /* none */
    }
    return same;
}

void xcp_stream_begin(xcp_stream_t *stream)
{
    stream->at = 0U;
}

uint32_t xcp_stream_take(xcp_stream_t *stream, uint8_t byte)
{
    uint32_t whole = 0U;

    if (stream->at < (XCP_FRAME_HEAD + stream->max + XCP_FRAME_TAIL)) {
        stream->frame[stream->at] = byte;
    }
    stream->at++;
    if (stream->at >= XCP_FRAME_HEAD) {
        const uint32_t n = word_at(stream->frame);
        if (stream->at == (body(stream, n) + stream->checksum)) {
            stream->at = 0U;
            if ((n <= stream->max) && good(stream, n)) {
                whole = n;
            }
        }
    }
    return whole;
}

uint32_t xcp_stream_frame(xcp_stream_t *stream, uint32_t n, uint8_t message[])
{
    const uint32_t end = body(stream, n);

    put_word(&message[0], n);
    put_word(&message[2], stream->sent);
    stream->sent++;
    for (uint32_t i = XCP_FRAME_HEAD + n; i < end; i++) {
        message[i] = FILL;
    }
    if (stream->checksum == 1U) {
        message[end] = (uint8_t)sum(1U, end, message);
    } else if (stream->checksum == 2U) {
        put_word(&message[end], sum(2U, end, message));
    } else {
        /* none */
    }
    return end + stream->checksum;
}

uint32_t xcp_can_length(uint32_t dlc)
{
    static const uint8_t length[16] = { 0U, 1U, 2U, 3U, 4U, 5U, 6U, 7U, 8U, 12U, 16U, 20U, 24U, 32U, 48U, 64U };

    return length[dlc & 15U];
}

uint32_t xcp_can_dlc(uint32_t length)
{
    uint32_t dlc = 0U;

    while ((dlc < 15U) && (xcp_can_length(dlc) < length)) {
        dlc++;
    }
    return dlc;
}

uint32_t xcp_can_fill(uint32_t n, uint32_t max, bool padded, uint8_t data[])
{
    const uint32_t length = padded ? max : xcp_can_length(xcp_can_dlc(n));

    for (uint32_t i = n; i < length; i++) {
        data[i] = FILL;
    }
    return length;
}
