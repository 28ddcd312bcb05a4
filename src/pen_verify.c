/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "penode/pen_exact.h"

#include "penode/pen_instance.h"
#include "penode/pen_port.h"
#include "penode/pen_serial.h"

/* Head and address of the running set, addresses of the banks, and which slot it is, as they were last known. */
static bool known(const pen_model_t *model, const pen_tuning_t *tuning, uint32_t slot)
{
    const pen_set_t *const set = &tuning->slot[slot];
    const bool fits = (set->head.layout == model->layout) && (set->head.length == model->length);
    const bool same = pen_set_same(set, &tuning->slot_check[slot]);

    return pen_tuning_banks_known(tuning) && fits && same &&
           ((tuning->published != 0U) || (tuning->settled == pen_port_load(&tuning->active)));
}

uint32_t pen_piece_crc(uint32_t crc, const pen_piece_t *piece)
{
    uint32_t next = pen_crc_values(crc, 1U, &piece->start);

    next = pen_crc_values(next, 1U, &piece->offset);
    next = pen_crc_values(next, 1U, &piece->slope);
    return pen_crc_word(next, piece->status);
}

uint32_t pen_pieces_crc(const pen_model_t *model, const pen_piece_t piece[])
{
    uint32_t crc = PEN_CRC_START;

    for (uint32_t i = 0U; i < (model->networks * model->pieces); i++) {
        crc = pen_piece_crc(crc, &piece[i]);
    }
    return crc;
}

/* One stretch of the round, values or pieces, up to *n of them. False if its checksum is wrong. */
static bool look(const pen_model_t *model, const pen_set_t *set, const pen_piece_t piece[], pen_guard_t *guard, uint32_t *n)
{
    const uint32_t length = model->length;
    const uint32_t end = length + (model->networks * model->pieces);
    bool good = true;

    if (guard->at < length) {
        while ((*n > 0U) && (guard->at < length)) {
            guard->crc = pen_crc_values(guard->crc, 1U, &set->value[guard->at]);
            guard->at += 1U;
            *n -= 1U;
        }
        if (guard->at == length) {
            good = (~guard->crc == set->head.checksum);
            guard->crc = PEN_CRC_START;
        }
    } else {
        while ((*n > 0U) && (guard->at < end)) {
            guard->crc = pen_piece_crc(guard->crc, &piece[guard->at - length]);
            guard->at += 1U;
            *n -= 1U;
        }
        if (guard->at >= end) {
            good = (guard->crc == guard->pieces[guard->slot]);
            guard->crc = PEN_CRC_START;
            guard->at = 0U;
        }
    }
    return good;
}

/* Up to n values: are they as their checksums say? */
static bool whole(const pen_model_t *model, const pen_set_t *set, const pen_piece_t piece[], pen_guard_t *guard, uint32_t n)
{
    uint32_t left = n;
    bool good = true;

    while (good && (left > 0U)) {
        good = look(model, set, piece, guard, &left);
    }
    return good;
}

pen_status_t pen_verify(const pen_model_t *model, pen_instance_t *self, const pen_piece_t piece[], uint32_t n)
{
    pen_status_t status = PEN_SET_BADARG;

    if (pen_usable(model, self)) {
        const uint32_t round = model->length + (model->networks * model->pieces);
        pen_tuning_t *const tuning = &self->tuning;
        const bool idle = pen_tuning_settle(tuning) && (tuning->open == 0U);
        const uint32_t slot = pen_tuning_inactive(tuning) ^ 1U;
        const pen_piece_t *const own = (piece == NULL) ? NULL : &piece[slot * (model->networks * model->pieces)];
        bool good = known(model, tuning, slot);

        if ((self->guard.slot != slot) || (self->guard.at == 0U)) {
            self->guard.slot = slot;
            self->guard.at = 0U;
            self->guard.crc = PEN_CRC_START;
        }
        if (good && !whole(model, &tuning->slot[slot], own, &self->guard, (n < round) ? n : round)) {
            /* all of it once more, from the start: the fault may be with the guard itself */
            self->guard.at = 0U;
            self->guard.crc = PEN_CRC_START;
            good = whole(model, &tuning->slot[slot], own, &self->guard, round);
            self->guard.at = 0U;
        }
        status = good ? PEN_OK : PEN_SET_DAMAGED;
        if (!good && idle && (model->on_damage == PEN_DAMAGE_HOLD)) {
            pen_tuning_hold(tuning, true);
        }
        pen_status_note_tune(&self->log, status);
    }
    return status;
}

pen_status_t pen_fallback(const pen_model_t *model, pen_instance_t *self, uint32_t rank, pen_set_t *ready)
{
    pen_tuning_t *const tuning = &self->tuning;
    pen_status_t status = PEN_SET_BUSY;

    if (tuning->open == 0U) {
        status = (rank == 0U) ? pen_tuning_rollback(tuning, model->layout, model->length, ready)
                              : pen_tuning_select(tuning, model->layout, model->length, &tuning->initial, ready);
    }
    return status;
}

/* Banks that cannot be told from other memory are given up: else the guard would find them damaged again, without end. */
static void give_up_banks(pen_tuning_t *tuning)
{
    const bool good = pen_tuning_banks_known(tuning);

    for (uint32_t i = 0U; i < 2U; i++) {
        tuning->bank[i] = good ? tuning->bank[i] : NULL;
        tuning->bank_check[i] = tuning->bank[i];
    }
}

void pen_recover(const pen_model_t *model, pen_instance_t *self, const pen_piece_t piece[], const pen_set_t *ready, pen_status_t found)
{
    if (found == PEN_OK) {
        (void)pen_tune_publish(model, self, piece, ready, PEN_OK);
        self->tuning.previous.value = NULL;
        give_up_banks(&self->tuning);
    } else if (found != PEN_SET_BUSY) {
        pen_tuning_hold(&self->tuning, true);
    } else {
        /* only reported */
    }
}
