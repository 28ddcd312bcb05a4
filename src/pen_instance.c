/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "penode/pen_exact.h"

#include "penode/pen_instance.h"

#include <stddef.h>

#include "penode/pen_port.h"
#include "penode/pen_serial.h"

bool pen_usable(const pen_model_t *model, const pen_instance_t *self)
{
    return (self != NULL) && (self->ready == model->layout);
}

pen_status_t pen_init(const pen_model_t *model, pen_instance_t *self, const pen_set_t *set, pen_real_t bank0[], pen_real_t bank1[])
{
    pen_status_t status = PEN_BADARG;

    if (self != NULL) {
        self->ready = 0U;
        status = pen_tuning_init(&self->tuning, model->layout, model->length, set, bank0, bank1);
    }
    return status;
}

pen_status_t pen_ready(const pen_model_t *model, pen_instance_t *self, const pen_piece_t piece[], pen_status_t found)
{
    if (found == PEN_OK) {
        self->scrub = 0U;
        self->running = 0U;
        self->guard.at = 0U;
        self->guard.crc = PEN_CRC_START;
        self->guard.slot = 0U;
        self->guard.pieces[0] = pen_pieces_crc(model, piece);
        self->guard.pieces[1] = self->guard.pieces[0];
        self->breach.network = 0U;
        self->breach.kind = 0U;
        self->breach.at = (pen_real_t)0;
        pen_status_clear(&self->log);
        self->ready = model->layout;
    }
    return found;
}

/* Count what a tuning call found. */
static pen_status_t noted(pen_instance_t *self, pen_status_t status)
{
    pen_status_note_tune(&self->log, status);
    return status;
}

pen_status_t pen_tune_begin(const pen_model_t *model, pen_instance_t *self, const pen_set_head_t *head)
{
    return pen_usable(model, self) ? noted(self, pen_tuning_begin(&self->tuning, model->layout, model->length, head)) : PEN_SET_BADARG;
}

pen_status_t pen_tune_begin_copy(const pen_model_t *model, pen_instance_t *self, uint32_t id)
{
    return pen_usable(model, self) ? noted(self, pen_tuning_begin_copy(&self->tuning, model->layout, model->length, id)) : PEN_SET_BADARG;
}

pen_status_t pen_tune_write(const pen_model_t *model, pen_instance_t *self, uint32_t offset, const pen_real_t value[], uint32_t n)
{
    return pen_usable(model, self) ? noted(self, pen_tuning_write(&self->tuning, model->length, offset, value, n)) : PEN_SET_BADARG;
}

pen_status_t pen_tune_write_bytes(const pen_model_t *model, pen_instance_t *self, uint32_t offset, const uint8_t byte[], uint32_t n)
{
    return pen_usable(model, self) ? noted(self, pen_tuning_write_bytes(&self->tuning, model->length, offset, byte, n)) : PEN_SET_BADARG;
}

pen_status_t pen_tune_abort(const pen_model_t *model, pen_instance_t *self)
{
    return pen_usable(model, self) ? noted(self, pen_tuning_abort(&self->tuning)) : PEN_SET_BADARG;
}

pen_status_t pen_tune_withdraw(const pen_model_t *model, pen_instance_t *self)
{
    return pen_usable(model, self) ? noted(self, pen_tuning_withdraw(&self->tuning)) : PEN_SET_BADARG;
}

pen_status_t pen_tune_expect(const pen_model_t *model, pen_instance_t *self, uint32_t checksum)
{
    return pen_usable(model, self) ? noted(self, pen_tuning_expect(&self->tuning, checksum)) : PEN_SET_BADARG;
}

pen_status_t pen_tune_hold(const pen_model_t *model, pen_instance_t *self, bool hold)
{
    const bool good = pen_usable(model, self);

    if (good) {
        pen_tuning_hold(&self->tuning, hold);
    }
    return good ? PEN_OK : PEN_SET_BADARG;
}

pen_status_t pen_tune_pending(const pen_model_t *model, const pen_instance_t *self, bool *pending)
{
    const bool good = pen_usable(model, self) && (pending != NULL);

    if (good) {
        *pending = pen_tuning_pending(&self->tuning);
    }
    return good ? PEN_OK : PEN_SET_BADARG;
}

pen_status_t pen_tune_running(const pen_model_t *model, const pen_instance_t *self, pen_set_head_t *head)
{
    const bool good = pen_usable(model, self) && (head != NULL);

    if (good) {
        pen_tuning_running(&self->tuning, head);
    }
    return good ? PEN_OK : PEN_SET_BADARG;
}

pen_status_t pen_tune_commit(const pen_model_t *model, pen_instance_t *self, pen_set_t *ready)
{
    return pen_usable(model, self) ? pen_tuning_commit(&self->tuning, model->layout, model->length, ready) : PEN_SET_BADARG;
}

pen_status_t pen_tune_select(const pen_model_t *model, pen_instance_t *self, const pen_set_t *set, pen_set_t *ready)
{
    return pen_usable(model, self) ? pen_tuning_select(&self->tuning, model->layout, model->length, set, ready) : PEN_SET_BADARG;
}

pen_status_t pen_tune_rollback(const pen_model_t *model, pen_instance_t *self, pen_set_t *ready)
{
    return pen_usable(model, self) ? pen_tuning_rollback(&self->tuning, model->layout, model->length, ready) : PEN_SET_BADARG;
}

pen_status_t pen_tune_publish(const pen_model_t *model, pen_instance_t *self, const pen_piece_t piece[], const pen_set_t *ready,
                              pen_status_t found)
{
    if (pen_usable(model, self)) {
        if (found == PEN_OK) {
            self->guard.pieces[pen_tuning_inactive(&self->tuning)] = pen_pieces_crc(model, piece);
            self->guard.at = 0U;
            pen_tuning_publish(&self->tuning, ready);
        }
        pen_status_note_tune(&self->log, found);
    }
    return found;
}

/* No pieces, then: numbers all the same, for the scrub. */
static void layer_by_layer(uint32_t n, pen_piece_t piece[])
{
    for (uint32_t k = 0U; k < n; k++) {
        piece[k].start = (pen_real_t)0;
        piece[k].offset = (pen_real_t)0;
        piece[k].slope = (pen_real_t)0;
        piece[k].status = PEN_SET_PIECES;
    }
}

pen_status_t pen_prepare(const pen_model_t *model, const pen_real_t value[], pen_real_t work[], bool active[], pen_piece_t piece[],
                         pen_breach_t *breach)
{
    pen_status_t status = PEN_OK;

    for (uint32_t i = 0U; i < model->networks; i++) {
        const pen_network_t *const network = &model->network[i];
        const pen_real_t *const p = &value[network->at];
        const pen_piece_t *folded = NULL;
        if (model->pieces > 0U) {
            pen_piece_t *const own = &piece[i * model->pieces];
            const pen_status_t found = pen_fold(&network->chain, p, model->clamp, work, active, model->pieces, own);
            if (found == PEN_OK) {
                folded = own;
            } else if (model->layers) {
                layer_by_layer(model->pieces, own);
            } else {
                status |= found;
            }
        }
        if ((network->promise != NULL) &&
            !pen_promise_kept(network->promise, &network->chain, p, model->clamp, model->pieces, folded, work, active, breach)) {
            breach->network = i;
            status |= PEN_SET_PROMISE;
        }
    }
    return status;
}

pen_status_t pen_tune_breach(const pen_model_t *model, const pen_instance_t *self, pen_breach_t *breach)
{
    const bool good = pen_usable(model, self) && (breach != NULL);

    if (good) {
        breach->network = self->breach.network;
        breach->kind = self->breach.kind;
        breach->at = self->breach.at;
    }
    return good ? PEN_OK : PEN_SET_BADARG;
}

pen_status_t pen_instance_status(const pen_model_t *model, pen_instance_t *self, pen_status_report_t *report)
{
    const bool good = pen_usable(model, self) && (report != NULL);

    if (good) {
        pen_status_read(&self->log, report);
    }
    return good ? PEN_OK : PEN_BADARG;
}

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

/* Banks that cannot be distinguished from other memory are given up: the guard would find them damaged again and again. */
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
