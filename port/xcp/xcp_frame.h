/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * Framings of XCP packets (penode/pen_xcp.h), without an operating system: bytes in, bytes out.
 *
 *   Ethernet   LEN (2 bytes), CTR (2 bytes), packet; little endian. TCP: a stream. UDP: a datagram holds whole messages.
 *   serial     the same (SxI, HEADER_LEN_CTR_WORD), and after the packet no checksum, or one of 1 or 2 bytes
 *   CAN        the packet alone; filled up to a length that CAN FD has, or to the longest
 */
#ifndef XCP_FRAME_H
#define XCP_FRAME_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define XCP_FRAME_HEAD 4U
#define XCP_FRAME_TAIL 3U /* bytes behind a packet: fill and checksum */

/** One connection. Owned by the caller. */
typedef struct {
    uint32_t max;      /* bytes of the longest packet                                */
    uint32_t checksum; /* bytes: 0; serial: 0, 1 (sum of bytes), 2 (sum of words)    */
    uint8_t *frame;    /* [XCP_FRAME_HEAD + max + XCP_FRAME_TAIL] where a message is put together */
    uint32_t at;       /* bytes of it so far                                         */
    uint32_t sent;     /* messages sent: CTR                                         */
} xcp_stream_t;

/** Begin, or begin again: a new connection, a new datagram, a pause on a serial line. */
void xcp_stream_begin(xcp_stream_t *stream);

/**
 * One byte that was received.
 * @return bytes of a packet that is now whole, at &frame[XCP_FRAME_HEAD], until the next byte; else 0. Messages that are
 *         empty, too long, or whose checksum is wrong, are skipped.
 */
uint32_t xcp_stream_take(xcp_stream_t *stream, uint8_t byte);

/**
 * Frame a packet of n bytes that stands at &message[XCP_FRAME_HEAD].
 * @param message  [XCP_FRAME_HEAD + n + XCP_FRAME_TAIL]
 * @return bytes of the message
 */
uint32_t xcp_stream_frame(xcp_stream_t *stream, uint32_t n, uint8_t message[]);

/** Fill a packet for a CAN frame. @param padded  fill to max: 8 or 64 @param data  [max] @return its length */
uint32_t xcp_can_fill(uint32_t n, uint32_t max, bool padded, uint8_t data[]);

/** DLC of a length that CAN FD has, and back. */
uint32_t xcp_can_dlc(uint32_t length);
uint32_t xcp_can_length(uint32_t dlc);

#ifdef __cplusplus
}
#endif

#endif
