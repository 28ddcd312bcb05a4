/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * A port in plain C99, to copy for a compiler that is not GCC or clang. Right as it stands on a single core whose
 * aligned 32-bit accesses are atomic and whose compiler keeps ordinary accesses in order around volatile ones;
 * anything else puts its barrier instruction (DMB on Cortex-M) where the comment says. penode/pen_port.h is the contract;
 * it also names what a port may add for speed, and need not.
 */
#ifndef PEN_PORT_TARGET_H
#define PEN_PORT_TARGET_H

#define PEN_PORT_INLINE static inline /* and the compiler's word for: always */
#define PEN_PORT_UNROLL /* the compiler's pragma that writes out a short loop of constant length */

static inline uint32_t pen_port_load(const volatile uint32_t *word)
{
    return *word;
}

static inline void pen_port_store(volatile uint32_t *word, uint32_t value)
{
    *word = value;
}

static inline void pen_port_barrier(void)
{
    /* the target's barrier instruction */
}

static inline pen_real_t pen_port_abs(pen_real_t x)
{
    return (x > (pen_real_t)0) ? x : ((pen_real_t)0 - x); /* not -x: it would keep the sign of -0 */
}

static inline uint32_t pen_port_cycles(void)
{
    return 0U; /* the target's cycle counter */
}

#endif
