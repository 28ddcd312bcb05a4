/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "penode/pen_exact.h"

#include "penode/pen_xcp.h"

#include <stddef.h>

#include "penode/pen_port.h"
#include "penode/pen_xcp_parts.h"

#define XCP_ANSWER    0xffU
#define XCP_FAILURE   0xfeU
#define XCP_CONNECT   0xffU
#define XCP_FIRST     0xd0U /* of the commands in xcp_shape */
#define XCP_CAL_FIRST 0xe4U
#define XCP_CAL_LAST  0xf0U
#define XCP_MIN_CTO   8U
#define XCP_MAX_CTO   255U
#define XCP_FIXED     8U /* bytes of the longest answer of fixed length */

static void xcp_start(pen_xcp_t *xcp, bool connected)
{
    pen_port_store(&xcp->sampling, 0U);
    pen_xcp_drop(xcp);
    xcp->connected = connected;
    xcp->locked = (uint8_t)xcp->config->protect;
    xcp->asked = 0U;
    xcp->page = 0U;
    xcp->text = NULL;
    xcp->left = 0U;
    xcp->mta = 0U;
    xcp->block = 0U;
}

void pen_xcp_disconnect(pen_xcp_t *xcp)
{
    xcp_start(xcp, false);
}

pen_status_t pen_xcp_init(pen_xcp_t *xcp, const pen_xcp_config_t *config)
{
    pen_status_t status = PEN_SET_BADARG;

    if ((xcp != NULL) && (config != NULL) && (config->max_cto >= XCP_MIN_CTO) && (config->max_cto <= XCP_MAX_CTO) &&
        (config->instance->ready == config->layout)) {
        xcp->config = config;
        xcp->tuning = &config->instance->tuning;
        xcp->sets = 0U;
        xcp->idle = 0U;
        xcp->waiting = config->reference->value;
        xcp->frozen = 0U;
        xcp->store = 0U;
        xcp_start(xcp, false);
        status = PEN_OK;
    }
    return status;
}

static void xcp_connect(pen_xcp_t *xcp, uint8_t out[])
{
    const pen_xcp_config_t *const config = xcp->config;

    xcp_start(xcp, true);
    out[1] = (uint8_t)((config->daq != NULL) ? (PEN_XCP_CAL | PEN_XCP_DAQ) : PEN_XCP_CAL);
    out[2] = (uint8_t)(0x80U | (pen_xcp_turn() & 1U)); /* GET_COMM_MODE_INFO is there; byte order */
    out[3] = (uint8_t)config->max_cto;
    out[4U + (pen_xcp_turn() & 1U)] = out[3]; /* MAX_DTO, of two bytes */
    out[6] = 1U; /* protocol 1, transport 1 */
    out[7] = 1U;
}

static void xcp_get_id(pen_xcp_t *xcp, uint32_t type, uint8_t out[])
{
    const pen_xcp_region_t *const text = (type < PEN_XCP_TEXTS) ? xcp->config->text[type] : NULL;

    if (text != NULL) {
        xcp->text = text->byte;
        xcp->left = text->size;
        pen_xcp_put(&out[4], 4U, text->size); /* else 0: not available */
    }
}

/* Bytes that a command needs at least, and 16 times those of its answer; 0: no such command. */
static uint32_t xcp_shape(uint8_t code)
{
    static const uint8_t shape[48] = {
        0x00U, 0x00U, 0x00U, 0x16U, 0x15U, 0x14U, 0x11U, 0x74U, 0x00U, 0x81U, 0x81U, 0x00U, 0x81U, 0x12U, 0x24U, 0x84U, /* d0 */
        0x18U, 0x18U, 0x16U, 0x14U, 0x15U, 0x33U, 0x13U, 0x34U, 0x84U, 0x31U, 0x43U, 0x14U, 0x00U, 0x00U, 0x11U, 0x12U, /* e0 */
        0x12U, 0x00U, 0x00U, 0x88U, 0x18U, 0x12U, 0x18U, 0x22U, 0x23U, 0x12U, 0x82U, 0x81U, 0x21U, 0x61U, 0x11U, 0x82U, /* f0 */
    };

    return (code >= XCP_FIRST) ? shape[code - XCP_FIRST] : 0U;
}

static uint32_t xcp_call(pen_xcp_command_t handler, pen_xcp_t *xcp, const uint8_t in[], uint32_t n, uint8_t out[])
{
    return (handler != NULL) ? handler(xcp, in, n, out) : PEN_XCP_UNKNOWN;
}

static uint32_t xcp_execute(pen_xcp_t *xcp, const uint8_t in[], uint32_t n, uint8_t out[])
{
    const pen_xcp_config_t *const config = xcp->config;
    uint32_t error = PEN_XCP_DONE;

    switch (in[0]) {
    case 0xe4U:
    case 0xe7U:
    case 0xe8U:
    case 0xe9U:
    case 0xeaU:
    case 0xebU: error = pen_xcp_page_command(xcp, in, out); break;
    case 0xeeU:
    case 0xefU:
    case 0xf0U: error = pen_xcp_download_command(xcp, in, n, out); break;
    case 0xf3U:
    case 0xf4U:
    case 0xf5U:
    case 0xf6U: error = pen_xcp_memory_command(xcp, in, out); break;
    case 0xe5U:
    case 0xe6U:
    case 0xf7U:
    case 0xf8U:
    case 0xf9U: error = xcp_call(config->options_command, xcp, in, n, out); break;
    case 0xfaU: xcp_get_id(xcp, in[1], out); break;
    case 0xfbU: /* GET_COMM_MODE_INFO */
        out[2] = 1U; /* master block mode */
        out[4] = XCP_MAX_CTO; /* packets of a block: as many as its 255 bytes take */
        break;
    case 0xfcU: error = PEN_XCP_SYNCHRONISED; break;
    case 0xfdU: /* GET_STATUS */
        out[1] = (uint8_t)(((pen_port_load(&xcp->sampling) != 0U) ? 0x40U : 0U) | xcp->store);
        out[2] = xcp->locked;
        break;
    case 0xfeU: pen_xcp_disconnect(xcp); break;
    case 0xffU: xcp_connect(xcp, out); break;
    default: error = (xcp->answer != 0U) ? xcp_call(config->daq_command, xcp, in, n, out) : PEN_XCP_UNKNOWN; break;
    }
    return error;
}

/* What is wrong with a packet before its command is looked at. */
static uint32_t xcp_refuse(const pen_xcp_t *xcp, uint8_t code, uint32_t n, uint32_t needs)
{
    uint32_t resource = 0U;
    uint32_t error = PEN_XCP_DONE;

    if (code < XCP_CAL_FIRST) {
        resource = PEN_XCP_DAQ;
    } else if (code <= XCP_CAL_LAST) {
        resource = PEN_XCP_CAL;
    } else {
        /* open to all */
    }
    if ((n < needs) || (n > xcp->config->max_cto)) {
        error = PEN_XCP_SYNTAX;
    } else if ((xcp->locked & resource) != 0U) {
        error = PEN_XCP_ACCESS_LOCKED;
    } else {
        /* nothing */
    }
    return error;
}

uint32_t pen_xcp_receive(pen_xcp_t *xcp, const uint8_t in[], uint32_t n, uint8_t out[])
{
    uint32_t answer = 0U;

    /* before CONNECT only that is answered; below 0xc0 are STIM packets, which there are none of */
    if ((n > 0U) && (in[0] >= 0xc0U) && (xcp->connected || (in[0] == XCP_CONNECT))) {
        const uint32_t shape = xcp_shape(in[0]);
        uint32_t error = xcp_refuse(xcp, in[0], n, shape & 0xfU);
        for (uint32_t i = 1U; i < XCP_FIXED; i++) {
            out[i] = 0U;
        }
        out[0] = XCP_ANSWER;
        xcp->answer = (uint8_t)(shape >> 4U);
        xcp->status = PEN_OK;
        if (in[0] != 0xefU) {
            xcp->block = 0U;
            xcp->refused = false;
        }
        if (error == PEN_XCP_DONE) {
            error = xcp_execute(xcp, in, n, out);
        }
        answer = xcp->answer;
        if (error != PEN_XCP_DONE) {
            out[0] = XCP_FAILURE;
            out[1] = (uint8_t)(error & 0xffU);
            pen_xcp_put(&out[4], 4U, xcp->status);
            answer = XCP_FIXED;
        }
    }
    return answer;
}
