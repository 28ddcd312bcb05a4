/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "penode/pen_serial.h"
#include "penode/pen_xcp.h"
#include "unity.h"

#include "xcp_fixture.inc"

#define WORKING   0U
#define REFERENCE 1U
#define ECU       1U
#define TOOL      2U
#define BOTH      0x83U

static uint32_t ecu_page(void)
{
    GOOD(4U, 0xea, ECU, 0);
    return out[3];
}

static void set_page(uint8_t mode, uint8_t page)
{
    GOOD(1U, 0xeb, mode, 0, page);
}

/* Value k of the set in force, after a step, is `value`; its id is `id`. */
static void expect_in_force(uint32_t id, uint32_t k, pen_real_t value)
{
    const pen_set_t *const set = step();

    TEST_ASSERT_EQUAL_UINT32(id, set->head.id);
    TEST_ASSERT_TRUE(set->value[k] == value);
}

/* -- pages are sets ------------------------------------------------------------------------------------------------------ */

void test_reference_runs_at_first(void)
{
    TEST_ASSERT_EQUAL_UINT32(REFERENCE, ecu_page());
    GOOD(4U, 0xea, TOOL, 0);
    TEST_ASSERT_EQUAL_UINT8(WORKING, out[3]);
    BAD(MODE_NOT_VALID, 0xea, 3, 0);
    BAD(SEGMENT_NOT_VALID, 0xea, 1, 1);
    TEST_ASSERT_TRUE(value_at(2U) == (pen_real_t)3);
}

void test_download_is_in_force_with_the_step_after_the_switch(void)
{
    write_value(2U, (pen_real_t)33);
    TEST_ASSERT_TRUE(value_at(2U) == (pen_real_t)33);
    TEST_ASSERT_TRUE(value_at(1U) == (pen_real_t)2);
    expect_in_force(1U, 2U, (pen_real_t)3);
    set_page(ECU, WORKING);
    TEST_ASSERT_EQUAL_UINT32(WORKING, ecu_page()); /* committed: the next step adopts it */
    TEST_ASSERT_TRUE(value_at(2U) == (pen_real_t)33);
    expect_in_force(FIRST, 2U, (pen_real_t)33);
    TEST_ASSERT_EQUAL_UINT32(WORKING, ecu_page());
    TEST_ASSERT_TRUE(first_value[2] == (pen_real_t)3);
}

void test_each_edit_is_a_set_of_its_own(void)
{
    for (uint32_t i = 0U; i < 5U; i++) {
        write_value(0U, (pen_real_t)(50U + i));
        set_page(ECU, WORKING);
        expect_in_force(FIRST + i, 0U, (pen_real_t)(50U + i));
        TEST_ASSERT_TRUE(value_at(4U) == (pen_real_t)5);
    }
    set_page(ECU, WORKING); /* nothing has changed */
    expect_in_force(FIRST + 4U, 0U, (pen_real_t)54);
}

void test_switch_without_an_edit_runs_a_copy_of_the_reference(void)
{
    set_page(BOTH, WORKING);
    expect_in_force(FIRST, 2U, (pen_real_t)3);
    TEST_ASSERT_EQUAL_UINT32(WORKING, ecu_page());
    TEST_ASSERT_TRUE(step()->value != first_value);
}

void test_to_the_reference_and_back(void)
{
    write_value(1U, (pen_real_t)20);
    set_page(ECU, WORKING);
    expect_in_force(FIRST, 1U, (pen_real_t)20);
    set_page(ECU, REFERENCE);
    TEST_ASSERT_EQUAL_UINT32(REFERENCE, ecu_page());
    expect_in_force(1U, 1U, (pen_real_t)2);
    set_page(ECU, REFERENCE); /* runs already */
    TEST_ASSERT_FALSE(pen_tuning_pending(&instance.tuning));
    TEST_ASSERT_TRUE(value_at(1U) == (pen_real_t)20); /* the working page is as it was */
    set_page(ECU, WORKING);
    expect_in_force(FIRST + 1U, 1U, (pen_real_t)20);
}

void test_edits_survive_the_reference(void)
{
    set_page(ECU, WORKING);
    (void)step();
    write_value(3U, (pen_real_t)40);
    set_page(ECU, REFERENCE);
    expect_in_force(1U, 3U, (pen_real_t)4);
    TEST_ASSERT_TRUE(value_at(3U) == (pen_real_t)40);
    write_value(4U, (pen_real_t)50); /* while the reference runs */
    TEST_ASSERT_TRUE(value_at(3U) == (pen_real_t)40);
    expect_in_force(1U, 4U, (pen_real_t)5);
    set_page(ECU, WORKING);
    expect_in_force(FIRST + 2U, 3U, (pen_real_t)40);
    expect_in_force(FIRST + 2U, 4U, (pen_real_t)50);
}

void test_pages_of_tool_and_ecu_switch_apart(void)
{
    write_value(0U, (pen_real_t)9);
    set_page(TOOL, REFERENCE);
    TEST_ASSERT_TRUE(value_at(0U) == (pen_real_t)1);
    TEST_ASSERT_EQUAL_UINT32(8U, download(0U, (pen_real_t)8));
    TEST_ASSERT_EQUAL_HEX8(WRITE_PROTECTED, out[1]);
    at(SEGMENT);
    TEST_ASSERT_EQUAL_UINT32(8U, send_word(0xf3U, 0U, SIZE));
    TEST_ASSERT_EQUAL_HEX32(first.head.checksum, number_of(4U, &out[4]));
    set_page(ECU, WORKING);
    TEST_ASSERT_TRUE(value_at(0U) == (pen_real_t)1);
    set_page(TOOL, WORKING);
    TEST_ASSERT_TRUE(value_at(0U) == (pen_real_t)9);
}

void test_page_of_the_tool_does_not_move_that_of_the_ecu(void)
{
    write_value(0U, (pen_real_t)9);
    set_page(TOOL, WORKING);
    TEST_ASSERT_EQUAL_UINT32(REFERENCE, ecu_page());
    expect_in_force(1U, 0U, (pen_real_t)1);
    set_page(ECU, WORKING);
    (void)step();
    set_page(TOOL, REFERENCE);
    TEST_ASSERT_EQUAL_UINT32(WORKING, ecu_page());
    expect_in_force(FIRST, 0U, (pen_real_t)9);
}

void test_modes_pages_and_segments_that_are_not_there(void)
{
    BAD(MODE_NOT_VALID, 0xeb, 0, 0, 0);
    BAD(MODE_NOT_VALID, 0xeb, 0x80, 0, 0);
    BAD(PAGE_NOT_VALID, 0xeb, 1, 0, 2);
    BAD(SEGMENT_NOT_VALID, 0xeb, 1, 1, 0);
    GOOD(1U, 0xeb, BOTH, 9, 1); /* all segments */
    GOOD(4U, 0xea, TOOL, 0);
    TEST_ASSERT_EQUAL_UINT8(REFERENCE, out[3]);
}

void test_copy_page(void)
{
    write_value(0U, (pen_real_t)9);
    GOOD(1U, 0xe4, 0, 0, 0, 0); /* onto itself */
    TEST_ASSERT_TRUE(value_at(0U) == (pen_real_t)9);
    GOOD(1U, 0xe4, 0, 1, 0, 0);
    TEST_ASSERT_TRUE(value_at(0U) == (pen_real_t)1);
    BAD(WRITE_PROTECTED, 0xe4, 0, 0, 0, 1);
    BAD(PAGE_NOT_VALID, 0xe4, 0, 2, 0, 0);
    BAD(PAGE_NOT_VALID, 0xe4, 0, 0, 0, 2);
    BAD(SEGMENT_NOT_VALID, 0xe4, 1, 1, 0, 0);
    BAD(SEGMENT_NOT_VALID, 0xe4, 0, 1, 1, 0);
    set_page(ECU, WORKING);
    BAD(BUSY, 0xe4, 0, 1, 0, 0);
    expect_in_force(FIRST + 1U, 0U, (pen_real_t)1);
}

/* -- refusals ---------------------------------------------------------------------------------------------------------- */

void test_busy_until_the_step_has_adopted(void)
{
    write_value(0U, (pen_real_t)9);
    set_page(ECU, WORKING);
    TEST_ASSERT_EQUAL_UINT32(8U, download(0U, (pen_real_t)8));
    TEST_ASSERT_EQUAL_HEX8(BUSY, out[1]);
    BAD(BUSY, 0xeb, ECU, 0, REFERENCE);
    expect_in_force(FIRST, 0U, (pen_real_t)9);
    set_page(ECU, REFERENCE);
    BAD(BUSY, 0xeb, ECU, 0, WORKING);
    expect_in_force(1U, 0U, (pen_real_t)1);
    TEST_ASSERT_TRUE(value_at(0U) == (pen_real_t)9);
}

void test_refused_set_stays_open_and_out_of_force(void)
{
    write_value(0U, (pen_real_t)NAN);
    BAD(GENERIC, 0xeb, BOTH, 0, 0);
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_NONFINITE, number_of(4U, &out[4]));
    expect_in_force(1U, 0U, (pen_real_t)1);
    BAD(UNKNOWN, 0xd6);
    TEST_ASSERT_EQUAL_HEX32(0U, number_of(4U, &out[4])); /* the reason belongs to one answer */
    write_value(0U, (pen_real_t)6);
    verdict = PEN_SET_PROMISE;
    BAD(GENERIC, 0xeb, ECU, 0, 0);
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_PROMISE, number_of(4U, &out[4]));
    verdict = PEN_OK;
    set_page(ECU, WORKING);
    expect_in_force(FIRST, 0U, (pen_real_t)6);
}

void test_refused_switch_leaves_the_page_of_the_tool(void)
{
    set_page(TOOL, REFERENCE);
    verdict = PEN_SET_TRIAL;
    BAD(GENERIC, 0xeb, BOTH, 0, 0);
    GOOD(4U, 0xea, TOOL, 0);
    TEST_ASSERT_EQUAL_UINT8(REFERENCE, out[3]);
}

void test_reference_that_is_refused(void)
{
    set_page(ECU, WORKING);
    (void)step();
    first.head.checksum ^= 1U;
    BAD(GENERIC, 0xeb, ECU, 0, REFERENCE);
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CHECKSUM, number_of(4U, &out[4]));
    TEST_ASSERT_EQUAL_UINT32(WORKING, ecu_page());
    TEST_ASSERT_TRUE(value_at(0U) == (pen_real_t)1);
}

void test_no_banks(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_ready(&model, &instance, NULL, pen_init(&model, &instance, &first, NULL, NULL)));
    start();
    TEST_ASSERT_EQUAL_UINT32(8U, download(0U, (pen_real_t)8));
    TEST_ASSERT_EQUAL_HEX8(GENERIC, out[1]);
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, number_of(4U, &out[4]));
}

void test_refusals_are_counted(void)
{
    pen_status_report_t report;

    write_value(0U, (pen_real_t)NAN);
    BAD(GENERIC, 0xeb, ECU, 0, 0);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_instance_status(&model, &instance, &report));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_NONFINITE, report.flags);
}

/* A set that the application selects is the working page; the next edit begins with it. */
void test_set_of_the_application(void)
{
    static const pen_real_t other_value[N] = { 9, 8, 7, 6, 5 };
    const pen_set_t other = { { LAYOUT, N, 77U, pen_set_checksum(other_value, N) }, other_value };

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, choose(&other));
    expect_in_force(77U, 1U, (pen_real_t)8);
    TEST_ASSERT_EQUAL_UINT32(WORKING, ecu_page());
    TEST_ASSERT_TRUE(value_at(1U) == (pen_real_t)8);
    set_page(ECU, WORKING); /* runs already */
    TEST_ASSERT_FALSE(pen_tuning_pending(&instance.tuning));
    write_value(0U, (pen_real_t)1);
    set_page(ECU, WORKING);
    expect_in_force(FIRST, 1U, (pen_real_t)8);
}

/* A slave that starts while a set of the application waits shows the reference until the step adopts that set. */
void test_set_that_waits_at_the_start(void)
{
    static const pen_real_t other_value[N] = { 9, 8, 7, 6, 5 };
    const pen_set_t other = { { LAYOUT, N, 77U, pen_set_checksum(other_value, N) }, other_value };

    memset(&xcp, 0x5a, sizeof(xcp));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, choose(&other));
    start();
    TEST_ASSERT_EQUAL_UINT32(REFERENCE, ecu_page());
    TEST_ASSERT_TRUE(value_at(1U) == (pen_real_t)2);
    expect_in_force(77U, 1U, (pen_real_t)8);
    TEST_ASSERT_EQUAL_UINT32(WORKING, ecu_page());
    TEST_ASSERT_TRUE(value_at(1U) == (pen_real_t)8);
}

/* A bank whose address is damaged is not written to. */
void test_damaged_bank(void)
{
    write_value(0U, (pen_real_t)9);
    instance.tuning.bank[0] = NULL;
    instance.tuning.bank[1] = NULL;
    TEST_ASSERT_EQUAL_UINT32(8U, download(1U, (pen_real_t)8));
    TEST_ASSERT_EQUAL_HEX8(GENERIC, out[1]);
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, number_of(4U, &out[4]));
    BAD(GENERIC, 0xeb, ECU, 0, 0);
    expect_in_force(1U, 0U, (pen_real_t)1);
}
