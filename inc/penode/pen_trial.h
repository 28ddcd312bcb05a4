/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * The trial of a set before it is adopted (`trial` of the model file): the step keeps its last samples in a ring; a
 * tuning call then simulates them on copies of the model, with the new set and the running one. For generated code.
 *
 * The ring has room for three samples more than a trial uses. After a tuning call has closed it, a step in progress on
 * the same core may still write one sample; on another core two, and begin a third: what the trial reads does not
 * change. Samples during a trial are not kept; the ring then restarts, as it does after a held sample.
 *
 * Cost per step: a copy of its states and inputs, and some 20 instructions. Cost of a trial: two steps per sample.
 */
#ifndef PEN_TRIAL_H
#define PEN_TRIAL_H

#include <stdbool.h>
#include <stdint.h>

#include "penode/pen_port.h"
#include "penode/pen_status.h"

#ifdef __cplusplus
extern "C" {
#endif

/** The ring of an instance, without its samples. */
typedef struct {
    volatile uint32_t written; /* samples kept so far; wraps; written by the step               */
    volatile uint32_t first;   /* oldest sample without a gap since; written by the step        */
    volatile uint32_t closed;  /* 1 during a trial; written by the tuning context               */
} pen_trial_t;

/** The samples a trial may use: first, first + 1, ... last - 1, each at its number modulo the size of the ring. */
typedef struct {
    uint32_t first;
    uint32_t last;
} pen_trial_span_t;

/** Step context, after a sample was written to the ring: count it, or restart the ring if it is closed or the step held. */
static inline void pen_trial_keep(pen_trial_t *trial, bool advanced)
{
    const uint32_t open = (pen_port_load(&trial->closed) == 0U) ? 1U : 0U;
    const uint32_t next = pen_port_load(&trial->written) + (advanced ? open : 0U);

    pen_port_barrier(); /* the sample is there before it counts */
    pen_port_store(&trial->first, ((open == 1U) && advanced) ? pen_port_load(&trial->first) : next);
    pen_port_store(&trial->written, next);
}

/** Tuning context: close the ring, and return its newest samples without a gap, `most` at most. */
static inline void pen_trial_close(pen_trial_t *trial, uint32_t most, pen_trial_span_t *span)
{
    uint32_t first;
    uint32_t kept;

    pen_port_store(&trial->closed, 1U);
    pen_port_barrier();
    first = pen_port_load(&trial->first); /* before `written`: it is never ahead of that */
    pen_port_barrier();
    span->last = pen_port_load(&trial->written);
    pen_port_barrier();
    kept = (first == pen_port_load(&trial->first)) ? (span->last - first) : 0U; /* else there was a gap just now */
    kept = (kept > most) ? most : kept;
    span->first = span->last - kept;
}

/** Tuning context: let the step keep samples again. */
static inline void pen_trial_open(pen_trial_t *trial)
{
    pen_port_barrier();
    pen_port_store(&trial->closed, 0U);
}

#ifdef __cplusplus
}
#endif

#endif
