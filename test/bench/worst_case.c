/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * worst_case RECORD ROUNDS POINTS: steps of a model under everything that a constant-time step must not notice, counted
 * from outside. First each state in turn is at each point of a file, such as the ends of the networks' pieces. Then
 * rounds: another set is staged and adopted, 100 steps of which some hold; from the middle on the set in force is
 * damaged, as if its memory were. Inputs and states are any bits, special numbers, all sizes, or all over the networks'
 * range.
 *
 * record  the status of each step, one word
 */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "board.h"

#include MODEL_HEADER

#define ROUND   100U /* steps */
#define HOLD    30U  /* here it begins to hold, */
#define GO_ON   35U  /* here it goes on         */
#define DAMAGED 50U  /* here the set is damaged */
#define ROUNDS  200U  /* at most */
#define POINTS  2048U /* at most */

#define N_X    MODEL_SIZE(N_X)
#define COPIES 2U /* of the state in an instance */

enum { ANY_BITS, SPECIAL, ALL_SIZES, USUAL, KINDS };

static const pen_set_t *const sets[] = { MODEL_SETS };
static MODEL(t) model;
static MODEL(banks_t) banks;
static pen_real_t staged[MODEL_SIZE(SET_LENGTH)];
static pen_real_t point[POINTS];
static uint32_t record[(ROUNDS * ROUND) + (POINTS * N_X)];
static uint32_t recorded;
static size_t copy[COPIES]; /* places, in reals, of the state in the instance */
static size_t copies;
static uint32_t seed = 1U;

static uint32_t draw(void)
{
    seed ^= seed << 13U;
    seed ^= seed >> 17U;
    seed ^= seed << 5U;
    return seed;
}

static pen_real_t bits(uint32_t low, uint32_t high)
{
    pen_real_t value;
    uint32_t *const word = (uint32_t *)(void *)&value;

    word[0] = low;
#ifdef PEN_REAL_DOUBLE
    word[1] = high;
#else
    (void)high;
#endif
    return value;
}

static pen_real_t number(uint32_t kind, pen_real_t range)
{
    const pen_real_t zero = (pen_real_t)0;
    const pen_real_t part = ((pen_real_t)(int32_t)draw() / (pen_real_t)2147483648.0) * range;
    const uint32_t any = draw();
    pen_real_t value = part;

    if (kind == ANY_BITS) {
        value = bits(draw(), draw());
    } else if (kind == SPECIAL) {
        const pen_real_t inf = (pen_real_t)1 / zero;
        const pen_real_t tiny = bits(1U, 0U);
        const pen_real_t subnormal = bits(0x007FFFFFU, 0x000FFFFFU);
        const pen_real_t huge = bits(0x7F7FFFFFU, 0x7FEFFFFFU);
        const pen_real_t special[] = { zero, -zero, inf, -inf, inf - inf, -(inf - inf), tiny, -tiny, subnormal, -subnormal, huge, -huge };
        value = special[any % (sizeof(special) / sizeof(special[0]))];
    } else if (kind == ALL_SIZES) {
        for (uint32_t k = 0U; k < (any % 160U); k++) {
            value *= (pen_real_t)0.5;
        }
    } else {
        /* anywhere in the range */
    }
    return value;
}

/* Stage a set: those of the model, then their values changed by up to four times themselves. It need not fold. */
static bool stage(uint32_t round)
{
    const pen_set_t *const set = sets[round % (sizeof(sets) / sizeof(sets[0]))];
    pen_set_head_t head = { MODEL_SIZE(LAYOUT), MODEL_SIZE(SET_LENGTH), round, 0U };
    pen_status_t status;

    for (size_t i = 0U; i < MODEL_SIZE(SET_LENGTH); i++) {
        const pen_real_t change = number(USUAL, (pen_real_t)(round % 8U) / (pen_real_t)2);
        staged[i] = set->value[i] + (set->value[i] * ((round < 2U) ? (pen_real_t)0 : change));
    }
    head.checksum = pen_set_checksum(staged, MODEL_SIZE(SET_LENGTH));
    status = MODEL(tune_begin)(&model, &head);
    status |= MODEL(tune_write)(&model, 0U, staged, head.length);
    status |= MODEL(tune_commit)(&model);
    if (status == PEN_SET_PIECES) {
        status = MODEL(tune_abort)(&model);
    }
    return status == PEN_OK;
}

static void damage(uint32_t kind)
{
    for (size_t i = 0U; i < MODEL_SIZE(SET_LENGTH); i++) {
        const pen_real_t value = number(kind, (pen_real_t)10);
        banks.value[0][i] = value;
        banks.value[1][i] = value;
    }
#ifdef MODEL_FOLDED
    pen_piece_t *const piece = &model.piece[0][0];
    for (size_t i = 0U; i < (sizeof(model.piece) / sizeof(*piece)); i++) {
        piece[i].start = number(kind, (pen_real_t)10);
        piece[i].offset = number(kind, (pen_real_t)10);
        piece[i].slope = number(kind, (pen_real_t)10);
    }
#endif
}

/* Where an instance keeps its state, both copies, found by setting it. */
static void find_state(void)
{
    const pen_real_t *const word = (const pen_real_t *)(const void *)&model;
    MODEL(x_t) x;
    pen_real_t *const value = (pen_real_t *)&x;

    for (size_t i = 0U; i < N_X; i++) {
        value[i] = (pen_real_t)i + (pen_real_t)0.625;
    }
    (void)MODEL(set_state)(&model, &x);
    for (size_t at = 0U; ((at + N_X) <= (sizeof(model) / sizeof(pen_real_t))) && (copies < COPIES); at++) {
        size_t same = 0U;
        while ((same < N_X) && (word[at + same] == value[same])) {
            same++;
        }
        if (same == N_X) {
            copy[copies] = at;
            copies++;
        }
    }
}

/* Put one state into both copies, or into one as damage would. */
static void put_state(size_t i, pen_real_t value, bool both)
{
    pen_real_t *const word = (pen_real_t *)(void *)&model;

    for (size_t k = 0U; k < (both ? copies : 1U); k++) {
        word[copy[both ? k : (draw() % copies)] + i] = value;
    }
}

static void step(const pen_real_t input[])
{
    static MODEL(y_t) y;

    record[recorded] = MODEL(step)(&model, (const MODEL(u_t) *)input, &y);
    recorded++;
}

static void play_points(uint32_t points)
{
    for (uint32_t k = 0U; k < (points * N_X); k++) {
        pen_real_t input[MODEL_SIZE(N_U)] = { 0 };
        for (size_t i = 0U; i < N_X; i++) {
            put_state(i, ((k / points) == i) ? point[k % points] : (pen_real_t)0, true);
        }
        step(input);
    }
}

static void play_round(uint32_t round)
{
    for (uint32_t k = 0U; k < ROUND; k++) {
        const uint32_t kind = draw() % KINDS;
        pen_real_t input[MODEL_SIZE(N_U)];

        if ((k == HOLD) || (k == GO_ON)) {
            (void)MODEL(tune_hold)(&model, k == HOLD);
        } else if (k == DAMAGED) {
            damage(round % KINDS);
        } else {
            /* nothing but the step */
        }
        for (size_t i = 0U; i < MODEL_SIZE(N_U); i++) {
            input[i] = number(((k % 2U) == 0U) ? (uint32_t)USUAL : kind, (pen_real_t)0.3);
        }
        for (size_t i = 0U; ((k % 5U) != 0U) && (i < N_X); i++) {
            const pen_real_t range = (i < (N_X / 2U)) ? (pen_real_t)0.1 : (pen_real_t)2;
            put_state(i, number(((k % 3U) == 0U) ? kind : (uint32_t)USUAL, range), (k % 7U) != 0U);
        }
        step(input);
    }
}

static uint32_t argument(void)
{
    char text[11];
    uint32_t value = 0U;

    if (board_argument(2U, text, sizeof(text))) {
        for (size_t k = 0U; text[k] != '\0'; k++) {
            value = (10U * value) + (uint32_t)(text[k] - '0');
        }
    }
    return value;
}

int main(void)
{
    char name[128];
    const int32_t to = board_argument(1U, name, sizeof(name)) ? board_open(name, true) : -1;
    const int32_t from = board_argument(3U, name, sizeof(name)) ? board_open(name, false) : -1;
    const uint32_t points = ((from >= 0) ? board_read(from, point, sizeof(point)) : 0U) / sizeof(pen_real_t);
    const uint32_t rounds = argument();
    bool good = (to >= 0) && (rounds <= ROUNDS) && (MODEL(init)(&model, sets[0], &banks) == PEN_OK);

    if (good) {
        find_state();
        good = (copies == COPIES);
    }
    if (good) {
        play_points(points);
    }
    for (uint32_t round = 0U; good && (round < rounds); round++) {
        good = stage(round);
        if (good) {
            play_round(round);
        }
    }
    good = good && (board_write(to, record, recorded * sizeof(uint32_t)) == (recorded * sizeof(uint32_t)));
    board_close(to);
    return good ? 0 : 1;
}
