/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * A whole instance as bytes without addresses: state, inputs, sets and banks, a pending exchange, counters. Little
 * endian on every core. A restored instance continues with the same bits. For generated code; applications call
 * NAME_save and NAME_restore.
 * A set is recorded by its place: a bank (whose values are saved), the set given to init, or one of the sets of the
 * model file. An instance that runs any other set, or may roll back to one, cannot be saved.
 */
#ifndef PEN_SAVED_H
#define PEN_SAVED_H

#include <stddef.h>
#include <stdint.h>

#include "penode/pen_instance.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Bytes besides the values: four words of a head, nine of the exchange, five sets of five, the counters, a CRC. */
#define PEN_SAVED_HEAD (4U * (4U + 9U + 25U + (2U * PEN_STATUS_FLAGS) + 1U))

/**
 * @param row   [rows] states and outputs; @param u  [inputs] inputs
 * @param size  of byte[]: PEN_SAVED_HEAD + sizeof(pen_real_t) * (rows + inputs + 2 * model->length)
 * @return PEN_OK; PEN_SET_BADARG: NULL, not initialised, too little room, or a set that restore would not find
 */
pen_status_t pen_save(const pen_model_t *model, const pen_instance_t *self, uint32_t rows, const pen_real_t row[], uint32_t inputs,
                      const pen_real_t u[], uint8_t byte[], size_t size);

/**
 * Restore an instance that was initialised, with banks if the saved one had banks. A refused call changes nothing.
 * The caller then folds the networks of both slots and calls pen_restored.
 * @return PEN_OK; PEN_SET_BADARG; PEN_SET_LAYOUT: saved by another model or real type, or with another set given to
 *         init, or that in a bank, or a set of the model file has changed; PEN_SET_CHECKSUM: damaged
 */
pen_status_t pen_restore(const pen_model_t *model, pen_instance_t *self, uint32_t rows, pen_real_t row[], uint32_t inputs, pen_real_t u[],
                         const uint8_t byte[], size_t size);

/** Recompute the checksums of the pieces of both slots. @param piece  [2 * networks * pieces] */
void pen_restored(const pen_model_t *model, pen_instance_t *self, const pen_piece_t piece[]);

#ifdef __cplusplus
}
#endif

#endif
