/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* Sends a set through receive() of port/README.md, in frames of 1 to 37 bytes. Ends with 0 if the next step has adopted it. */

#include <stdio.h>

#include "nqvm.h"
#include "penode/pen_serial.h"

#define BYTES (NQVM_SET_LENGTH * (uint32_t)sizeof(pen_real_t))

pen_status_t receive(nqvm_t *model, uint32_t at, const uint8_t byte[], uint32_t n);

int main(void)
{
    static nqvm_t model;
    static nqvm_banks_t banks;
    static uint8_t wire[PEN_SERIAL_HEAD + BYTES];
    const pen_set_t *const set = &nqvm_set_altered_friction;
    const nqvm_u_t u = { (pen_real_t)0 };
    nqvm_y_t y;
    pen_set_head_t running = { 0U, 0U, 0U, 0U };
    pen_status_t status = nqvm_init(&model, &nqvm_set_default, &banks);
    uint32_t at = 0U;
    uint32_t n = PEN_SERIAL_HEAD;

    pen_serial_write(&set->head, wire);
    pen_serial_put_bytes(set->value, 0U, BYTES, &wire[PEN_SERIAL_HEAD]);
    while ((status == PEN_OK) && (at < sizeof(wire))) {
        status = receive(&model, at, &wire[at], n);
        at += n;
        n = (n % 37U) + 1U;
        n = (n > ((uint32_t)sizeof(wire) - at)) ? ((uint32_t)sizeof(wire) - at) : n;
    }
    printf("received %u bytes, status 0x%x\n", (unsigned)at, (unsigned)status);
    if (status == PEN_OK) {
        status = nqvm_step(&model, &u, &y) ^ PEN_ADOPTED;
        (void)nqvm_tune_running(&model, &running);
    }
    printf("set %u runs, status 0x%x\n", (unsigned)running.id, (unsigned)status);
    return ((status == PEN_OK) && (running.id == set->head.id)) ? 0 : 1;
}
