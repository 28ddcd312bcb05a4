/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * Everything the library requires of a target. pen_port_target.h is found on the include path: port/gnu for GCC and
 * clang on any core, port/template (plain C99, the one to copy) for everything else. It defines, as `static inline`:
 *
 *   uint32_t   pen_port_load(const volatile uint32_t *word)             atomic read of an aligned word
 *   void       pen_port_store(volatile uint32_t *word, uint32_t value)  atomic write of an aligned word
 *   void       pen_port_barrier(void)       no load or store moves across it, neither in compiler nor in core
 *   pen_real_t pen_port_abs(pen_real_t x)   |x|; NaN stays NaN, -0 becomes +0; one instruction where the core has one
 *   uint32_t   pen_port_cycles(void)        free-running counter for measurements; wraps; 0 where there is none
 *
 * and two macros: PEN_PORT_INLINE is `static inline`, with the compiler's attribute to always inline where needed;
 * PEN_PORT_UNROLL stands before a loop whose length is a small constant and may ask the compiler to unroll it
 * where speed counts more than size.
 *
 * A port may also define PEN_PORT_ROWS and PEN_PORT_NET16, and functions that replace the C in pen_rows_relu and in
 * pen_net16 (penode/pen_net16.h):
 *
 *   void       pen_port_rows(size_t n_in, const pen_real_t w[], const pen_real_t x[], pen_real_t y[])
 *   pen_real_t pen_port_net16(size_t hidden, const pen_real_t w[], pen_real_t x)
 *
 * The first: sixteen rows of a layer, n_in >= 1; y may be x. Both must give the bits of the C (for NaN any NaN), and
 * their time may depend on n_in and hidden alone; test/unit/test_pen_net.c and test_pen_net16.c compare the bits.
 * port/gnu has both for size builds on a Cortex-M with FPU, and the second for speed builds.
 *
 * Cost on a Cortex-M with FPU: load, store, abs one instruction each, barrier one (DMB).
 */
#ifndef PEN_PORT_H
#define PEN_PORT_H

#include <stdint.h>

#include "penode/pen_real.h"
#include "pen_port_target.h"

#endif
