/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * xcp_preempt ALL FILE: packets to the XCP slave are pre-empted by a step with its DAQ sample, and such a step by a packet, once at each
 * boundary between two instructions, with and without a set that waits; for xcp_preempt_check.py. The delay before the
 * interrupt grows by TICKS from run to run. ALL and FILE: as of preempt.c.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "board.h"
#include "cortex_m.h"
#include "small.h"

#include "penode/pen_serial.h"
#include "penode/pen_xcp_daq.h"

#define BYTES   (SMALL_SET_LENGTH * 4U)
#define MAX_CTO 255U
#define SLOTS   16U
#define PAGE    0x10000U
#define PAIR    0x1000U
#define SAMPLE  13U /* bytes of a DAQ packet: PID, time, pair */

enum { DOWNLOAD, SWITCH, REFERENCE, COPY, CHECKSUM, CONNECT, DRAIN, STOP, FREE, KINDS };
enum { SOFT, KINKED, SETS }; /* the reference, what is written */

static const char *const name[KINDS] = { "download", "switch", "reference", "copy", "checksum", "connect", "drain", "stop", "free" };
static small_t model;
static small_banks_t banks;
static pen_xcp_t xcp;
static pen_xcp_daq_t daq;
static uint8_t ring[SLOTS * (MAX_CTO + 1U)];
static pen_real_t expected[SETS];
static bool step_interrupts;
static volatile uint32_t pair[2]; /* steps so far, and its complement: written by the step */

/* of one run */
static uint32_t kind;
static uint32_t in_force;
static uint32_t waiting; /* set, or SETS */
static volatile uint32_t target; /* set that the packet publishes, or SETS */
static bool good_answer;
static uint32_t drained; /* the pair that the last DAQ packet held */
static uint32_t failures;
static uint32_t runs;

#include "interrupt.inc"

static void expect(bool good, const char *what)
{
    if (!good) {
        if (failures < 10U) {
            board_print(step_interrupts ? "step in a packet, " : "packet in a step, ");
            board_print(name[kind]);
            board_print(" in run ");
            board_print_number(runs);
            board_print(": ");
            board_print(what);
            board_print("\n");
        }
        failures++;
    }
}

/* -- the slave ------------------------------------------------------------------------------------------------------ */

static pen_status_t commit(void)
{
    return small_tune_commit(&model);
}
static pen_status_t choose(const pen_set_t *set)
{
    return small_tune_select(&model, set);
}

static const pen_xcp_region_t region[] = { { PAIR, sizeof(pair), (const uint8_t *)(uintptr_t)pair } };
static const pen_xcp_config_t config = {
    .instance = &model.head,
    .layout = SMALL_LAYOUT,
    .length = SMALL_SET_LENGTH,
    .reference = &small_set_default,
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

static uint8_t out[MAX_CTO];

static bool send(uint32_t n, const uint8_t in[])
{
    return (pen_xcp_receive(&xcp, in, n, out) > 0U) && (out[0] == 0xffU);
}

static bool set_mta(void)
{
    return send(8U, (const uint8_t[]){ 0xf6U, 0U, 0U, 0U, 0U, 0U, 1U, 0U });
}
static bool set_page(uint8_t page)
{
    return send(4U, (const uint8_t[]){ 0xebU, 1U, 0U, page });
}

/* A whole set is short enough for one packet. */
static bool download(void)
{
    static uint8_t packet[2U + BYTES];

    packet[0] = 0xf0U;
    packet[1] = (uint8_t)BYTES;
    for (uint32_t i = 0U; i < BYTES; i++) {
        packet[2U + i] = ((const uint8_t *)small_set_kinked.value)[i];
    }
    return send(2U + BYTES, packet);
}

/* A list that samples the pair, `entries` numbers of it. */
static void make_list(uint8_t entries)
{
    bool good = send(4U, (const uint8_t[]){ 0xd5U, 0U, 1U, 0U }) && send(5U, (const uint8_t[]){ 0xd4U, 0U, 0U, 0U, 1U });

    good = good && send(6U, (const uint8_t[]){ 0xd3U, 0U, 0U, 0U, 0U, entries }) &&
           send(6U, (const uint8_t[]){ 0xe2U, 0U, 0U, 0U, 0U, 0U });
    for (uint8_t i = 0U; i < entries; i++) {
        good = good && send(8U, (const uint8_t[]){ 0xe1U, 0xffU, 4U, 0U, (uint8_t)(4U * i), 0x10U, 0U, 0U });
    }
    good = good && send(8U, (const uint8_t[]){ 0xe0U, 0x10U, 0U, 0U, 0U, 0U, 1U, 0U });
    expect(good, "list");
}

static void start_list(void)
{
    (void)send(1U, (const uint8_t[]){ 0xd6U });
    make_list(2U);
    expect(send(4U, (const uint8_t[]){ 0xdeU, 1U, 0U, 0U }), "start");
}

/* The samples that wait: whole, and one for each step. */
static void drain(uint32_t most)
{
    uint8_t packet[MAX_CTO];

    for (uint32_t k = 0U; k < most; k++) {
        const uint32_t n = pen_xcp_daq_packet(&xcp, packet);
        const uint32_t first = pen_serial_get(&packet[5]);
        if (n == 0U) {
            break;
        }
        expect((n == SAMPLE) && (packet[0] == 0U), "sample of another length");
        expect(first == ~pen_serial_get(&packet[9]), "torn sample");
        expect(first == (drained + 1U), "lost sample");
        drained = first;
    }
}

/* -- what interrupts and is interrupted ----------------------------------------------------------------------------- */

static const uint32_t published[KINDS] = { SETS, KINKED, SOFT, SETS, SETS, SETS, SETS, SETS, SETS };

__attribute__((noinline)) void the_packet(void)
{
    bool good = true;

    switch (kind) {
    case DOWNLOAD: good = download(); break;
    case SWITCH: good = set_page(0U); break;
    case REFERENCE: good = set_page(1U); break;
    case COPY: good = send(5U, (const uint8_t[]){ 0xe4U, 0U, 1U, 0U, 0U }); break;
    case CHECKSUM: good = send(8U, (const uint8_t[]){ 0xf3U, 0U, 0U, 0U, (uint8_t)BYTES, 0U, 0U, 0U }); break;
    case CONNECT: good = send(2U, (const uint8_t[]){ 0xffU, 0U }); break;
    case DRAIN: drain(1U); break;
    case STOP: good = send(2U, (const uint8_t[]){ 0xddU, 0U }); break;
    default:
        good = send(1U, (const uint8_t[]){ 0xd6U });
        if (good) {
            make_list(1U);
        }
        break;
    }
    good_answer = good;
}

static pen_status_t stepped;
static small_y_t y;

__attribute__((noinline)) void the_step(void)
{
    static const small_u_t u = { (pen_real_t)0.5 };
    const uint32_t now = pair[0] + 1U;

    stepped = small_step(&model, &u, &y);
    pair[0] = now;
    pair[1] = ~now;
    pen_xcp_sample(&xcp, now);
}

/* A step is that of one whole set: the one that waited, the one that the packet published, or the one before. */
static void judge(bool must, bool may)
{
    const bool adopts = (stepped & PEN_ADOPTED) != 0U;

    expect(!must || adopts, "lost");
    expect(may || !adopts, "adopted, and nobody asked");
    expect((stepped & ~PEN_ADOPTED) == PEN_OK, "flags");
    if (adopts) {
        in_force = (waiting != SETS) ? waiting : target;
        target = (waiting != SETS) ? target : SETS;
        waiting = SETS;
    }
    expect((in_force < SETS) && same(y.v, expected[in_force]), "torn");
}

/* -- the interrupt -------------------------------------------------------------------------------------------------- */

static void pre_empt(void)
{
    if (step_interrupts) {
        const bool due = (waiting != SETS);
        from_start();
        the_step();
        judge(due, due || (target != SETS));
    } else {
        the_packet();
    }
}

/* -- one run -------------------------------------------------------------------------------------------------------- */

static void adopt_kinked(void)
{
    expect(set_mta() && download() && set_page(0U), "kinked");
}

static void prepare(bool pending)
{
    in_force = SOFT;
    waiting = SETS;
    pair[0] = 0U;
    pair[1] = ~0U;
    drained = 0U;
    (void)small_init(&model, &small_set_default, &banks);
    for (uint32_t i = 0U; i < SLOTS; i++) {
        ring[i * (MAX_CTO + 1U)] = 0xa5U; /* no sample is that long */
    }
    pen_xcp_daq_init(&daq, ring, SLOTS, MAX_CTO, 1U, 8U);
    expect(pen_xcp_init(&xcp, &config) == PEN_OK, "init");
    expect(send(2U, (const uint8_t[]){ 0xffU, 0U }), "connect");
    start_list();
    the_step();
    if (kind == REFERENCE) { /* from another set */
        adopt_kinked();
        from_start();
        the_step();
        in_force = KINKED;
    }
    if (pending && (kind == REFERENCE)) { /* back and forth */
        (void)set_page(1U);
        waiting = SOFT;
    } else if (pending) {
        adopt_kinked();
        waiting = KINKED;
    } else if (kind == SWITCH) {
        (void)(set_mta() && download());
    } else {
        /* nothing is open, nothing waits */
    }
    if (!step_interrupts) {
        drain(SLOTS); /* so that a packet finds the sample that is being taken, if it finds any */
    }
    (void)set_mta();
    target = pending ? SETS : published[kind];
    from_start();
}

static void judge_answer(bool pending)
{
    const bool may_be_busy = pending && ((kind == DOWNLOAD) || (kind == COPY));
    const bool sampling = !step_interrupts && (kind == FREE);

    expect(good_answer || ((may_be_busy || sampling) && (out[1] == 0x10U)), "refused");
}

static void end(bool samples_go_on)
{
    const bool due = (waiting != SETS) || (target != SETS);

    from_start();
    the_step();
    judge(due, due);
    expect((waiting == SETS) && (target == SETS), "lost in the end");
    if (samples_go_on) {
        drain(SLOTS);
        expect(drained == pair[0], "samples missing in the end");
    }
    runs++;
}

/* Other names distinguish them from those that nothing interrupts. */
__attribute__((noinline)) void the_call(void)
{
    the_packet();
}

__attribute__((noinline)) void the_sample(void)
{
    the_step();
}

static void sweep(bool pending, bool all)
{
    const bool ends_list = (kind == CONNECT) || (kind == STOP) || (kind == FREE);
    uint32_t delay = all ? TICKS : 0U;
    bool early = false;

    while (!early) {
        prepare(pending);
        good_answer = true;
        if (step_interrupts) {
            early = interrupt(the_call, delay);
            judge_answer(pending);
        } else {
            early = interrupt(the_sample, delay);
            if (fired) {
                judge_answer(pending);
            } else {
                target = SETS;
            }
            judge(pending, pending || (target != SETS));
        }
        if (ends_list) {
            expect((kind != FREE) || !good_answer || (daq.entries == 1U) || (!step_interrupts && !fired), "list of another length");
            drain(SLOTS); /* what was sampled before is whole */
        }
        end(!ends_list);
        delay += TICKS;
    }
}

int main(void)
{
    char text[128];
    const bool all = board_argument(1U, text, sizeof(text)) && (text[0] == '1');
    const int32_t file = board_argument(2U, text, sizeof(text)) ? board_open(text, true) : -1;

    take_vector();
    (void)small_init(&model, &small_set_default, &banks);
    (void)pen_xcp_daq_init(&daq, ring, SLOTS, MAX_CTO, 1U, 8U);
    (void)pen_xcp_init(&xcp, &config);
    for (uint32_t s = 0U; s < SETS; s++) {
        (void)small_init(&model, (s == SOFT) ? &small_set_default : &small_set_kinked, &banks);
        the_step();
        from_start();
        the_step();
        expected[s] = y.v;
    }
    expect(!same(expected[SOFT], expected[KINKED]), "sets are alike");
    for (uint32_t way = 0U; way < 2U; way++) {
        step_interrupts = (way == 0U);
        runs = 0U;
        for (kind = DOWNLOAD; kind < KINDS; kind++) {
            sweep(false, all);
            sweep(true, all);
        }
        board_print(step_interrupts ? "packets interrupted " : "steps interrupted ");
        board_print_number(runs);
        board_print("\n");
    }
    board_print("failures ");
    board_print_number(failures);
    board_print("\n");
    keep_met(file);
    return (failures == 0U) ? 0 : 1;
}
