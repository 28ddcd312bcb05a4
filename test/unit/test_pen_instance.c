/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* The half of a model that is the same for all, on a model made by hand: a number and two networks, a tent each. */

#include <stddef.h>
#include <stdint.h>

#include "penode/pen_instance.h"
#include "penode/pen_serial.h"
#include "unity.h"

#define LAYOUT   0x2468aceU
#define NETWORK  12U
#define N        (1U + (2U * NETWORK))
#define ROOM     8U
#define NETWORKS 2U
#define SLOT     (NETWORKS * ROOM)
#define ROUND    (N + SLOT)

static const pen_layer_t layer[2] = { { PEN_LAYER_RELU, 1U, 3U }, { PEN_LAYER_DENSE, 3U, 1U } };
static const pen_network_t network[NETWORKS] = { { { layer, 2U, 3U, 3U }, 1U, NULL }, { { layer, 2U, 3U, 3U }, 1U + NETWORK, NULL } };
static const pen_real_t tent[NETWORK] = {
    (pen_real_t)-3, (pen_real_t)2, (pen_real_t)1, (pen_real_t)1, (pen_real_t)0,  (pen_real_t)1,
    (pen_real_t)-1, (pen_real_t)1, (pen_real_t)0, (pen_real_t)1, (pen_real_t)-2, (pen_real_t)1,
};
/* how many values a call of verify looks at */
static const uint32_t chunks[] = { 1U, 7U, N, ROUND - 1U, ROUND, ROUND + 3U, UINT32_MAX };

#define CHUNKS (sizeof(chunks) / sizeof(chunks[0]))

static pen_model_t model;
static pen_instance_t instance;
static pen_piece_t piece[2U * SLOT];
static pen_real_t bank[2][N];
static pen_real_t first_value[N];
static pen_real_t other_value[N];
static pen_set_t first;
static pen_set_t other;

static void fill(pen_set_t *set, pen_real_t value[], uint32_t id)
{
    value[0] = (pen_real_t)id;
    for (uint32_t i = 0U; i < (2U * NETWORK); i++) {
        value[1U + i] = tent[i % NETWORK];
    }
    value[1U + 11U] = (pen_real_t)id; /* a weight of the last layer: other pieces */
    set->head.layout = LAYOUT;
    set->head.length = N;
    set->head.id = id;
    set->head.checksum = pen_set_checksum(value, N);
    set->value = value;
}

static pen_status_t prepare(const pen_real_t value[], pen_piece_t of_slot[])
{
    pen_real_t line[4U * 3U];
    bool active[3];

    return pen_prepare(&model, value, line, active, of_slot, &instance.breach);
}

static pen_piece_t *inactive(void)
{
    return &piece[SLOT * pen_tuning_inactive(&instance.tuning)];
}

/* What generated code does with a set that was found good. */
static pen_status_t published(pen_status_t found, const pen_set_t *ready)
{
    const pen_status_t status = (found == PEN_OK) ? prepare(ready->value, inactive()) : found;

    return pen_tune_publish(&model, &instance, inactive(), ready, status);
}

static pen_status_t choose(const pen_set_t *set)
{
    pen_set_t ready;
    const pen_status_t status = pen_tune_select(&model, &instance, set, &ready);

    return published(status, &ready);
}

static pen_status_t commit(void)
{
    pen_set_t ready;
    const pen_status_t status = pen_tune_commit(&model, &instance, &ready);

    return published(status, &ready);
}

static pen_status_t roll_back(void)
{
    pen_set_t ready;
    const pen_status_t status = pen_tune_rollback(&model, &instance, &ready);

    return published(status, &ready);
}

static pen_status_t step(void)
{
    uint32_t slot = 9U;

    return pen_tuning_adopt(&instance.tuning, &slot);
}

static uint32_t running(void)
{
    pen_set_head_t head = { 0U, 0U, 0U, 0U };

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tune_running(&model, &instance, &head));
    return head.id;
}

/* As generated code guards a model with on_damage = "rollback". */
static pen_status_t guard(uint32_t n)
{
    const pen_status_t status = pen_verify(&model, &instance, piece, n);

    if ((status == PEN_SET_DAMAGED) && (model.on_damage == PEN_DAMAGE_ROLLBACK)) {
        pen_status_t found = PEN_SET_NO_PREVIOUS;
        pen_set_t ready;
        for (uint32_t rank = 0U; (rank < 2U) && (found != PEN_OK); rank++) {
            found = pen_fallback(&model, &instance, rank, &ready);
            if (found == PEN_OK) {
                found = prepare(ready.value, inactive());
            }
        }
        pen_recover(&model, &instance, inactive(), &ready, found);
    }
    return status;
}

static void start(uint32_t on_damage)
{
    model.layout = LAYOUT;
    model.length = N;
    model.on_damage = on_damage;
    model.clamp = false;
    model.layers = false;
    model.pieces = ROOM;
    model.networks = NETWORKS;
    model.network = network;
    model.sets = 0U;
    model.set = NULL;
    fill(&first, first_value, 1U);
    fill(&other, other_value, 2U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_init(&model, &instance, &first, bank[0], bank[1]));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, prepare(first_value, piece));
    for (size_t i = 0U; i < SLOT; i++) { /* what lies in the other slot is not this slot's pieces */
        piece[SLOT + i].start = (pen_real_t)-77;
        piece[SLOT + i].offset = (pen_real_t)-77;
        piece[SLOT + i].slope = (pen_real_t)-77;
        piece[SLOT + i].status = PEN_OK;
    }
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_ready(&model, &instance, piece, PEN_OK));
}

/* Run a copy of the running set from a bank, as set `id`. */
static void run_copy(uint32_t id)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tune_begin_copy(&model, &instance, id));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, commit());
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step());
    TEST_ASSERT_EQUAL_UINT32(id, running());
}

void setUp(void)
{
    start(PEN_DAMAGE_REPORT);
}

void tearDown(void) {}

static uint32_t least(uint32_t a, uint32_t b)
{
    return (a < b) ? a : b;
}

/* Calls that two rounds take. */
static uint32_t two_rounds(uint32_t n)
{
    const uint32_t taken = least(n, ROUND);

    return ((2U * ROUND) + (taken - 1U)) / taken;
}

static void expect_found_within_two_rounds(uint32_t n)
{
    const uint32_t calls = two_rounds(n);
    pen_status_t status = PEN_OK;

    for (uint32_t k = 0U; (k < calls) && (status == PEN_OK); k++) {
        status = pen_verify(&model, &instance, piece, n);
    }
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_DAMAGED, status);
}

static void expect_whole_for_two_rounds(uint32_t n)
{
    for (uint32_t k = 0U; k < two_rounds(n); k++) {
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_verify(&model, &instance, piece, n));
    }
}

/* Flip a bit of something, expect it to be found from any place of the round, flip it back, expect quiet. */
static void expect_bit_found(uint8_t *byte, uint32_t bit)
{
    for (size_t c = 0U; c < CHUNKS; c++) {
        for (uint32_t before = 0U; before <= ROUND; before += (ROUND / 2U)) {
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_verify(&model, &instance, piece, before));
            *byte = (uint8_t)(*byte ^ (1U << bit));
            expect_found_within_two_rounds(chunks[c]);
            *byte = (uint8_t)(*byte ^ (1U << bit));
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_verify(&model, &instance, piece, ROUND));
        }
    }
}

/* ---- the guard ---- */

void test_whole_set_raises_no_alarm(void)
{
    for (size_t c = 0U; c < CHUNKS; c++) {
        for (uint32_t k = 0U; k < (3U * ROUND); k++) {
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_verify(&model, &instance, piece, chunks[c]));
        }
    }
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_verify(&model, &instance, piece, 0U));
}

void test_damage_in_each_value_of_the_running_set(void)
{
    uint8_t *byte;

    run_copy(5U);
    byte = (uint8_t *)&bank[0][0];
    for (uint32_t i = 0U; i < (N * sizeof(pen_real_t)); i++) {
        expect_bit_found(&byte[i], i % 8U);
    }
}

void test_damage_in_each_word_of_each_piece_in_use(void)
{
    run_copy(5U); /* slot 1 */
    for (uint32_t i = 0U; i < SLOT; i++) {
        pen_piece_t *const at = &piece[SLOT + i];
        expect_bit_found((uint8_t *)&at->start, i % 8U);
        expect_bit_found((uint8_t *)&at->offset, 7U - (i % 8U));
        expect_bit_found((uint8_t *)&at->slope, i % 8U);
        expect_bit_found((uint8_t *)&at->status, i % 8U);
    }
}

/* Not in force: nobody reads them. */
void test_damage_in_the_inactive_slot_is_no_damage(void)
{
    run_copy(5U);
    piece[3].slope += (pen_real_t)1; /* slot 0 */
    bank[1][3] += (pen_real_t)1;
    for (size_t c = 0U; c < CHUNKS; c++) {
        expect_whole_for_two_rounds(chunks[c]);
    }
}

/* What is wrong with heads and addresses is seen at once, before anything is read by them. */
void test_damaged_heads_and_addresses_at_once(void)
{
    pen_tuning_t *const tuning = &instance.tuning;
    uint8_t *const place[] = {
        (uint8_t *)&tuning->slot[1].head,        (uint8_t *)&tuning->slot[1].value, (uint8_t *)&tuning->slot_check[1].head,
        (uint8_t *)&tuning->slot_check[1].value, (uint8_t *)&tuning->bank[0],       (uint8_t *)&tuning->bank[1],
        (uint8_t *)&tuning->bank_check[0],       (uint8_t *)&tuning->bank_check[1], (uint8_t *)&tuning->settled,
    };
    const size_t size[] = {
        sizeof(pen_set_head_t), sizeof(pen_real_t *), sizeof(pen_set_head_t), sizeof(pen_real_t *), sizeof(pen_real_t *),
        sizeof(pen_real_t *),   sizeof(pen_real_t *), sizeof(pen_real_t *),   sizeof(uint32_t),
    };

    run_copy(5U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_verify(&model, &instance, piece, 3U));
    for (size_t p = 0U; p < (sizeof(place) / sizeof(place[0])); p++) {
        for (size_t i = 0U; i < (8U * size[p]); i++) {
            uint8_t *const byte = &place[p][i / 8U];
            *byte = (uint8_t)(*byte ^ (1U << (i % 8U)));
            TEST_ASSERT_EQUAL_HEX32(PEN_SET_DAMAGED, pen_verify(&model, &instance, piece, 1U));
            *byte = (uint8_t)(*byte ^ (1U << (i % 8U)));
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_verify(&model, &instance, piece, 1U));
        }
    }
    for (uint32_t bit = 0U; bit < 32U; bit++) { /* which slot it is */
        tuning->active ^= UINT32_C(1) << bit;
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_DAMAGED, pen_verify(&model, &instance, piece, 1U));
        tuning->active ^= UINT32_C(1) << bit;
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_verify(&model, &instance, piece, 1U));
    }
}

/* Where the guard is, and what it has seen: no bit of that may raise an alarm, nor hide damage for longer than two rounds. */
void test_damage_of_the_guard_itself_raises_no_alarm(void)
{
    uint32_t *const word[] = { &instance.guard.at, &instance.guard.crc, &instance.guard.slot };

    run_copy(5U);
    for (size_t w = 0U; w < 3U; w++) {
        for (uint32_t bit = 0U; bit < 32U; bit++) {
            for (size_t c = 0U; c < CHUNKS; c++) {
                for (uint32_t before = 1U; before < ROUND; before += 6U) {
                    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_verify(&model, &instance, piece, before));
                    *word[w] ^= UINT32_C(1) << bit;
                    expect_whole_for_two_rounds(chunks[c]);
                }
            }
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_verify(&model, &instance, piece, 5U));
            *word[w] ^= UINT32_C(1) << bit;
            bank[0][4] += (pen_real_t)1;
            expect_found_within_two_rounds(7U);
            bank[0][4] -= (pen_real_t)1;
        }
    }
}

/* The checksum of the pieces is part of what is guarded; that of the other slot is not. */
void test_damaged_checksum_of_the_pieces(void)
{
    run_copy(5U);
    for (uint32_t bit = 0U; bit < 32U; bit++) {
        instance.guard.pieces[0] ^= UINT32_C(1) << bit;
        expect_whole_for_two_rounds(7U);
        expect_bit_found((uint8_t *)&instance.guard.pieces[1] + (bit / 8U), bit % 8U);
    }
}

void test_exchange_in_the_middle_of_a_round(void)
{
    for (size_t c = 0U; c < CHUNKS; c++) {
        for (uint32_t at = 0U; at <= ROUND; at++) {
            start(PEN_DAMAGE_REPORT);
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_verify(&model, &instance, piece, at));
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, choose(&other));
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_verify(&model, &instance, piece, at)); /* the old one, as long as it runs */
            TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_verify(&model, &instance, piece, chunks[c]));
            TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step());
            expect_whole_for_two_rounds(chunks[c]);
            first_value[3] += (pen_real_t)1; /* the rollback set: not this one's */
            expect_whole_for_two_rounds(chunks[c]);
            other_value[N - 1U] += (pen_real_t)1;
            expect_found_within_two_rounds(chunks[c]);
        }
    }
}

void test_withdrawal_in_the_middle_of_a_round(void)
{
    for (uint32_t at = 0U; at <= ROUND; at++) {
        start(PEN_DAMAGE_REPORT);
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, choose(&other));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_verify(&model, &instance, piece, at));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tune_withdraw(&model, &instance));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_verify(&model, &instance, piece, 5U));
        TEST_ASSERT_EQUAL_HEX32(PEN_WITHDRAWN, step());
        expect_whole_for_two_rounds(7U);
        first_value[3] += (pen_real_t)1;
        expect_found_within_two_rounds(7U);
    }
}

/* The same set twice over, so that the slot changes there and back within a round. */
void test_two_exchanges_within_a_round(void)
{
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_verify(&model, &instance, piece, 9U));
    run_copy(5U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, choose(&other));
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step()); /* slot 0 again, other values */
    expect_whole_for_two_rounds(7U);
}

/* ---- what follows ---- */

static uint32_t times(pen_status_t flag)
{
    pen_status_report_t report;

    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_instance_status(&model, &instance, &report));
    return pen_status_times(&report, flag);
}

void test_report_only_reports_and_counts(void)
{
    run_copy(5U);
    (void)times(PEN_SET_DAMAGED);
    bank[0][7] += (pen_real_t)1;
    for (uint32_t k = 0U; k < 3U; k++) {
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_DAMAGED, guard(ROUND));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, step());
    }
    TEST_ASSERT_EQUAL_UINT32(5U, running());
    TEST_ASSERT_EQUAL_UINT32(3U, times(PEN_SET_DAMAGED));
    bank[0][7] -= (pen_real_t)1;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, guard(ROUND));
    TEST_ASSERT_EQUAL_UINT32(0U, times(PEN_SET_DAMAGED));
}

void test_hold_holds_until_told_otherwise(void)
{
    start(PEN_DAMAGE_HOLD);
    run_copy(5U);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, guard(ROUND));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, step());
    bank[0][7] += (pen_real_t)1;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_DAMAGED, guard(ROUND));
    TEST_ASSERT_EQUAL_HEX32(PEN_HELD, step());
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, choose(&other));
    TEST_ASSERT_EQUAL_HEX32(PEN_HELD | PEN_ADOPTED, step()); /* a good set does not end it */
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, guard(ROUND));
    TEST_ASSERT_EQUAL_HEX32(PEN_HELD, step());
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tune_hold(&model, &instance, false));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, step());
}

void test_rollback_set_takes_over(void)
{
    start(PEN_DAMAGE_ROLLBACK);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, choose(&other));
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step());
    run_copy(5U);
    bank[0][7] += (pen_real_t)1;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_DAMAGED, guard(ROUND));
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step()); /* the next step runs it */
    TEST_ASSERT_EQUAL_UINT32(2U, running());
    expect_whole_for_two_rounds(7U);
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_NO_PREVIOUS, roll_back()); /* the damaged one is forgotten */
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, step());
}

void test_set_given_to_init_takes_over_from_two_damaged_ones(void)
{
    start(PEN_DAMAGE_ROLLBACK);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, choose(&other));
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step());
    run_copy(5U);
    bank[0][7] += (pen_real_t)1;
    other_value[3] += (pen_real_t)1;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_DAMAGED, guard(ROUND));
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step());
    TEST_ASSERT_EQUAL_UINT32(1U, running());
    expect_whole_for_two_rounds(7U);
}

void test_step_holds_when_nothing_whole_is_left(void)
{
    start(PEN_DAMAGE_ROLLBACK);
    run_copy(5U); /* 1 is the rollback set and the one given to init */
    bank[0][7] += (pen_real_t)1;
    first_value[7] += (pen_real_t)1;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_DAMAGED, guard(ROUND));
    TEST_ASSERT_EQUAL_HEX32(PEN_HELD, step());
    TEST_ASSERT_EQUAL_UINT32(5U, running());
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, choose(&other));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tune_hold(&model, &instance, false));
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step());
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, guard(ROUND));
}

/* Only pieces are hit: the set is whole, folded anew it takes over from itself. */
void test_damaged_pieces_of_the_first_set_are_folded_anew(void)
{
    start(PEN_DAMAGE_ROLLBACK);
    piece[2].slope += (pen_real_t)1;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_DAMAGED, guard(ROUND));
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step());
    TEST_ASSERT_EQUAL_UINT32(1U, running());
    expect_whole_for_two_rounds(7U);
}

/* A head or address of the running set is hit: nothing may be read by it, and the rollback set is another's. */
void test_rollback_from_a_damaged_address(void)
{
    start(PEN_DAMAGE_ROLLBACK);
    run_copy(5U);
    instance.tuning.slot[1].value = NULL;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_DAMAGED, guard(1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step());
    TEST_ASSERT_EQUAL_UINT32(1U, running());
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, guard(ROUND));
}

/* With a set open or pending only the flag: the tuning context is in the middle of something. */
void test_only_reports_while_a_set_is_open_or_pending(void)
{
    static const uint32_t reaction[2] = { PEN_DAMAGE_HOLD, PEN_DAMAGE_ROLLBACK };

    for (size_t r = 0U; r < 2U; r++) {
        start(reaction[r]);
        run_copy(5U);
        bank[0][7] += (pen_real_t)1;
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tune_begin(&model, &instance, &other.head));
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_DAMAGED, guard(ROUND));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, step());
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tune_write(&model, &instance, 0U, other_value, N)); /* it is still open */
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, commit());
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_DAMAGED, guard(ROUND)); /* and now pending */
        TEST_ASSERT_EQUAL_HEX32(PEN_ADOPTED, step());
        TEST_ASSERT_EQUAL_UINT32(2U, running());
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, guard(ROUND));
        TEST_ASSERT_EQUAL_HEX32(PEN_OK, step());
    }
}

/* ---- the tuning half ---- */

void test_not_initialised_is_refused_by_every_call(void)
{
    pen_model_t strange = model;
    pen_set_head_t head;
    pen_set_t ready;
    pen_status_report_t report;
    const uint8_t byte[1] = { 0U };
    bool pending = false;
    uint32_t before;

    strange.layout ^= 1U;
    TEST_ASSERT_TRUE(pen_usable(&model, &instance));
    for (uint32_t k = 0U; k < 2U; k++) {
        const pen_model_t *const of = (k == 0U) ? &model : &strange; /* no instance; an instance of another model */
        pen_instance_t *const self = (k == 0U) ? NULL : &instance;
        TEST_ASSERT_FALSE(pen_usable(of, self));
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tune_begin(of, self, &other.head));
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tune_begin_copy(of, self, 1U));
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tune_write(of, self, 0U, other_value, 1U));
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tune_write_bytes(of, self, 0U, byte, 1U));
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tune_expect(of, self, 1U));
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tune_commit(of, self, &ready));
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tune_select(of, self, &other, &ready));
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tune_rollback(of, self, &ready));
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tune_publish(of, self, piece, &other, PEN_SET_BADARG));
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tune_abort(of, self));
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tune_withdraw(of, self));
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tune_hold(of, self, true));
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tune_pending(of, self, &pending));
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tune_running(of, self, &head));
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_verify(of, self, piece, 1U));
        TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, pen_instance_status(of, self, &report));
    }
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tune_pending(&model, &instance, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tune_running(&model, &instance, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, pen_instance_status(&model, &instance, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, step());
    before = times(PEN_SET_BADARG);
    TEST_ASSERT_EQUAL_UINT32(0U, before); /* none of these had an instance to count in */
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BADARG, pen_tune_begin(&model, &instance, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, pen_tune_write(&model, &instance, 0U, NULL, 1U));
    TEST_ASSERT_EQUAL_UINT32(1U, times(PEN_SET_BADARG));
}

void test_refused_init_leaves_an_instance_that_is_not_initialised(void)
{
    first.head.checksum ^= 1U;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CHECKSUM, pen_init(&model, &instance, &first, bank[0], bank[1]));
    TEST_ASSERT_FALSE(pen_usable(&model, &instance));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, pen_init(&model, NULL, &first, bank[0], bank[1]));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_PIECES, pen_ready(&model, &instance, piece, PEN_SET_PIECES));
    TEST_ASSERT_FALSE(pen_usable(&model, &instance));
}

void test_each_call_counts_what_it_found(void)
{
    bool pending = true;

    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, pen_tune_abort(&model, &instance));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, pen_tune_expect(&model, &instance, 0U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_CLOSED, commit());
    TEST_ASSERT_EQUAL_UINT32(3U, times(PEN_SET_CLOSED));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_IDLE, pen_tune_withdraw(&model, &instance));
    TEST_ASSERT_EQUAL_UINT32(1U, times(PEN_SET_IDLE));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_NO_PREVIOUS, roll_back());
    TEST_ASSERT_EQUAL_UINT32(1U, times(PEN_SET_NO_PREVIOUS));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tune_pending(&model, &instance, &pending));
    TEST_ASSERT_FALSE(pending);
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, choose(&other));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, pen_tune_pending(&model, &instance, &pending));
    TEST_ASSERT_TRUE(pending);
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BUSY, pen_tune_begin_copy(&model, &instance, 1U));
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_BUSY, choose(&other));
    TEST_ASSERT_EQUAL_UINT32(2U, times(PEN_SET_BUSY)); /* asking whether one is pending is no error */
}

/* zlib.crc32(struct.pack("<3fI", 1, -2.5, 0.15625, 0x10)), and with 3d */
void test_checksum_of_a_piece(void)
{
    const pen_piece_t at = { (pen_real_t)1, (pen_real_t)-2.5F, (pen_real_t)0.15625F, PEN_OUTSIDE };

    TEST_ASSERT_EQUAL_HEX32((sizeof(pen_real_t) == 4U) ? 0xf1ffc87bU : 0x49d86ab4U, ~pen_piece_crc(PEN_CRC_START, &at));
}

/* A network with more pieces than there is room for: refused, or layer by layer. */
void test_more_pieces_than_room(void)
{
    model.pieces = 4U; /* the tent has four and two outside */
    model.networks = 1U;
    TEST_ASSERT_EQUAL_HEX32(PEN_SET_PIECES, prepare(first_value, piece));
    model.layers = true;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, prepare(first_value, piece));
    for (size_t i = 0U; i < 4U; i++) {
        TEST_ASSERT_EQUAL_HEX32(PEN_SET_PIECES, piece[i].status);
        TEST_ASSERT_TRUE((piece[i].start == (pen_real_t)0) && (piece[i].offset == (pen_real_t)0) && (piece[i].slope == (pen_real_t)0));
    }
}
