/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * One status type for the whole library: flags that add up, 0 is good.
 *
 * Each flag is also counted. A counter has one writer: the step's context counts PEN_STATUS_STEP, the tuning context
 * counts PEN_STATUS_TUNE. A reader in a third place never writes a shared word, so nothing is lost or counted twice,
 * whoever pre-empts whom.
 */
#ifndef PEN_STATUS_H
#define PEN_STATUS_H

#include <stdbool.h>
#include <stdint.h>

typedef uint32_t pen_status_t;

#define PEN_OK UINT32_C(0)

/* Raised by a step. */
#define PEN_INPUT_NONFINITE UINT32_C(0x0001) /* an input is NaN or Inf; state and outputs held                      */
#define PEN_STATE_NONFINITE UINT32_C(0x0002) /* the state was NaN or Inf; the last good state is back, outputs held */
#define PEN_STEP_NONFINITE  UINT32_C(0x0004) /* NaN or Inf arose inside (weight, overflow); state and outputs held  */
#define PEN_SINGULAR        UINT32_C(0x0008) /* a linear solve met a singular matrix; state and outputs held        */
#define PEN_OUTSIDE         UINT32_C(0x0010) /* a network input left its trust envelope; treated as the model says  */
#define PEN_HELD            UINT32_C(0x0020) /* no step taken, as told by the tuning context                        */
#define PEN_ADOPTED         UINT32_C(0x0040) /* a new parameter set is in force from this step on                   */
#define PEN_BADARG          UINT32_C(0x0080) /* NULL, or an instance that was not initialised; nothing written      */

/* Raised by a tuning call; the running set is untouched. */
#define PEN_SET_BUSY        UINT32_C(0x0100) /* a committed set still waits for the next step                       */
#define PEN_SET_CLOSED      UINT32_C(0x0200) /* no set is open: begin was not called, or it is already committed    */
#define PEN_SET_RANGE       UINT32_C(0x0400) /* a chunk leaves a gap or runs past the end                           */
#define PEN_SET_SHORT       UINT32_C(0x0800) /* commit before the last value was written                            */
#define PEN_SET_CHECKSUM    UINT32_C(0x1000) /* values do not match the checksum in the head                        */
#define PEN_SET_NONFINITE   UINT32_C(0x2000) /* a value is NaN or Inf                                               */
#define PEN_SET_LAYOUT      UINT32_C(0x4000) /* made for another model, layout version or real type                 */
#define PEN_SET_NO_PREVIOUS UINT32_C(0x8000) /* rollback: the previous set is gone                                  */
#define PEN_SET_PIECES     UINT32_C(0x10000) /* a network has more pieces than there is room for                    */

#define PEN_STATUS_FLAGS 17U /* flags above, and counters                                                  */
#define PEN_STATUS_STEP   8U /* the first 8 flags are a step's, the others a tuning call's                  */
#define PEN_HOLDING \
    (PEN_INPUT_NONFINITE | PEN_STATE_NONFINITE | PEN_STEP_NONFINITE | PEN_SINGULAR | PEN_HELD | PEN_BADARG)

/** True if the step advanced: state and outputs are of this sample (they may still be PEN_OUTSIDE). */
static inline bool pen_advanced(pen_status_t status)
{
    return (status & PEN_HOLDING) == PEN_OK;
}

/** Counters of one instance; owned by it. `seen` belongs to the reader. */
typedef struct {
    uint32_t count[PEN_STATUS_FLAGS]; /* how often each flag was raised since init; wraps */
    uint32_t seen[PEN_STATUS_FLAGS];  /* the same, at the last read                       */
} pen_status_log_t;

/** What was raised since the last read. */
typedef struct {
    pen_status_t flags;                  /* sticky: every flag raised at least once */
    uint32_t     times[PEN_STATUS_FLAGS]; /* how often, in the order of the flags    */
} pen_status_report_t;

/** Clear all counters. Not while another context uses the log. */
void pen_status_clear(pen_status_log_t *log);

/** Count the flags of a step, the others are ignored; for the step's context only. Cost: 6 instructions a flag, at -Os 10. */
void pen_status_note_step(pen_status_log_t *log, pen_status_t status);

/** Count the flags of a tuning call, the others are ignored; for the tuning context only. */
void pen_status_note_tune(pen_status_log_t *log, pen_status_t status);

/**
 * Read and clear: everything raised since the last read. One reader; any context. What is raised during the call is in
 * this report or in the next. At most 2^32 - 1 steps between two reads: then a counter has come round.
 */
void pen_status_read(pen_status_log_t *log, pen_status_report_t *report);

#endif
