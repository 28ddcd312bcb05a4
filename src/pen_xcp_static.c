/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* DAQ lists of fixed size, in front of the slave: what a packet must not reach is replaced, what an answer lacks is added. */

#include "penode/pen_exact.h"

#include "penode/pen_xcp_static.h"

#include <stddef.h>

#include "penode/pen_port.h"
#include "penode/pen_xcp_parts.h"

#define XCP_STAMPED        5U    /* bytes before the entries of a first ODT: number, time stamp */
#define XCP_STATIC         0xfeU /* all properties but: dynamic */
#define XCP_PREDEFINED     0x07U /* properties of a list: predefined, its event is fixed, DAQ */
#define XCP_CONFIGURABLE   0x06U
#define XCP_CODE_NONE      0xd0U /* a command that there is not */
#define XCP_CODE_INFO      0xd8U
#define XCP_CODE_PROCESSOR 0xdaU
#define XCP_CODE_MODE      0xe0U
#define XCP_CODE_WRITE     0xe1U
#define XCP_CODE_POINTER   0xe2U
#define XCP_CODE_CLEAR     0xe3U

static uint32_t xcp_predefined(const pen_xcp_statics_t *statics)
{
    uint32_t n = 0U;

    while ((n < statics->lists) && (statics->list[n].entry != NULL)) {
        n++;
    }
    return n;
}

/* Has each ODT of a predefined list room in a packet? */
static bool xcp_fits(const pen_xcp_static_t *list, uint32_t max_cto)
{
    bool good = true;

    for (uint32_t i = 0U; i < list->odts; i++) {
        uint32_t n = (i == 0U) ? XCP_STAMPED : 1U;
        for (uint32_t k = 0U; k < list->entries; k++) {
            const uint32_t size = list->entry[(i * list->entries) + k].size;
            good = good && (size <= max_cto);
            n += size;
        }
        good = good && (n <= max_cto);
    }
    return good;
}

static bool xcp_possible(const pen_xcp_daq_t *daq, const pen_xcp_statics_t *statics)
{
    const uint32_t predefined = xcp_predefined(statics);
    bool good = (statics->lists <= PEN_XCP_LISTS);
    uint32_t odts = 0U;
    uint32_t entries = 0U;

    for (uint32_t i = 0U; good && (i < statics->lists); i++) {
        const pen_xcp_static_t *const list = &statics->list[i];
        odts += list->odts;
        entries += (uint32_t)list->odts * list->entries;
        good = (list->odts > 0U) && (list->entries > 0U) && (odts <= PEN_XCP_ODTS) && (entries <= PEN_XCP_ENTRIES);
        if (good && (list->entry != NULL)) {
            good = (i < predefined) && xcp_fits(list, daq->size - 1U);
        }
    }
    return good;
}

/* An entry of a list in the state that it has before a master writes it. */
static pen_xcp_entry_t xcp_initial(const pen_xcp_static_t *list, uint32_t k)
{
    static const uint8_t nothing[1] = { 0U }; /* the address of entries of size 0 */
    pen_xcp_entry_t entry = { nothing, 0U };

    if ((list->entry != NULL) && (list->entry[k].size > 0U)) {
        entry = list->entry[k];
    }
    return entry;
}

static void xcp_reset(pen_xcp_daq_t *daq, const pen_xcp_static_t *list, uint32_t first)
{
    for (uint32_t k = 0U; k < ((uint32_t)list->odts * list->entries); k++) {
        daq->entry[first + k] = xcp_initial(list, k);
    }
}

/* ODTs up to the last one that has an entry: what a sample sends. */
static uint8_t xcp_used(const pen_xcp_daq_t *daq, const pen_xcp_static_t *list, uint32_t first)
{
    uint32_t used = 0U;

    for (uint32_t k = 0U; k < ((uint32_t)list->odts * list->entries); k++) {
        if (daq->entry[first + k].size > 0U) {
            used = (k / list->entries) + 1U;
        }
    }
    return (uint8_t)used;
}

/* Number of ODTs of each list: all of them, or those that are used. Only while nothing is sampled. */
static void xcp_size_lists(pen_xcp_daq_t *daq, const pen_xcp_statics_t *statics, bool whole)
{
    for (uint32_t i = 0U; i < statics->lists; i++) {
        pen_xcp_list_t *const list = &daq->list[i];
        list->odts = whole ? statics->list[i].odts : xcp_used(daq, &statics->list[i], daq->odt[list->first].first);
    }
}

static void xcp_lay_out(pen_xcp_daq_t *daq, const pen_xcp_static_t *from, pen_xcp_list_t *list)
{
    list->first = daq->odts;
    list->mode = 0U;
    list->prescaler = 1U;
    xcp_reset(daq, from, daq->entries);
    for (uint32_t k = 0U; k < from->odts; k++) {
        daq->odt[daq->odts].first = daq->entries;
        daq->odt[daq->odts].entries = from->entries;
        daq->odts++;
        daq->entries += from->entries;
    }
}

pen_status_t pen_xcp_static_init(pen_xcp_daq_t *daq, const pen_xcp_statics_t *statics)
{
    const bool good = xcp_possible(daq, statics);

    if (good) {
        daq->odts = 0U;
        daq->entries = 0U;
        daq->lists = (uint8_t)statics->lists;
        for (uint32_t i = 0U; i < statics->lists; i++) {
            xcp_lay_out(daq, &statics->list[i], &daq->list[i]);
        }
        xcp_size_lists(daq, statics, false);
    }
    return good ? PEN_OK : PEN_SET_BADARG;
}

/* -- commands ------------------------------------------------------------------------------------------------------------ */

static uint32_t xcp_fail(uint8_t out[], uint32_t error)
{
    out[1] = (uint8_t)error;
    return 8U;
}

/* The slave has answered ERR_CMD_UNKNOWN: connected, DAQ is not locked. */
static uint32_t xcp_list_info(const pen_xcp_statics_t *statics, const uint8_t in[], uint32_t n, uint8_t out[])
{
    const uint32_t number = (n >= 4U) ? pen_xcp_get(&in[2], 2U) : 0U;
    uint32_t answer;

    if (n < 4U) {
        answer = xcp_fail(out, PEN_XCP_SYNTAX);
    } else if (number >= statics->lists) {
        answer = xcp_fail(out, PEN_XCP_RANGE);
    } else {
        const pen_xcp_static_t *const list = &statics->list[number];
        out[0] = 0xffU;
        out[1] = (list->entry != NULL) ? XCP_PREDEFINED : XCP_CONFIGURABLE;
        out[2] = list->odts;
        out[3] = list->entries;
        answer = 6U; /* bytes 4 and 5: event 0 */
    }
    return answer;
}

/* Of a predefined list: SET_DAQ_PTR and CLEAR_DAQ_LIST must not reach its entries. */
static uint32_t xcp_protect(pen_xcp_t *xcp, const uint8_t in[], uint32_t n, uint8_t out[])
{
    const uint8_t reset[8] = { XCP_CODE_MODE, 0U, in[2], in[3], 0U, 0U, 1U, 0U };
    uint32_t answer = pen_xcp_receive(xcp, reset, 8U, out);

    if ((out[0] == 0xffU) && (in[0] == XCP_CODE_POINTER)) {
        xcp->config->daq->left = 0U;
        out[0] = 0xfeU;
        answer = xcp_fail(out, (n >= 6U) ? PEN_XCP_WRITE_PROTECTED : PEN_XCP_SYNTAX);
    }
    return answer;
}

/* WRITE_DAQ, SET_DAQ_PTR and CLEAR_DAQ_LIST see lists of their full size. */
static uint32_t xcp_change(pen_xcp_t *xcp, const pen_xcp_statics_t *statics, const uint8_t in[], uint32_t n, uint8_t out[])
{
    pen_xcp_daq_t *const daq = xcp->config->daq;
    const bool rests = (pen_port_load(&xcp->sampling) == 0U) && (pen_port_load(&daq->busy) == 0U);
    uint32_t answer;

    if (rests) {
        xcp_size_lists(daq, statics, true);
    }
    answer = pen_xcp_receive(xcp, in, n, out);
    if (rests) {
        if ((answer == 1U) && (in[0] == XCP_CODE_CLEAR)) {
            const uint32_t number = pen_xcp_get(&in[2], 2U);
            xcp_reset(daq, &statics->list[number], daq->odt[daq->list[number].first].first);
        }
        xcp_size_lists(daq, statics, false);
    }
    return answer;
}

uint32_t pen_xcp_static_receive(pen_xcp_t *xcp, const pen_xcp_statics_t *statics, const uint8_t in[], uint32_t n, uint8_t out[])
{
    static const uint8_t none[1] = { XCP_CODE_NONE };
    const uint32_t code = (n > 0U) ? in[0] : 0U;
    const bool lists = ((code >= XCP_CODE_WRITE) && (code <= XCP_CODE_CLEAR));
    uint32_t answer;

    if ((code >= 0xd3U) && (code <= 0xd6U)) { /* ALLOC_..., FREE_DAQ */
        answer = pen_xcp_receive(xcp, none, 1U, out);
    } else if (code == XCP_CODE_INFO) {
        answer = pen_xcp_receive(xcp, none, 1U, out);
        if ((answer > 0U) && (out[1] == PEN_XCP_UNKNOWN)) {
            answer = xcp_list_info(statics, in, n, out);
        }
    } else if (lists && (code != XCP_CODE_WRITE) && (n >= 4U) && (pen_xcp_get(&in[2], 2U) < xcp_predefined(statics))) {
        answer = xcp_protect(xcp, in, n, out);
    } else if (lists) {
        answer = xcp_change(xcp, statics, in, n, out);
    } else {
        answer = pen_xcp_receive(xcp, in, n, out);
        if ((answer > 0U) && (out[0] == 0xffU) && (code == XCP_CODE_PROCESSOR)) {
            out[1] &= XCP_STATIC;
            out[6] = (uint8_t)xcp_predefined(statics); /* MIN_DAQ */
        }
    }
    return answer;
}
