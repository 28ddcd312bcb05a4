/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * What every generated model has in common: the head of an instance, the description of a model, and the tuning half of
 * its interface. Generated code calls these functions with its own description; an application calls NAME_...
 *
 * A new set passes the same stages in NAME_tune_commit, _select and _rollback:
 *   checked      layout, length, checksum, every value finite: penode/pen_set.h
 *   prepared     networks folded, promises of the model file checked, tried on the last samples: pen_prepare, NAME_prepare
 *   published    for the next step: pen_tune_publish
 *
 * The guard. NAME_verify, called from the tuning context as often as there is time, compares the running set and its
 * folded pieces with their checksums, and heads and addresses with their copies. It checks n values a call; a round is
 * NAME_VERIFY values. Damage, finite or not, is reported with PEN_SET_DAMAGED: by the next call if in a head or an
 * address; else at the end of this round, or of the next one if this round has already passed the place: within
 * 2 * NAME_VERIFY / n calls. What follows is `on_damage` of the model file:
 *   report    only the flag
 *   hold      the step also holds, until NAME_tune_hold(self, false)
 *   rollback  the rollback set is published, or the set given to init if that is damaged as well; else the step holds
 * While a set is open or pending, the guard only reports; which slot runs is checked while none is pending.
 */
#ifndef PEN_INSTANCE_H
#define PEN_INSTANCE_H

#include <stdbool.h>
#include <stdint.h>

#include "penode/pen_fold.h"
#include "penode/pen_promise.h"
#include "penode/pen_real.h"
#include "penode/pen_set.h"
#include "penode/pen_status.h"

#ifdef __cplusplus
extern "C" {
#endif

/** A network of the sets that is folded or has promises. */
typedef struct {
    pen_chain_t chain;
    uint32_t at;                  /* where its values begin in a set */
    const pen_promise_t *promise; /* NULL: none                      */
} pen_network_t;

/** What the runtime needs to know of a model. Constant, in flash. */
typedef struct {
    uint32_t layout;              /* fingerprint that every set must carry                            */
    uint32_t length;              /* values of a set                                                  */
    uint32_t source;              /* fingerprint of the model file: models may share sets             */
    uint32_t on_damage;           /* one of PEN_DAMAGE_...                                            */
    bool clamp;                   /* outside of the trust envelope: true: clamp; false: extrapolate   */
    bool layers;                  /* too many pieces: true: layer by layer; false: refuse             */
    uint32_t pieces;              /* capacity of a folded network; 0: none is folded                  */
    uint32_t networks;            /* of network[]; if one is folded, all of them are                  */
    const pen_network_t *network; /* [networks]                                                       */
    uint32_t sets;                /* of the model file                                                */
    const pen_set_t *const *set;  /* [sets]                                                           */
} pen_model_t;

#define PEN_DAMAGE_REPORT   0U
#define PEN_DAMAGE_HOLD     1U
#define PEN_DAMAGE_ROLLBACK 2U

/** Progress of the guard. Used by the tuning context only. */
typedef struct {
    uint32_t at;        /* next value of the round                              */
    uint32_t crc;       /* of the values before it                              */
    uint32_t slot;      /* checked in this round                                */
    uint32_t pieces[2]; /* checksums of the folded pieces of the slots          */
} pen_guard_t;

/** The head of an instance. Owned by it; use it only through the functions of the model. */
typedef struct {
    uint32_t ready;   /* layout of the model once initialised                              */
    uint32_t scrub;   /* what the next step checks for NaN and Inf                         */
    uint32_t running; /* 1 after the first good sample, 3 after the second, ...            */
    pen_tuning_t tuning;
    pen_guard_t guard;
    pen_breach_t breach; /* of the last set that broke a promise                              */
    pen_status_log_t log;
} pen_instance_t;

/** True if the instance was initialised for this model. @param self  NULL allowed */
bool pen_usable(const pen_model_t *model, const pen_instance_t *self);

/* ---- the tuning half: as in penode/pen_set.h; also counted, and PEN_SET_BADARG if the instance is not usable ---- */

/** Give a new instance its set and up to two banks [model->length], or NULL. @return as pen_tuning_init */
pen_status_t pen_init(const pen_model_t *model, pen_instance_t *self, const pen_set_t *set, pen_real_t bank0[], pen_real_t bank1[]);
/** Then make it usable if `found` is PEN_OK. @param piece  of both slots, or NULL if nothing is folded. @return found */
pen_status_t pen_ready(const pen_model_t *model, pen_instance_t *self, const pen_piece_t piece[], pen_status_t found);

pen_status_t pen_tune_begin(const pen_model_t *model, pen_instance_t *self, const pen_set_head_t *head); /* PEN_SET_BUSY, PEN_SET_LAYOUT */
pen_status_t pen_tune_begin_copy(const pen_model_t *model, pen_instance_t *self, uint32_t id); /* of the running set; errors as begin */
/** Values [offset, offset + n) of the open set, in order. @return PEN_OK; PEN_SET_CLOSED; PEN_SET_RANGE; PEN_SET_BADARG */
pen_status_t pen_tune_write(const pen_model_t *model, pen_instance_t *self, uint32_t offset, const pen_real_t value[], uint32_t n);
/** The same in bytes of the serial form (penode/pen_serial.h): offset and n count bytes, nothing need be aligned. */
pen_status_t pen_tune_write_bytes(const pen_model_t *model, pen_instance_t *self, uint32_t offset, const uint8_t byte[], uint32_t n);
pen_status_t pen_tune_abort(const pen_model_t *model, pen_instance_t *self); /* the open set; PEN_SET_CLOSED: none is open */
pen_status_t pen_tune_withdraw(const pen_model_t *model, pen_instance_t *self); /* a published set; PEN_SET_IDLE: none */
pen_status_t pen_tune_hold(const pen_model_t *model, pen_instance_t *self, bool hold); /* state and outputs, from the next step on */
pen_status_t pen_tune_expect(const pen_model_t *model, pen_instance_t *self, uint32_t checksum); /* of the open set; PEN_SET_CLOSED */
pen_status_t pen_tune_pending(const pen_model_t *model, const pen_instance_t *self, bool *pending); /* waits for the next step? */
/** The head of the set in force. @return PEN_OK; PEN_SET_BADARG */
pen_status_t pen_tune_running(const pen_model_t *model, const pen_instance_t *self, pen_set_head_t *head);

/* These three return the checked set in *ready; pen_tune_publish counts the result. */
pen_status_t pen_tune_commit(const pen_model_t *model, pen_instance_t *self, pen_set_t *ready);
/** A whole set, for example in flash, without a copy; an open set is dropped. @return also PEN_SET_BUSY; PEN_SET_BADARG */
pen_status_t pen_tune_select(const pen_model_t *model, pen_instance_t *self, const pen_set_t *set, pen_set_t *ready);
/** The set that ran before; an open set is dropped. @return also PEN_SET_BUSY; PEN_SET_NO_PREVIOUS */
pen_status_t pen_tune_rollback(const pen_model_t *model, pen_instance_t *self, pen_set_t *ready);

/** Publish `ready` if `found` is PEN_OK, and count. @param piece  of the inactive slot; NULL if nothing is folded. @return found */
pen_status_t pen_tune_publish(const pen_model_t *model, pen_instance_t *self, const pen_piece_t piece[], const pen_set_t *ready,
                              pen_status_t found);

/**
 * Fold the networks of a set, and check the promises of the model file (penode/pen_promise.h).
 * @param value  [model->length]
 * @param work   [8 * the widest layer] work space; [4 * the widest layer] where nothing is promised
 * @param active [most neurons of one network] work space
 * @param piece  [networks * pieces]; NULL if nothing is folded
 * @param breach written if a promise is broken
 * @return PEN_OK; PEN_SET_PIECES; PEN_SET_PROMISE
 */
pen_status_t pen_prepare(const pen_model_t *model, const pen_real_t value[], pen_real_t work[], bool active[], pen_piece_t piece[],
                         pen_breach_t *breach);

/** Promise and place of the last PEN_SET_PROMISE. Tuning context. @return PEN_OK; PEN_SET_BADARG */
pen_status_t pen_tune_breach(const pen_model_t *model, const pen_instance_t *self, pen_breach_t *breach);

/** Read and clear the counters. Any one context; counts nothing itself. @return PEN_OK; PEN_BADARG */
pen_status_t pen_instance_status(const pen_model_t *model, pen_instance_t *self, pen_status_report_t *report);

/** Add a piece to a CRC-32, as pen_crc_values; checksum of all pieces of a slot, [networks * pieces]. */
uint32_t pen_piece_crc(uint32_t crc, const pen_piece_t *piece);
uint32_t pen_pieces_crc(const pen_model_t *model, const pen_piece_t piece[]); /* of all pieces of a slot */

/**
 * Check up to n values of the running set and its pieces. Tuning context.
 * @param piece  of both slots, [2 * networks * pieces]; NULL if nothing is folded
 * @return PEN_OK; PEN_SET_DAMAGED; PEN_SET_BADARG
 * Cost: about 10 instructions a byte of the set, 16 bytes a piece; if damage is found, a whole round to confirm it.
 */
pen_status_t pen_verify(const pen_model_t *model, pen_instance_t *self, const pen_piece_t piece[], uint32_t n);

/**
 * The set to run instead of a damaged one: the rollback set (rank 0), the set given to init (rank 1).
 * @return PEN_OK: *ready is valid; PEN_SET_BUSY: a set is open or pending; PEN_SET_NO_PREVIOUS; as pen_set_check
 */
pen_status_t pen_fallback(const pen_model_t *model, pen_instance_t *self, uint32_t rank, pen_set_t *ready);

/**
 * PEN_OK: publish the fallback; PEN_SET_BUSY: do nothing; else hold. The damaged set is not kept for rollback. Banks whose
 * address is damaged are given up: sets can only be selected until the next init.
 */
void pen_recover(const pen_model_t *model, pen_instance_t *self, const pen_piece_t piece[], const pen_set_t *ready, pen_status_t found);

#ifdef __cplusplus
}
#endif

#endif
