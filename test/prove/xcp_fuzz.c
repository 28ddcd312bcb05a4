/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * For libFuzzer: packets of all kinds to the XCP slave, steps, time and refusals between them. An oracle with pages of
 * its own, plain arrays, predicts each answer of the calibration commands to the bit, the values and the id of the set that
 * each step runs with, and that nothing else in memory has changed. Of the DAQ commands only form and bounds are checked.
 */
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "penode/pen_xcp_daq.h"

#define N       5U
#define SIZE    20U
#define LAYOUT  0x12345678U
#define SEGMENT 0x8000U
#define REGION  0x100U
#define ROOM    8U
#define FIRST   100U
#define QUIET   50U
#define SLOTS   6U

static const pen_model_t model = { .layout = LAYOUT, .length = N };
static pen_instance_t instance;
static pen_real_t *bank[2]; /* of their own size: the sanitizer finds what is written beside them */
static pen_real_t reference_value[N];
static pen_set_t reference;
static uint8_t memory[ROOM];
static const uint8_t name_text[5] = { 'n', 'a', 'm', 'e', '!' };
static const uint8_t step_text[4] = { 's', 't', 'e', 'p' };
static uint8_t *name_memory, *region_memory;
static pen_xcp_region_t region[1];
static pen_xcp_region_t name;
static pen_xcp_config_t config;
static pen_xcp_t xcp;
static pen_xcp_daq_t daq;
static uint8_t *ring;
static pen_status_t verdict;
static unsigned long long packets; /* sent so far, in all sequences */

/* For xcp_fuzz_check.py. */
__attribute__((destructor)) static void count(void)
{
    fprintf(stderr, "packets: %llu\n", packets);
}

static const uint8_t *at;
static size_t left;

static uint8_t byte(void)
{
    const uint8_t b = (left > 0U) ? *at : 0U;

    at += (left > 0U) ? 1U : 0U;
    left -= (left > 0U) ? 1U : 0U;
    return b;
}

static void expect(bool good, const char what[], uint32_t is, uint32_t should)
{
    if (!good) {
        fprintf(stderr, "oracle: %s: %x, not %x\n", what, is, should);
        abort();
    }
}

static pen_status_t commit(void)
{
    pen_set_t ready;
    const pen_status_t status = pen_tune_commit(&model, &instance, &ready);

    return pen_tune_publish(&model, &instance, NULL, &ready, (status == PEN_OK) ? verdict : status);
}

static pen_status_t choose(const pen_set_t *set)
{
    pen_set_t ready;
    const pen_status_t status = pen_tune_select(&model, &instance, set, &ready);

    return pen_tune_publish(&model, &instance, NULL, &ready, status);
}

#include "xcp_oracle.inc"

static void begin(uint32_t max_cto)
{
    for (uint32_t i = 0U; i < N; i++) {
        reference_value[i] = (pen_real_t)(i + 1U);
    }
    bank[0] = malloc(sizeof(pen_real_t) * N);
    bank[1] = malloc(sizeof(pen_real_t) * N);
    ring = malloc(SLOTS * (max_cto + 1U));
    name_memory = malloc(sizeof(name_text));
    memcpy(name_memory, name_text, sizeof(name_text));
    region_memory = malloc(ROOM);
    for (uint32_t i = 0U; i < ROOM; i++) {
        memory[i] = (uint8_t)(0xc0U + i);
    }
    memcpy(region_memory, memory, ROOM);
    reference = (pen_set_t){ { LAYOUT, N, 1U, pen_set_checksum(reference_value, N) }, reference_value };
    region[0] = (pen_xcp_region_t){ REGION, ROOM, region_memory };
    name = (pen_xcp_region_t){ 0U, sizeof(name_text), name_memory };
    config = (pen_xcp_config_t){ .instance = &instance,
                                 .layout = LAYOUT,
                                 .length = N,
                                 .reference = &reference,
                                 .commit = commit,
                                 .select = choose,
                                 .address = SEGMENT,
                                 .id = FIRST,
                                 .quiet = QUIET,
                                 .max_cto = max_cto,
                                 .regions = 1U,
                                 .region = region,
                                 .text = { NULL, &name },
                                 .daq = &daq,
                                 .daq_command = pen_xcp_daq_command };
    verdict = PEN_OK;
    pen_xcp_daq_init(&daq, ring, SLOTS, max_cto, 1U, 6U);
    expect(pen_ready(&model, &instance, NULL, pen_init(&model, &instance, &reference, bank[0], bank[1])) == PEN_OK, "init", 0U, 0U);
    expect(pen_xcp_init(&xcp, &config) == PEN_OK, "slave", 0U, 0U);
    memset(&o, 0, sizeof(o));
    memcpy(o.ref, reference_value, SIZE);
    memcpy(o.latest, o.ref, SIZE);
    memcpy(o.work, o.ref, SIZE);
    memcpy(o.run, o.ref, SIZE);
    o.isref = true;
    o.latest_id = 1U;
    o.run_id = 1U;
}

/* -- what is done ------------------------------------------------------------------------------------------------------- */

static void send(const uint8_t packet[], uint32_t n)
{
    uint8_t *const in = malloc((n > 0U) ? n : 1U); /* of its own size: no byte behind it is read */
    uint8_t *const out = malloc(config.max_cto);
    const bool sure = predict(packet, n);
    uint32_t answer;

    packets++;
    memcpy(in, packet, n);
    answer = pen_xcp_receive(&xcp, in, n, out);
    if (getenv("SHOW") != NULL) {
        fprintf(stderr, "%u:", n);
        for (uint32_t i = 0U; i < n; i++) {
            fprintf(stderr, " %02x", packet[i]);
        }
        fprintf(stderr, "  answer %u %02x %02x, wanted %u %02x %02x\n", answer, out[0], out[1], wanted, want[0], want[1]);
    }
    expect(!sure || (answer == wanted), "bytes of the answer", answer, wanted);
    for (uint32_t i = 0U; sure && (i < answer); i++) {
        const bool spare = (want[0] == 0xfeU) && ((i == 3U) || ((i == 2U) && (want[1] != 0x29U))); /* means nothing */
        expect(spare || (out[i] == want[i]), "byte of the answer", out[i], want[i]);
    }
    expect((answer <= config.max_cto) && ((answer == 0U) || (out[0] >= 0xfeU)), "form", answer, 0U);
    if (!sure && (packet[0] == 0xd7U) && (n >= 4U) && (n <= config.max_cto)) { /* GET_DAQ_EVENT_INFO */
        o.text = step_text;
        o.left = 4U;
    }
    free(in);
    free(out);
}

static void step(void)
{
    uint32_t slot = 9U;
    const pen_set_t *set;

    (void)pen_tuning_adopt(&instance.tuning, &slot);
    set = &instance.tuning.slot[slot];
    if (o.pending) {
        memcpy(o.run, o.latest, SIZE);
        o.run_id = o.latest_id;
        o.pending = false;
    }
    expect(set->head.id == o.run_id, "id in force", set->head.id, o.run_id);
    expect(memcmp(set->value, o.run, SIZE) == 0, "values in force", 0U, 0U);
    expect(memcmp(o.ref, reference_value, SIZE) == 0, "reference", 0U, 0U);
    expect((memcmp(region_memory, memory, ROOM) == 0) && (memcmp(name_memory, name_text, 5U) == 0), "memory", 0U, 0U);
    pen_xcp_sample(&xcp, slot);
}

static bool drain(void)
{
    uint8_t *const out = malloc(config.max_cto);
    uint32_t n = pen_xcp_daq_packet(&xcp, out);

    expect(n <= config.max_cto, "DAQ packet", n, config.max_cto);
    expect((n == 0U) || (out[0] < PEN_XCP_ODTS) || (out[0] == 0xfdU), "PID", out[0], 0U);
    free(out);
    return n > 0U;
}

static void elapse(uint32_t ms)
{
    uint8_t out[2];
    uint32_t should = 0U;
    uint32_t n;

    if ((o.idle < QUIET) && o.open && !o.torn && !o.isref) {
        o.idle = (ms >= (QUIET - o.idle)) ? QUIET : (o.idle + ms);
        should = ((o.idle == QUIET) && !try_commit() && o.connected) ? 2U : 0U;
    }
    n = pen_xcp_elapse(&xcp, ms, out);
    expect(n == should, "event", n, should);
}

/* A packet that is likely to mean something. */
static void likely(void)
{
    static const uint8_t commands[] = { 0xffU, 0xfeU, 0xfaU, 0xf6U, 0xf6U, 0xf5U, 0xf4U, 0xf3U, 0xf0U, 0xf0U, 0xefU, 0xeeU, 0xebU, 0xebU,
                                        0xeaU, 0xe4U, 0xe3U, 0xe2U, 0xe1U, 0xe0U, 0xdfU, 0xdeU, 0xddU, 0xd7U, 0xd6U, 0xd5U, 0xd4U, 0xd3U };
    uint8_t in[256] = { commands[byte() % sizeof(commands)] };
    const uint32_t n = config.max_cto;
    uint32_t address = ((byte() % 4U) == 0U) ? (REGION + (byte() % 12U) - 2U) : (SEGMENT + (byte() % 28U) - 4U);

    for (uint32_t i = 1U; i < n; i++) {
        in[i] = byte();
    }
    switch (in[0]) {
    case 0xf6U:
    case 0xf4U:
    case 0xe1U:
        in[1] = (in[0] == 0xe1U) ? 0xffU : (in[1] % 18U);
        in[2] %= 18U;
        in[3] = 0U;
        memcpy(&in[4], &address, 4U);
        break;
    case 0xf5U: in[1] %= 18U; break;
    case 0xf3U:
        address = in[4] % 22U;
        memcpy(&in[4], &address, 4U);
        break;
    case 0xf0U: in[1] %= 22U; break;
    case 0xefU: in[1] = ((in[1] % 8U) != 0U) ? (uint8_t)o.block : in[1]; break;
    default:
        for (uint32_t i = 1U; i < 8U; i++) {
            in[i] %= 4U; /* modes, segments, pages, lists */
        }
        break;
    }
    if (in[0] == 0xebU) {
        in[2] %= 2U;
        in[3] %= 2U;
    }
    send(in, ((byte() % 16U) == 0U) ? (byte() % n) : n);
}

static void any(void)
{
    uint8_t in[40] = { 0U };
    const uint32_t n = byte() % 20U;

    for (uint32_t i = 0U; i < n; i++) {
        in[i] = byte();
    }
    send(in, n);
}

static void send8(uint8_t a, uint8_t b, uint8_t c, uint8_t d, uint32_t address)
{
    uint8_t in[8] = { a, b, c, d };

    memcpy(&in[4], &address, 4U);
    send(in, 8U);
}

/* An edit, the switch, the reference, and a look at the working page: chance alone seldom has this order. */
static void pages(void)
{
    send8(0xf6U, 0U, 0U, 0U, SEGMENT + (byte() % SIZE));
    send8(0xf0U, 1U, byte() % 64U, 0U, 0U);
    send8(0xebU, 1U, 0U, 0U, 0U);
    step();
    send8(0xebU, 1U, 0U, byte() % 2U, 0U);
    step();
    send8(0xf6U, 0U, 0U, 0U, SEGMENT);
    send8(0xf5U, 7U, 0U, 0U, 0U);
    if ((byte() % 4U) == 0U) {
        send8(0xf6U, 0U, 0U, 0U, SEGMENT);
        send8(0xf0U, 16U, 0U, 0U, 0U); /* the first packet of a block, or too short for one */
        send8(0xebU, 1U, 0U, 0U, 0U);
    }
}

/* A list with one ODT, some of its entries written, some too large; started, sampled, changed while it runs or not. */
static void list(void)
{
    const uint8_t entries = 1U + (byte() % 3U);
    const uint32_t odts = 1U + (byte() % 3U);
    const uint32_t steps = byte() % 12U;
    const uint32_t room = (SLOTS - 1U) / odts; /* samples */
    const uint32_t should = (steps > room) ? ((room * odts) + 1U) : (steps * odts); /* packets, and an event */
    uint32_t sent = 0U;

    send8(0xd6U, 0U, 0U, 0U, 0U);
    send8(0xd5U, 0U, 1U, 0U, 0U);
    send8(0xd4U, 0U, 0U, 0U, odts);
    send8(0xd3U, 0U, 0U, 0U, (uint32_t)entries << 8U);
    send8(0xe2U, 0U, 0U, 0U, 0U);
    for (uint32_t i = byte() % 5U; i > 0U; i--) {
        send8(0xe1U, 0xffU, 1U + (byte() % ROOM), 0U, REGION);
    }
    expect(!o.connected || (daq.at <= daq.entries), "entry", daq.at, daq.entries);
    send8(0xe0U, (uint8_t)(16U * (byte() % 2U)), 0U, 0U, 0x00010000U);
    while (drain()) {
    }
    send8(0xdeU, 1U, 0U, 0U, 0U);
    for (uint32_t i = 0U; i < steps; i++) {
        step();
    }
    while ((xcp.sampling != 0U) && drain()) {
        sent++;
    }
    expect((xcp.sampling == 0U) || (sent == should), "packets", sent, should);
    if ((byte() % 2U) == 0U) {
        expect((xcp.sampling == 0U) || (daq.lists == 1U), "lists", daq.lists, 1U);
        send8(0xd3U, 0U, 0U, 0U, 0U);
        send8(0xe3U, 0U, 0U, 0U, 0U);
        step();
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const uint8_t connect[2] = { 0xffU, 0U };

    at = data;
    left = size;
    begin(((byte() % 2U) == 0U) ? 8U : 16U);
    send(connect, 2U);
    while (left > 0U) {
        switch (byte() % 16U) {
        case 0U:
        case 1U:
        case 2U: step(); break;
        case 3U: elapse(byte()); break;
        case 4U: (void)drain(); break;
        case 5U: any(); break;
        case 6U: verdict = ((byte() % 4U) == 0U) ? PEN_SET_PROMISE : PEN_OK; break;
        case 7U:
            if ((byte() % 8U) == 0U) {
                pen_xcp_disconnect(&xcp);
                session(false);
            }
            break;
        case 8U: pages(); break;
        case 9U: list(); break;
        default: likely(); break;
        }
    }
    step();
    free(bank[0]);
    free(bank[1]);
    free(ring);
    free(name_memory);
    free(region_memory);
    return 0;
}
