/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "penode/pen_exact.h"

#include "penode/pen_xcp.h"

#include <stddef.h>

#include "penode/pen_xcp_parts.h"

static uint32_t xcp_get_seed(pen_xcp_t *xcp, const uint8_t in[], uint8_t out[])
{
    const pen_xcp_options_t *const options = xcp->config->options;
    uint32_t error = PEN_XCP_DONE;

    if ((options->seed == NULL) || (options->unlock == NULL)) {
        error = PEN_XCP_UNKNOWN;
    } else if (in[1] != 0U) {
        error = PEN_XCP_RANGE; /* no second part */
    } else {
        xcp->asked = in[2] & xcp->locked;
        out[1] = (uint8_t)((xcp->asked != 0U) ? options->seed(xcp->asked, &out[2]) : 0U);
        xcp->answer = (uint8_t)(2U + out[1]);
    }
    return error;
}

static uint32_t xcp_unlock(pen_xcp_t *xcp, const uint8_t in[], uint32_t n, uint8_t out[])
{
    const uint8_t asked = xcp->asked;
    uint32_t error = PEN_XCP_DONE;

    xcp->asked = 0U;
    if (asked == 0U) {
        error = PEN_XCP_SEQUENCE;
    } else if ((n - 2U) < in[1]) {
        error = PEN_XCP_SYNTAX;
    } else if (xcp->config->options->unlock(asked, in[1], &in[2])) {
        xcp->locked &= (uint8_t)(asked ^ 0xffU);
        out[1] = xcp->locked;
    } else {
        pen_xcp_disconnect(xcp); /* as the standard asks for */
        error = PEN_XCP_ACCESS_LOCKED;
    }
    return error;
}

static uint32_t xcp_set_request(pen_xcp_t *xcp, uint32_t mode)
{
    uint32_t error = PEN_XCP_RANGE;

    if ((mode == 1U) && xcp->config->options->freeze) {
        xcp->store = xcp->frozen;
        error = PEN_XCP_DONE;
    }
    return error;
}

static uint32_t xcp_set_segment_mode(pen_xcp_t *xcp, uint32_t mode)
{
    const bool possible = (mode == 0U) || ((mode == 1U) && xcp->config->options->freeze);

    if (possible) {
        xcp->frozen = (uint8_t)mode;
    }
    return possible ? PEN_XCP_DONE : PEN_XCP_MODE_NOT_VALID;
}

uint32_t pen_xcp_options_command(pen_xcp_t *xcp, const uint8_t in[], uint32_t n, uint8_t out[])
{
    const bool segment = (in[0] < 0xf7U); /* in[2] is one */
    uint32_t error;

    if (segment && (in[2] != 0U)) {
        error = PEN_XCP_SEGMENT_NOT_VALID;
    } else {
        switch (in[0]) {
        case 0xe5U:
            out[2] = xcp->frozen;
            error = PEN_XCP_DONE;
            break;
        case 0xe6U: error = xcp_set_segment_mode(xcp, in[1]); break;
        case 0xf7U: error = xcp_unlock(xcp, in, n, out); break;
        case 0xf8U: error = xcp_get_seed(xcp, in, out); break;
        default: error = xcp_set_request(xcp, in[1]); break;
        }
    }
    return error;
}

const pen_set_t *pen_xcp_to_store(pen_xcp_t *xcp)
{
    const bool ready = (xcp->store != 0U) && pen_tuning_settle(xcp->tuning);

    return ready ? &xcp->tuning->slot[pen_tuning_inactive(xcp->tuning) ^ 1U] : NULL;
}

uint32_t pen_xcp_stored(pen_xcp_t *xcp, uint8_t out[])
{
    const bool asked = (xcp->store != 0U) && xcp->connected;

    xcp->store = 0U;
    out[0] = 0xfdU;
    out[1] = 0x03U; /* EV_STORE_CAL */
    return asked ? 2U : 0U;
}
