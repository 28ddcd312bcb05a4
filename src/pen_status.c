/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "penode/pen_status.h"

#include <stddef.h>

#include "penode/pen_port.h"

void pen_status_clear(pen_status_log_t *log)
{
    for (size_t i = 0U; i < PEN_STATUS_FLAGS; i++) {
        pen_port_store(&log->count[i], 0U);
        log->seen[i] = 0U;
    }
}

/* In every step, so unrolled: four instructions a flag. */
void pen_status_note_step(pen_status_log_t *log, pen_status_t status)
{
    uint32_t *const count = log->count;

    pen_port_store(&count[0], pen_port_load(&count[0]) + (status & 1U));
    pen_port_store(&count[1], pen_port_load(&count[1]) + ((status >> 1U) & 1U));
    pen_port_store(&count[2], pen_port_load(&count[2]) + ((status >> 2U) & 1U));
    pen_port_store(&count[3], pen_port_load(&count[3]) + ((status >> 3U) & 1U));
    pen_port_store(&count[4], pen_port_load(&count[4]) + ((status >> 4U) & 1U));
    pen_port_store(&count[5], pen_port_load(&count[5]) + ((status >> 5U) & 1U));
    pen_port_store(&count[6], pen_port_load(&count[6]) + ((status >> 6U) & 1U));
    pen_port_store(&count[7], pen_port_load(&count[7]) + ((status >> 7U) & 1U));
}

void pen_status_note_tune(pen_status_log_t *log, pen_status_t status)
{
    for (uint32_t flag = PEN_STATUS_STEP; flag < PEN_STATUS_FLAGS; flag++) {
        pen_port_store(&log->count[flag], pen_port_load(&log->count[flag]) + ((status >> flag) & 1U));
    }
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
