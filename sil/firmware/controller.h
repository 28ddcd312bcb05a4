/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * A controller that a calibration tool connects to: one instance of any generated model, an XCP slave, and what may be read.
 * The options of sample.h select the model; CONTROLLER_EPK, a text, identifies the program. Where the model file
 * has a filter, the controller steps that: controller_filter.h.
 *
 * Addresses are those of the program: on a host, link it with -no-pie.
 */
#ifndef CONTROLLER_H
#define CONTROLLER_H

#include <stdbool.h>
#include <stdint.h>

#include "sample.h"

#include "penode/pen_xcp_daq.h"

/* Between two steps, in ns; given as an option where a float cannot represent it. */
#ifndef CONTROLLER_PERIOD
#define CONTROLLER_PERIOD (UINT64_C(1000) * (uint32_t)((MODEL_SIZE(SAMPLE_TIME) * (pen_real_t)1e6) + (pen_real_t)0.5))
#endif

/** How the slave is reached. */
typedef struct {
    uint32_t max_cto; /* bytes of the longest packet                                   */
    uint32_t quiet;   /* ms after the last DOWNLOAD, until it comes into force; 0: off */
    uint8_t *ring;    /* [slots * (max_cto + 1)] of DAQ lists                          */
    uint32_t slots;
    const uint8_t *a2l;     /* [a2l_size] that GET_ID offers; NULL: none                     */
    uint32_t a2l_size;
} controller_config_t;

extern pen_xcp_t controller_xcp;

/** Before the first step. @return false: the model or the slave refused */
bool controller_start(const controller_config_t *config);

/** One step, then the DAQ lists. Context: step. @param late  true: it came too late; counted */
void controller_step(const MODEL(u_t) *u, bool late);

/** Steps so far, and those that came late. */
uint32_t controller_samples(void);
uint32_t controller_late(void);

#endif
