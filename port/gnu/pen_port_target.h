/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * The port for GCC and clang, any core.
 *
 * On a Cortex-M a load or store is one plain LDR or STR and the barrier one DMB: the library puts a barrier wherever
 * order matters. On a host they also acquire and release, which costs nothing on x86 and is what ThreadSanitizer
 * understands. A core without instructions for exchanges (Armv6-M, RISC-V without A) loads and stores an aligned word in
 * one piece all the same, but there clang makes a call into libatomic of the built-ins: a volatile access takes their place.
 */
#ifndef PEN_PORT_TARGET_H
#define PEN_PORT_TARGET_H

/* Before a short loop of constant length: write it out. GCC only; and never when optimising for size. */
#if defined(__GNUC__) && !defined(__clang__) && !defined(__OPTIMIZE_SIZE__)
#define PEN_PORT_UNROLL _Pragma("GCC unroll 16")
#else
#define PEN_PORT_UNROLL
#endif

/* One or two instructions each: never worth a call, not even when optimising for size. */
#define PEN_PORT_INLINE static inline __attribute__((always_inline))

#if defined(__ARM_ARCH_PROFILE) && (__ARM_ARCH_PROFILE == 'M')
#define PEN_PORT_ACQUIRE __ATOMIC_RELAXED
#define PEN_PORT_RELEASE __ATOMIC_RELAXED
#else
#define PEN_PORT_ACQUIRE __ATOMIC_ACQUIRE
#define PEN_PORT_RELEASE __ATOMIC_RELEASE
#endif

PEN_PORT_INLINE uint32_t pen_port_load(const volatile uint32_t *word)
{
#if __GCC_ATOMIC_INT_LOCK_FREE == 2
    return __atomic_load_n(word, PEN_PORT_ACQUIRE);
#else
    return *word;
#endif
}

PEN_PORT_INLINE void pen_port_store(volatile uint32_t *word, uint32_t value)
{
#if __GCC_ATOMIC_INT_LOCK_FREE == 2
    __atomic_store_n(word, value, PEN_PORT_RELEASE);
#else
    *word = value;
#endif
}

PEN_PORT_INLINE void pen_port_barrier(void)
{
    __atomic_thread_fence(__ATOMIC_SEQ_CST);
}

PEN_PORT_INLINE pen_real_t pen_port_abs(pen_real_t x)
{
#ifdef PEN_REAL_DOUBLE
    return __builtin_fabs(x);
#else
    return __builtin_fabsf(x);
#endif
}

/* Kernels for the FPU of a Cortex-M: for size on any; for speed not where the FPU has double precision: such a core, an
 * M7 or M55, may load while it computes. An M7 with single precision looks like an M4 and is treated as one. */
#if !defined(PEN_REAL_DOUBLE) && defined(__ARM_FP) && defined(__ARM_ARCH_PROFILE)
#if (__ARM_ARCH_PROFILE == 'M') && ((__ARM_FP & 4) != 0)
#if defined(__OPTIMIZE_SIZE__)
#include "pen_port_rows.h"
#elif defined(__OPTIMIZE__) && ((__ARM_FP & 8) == 0)
#include "pen_port_net16.h"
#endif
#endif
#endif

/** x86: time stamp counter. Cortex-M3 and up: DWT_CYCCNT, which the application must have started. Others: 0. */
PEN_PORT_INLINE uint32_t pen_port_cycles(void)
{
#if defined(__x86_64__) || defined(__i386__)
    return (uint32_t)__builtin_ia32_rdtsc();
#elif defined(__ARM_ARCH_PROFILE) && (__ARM_ARCH_PROFILE == 'M') && (__ARM_ARCH_ISA_THUMB >= 2)
    return *(const volatile uint32_t *)0xE0001004U;
#else
    return 0U;
#endif
}

#endif
