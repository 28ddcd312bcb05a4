/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "penode/pen_exact.h"

#include "penode/pen_status.h"

#include <stddef.h>

#include "penode/pen_port.h"

uint32_t pen_status_times(const pen_status_report_t *report, pen_status_t flag)
{
    uint32_t times = 0U;

    for (size_t i = 0U; i < PEN_STATUS_FLAGS; i++) {
        times += (flag == (UINT32_C(1) << i)) ? report->times[i] : 0U;
    }
    return times;
}

void pen_status_clear(pen_status_log_t *log)
{
    for (size_t i = 0U; i < PEN_STATUS_FLAGS; i++) {
        pen_port_store(&log->count[i], 0U);
        log->seen[i] = 0U;
    }
}

/* The counters of `flags` flags from the one at `first` on. */
PEN_PORT_INLINE void note(volatile uint32_t first[], uint32_t flags, pen_status_t status)
{
    pen_status_t left = status;

    PEN_PORT_UNROLL
    for (uint32_t i = 0U; i < flags; i++) {
        pen_port_store(&first[i], pen_port_load(&first[i]) + (left & 1U));
        left >>= 1U;
    }
}

void pen_status_note_step(pen_status_log_t *log, pen_status_t status)
{
    note(&log->count[0], PEN_STATUS_STEP, status);
}

void pen_status_note_tune(pen_status_log_t *log, pen_status_t status)
{
    note(&log->count[PEN_STATUS_STEP], PEN_STATUS_FLAGS - PEN_STATUS_STEP, status >> PEN_STATUS_STEP);
}

void pen_status_read(pen_status_log_t *log, pen_status_report_t *report)
{
    report->flags = PEN_OK;
    for (size_t i = 0U; i < PEN_STATUS_FLAGS; i++) {
        const uint32_t now = pen_port_load(&log->count[i]);
        const uint32_t times = now - log->seen[i];
        report->times[i] = times;
        report->flags |= (times > 0U) ? (UINT32_C(1) << i) : PEN_OK;
        log->seen[i] = now;
    }
}
