/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/** The first serial line of the emulated boards mps2-an385, -an386 and -an500 (CMSDK UART), byte by byte, without interrupts. */
#ifndef UART_H
#define UART_H

#include <stdbool.h>
#include <stdint.h>

void uart_start(void);

/** @return true: *byte has come */
bool uart_receive(uint8_t *byte);

/** Waits for room. */
void uart_send(uint8_t byte);

#endif
