/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "penode/pen_exact.h"

#include "penode/pen_serial.h"

#define VERSION  1U
#define MAGIC    0x534e4550U /* "PENS" */
#define FORM     (VERSION | ((uint32_t)sizeof(pen_real_t) << 16U))
#define CRC_AT   28U
#define RESERVED 24U

/* On a big-endian core byte `at` of the serial form stands at place(at, swap()), on any other at `at`. */
static size_t swap(void)
{
    static const uint32_t probe = 1U;
    const uint8_t *const first = (const uint8_t *)&probe;

    return ((size_t)1U - first[0]) * (sizeof(pen_real_t) - 1U); /* first[0]: 1 if little endian, else 0 */
}

static size_t place(size_t at, size_t turn)
{
    const size_t last = sizeof(pen_real_t) - 1U;

    return (at & ~last) + ((at ^ turn) & last);
}

/* four bits at a time */
static uint32_t crc_byte(uint32_t crc, uint8_t byte)
{
    static const uint32_t table[16] = {
        0x00000000U, 0x1db71064U, 0x3b6e20c8U, 0x26d930acU, 0x76dc4190U, 0x6b6b51f4U, 0x4db26158U, 0x5005713cU,
        0xedb88320U, 0xf00f9344U, 0xd6d6a3e8U, 0xcb61b38cU, 0x9b64c2b0U, 0x86d3d2d4U, 0xa00ae278U, 0xbdbdf21cU,
    };
    uint32_t next = crc ^ byte;

    next = (next >> 4U) ^ table[next & 0x0fU];
    next = (next >> 4U) ^ table[next & 0x0fU];
    return next;
}

uint32_t pen_crc_bytes(uint32_t crc, size_t n, const uint8_t byte[])
{
    uint32_t next = crc;

    for (size_t i = 0U; i < n; i++) {
        next = crc_byte(next, byte[i]);
    }
    return next;
}

uint32_t pen_crc_values(uint32_t crc, size_t n, const pen_real_t value[])
{
    const uint8_t *const byte = (const uint8_t *)value;
    const size_t turn = swap();
    uint32_t next = crc;

    for (size_t i = 0U; i < (n * sizeof(pen_real_t)); i++) {
        next = crc_byte(next, byte[place(i, turn)]);
    }
    return next;
}

uint32_t pen_crc_word(uint32_t crc, uint32_t word)
{
    uint32_t next = crc;

    for (uint32_t i = 0U; i < 4U; i++) {
        next = crc_byte(next, (uint8_t)((word >> (8U * i)) & 0xffU));
    }
    return next;
}

void pen_serial_put(uint32_t word, uint8_t byte[4])
{
    for (uint32_t i = 0U; i < 4U; i++) {
        byte[i] = (uint8_t)((word >> (8U * i)) & 0xffU);
    }
}

uint32_t pen_serial_get(const uint8_t byte[4])
{
    uint32_t word = 0U;

    for (uint32_t i = 0U; i < 4U; i++) {
        word |= (uint32_t)byte[i] << (8U * i);
    }
    return word;
}

void pen_serial_put_bytes(const pen_real_t value[], size_t offset, size_t n, uint8_t byte[])
{
    const uint8_t *const from = (const uint8_t *)value;
    const size_t turn = swap();

    for (size_t i = 0U; i < n; i++) {
        byte[i] = from[place(offset + i, turn)];
    }
}

void pen_serial_get_bytes(pen_real_t value[], size_t offset, size_t n, const uint8_t byte[])
{
    uint8_t *const to = (uint8_t *)value;
    const size_t turn = swap();

    for (size_t i = 0U; i < n; i++) {
        to[place(offset + i, turn)] = byte[i];
    }
}

void pen_serial_write(const pen_set_head_t *head, uint8_t byte[PEN_SERIAL_HEAD])
{
    pen_serial_put(MAGIC, &byte[0]);
    pen_serial_put(FORM, &byte[4]);
    pen_serial_put(head->layout, &byte[8]);
    pen_serial_put(head->length, &byte[12]);
    pen_serial_put(head->id, &byte[16]);
    pen_serial_put(head->checksum, &byte[20]);
    pen_serial_put(0U, &byte[RESERVED]);
    pen_serial_put(~pen_crc_bytes(PEN_CRC_START, CRC_AT, byte), &byte[CRC_AT]);
}

pen_status_t pen_serial_read(const uint8_t byte[PEN_SERIAL_HEAD], pen_set_head_t *head)
{
    const uint32_t crc = ~pen_crc_bytes(PEN_CRC_START, CRC_AT, byte);
    pen_status_t status = PEN_OK;

    if ((pen_serial_get(&byte[0]) != MAGIC) || (pen_serial_get(&byte[CRC_AT]) != crc)) {
        status = PEN_SET_CHECKSUM;
    } else if ((pen_serial_get(&byte[4]) != FORM) || (pen_serial_get(&byte[RESERVED]) != 0U)) {
        status = PEN_SET_LAYOUT;
    } else {
        head->layout = pen_serial_get(&byte[8]);
        head->length = pen_serial_get(&byte[12]);
        head->id = pen_serial_get(&byte[16]);
        head->checksum = pen_serial_get(&byte[20]);
    }
    return status;
}
