/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* For Frama-C: commands of the XCP slave that calibrate, and all others that look at no list. xcp_state.inc says how. */
#include "xcp_state.inc"

/* -- calibration ----------------------------------------------------------------------------------------------------------- */

/* UPLOAD of each number of bytes, from each place of pages, regions and texts; SHORT_UPLOAD, BUILD_CHECKSUM likewise. */
void xcp_upload_page(void)
{
    begin();
    //@ loop unroll 18;
    for (uint32_t n = 0U; n <= (MAX_CTO + 1U); n++) {
        //@ loop unroll 23;
        for (uint32_t k = 0U; k <= SIZE; k++) {
            uint8_t *const in = arriving(8U, 0xf5U);
            slave();
            in[1] = bytes(n);
            xcp.mta = SEGMENT + k;
            send(in, 8U);
        }
    }
}

void xcp_upload_region(void)
{
    begin();
    //@ loop unroll 18;
    for (uint32_t n = 0U; n <= (MAX_CTO + 1U); n++) {
        //@ loop unroll 16;
        for (uint32_t k = 0U; k <= (ROOM + ELSEWHERE); k++) {
            uint8_t *const in = arriving(8U, 0xf4U);
            slave();
            in[1] = bytes(n);
            number(&in[4], place(k));
            send(in, 8U);
        }
    }
}

void xcp_upload_text(void)
{
    begin();
    //@ loop unroll 18;
    for (uint32_t n = 0U; n <= (MAX_CTO + 1U); n++) {
        //@ loop unroll 6;
        for (uint32_t k = 0U; k <= TEXT; k++) {
            uint8_t *const in = arriving(8U, 0xf5U);
            slave();
            in[1] = bytes(n);
            xcp.text = &name_byte[k];
            xcp.left = TEXT - k;
            send(in, 8U);
            /*@ assert xcp.text == \null || xcp.left <= TEXT; */
        }
    }
}

static void checksum(uint32_t mta, uint32_t n)
{
    uint8_t *const in = arriving(8U, 0xf3U);

    slave();
    xcp.mta = mta;
    number(&in[4], n);
    send(in, 8U);
}

void xcp_checksum(void)
{
    static const uint32_t many[4][2] = { { SIZE + 1U, 0xffU }, { 0x100U, 0xffffU }, { 0x10000U, 0xffffffU }, { 0x1000000U, UINT32_MAX } };

    begin();
    //@ loop unroll 22;
    for (uint32_t n = 0U; n <= (SIZE + 1U); n++) {
        //@ loop unroll 21;
        for (uint32_t k = 0U; k <= SIZE; k++) {
            if ((k + n) <= (SIZE + 1U)) {
                checksum(SEGMENT + k, n);
            }
        }
        //@ loop unroll 9;
        for (uint32_t k = 0U; k <= ROOM; k++) {
            if ((k + n) <= (ROOM + 1U)) {
                checksum(REGION + k, n);
            }
        }
    }
    //@ loop unroll 4;
    for (uint32_t k = 0U; k < 4U; k++) {
        checksum(SEGMENT + Frama_C_unsigned_int_interval(0U, SIZE), Frama_C_unsigned_int_interval(many[k][0], many[k][1]));
        checksum(REGION + Frama_C_unsigned_int_interval(0U, ROOM), Frama_C_unsigned_int_interval(many[k][0], many[k][1]));
    }
}

static void download(uint32_t n, uint8_t code, uint32_t mta)
{
    uint8_t *const in = arriving(n, code);

    slave();
    xcp.mta = mta;
    send(in, n);
}

/* Packets of each length, longer ones than are allowed too, to each place. */
void xcp_download_command(void)
{
    begin();
    //@ loop unroll 18;
    for (uint32_t n = 1U; n <= (MAX_CTO + 2U); n++) {
        //@ loop unroll 21;
        for (uint32_t k = 0U; k <= SIZE; k++) {
            download(n, 0xeeU, SEGMENT + k);
            download(n, 0xefU, SEGMENT + k);
            download(n, 0xf0U, SEGMENT + k);
        }
        //@ loop unroll 7;
        for (uint32_t k = 0U; k < ELSEWHERE; k++) {
            download(n, 0xf0U, Frama_C_unsigned_int_interval(elsewhere[k][0], elsewhere[k][1]));
        }
    }
}

void xcp_pages(void)
{
    static const uint8_t code[] = { 0xe4U, 0xe7U, 0xe8U, 0xe9U, 0xeaU, 0xebU };

    //@ loop unroll 6;
    for (uint32_t i = 0U; i < sizeof code; i++) {
        begin();
        send(arriving(8U, code[i]), 8U);
    }
}

void xcp_elapse(void)
{
    begin();
    seen = pen_xcp_elapse(&xcp, any, out);
    slave();
    seen = (pen_xcp_to_store(&xcp) != NULL) ? 1U : 0U;
    slave();
    seen = pen_xcp_stored(&xcp, out);
    pen_xcp_disconnect(&xcp);
    slave();
    seen = pen_xcp_init(some() ? NULL : &xcp, some() ? NULL : &config);
}

/* Keys: packets of each length. */
void xcp_keys(void)
{
    static const uint8_t code[] = { 0xe5U, 0xe6U, 0xf7U, 0xf8U, 0xf9U };

    begin();
    //@ loop unroll 18;
    for (uint32_t n = 1U; n <= (MAX_CTO + 2U); n++) {
        //@ loop unroll 5;
        for (uint32_t i = 0U; i < sizeof code; i++) {
            slave();
            send(arriving(n, code[i]), n);
        }
    }
}

/* Every code, connected or not, with packets of each length whose other bytes are 0. */
void xcp_dispatch(void)
{
    begin();
    //@ loop unroll 10;
    for (uint32_t n = 0U; n <= 9U; n++) {
        //@ loop unroll 257;
        for (uint32_t code = 0U; code <= 255U; code++) {
            uint8_t *const in = arriving((n > 0U) ? n : 1U, (uint8_t)code);
            //@ loop unroll 9;
            for (uint32_t i = 1U; i < n; i++) {
                in[i] = 0U;
            }
            slave();
            send(in, n);
        }
    }
}
