/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "penode/pen_exact.h"

#include "penode/pen_xcp_daq.h"

#include <stddef.h>

#include "penode/pen_port.h"
#include "penode/pen_xcp_parts.h"

#define XCP_TIME_SIZE  4U
#define XCP_RUNS       0x40U
#define XCP_PROPERTIES 0x93U /* dynamic, prescaler, time stamps, overload as event */
#define XCP_TIME_MODE  0x34U /* 4 bytes, 1 us */

void pen_xcp_daq_init(pen_xcp_daq_t *daq, uint8_t ring[], uint32_t slots, uint32_t max_cto, uint8_t cycle, uint8_t unit)
{
    daq->lists = 0U;
    daq->odts = 0U;
    daq->entries = 0U;
    daq->selected = 0U;
    daq->left = 0U;
    daq->at = 0U;
    daq->cycle = cycle;
    daq->unit = unit;
    daq->slots = slots;
    daq->size = max_cto + 1U;
    daq->ring = ring;
    daq->head = 0U;
    daq->tail = 0U;
    daq->busy = 0U;
    daq->overload = 0U;
    daq->time = 0U;
}

/* -- sampling ---------------------------------------------------------------------------------------------------------- */

static uint32_t xcp_copy(const pen_xcp_daq_t *daq, const pen_xcp_odt_t *odt, uint8_t to[])
{
    uint32_t n = 0U;

    for (uint32_t i = 0U; i < odt->entries; i++) {
        const pen_xcp_entry_t *const entry = &daq->entry[odt->first + i];
        for (uint32_t k = 0U; k < entry->size; k++) {
            to[n] = entry->byte[k];
            n++;
        }
    }
    return n;
}

static void xcp_take(pen_xcp_daq_t *daq, const pen_xcp_list_t *list)
{
    const uint32_t tail = pen_port_load(&daq->tail);
    uint32_t head = daq->head;
    const uint32_t ahead = (tail > head) ? 0U : daq->slots; /* of the tail, it is one round further on */

    if ((head + list->odts) < (tail + ahead)) {
        uint32_t n = 2U;
        if (list->mode == PEN_XCP_STAMP) {
            pen_xcp_put(&daq->ring[(head * daq->size) + 2U], XCP_TIME_SIZE, daq->time);
            n += XCP_TIME_SIZE;
        }
        for (uint32_t i = 0U; i < list->odts; i++) {
            uint8_t *const slot = &daq->ring[head * daq->size];
            n += xcp_copy(daq, &daq->odt[list->first + i], &slot[n]);
            slot[0] = (uint8_t)(n - 1U);
            slot[1] = (uint8_t)(list->first + i);
            n = 2U;
            head = ((head + 1U) == daq->slots) ? 0U : (head + 1U);
        }
        pen_port_barrier(); /* the sample is whole before it can be sent */
        pen_port_store(&daq->head, head);
    } else {
        pen_port_store(&daq->overload, 1U);
    }
}

void pen_xcp_sample(pen_xcp_t *xcp, uint32_t time)
{
    pen_xcp_daq_t *const daq = xcp->config->daq;

    pen_port_store(&daq->time, time);
    pen_port_store(&daq->busy, 1U);
    pen_port_barrier(); /* what runs is looked at when the tuning context can see that it is */
    const uint32_t running = pen_port_load(&xcp->sampling);
    for (uint32_t i = 0U; i < PEN_XCP_LISTS; i++) {
        if (((running >> i) & 1U) != 0U) {
            pen_xcp_list_t *const list = &daq->list[i];
            if (list->wait > 1U) {
                list->wait--;
            } else {
                list->wait = list->prescaler;
                xcp_take(daq, list);
            }
        }
    }
    pen_port_barrier();
    pen_port_store(&daq->busy, 0U);
}

uint32_t pen_xcp_daq_packet(pen_xcp_t *xcp, uint8_t out[])
{
    pen_xcp_daq_t *const daq = xcp->config->daq;
    const uint32_t tail = daq->tail;
    uint32_t n = 0U;

    if (pen_port_load(&daq->overload) != 0U) {
        pen_port_store(&daq->overload, 0U);
        out[0] = 0xfdU;
        out[1] = 0x06U; /* EV_DAQ_OVERLOAD */
        n = 2U;
    } else if (pen_port_load(&daq->head) != tail) {
        const uint8_t *const slot = &daq->ring[tail * daq->size];
        pen_port_barrier();
        n = slot[0];
        for (uint32_t i = 0U; i < n; i++) {
            out[i] = slot[i + 1U];
        }
        pen_port_barrier(); /* read before the step may fill it again */
        pen_port_store(&daq->tail, ((tail + 1U) == daq->slots) ? 0U : (tail + 1U));
    } else {
        /* nothing to send */
    }
    return n;
}

/* -- lists ------------------------------------------------------------------------------------------------------------- */

static void xcp_run(pen_xcp_t *xcp, uint32_t lists)
{
    pen_xcp_daq_t *const daq = xcp->config->daq;
    const uint32_t running = pen_port_load(&xcp->sampling);

    for (uint32_t i = 0U; i < daq->lists; i++) {
        if ((((lists & ~running) >> i) & 1U) != 0U) {
            daq->list[i].wait = 0U; /* the next step */
        }
    }
    pen_port_barrier();
    pen_port_store(&xcp->sampling, running | lists);
}

static void xcp_stop(pen_xcp_t *xcp, uint32_t lists)
{
    pen_port_store(&xcp->sampling, pen_port_load(&xcp->sampling) & ~lists);
}

/* Has a list ODTs, are they complete, does each fit a packet? */
static bool xcp_complete(const pen_xcp_t *xcp, const pen_xcp_list_t *list)
{
    const pen_xcp_daq_t *const daq = xcp->config->daq;
    bool good = (list->odts > 0U);

    for (uint32_t i = 0U; i < list->odts; i++) {
        const pen_xcp_odt_t *const odt = &daq->odt[list->first + i];
        uint32_t n = ((i == 0U) && (list->mode == PEN_XCP_STAMP)) ? (1U + XCP_TIME_SIZE) : 1U;
        for (uint32_t k = 0U; k < odt->entries; k++) {
            const pen_xcp_entry_t *const entry = &daq->entry[odt->first + k];
            good = good && (entry->byte != NULL);
            n += entry->size;
        }
        good = good && (n <= xcp->config->max_cto);
    }
    return good;
}

static uint32_t xcp_start_stop(pen_xcp_t *xcp, const uint8_t in[], uint32_t number, uint8_t out[])
{
    pen_xcp_daq_t *const daq = xcp->config->daq;
    const uint32_t bit = (uint32_t)1U << number;
    uint32_t error = PEN_XCP_DONE;

    if (in[1] > 2U) {
        error = PEN_XCP_MODE_NOT_VALID;
    } else if (in[1] == 0U) {
        xcp_stop(xcp, bit);
    } else if (!xcp_complete(xcp, &daq->list[number])) {
        error = PEN_XCP_DAQ_CONFIG;
    } else if (in[1] == 1U) {
        xcp_run(xcp, bit);
    } else {
        daq->selected |= (uint8_t)bit;
    }
    out[1] = daq->list[number].first;
    return error;
}

static uint32_t xcp_start_stop_synch(pen_xcp_t *xcp, uint32_t mode)
{
    pen_xcp_daq_t *const daq = xcp->config->daq;
    uint32_t error = PEN_XCP_DONE;

    if (mode == 1U) {
        xcp_run(xcp, daq->selected);
    } else if (mode <= 2U) {
        xcp_stop(xcp, (mode == 0U) ? UINT32_MAX : daq->selected);
    } else {
        error = PEN_XCP_MODE_NOT_VALID;
    }
    daq->selected = 0U;
    return error;
}

static void xcp_get_list_mode(const pen_xcp_t *xcp, uint32_t number, uint8_t out[])
{
    const pen_xcp_daq_t *const daq = xcp->config->daq;
    const pen_xcp_list_t *const list = &daq->list[number];

    out[1] = list->mode;
    out[1] |= (uint8_t)(((uint32_t)daq->selected >> number) & 1U);
    out[1] |= (uint8_t)(((pen_port_load(&xcp->sampling) >> number) & 1U) * XCP_RUNS);
    out[6] = list->prescaler;
}

static void xcp_processor(const pen_xcp_daq_t *daq, uint8_t out[])
{
    out[1] = XCP_PROPERTIES;
    pen_xcp_put(&out[2], 2U, daq->lists);
    pen_xcp_put(&out[4], 2U, 1U); /* events */
}

static void xcp_resolution(const pen_xcp_config_t *config, uint8_t out[])
{
    out[1] = 1U;
    out[2] = (uint8_t)(config->max_cto - 1U);
    out[5] = XCP_TIME_MODE;
    pen_xcp_put(&out[6], 2U, 1U);
}

static uint32_t xcp_event_info(pen_xcp_t *xcp, uint32_t event, uint8_t out[])
{
    static const uint8_t name[4] = { 0x73U, 0x74U, 0x65U, 0x70U }; /* step */

    out[1] = 0x04U; /* DAQ */
    out[2] = PEN_XCP_LISTS;
    out[3] = 4U;
    out[4] = xcp->config->daq->cycle;
    out[5] = xcp->config->daq->unit;
    xcp->text = name;
    xcp->left = 4U;
    return (event == 0U) ? PEN_XCP_DONE : PEN_XCP_RANGE;
}

/* Commands that change lists need them at rest; FREE_DAQ sees to that. */
static uint32_t xcp_at_rest(pen_xcp_t *xcp, uint8_t code)
{
    const bool changes = (code <= 0xd6U) || (code >= 0xe0U);
    uint32_t error = PEN_XCP_DONE;

    if (code == 0xd6U) {
        xcp_stop(xcp, UINT32_MAX);
        pen_port_barrier();
    }
    if (changes) {
        if (pen_port_load(&xcp->sampling) != 0U) {
            error = PEN_XCP_DAQ_ACTIVE;
        } else if (pen_port_load(&xcp->config->daq->busy) != 0U) {
            error = PEN_XCP_BUSY; /* the last sample is still being taken */
        } else {
            /* at rest */
        }
    }
    return error;
}

uint32_t pen_xcp_daq_command(pen_xcp_t *xcp, const uint8_t in[], uint32_t n, uint8_t out[])
{
    pen_xcp_daq_t *const daq = xcp->config->daq;
    const uint32_t number = (n >= 4U) ? pen_xcp_get(&in[2], 2U) : 0U; /* in most commands that of a list */
    uint32_t error = xcp_at_rest(xcp, in[0]);

    if (error == PEN_XCP_DONE) {
        switch (in[0]) {
        case 0xd5U:
        case 0xd6U:
        case 0xe1U: error = pen_xcp_list_command(xcp, in, 0U); break;
        case 0xd7U: error = xcp_event_info(xcp, number, out); break;
        case 0xd9U: xcp_resolution(xcp->config, out); break;
        case 0xdaU: xcp_processor(daq, out); break;
        case 0xdcU: pen_xcp_put(&out[4], 4U, pen_port_load(&daq->time)); break;
        case 0xddU: error = xcp_start_stop_synch(xcp, in[1]); break;
        default:
            if (number >= daq->lists) {
                error = PEN_XCP_RANGE;
            } else if (in[0] == 0xdeU) {
                error = xcp_start_stop(xcp, in, number, out);
            } else if (in[0] == 0xdfU) {
                xcp_get_list_mode(xcp, number, out);
            } else {
                error = pen_xcp_list_command(xcp, in, number);
            }
            break;
        }
    }
    return error;
}
