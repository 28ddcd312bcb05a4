/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * Double-buffered parameter sets: staged by a slow context, adopted by the step between two samples.
 *
 *   tuning context                        step
 *   begin   -> a bank that is not read
 *   write, write, ...
 *   commit  -> checks
 *   publish -> barrier, pending = adopt slot
 *                                         pending? barrier, active = slot, barrier, pending = 0
 *   begin / select / rollback again       (everything else of this struct is the tuning context's own)
 *   withdraw -> pending = withdraw slot   slot not active yet? leave it; barrier, pending = 0
 *
 * Only the step writes `active`, and only it clears `pending`; only the tuning context fills the slot that is not active,
 * and only while nothing is pending. So the step never sees a half-written set, whichever of the two pre-empts the other,
 * also on two cores. A command that loses a bit in memory is dropped: the running set goes on. One tuning context at a time. A refused call changes nothing that the step reads.
 *
 * `layout` and `length` are those of the model, constants of the code: no bit that flips in RAM can move a write out of a
 * bank, or let a set of another shape pass.
 *
 * The values lie in the order in which the kernels stream them (see the map in the generated header of the sets).
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
    uint32_t id;       /* free for the user: which set this is                                                     */
    uint32_t checksum; /* CRC-32 (IEEE 802.3, reflected) over the values, each little endian, on every core        */
} pen_set_head_t;

/** A whole set: borrowed values that must stay unchanged while the set is active, pending or the rollback set. */
typedef struct {
    pen_set_head_t    head;
    const pen_real_t *value; /* [head.length] */
} pen_set_t;

/** The tuning state of one instance. Owned by it; touch it only through the functions below. */
typedef struct {
    pen_set_t         slot[2];       /* slot[active] is read by the step, the other belongs to the tuning context     */
    volatile uint32_t active;        /* 0 or 1; written by the step only                                              */
    volatile uint32_t pending;       /* 0, or a command to the next step: adopt a slot, withdraw it                    */
    volatile uint32_t hold;          /* PEN_HELD: the step keeps the state                                            */
    uint32_t          published;     /* the command last published, until it is known what became of it; else 0       */
    uint32_t          settled;       /* what `active` was when that was last known                                    */
    pen_set_t         slot_check[2]; /* copy of slot[]: a damaged head or address is found before it is used          */
    pen_set_t         previous;      /* the rollback set; value is NULL if there is none                              */
    pen_set_t         replaced;      /* the rollback set before the last publish: in force again if that is withdrawn */
    pen_set_t         initial;       /* the set given to init: the last resort of a damaged running set               */
    pen_real_t       *bank[2];       /* [length] each; NULL if the model runs from selected sets only                 */
    pen_real_t       *bank_check[2]; /* copy of bank[]: an address that has lost a bit is not written to              */
    uint32_t          open;          /* 1: between begin and commit                                                   */
    uint32_t          fill;          /* bytes written so far                                                          */
} pen_tuning_t;

/**
 * Start with a whole set active. Not while a step or another tuning call runs. A refused call leaves *tuning as it is.
 * @param layout, length  what every set of this model must name, here and in every call below
 * @param set     borrowed for as long as the instance is used; checked as commit does
 * @param bank0, bank1  [length] each, for staging; or both NULL: then only select works
 * @return PEN_OK; PEN_BADARG; PEN_SET_LAYOUT; PEN_SET_CHECKSUM; PEN_SET_NONFINITE
 */
pen_status_t pen_tuning_init(pen_tuning_t *tuning, uint32_t layout, uint32_t length, const pen_set_t *set,
                             pen_real_t bank0[], pen_real_t bank1[]);

/* All calls below but pen_tuning_adopt are for the tuning context. */

/**
 * Open the inactive slot for a new set. The rollback set is kept if a bank is free.
 * @return PEN_OK; PEN_SET_BUSY; PEN_SET_LAYOUT if layout or length differ; PEN_SET_BADARG if head is NULL, or there is no
 *         bank, or its address is damaged
 */
pen_status_t pen_tuning_begin(pen_tuning_t *tuning, uint32_t layout, uint32_t length, const pen_set_head_t *head);

/**
 * The same with a copy of the running set: any part may be overwritten, in any order. Its checksum is that of the running
 * set until pen_tuning_expect gives another. Cost: one copy of the set.
 * @return as pen_tuning_begin
 */
pen_status_t pen_tuning_begin_copy(pen_tuning_t *tuning, uint32_t layout, uint32_t length, uint32_t id);

/** The checksum that commit is to find in the open set. @return PEN_OK; PEN_SET_CLOSED */
pen_status_t pen_tuning_expect(pen_tuning_t *tuning, uint32_t checksum);

/**
 * Write values [offset, offset + n). In order; a chunk may be sent again, a gap is refused.
 * @return PEN_OK; PEN_SET_CLOSED, also if the pointers to the bank do not agree any more; PEN_SET_RANGE; PEN_SET_BADARG
 */
pen_status_t pen_tuning_write(pen_tuning_t *tuning, uint32_t length, uint32_t offset, const pen_real_t value[], uint32_t n);

/** The same in bytes of the serial form (penode/pen_serial.h): offset and n count bytes, nothing need be aligned. */
pen_status_t pen_tuning_write_bytes(pen_tuning_t *tuning, uint32_t length, uint32_t offset, const uint8_t byte[], uint32_t n);

/* Three ways to a new set. Each checks one and gives it out as `ready`; nothing changes until it is published. In between,
 * what is derived from the set is made for the slot that it will take. Cost: about 10 operations per byte of the set. */

/**
 * The open set. A refused one stays open: send the wrong part again, or abort.
 * @return PEN_OK; PEN_SET_CLOSED; PEN_SET_SHORT; PEN_SET_LAYOUT; PEN_SET_CHECKSUM; PEN_SET_NONFINITE
 */
pen_status_t pen_tuning_commit(const pen_tuning_t *tuning, uint32_t layout, uint32_t length, pen_set_t *ready);

/**
 * A whole set (in flash, say), without copying it; an open set is dropped.
 * @return PEN_OK; PEN_SET_BUSY; PEN_SET_LAYOUT; PEN_SET_CHECKSUM; PEN_SET_NONFINITE; PEN_SET_BADARG
 */
pen_status_t pen_tuning_select(pen_tuning_t *tuning, uint32_t layout, uint32_t length, const pen_set_t *set, pen_set_t *ready);

/**
 * The rollback set, the one that ran before; an open set is dropped.
 * @return PEN_OK; PEN_SET_BUSY; PEN_SET_NO_PREVIOUS; if it is no longer what it was PEN_SET_LAYOUT, PEN_SET_CHECKSUM
 */
pen_status_t pen_tuning_rollback(pen_tuning_t *tuning, uint32_t layout, uint32_t length, pen_set_t *ready);

/** The slot that the next set will take: what belongs to it may be written. Stable while nothing is pending. */
uint32_t pen_tuning_inactive(const pen_tuning_t *tuning);

/** Hand a ready set to the next step; the running set becomes the rollback set. */
void pen_tuning_publish(pen_tuning_t *tuning, const pen_set_t *ready);

/**
 * Ask the next step to leave a published set alone. The step may be faster: once nothing is pending,
 * pen_tuning_running tells which set is in force.
 * @return PEN_OK: asked; PEN_SET_IDLE: nothing is pending
 */
pen_status_t pen_tuning_withdraw(pen_tuning_t *tuning);

/** True while a published set, or the request to withdraw it, waits for the next step. Any context. */
bool pen_tuning_pending(const pen_tuning_t *tuning);

/** Has the step answered? If so, take note of what became of the set published last. */
bool pen_tuning_settle(pen_tuning_t *tuning);

/** The rollback set as it is if the set published last is, or was, withdrawn; once that is adopted, as it is. */
const pen_set_t *pen_tuning_fallback(const pen_tuning_t *tuning);

/** Drop the open set. @return PEN_OK; PEN_SET_CLOSED */
pen_status_t pen_tuning_abort(pen_tuning_t *tuning);

/** Tell the step to hold state and outputs (true), or to go on from them (false). */
void pen_tuning_hold(pen_tuning_t *tuning, bool hold);

/** The head of the running set. */
void pen_tuning_running(const pen_tuning_t *tuning, pen_set_head_t *head);

/** Layout, length, checksum and values of a set. @return PEN_OK; PEN_SET_LAYOUT; PEN_SET_CHECKSUM; PEN_SET_NONFINITE */
pen_status_t pen_set_check(const pen_set_t *set, uint32_t layout, uint32_t length);

/** Copy head and address, not the values; member by member, so that no compiler makes a call of it. */
void pen_set_copy(pen_set_t *to, const pen_set_t *from);

/** The same head and address? */
bool pen_set_same(const pen_set_t *a, const pen_set_t *b);

/** CRC-32 of n values, as pen_set_head_t wants it. */
uint32_t pen_set_checksum(const pen_real_t value[], uint32_t n);

/**
 * For the step: adopt what is pending, or leave it if it is withdrawn, and tell what to run with.
 * @param slot  0 or 1: the slot of the set now in force
 * @return PEN_OK, or of PEN_ADOPTED, PEN_WITHDRAWN, PEN_HELD
 * Cost: constant but for the exchange itself, which adds two stores and two barriers.
 */
pen_status_t pen_tuning_adopt(pen_tuning_t *tuning, uint32_t *slot);

#ifdef __cplusplus
}
#endif

#endif
