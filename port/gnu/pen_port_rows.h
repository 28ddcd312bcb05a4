/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * Sixteen rows of a ReLU layer for the FPU of a Cortex-M, in a size build: eight weights a load, which GCC does not do.
 * Only then: at -O2, VMUL and VADD take fewer cycles than the VMLA here. Included by pen_port_target.h.
 */
#ifndef PEN_PORT_ROWS_H
#define PEN_PORT_ROWS_H

#include <stddef.h>

#define PEN_PORT_ROWS
#define PEN_PORT_NET16

/* 24 instructions a column, 100 bytes. VMLA rounds the product, then the sum, as C without contraction does. */
PEN_PORT_INLINE void pen_port_rows(size_t n_in, const float w[], const float x[], float y[])
{
    float h;    /* of the layer before */
    float size; /* of it */

    /* "&": in place, x and y begin at one address, but must not share its register. */
    __asm__ volatile("   vldmia   %[w]!, {s0-s15}    \n" /* biases: one row a register */
                     "1: vldmia   %[x]!, {%[h]}      \n"
                     "   vabs.f32 %[size], %[h]      \n"
                     "   vadd.f32 %[h], %[h], %[size]\n"
                     "   vmul.f32 %[h], %[h], %[half]\n" /* max(0, h), and NaN for Inf */
                     "   vldmia   %[w]!, {s16-s23}   \n"
                     "   vmla.f32 s0, s16, %[h]      \n"
                     "   vmla.f32 s1, s17, %[h]      \n"
                     "   vmla.f32 s2, s18, %[h]      \n"
                     "   vmla.f32 s3, s19, %[h]      \n"
                     "   vmla.f32 s4, s20, %[h]      \n"
                     "   vmla.f32 s5, s21, %[h]      \n"
                     "   vmla.f32 s6, s22, %[h]      \n"
                     "   vmla.f32 s7, s23, %[h]      \n"
                     "   vldmia   %[w]!, {s16-s23}   \n"
                     "   vmla.f32 s8, s16, %[h]      \n"
                     "   vmla.f32 s9, s17, %[h]      \n"
                     "   vmla.f32 s10, s18, %[h]     \n"
                     "   vmla.f32 s11, s19, %[h]     \n"
                     "   vmla.f32 s12, s20, %[h]     \n"
                     "   vmla.f32 s13, s21, %[h]     \n"
                     "   vmla.f32 s14, s22, %[h]     \n"
                     "   vmla.f32 s15, s23, %[h]     \n"
                     "   subs     %[n], #1           \n"
                     "   bne      1b                 \n"
                     "   vstmia   %[y], {s0-s15}     \n"
                     : [n] "+&r"(n_in), [w] "+&r"(w), [x] "+&r"(x), [h] "=&t"(h), [size] "=&t"(size)
                     : [y] "r"(y), [half] "t"(0.5F)
                     : "cc", "memory", "s0", "s1", "s2", "s3", "s4", "s5", "s6", "s7", "s8", "s9", "s10", "s11", "s12", "s13", "s14", "s15",
                       "s16", "s17", "s18", "s19", "s20", "s21", "s22", "s23");
}

/* The network 1-16-...-16-1: its first layer is one with a single column. 160 bytes. */
PEN_PORT_INLINE float pen_port_net16(size_t hidden, const float w[], float x)
{
    float h[16]; /* the layer before */
    float *from;
    size_t n;
    float y;

    __asm__ volatile("   vldmia   %[w]!, {s0-s15}    \n"
                     "   movs     %[n], #1           \n"
                     "   b        3f                 \n"
                     "1: vldmia   %[w]!, {s0-s15}    \n" /* biases: one row a register */
                     "2: vldmia   %[from]!, {%[x]}   \n"
                     "   vabs.f32 %[y], %[x]         \n"
                     "   vadd.f32 %[x], %[x], %[y]   \n"
                     "   vmul.f32 %[x], %[x], %[half]\n" /* max(0, h), and NaN for Inf */
                     "3: vldmia   %[w]!, {s16-s23}   \n"
                     "   vmla.f32 s0, s16, %[x]      \n"
                     "   vmla.f32 s1, s17, %[x]      \n"
                     "   vmla.f32 s2, s18, %[x]      \n"
                     "   vmla.f32 s3, s19, %[x]      \n"
                     "   vmla.f32 s4, s20, %[x]      \n"
                     "   vmla.f32 s5, s21, %[x]      \n"
                     "   vmla.f32 s6, s22, %[x]      \n"
                     "   vmla.f32 s7, s23, %[x]      \n"
                     "   vldmia   %[w]!, {s16-s23}   \n"
                     "   vmla.f32 s8, s16, %[x]      \n"
                     "   vmla.f32 s9, s17, %[x]      \n"
                     "   vmla.f32 s10, s18, %[x]     \n"
                     "   vmla.f32 s11, s19, %[x]     \n"
                     "   vmla.f32 s12, s20, %[x]     \n"
                     "   vmla.f32 s13, s21, %[x]     \n"
                     "   vmla.f32 s14, s22, %[x]     \n"
                     "   vmla.f32 s15, s23, %[x]     \n"
                     "   subs     %[n], #1           \n"
                     "   bne      2b                 \n"
                     "   vstmia   %[h], {s0-s15}     \n"
                     "   mov      %[from], %[h]      \n"
                     "   movs     %[n], #16          \n"
                     "   subs     %[hidden], #1      \n"
                     "   bpl      1b                 \n"
                     "   vldmia   %[w]!, {%[y]}      \n" /* last layer: one row, halved in the end */
                     "   vadd.f32 %[y], %[y], %[y]   \n"
                     "4: vldmia   %[from]!, {s0}     \n"
                     "   vldmia   %[w]!, {s1}        \n"
                     "   vabs.f32 s2, s0             \n"
                     "   vadd.f32 s0, s0, s2         \n"
                     "   vmla.f32 %[y], s0, s1       \n"
                     "   subs     %[n], #1           \n"
                     "   bne      4b                 \n"
                     "   vmul.f32 %[y], %[y], %[half]\n"
                     : [hidden] "+&r"(hidden), [w] "+&r"(w), [from] "=&r"(from), [n] "=&r"(n), [x] "+&t"(x), [y] "=&t"(y)
                     : [h] "r"(h), [half] "t"(0.5F)
                     : "cc", "memory", "s0", "s1", "s2", "s3", "s4", "s5", "s6", "s7", "s8", "s9", "s10", "s11", "s12", "s13", "s14", "s15",
                       "s16", "s17", "s18", "s19", "s20", "s21", "s22", "s23");
    return y;
}

#endif
