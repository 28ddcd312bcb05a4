/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * One status type for the whole library: flags that add up, 0 is good.
 *
 * Each flag is also counted. A counter has one writer: the step's context counts PEN_STATUS_STEP, the tuning context
 * counts PEN_STATUS_TUNE. A reader in a third place never writes a shared word, so nothing is lost or counted twice,
 * whoever pre-empts whom.
 *
 * NaN and Inf in memory: the step that meets one says so. But a bound of a trust envelope is only compared with, and of
 * a folded network one piece is in use. So each step also looks at one number of the running set and at one piece of
 * each folded network, the next step at the next: the patrol. Any NaN or Inf is said within NAME_PATROL steps, a
 * constant of the generated header: the length of a set, or the room for pieces if that is more. Where steps read pieces
 * only it looks at pieces only: the weights that they were made of are checked when they are next folded. A good set
 * may have pieces so far out that they overflow: that is said, too. It costs the same wherever it is; what it takes is
 * in the figures of the step.
 */
#ifndef PEN_STATUS_H
#define PEN_STATUS_H

#include <stdbool.h>
#include <stdint.h>

typedef uint32_t pen_status_t;

#define PEN_OK UINT32_C(0)

/* Raised by a step. */
#define PEN_INPUT_NONFINITE  UINT32_C(0x00001) /* an input is NaN or Inf; state and outputs held                      */
#define PEN_STATE_NONFINITE  UINT32_C(0x00002) /* the state was NaN or Inf; the last good state is back, outputs held */
#define PEN_STEP_NONFINITE   UINT32_C(0x00004) /* NaN or Inf arose inside (weight, overflow); state and outputs held  */
#define PEN_SINGULAR         UINT32_C(0x00008) /* a linear solve met a singular matrix; state and outputs held        */
#define PEN_OUTSIDE          UINT32_C(0x00010) /* a network input left its trust envelope; treated as the model says  */
#define PEN_HELD             UINT32_C(0x00020) /* no step taken, as told by the tuning context                        */
#define PEN_ADOPTED          UINT32_C(0x00040) /* a new parameter set is in force from this step on                   */
#define PEN_BADARG           UINT32_C(0x00080) /* NULL, or an instance that was not initialised; nothing written      */
#define PEN_WEIGHT_NONFINITE UINT32_C(0x00100) /* the patrol met NaN or Inf in the running set; nothing held          */

/* Raised by a tuning call; the running set is untouched. */
#define PEN_SET_BUSY         UINT32_C(0x00200) /* a committed set still waits for the next step                       */
#define PEN_SET_CLOSED       UINT32_C(0x00400) /* no set is open: begin was not called, or it is already committed    */
#define PEN_SET_RANGE        UINT32_C(0x00800) /* a chunk leaves a gap or runs past the end                           */
#define PEN_SET_SHORT        UINT32_C(0x01000) /* commit before the last value was written                            */
#define PEN_SET_CHECKSUM     UINT32_C(0x02000) /* values do not match the checksum in the head                        */
#define PEN_SET_NONFINITE    UINT32_C(0x04000) /* a value is NaN or Inf                                               */
#define PEN_SET_LAYOUT       UINT32_C(0x08000) /* made for another model, layout version or real type                 */
#define PEN_SET_NO_PREVIOUS  UINT32_C(0x10000) /* rollback: the previous set is gone                                  */
#define PEN_SET_PIECES       UINT32_C(0x20000) /* a network has more pieces than there is room for                    */

#define PEN_STATUS_FLAGS 18U /* flags above, and counters                                   */
#define PEN_STATUS_STEP   9U /* the first 9 flags are a step's, the others a tuning call's  */
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

/** Count the flags of a step, the others are ignored; for the step's context only. Cost: 49 instructions, at -Os 88. */
void pen_status_note_step(pen_status_log_t *log, pen_status_t status);

/** Count the flags of a tuning call, the others are ignored; for the tuning context only. */
void pen_status_note_tune(pen_status_log_t *log, pen_status_t status);

/**
 * Read and clear: everything raised since the last read. One reader; any context. What is raised during the call is in
 * this report or in the next. At most 2^32 - 1 steps between two reads: then a counter has come round.
 */
void pen_status_read(pen_status_log_t *log, pen_status_report_t *report);

#endif
