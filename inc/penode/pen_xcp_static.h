/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * Static DAQ lists of the XCP slave (penode/pen_xcp_daq.h): their number and size are fixed when the program is built; for
 * masters that cannot allocate lists, and for measurements that come with the program. A layer in front of
 * pen_xcp_receive: programs with dynamic lists do not link it.
 *
 *   predefined    a list whose entries are constants of the program. They stand first: numbers 0 to MIN_DAQ - 1.
 *   configurable  a list whose entries the master writes: CLEAR_DAQ_LIST, SET_DAQ_PTR, WRITE_DAQ. Entries that it leaves out
 *                 are not sent, nor are the ODTs behind the last one that has any.
 *
 * GET_DAQ_LIST_INFO answers; FREE_DAQ and ALLOC_... are ERR_CMD_UNKNOWN; SET_DAQ_PTR to a predefined list is
 * ERR_WRITE_PROTECTED, CLEAR_DAQ_LIST resets its mode. All else is as for dynamic lists.
 */
#ifndef PEN_XCP_STATIC_H
#define PEN_XCP_STATIC_H

#include <stdint.h>

#include "penode/pen_xcp_daq.h"

#ifdef __cplusplus
extern "C" {
#endif

/** A list. Constant; borrowed for as long as the slave is used. */
typedef struct {
    uint8_t odts;                 /* of the list, at least 1                                                   */
    uint8_t entries;              /* of each ODT, at least 1                                                   */
    const pen_xcp_entry_t *entry; /* [odts * entries], ODT by ODT, size 0: none; NULL: a configurable list     */
} pen_xcp_static_t;

/** All lists: at most PEN_XCP_LISTS, PEN_XCP_ODTS, PEN_XCP_ENTRIES in all. */
typedef struct {
    uint32_t lists;
    const pen_xcp_static_t *list; /* [lists], predefined ones first */
} pen_xcp_statics_t;

/**
 * After pen_xcp_daq_init, before the first packet.
 * @return PEN_OK; PEN_SET_BADARG: too many, a list without ODTs or entries, a predefined one after a configurable one, or with
 *         an ODT that no packet has room for (with a time stamp in the first)
 */
pen_status_t pen_xcp_static_init(pen_xcp_daq_t *daq, const pen_xcp_statics_t *statics);

/** In place of pen_xcp_receive. Cost: that of pen_xcp_receive; of commands that change lists, linear in their entries more */
uint32_t pen_xcp_static_receive(pen_xcp_t *xcp, const pen_xcp_statics_t *statics, const uint8_t in[], uint32_t n, uint8_t out[]);

#ifdef __cplusplus
}
#endif

#endif
