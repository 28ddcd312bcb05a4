/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * The serial form of a parameter set, for files, buses and containers. Little endian on every core, no alignment
 * required.
 *
 *   byte  0  "PENS"
 *         4  version of this form (16 bits): 1
 *         6  bytes per value (16 bits): 4, or 8 for double
 *         8  layout     } as in pen_set_head_t
 *        12  length     }
 *        16  id         }
 *        20  checksum   }
 *        24  0
 *        28  CRC-32 of the 28 bytes before
 *        32  the values, length of them
 *
 * To receive: pen_serial_read the first 32 bytes, NAME_tune_begin with the head it returns, NAME_tune_write_bytes the
 * rest in chunks of any size, NAME_tune_commit.
 */
#ifndef PEN_SERIAL_H
#define PEN_SERIAL_H

#include <stddef.h>
#include <stdint.h>

#include "penode/pen_real.h"
#include "penode/pen_set.h"
#include "penode/pen_status.h"

#ifdef __cplusplus
extern "C" {
#endif

#define PEN_SERIAL_HEAD 32U /* bytes before the values */

/**
 * Read the head of a set from its serial form. Any context.
 * @param byte  [PEN_SERIAL_HEAD]
 * @param head  written only if PEN_OK
 * @return PEN_OK; PEN_SET_CHECKSUM: not this form, or damaged; PEN_SET_LAYOUT: another version or real type
 */
pen_status_t pen_serial_read(const uint8_t byte[PEN_SERIAL_HEAD], pen_set_head_t *head);

/** Write the serial form of a head. @param byte  [PEN_SERIAL_HEAD] */
void pen_serial_write(const pen_set_head_t *head, uint8_t byte[PEN_SERIAL_HEAD]);

/** A word as four bytes, and back. @param byte  [4] */
void pen_serial_put(uint32_t word, uint8_t byte[4]);
uint32_t pen_serial_get(const uint8_t byte[4]); /* the word of four bytes, whatever their alignment */

/** Write n bytes of the serial form of value[] from its byte `offset` on to byte[]; read them from byte[] into value[]. */
void pen_serial_put_bytes(const pen_real_t value[], size_t offset, size_t n, uint8_t byte[]);
void pen_serial_get_bytes(pen_real_t value[], size_t offset, size_t n, const uint8_t byte[]); /* the reverse; whole or parts of values */

/**
 * CRC-32 (IEEE 802.3, reflected) of bytes; of values, over their serial form; of a word. Begin with PEN_CRC_START, pass
 * each result to the next call; the CRC is ~crc of the last one. Cost: about 10 instructions a byte.
 */
#define PEN_CRC_START UINT32_MAX
uint32_t pen_crc_bytes(uint32_t crc, size_t n, const uint8_t byte[]);
uint32_t pen_crc_values(uint32_t crc, size_t n, const pen_real_t value[]); /* n values, in their serial form */
uint32_t pen_crc_word(uint32_t crc, uint32_t word); /* one word, in its serial form */

#ifdef __cplusplus
}
#endif

#endif
