/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/** A port without bodies: CMock makes them from these declarations. */
#ifndef PEN_PORT_TARGET_H
#define PEN_PORT_TARGET_H

#include <stdint.h>

#include "penode/pen_real.h"

#define PEN_PORT_INLINE static inline
#define PEN_PORT_UNROLL

uint32_t pen_port_load(const volatile uint32_t *word);
void pen_port_store(volatile uint32_t *word, uint32_t value);
void pen_port_barrier(void);
pen_real_t pen_port_abs(pen_real_t x);
uint32_t pen_port_cycles(void);

#endif
