/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* Prints what packets to the XCP slave of nqvm cost, in instructions; for xcp_cost_check.py. */
#include <stddef.h>
#include <stdint.h>

#include "board.h"
#include "nqvm.h"

#include "penode/pen_xcp_daq.h"

#define MAX_CTO 64U
#define SLOTS   8U
#define PAGE    0x10000U
#define SHOWN   0x1000U
#define BYTES   (NQVM_SET_LENGTH * (uint32_t)sizeof(pen_real_t))

static nqvm_t model;
static nqvm_banks_t banks;
static pen_xcp_t xcp;
static pen_xcp_daq_t daq;
static uint8_t ring[SLOTS * (MAX_CTO + 1U)];
static pen_real_t shown[8];
static uint8_t out[MAX_CTO];

static pen_status_t commit(void)
{
    return nqvm_tune_commit(&model);
}
static pen_status_t choose(const pen_set_t *set)
{
    return nqvm_tune_select(&model, set);
}

static const pen_xcp_region_t region[] = { { SHOWN, sizeof(shown), (const uint8_t *)shown } };
static const pen_xcp_config_t config = {
    .instance = &model.head,
    .layout = NQVM_LAYOUT,
    .length = NQVM_SET_LENGTH,
    .reference = &nqvm_set_default,
    .commit = commit,
    .select = choose,
    .address = PAGE,
    .id = 1000U,
    .max_cto = MAX_CTO,
    .regions = 1U,
    .region = region,
    .daq = &daq,
    .daq_command = pen_xcp_daq_command,
};

static void tell(const char *name, uint32_t n)
{
    board_print(name);
    board_print(" ");
    board_print_number(n);
    board_print("\n");
}

/* One packet; printed if it has a name. */
static void send(const char *name, uint32_t n, const uint8_t in[])
{
    uint32_t cost;

    board_count_start();
    const uint32_t answer = pen_xcp_receive(&xcp, in, n, out);
    cost = board_count_stop();
    if ((answer == 0U) || (out[0] != 0xffU)) {
        tell("refused", in[0]);
    }
    if (name != NULL) {
        tell(name, cost);
    }
}

static void step(void)
{
    static const nqvm_u_t u = { (pen_real_t)0.01 };
    nqvm_y_t y;

    (void)nqvm_step(&model, &u, &y);
}

static void measure_lists(void)
{
    send(NULL, 1U, (const uint8_t[]){ 0xd6U });
    send(NULL, 4U, (const uint8_t[]){ 0xd5U, 0U, 1U, 0U });
    send(NULL, 5U, (const uint8_t[]){ 0xd4U, 0U, 0U, 0U, 1U });
    send(NULL, 6U, (const uint8_t[]){ 0xd3U, 0U, 0U, 0U, 0U, 8U });
    send(NULL, 6U, (const uint8_t[]){ 0xe2U, 0U, 0U, 0U, 0U, 0U });
    for (uint32_t i = 0U; i < 8U; i++) {
        send((i == 7U) ? "WRITE_DAQ" : NULL, 8U, (const uint8_t[]){ 0xe1U, 0xffU, 4U, 0U, (uint8_t)(4U * i), 0x10U, 0U, 0U });
    }
    send(NULL, 8U, (const uint8_t[]){ 0xe0U, 0x10U, 0U, 0U, 0U, 0U, 1U, 0U });
    board_count_start();
    pen_xcp_sample(&xcp, 0U);
    tell("sample, no list runs", board_count_stop());
    send("START_STOP_DAQ_LIST", 4U, (const uint8_t[]){ 0xdeU, 1U, 0U, 0U });
    board_count_start();
    pen_xcp_sample(&xcp, 1000U);
    tell("sample, 8 signals", board_count_stop());
    board_count_start();
    (void)pen_xcp_daq_packet(&xcp, out);
    tell("DAQ packet, 8 signals", board_count_stop());
}

int main(void)
{
    static uint8_t packet[MAX_CTO] = { 0xf0U, 62U };
    static const uint8_t mta[8] = { 0xf6U, 0U, 0U, 0U, 0U, 0U, 1U, 0U };

    (void)nqvm_init(&model, &nqvm_set_default, &banks);
    pen_xcp_daq_init(&daq, ring, SLOTS, MAX_CTO, 1U, 6U);
    (void)pen_xcp_init(&xcp, &config);
    send("CONNECT", 2U, (const uint8_t[]){ 0xffU, 0U });
    send("GET_STATUS", 1U, (const uint8_t[]){ 0xfdU });
    send("SET_MTA", sizeof(mta), mta);
    send("UPLOAD of 63 bytes", 2U, (const uint8_t[]){ 0xf5U, 63U });
    for (uint32_t i = 0U; i < 62U; i++) {
        packet[2U + i] = (uint8_t)(i & 0x1fU);
    }
    send(NULL, sizeof(mta), mta);
    send("DOWNLOAD of 62 bytes, the first", MAX_CTO, packet);
    send("DOWNLOAD of 62 bytes, others", MAX_CTO, packet);
    send(NULL, sizeof(mta), mta);
    send("BUILD_CHECKSUM of 4792 bytes", 8U,
         (const uint8_t[]){ 0xf3U, 0U, 0U, 0U, (uint8_t)(BYTES & 0xffU), (uint8_t)(BYTES >> 8U), 0U, 0U });
    send("SET_CAL_PAGE(ECU, 0), a commit", 4U, (const uint8_t[]){ 0xebU, 1U, 0U, 0U });
    step();
    send("SET_CAL_PAGE(ECU, 1)", 4U, (const uint8_t[]){ 0xebU, 1U, 0U, 1U });
    step();
    measure_lists();
    return 0;
}
