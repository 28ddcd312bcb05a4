/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* For Frama-C: DAQ lists of the XCP slave. xcp_state.inc says how. */
#include "xcp_state.inc"

/* -- lists ------------------------------------------------------------------------------------------------------------------- */

static void unchanged(void)
{
    //@ loop unroll 4;
    for (size_t i = 0U; i < PEN_XCP_LISTS; i++) {
        /*@ assert daq.list[i].first + daq.list[i].odts <= PEN_XCP_ODTS; */
    }
    //@ loop unroll 32;
    for (size_t i = 0U; i < PEN_XCP_ODTS; i++) {
        /*@ assert daq.odt[i].first + daq.odt[i].entries <= PEN_XCP_ENTRIES; */
    }
    /*@ assert daq.lists <= PEN_XCP_LISTS && daq.odts <= PEN_XCP_ODTS && daq.entries <= PEN_XCP_ENTRIES; */
    /*@ assert daq.at + daq.left <= PEN_XCP_ENTRIES; */
}

static void change(uint8_t code)
{
    send(arriving(8U, code), 8U);
    unchanged();
}

/* Commands without a list, or that look at none of its entries. */
void xcp_lists(void)
{
    static const uint8_t code[] = { 0xd5U, 0xd6U, 0xd7U, 0xd9U, 0xdaU, 0xdcU, 0xddU, 0xdfU, 0xe0U };

    begin();
    //@ loop unroll 9;
    for (uint32_t i = 0U; i < sizeof code; i++) {
        //@ loop unroll 5;
        for (uint32_t n = 0U; n <= PEN_XCP_LISTS; n++) {
            slave();
            lists(n, 1U, 1U);
            change(code[i]);
        }
    }
}

void xcp_allocate(void)
{
    begin();
    //@ loop unroll 65;
    for (uint32_t n = 0U; n <= PEN_XCP_ENTRIES; n++) {
        slave();
        lists(4U, Frama_C_unsigned_int_interval(0U, 1U), 0U);
        daq.entries = (uint8_t)n;
        change(0xd3U);
        slave();
        lists(4U, 0U, 0U);
        daq.odts = (uint8_t)(n / 2U);
        change(0xd4U);
    }
}

/* The pointer to each entry of ODTs of each size, and to one behind them. A packet takes it there too. */
void xcp_pointer(void)
{
    begin();
    lists(4U, 2U, 0U);
    //@ loop unroll 65;
    for (uint32_t n = 0U; n <= PEN_XCP_ENTRIES; n++) {
        uint8_t *const in = arriving(8U, 0xe2U);
        //@ loop unroll 32;
        for (size_t i = 0U; i < PEN_XCP_ODTS; i++) { /* which SET_DAQ_PTR leaves alone */
            daq.odt[i].first = (uint8_t)Frama_C_unsigned_int_interval(0U, PEN_XCP_ENTRIES - n);
            daq.odt[i].entries = (uint8_t)n;
        }
        //@ loop unroll 66;
        for (uint32_t k = 0U; k <= (n + 1U); k++) {
            daq.at = 0U; /* without an entry it has no meaning; it stays, and left becomes 0, where the pointer is refused */
            in[5] = (uint8_t)((k <= n) ? k : Frama_C_unsigned_int_interval(n + 1U, 255U));
            seen = pen_xcp_list_command(&xcp, in, Frama_C_unsigned_int_interval(0U, PEN_XCP_LISTS - 1U));
            /*@ assert daq.at + daq.left <= PEN_XCP_ENTRIES; */
        }
        slave();
        daq.at = 0U;
        in[5] = 0U;
        send(in, 8U);
        /*@ assert daq.at + daq.left <= PEN_XCP_ENTRIES; */
    }
}

/* At which entry, and how many are left, decides nothing about what is written. */
static void write_entry(uint32_t at, uint32_t left, uint32_t address, uint32_t size)
{
    uint8_t *const in = arriving(8U, 0xe1U);

    slave();
    lists(1U, 0U, 0U);
    daq.left = (uint8_t)left;
    daq.at = (uint8_t)at;
    in[2] = (uint8_t)size;
    number(&in[4], address);
    send(in, 8U);
}

/* While n entries are left: a packet that writes one, or one that does not; either alone keeps what is asserted, both in one state would not. */
static void entries_left(uint32_t n, bool taken)
{
    uint8_t *const in = arriving(8U, 0xe1U);

    slave();
    lists(1U, 0U, 0U);
    daq.left = (uint8_t)n;
    daq.at = (uint8_t)Frama_C_unsigned_int_interval(0U, PEN_XCP_ENTRIES - n);
    number(&in[4], REGION);
    in[1] = (uint8_t)(taken ? 0xffU : Frama_C_unsigned_int_interval(0U, 0xfeU));
    if (taken) {
        xcp.connected = true;
        xcp.locked = 0U;
        xcp.sampling = 0U;
        daq.busy = 0U;
        in[2] = 1U;
        in[3] = 0U;
    }
    send(in, 8U);
    /*@ assert daq.at + daq.left <= PEN_XCP_ENTRIES; */
}

/* Each place with each size, at any entry; then each number of entries that are left. */
void xcp_write_entries(void)
{
    begin();
    //@ loop unroll 16;
    for (uint32_t k = 0U; k <= (ROOM + ELSEWHERE); k++) {
        //@ loop unroll 10;
        for (uint32_t n = 0U; n <= (ROOM + 1U); n++) {
            const uint32_t size = (n <= ROOM) ? n : Frama_C_unsigned_int_interval(ROOM + 1U, 255U);
            write_entry(Frama_C_unsigned_int_interval(0U, PEN_XCP_ENTRIES - 1U), Frama_C_unsigned_int_interval(0U, PEN_XCP_ENTRIES),
                        place(k), size);
            //@ loop unroll 64;
            for (size_t i = 0U; i < PEN_XCP_ENTRIES; i++) {
                /*@ assert daq.entry[i].byte == \null || daq.entry[i].size <= ROOM - ((k <= ROOM) ? k : 0); */
                /*@ assert daq.entry[i].byte == \null || (daq.entry[i].byte == region_byte + k && k <= ROOM); */
            }
        }
    }
    //@ loop unroll 65;
    for (uint32_t n = 0U; n <= PEN_XCP_ENTRIES; n++) {
        entries_left(n, true);
        entries_left(n, false);
    }
}

static void look(uint8_t code, uint32_t odts, uint32_t entries)
{
    slave();
    lists(4U, odts, entries);
    //@ loop unroll 64;
    for (size_t i = 0U; i < PEN_XCP_ENTRIES; i++) {
        daq.entry[i].byte = some() ? NULL : &region_byte[0];
        daq.entry[i].size = Frama_C_unsigned_int_interval(0U, ROOM);
    }
    change(code);
}

/* CLEAR_DAQ_LIST and START_STOP_DAQ_LIST look at all entries of a list. */
void xcp_whole_lists(void)
{
    begin();
    //@ loop unroll 65;
    for (uint32_t n = 0U; n <= PEN_XCP_ENTRIES; n++) {
        look(0xe3U, 1U, n);
        look(0xdeU, 1U, n);
    }
    //@ loop unroll 33;
    for (uint32_t n = 0U; n <= PEN_XCP_ODTS; n++) {
        look(0xe3U, n, 1U);
        look(0xdeU, n, 1U);
    }
}

/* A list of ODTs of `entries` entries of `size` bytes is started, if it can be, and sampled. */
static void sample(uint32_t odts, uint32_t entries, uint32_t size, uint8_t mode)
{
    uint8_t *const in = arriving(8U, 0xdeU);

    in[1] = 1U;
    in[2] = 0U;
    in[3] = 0U;
    slave();
    xcp.connected = true;
    xcp.locked = 0U;
    xcp.sampling = 0U;
    lists(1U, odts, entries);
    daq.list[0].mode = mode;
    //@ loop unroll 64;
    for (size_t i = 0U; i < PEN_XCP_ENTRIES; i++) {
        daq.entry[i].byte = &region_byte[Frama_C_unsigned_int_interval(0U, ROOM - size)];
        daq.entry[i].size = size;
    }
    //@ loop unroll 6;
    for (size_t i = 0U; i < SLOTS; i++) {
        ring[i * (MAX_CTO + 1U)] = (uint8_t)Frama_C_unsigned_int_interval(0U, MAX_CTO);
    }
    send(in, 8U);
    pen_xcp_sample(&xcp, any);
    pen_xcp_sample(&xcp, any);
    //@ loop unroll 6;
    for (size_t i = 0U; i < SLOTS; i++) {
        /*@ assert ring[i * (MAX_CTO + 1U)] <= MAX_CTO; */
    }
    /*@ assert daq.head < SLOTS; */
    seen = pen_xcp_daq_packet(&xcp, out);
    /*@ assert daq.tail < SLOTS; */
}

void xcp_sampling(void)
{
    begin();
    //@ loop unroll 17;
    for (uint32_t entries = 0U; entries <= MAX_CTO; entries++) {
        //@ loop unroll 9;
        for (uint32_t size = 0U; size <= ROOM; size++) {
            sample(1U, entries, size, 0U);
            sample(1U, entries, size, PEN_XCP_STAMP);
            sample(3U, entries, size, PEN_XCP_STAMP);
            sample(SLOTS, entries, size, 0U);
        }
    }
}

/* -- static lists -------------------------------------------------------------------------------------------------------------- */

static const pen_xcp_entry_t constant[4] = { { &region_byte[0], 4U }, { &region_byte[4], 1U }, { name_byte, 5U }, { NULL, 0U } };
static const pen_xcp_entry_t huge[1] = { { region_byte, UINT32_MAX } };
static const pen_xcp_static_t some_lists[3] = { { 2U, 2U, constant }, { 3U, 2U, NULL }, { 27U, 2U, NULL } };
static const pen_xcp_static_t wrong[5] = { { 1U, 1U, NULL }, { 2U, 2U, constant }, { 1U, 1U, huge }, { 0U, 1U, NULL }, { 1U, 65U, NULL } };
static const pen_xcp_statics_t statics[] = { { 3U, some_lists }, { 5U, wrong },     { 2U, wrong }, { 1U, &wrong[2] },
                                             { 1U, &wrong[3] },  { 1U, &wrong[4] }, { 0U, wrong } };

/* To a list that there is, or (3, 4) any other; entry 0, 1 or any other. */
static void packet_of_static(uint32_t n, uint8_t code, uint32_t to, uint32_t entry)
{
    uint8_t *const in = arriving((n > 0U) ? n : 1U, code);

    if (n >= 4U) {
        in[2] = (uint8_t)((to < 3U) ? to : Frama_C_unsigned_int_interval((to == 3U) ? 3U : 0U, 255U));
        in[3] = (uint8_t)((to < 3U) ? 0U : ((to == 3U) ? 0U : Frama_C_unsigned_int_interval(1U, 255U)));
    }
    if (n >= 6U) {
        in[5] = (uint8_t)((entry < 2U) ? entry : Frama_C_unsigned_int_interval(2U, 255U));
    }
    slave();
    //@ loop unroll 64;
    for (size_t k = 4U; k < PEN_XCP_ENTRIES; k++) {
        daq.entry[k].size = Frama_C_unsigned_int_interval(0U, ROOM);
    }
    daq.busy = any;
    daq.at = 0U; /* without an entry it has no meaning */
    daq.left = 0U;
    seen = pen_xcp_static_receive(&xcp, &statics[0], in, n, out);
    unchanged();
}

void xcp_static_lists(void)
{
    static const uint8_t code[] = { 0xd3U, 0xd6U, 0xd8U, 0xdaU, 0xe1U, 0xe2U, 0xe3U, 0xffU };

    begin();
    //@ loop unroll 7;
    for (uint32_t i = 1U; i <= (sizeof statics / sizeof statics[0]); i++) {
        seen = pen_xcp_static_init(&daq, &statics[i % (sizeof statics / sizeof statics[0])]); /* last: the one that is used */
    }
    //@ loop unroll 9;
    for (uint32_t n = 0U; n <= 8U; n++) {
        //@ loop unroll 8;
        for (uint32_t i = 0U; i < sizeof code; i++) {
            //@ loop unroll 15;
            for (uint32_t k = 0U; k < 15U; k++) {
                if ((n >= 4U) || (k == 14U)) {
                    packet_of_static(n, code[i], k % 5U, k / 5U);
                }
            }
        }
    }
}
