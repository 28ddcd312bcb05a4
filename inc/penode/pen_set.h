/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * Double-buffered parameter sets: staged in the tuning context, adopted by the step between two samples.
 *
 *   tuning context                        step
 *   begin   -> a bank not in use
 *   write, write, ...
 *   commit  -> checks
 *   publish -> barrier, pending = adopt slot
 *                                         pending? barrier, active = slot, barrier, pending = 0
 *   begin / select / rollback again       (everything else of this struct is the tuning context's own)
 *   withdraw -> pending = withdraw slot   slot not active yet? do not adopt it; barrier, pending = 0
 *
 * Only the step writes `active`, and only it clears `pending`; only the tuning context fills the inactive slot, and
 * only while nothing is pending. So the step never sees a half-written set, whichever of the two pre-empts the other,
 * also on two cores. A command damaged in memory is dropped, and the running set stays in force. One tuning context at
 * a time. A refused call changes nothing that the step reads.
 * `layout` and `length` are constants of the model's code: no bit that flips in RAM can move a write out of a bank, or
 * let a set of another shape pass.
 *
 * The values are in the order in which the kernels read them (see the map in the generated header of the sets).
 * Applications call the functions of their model, NAME_tune_...; those of this header are for generated code.
 */
#ifndef PEN_SET_H
#define PEN_SET_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "penode/pen_real.h"
#include "penode/pen_status.h"

#ifdef __cplusplus
extern "C" {
#endif

/** What a set is, apart from its values. 16 bytes. */
typedef struct {
    uint32_t layout;   /* fingerprint of model, order of the values, ABI and real type; must equal the model's     */
    uint32_t length;   /* number of values; must equal the model's                                                 */
    uint32_t id;       /* chosen by the user                                                                       */
    uint32_t checksum; /* CRC-32 (IEEE 802.3, reflected) over the values, each little endian, on every core        */
} pen_set_head_t;

/** A whole set: borrowed values that must stay unchanged while the set is active, pending or the rollback set. */
typedef struct {
    pen_set_head_t head;
    const pen_real_t *value; /* [head.length] */
} pen_set_t;

/** The tuning state of one instance. Owned by it; touch it only through the functions below. */
typedef struct {
    pen_set_t slot[2];         /* slot[active] is read by the step, the other belongs to the tuning context     */
    volatile uint32_t active;  /* 0 or 1; written by the step only                                              */
    volatile uint32_t pending; /* 0, or a command to the next step: adopt a slot, withdraw it                    */
    volatile uint32_t hold;    /* PEN_HELD: the step keeps the state                                            */
    uint32_t published;        /* the command last published, until its outcome is known; else 0                */
    uint32_t settled;          /* `active` when the last outcome was known                                      */
    pen_set_t slot_check[2];   /* copy of slot[]: a damaged head or address is found before it is used          */
    pen_set_t previous;        /* the rollback set; value is NULL if there is none                              */
    pen_set_t replaced;        /* the rollback set before the last publish: restored if that is withdrawn       */
    pen_set_t initial;         /* the set given to init: used if running and rollback set are damaged           */
    pen_real_t *bank[2];       /* [length] each; NULL if the model runs from selected sets only                 */
    pen_real_t *bank_check[2]; /* copy of bank[]: a damaged address is not written to                           */
    uint32_t open;             /* 1: between begin and commit                                                   */
    uint32_t fill;             /* bytes written so far                                                          */
} pen_tuning_t;

/**
 * Start with a whole set active. Not while a step or another tuning call runs. A refused call leaves *tuning as it is.
 * @param layout, length  of the model: every set must have them, here and in every call below
 * @param set     borrowed for as long as the instance is used; checked as commit does
 * @param bank0, bank1  [length] each, for staging; or both NULL: then only select works
 * @return PEN_OK; PEN_BADARG; PEN_SET_LAYOUT; PEN_SET_CHECKSUM; PEN_SET_NONFINITE
 */
pen_status_t pen_tuning_init(pen_tuning_t *tuning, uint32_t layout, uint32_t length, const pen_set_t *set, pen_real_t bank0[],
                             pen_real_t bank1[]);

/* All calls below but pen_tuning_adopt are for the tuning context. */

/**
 * Open the inactive slot for a new set. The rollback set is kept if a bank is free.
 * @return PEN_OK; PEN_SET_BUSY; PEN_SET_LAYOUT if layout or length differ; PEN_SET_BADARG if head is NULL, or there is
 *         no bank, or its address is damaged
 */
pen_status_t pen_tuning_begin(pen_tuning_t *tuning, uint32_t layout, uint32_t length, const pen_set_head_t *head);

/**
 * The same with a copy of the running set: any part may be overwritten, in any order. Its checksum is that of the
 * running set until pen_tuning_expect gives another. Cost: one copy of the set.
 * @return as pen_tuning_begin
 */
pen_status_t pen_tuning_begin_copy(pen_tuning_t *tuning, uint32_t layout, uint32_t length, uint32_t id);

/** Set the checksum of the open set, which commit compares with its values. @return PEN_OK; PEN_SET_CLOSED */
pen_status_t pen_tuning_expect(pen_tuning_t *tuning, uint32_t checksum);

/**
 * Write values [offset, offset + n). In order; a chunk may be sent again, a gap is refused.
 * @return PEN_OK; PEN_SET_CLOSED, also if the address of the bank is damaged; PEN_SET_RANGE; PEN_SET_BADARG
 */
pen_status_t pen_tuning_write(pen_tuning_t *tuning, uint32_t length, uint32_t offset, const pen_real_t value[], uint32_t n);

/** The same in bytes of the serial form (penode/pen_serial.h): offset and n count bytes, nothing need be aligned. */
pen_status_t pen_tuning_write_bytes(pen_tuning_t *tuning, uint32_t length, uint32_t offset, const uint8_t byte[], uint32_t n);

/* Three sources of a new set. Each call checks it and returns it in *ready; nothing changes until it is published.
 * Before that, the caller folds networks into the slot that the set will take. Cost: about 10 operations per byte. */

/**
 * Check the open set. A refused one stays open: write the wrong part again, or abort.
 * @return PEN_OK; PEN_SET_CLOSED; PEN_SET_SHORT; PEN_SET_LAYOUT; PEN_SET_CHECKSUM; PEN_SET_NONFINITE
 */
pen_status_t pen_tuning_commit(const pen_tuning_t *tuning, uint32_t layout, uint32_t length, pen_set_t *ready);

/**
 * A whole set, for example in flash, without copying it; an open set is dropped.
 * @return PEN_OK; PEN_SET_BUSY; PEN_SET_LAYOUT; PEN_SET_CHECKSUM; PEN_SET_NONFINITE; PEN_SET_BADARG
 */
pen_status_t pen_tuning_select(pen_tuning_t *tuning, uint32_t layout, uint32_t length, const pen_set_t *set, pen_set_t *ready);

/**
 * The rollback set, which ran before the running one; an open set is dropped.
 * @return PEN_OK; PEN_SET_BUSY; PEN_SET_NO_PREVIOUS; if it was changed PEN_SET_LAYOUT, PEN_SET_CHECKSUM
 */
pen_status_t pen_tuning_rollback(pen_tuning_t *tuning, uint32_t layout, uint32_t length, pen_set_t *ready);

/** The slot that the next set will take: what belongs to it may be written. Stable while nothing is pending. */
uint32_t pen_tuning_inactive(const pen_tuning_t *tuning);

/** Hand a ready set to the next step; the running set becomes the rollback set. */
void pen_tuning_publish(pen_tuning_t *tuning, const pen_set_t *ready);

/**
 * Ask the next step not to adopt the published set. A step may adopt it before it sees the request: once nothing is
 * pending, pen_tuning_running returns the set in force.
 * @return PEN_OK: requested; PEN_SET_IDLE: nothing is pending
 */
pen_status_t pen_tuning_withdraw(pen_tuning_t *tuning);

/** True while a published set, or the request to withdraw it, waits for the next step. Any context. */
bool pen_tuning_pending(const pen_tuning_t *tuning);

/** True if nothing is pending; then records whether the set published last was adopted or withdrawn. */
bool pen_tuning_settle(pen_tuning_t *tuning);

/** The rollback set that belongs to the set in force, whether the set published last was adopted or not. */
const pen_set_t *pen_tuning_fallback(const pen_tuning_t *tuning);

/** Drop the open set. @return PEN_OK; PEN_SET_CLOSED */
pen_status_t pen_tuning_abort(pen_tuning_t *tuning);

/** Tell the step to hold state and outputs (true), or to continue from them (false). */
void pen_tuning_hold(pen_tuning_t *tuning, bool hold);

/** The head of the running set. */
void pen_tuning_running(const pen_tuning_t *tuning, pen_set_head_t *head);

/** Check layout, length, checksum and values. @return PEN_OK; PEN_SET_LAYOUT; PEN_SET_CHECKSUM; PEN_SET_NONFINITE */
pen_status_t pen_set_check(const pen_set_t *set, uint32_t layout, uint32_t length);

/** Copy head and address, not the values; member by member, so that no compiler calls memcpy. */
void pen_set_copy(pen_set_t *to, const pen_set_t *from);

/** True if head and address are equal. */
bool pen_set_same(const pen_set_t *a, const pen_set_t *b);

/** Are the addresses of the banks those given to init? */
bool pen_tuning_banks_known(const pen_tuning_t *tuning);

/** CRC-32 of n values, as in pen_set_head_t. */
uint32_t pen_set_checksum(const pen_real_t value[], uint32_t n);

/**
 * For the step: adopt a pending set, unless it is withdrawn.
 * @param slot  0 or 1: the slot of the set now in force
 * @return PEN_OK, or flags: PEN_ADOPTED or PEN_WITHDRAWN, PEN_HELD
 * Cost: constant but for the exchange itself, which adds two stores and two barriers.
 */
pen_status_t pen_tuning_adopt(pen_tuning_t *tuning, uint32_t *slot);

#ifdef __cplusplus
}
#endif

#endif
