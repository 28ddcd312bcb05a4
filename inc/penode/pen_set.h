/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * Double-buffered parameter sets: staged by a slow context, adopted by the step between two samples.
 *
 *   tuning context                      step
 *   begin  -> a bank that is not read
 *   write, write, ...
 *   commit   -> checks
 *   announce -> barrier, pending=1
 *                                       pending? barrier, active ^= 1, barrier, pending=0
 *   begin / select / rollback again     (everything else of this struct is the tuning context's own)
 *
 * Only the step writes `active`; only the tuning context fills the slot that is not active, and only while nothing is
 * pending. So the step never sees a half-written set, whichever of the two pre-empts the other, also on two cores.
 * One tuning context at a time. A refused call changes nothing that the step reads.
 *
 * `layout` and `length` are those of the model, constants of the code: no bit that flips in RAM can move a write out of a
 * bank, or let a set of another shape pass.
 *
 * The values lie in the order in which the kernels stream them (see the generated header of the model for the map).
 */
#ifndef PEN_SET_H
#define PEN_SET_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "penode/pen_real.h"
#include "penode/pen_status.h"

/** What a set is, apart from its values. 16 bytes. */
typedef struct {
    uint32_t layout;   /* fingerprint of model, order of the values, ABI and real type; must equal the model's     */
    uint32_t length;   /* number of values; must equal the model's                                                 */
    uint32_t id;       /* free for the user: which set this is                                                     */
    uint32_t checksum; /* CRC-32 (IEEE 802.3, reflected) over the bytes of the values as they lie in memory        */
} pen_set_head_t;

/** A whole set: borrowed values that must stay unchanged while the set is active, pending or previous. */
typedef struct {
    pen_set_head_t    head;
    const pen_real_t *value; /* [head.length] */
} pen_set_t;

/** The tuning state of one instance. Owned by it; touch it only through the functions below. */
typedef struct {
    pen_set_t         slot[2];  /* slot[active] is read by the step, the other belongs to the tuning context */
    volatile uint32_t active;   /* 0 or 1; written by the step only                                          */
    volatile uint32_t pending;  /* 1: the other slot waits for the next step                                 */
    volatile uint32_t hold;     /* PEN_HELD: the step keeps the state                                        */
    pen_set_t         previous; /* what rollback returns to; value is NULL if it is gone                     */
    pen_real_t       *bank[2];  /* [length] each; NULL if the model runs from selected sets only             */
    pen_real_t       *bank_again[2]; /* the same: an address that has lost a bit is not written to            */
    uint32_t          open;     /* 1: between begin and commit                                               */
    uint32_t          fill;     /* values written so far                                                     */
} pen_tuning_t;

/**
 * Start with a whole set active.
 * @param layout, length  what every set of this model must name, here and in every call below
 * @param set     borrowed for as long as it may be active or previous; checked as commit does
 * @param bank0, bank1  [length] each, for staging; or both NULL: then only select works
 * @return PEN_OK; PEN_BADARG; PEN_SET_LAYOUT; PEN_SET_CHECKSUM; PEN_SET_NONFINITE
 */
pen_status_t pen_tuning_init(pen_tuning_t *tuning, uint32_t layout, uint32_t length, const pen_set_t *set,
                             pen_real_t bank0[], pen_real_t bank1[]);

/**
 * Open the inactive buffer for a new set. The set before the running one is kept for rollback if a bank is free.
 * @return PEN_OK; PEN_SET_BUSY; PEN_SET_LAYOUT if layout or length differ; PEN_BADARG if head is NULL, or there is no bank,
 *         or its address is damaged
 */
pen_status_t pen_tuning_begin(pen_tuning_t *tuning, uint32_t layout, uint32_t length, const pen_set_head_t *head);

/**
 * Write values [offset, offset + n). In order; a chunk may be sent again, a gap is refused.
 * @return PEN_OK; PEN_SET_CLOSED, also if the pointers to the bank do not agree any more; PEN_SET_RANGE; PEN_BADARG
 */
pen_status_t pen_tuning_write(pen_tuning_t *tuning, uint32_t length, uint32_t offset, const pen_real_t value[], uint32_t n);

/* Three ways to a new set. Each checks one and gives it out as `ready`; nothing changes until it is announced. In between,
 * what is derived from the set is made for the slot that it will take. Cost: about 10 operations per byte of the set. */

/**
 * The open set. A refused one stays open: send the wrong part again, or abort.
 * @return PEN_OK; PEN_SET_CLOSED; PEN_SET_SHORT; PEN_SET_LAYOUT; PEN_SET_CHECKSUM; PEN_SET_NONFINITE
 */
pen_status_t pen_tuning_commit(const pen_tuning_t *tuning, uint32_t layout, uint32_t length, pen_set_t *ready);

/**
 * A whole set (in flash, say), without copying it; an open set is dropped.
 * @return PEN_OK; PEN_SET_BUSY; PEN_SET_LAYOUT; PEN_SET_CHECKSUM; PEN_SET_NONFINITE; PEN_BADARG
 */
pen_status_t pen_tuning_select(const pen_tuning_t *tuning, uint32_t layout, uint32_t length, const pen_set_t *set,
                               pen_set_t *ready);

/**
 * The set that ran before; an open set is dropped.
 * @return PEN_OK; PEN_SET_BUSY; PEN_SET_NO_PREVIOUS; if it is no longer what it was PEN_SET_LAYOUT, PEN_SET_CHECKSUM
 */
pen_status_t pen_tuning_rollback(const pen_tuning_t *tuning, uint32_t layout, uint32_t length, pen_set_t *ready);

/** The slot that the next set will take: what belongs to it may be written. Stable while nothing is pending. */
uint32_t pen_tuning_spare(const pen_tuning_t *tuning);

/** Hand a ready set to the next step. */
void pen_tuning_announce(pen_tuning_t *tuning, const pen_set_t *ready);

/** Drop the open set. @return PEN_OK; PEN_SET_CLOSED */
pen_status_t pen_tuning_abort(pen_tuning_t *tuning);

/** Tell the step to hold state and outputs (true), or to go on from them (false). */
void pen_tuning_hold(pen_tuning_t *tuning, bool hold);

/** The head of the running set. */
pen_set_head_t pen_tuning_running(const pen_tuning_t *tuning);

/** CRC-32 of n values, as pen_set_head_t wants it. */
uint32_t pen_set_checksum(const pen_real_t value[], uint32_t n);

/**
 * For the step: adopt what is pending and say what to run with.
 * @param slot  0 or 1: the slot of the set now in force
 * @return PEN_OK, PEN_ADOPTED, PEN_HELD, or both
 * Cost: constant but for the adoption itself, which adds two stores and two barriers.
 */
pen_status_t pen_tuning_adopt(pen_tuning_t *tuning, uint32_t *slot);

#endif
