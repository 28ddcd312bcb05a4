/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "penode/pen_exact.h"

#include "penode/pen_instance.h"

#include <stddef.h>

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
