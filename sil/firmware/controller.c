/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "controller.h"

#include <stddef.h>

#include "penode/pen_port.h"

#ifndef CONTROLLER_EPK
#define CONTROLLER_EPK "penode" /* identifies the program: give each its own */
#endif

#define FIRST_ID 1000U /* of the sets that a master opens */

pen_xcp_t controller_xcp;

#ifdef EKF_HEADER /* the model file has a filter: what is calibrated is the model in it */
#include "controller_filter.h"
#define CONTROLLED filter.model
#else
#define CORE       MODEL
static MODEL(t) controller;
#define CONTROLLED controller
#endif

static CORE(banks_t) banks;
static pen_xcp_daq_t daq;

/* What a master may read, besides the instance. Written by the step. One region: a master may read neighbours at once. */
static struct {
    uint32_t sample;       /* steps so far                                      */
    uint32_t set_in_force; /* id of the set that the last step ran with         */
    uint32_t adopted_at;   /* the step, counted from 1, that last adopted a set */
    uint32_t late_steps;
    uint32_t step_status;  /* flags of the last step                            */
#ifdef MODEL_SENSORS
    MODEL(z_t) sensors;
#endif
#ifdef EKF_HEADER
    MODEL(ekf_estimate_t) estimate;
#endif
} shown;

#define TEXT_OF(name)  TEXT_OF_(name)
#define TEXT_OF_(name) #name
const char penode_epk[] = CONTROLLER_EPK;
static const char name_text[] = TEXT_OF(MODEL()); /* the model's name, which its A2L has too, and an underscore */

static pen_status_t commit(void)
{
    return CORE(tune_commit)(&CONTROLLED);
}
static pen_status_t choose(const pen_set_t *set)
{
    return CORE(tune_select)(&CONTROLLED, set);
}

#define REGIONS 4U
static pen_xcp_region_t region[REGIONS];
static pen_xcp_region_t name_region;
static pen_xcp_region_t epk_region;
static pen_xcp_region_t a2l_region;
static pen_xcp_config_t xcp_config = {
    .instance = &CONTROLLED.head,
    .layout = MODEL_SIZE(LAYOUT),
    .length = MODEL_SIZE(SET_LENGTH),
    .reference = &MODEL(set_default),
    .commit = commit,
    .select = choose,
    .id = FIRST_ID,
    .region = region,
    .daq = &daq,
    .daq_command = pen_xcp_daq_command,
};

static uint32_t address_of(const void *at)
{
    return (uint32_t)(uintptr_t)at;
}

static pen_xcp_region_t region_of(const void *at, uint32_t size)
{
    const pen_xcp_region_t found = { address_of(at), size, (const uint8_t *)at };

    return found;
}

static void declare(const void *at, uint32_t size)
{
    region[xcp_config.regions] = region_of(at, size);
    xcp_config.regions++;
}

static void declare_all(const controller_config_t *config)
{
#ifdef EKF_HEADER
    declare(&filter, sizeof(filter));
#else
    declare(&controller, sizeof(controller));
#endif
#ifdef MONITOR_HEADER
    declare(&monitor, sizeof(monitor));
#endif
    declare(&shown, sizeof(shown));
    declare(penode_epk, sizeof(penode_epk));
    name_region = region_of(name_text, sizeof(name_text) - 2U);
    epk_region = region_of(penode_epk, sizeof(penode_epk) - 1U);
    a2l_region = region_of(config->a2l, config->a2l_size);
    xcp_config.text[0] = &epk_region;
    xcp_config.text[1] = &name_region;
    xcp_config.text[4] = (config->a2l != NULL) ? &a2l_region : NULL;
    xcp_config.text[5] = &epk_region;
}

/* A period as XCP codes it: a count of up to 255, and 0 for 1 ns, 1 for 10 ns, ... 9 for 1 s; 0, not cyclic, if it is none. */
static void start_lists(const controller_config_t *config)
{
    const bool whole = (CONTROLLER_PERIOD % 1000U) == 0U; /* us */
    uint32_t cycle = (uint32_t)(whole ? (CONTROLLER_PERIOD / 1000U) : CONTROLLER_PERIOD);
    uint8_t unit = whole ? 3U : 0U;

    while ((unit < 9U) && (cycle > 0U) && ((cycle % 10U) == 0U)) {
        cycle /= 10U;
        unit++;
    }
    if ((cycle > 255U) || (!whole && (CONTROLLER_PERIOD > UINT32_MAX))) {
        cycle = 0U;
        unit = 0U;
    }
    pen_xcp_daq_init(&daq, config->ring, config->slots, config->max_cto, (uint8_t)cycle, unit);
}

/* The model's time in microseconds: no error adds up. Wraps. */
static uint32_t elapsed(void)
{
    static uint32_t time;
    static uint32_t rest; /* ns */

    rest += (uint32_t)(CONTROLLER_PERIOD % 1000U);
    time += (uint32_t)(CONTROLLER_PERIOD / 1000U) + (rest / 1000U);
    rest %= 1000U;
    return time;
}

bool controller_start(const controller_config_t *config)
{
    declare_all(config);
    xcp_config.address = address_of(MODEL(set_default).value);
    xcp_config.max_cto = config->max_cto;
    xcp_config.quiet = config->quiet;
    shown.set_in_force = MODEL(set_default).head.id;
    start_lists(config);
#ifdef EKF_HEADER
    const pen_status_t status = filter_start(&banks);
#else
    const pen_status_t status = MODEL(init)(&controller, &MODEL(set_default), &banks);
#endif
    return (status == PEN_OK) && (pen_xcp_init(&controller_xcp, &xcp_config) == PEN_OK);
}

void controller_step(const MODEL(u_t) *u, bool late)
{
    const uint32_t now = shown.sample + 1U;
#ifdef EKF_HEADER
    const pen_status_t status = filter_step(u, &shown.sensors, &shown.estimate);
#else
    MODEL(y_t) y;
    const pen_status_t status = MODEL(step)(&controller, u, &y);
#endif

    if ((status & PEN_ADOPTED) != PEN_OK) {
        pen_set_head_t running;
        (void)CORE(tune_running)(&CONTROLLED, &running);
        shown.set_in_force = running.id;
        shown.adopted_at = now;
    }
#if defined(MODEL_SENSORS) && !defined(EKF_HEADER)
    (void)MODEL(sensors)(&controller, &shown.sensors);
#endif
    shown.step_status = status;
    shown.late_steps += late ? 1U : 0U;
    pen_port_store(&shown.sample, now);
    pen_xcp_sample(&controller_xcp, elapsed());
}

uint32_t controller_samples(void)
{
    return pen_port_load(&shown.sample);
}
uint32_t controller_late(void)
{
    return pen_port_load(&shown.late_steps);
}
