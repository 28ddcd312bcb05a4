/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "penode/pen_exact.h"

#include "penode/pen_set.h"

#include "penode/pen_math.h"
#include "penode/pen_port.h"

#define YES 1U
#define NO  0U

/* What takes the index of a byte in little-endian order to its place in memory, by exclusive or: 0 on a little-endian core. */
static size_t byte_swap(void)
{
    const uint32_t one = 1U;

    return (*(const uint8_t *)&one == 1U) ? 0U : (sizeof(pen_real_t) - 1U);
}

/* CRC-32 of the values' bytes in little-endian order, on every core, four bits at a time. */
uint32_t pen_set_checksum(const pen_real_t value[], uint32_t n)
{
    static const uint32_t table[16] = {
        0x00000000U, 0x1db71064U, 0x3b6e20c8U, 0x26d930acU,
        0x76dc4190U, 0x6b6b51f4U, 0x4db26158U, 0x5005713cU,
        0xedb88320U, 0xf00f9344U, 0xd6d6a3e8U, 0xcb61b38cU,
        0x9b64c2b0U, 0x86d3d2d4U, 0xa00ae278U, 0xbdbdf21cU,
    };
    const uint8_t *const byte = (const uint8_t *)value;
    const size_t length = (size_t)n * sizeof(pen_real_t);
    const size_t swap = byte_swap();
    uint32_t crc = UINT32_MAX;

    for (size_t i = 0U; i < length; i++) {
        crc ^= byte[i ^ swap];
        crc = (crc >> 4U) ^ table[crc & 0x0fU];
        crc = (crc >> 4U) ^ table[crc & 0x0fU];
    }
    return crc ^ UINT32_MAX;
}

uint32_t pen_tuning_spare(const pen_tuning_t *tuning)
{
    return (pen_port_load(&tuning->active) & 1U) ^ 1U;
}

/* Is the step done with what was last announced? Then its view of `active` is ours. */
static bool settled(const pen_tuning_t *tuning)
{
    const bool done = (pen_port_load(&tuning->pending) == NO);

    pen_port_barrier();
    return done;
}

/* What runs now becomes the way back. */
void pen_tuning_announce(pen_tuning_t *tuning, const pen_set_t *ready)
{
    const uint32_t spare = pen_tuning_spare(tuning);

    tuning->slot[spare] = *ready;
    tuning->previous = tuning->slot[spare ^ 1U];
    tuning->open = NO;
    pen_port_barrier();
    pen_port_store(&tuning->pending, YES);
}

/* Layout and length come from the code: what lies in RAM may have lost a bit. */
static bool fits(const pen_set_head_t *head, uint32_t layout, uint32_t length)
{
    return (head->layout == layout) && (head->length == length);
}

static pen_status_t check_set(const pen_set_t *set, uint32_t layout, uint32_t length)
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
    const pen_real_t *const value = tuning->slot[pen_tuning_spare(tuning)].value;
    pen_real_t *const bank = (tuning->bank[0] == value) ? tuning->bank[0] : tuning->bank[1];

    return ((tuning->open == YES) && (bank == value)) ? bank : NULL;
}

pen_status_t pen_tuning_init(pen_tuning_t *tuning, uint32_t layout, uint32_t length, const pen_set_t *set,
                             pen_real_t bank0[], pen_real_t bank1[])
{
    pen_status_t status;

    if ((tuning == NULL) || (set == NULL) || (set->value == NULL) || ((bank0 == NULL) != (bank1 == NULL))) {
        status = PEN_BADARG;
    } else {
        status = check_set(set, layout, length);
    }
    if (status == PEN_OK) {
        tuning->slot[0] = *set;
        tuning->slot[1] = *set;
        tuning->previous = *set;
        tuning->previous.value = NULL;
        tuning->bank[0] = bank0;
        tuning->bank[1] = bank1;
        tuning->bank_again[0] = bank0;
        tuning->bank_again[1] = bank1;
        tuning->open = NO;
        tuning->fill = 0U;
        tuning->active = 0U;
        tuning->pending = NO;
        tuning->hold = PEN_OK;
    }
    return status;
}

static bool has_banks(const pen_tuning_t *tuning)
{
    return (tuning->bank[0] != NULL) && (tuning->bank[0] == tuning->bank_again[0]) &&
           (tuning->bank[1] == tuning->bank_again[1]);
}

pen_status_t pen_tuning_begin(pen_tuning_t *tuning, uint32_t layout, uint32_t length, const pen_set_head_t *head)
{
    pen_status_t status;

    if ((head == NULL) || !has_banks(tuning)) {
        status = PEN_BADARG;
    } else if (!settled(tuning)) {
        status = PEN_SET_BUSY;
    } else {
        status = fits(head, layout, length) ? PEN_OK : PEN_SET_LAYOUT;
    }
    if (status == PEN_OK) {
        const uint32_t free_slot = pen_tuning_spare(tuning);
        const pen_real_t *const running = tuning->slot[free_slot ^ 1U].value;
        /* the bank that is neither running nor the way back; the way back is given up if it must be */
        const bool first = (tuning->bank[0] != running) &&
                           ((tuning->bank[0] != tuning->previous.value) || (tuning->bank[1] == running));
        const uint32_t bank = first ? 0U : 1U;
        if (tuning->previous.value == tuning->bank[bank]) {
            tuning->previous.value = NULL;
        }
        tuning->slot[free_slot].head = *head;
        tuning->slot[free_slot].value = tuning->bank[bank];
        tuning->fill = 0U;
        tuning->open = YES;
    }
    return status;
}

pen_status_t pen_tuning_write(pen_tuning_t *tuning, uint32_t length, uint32_t offset, const pen_real_t value[], uint32_t n)
{
    pen_real_t *const bank = open_bank(tuning);
    pen_status_t status;

    if (bank == NULL) {
        status = PEN_SET_CLOSED;
    } else if (value == NULL) {
        status = PEN_BADARG;
    } else if ((offset > tuning->fill) || (offset > length) || (n > (length - offset))) {
        status = PEN_SET_RANGE;
    } else {
        for (uint32_t i = 0U; i < n; i++) {
            bank[offset + i] = value[i];
        }
        tuning->fill = ((offset + n) > tuning->fill) ? (offset + n) : tuning->fill;
        status = PEN_OK;
    }
    return status;
}

pen_status_t pen_tuning_commit(const pen_tuning_t *tuning, uint32_t layout, uint32_t length, pen_set_t *ready)
{
    const pen_set_t *const set = &tuning->slot[pen_tuning_spare(tuning)];
    pen_status_t status;

    if (open_bank(tuning) == NULL) {
        status = PEN_SET_CLOSED;
    } else if (tuning->fill != length) {
        status = PEN_SET_SHORT;
    } else {
        status = check_set(set, layout, length);
    }
    if (status == PEN_OK) {
        *ready = *set;
    }
    return status;
}

pen_status_t pen_tuning_abort(pen_tuning_t *tuning)
{
    const pen_status_t status = (tuning->open == YES) ? PEN_OK : PEN_SET_CLOSED;

    tuning->open = NO;
    return status;
}

pen_status_t pen_tuning_select(const pen_tuning_t *tuning, uint32_t layout, uint32_t length, const pen_set_t *set,
                               pen_set_t *ready)
{
    pen_status_t status;

    if ((set == NULL) || (set->value == NULL)) {
        status = PEN_BADARG;
    } else if (!settled(tuning)) {
        status = PEN_SET_BUSY;
    } else {
        status = check_set(set, layout, length);
    }
    if (status == PEN_OK) {
        *ready = *set;
    }
    return status;
}

pen_status_t pen_tuning_rollback(const pen_tuning_t *tuning, uint32_t layout, uint32_t length, pen_set_t *ready)
{
    pen_status_t status;

    if (!settled(tuning)) {
        status = PEN_SET_BUSY;
    } else if (tuning->previous.value == NULL) {
        status = PEN_SET_NO_PREVIOUS;
    } else {
        status = check_set(&tuning->previous, layout, length);
    }
    if (status == PEN_OK) {
        *ready = tuning->previous;
    }
    return status;
}

void pen_tuning_hold(pen_tuning_t *tuning, bool hold)
{
    pen_port_store(&tuning->hold, hold ? PEN_HELD : PEN_OK);
}

pen_set_head_t pen_tuning_running(const pen_tuning_t *tuning)
{
    return tuning->slot[pen_port_load(&tuning->active) & 1U].head;
}

pen_status_t pen_tuning_adopt(pen_tuning_t *tuning, uint32_t *slot)
{
    uint32_t active = pen_port_load(&tuning->active) & 1U; /* ours alone to write */
    pen_status_t status = pen_port_load(&tuning->hold) & PEN_HELD;

    if (pen_port_load(&tuning->pending) == YES) {
        pen_port_barrier(); /* what was announced is now seen whole ...                         */
        active ^= 1U;
        pen_port_store(&tuning->active, active);
        pen_port_barrier(); /* ... and the flip is out before the tuning context may act on it */
        pen_port_store(&tuning->pending, NO);
        status |= PEN_ADOPTED;
    }
    *slot = active;
    return status;
}
