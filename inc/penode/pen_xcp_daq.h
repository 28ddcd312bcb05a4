/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * DAQ lists of the XCP slave (penode/pen_xcp.h): samples of the regions of the configuration, taken between two steps and
 * sent as packets. Dynamic lists; one event, 0, the step; prescaler; time stamps of 4 bytes in microseconds; identification
 * by absolute ODT number. A sample that finds no room in the ring is left out as a whole and reported by
 * EV_DAQ_OVERLOAD.
 *
 *   step                             tuning
 *   pen_xcp_sample  -> ring ->       pen_xcp_daq_packet -> transport
 *
 * The step writes the ring and `head`, the tuning context `tail` and the lists; lists change only while none runs, and no
 * sample is being taken (`busy`): else ERR_DAQ_ACTIVE, ERR_CMD_BUSY.
 */
#ifndef PEN_XCP_DAQ_H
#define PEN_XCP_DAQ_H

#include <stdint.h>

#include "penode/pen_xcp.h"

#ifdef __cplusplus
extern "C" {
#endif

#define PEN_XCP_LISTS   4U
#define PEN_XCP_ODTS    32U
#define PEN_XCP_ENTRIES 64U

typedef struct {
    const uint8_t *byte; /* NULL: not written yet */
    uint32_t size;
} pen_xcp_entry_t;

typedef struct {
    uint8_t first;   /* of entry[] */
    uint8_t entries;
} pen_xcp_odt_t;

typedef struct {
    uint8_t first;     /* of odt[]                               */
    uint8_t odts;
    uint8_t mode;      /* 0x10: with time stamp                  */
    uint8_t prescaler;
    uint8_t wait;      /* steps until the next sample, that one included; 0: the next step; the step's */
} pen_xcp_list_t;

/** Lists and ring. Owned by the caller; use it only through the functions below. */
struct pen_xcp_daq {
    pen_xcp_list_t list[PEN_XCP_LISTS];
    uint8_t lists;
    uint8_t odts;
    uint8_t entries;
    uint8_t selected;           /* lists, a bit each                 */
    uint8_t at;                 /* of the DAQ pointer: entry         */
    uint8_t left;               /* entries of the ODT from there on  */
    uint8_t cycle;              /* of the event: GET_DAQ_EVENT_INFO  */
    uint8_t unit;               /* of the cycle: 6 is 1 ms           */
    uint32_t slots;             /* of the ring                       */
    uint32_t size;              /* of a slot: length, packet         */
    uint8_t *ring;              /* [slots * size]                    */
    volatile uint32_t head;     /* next slot that the step fills     */
    volatile uint32_t tail;     /* next slot to send                 */
    volatile uint32_t busy;     /* 1: a sample is being taken        */
    volatile uint32_t overload; /* 1: a sample was left out          */
    volatile uint32_t time;     /* of the last sample                */
    pen_xcp_odt_t odt[PEN_XCP_ODTS];
    pen_xcp_entry_t entry[PEN_XCP_ENTRIES];
};

/**
 * Before pen_xcp_init.
 * @param ring   [slots * (max_cto + 1)]; one slot stays free
 * @param max_cto  as in the configuration
 * @param cycle, unit  time between two samples, as the standard codes it: 1, 6 for 1 ms
 */
void pen_xcp_daq_init(pen_xcp_daq_t *daq, uint8_t ring[], uint32_t slots, uint32_t max_cto, uint8_t cycle, uint8_t unit);

/** For daq_command of the configuration. */
uint32_t pen_xcp_daq_command(pen_xcp_t *xcp, const uint8_t in[], uint32_t n, uint8_t out[]);

/**
 * After each step. Context: step.
 * @param time  microseconds; wraps
 * Cost: linear in the bytes of the lists that run
 */
void pen_xcp_sample(pen_xcp_t *xcp, uint32_t time);

/** The next packet to send. Context: tuning. @param out  [max_cto] @return bytes of it; 0: none */
uint32_t pen_xcp_daq_packet(pen_xcp_t *xcp, uint8_t out[]);

#ifdef __cplusplus
}
#endif

#endif
