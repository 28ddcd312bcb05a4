/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "penode/pen_exact.h"

#include "penode/pen_xcp_parts.h"

#include <stddef.h>

#define XCP_WORKING     0U
#define XCP_REFERENCE   1U
#define XCP_ECU         0x01U /* modes of SET_CAL_PAGE */
#define XCP_TOOL        0x02U
#define XCP_ALL         0x80U
#define XCP_ANY_ACCESS  0x3fU /* page properties: read and write, with and without the ECU */
#define XCP_READ_ACCESS 0x0fU

/* The values that run, or that the next step adopts. */
static const pen_real_t *xcp_latest(const pen_xcp_t *xcp)
{
    pen_tuning_t *const tuning = xcp->tuning;

    return pen_tuning_settle(tuning) ? tuning->slot[pen_tuning_inactive(tuning) ^ 1U].value : xcp->waiting;
}

static bool xcp_on_reference(const pen_xcp_t *xcp)
{
    return xcp_latest(xcp) == xcp->config->reference->value;
}

static bool xcp_open(const pen_xcp_t *xcp)
{
    return xcp->tuning->open != 0U;
}

static const pen_real_t *xcp_working(const pen_xcp_t *xcp)
{
    const pen_tuning_t *const tuning = xcp->tuning;
    const pen_real_t *value = xcp_latest(xcp);

    if (xcp_open(xcp)) {
        value = tuning->slot[pen_tuning_inactive(tuning)].value;
    } else if (value == xcp->config->reference->value) {
        value = xcp->kept;
    } else {
        /* that of the running set */
    }
    return value;
}

const pen_real_t *pen_xcp_page(const pen_xcp_t *xcp)
{
    return (xcp->page == XCP_WORKING) ? xcp_working(xcp) : xcp->config->reference->value;
}

static uint32_t xcp_error_of(pen_xcp_t *xcp, pen_status_t status)
{
    uint32_t error = PEN_XCP_DONE;

    if (status != PEN_OK) {
        xcp->status = status;
        error = (status == PEN_SET_BUSY) ? PEN_XCP_BUSY : PEN_XCP_GENERIC;
    }
    return error;
}

/* Open a copy of some values, unless a set is open already. */
static uint32_t xcp_open_copy(pen_xcp_t *xcp, const pen_real_t from[])
{
    const pen_xcp_config_t *const config = xcp->config;
    pen_tuning_t *const tuning = xcp->tuning;
    pen_status_t status = PEN_OK;

    if (!xcp_open(xcp)) {
        const pen_set_head_t head = { config->layout, config->length, config->id + xcp->sets, 0U };
        status = pen_tuning_begin(tuning, config->layout, config->length, &head);
        if (status == PEN_OK) {
            xcp->sets++;
            xcp->kept = config->reference->value;
            status = pen_tuning_write(tuning, config->length, 0U, from, config->length);
        }
        pen_status_note_tune(&config->instance->log, status);
    }
    return xcp_error_of(xcp, status);
}

uint32_t pen_xcp_write(pen_xcp_t *xcp, const uint8_t byte[], uint32_t n)
{
    const pen_xcp_config_t *const config = xcp->config;
    const uint32_t turn = pen_xcp_turn() & ((uint32_t)sizeof(pen_real_t) - 1U);
    const uint32_t offset = xcp->mta - config->address;
    uint32_t error = PEN_XCP_WRITE_PROTECTED;

    if (xcp->page == XCP_WORKING) {
        error = xcp_open_copy(xcp, xcp_working(xcp));
    }
    if (error == PEN_XCP_DONE) {
        pen_status_t status = PEN_OK;
        for (uint32_t i = 0U; i < n; i++) { /* a packet has the core's order, the serial form is little endian */
            status |= pen_tuning_write_bytes(xcp->tuning, config->length, (offset + i) ^ turn, &byte[i], 1U);
        }
        xcp->mta += n;
        xcp->idle = 0U;
        error = xcp_error_of(xcp, status);
    }
    return error;
}

/* Commit the open set. Its checksum is that of its values: a transfer is proven by BUILD_CHECKSUM. */
static uint32_t xcp_commit(pen_xcp_t *xcp)
{
    const pen_xcp_config_t *const config = xcp->config;
    const pen_real_t *const value = xcp_working(xcp);
    uint32_t error = PEN_XCP_SEQUENCE;

    if (!xcp->torn) {
        (void)pen_tuning_expect(xcp->tuning, pen_set_checksum(value, config->length));
        error = xcp_error_of(xcp, config->commit());
        if (error == PEN_XCP_DONE) {
            xcp->waiting = value;
        }
    }
    return error;
}

static uint32_t xcp_run_working(pen_xcp_t *xcp)
{
    uint32_t error = PEN_XCP_DONE;

    if (xcp_on_reference(xcp)) {
        error = xcp_open_copy(xcp, xcp_working(xcp));
    }
    if ((error == PEN_XCP_DONE) && xcp_open(xcp)) {
        error = xcp_commit(xcp);
    }
    return error;
}

static uint32_t xcp_run_reference(pen_xcp_t *xcp)
{
    const pen_set_t *const reference = xcp->config->reference;
    uint32_t error = PEN_XCP_DONE;

    if (!xcp_on_reference(xcp)) {
        const pen_real_t *const kept = xcp_working(xcp);
        error = xcp_error_of(xcp, xcp->config->select(reference));
        if (error == PEN_XCP_DONE) {
            xcp->waiting = reference->value;
            xcp->kept = kept;
        }
    }
    return error;
}

uint32_t pen_xcp_elapse(pen_xcp_t *xcp, uint32_t ms, uint8_t out[])
{
    const uint32_t quiet = xcp->config->quiet;
    uint32_t n = 0U;

    if ((xcp->idle < quiet) && xcp_open(xcp) && !xcp->torn && !xcp_on_reference(xcp)) {
        const bool over = (ms >= (quiet - xcp->idle));
        xcp->idle = over ? quiet : (xcp->idle + ms);
        if (over && (xcp_commit(xcp) != PEN_XCP_DONE) && xcp->connected) {
            out[0] = 0xfdU;
            out[1] = 0xfeU; /* EV_USER */
            n = 2U;
        }
    }
    return n;
}

void pen_xcp_drop(pen_xcp_t *xcp)
{
    (void)pen_tuning_abort(xcp->tuning);
    xcp->kept = xcp->config->reference->value;
    xcp->torn = false;
}

/* -- commands ----------------------------------------------------------------------------------------------------------- */

static uint32_t xcp_set_page(pen_xcp_t *xcp, const uint8_t in[])
{
    const uint32_t mode = in[1];
    uint32_t error = PEN_XCP_DONE;

    if ((mode & (XCP_ECU | XCP_TOOL)) == 0U) {
        error = PEN_XCP_MODE_NOT_VALID;
    } else if (in[3] > XCP_REFERENCE) {
        error = PEN_XCP_PAGE_NOT_VALID;
    } else if ((mode & XCP_ECU) != 0U) {
        error = (in[3] == XCP_WORKING) ? xcp_run_working(xcp) : xcp_run_reference(xcp);
    } else {
        /* the ECU stays where it is */
    }
    if ((error == PEN_XCP_DONE) && ((mode & XCP_TOOL) != 0U)) {
        xcp->page = in[3];
    }
    return error;
}

static uint32_t xcp_get_page(const pen_xcp_t *xcp, uint32_t mode, uint8_t out[])
{
    out[3] = xcp->page;
    if (mode == XCP_ECU) {
        out[3] = xcp_on_reference(xcp) ? XCP_REFERENCE : XCP_WORKING;
    }
    return ((mode == XCP_ECU) || (mode == XCP_TOOL)) ? PEN_XCP_DONE : PEN_XCP_MODE_NOT_VALID;
}

static uint32_t xcp_copy_page(pen_xcp_t *xcp, uint32_t from, uint32_t to)
{
    uint32_t error = PEN_XCP_WRITE_PROTECTED;

    if ((from > XCP_REFERENCE) || (to > XCP_REFERENCE)) {
        error = PEN_XCP_PAGE_NOT_VALID;
    } else if (to == XCP_WORKING) {
        error = PEN_XCP_DONE;
        if (from == XCP_REFERENCE) {
            (void)pen_tuning_abort(xcp->tuning);
            error = xcp_open_copy(xcp, xcp->config->reference->value);
            xcp->torn = false;
            xcp->idle = 0U;
        }
    } else {
        /* flash */
    }
    return error;
}

static uint32_t xcp_segment_info(pen_xcp_t *xcp, const uint8_t in[], uint8_t out[])
{
    uint32_t error = PEN_XCP_DONE;

    if (in[1] == 1U) {
        out[1] = 2U; /* pages */
        xcp->answer = 6U;
    } else if ((in[1] > 1U) || (in[3] > 1U)) {
        error = PEN_XCP_RANGE; /* no mapping */
    } else {
        pen_xcp_put(&out[4], 4U, (in[3] == 0U) ? xcp->config->address : (xcp->config->length * (uint32_t)sizeof(pen_real_t)));
    }
    return error;
}

static uint32_t xcp_page_info(uint32_t page, uint8_t out[])
{
    out[1] = (page == XCP_WORKING) ? XCP_ANY_ACCESS : XCP_READ_ACCESS;
    return (page > XCP_REFERENCE) ? PEN_XCP_PAGE_NOT_VALID : PEN_XCP_DONE;
}

static void xcp_processor_info(const pen_xcp_options_t *options, uint8_t out[])
{
    out[1] = 1U; /* segments */
    if (options != NULL) {
        out[2] = options->freeze ? 1U : 0U;
    }
}

/* in[2] is the segment in all but COPY_CAL_PAGE, GET_PAG_PROCESSOR_INFO, and SET_CAL_PAGE for all segments. */
uint32_t pen_xcp_page_command(pen_xcp_t *xcp, const uint8_t in[], uint8_t out[])
{
    uint32_t segment = (in[0] != 0xe9U) ? in[2] : 0U; /* GET_PAG_PROCESSOR_INFO is one byte long */
    uint32_t error = PEN_XCP_DONE;

    switch (in[0]) {
    case 0xe4U:
        segment = (uint32_t)in[1] | in[3];
        if (segment == 0U) {
            error = xcp_copy_page(xcp, in[2], in[4]);
        }
        break;
    case 0xe7U: error = xcp_page_info(in[3], out); break;
    case 0xe8U: error = xcp_segment_info(xcp, in, out); break;
    case 0xe9U: xcp_processor_info(xcp->config->options, out); break;
    case 0xeaU: error = xcp_get_page(xcp, in[1], out); break;
    default:
        segment = (in[1] < XCP_ALL) ? segment : 0U;
        if (segment == 0U) {
            error = xcp_set_page(xcp, in);
        }
        break;
    }
    return (segment == 0U) ? error : PEN_XCP_SEGMENT_NOT_VALID;
}
