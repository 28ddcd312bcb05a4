/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "uart.h"
#include "cortex_m.h"

#define UART_DATA    REGISTER(0x40004000U)
#define UART_STATE   REGISTER(0x40004004U)
#define UART_CTRL    REGISTER(0x40004008U)
#define UART_BAUDDIV REGISTER(0x40004010U)

#define STATE_SEND_FULL    0x1U
#define STATE_RECEIVE_FULL 0x2U
#define CTRL_BOTH_WAYS     0x3U
#define BAUD_DIVISOR       16U /* the smallest: as fast as it goes */

void uart_start(void)
{
    UART_BAUDDIV = BAUD_DIVISOR;
    UART_CTRL = CTRL_BOTH_WAYS;
}

bool uart_receive(uint8_t *byte)
{
    const bool there = (UART_STATE & STATE_RECEIVE_FULL) != 0U;

    if (there) {
        *byte = (uint8_t)(UART_DATA & 0xFFU);
    }
    return there;
}

void uart_send(uint8_t byte)
{
    while ((UART_STATE & STATE_SEND_FULL) != 0U) {
        /* the byte before is on its way */
    }
    UART_DATA = byte;
}
