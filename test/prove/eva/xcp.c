/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * For Frama-C: the XCP slave, a command at a time, each from every state that its invariants allow; they are checked again
 * afterwards (unchanged()), so they hold after any sequence of packets.
 *
 *   a packet of n bytes ends where its array does: what is read behind it is an alarm
 *   lists    first + odts <= PEN_XCP_ODTS; ODTs: first + entries <= PEN_XCP_ENTRIES; the pointer: at + left <= PEN_XCP_ENTRIES
 *   entries  NULL, or inside the region; a list that runs is complete
 *   texts    the rest that is left is inside
 *
 * Intervals do not express these sums, so one of their terms takes each of its values in turn, in loops that are unrolled. ODTs of
 * a list are alike, and the entries of an ODT: what a loop does with one of them depends on no other but by the bytes so far, and those
 * are the same for any sizes of the same sum. Tuning state: any bytes; its addresses, any of the buffers.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "__fc_builtin.h"

#include "penode/pen_xcp_parts.h"
#include "penode/pen_xcp_static.h"

extern volatile uint32_t any; /* each read gives any number */

#define N       5U
#define SIZE    (N * (uint32_t)sizeof(pen_real_t))
#define LAYOUT  0x12345678U
#define SEGMENT 0x8000U
#define REGION  0x100U
#define ROOM    8U
#define TEXT    5U
#define MAX_CTO 16U
#define SLOTS   6U

static pen_instance_t instance;
static pen_real_t bank[2][N];
static pen_real_t reference_value[N];
static pen_set_t reference;
static uint8_t region_byte[ROOM];
static const uint8_t name_byte[TEXT] = { 'n', 'a', 'm', 'e', '!' };
static const pen_model_t model = { .layout = LAYOUT, .length = N };
static const pen_xcp_region_t region[1] = { { REGION, ROOM, region_byte } };
static const pen_xcp_region_t name = { 0U, TEXT, name_byte };
static pen_xcp_t xcp;
static pen_xcp_daq_t daq;
static uint8_t ring[SLOTS * (MAX_CTO + 1U)];
static uint8_t packet[2U * MAX_CTO];
static uint8_t out[MAX_CTO];
volatile uint32_t seen;

static void fill(void *at, size_t bytes)
{
    Frama_C_make_unknown((char *)at, bytes);
}

static bool some(void)
{
    return any != 0U;
}

static pen_status_t commit(void)
{
    pen_set_t ready;
    const pen_status_t status = pen_tune_commit(&model, &instance, &ready);

    return pen_tune_publish(&model, &instance, NULL, &ready, some() ? status : PEN_SET_PROMISE);
}

static pen_status_t choose(const pen_set_t *set)
{
    pen_set_t ready;
    const pen_status_t status = pen_tune_select(&model, &instance, set, &ready);

    return pen_tune_publish(&model, &instance, NULL, &ready, status);
}

static uint32_t seed(uint8_t resource, uint8_t bytes[])
{
    for (uint32_t i = 0U; i < (MAX_CTO - 2U); i++) {
        bytes[i] = resource;
    }
    return (any < 14U) ? 7U : 14U;
}

static bool unlock(uint8_t resource, uint32_t n, const uint8_t key[])
{
    uint32_t sum = resource;

    for (uint32_t i = 0U; i < n; i++) {
        sum += key[i];
    }
    return sum == 7U;
}

static const pen_xcp_options_t options = { seed, unlock, true };
static const pen_xcp_config_t config = {
    .instance = &instance, .layout = LAYOUT, .length = N, .reference = &reference, .commit = commit, .select = choose, .address = SEGMENT,
    .id = 100U, .quiet = 50U, .max_cto = MAX_CTO, .regions = 1U, .region = region, .text = { NULL, &name }, .protect = 5U,
    .options = &options, .options_command = pen_xcp_options_command, .daq = &daq, .daq_command = pen_xcp_daq_command,
};

/* -- any state ----------------------------------------------------------------------------------------------------------- */

static pen_real_t *buffer(void)
{
    pen_real_t *const own = some() ? bank[0] : bank[1];

    return some() ? own : reference_value;
}

static void tuning(void)
{
    fill(&instance, sizeof instance);
    fill(bank, sizeof bank);
    fill(reference_value, sizeof reference_value);
    fill(&reference, sizeof reference);
    reference.value = reference_value;
    for (size_t i = 0U; i < 2U; i++) {
        instance.tuning.slot[i].value = buffer();
        instance.tuning.slot_check[i].value = buffer();
        instance.tuning.bank[i] = bank[i];
        instance.tuning.bank_check[i] = bank[i];
    }
    instance.tuning.previous.value = some() ? NULL : buffer();
    instance.tuning.replaced.value = some() ? NULL : buffer();
    instance.tuning.initial.value = reference_value;
}

static void slave(void)
{
    fill(&xcp, sizeof xcp);
    xcp.config = &config;
    xcp.tuning = &instance.tuning;
    xcp.connected = some();
    xcp.refused = some();
    xcp.torn = some();
    xcp.text = NULL;
    xcp.kept = buffer();
    xcp.waiting = buffer();
    fill(region_byte, sizeof region_byte);
}

/* No list. */
static void lists(void)
{
    fill(&daq, sizeof daq);
    daq.lists = 0U;
    daq.odts = 0U;
    daq.entries = 0U;
    daq.left = 0U;
    daq.slots = SLOTS;
    daq.size = MAX_CTO + 1U;
    daq.ring = ring;
    daq.head = any % SLOTS;
    daq.tail = any % SLOTS;
    daq.at = 0U;
    for (size_t i = 0U; i < PEN_XCP_LISTS; i++) {
        daq.list[i].first = 0U;
        daq.list[i].odts = 0U;
    }
    for (size_t i = 0U; i < PEN_XCP_ODTS; i++) {
        daq.odt[i].first = 0U;
        daq.odt[i].entries = 0U;
    }
    for (size_t i = 0U; i < PEN_XCP_ENTRIES; i++) {
        daq.entry[i].byte = NULL;
        daq.entry[i].size = 0U;
    }
}

static void begin(void)
{
    tuning();
    slave();
    lists();
}

/* A packet of n bytes; the command is its first. */
static uint8_t *arriving(uint32_t n, uint8_t code)
{
    uint8_t *const in = &packet[sizeof packet - n];

    fill(packet, sizeof packet);
    fill(out, sizeof out);
    in[0] = code;
    return in;
}

static void number(uint8_t to[], uint32_t value)
{
    pen_xcp_put(to, 4U, value);
}

/* -- calibration ----------------------------------------------------------------------------------------------------------- */

#define PLACES 12U

/* An address: each byte of what may be read and the one behind it; for k = of, below it, of + 1, above it. */
static uint32_t place(uint32_t from, uint32_t of, uint32_t k)
{
    uint32_t address = from + k;

    if (k > of) {
        address = any;
        if (k == (of + 1U)) {
            address %= from;
        } else {
            address = from + of + 1U + (address % (UINT32_MAX - from - of));
        }
    }
    return address;
}

static void upload_of(uint32_t bytes)
{
    for (uint32_t n = 0U; n <= (MAX_CTO + 1U); n++) {
        uint8_t *const in = arriving(8U, (bytes > 0U) ? 0xf5U : 0xf4U);
        in[1] = (uint8_t)((n <= MAX_CTO) ? n : (MAX_CTO + (any % 240U)));
        seen = pen_xcp_receive(&xcp, in, 8U, out);
        if (bytes > 0U) {
            break;
        }
    }
}

/* UPLOAD of each number of bytes, from each place in pages, regions and texts. */
void xcp_upload_command(void)
{
    for (uint32_t n = 0U; n <= (MAX_CTO + 1U); n++) {
        for (uint32_t k = 0U; k <= (SIZE + 2U); k++) {
            uint8_t *const in = arriving(8U, 0xf5U);
            begin();
            in[1] = (uint8_t)((n <= MAX_CTO) ? n : (MAX_CTO + (any % 240U)));
            xcp.mta = place(SEGMENT, SIZE, k);
            if ((k > SIZE) && ((xcp.mta - REGION) <= ROOM)) {
                xcp.mta = 0U; /* those of the region: below */
            }
            seen = pen_xcp_receive(&xcp, in, 8U, out);
        }
        for (uint32_t k = 0U; k <= ROOM; k++) {
            uint8_t *const in = arriving(8U, 0xf5U);
            begin();
            in[1] = (uint8_t)((n <= MAX_CTO) ? n : (MAX_CTO + (any % 240U)));
            xcp.mta = REGION + k;
            seen = pen_xcp_receive(&xcp, in, 8U, out);
        }
        for (uint32_t k = 0U; k <= TEXT; k++) {
            uint8_t *const in = arriving(8U, 0xf5U);
            begin();
            in[1] = (uint8_t)((n <= MAX_CTO) ? n : (MAX_CTO + (any % 240U)));
            xcp.text = &name_byte[k];
            xcp.left = TEXT - k;
            seen = pen_xcp_receive(&xcp, in, 8U, out);
            /*@ assert xcp.text == \null || (xcp.left <= TEXT && xcp.text + xcp.left == (uint8_t const *)name_byte + TEXT); */
        }
    }
}
