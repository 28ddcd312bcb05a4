/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * A controller on an emulated board: the timer interrupt steps, the main loop serves an XCP master over the serial line
 * (SxI: LEN and CTR of two bytes each, no checksum). Its argument names a file with the inputs of up to STIMULI samples,
 * pen_real_t[n][N_U], played again and again; it ends if there is none.
 */
#include "board.h"
#include "controller.h"
#include "uart.h"
#include "xcp_frame.h"

#define STIMULI (0x100000U / sizeof(MODEL(u_t))) /* 1 MiB, as sil/penode_sil/calibration/codes.py knows */
#define MAX_CTO 252U
#define SLOTS   512U
#define ROOM    (XCP_FRAME_HEAD + MAX_CTO + XCP_FRAME_TAIL)

static MODEL(u_t) stimulus[STIMULI];
static uint32_t stimuli;
static uint32_t at;
static uint8_t ring[SLOTS * (MAX_CTO + 1U)];
static uint8_t frame[ROOM];
static uint8_t message[ROOM];
static xcp_stream_t stream = { .frame = frame, .max = MAX_CTO };

void board_timer(void)
{
    controller_step(&stimulus[at], false);
    at = ((at + 1U) == stimuli) ? 0U : (at + 1U);
}

static void send_packet(uint32_t n)
{
    const uint32_t bytes = (n > 0U) ? xcp_stream_frame(&stream, n, message) : 0U;

    for (uint32_t i = 0U; i < bytes; i++) {
        uart_send(message[i]);
    }
}

static void serve(void)
{
    uint8_t byte;

    if (uart_receive(&byte)) {
        const uint32_t packet = xcp_stream_take(&stream, byte);
        if (packet > 0U) {
            send_packet(pen_xcp_receive(&controller_xcp, &frame[XCP_FRAME_HEAD], packet, &message[XCP_FRAME_HEAD]));
        }
    } else {
        send_packet(pen_xcp_daq_packet(&controller_xcp, &message[XCP_FRAME_HEAD]));
    }
}

static bool read_stimulus(void)
{
    char name[256];
    int32_t file = -1;

    if (board_argument(1U, name, sizeof(name))) {
        file = board_open(name, false);
    }
    if (file >= 0) {
        stimuli = board_read(file, stimulus, sizeof(stimulus)) / (uint32_t)sizeof(stimulus[0]);
        board_close(file);
    }
    return stimuli > 0U;
}

int main(void)
{
    const controller_config_t config = { .max_cto = MAX_CTO, .ring = ring, .slots = SLOTS };

    if (!read_stimulus() || !controller_start(&config)) {
        return 1;
    }
    uart_start();
    board_timer_start((uint32_t)(1000000000U / CONTROLLER_PERIOD));
    for (;;) {
        serve();
    }
}
