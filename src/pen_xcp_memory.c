/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "penode/pen_exact.h"

#include "penode/pen_xcp_parts.h"

#include <stddef.h>

#include "penode/pen_serial.h"

#define XCP_CRC_32 9U

uint32_t pen_xcp_get(const uint8_t byte[], uint32_t size)
{
    const uint32_t turn = pen_xcp_turn() & (size - 1U);
    uint32_t number = 0U;

    for (uint32_t i = 0U; i < size; i++) {
        number |= (uint32_t)byte[i ^ turn] << (8U * i);
    }
    return number;
}

void pen_xcp_put(uint8_t byte[], uint32_t size, uint32_t number)
{
    const uint32_t turn = pen_xcp_turn() & (size - 1U);

    for (uint32_t i = 0U; i < size; i++) {
        byte[i ^ turn] = (uint8_t)((number >> (8U * i)) & 0xffU);
    }
}

/* Is [address, address + n) in [from, from + size)? */
static bool xcp_inside(uint32_t address, uint32_t n, uint32_t from, uint32_t size)
{
    const uint32_t offset = address - from; /* large if the address is below */

    return (offset <= size) && (n <= (size - offset));
}

const uint8_t *pen_xcp_region(const pen_xcp_config_t *config, uint32_t address, uint32_t n)
{
    const uint8_t *found = NULL;

    for (uint32_t i = 0U; i < config->regions; i++) {
        const pen_xcp_region_t *const region = &config->region[i];
        if (xcp_inside(address, n, region->address, region->size)) {
            found = &region->byte[address - region->address];
        }
    }
    return found;
}

bool pen_xcp_in_page(const pen_xcp_t *xcp, uint32_t n)
{
    const pen_xcp_config_t *const config = xcp->config;

    return (xcp->text == NULL) && xcp_inside(xcp->mta, n, config->address, config->length * (uint32_t)sizeof(pen_real_t));
}

/* The n bytes at the MTA; NULL if they may not be read. */
static const uint8_t *xcp_at(const pen_xcp_t *xcp, uint32_t n)
{
    const uint8_t *from;

    if (xcp->text != NULL) {
        from = (n <= xcp->left) ? xcp->text : NULL;
    } else if (pen_xcp_in_page(xcp, n)) {
        from = &((const uint8_t *)pen_xcp_page(xcp))[xcp->mta - xcp->config->address];
    } else {
        from = pen_xcp_region(xcp->config, xcp->mta, n);
    }
    return from;
}

static uint32_t xcp_upload(pen_xcp_t *xcp, uint32_t n, uint8_t out[])
{
    const uint8_t *const from = xcp_at(xcp, n);
    uint32_t error = PEN_XCP_DONE;

    if ((n == 0U) || (n >= xcp->config->max_cto)) {
        error = PEN_XCP_RANGE;
    } else if (from == NULL) {
        error = PEN_XCP_ACCESS_DENIED;
    } else {
        for (uint32_t i = 0U; i < n; i++) {
            out[i + 1U] = from[i];
        }
        if (xcp->text != NULL) {
            xcp->text = &from[n];
            xcp->left -= n;
        }
        xcp->mta += n;
        xcp->answer = (uint8_t)(n + 1U);
    }
    return error;
}

static uint32_t xcp_set_mta(pen_xcp_t *xcp, const uint8_t in[])
{
    xcp->text = NULL;
    xcp->mta = pen_xcp_get(&in[4], 4U);
    return (in[3] == 0U) ? PEN_XCP_DONE : PEN_XCP_ACCESS_DENIED; /* address extension */
}

/* Of a page, the CRC of its serial form. */
static uint32_t xcp_build_checksum(pen_xcp_t *xcp, const uint8_t in[], uint8_t out[])
{
    const uint32_t n = pen_xcp_get(&in[4], 4U);
    const bool page = pen_xcp_in_page(xcp, n);
    const uint32_t offset = page ? (xcp->mta - xcp->config->address) : 0U;
    const uint32_t turn = page ? (pen_xcp_turn() & ((uint32_t)sizeof(pen_real_t) - 1U)) : 0U;
    const uint8_t *const from = page ? (const uint8_t *)pen_xcp_page(xcp) : xcp_at(xcp, n);
    uint32_t error = PEN_XCP_DONE;

    if (n == 0U) {
        error = PEN_XCP_RANGE;
    } else if ((from == NULL) || (xcp->text != NULL)) {
        error = PEN_XCP_ACCESS_DENIED;
    } else {
        uint32_t crc = PEN_CRC_START;
        for (uint32_t i = 0U; i < n; i++) {
            crc = pen_crc_bytes(crc, 1U, &from[(offset + i) ^ turn]);
        }
        out[1] = XCP_CRC_32;
        pen_xcp_put(&out[4], 4U, ~crc);
        xcp->mta += n;
    }
    return error;
}

uint32_t pen_xcp_memory_command(pen_xcp_t *xcp, const uint8_t in[], uint8_t out[])
{
    uint32_t error = PEN_XCP_DONE;

    if (in[0] == 0xf3U) {
        error = xcp_build_checksum(xcp, in, out);
    } else {
        if (in[0] != 0xf5U) {
            error = xcp_set_mta(xcp, in);
        }
        if ((error == PEN_XCP_DONE) && (in[0] != 0xf6U)) {
            error = xcp_upload(xcp, in[1], out);
        }
    }
    return error;
}

static uint32_t xcp_download(pen_xcp_t *xcp, const uint8_t byte[], uint32_t n, uint32_t now, uint32_t total)
{
    uint32_t error;

    if (total == 0U) {
        error = PEN_XCP_RANGE;
    } else if (n < now) {
        error = PEN_XCP_SYNTAX;
    } else if (!pen_xcp_in_page(xcp, total)) {
        error = PEN_XCP_ACCESS_DENIED;
    } else {
        error = pen_xcp_write(xcp, byte, now);
    }
    return error;
}

uint32_t pen_xcp_download_command(pen_xcp_t *xcp, const uint8_t in[], uint32_t n, uint8_t out[])
{
    const bool max = (in[0] == 0xeeU);
    const uint32_t at = max ? 1U : 2U; /* where data begin */
    const uint32_t room = xcp->config->max_cto - at;
    const uint32_t total = max ? room : in[1]; /* bytes of the block that are still to come */
    const uint32_t now = (total < room) ? total : room;
    uint32_t error = PEN_XCP_DONE;

    if ((in[0] == 0xefU) && (total != xcp->block)) {
        out[2] = xcp->block;
        xcp->block = 0U;
        error = PEN_XCP_SEQUENCE;
    } else {
        xcp->block = (uint8_t)(total - now);
        if (!xcp->refused) {
            error = xcp_download(xcp, &in[at], n - at, now, total);
            xcp->refused = (error != PEN_XCP_DONE);
            if (!xcp->refused) {
                xcp->torn = (xcp->block != 0U);
                xcp->answer = (uint8_t)(xcp->torn ? 0U : 1U);
            }
        } else {
            xcp->answer = 0U; /* the block has been answered: no word to the rest of it */
        }
    }
    return error;
}
