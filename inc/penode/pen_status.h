/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * One status type for the whole library: flags that are ORed; 0 is good.
 *
 * Each flag is also counted. A counter has one writer: the step's context counts the flags of a step, the tuning
 * context those of a tuning call. A reader in a third context writes no shared word, so nothing is lost or counted
 * twice, whichever context pre-empts another.
 *
 * NaN and Inf in memory: a step whose result is affected reports it. But a bound of a trust envelope is only compared,
 * and only one piece of a folded network is in use. So each step also checks, at constant cost, one value of the running
 * set, if steps read values, and one piece of each folded network: the scrub, a round of NAME_SCRUB steps. Pieces of a
 * good set that overflow far out are reported too. Damage that stays finite is found by NAME_verify: pen_instance.h.
 */
#ifndef PEN_STATUS_H
#define PEN_STATUS_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef uint32_t pen_status_t;

#define PEN_OK UINT32_C(0)

/* Raised by a step. */
#define PEN_INPUT_NONFINITE  UINT32_C(0x000001) /* an input is NaN or Inf; state and outputs held                      */
#define PEN_STATE_NONFINITE  UINT32_C(0x000002) /* the state was NaN or Inf; last good one restored, outputs held      */
#define PEN_STEP_NONFINITE   UINT32_C(0x000004) /* NaN or Inf arose inside (weight, overflow); state and outputs held  */
#define PEN_SINGULAR         UINT32_C(0x000008) /* a linear solve met a singular matrix; state and outputs held        */
#define PEN_OUTSIDE          UINT32_C(0x000010) /* a network input left its trust envelope; treated as the model says  */
#define PEN_HELD             UINT32_C(0x000020) /* no step taken: hold requested, or set by NAME_verify                */
#define PEN_ADOPTED          UINT32_C(0x000040) /* a new parameter set is in force from this step on                   */
#define PEN_BADARG           UINT32_C(0x000080) /* NULL, or an instance that was not initialised; nothing written      */
#define PEN_WEIGHT_NONFINITE UINT32_C(0x000100) /* the scrub met NaN or Inf in the running set; nothing held           */
#define PEN_INPUT_RANGE      UINT32_C(0x000200) /* an input left its declared range; treated as the model says         */
#define PEN_WITHDRAWN        UINT32_C(0x000400) /* a committed set was withdrawn before it came into force             */

/* Raised by a tuning call. Refused calls leave the running set as it is. */
#define PEN_SET_BUSY        UINT32_C(0x000800)  /* a committed set still waits for the next step                       */
#define PEN_SET_CLOSED      UINT32_C(0x001000)  /* no set is open: begin was not called, or it is already committed    */
#define PEN_SET_RANGE       UINT32_C(0x002000)  /* a chunk leaves a gap or runs past the end                           */
#define PEN_SET_SHORT       UINT32_C(0x004000)  /* commit before the last value was written                            */
#define PEN_SET_CHECKSUM    UINT32_C(0x008000)  /* values do not match the checksum in the head                        */
#define PEN_SET_NONFINITE   UINT32_C(0x010000)  /* a value is NaN or Inf                                               */
#define PEN_SET_LAYOUT      UINT32_C(0x020000)  /* made for another model, layout version or real type                 */
#define PEN_SET_NO_PREVIOUS UINT32_C(0x040000)  /* rollback: there is no rollback set                                  */
#define PEN_SET_PIECES      UINT32_C(0x080000)  /* a network has more pieces than there is room for                    */
#define PEN_SET_BADARG      UINT32_C(0x100000)  /* NULL, no banks, or an instance that was not initialised             */
#define PEN_SET_PROMISE     UINT32_C(0x200000)  /* a network breaks a promise of the model file                        */
#define PEN_SET_TRIAL       UINT32_C(0x400000)  /* the trial over the last samples failed                              */
#define PEN_SET_DAMAGED     UINT32_C(0x800000)  /* verify: the running set or its pieces have changed in memory        */
#define PEN_SET_IDLE        UINT32_C(0x1000000) /* withdraw: no committed set waits                                   */

#define PEN_STATUS_FLAGS 25U /* flags above, and counters                                    */
#define PEN_STATUS_STEP  11U /* the first 11 flags are a step's, the others a tuning call's  */

/* The step did not advance: state and outputs are held. */
#define PEN_HOLDING (PEN_INPUT_NONFINITE | PEN_STATE_NONFINITE | PEN_STEP_NONFINITE | PEN_SINGULAR | PEN_HELD | PEN_BADARG)

/* Three kinds of flag. Faults need a reaction; warnings mean that results are less certain; events were requested.
 * A refused tuning call is none of them: its return value tells the caller. */
#define PEN_FAULTS \
    (PEN_INPUT_NONFINITE | PEN_STATE_NONFINITE | PEN_STEP_NONFINITE | PEN_SINGULAR | PEN_BADARG | PEN_WEIGHT_NONFINITE | PEN_SET_DAMAGED)
#define PEN_WARNINGS (PEN_OUTSIDE | PEN_INPUT_RANGE)
#define PEN_EVENTS   (PEN_HELD | PEN_ADOPTED | PEN_WITHDRAWN)

/** True if the step advanced: state and outputs are of this sample (there may still be warnings and events). */
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
    pen_status_t flags;               /* sticky: every flag raised at least once                    */
    uint32_t times[PEN_STATUS_FLAGS]; /* how often, in the order of the flags: read by pen_status_times */
} pen_status_report_t;

/** How often `flag`, one of the flags above, was raised: pen_status_times(&report, PEN_OUTSIDE). 0 for anything else. */
uint32_t pen_status_times(const pen_status_report_t *report, pen_status_t flag);

/** Clear all counters. No other context may use the log meanwhile. */
void pen_status_clear(pen_status_log_t *log);

/** Count the flags of a step and ignore the others; for the step's context only. Cost: 59 instructions, at -Os 92. */
void pen_status_note_step(pen_status_log_t *log, pen_status_t status);

/** Count the flags of a tuning call and ignore the others; for the tuning context only. */
void pen_status_note_tune(pen_status_log_t *log, pen_status_t status);

/**
 * Read and clear: everything raised since the last read. One reader; any context. What is raised during the call is in
 * this report or in the next. Read at least every 2^32 - 1 steps: then a counter wraps.
 */
void pen_status_read(pen_status_log_t *log, pen_status_report_t *report);

#ifdef __cplusplus
}
#endif

#endif
