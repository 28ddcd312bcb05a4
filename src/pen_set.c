/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "penode/pen_exact.h"

#include "penode/pen_set.h"

#include "penode/pen_math.h"
#include "penode/pen_port.h"
#include "penode/pen_serial.h"

#define YES      1U
#define NO       0U
#define ADOPT    0x5a3c9600U /* commands to the step, with the slot: no bit that flips makes one of nothing or of another */
#define WITHDRAW 0xa5c36900U
#define APART    0x00ff00ffU
#define SIZE     ((uint32_t)sizeof(pen_real_t))

uint32_t pen_set_checksum(const pen_real_t value[], uint32_t n)
{
    return ~pen_crc_values(PEN_CRC_START, n, value);
}

static void copy_head(pen_set_head_t *to, const pen_set_head_t *from)
{
    to->layout = from->layout;
    to->length = from->length;
    to->id = from->id;
    to->checksum = from->checksum;
}

void pen_set_copy(pen_set_t *to, const pen_set_t *from)
{
    copy_head(&to->head, &from->head);
    to->value = from->value;
}

bool pen_set_same(const pen_set_t *a, const pen_set_t *b)
{
    const uint32_t differences = (a->head.layout ^ b->head.layout) | (a->head.length ^ b->head.length) | (a->head.id ^ b->head.id) |
                                 (a->head.checksum ^ b->head.checksum);

    return (differences == 0U) && (a->value == b->value);
}

static uint32_t command(uint32_t what, uint32_t slot)
{
    return what ^ (slot * APART);
}

uint32_t pen_tuning_inactive(const pen_tuning_t *tuning)
{
    return (pen_port_load(&tuning->active) & 1U) ^ 1U;
}

bool pen_tuning_pending(const pen_tuning_t *tuning)
{
    return pen_port_load(&tuning->pending) != 0U;
}

bool pen_tuning_settle(pen_tuning_t *tuning)
{
    const bool done = !pen_tuning_pending(tuning);

    pen_port_barrier(); /* if so, the step's view of `active` is ours */
    if (done && (tuning->published != 0U)) {
        const uint32_t active = pen_port_load(&tuning->active) & 1U;
        if (tuning->published == command(ADOPT, active ^ 1U)) {
            pen_set_copy(&tuning->previous, &tuning->replaced); /* it was withdrawn, or the command lost in memory */
        }
        tuning->settled = active;
        tuning->published = 0U;
    }
    return done;
}

const pen_set_t *pen_tuning_fallback(const pen_tuning_t *tuning)
{
    const bool not_adopted = (tuning->published == command(ADOPT, pen_tuning_inactive(tuning)));

    return not_adopted ? &tuning->replaced : &tuning->previous;
}

void pen_tuning_publish(pen_tuning_t *tuning, const pen_set_t *ready)
{
    const uint32_t slot = pen_tuning_inactive(tuning);

    pen_set_copy(&tuning->slot[slot], ready);
    pen_set_copy(&tuning->slot_check[slot], ready);
    pen_set_copy(&tuning->replaced, &tuning->previous);
    pen_set_copy(&tuning->previous, &tuning->slot[slot ^ 1U]);
    tuning->open = NO;
    tuning->published = command(ADOPT, slot);
    pen_port_barrier();
    pen_port_store(&tuning->pending, tuning->published);
}

pen_status_t pen_tuning_withdraw(pen_tuning_t *tuning)
{
    const uint32_t slot = (tuning->published == command(ADOPT, 1U)) ? 1U : 0U;
    pen_status_t status = PEN_OK;

    if (pen_tuning_settle(tuning)) {
        status = PEN_SET_IDLE;
    } else if (pen_port_load(&tuning->pending) == command(ADOPT, slot)) {
        pen_port_store(&tuning->pending, command(WITHDRAW, slot)); /* too late if the step has just adopted it: it will see so */
    } else {
        /* asked already, or answered by now */
    }
    return status;
}

/* Layout and length come from the code: what lies in RAM may have lost a bit. */
static bool fits(const pen_set_head_t *head, uint32_t layout, uint32_t length)
{
    return (head->layout == layout) && (head->length == length);
}

pen_status_t pen_set_check(const pen_set_t *set, uint32_t layout, uint32_t length)
{
    pen_status_t status;

    if (!fits(&set->head, layout, length)) {
        status = PEN_SET_LAYOUT;
    } else if (pen_set_checksum(set->value, length) != set->head.checksum) {
        status = PEN_SET_CHECKSUM;
    } else if (!pen_finite(length, set->value)) {
        status = PEN_SET_NONFINITE;
    } else {
        status = PEN_OK;
    }
    return status;
}

/* The bank of the open set; NULL if none is open, or if the pointers to it have come apart: nothing is written there. */
static pen_real_t *open_bank(const pen_tuning_t *tuning)
{
    const pen_real_t *const value = tuning->slot[pen_tuning_inactive(tuning)].value;
    pen_real_t *const bank = (tuning->bank[0] == value) ? tuning->bank[0] : tuning->bank[1];

    return ((tuning->open == YES) && (bank == value)) ? bank : NULL;
}

pen_status_t pen_tuning_init(pen_tuning_t *tuning, uint32_t layout, uint32_t length, const pen_set_t *set, pen_real_t bank0[],
                             pen_real_t bank1[])
{
    pen_status_t status;

    if ((tuning == NULL) || (set == NULL) || (set->value == NULL) || ((bank0 == NULL) != (bank1 == NULL))) {
        status = PEN_BADARG;
    } else {
        status = pen_set_check(set, layout, length);
    }
    if (status == PEN_OK) {
        for (uint32_t i = 0U; i < 2U; i++) {
            pen_set_copy(&tuning->slot[i], set);
            pen_set_copy(&tuning->slot_check[i], set);
        }
        pen_set_copy(&tuning->initial, set);
        pen_set_copy(&tuning->previous, set);
        tuning->previous.value = NULL;
        pen_set_copy(&tuning->replaced, &tuning->previous);
        tuning->bank[0] = bank0;
        tuning->bank[1] = bank1;
        tuning->bank_check[0] = bank0;
        tuning->bank_check[1] = bank1;
        tuning->open = NO;
        tuning->fill = 0U;
        tuning->published = 0U;
        tuning->settled = 0U;
        tuning->active = 0U;
        tuning->pending = 0U;
        tuning->hold = PEN_OK;
    }
    return status;
}

bool pen_tuning_banks_known(const pen_tuning_t *tuning)
{
    return (tuning->bank[0] == tuning->bank_check[0]) && (tuning->bank[1] == tuning->bank_check[1]);
}

pen_status_t pen_tuning_begin(pen_tuning_t *tuning, uint32_t layout, uint32_t length, const pen_set_head_t *head)
{
    pen_status_t status;

    if ((head == NULL) || (tuning->bank[0] == NULL) || !pen_tuning_banks_known(tuning)) {
        status = PEN_SET_BADARG;
    } else if (!pen_tuning_settle(tuning)) {
        status = PEN_SET_BUSY;
    } else {
        status = fits(head, layout, length) ? PEN_OK : PEN_SET_LAYOUT;
    }
    if (status == PEN_OK) {
        const uint32_t slot = pen_tuning_inactive(tuning);
        const pen_real_t *const running = tuning->slot[slot ^ 1U].value;
        /* the bank that holds neither the running nor the rollback set; the latter is given up if it must be */
        const bool first = (tuning->bank[0] != running) && ((tuning->bank[0] != tuning->previous.value) || (tuning->bank[1] == running));
        const uint32_t bank = first ? 0U : 1U;
        if (tuning->previous.value == tuning->bank[bank]) {
            tuning->previous.value = NULL;
        }
        copy_head(&tuning->slot[slot].head, head);
        tuning->slot[slot].value = tuning->bank[bank];
        tuning->fill = 0U;
        tuning->open = YES;
    }
    return status;
}

pen_status_t pen_tuning_begin_copy(pen_tuning_t *tuning, uint32_t layout, uint32_t length, uint32_t id)
{
    pen_status_t status = PEN_SET_BUSY;

    if (pen_tuning_settle(tuning)) { /* from here on it is certain which slot runs */
        const pen_set_t *const running = &tuning->slot[pen_tuning_inactive(tuning) ^ 1U];
        const pen_set_head_t head = { layout, length, id, running->head.checksum };
        status = pen_tuning_begin(tuning, layout, length, &head);
        if (status == PEN_OK) {
            status = pen_tuning_write(tuning, length, 0U, running->value, length);
        }
    }
    return status;
}

pen_status_t pen_tuning_expect(pen_tuning_t *tuning, uint32_t checksum)
{
    pen_status_t status = PEN_SET_CLOSED;

    if (open_bank(tuning) != NULL) {
        tuning->slot[pen_tuning_inactive(tuning)].head.checksum = checksum;
        status = PEN_OK;
    }
    return status;
}

static void note_fill(pen_tuning_t *tuning, uint32_t end)
{
    tuning->fill = (end > tuning->fill) ? end : tuning->fill;
}

pen_status_t pen_tuning_write(pen_tuning_t *tuning, uint32_t length, uint32_t offset, const pen_real_t value[], uint32_t n)
{
    pen_real_t *const bank = open_bank(tuning);
    pen_status_t status;

    if (bank == NULL) {
        status = PEN_SET_CLOSED;
    } else if (value == NULL) {
        status = PEN_SET_BADARG;
    } else if ((offset > length) || (n > (length - offset)) || ((SIZE * offset) > tuning->fill)) {
        status = PEN_SET_RANGE;
    } else {
        status = PEN_OK;
    }
    if (status == PEN_OK) {
        for (uint32_t i = 0U; i < n; i++) {
            bank[offset + i] = value[i];
        }
        note_fill(tuning, SIZE * (offset + n));
    }
    return status;
}

pen_status_t pen_tuning_write_bytes(pen_tuning_t *tuning, uint32_t length, uint32_t offset, const uint8_t byte[], uint32_t n)
{
    pen_real_t *const bank = open_bank(tuning);
    const uint32_t size = SIZE * length;
    pen_status_t status;

    if (bank == NULL) {
        status = PEN_SET_CLOSED;
    } else if (byte == NULL) {
        status = PEN_SET_BADARG;
    } else if ((offset > tuning->fill) || (offset > size) || (n > (size - offset))) {
        status = PEN_SET_RANGE;
    } else {
        status = PEN_OK;
    }
    if (status == PEN_OK) {
        pen_serial_get_bytes(bank, offset, n, byte);
        note_fill(tuning, offset + n);
    }
    return status;
}

pen_status_t pen_tuning_commit(const pen_tuning_t *tuning, uint32_t layout, uint32_t length, pen_set_t *ready)
{
    const pen_set_t *const set = &tuning->slot[pen_tuning_inactive(tuning)];
    pen_status_t status;

    if (open_bank(tuning) == NULL) {
        status = PEN_SET_CLOSED;
    } else if (tuning->fill != (SIZE * length)) {
        status = PEN_SET_SHORT;
    } else {
        status = pen_set_check(set, layout, length);
    }
    if (status == PEN_OK) {
        pen_set_copy(ready, set);
    }
    return status;
}

pen_status_t pen_tuning_abort(pen_tuning_t *tuning)
{
    const pen_status_t status = (tuning->open == YES) ? PEN_OK : PEN_SET_CLOSED;

    tuning->open = NO;
    return status;
}

pen_status_t pen_tuning_select(pen_tuning_t *tuning, uint32_t layout, uint32_t length, const pen_set_t *set, pen_set_t *ready)
{
    pen_status_t status;

    if ((set == NULL) || (set->value == NULL)) {
        status = PEN_SET_BADARG;
    } else if (!pen_tuning_settle(tuning)) {
        status = PEN_SET_BUSY;
    } else {
        status = pen_set_check(set, layout, length);
    }
    if (status == PEN_OK) {
        pen_set_copy(ready, set);
    }
    return status;
}

pen_status_t pen_tuning_rollback(pen_tuning_t *tuning, uint32_t layout, uint32_t length, pen_set_t *ready)
{
    pen_status_t status;

    if (!pen_tuning_settle(tuning)) {
        status = PEN_SET_BUSY;
    } else if (tuning->previous.value == NULL) {
        status = PEN_SET_NO_PREVIOUS;
    } else {
        status = pen_set_check(&tuning->previous, layout, length);
    }
    if (status == PEN_OK) {
        pen_set_copy(ready, &tuning->previous);
    }
    return status;
}

void pen_tuning_hold(pen_tuning_t *tuning, bool hold)
{
    pen_port_store(&tuning->hold, hold ? PEN_HELD : PEN_OK);
}

void pen_tuning_running(const pen_tuning_t *tuning, pen_set_head_t *head)
{
    copy_head(head, &tuning->slot[pen_port_load(&tuning->active) & 1U].head);
}

pen_status_t pen_tuning_adopt(pen_tuning_t *tuning, uint32_t *slot)
{
    uint32_t active = pen_port_load(&tuning->active) & 1U; /* ours alone to write */
    pen_status_t status = pen_port_load(&tuning->hold) & PEN_HELD;
    const uint32_t pending = pen_port_load(&tuning->pending);

    if (pending != 0U) {
        const uint32_t other = active ^ 1U;
        pen_port_barrier(); /* what was published is now seen whole ...                           */
        if (pending == command(ADOPT, other)) {
            active = other;
            pen_port_store(&tuning->active, active);
            status |= PEN_ADOPTED;
        } else if (pending == command(WITHDRAW, other)) {
            status |= PEN_WITHDRAWN;
        } else {
            /* a withdrawal that came too late, or damage */
        }
        pen_port_barrier(); /* ... and the flip is out before the tuning context may act on it   */
        pen_port_store(&tuning->pending, 0U);
    }
    *slot = active;
    return status;
}
