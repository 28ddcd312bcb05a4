/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include <stddef.h>
#include <stdint.h>

#include "penode/pen_serial.h"
#include "unity.h"

#define DOUBLE (sizeof(pen_real_t) == 8U)
#define VALUES 3U
#define BYTES  (VALUES * sizeof(pen_real_t))
#define GUARD  0xa5U

/* The form by another hand, Python: h = b"PENS" + struct.pack("<HHIIIII", 1, 4, 0x11223344, 0x506, 0xa1b2c3d4, 0xbadcafe, 0),
   then struct.pack("<I", zlib.crc32(h)); the same with 8 for double. */
static const uint8_t golden_float[PEN_SERIAL_HEAD] = {
    0x50U, 0x45U, 0x4eU, 0x53U, 0x01U, 0x00U, 0x04U, 0x00U, 0x44U, 0x33U, 0x22U, 0x11U, 0x06U, 0x05U, 0x00U, 0x00U,
    0xd4U, 0xc3U, 0xb2U, 0xa1U, 0xfeU, 0xcaU, 0xadU, 0x0bU, 0x00U, 0x00U, 0x00U, 0x00U, 0x6aU, 0xfbU, 0x45U, 0xf5U,
};
static const uint8_t golden_double[PEN_SERIAL_HEAD] = {
    0x50U, 0x45U, 0x4eU, 0x53U, 0x01U, 0x00U, 0x08U, 0x00U, 0x44U, 0x33U, 0x22U, 0x11U, 0x06U, 0x05U, 0x00U, 0x00U,
    0xd4U, 0xc3U, 0xb2U, 0xa1U, 0xfeU, 0xcaU, 0xadU, 0x0bU, 0x00U, 0x00U, 0x00U, 0x00U, 0x6aU, 0x4eU, 0xa7U, 0x10U,
};
static const pen_set_head_t golden_head = { 0x11223344U, 0x00000506U, 0xa1b2c3d4U, 0x0badcafeU };

/* numpy.array([1, -2.5, 0.15625], "<f4" or "<f8").tobytes(): all exact in both types */
static const pen_real_t value[VALUES] = { (pen_real_t)1, (pen_real_t)-2.5F, (pen_real_t)0.15625F };
static const uint8_t value_float[12] = { 0U, 0U, 0x80U, 0x3fU, 0U, 0U, 0x20U, 0xc0U, 0U, 0U, 0x20U, 0x3eU };
static const uint8_t value_double[24] = { 0U, 0U, 0U,    0U,    0U, 0U, 0xf0U, 0x3fU, 0U, 0U, 0U,    0U,
                                          0U, 0U, 0x04U, 0xc0U, 0U, 0U, 0U,    0U,    0U, 0U, 0xc4U, 0x3fU };

static const uint8_t *golden;
static const uint8_t *golden_value;
static uint8_t byte[PEN_SERIAL_HEAD];

void setUp(void)
{
    golden = DOUBLE ? golden_double : golden_float;
    golden_value = DOUBLE ? value_double : value_float;
    for (size_t i = 0U; i < PEN_SERIAL_HEAD; i++) {
        byte[i] = golden[i];
    }
}

void tearDown(void) {}

static void expect_refused(pen_status_t expected)
{
    pen_set_head_t head = { 1U, 2U, 3U, 4U };
    const pen_set_head_t before = head;

    TEST_ASSERT_EQUAL_HEX32(expected, pen_serial_read(byte, &head));
    TEST_ASSERT_EQUAL_MEMORY(&before, &head, sizeof(head));
}

/* A word of the head anew, and the checksum of the head with it. */
static void alter(size_t at, uint32_t word)
{
    pen_serial_put(word, &byte[at]);
    pen_serial_put(~pen_crc_bytes(PEN_CRC_START, 28U, byte), &byte[28]);
}

/* 0xcbf43926 is the check value of the catalogue of CRCs. The others are zlib.crc32 of struct.pack("<I", 0x01020304) and of
   the values' bytes. */
void test_crc_is_that_of_ieee_802_3(void)
{
    static const uint8_t digits[9] = { 0x31U, 0x32U, 0x33U, 0x34U, 0x35U, 0x36U, 0x37U, 0x38U, 0x39U };

    TEST_ASSERT_EQUAL_HEX32(0xcbf43926U, ~pen_crc_bytes(PEN_CRC_START, 9U, digits));
    TEST_ASSERT_EQUAL_HEX32(0xe951a406U, ~pen_crc_word(PEN_CRC_START, 0x01020304U));
    TEST_ASSERT_EQUAL_HEX32(DOUBLE ? 0x936ebcfeU : 0xd6041489U, ~pen_crc_values(PEN_CRC_START, VALUES, value));
    TEST_ASSERT_EQUAL_HEX32(0U, ~pen_crc_bytes(PEN_CRC_START, 0U, digits));
    TEST_ASSERT_EQUAL_HEX32(0U, ~pen_crc_values(PEN_CRC_START, 0U, value));
}

/* Passed on, parts give what the whole gives. */
void test_crc_of_parts_is_that_of_the_whole(void)
{
    const uint32_t whole = pen_crc_bytes(PEN_CRC_START, PEN_SERIAL_HEAD, golden);

    for (size_t cut = 0U; cut <= PEN_SERIAL_HEAD; cut++) {
        const uint32_t part = pen_crc_bytes(PEN_CRC_START, cut, golden);
        TEST_ASSERT_EQUAL_HEX32(whole, pen_crc_bytes(part, PEN_SERIAL_HEAD - cut, &golden[cut]));
    }
    for (size_t cut = 0U; cut <= VALUES; cut++) {
        const uint32_t part = pen_crc_values(PEN_CRC_START, cut, value);
        TEST_ASSERT_EQUAL_HEX32(DOUBLE ? 0x936ebcfeU : 0xd6041489U, ~pen_crc_values(part, VALUES - cut, &value[cut]));
    }
}

void test_head_to_the_byte(void)
{
    uint8_t written[PEN_SERIAL_HEAD + 1U];
    pen_set_head_t head = { 0U, 0U, 0U, 0U };

    written[PEN_SERIAL_HEAD] = GUARD;
    pen_serial_write(&golden_head, written);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(golden, written, PEN_SERIAL_HEAD);
    TEST_ASSERT_EQUAL_HEX8(GUARD, written[PEN_SERIAL_HEAD]);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_serial_read(golden, &head));
    TEST_ASSERT_EQUAL_MEMORY(&golden_head, &head, sizeof(head));
}

void test_every_bit_of_the_head_counts(void)
{
    for (size_t i = 0U; i < PEN_SERIAL_HEAD; i++) {
        for (uint32_t bit = 0U; bit < 8U; bit++) {
            const uint8_t kept = byte[i];
            byte[i] = (uint8_t)(kept ^ (1U << bit));
            expect_refused(PEN_SET_CHECKSUM);
            byte[i] = kept;
        }
    }
}

/* Whole, but of another kind: with a checksum that fits. */
void test_other_forms_are_refused(void)
{
    static const uint32_t form[] = { 0x00040000U, 0x00040002U, 0x00080002U, 0x00020001U, 0x00000001U, 0x01040001U, 0x00040101U };

    for (size_t i = 0U; i < (sizeof(form) / sizeof(form[0])); i++) {
        alter(4U, form[i]);
        expect_refused(PEN_SET_LAYOUT);
    }
    alter(4U, DOUBLE ? 0x00040001U : 0x00080001U); /* the other real type */
    expect_refused(PEN_SET_LAYOUT);
    alter(4U, DOUBLE ? 0x00080001U : 0x00040001U);
    alter(24U, 1U); /* kept for later versions */
    expect_refused(PEN_SET_LAYOUT);
    alter(24U, 0U);
    alter(0U, 0x494e4550U); /* "PENI": a saved instance */
    expect_refused(PEN_SET_CHECKSUM);
    alter(0U, 0x534e4550U);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(golden, byte, PEN_SERIAL_HEAD);
}

void test_words_at_every_alignment(void)
{
    uint8_t row[12];

    for (size_t at = 1U; at < 8U; at++) {
        for (size_t i = 0U; i < 12U; i++) {
            row[i] = GUARD;
        }
        pen_serial_put(0x81c2a3e4U, &row[at]);
        TEST_ASSERT_EQUAL_HEX8(0xe4U, row[at]);
        TEST_ASSERT_EQUAL_HEX8(0xa3U, row[at + 1U]);
        TEST_ASSERT_EQUAL_HEX8(0xc2U, row[at + 2U]);
        TEST_ASSERT_EQUAL_HEX8(0x81U, row[at + 3U]);
        TEST_ASSERT_EQUAL_HEX8(GUARD, row[at - 1U]);
        TEST_ASSERT_EQUAL_HEX8(GUARD, row[at + 4U]);
        TEST_ASSERT_EQUAL_HEX32(0x81c2a3e4U, pen_serial_get(&row[at]));
    }
}

/* Every stretch of the values' bytes, to every alignment, and back: these bytes and no others. */
void test_values_in_every_stretch_at_every_alignment(void)
{
    for (size_t from = 0U; from <= BYTES; from++) {
        for (size_t n = 0U; n <= (BYTES - from); n++) {
            for (size_t shift = 1U; shift <= 8U; shift++) {
                uint8_t row[BYTES + 10U];
                pen_real_t back[VALUES];
                uint8_t seen[BYTES];
                for (size_t i = 0U; i < sizeof(row); i++) {
                    row[i] = GUARD;
                }
                pen_serial_put_bytes(value, from, n, &row[shift]);
                TEST_ASSERT_EQUAL_HEX8(GUARD, row[shift - 1U]);
                TEST_ASSERT_EQUAL_HEX8(GUARD, row[shift + n]);
                for (size_t i = 0U; i < n; i++) {
                    TEST_ASSERT_EQUAL_HEX8(golden_value[from + i], row[shift + i]);
                }
                for (size_t i = 0U; i < VALUES; i++) {
                    back[i] = (pen_real_t)0; /* all bytes 0 */
                }
                pen_serial_get_bytes(back, from, n, &row[shift]);
                pen_serial_put_bytes(back, 0U, BYTES, seen);
                for (size_t i = 0U; i < BYTES; i++) {
                    TEST_ASSERT_EQUAL_HEX8(((i >= from) && (i < (from + n))) ? golden_value[i] : 0U, seen[i]);
                }
            }
        }
    }
}

void test_values_come_back_as_numbers(void)
{
    pen_real_t back[VALUES] = { (pen_real_t)9, (pen_real_t)9, (pen_real_t)9 };

    pen_serial_get_bytes(back, 0U, BYTES, golden_value);
    for (size_t i = 0U; i < VALUES; i++) {
        TEST_ASSERT_TRUE(back[i] == value[i]);
    }
}
