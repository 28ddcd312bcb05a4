/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* Setting DAQ lists up. Nothing is sampled meanwhile. */

#include "penode/pen_exact.h"

#include "penode/pen_xcp_daq.h"

#include <stddef.h>

#include "penode/pen_xcp_parts.h"

static uint32_t xcp_set_list_mode(pen_xcp_list_t *list, const uint8_t in[])
{
    uint32_t error = PEN_XCP_DONE;

    if ((in[1] & ~PEN_XCP_STAMP) != 0U) {
        error = PEN_XCP_MODE_NOT_VALID;
    } else if ((pen_xcp_get(&in[4], 2U) != 0U) || (in[6] == 0U)) {
        error = PEN_XCP_RANGE;
    } else {
        list->mode = in[1];
        list->prescaler = in[6];
    }
    return error;
}

static void xcp_free(pen_xcp_daq_t *daq)
{
    daq->lists = 0U;
    daq->odts = 0U;
    daq->entries = 0U;
    daq->selected = 0U;
    daq->left = 0U;
}

static uint32_t xcp_alloc_lists(pen_xcp_daq_t *daq, uint32_t count)
{
    uint32_t error = PEN_XCP_DONE;

    if (daq->lists != 0U) {
        error = PEN_XCP_SEQUENCE;
    } else if (count > PEN_XCP_LISTS) {
        error = PEN_XCP_MEMORY;
    } else {
        daq->lists = (uint8_t)count;
        for (uint32_t i = 0U; i < count; i++) {
            daq->list[i].odts = 0U;
            daq->list[i].mode = 0U;
            daq->list[i].prescaler = 1U;
        }
    }
    return error;
}

static uint32_t xcp_alloc_odts(pen_xcp_daq_t *daq, pen_xcp_list_t *list, uint32_t count)
{
    uint32_t error = PEN_XCP_DONE;

    if (list->odts != 0U) {
        error = PEN_XCP_SEQUENCE;
    } else if (count > (PEN_XCP_ODTS - daq->odts)) {
        error = PEN_XCP_MEMORY;
    } else {
        list->first = daq->odts;
        list->odts = (uint8_t)count;
        for (uint32_t i = 0U; i < count; i++) {
            daq->odt[daq->odts + i].entries = 0U;
        }
        daq->odts += (uint8_t)count;
    }
    return error;
}

static uint32_t xcp_alloc_entries(pen_xcp_daq_t *daq, const pen_xcp_list_t *list, uint32_t number, uint32_t count)
{
    pen_xcp_odt_t *const odt = &daq->odt[((uint32_t)list->first + number) % PEN_XCP_ODTS];
    uint32_t error = PEN_XCP_DONE;

    if (number >= list->odts) {
        error = PEN_XCP_RANGE;
    } else if (odt->entries != 0U) {
        error = PEN_XCP_SEQUENCE;
    } else if (count > (PEN_XCP_ENTRIES - daq->entries)) {
        error = PEN_XCP_MEMORY;
    } else {
        odt->first = daq->entries;
        odt->entries = (uint8_t)count;
        for (uint32_t i = 0U; i < count; i++) {
            daq->entry[daq->entries + i].byte = NULL;
        }
        daq->entries += (uint8_t)count;
    }
    return error;
}

static uint32_t xcp_set_pointer(pen_xcp_daq_t *daq, const pen_xcp_list_t *list, const uint8_t in[])
{
    const pen_xcp_odt_t *const odt = &daq->odt[((uint32_t)list->first + in[4]) % PEN_XCP_ODTS];
    uint32_t error = PEN_XCP_RANGE;

    daq->left = 0U;
    if ((in[4] < list->odts) && (in[5] < odt->entries)) {
        daq->at = (uint8_t)(odt->first + in[5]);
        daq->left = (uint8_t)(odt->entries - in[5]);
        error = PEN_XCP_DONE;
    }
    return error;
}

static uint32_t xcp_write_entry(pen_xcp_t *xcp, const uint8_t in[])
{
    pen_xcp_daq_t *const daq = xcp->config->daq;
    const uint8_t *const byte = pen_xcp_region(xcp->config, pen_xcp_get(&in[4], 4U), in[2]);
    uint32_t error = PEN_XCP_DONE;

    if (daq->left == 0U) {
        error = PEN_XCP_DAQ_CONFIG;
    } else if ((in[1] != 0xffU) || (in[2] == 0U)) { /* no single bits */
        error = PEN_XCP_RANGE;
    } else if ((in[3] != 0U) || (byte == NULL)) {
        error = PEN_XCP_ACCESS_DENIED;
    } else {
        daq->entry[daq->at].byte = byte;
        daq->entry[daq->at].size = in[2];
        daq->at++;
        daq->left--;
    }
    return error;
}

static void xcp_clear(pen_xcp_daq_t *daq, const pen_xcp_list_t *list)
{
    for (uint32_t i = 0U; i < list->odts; i++) {
        const pen_xcp_odt_t *const odt = &daq->odt[list->first + i];
        for (uint32_t k = 0U; k < odt->entries; k++) {
            daq->entry[odt->first + k].byte = NULL;
        }
    }
}

uint32_t pen_xcp_list_command(pen_xcp_t *xcp, const uint8_t in[], uint32_t number)
{
    pen_xcp_daq_t *const daq = xcp->config->daq;
    pen_xcp_list_t *const list = &daq->list[number];
    uint32_t error = PEN_XCP_DONE;

    switch (in[0]) {
    case 0xd3U: error = xcp_alloc_entries(daq, list, in[4], in[5]); break;
    case 0xd4U: error = xcp_alloc_odts(daq, list, in[4]); break;
    case 0xd5U: error = xcp_alloc_lists(daq, pen_xcp_get(&in[2], 2U)); break;
    case 0xd6U: xcp_free(daq); break;
    case 0xe0U: error = xcp_set_list_mode(list, in); break;
    case 0xe1U: error = xcp_write_entry(xcp, in); break;
    case 0xe2U: error = xcp_set_pointer(daq, list, in); break;
    default: xcp_clear(daq, list); break;
    }
    return error;
}
