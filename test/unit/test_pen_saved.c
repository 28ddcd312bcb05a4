/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include <stddef.h>
#include <stdint.h>

#include "penode/pen_saved.h"
#include "penode/pen_serial.h"
#include "unity.h"

#include "saved_fixture.inc"

static world_t b;
static uint8_t byte[SIZE];
static uint8_t again[SIZE];

void setUp(void)
{
    fill(&first, first_value, 1U);
    fill(&other, other_value, 2U);
    fill(&foreign, foreign_value, 3U);
    start(&a, &first, true);
    start(&b, &first, true);
}

void tearDown(void) {}

void test_what_is_restored_goes_on_alike_from_every_phase(void)
{
    for (uint32_t phase = 0U; phase < PHASES; phase++) {
        for (uint32_t target = 0U; target < PHASES; target++) { /* whatever the other was about */
            start(&a, &first, true);
            start(&b, &first, true);
            bring(&a, phase);
            bring(&b, target);
            b.row[3] = (pen_real_t)99;
            b.u[1] = (pen_real_t)98;
            b.bank[0][1] = (pen_real_t)97;
            b.bank[1][1] = (pen_real_t)96;
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, save(&a, byte));
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, restore(&b, byte));
            TEST_ASSERT_EQUAL_MEMORY(a.bank, b.bank, sizeof(a.bank));
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, save(&b, again));
            TEST_ASSERT_EQUAL_HEX8_ARRAY(byte, again, SIZE);
            expect_alike(&a, &b);
        }
    }
}

/* Banks and set elsewhere in memory: no address is kept. */
void test_no_address_is_kept(void)
{
    static pen_real_t moved[N];
    pen_set_t set;

    fill(&set, moved, 1U); /* equal to `first`, at another place */
    bring(&a, 4U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, save(&a, byte));
    start(&b, &set, true);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, restore(&b, byte));
    TEST_ASSERT_EQUAL_PTR(moved, b.head.tuning.initial.value);
    TEST_ASSERT_TRUE((b.head.tuning.slot[0].value == b.bank[0]) || (b.head.tuning.slot[0].value == b.bank[1]));
    TEST_ASSERT_TRUE((b.head.tuning.slot[1].value == b.bank[0]) || (b.head.tuning.slot[1].value == b.bank[1]));
    expect_alike(&a, &b);
}

void test_without_banks(void)
{
    start(&a, &first, false);
    start(&b, &first, false);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, choose(&a, &other));
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step(&a));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, save(&a, byte));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, restore(&b, byte));
    TEST_ASSERT_EQUAL_PTR(other_value, b.head.tuning.slot[1].value);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, roll_back(&b));
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step(&b));
    TEST_ASSERT_EQUAL_PTR(first_value, b.head.tuning.slot[0].value);
}

/* ---- refused ---- */

/* Nothing of b changes. */
static void expect_refused(pen_status_t expected, const uint8_t from[], size_t size)
{
    const world_t before = b;

    TEST_ASSERT_EQUAL_HEX32(expected, pen_restore(&model, &b.head, ROWS, b.row, INPUTS, b.u, from, size));
    TEST_ASSERT_EQUAL_MEMORY(&before, &b, sizeof(b));
}

static void seal(uint8_t of[])
{
    pen_serial_put(~pen_crc_bytes(PEN_CRC_START, SIZE - 4U, of), &of[SIZE - 4U]);
}

void test_bad_arguments(void)
{
    static world_t raw;
    pen_model_t strange = model;

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, save(&a, byte));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, save(&a, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, save(&raw, again));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, restore(&raw, byte));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_save(&model, NULL, ROWS, a.row, INPUTS, a.u, again, SIZE));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_restore(&model, NULL, ROWS, b.row, INPUTS, b.u, byte, SIZE));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_save(&model, &a.head, ROWS, a.row, INPUTS, a.u, again, SIZE - 1U));
    expect_refused(PEN_SET_BADARG, NULL, SIZE);
    expect_refused(PEN_SET_BADARG, byte, SIZE - 1U);
    expect_refused(PEN_SET_BADARG, byte, SIZE + 1U);
    strange.layout ^= 1U;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_save(&strange, &a.head, ROWS, a.row, INPUTS, a.u, again, SIZE));
}

void test_every_bit_of_the_bytes_counts(void)
{
    bring(&a, 4U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, save(&a, byte));
    for (size_t i = 0U; i < SIZE; i++) {
        for (uint32_t bit = 0U; bit < 8U; bit++) {
            const uint8_t kept = byte[i];
            byte[i] = (uint8_t)(kept ^ (1U << bit));
            expect_refused(PEN_SET_CHECKSUM, byte, SIZE);
            byte[i] = kept;
        }
    }
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, restore(&b, byte));
}

/* Whole, but not for this instance. */
void test_bytes_of_another_instance(void)
{
    static const uint32_t word[4] = { 0x534e4550U, 0x00020001U, SOURCE ^ 1U, 0U }; /* magic, form, layout, banks */
    pen_set_t set = first;
    pen_real_t value[N];

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, save(&a, byte));
    TEST_ASSERT_EQUAL_HEX32(0x494e4550U, pen_serial_get(&byte[0])); /* "PENI" */
    TEST_ASSERT_EQUAL_HEX32(1U | ((uint32_t)sizeof(pen_real_t) << 16U), pen_serial_get(&byte[4]));
    TEST_ASSERT_EQUAL_HEX32(SOURCE, pen_serial_get(&byte[8]));
    TEST_ASSERT_EQUAL_HEX32(1U, pen_serial_get(&byte[12]));
    for (size_t i = 0U; i < 4U; i++) {
        const uint32_t kept = pen_serial_get(&byte[4U * i]);
        pen_serial_put(word[i], &byte[4U * i]);
        seal(byte);
        expect_refused(PEN_SET_LAYOUT, byte, SIZE);
        pen_serial_put(kept, &byte[4U * i]);
    }
    seal(byte);
    start(&b, &first, false); /* it has no banks */
    expect_refused(PEN_SET_LAYOUT, byte, SIZE);
    start(&b, &other, true); /* it was given another set */
    expect_refused(PEN_SET_LAYOUT, byte, SIZE);
    fill(&set, value, 1U);
    value[2] += (pen_real_t)1;
    set.head.checksum = pen_set_checksum(value, N);
    start(&b, &set, true); /* of the same id, but other values */
    expect_refused(PEN_SET_LAYOUT, byte, SIZE);
    start(&b, &first, true);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, restore(&b, byte));
}

/* A slot that names no set that there is here, or one of another shape. */
void test_slots_that_lead_nowhere(void)
{
    static const uint32_t nowhere[] = { 0U, 6U, 7U, 0x80000000U, UINT32_MAX };

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, save(&a, byte));
    for (uint32_t slot = 0U; slot < 2U; slot++) {
        uint8_t *const at = &byte[SLOT0 + (20U * slot)];
        const uint32_t place = pen_serial_get(&at[16]);
        for (size_t i = 0U; i < (sizeof(nowhere) / sizeof(nowhere[0])); i++) {
            pen_serial_put(nowhere[i], &at[16]);
            seal(byte);
            expect_refused(PEN_SET_LAYOUT, byte, SIZE);
        }
        pen_serial_put(place, &at[16]);
        for (uint32_t i = 0U; i < 2U; i++) {
            const uint32_t kept = pen_serial_get(&at[4U * i]);
            pen_serial_put(kept + 1U, &at[4U * i]);
            seal(byte);
            expect_refused(PEN_SET_LAYOUT, byte, SIZE);
            pen_serial_put(kept, &at[4U * i]);
        }
    }
    seal(byte);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, restore(&b, byte));
}

/* The sets to roll back to, before and after a withdrawal: there may be none, but none that is nowhere. */
void test_rollback_sets_that_lead_nowhere(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, save(&a, byte));
    for (uint32_t k = 2U; k < 4U; k++) {
        uint8_t *const place = &byte[SLOT0 + (20U * k) + 16U];
        const uint32_t kept = pen_serial_get(place);
        pen_serial_put(UINT32_MAX, place);
        seal(byte);
        expect_refused(PEN_SET_LAYOUT, byte, SIZE);
        pen_serial_put(kept, place);
    }
    seal(byte);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, restore(&b, byte));
}

/* A set that restore would not find: refused while it runs, waits or can be rolled back to, and no longer. */
void test_set_that_is_nowhere_cannot_be_saved(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, choose(&a, &foreign));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, save(&a, byte)); /* waits */
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step(&a));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, save(&a, byte)); /* runs */
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, choose(&a, &other));
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step(&a));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, save(&a, byte)); /* may be rolled back to */
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, choose(&a, &first));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, save(&a, byte)); /* may be again, if this is withdrawn */
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step(&a));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, save(&a, byte)); /* gone */
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, restore(&b, byte));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, save(&b, again));
    TEST_ASSERT_EQUAL_HEX8_ARRAY(byte, again, SIZE);
    expect_alike(&a, &b);
}

void test_set_that_is_nowhere_and_was_withdrawn(void)
{
    stage(&a, 5U);
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step(&a));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, choose(&a, &foreign));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tune_withdraw(&model, &a.head));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, save(&a, byte)); /* the step may have been faster */
    TEST_ASSERT_EQUAL_HEX32(PEN_WITHDRAWN, step(&a));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, save(&a, byte));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, restore(&b, byte));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, save(&b, again));
    TEST_ASSERT_EQUAL_HEX8_ARRAY(byte, again, SIZE);
    expect_alike(&a, &b);
}

/* A set of the model file that has other values by now: not run in place of the one that was saved. */
void test_set_of_the_model_file_that_has_changed(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, choose(&a, &other));
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step(&a));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, save(&a, byte));
    fill(&other, other_value, 4U);
    expect_refused(PEN_SET_LAYOUT, byte, SIZE); /* runs */
    fill(&other, other_value, 2U);
    stage(&a, 5U);
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step(&a));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, save(&a, byte));
    fill(&other, other_value, 4U);
    expect_refused(PEN_SET_LAYOUT, byte, SIZE); /* may be rolled back to */
    fill(&other, other_value, 2U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, restore(&b, byte));
}

/* The set given to init lies in a bank, and would be overwritten by what was saved of that. */
void test_initial_set_in_a_bank(void)
{
    pen_set_t set;

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, save(&a, byte));
    fill(&set, b.bank[0], 1U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_init(&model, &b.head, &set, b.bank[0], b.bank[1]));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_ready(&model, &b.head, NULL, PEN_OK));
    expect_refused(PEN_SET_LAYOUT, byte, SIZE);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, save(&b, again));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, restore(&b, again));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_verify(&model, &b.head, NULL, N));
}
