/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * XCP 1.x slave: calibrate a running model with the tools of the field. One packet in, at most one out; the transport,
 * with its header, is the caller's (port/xcp). No heap, no libc, no waiting; all state is in pen_xcp_t.
 *
 * One segment, number 0, with two pages of NAME_SET_LENGTH values, in the order of the layout table:
 *   page 1, reference   the set of the configuration, in flash: read only
 *   page 0, working     the open set, if there is one; else the set that runs; while the reference runs, the one before
 *
 *   DOWNLOAD                opens a copy of the working page in the bank that is free. The step does not see it.
 *   BUILD_CHECKSUM          CRC-32 of the serial form (penode/pen_serial.h): proves a transfer before the switch
 *   SET_CAL_PAGE(ECU, 0)    commits the open set: length, checksum, finite values, promises, trial. The answer comes at
 *                           commit; the next step adopts the set, all or none. Refused: ERR_GENERIC with the
 *                           pen_status_t in bytes 4 to 7; the set stays open, the running set in force.
 *   SET_CAL_PAGE(ECU, 1)    selects the reference; the working page keeps its values
 *   SET_CAL_PAGE(XCP, p)    what UPLOAD, DOWNLOAD and BUILD_CHECKSUM mean by an address of the segment
 *   COPY_CAL_PAGE(1 to 0)   opens a copy of the reference
 *   CONNECT, DISCONNECT     drop an open set; the working page is that of the running set
 * `quiet` ms after the last DOWNLOAD the open set is committed without SET_CAL_PAGE, if the ECU is on page 0 and no
 * block is unfinished; refused: EV_USER, and NAME_status has the reason. Off (0) unless a tool expects it: a transfer
 * that pauses longer would come into force in parts. GET_CAL_PAGE(ECU) returns 1 while the reference runs,
 * else 0. Until a step has adopted a committed set, DOWNLOAD is answered by ERR_CMD_BUSY. All errors have 8 bytes: 0xfe,
 * code, the count expected (ERR_SEQUENCE of a block), one that means nothing, and the pen_status_t of the tuning call that
 * has refused (ERR_GENERIC, ERR_CMD_BUSY), else 0.
 *
 * Nothing but the open set can be written. Only the pages, the regions of the configuration and the texts of GET_ID can
 * be read; any other address is ERR_ACCESS_DENIED. The byte order is that of the core; CONNECT reports it.
 *
 * Context: tuning (penode/pen_set.h); while a master is connected, the slave is the one tuner. UPLOAD may show a value
 * that the step is just writing in parts; DAQ lists (penode/pen_xcp_daq.h) never do.
 */
#ifndef PEN_XCP_H
#define PEN_XCP_H

#include <stdbool.h>
#include <stdint.h>

#include "penode/pen_instance.h"
#include "penode/pen_set.h"
#include "penode/pen_status.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Memory that a master may read; for a text, the address means nothing. */
typedef struct {
    uint32_t address;    /* as in the A2L */
    uint32_t size;       /* bytes         */
    const uint8_t *byte; /* [size]        */
} pen_xcp_region_t;

#define PEN_XCP_CAL 0x01U /* resources, for `protect` and the hooks */
#define PEN_XCP_DAQ 0x04U

#define PEN_XCP_TEXTS 6U /* types of GET_ID: 0 a text, 1 name of the A2L without path and extension, 4 the A2L itself, 5 EPK */

typedef struct pen_xcp pen_xcp_t;
typedef struct pen_xcp_daq pen_xcp_daq_t;
typedef uint32_t (*pen_xcp_command_t)(pen_xcp_t *xcp, const uint8_t in[], uint32_t n, uint8_t out[]);

/** What not every slave needs. A seed and a key fit one packet each. */
typedef struct {
    uint32_t (*seed)(uint8_t resource, uint8_t seed[]);                /* writes up to max_cto - 2 bytes; how many  */
    bool (*unlock)(uint8_t resource, uint32_t n, const uint8_t key[]); /* true: the key fits; both NULL: no keys    */
    bool freeze;                                                       /* the caller stores: pen_xcp_to_store       */
} pen_xcp_options_t;

/** What the slave is for. Constant; borrowed for as long as the slave is used. */
typedef struct {
    pen_instance_t *instance;                     /* head of the instance: &model.head                               */
    uint32_t layout;                              /* NAME_LAYOUT                                                     */
    uint32_t length;                              /* NAME_SET_LENGTH                                                 */
    const pen_set_t *reference;                   /* such as &NAME_set_default                                       */
    pen_status_t (*commit)(void);                 /* calls NAME_tune_commit for the instance                         */
    pen_status_t (*select)(const pen_set_t *set); /* calls NAME_tune_select for the instance                         */
    uint32_t address;                             /* of both pages, as in the A2L: that of the set in flash, say     */
    uint32_t id;                                  /* of the first set that is opened; each further one has 1 more    */
    uint32_t quiet;                               /* ms; 0: off                                                      */
    uint32_t max_cto;                             /* bytes of a packet: 8 on CAN, 64 on CAN FD, at most 255          */
    uint32_t regions;                             /* of region[]                                                     */
    const pen_xcp_region_t *region;               /* [regions]                                                       */
    const pen_xcp_region_t *text[PEN_XCP_TEXTS];  /* of GET_ID; NULL: none                                           */
    uint32_t protect;                             /* resources that need a key: PEN_XCP_CAL, PEN_XCP_DAQ; 0: none    */
    const pen_xcp_options_t *options;             /* keys, storing; NULL: none                                       */
    pen_xcp_command_t options_command;            /* pen_xcp_options_command, or NULL: not linked then               */
    pen_xcp_daq_t *daq;                           /* NULL: no DAQ                                                    */
    pen_xcp_command_t daq_command;                /* pen_xcp_daq_command, or NULL: not linked then                   */
} pen_xcp_config_t;

/** One slave. Owned by the caller; use it only through the functions below. Bytes first: shorter code on a Cortex-M. */
struct pen_xcp {
    const pen_xcp_config_t *config;
    bool connected;
    bool refused;               /* the block has failed: the rest of it is ignored                               */
    bool torn;                  /* a block is unfinished: no commit                                              */
    uint8_t answer;             /* bytes of the answer                                                           */
    uint8_t page;               /* of the tool                                                                   */
    uint8_t block;              /* bytes of a block of DOWNLOADs that are still to come                          */
    uint8_t locked;             /* resources                                                                     */
    uint8_t asked;              /* resource of the last GET_SEED                                                 */
    uint8_t frozen;             /* 1: segment mode FREEZE                                                        */
    uint8_t store;              /* 1: STORE_CAL requested                                                        */
    pen_tuning_t *tuning;       /* of the instance                                                               */
    const uint8_t *text;        /* GET_ID: what UPLOAD reads next; NULL: the address does                        */
    uint32_t left;              /* bytes of it                                                                   */
    uint32_t mta;               /* memory transfer address                                                       */
    uint32_t sets;              /* opened so far                                                                 */
    uint32_t idle;              /* ms since the last DOWNLOAD; `quiet`: no automatic commit                      */
    pen_status_t status;        /* for bytes 4 to 7 of an error                                                  */
    const pen_real_t *kept;     /* the working page while the reference runs                                     */
    const pen_real_t *waiting;  /* the set published last                                                        */
    volatile uint32_t sampling; /* DAQ lists that run, a bit each                                                */
};

/**
 * Start, not connected. The instance must be initialised, with banks.
 * @return PEN_OK; PEN_SET_BADARG: NULL, max_cto outside of 8 to 255, an instance that is not initialised
 */
pen_status_t pen_xcp_init(pen_xcp_t *xcp, const pen_xcp_config_t *config);

/**
 * A packet from the master.
 * @param n    bytes of it; more than the command needs (CAN fill) is ignored
 * @param out  [max_cto] the answer
 * @return bytes of the answer; 0: none
 * Cost: linear in n, but for: opening a set (a copy of it), BUILD_CHECKSUM (10 instructions a byte), a commit
 */
uint32_t pen_xcp_receive(pen_xcp_t *xcp, const uint8_t in[], uint32_t n, uint8_t out[]);

/**
 * Time goes by; for `quiet`.
 * @param ms   since the last call
 * @param out  [2] an event
 * @return bytes of it; 0: none
 */
uint32_t pen_xcp_elapse(pen_xcp_t *xcp, uint32_t ms, uint8_t out[]);

/** The connection has gone: as DISCONNECT. */
void pen_xcp_disconnect(pen_xcp_t *xcp);

/** GET_SEED, UNLOCK, SET_REQUEST(STORE_CAL), SEGMENT_MODE: for options_command of the configuration. */
uint32_t pen_xcp_options_command(pen_xcp_t *xcp, const uint8_t in[], uint32_t n, uint8_t out[]);

/** The set to store in flash, if the master has asked for it and the step has adopted it; else NULL. */
const pen_set_t *pen_xcp_to_store(pen_xcp_t *xcp);

/** It is stored. @param out  [2] an event @return bytes of it; 0: none */
uint32_t pen_xcp_stored(pen_xcp_t *xcp, uint8_t out[]);

#ifdef __cplusplus
}
#endif

#endif
