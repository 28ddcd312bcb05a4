/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include <stddef.h>
#include <stdint.h>

#include "penode/pen_saved.h"
#include "penode/pen_serial.h"
#include "unity.h"

#define LAYOUT 0x600df00dU
#define N      4U
#define ROWS   6U
#define INPUTS 2U
#define SIZE   (PEN_SAVED_HEAD + ((ROWS + INPUTS + (2U * N)) * sizeof(pen_real_t)))
#define SLOT0  (4U * (4U + 9U + 5U)) /* byte at which slot 0 begins: four words, nine of the exchange, the set given to init */

/* An instance and what belongs to it, as a generated model has it. */
typedef struct {
    pen_instance_t head;
    pen_real_t     row[ROWS];
    pen_real_t     u[INPUTS];
    pen_real_t     bank[2][N];
} world_t;

static pen_real_t first_value[N];
static pen_real_t other_value[N];
static pen_real_t foreign_value[N];
static pen_set_t  first;   /* of the model file */
static pen_set_t  other;   /* of the model file */
static pen_set_t  foreign; /* of nobody */

static const pen_set_t *const known[2] = { &first, &other };
static const pen_model_t      model = { LAYOUT, N, PEN_DAMAGE_REPORT, false, false, 0U, 0U, NULL, 2U, known };

static world_t a;
static world_t b;
static uint8_t byte[SIZE];
static uint8_t again[SIZE];

static void fill(pen_set_t *set, pen_real_t value[], uint32_t id)
{
    for (uint32_t i = 0U; i < N; i++) {
        value[i] = (pen_real_t)((10U * id) + i);
    }
    set->head.layout = LAYOUT;
    set->head.length = N;
    set->head.id = id;
    set->head.checksum = pen_set_checksum(value, N);
    set->value = value;
}

static void start(world_t *w, const pen_set_t *set, bool banks)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_init(&model, &w->head, set, banks ? w->bank[0] : NULL, banks ? w->bank[1] : NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_ready(&model, &w->head, NULL, PEN_OK));
    for (uint32_t i = 0U; i < N; i++) {
        w->bank[0][i] = (pen_real_t)0;
        w->bank[1][i] = (pen_real_t)0;
    }
    for (uint32_t i = 0U; i < ROWS; i++) {
        w->row[i] = (pen_real_t)0.5F + (pen_real_t)i;
    }
    for (uint32_t i = 0U; i < INPUTS; i++) {
        w->u[i] = (pen_real_t)-0.25F - (pen_real_t)i;
    }
}

void setUp(void)
{
    fill(&first, first_value, 1U);
    fill(&other, other_value, 2U);
    fill(&foreign, foreign_value, 3U);
    start(&a, &first, true);
    start(&b, &first, true);
}

void tearDown(void) {}

static pen_status_t choose(world_t *w, const pen_set_t *set)
{
    pen_set_t ready;
    const pen_status_t status = pen_tune_select(&model, &w->head, set, &ready);

    return pen_tune_publish(&model, &w->head, NULL, &ready, status);
}

static pen_status_t commit(world_t *w)
{
    pen_set_t ready;
    const pen_status_t status = pen_tune_commit(&model, &w->head, &ready);

    return pen_tune_publish(&model, &w->head, NULL, &ready, status);
}

static pen_status_t roll_back(world_t *w)
{
    pen_set_t ready;
    const pen_status_t status = pen_tune_rollback(&model, &w->head, &ready);

    return pen_tune_publish(&model, &w->head, NULL, &ready, status);
}

static pen_status_t step(world_t *w)
{
    uint32_t slot = 9U;
    const pen_status_t status = pen_tuning_adopt(&w->head.tuning, &slot);

    pen_status_note_step(&w->head.log, status);
    w->row[0] += w->head.tuning.slot[slot].value[0]; /* the state depends on the set that runs */
    return status;
}

static void stage(world_t *w, uint32_t id)
{
    pen_set_t set;
    pen_real_t value[N];

    fill(&set, value, id);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tune_begin(&model, &w->head, &set.head));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tune_write(&model, &w->head, 0U, value, N));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, commit(w));
}

static pen_status_t save(const world_t *w, uint8_t to[])
{
    return pen_save(&model, &w->head, ROWS, w->row, INPUTS, w->u, to, SIZE);
}

static pen_status_t restore(world_t *w, const uint8_t from[])
{
    const pen_status_t status = pen_restore(&model, &w->head, ROWS, w->row, INPUTS, w->u, from, SIZE);

    if (status == PEN_OK) {
        pen_restored(&model, &w->head, NULL);
    }
    return status;
}

/* Bring an instance into one of these phases of an exchange. */
#define PHASES 11U

static void bring(world_t *w, uint32_t phase)
{
    pen_real_t part[N];
    pen_set_t set;

    fill(&set, part, 7U);
    if (phase >= 3U) { /* a set runs in a bank, one of the model file is the rollback set */
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, choose(w, &other));
        TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step(w));
        stage(w, 5U);
        TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step(w));
    }
    switch (phase) {
    case 1U: /* pending in a bank */
        stage(w, 5U);
        break;
    case 2U: /* open, half written */
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tune_begin(&model, &w->head, &set.head));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tune_write(&model, &w->head, 0U, part, 2U));
        break;
    case 4U: /* pending, and another in a bank runs */
        stage(w, 6U);
        break;
    case 5U: /* to be withdrawn */
        stage(w, 6U);
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tune_withdraw(&model, &w->head));
        break;
    case 6U: /* withdrawn, and nobody has looked since */
        stage(w, 6U);
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tune_withdraw(&model, &w->head));
        TEST_ASSERT_EQUAL_HEX32(PEN_WITHDRAWN, step(w));
        break;
    case 7U: /* the rollback set on its way */
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, roll_back(w));
        break;
    case 8U: /* held, a copy open */
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tune_hold(&model, &w->head, true));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tune_begin_copy(&model, &w->head, 8U));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tune_write(&model, &w->head, 3U, part, 1U));
        break;
    case 9U: /* the step has overtaken a withdrawal */
        stage(w, 6U);
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tune_withdraw(&model, &w->head));
        w->head.tuning.active ^= 1U;
        break;
    case 10U: /* counted, and read in between */
        (void)pen_tune_abort(&model, &w->head);
        {
            pen_status_report_t report;
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_instance_status(&model, &w->head, &report));
        }
        (void)pen_tune_abort(&model, &w->head);
        break;
    default: /* 0: just initialised; 3: settled */
        break;
    }
    w->head.running = 3U;
    w->head.scrub = 2U;
}

/* Both do the same from here on, call by call. */
static void expect_alike(world_t *x, world_t *y)
{
    pen_status_report_t report_x;
    pen_status_report_t report_y;

    TEST_ASSERT_EQUAL_HEX32(x->head.running, y->head.running);
    TEST_ASSERT_EQUAL_HEX32(x->head.scrub, y->head.scrub);
    for (uint32_t k = 0U; k < 3U; k++) {
        pen_set_head_t head_x;
        pen_set_head_t head_y;
        pen_status_t status = step(x);
        TEST_ASSERT_EQUAL_HEX32(status, step(y));
        pen_tuning_running(&x->head.tuning, &head_x);
        pen_tuning_running(&y->head.tuning, &head_y);
        TEST_ASSERT_EQUAL_MEMORY(&head_x, &head_y, sizeof(head_x));
        TEST_ASSERT_EQUAL_MEMORY(x->row, y->row, sizeof(x->row));
        TEST_ASSERT_EQUAL_MEMORY(x->u, y->u, sizeof(x->u));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_verify(&model, &y->head, NULL, 2U * N));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_verify(&model, &x->head, NULL, 2U * N));
        status = pen_tune_write(&model, &x->head, 2U, other_value, 2U);
        TEST_ASSERT_EQUAL_HEX32(status, pen_tune_write(&model, &y->head, 2U, other_value, 2U));
        status = commit(x);
        TEST_ASSERT_EQUAL_HEX32(status, commit(y));
        status = roll_back(x);
        TEST_ASSERT_EQUAL_HEX32(status, roll_back(y));
        (void)pen_tune_hold(&model, &x->head, false);
        (void)pen_tune_hold(&model, &y->head, false);
    }
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_instance_status(&model, &x->head, &report_x));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_instance_status(&model, &y->head, &report_y));
    TEST_ASSERT_EQUAL_MEMORY(&report_x, &report_y, sizeof(report_x));
}

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
    static const uint32_t word[4] = { 0x534e4550U, 0x00020001U, LAYOUT ^ 1U, 0U }; /* magic, form, layout, banks */
    pen_set_t set = first;
    pen_real_t value[N];

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, save(&a, byte));
    TEST_ASSERT_EQUAL_HEX32(0x494e4550U, pen_serial_get(&byte[0])); /* "PENI" */
    TEST_ASSERT_EQUAL_HEX32(1U | ((uint32_t)sizeof(pen_real_t) << 16U), pen_serial_get(&byte[4]));
    TEST_ASSERT_EQUAL_HEX32(LAYOUT, pen_serial_get(&byte[8]));
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
