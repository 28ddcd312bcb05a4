/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "penode/pen_exact.h"

#include "penode/pen_saved.h"

#include "penode/pen_serial.h"

#define MAGIC      0x494e4550U /* "PENI" */
#define FORM       (1U | ((uint32_t)sizeof(pen_real_t) << 16U))
#define SETS       5U
#define WORDS      9U
#define INITIAL_AT (4U * (4U + WORDS + 3U)) /* byte of the checksum of the set given to init */
#define NOWHERE    UINT32_MAX

/* Where a set's values are. */
#define NONE    0U
#define BANK    1U /* or 2 */
#define INITIAL 3U
#define KNOWN   4U /* and on */

static size_t size_of(const pen_model_t *model, uint32_t rows, uint32_t inputs)
{
    const size_t n = (size_t)rows + inputs + (2U * (size_t)model->length);

    return PEN_SAVED_HEAD + (n * sizeof(pen_real_t));
}

static void put(uint32_t word, uint8_t byte[], size_t *at)
{
    pen_serial_put(word, &byte[*at]);
    *at += 4U;
}

static uint32_t get(const uint8_t byte[], size_t *at)
{
    const uint32_t word = pen_serial_get(&byte[*at]);

    *at += 4U;
    return word;
}

static void put_values(uint32_t n, const pen_real_t value[], uint8_t byte[], size_t *at)
{
    pen_serial_put_bytes(value, 0U, (size_t)n * sizeof(pen_real_t), &byte[*at]);
    *at += (size_t)n * sizeof(pen_real_t);
}

static void get_values(uint32_t n, pen_real_t value[], const uint8_t byte[], size_t *at)
{
    pen_serial_get_bytes(value, 0U, (size_t)n * sizeof(pen_real_t), &byte[*at]);
    *at += (size_t)n * sizeof(pen_real_t);
}

static uint32_t place_of(const pen_model_t *model, const pen_tuning_t *tuning, const pen_real_t *value)
{
    uint32_t place = NOWHERE;

    for (uint32_t i = 0U; i < model->sets; i++) {
        place = (value == model->set[i]->value) ? (KNOWN + i) : place;
    }
    place = (value == tuning->initial.value) ? INITIAL : place;
    place = (value == tuning->bank[0]) ? BANK : place;
    place = (value == tuning->bank[1]) ? (BANK + 1U) : place;
    return (value == NULL) ? NONE : place;
}

/* NULL if there is no such set here, or another in its place. */
static const pen_real_t *value_at(const pen_model_t *model, const pen_tuning_t *tuning, uint32_t place, uint32_t checksum)
{
    const pen_real_t *value = NULL;

    if (place == INITIAL) {
        value = tuning->initial.value;
    } else if ((place == BANK) || (place == (BANK + 1U))) {
        value = tuning->bank[place - BANK];
    } else if ((place >= KNOWN) && ((place - KNOWN) < model->sets)) {
        const pen_set_t *const set = model->set[place - KNOWN];
        value = (set->head.checksum == checksum) ? set->value : NULL;
    } else {
        /* none */
    }
    return value;
}

static bool put_set(const pen_model_t *model, const pen_tuning_t *tuning, const pen_set_t *set, uint8_t byte[], size_t *at)
{
    const uint32_t place = place_of(model, tuning, set->value);

    put(set->head.layout, byte, at);
    put(set->head.length, byte, at);
    put(set->head.id, byte, at);
    put(set->head.checksum, byte, at);
    put(place, byte, at);
    return place != NOWHERE;
}

static void get_set(const pen_model_t *model, const pen_tuning_t *tuning, pen_set_t *set, const uint8_t byte[], size_t *at)
{
    set->head.layout = get(byte, at);
    set->head.length = get(byte, at);
    set->head.id = get(byte, at);
    set->head.checksum = get(byte, at);
    set->value = value_at(model, tuning, get(byte, at), set->head.checksum);
}

/* The set of a slot; of one that is not read and not asked about any more, that of the other. */
static const pen_set_t *slot_set(const pen_tuning_t *tuning, uint32_t slot)
{
    const bool idle = (tuning->pending == 0U) && (tuning->open == 0U);

    return (idle && (slot == pen_tuning_inactive(tuning))) ? &tuning->slot[slot ^ 1U] : &tuning->slot[slot];
}

pen_status_t pen_save(const pen_model_t *model, const pen_instance_t *self, uint32_t rows, const pen_real_t row[], uint32_t inputs,
                      const pen_real_t u[], uint8_t byte[], size_t size)
{
    pen_status_t status = PEN_SET_BADARG;

    if (pen_usable(model, self) && (byte != NULL) && (size >= size_of(model, rows, inputs))) {
        const pen_tuning_t *const tuning = &self->tuning;
        const pen_set_t *const set[SETS] = { &tuning->initial, slot_set(tuning, 0U), slot_set(tuning, 1U), &tuning->previous,
                                             pen_tuning_fallback(tuning) };
        const uint32_t word[WORDS] = { self->running,     self->scrub,     tuning->active, tuning->pending, tuning->hold,
                                       tuning->published, tuning->settled, tuning->open,   tuning->fill };
        const bool banks = (tuning->bank[0] != NULL);
        bool found = true;
        size_t at = 0U;

        put(MAGIC, byte, &at);
        put(FORM, byte, &at);
        put(model->source, byte, &at);
        put(banks ? 1U : 0U, byte, &at);
        for (uint32_t i = 0U; i < WORDS; i++) {
            put(word[i], byte, &at);
        }
        for (uint32_t i = 0U; i < SETS; i++) {
            found = put_set(model, tuning, set[i], byte, &at) && found;
        }
        for (uint32_t i = 0U; i < PEN_STATUS_FLAGS; i++) {
            put(self->log.count[i], byte, &at);
            put(self->log.seen[i], byte, &at);
        }
        put_values(rows, row, byte, &at);
        put_values(inputs, u, byte, &at);
        for (uint32_t i = 0U; i < 2U; i++) {
            put_values(model->length, (tuning->bank[i] != NULL) ? tuning->bank[i] : tuning->initial.value, byte, &at);
        }
        put(~pen_crc_bytes(PEN_CRC_START, at, byte), byte, &at);
        status = found ? PEN_OK : PEN_SET_BADARG;
    }
    return status;
}

/* A set that could be run: is it of this model, and to be found here? Its values are somewhere in any case. */
static bool get_known(const pen_model_t *model, const pen_tuning_t *tuning, bool none_allowed, pen_set_t *set, const uint8_t byte[],
                      size_t *at)
{
    const bool none = none_allowed && (pen_serial_get(&byte[*at + 16U]) == NONE);
    const pen_real_t *found;

    get_set(model, tuning, set, byte, at);
    found = set->value;
    set->value = (found != NULL) ? found : tuning->initial.value;
    return none || ((found != NULL) && (set->head.layout == model->layout) && (set->head.length == model->length));
}

/* The sets of both slots, and the two to roll back to, if any. */
static bool sets_fit(const pen_model_t *model, const pen_tuning_t *tuning, pen_set_t slot[2], const uint8_t byte[])
{
    size_t at = 4U * (4U + WORDS + 5U);
    const bool first = get_known(model, tuning, false, &slot[0], byte, &at);
    const bool second = get_known(model, tuning, false, &slot[1], byte, &at);
    pen_set_t other;
    const bool previous = get_known(model, tuning, true, &other, byte, &at);
    const bool replaced = get_known(model, tuning, true, &other, byte, &at);

    return first && second && previous && replaced;
}

/* May these bytes be restored into this instance? If so, slot[] holds the sets of its slots. */
static pen_status_t check(const pen_model_t *model, const pen_tuning_t *tuning, pen_set_t slot[2], const uint8_t byte[], size_t size)
{
    const uint32_t banks = (tuning->bank[0] != NULL) ? 1U : 0U;
    const uint32_t initial = place_of(model, tuning, tuning->initial.value); /* if in a bank, restoring it must not change it */
    pen_status_t status = PEN_OK;

    if (pen_serial_get(&byte[size - 4U]) != ~pen_crc_bytes(PEN_CRC_START, size - 4U, byte)) {
        status = PEN_SET_CHECKSUM;
    } else if ((pen_serial_get(&byte[0]) != MAGIC) || (pen_serial_get(&byte[4]) != FORM) || (pen_serial_get(&byte[8]) != model->source) ||
               (pen_serial_get(&byte[12]) != banks) || (pen_serial_get(&byte[INITIAL_AT]) != tuning->initial.head.checksum) ||
               (pen_serial_get(&byte[INITIAL_AT + 4U]) != initial) || !sets_fit(model, tuning, slot, byte)) {
        status = PEN_SET_LAYOUT;
    } else {
        /* good */
    }
    return status;
}

static void get_tuning(const pen_model_t *model, pen_instance_t *self, const pen_set_t slot[2], const uint8_t byte[], size_t *at)
{
    pen_tuning_t *const tuning = &self->tuning;

    self->running = get(byte, at);
    self->scrub = get(byte, at);
    tuning->active = get(byte, at);
    tuning->pending = get(byte, at);
    tuning->hold = get(byte, at);
    tuning->published = get(byte, at);
    tuning->settled = get(byte, at);
    tuning->open = get(byte, at);
    tuning->fill = get(byte, at);
    *at += 60U; /* the set given to init is the instance's own; those of the slots were read by check() */
    for (uint32_t i = 0U; i < 2U; i++) {
        pen_set_copy(&tuning->slot[i], &slot[i]);
        pen_set_copy(&tuning->slot_check[i], &slot[i]);
    }
    get_set(model, tuning, &tuning->previous, byte, at);
    get_set(model, tuning, &tuning->replaced, byte, at);
    for (uint32_t i = 0U; i < PEN_STATUS_FLAGS; i++) {
        self->log.count[i] = get(byte, at);
        self->log.seen[i] = get(byte, at);
    }
}

pen_status_t pen_restore(const pen_model_t *model, pen_instance_t *self, uint32_t rows, pen_real_t row[], uint32_t inputs, pen_real_t u[],
                         const uint8_t byte[], size_t size)
{
    pen_set_t slot[2];
    pen_status_t status = PEN_SET_BADARG;

    if (pen_usable(model, self) && (byte != NULL) && (size == size_of(model, rows, inputs))) {
        status = check(model, &self->tuning, slot, byte, size);
    }
    if (status == PEN_OK) {
        size_t at = 16U;
        get_tuning(model, self, slot, byte, &at);
        get_values(rows, row, byte, &at);
        get_values(inputs, u, byte, &at);
        for (uint32_t i = 0U; (i < 2U) && (self->tuning.bank[i] != NULL); i++) {
            get_values(model->length, self->tuning.bank[i], byte, &at);
        }
        self->guard.at = 0U;
    }
    return status;
}

void pen_restored(const pen_model_t *model, pen_instance_t *self, const pen_piece_t piece[])
{
    const uint32_t n = model->networks * model->pieces;

    for (uint32_t i = 0U; i < 2U; i++) {
        self->guard.pieces[i] = pen_pieces_crc(model, (piece == NULL) ? NULL : &piece[i * n]);
    }
}
