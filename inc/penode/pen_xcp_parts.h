/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * What the files of the XCP slave share. Not for applications.
 *
 * A command returns 0, or an error code of the standard. It finds the answer as 0xff, 0, 0, ... and its usual length in
 * xcp->answer; only what differs is written.
 */
#ifndef PEN_XCP_PARTS_H
#define PEN_XCP_PARTS_H

#include <stdint.h>

#include "penode/pen_xcp.h"

#ifdef __cplusplus
extern "C" {
#endif

#define PEN_XCP_DONE              0x00U
#define PEN_XCP_BUSY              0x10U
#define PEN_XCP_DAQ_ACTIVE        0x11U
#define PEN_XCP_UNKNOWN           0x20U
#define PEN_XCP_SYNTAX            0x21U
#define PEN_XCP_RANGE             0x22U
#define PEN_XCP_WRITE_PROTECTED   0x23U
#define PEN_XCP_ACCESS_DENIED     0x24U
#define PEN_XCP_ACCESS_LOCKED     0x25U
#define PEN_XCP_PAGE_NOT_VALID    0x26U
#define PEN_XCP_MODE_NOT_VALID    0x27U
#define PEN_XCP_SEGMENT_NOT_VALID 0x28U
#define PEN_XCP_SEQUENCE          0x29U
#define PEN_XCP_DAQ_CONFIG        0x2aU
#define PEN_XCP_MEMORY            0x30U
#define PEN_XCP_GENERIC           0x31U
#define PEN_XCP_SYNCHRONISED      0x100U /* code 0 of the standard */

/** 0, or on a big-endian core 7: byte i of a number in a packet stands at i ^ (pen_xcp_turn() & (size - 1)). */
static inline uint32_t pen_xcp_turn(void)
{
    const uint32_t probe = 1U;
    const uint8_t *const first = (const uint8_t *)&probe;

    return (1U - (uint32_t)first[0]) * 7U;
}

/** A number of 2 or 4 bytes, in the core's order. */
uint32_t pen_xcp_get(const uint8_t byte[], uint32_t size);
void pen_xcp_put(uint8_t byte[], uint32_t size, uint32_t number); /* write one */

/** Bytes of a region of the configuration; NULL if [address, address + n) is not all in one. */
const uint8_t *pen_xcp_region(const pen_xcp_config_t *config, uint32_t address, uint32_t n);

/** True if [MTA, MTA + n) is in the pages, and the MTA an address. */
bool pen_xcp_in_page(const pen_xcp_t *xcp, uint32_t n);

/** SET_MTA, UPLOAD, SHORT_UPLOAD, BUILD_CHECKSUM: 0xf3 to 0xf6. */
uint32_t pen_xcp_memory_command(pen_xcp_t *xcp, const uint8_t in[], uint8_t out[]);

/** DOWNLOAD_MAX, DOWNLOAD_NEXT, DOWNLOAD: 0xee to 0xf0. */
uint32_t pen_xcp_download_command(pen_xcp_t *xcp, const uint8_t in[], uint32_t n, uint8_t out[]);

/** Commands of pages: 0xe4, 0xe7 to 0xeb. */
uint32_t pen_xcp_page_command(pen_xcp_t *xcp, const uint8_t in[], uint8_t out[]);

/** The values of the tool's page. */
const pen_real_t *pen_xcp_page(const pen_xcp_t *xcp);

/** Write n bytes of the working page at the MTA, which is in it, and advance the MTA. */
uint32_t pen_xcp_write(pen_xcp_t *xcp, const uint8_t byte[], uint32_t n);

#define PEN_XCP_STAMP 0x10U /* mode of a DAQ list: time stamp */

/** A command that changes DAQ lists, 0xd3 to 0xd6 and 0xe0 to 0xe3. @param number  of its list, below daq->lists; else 0 */
uint32_t pen_xcp_list_command(pen_xcp_t *xcp, const uint8_t in[], uint32_t number);

/** Drop the open set; the working page is that of the running set. */
void pen_xcp_drop(pen_xcp_t *xcp);

#ifdef __cplusplus
}
#endif

#endif
