/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * The network 1-16-...-16-1 for the FPU of a Cortex-M that issues one instruction a cycle (M4, M33), in a speed build:
 * eight weights a load, four columns a turn, the last layer from registers. GCC loads each weight alone, and computes
 * the address of each one beyond 1020 bytes. Included by pen_port_target.h.
 *
 * Everything is written out, without macros of the assembler: GCC counts lines to know how far its constants are.
 */
#ifndef PEN_PORT_NET16_H
#define PEN_PORT_NET16_H

#include <stddef.h>

#define PEN_PORT_NET16

/* s16-s23 = the next eight weights times pen_column */
#define PEN_PORT_PRODUCTS \
    "   vldmia   %[w]!, {s16-s23}\n" \
    "   vmul.f32 s16, s16, pen_column\n" \
    "   vmul.f32 s17, s17, pen_column\n" \
    "   vmul.f32 s18, s18, pen_column\n" \
    "   vmul.f32 s19, s19, pen_column\n" \
    "   vmul.f32 s20, s20, pen_column\n" \
    "   vmul.f32 s21, s21, pen_column\n" \
    "   vmul.f32 s22, s22, pen_column\n" \
    "   vmul.f32 s23, s23, pen_column\n"

/* clang-format off */ /* one instruction a line */
/* s0-s15, one row each, += weights times pen_column. VMUL and VADD take two cycles, VMLA three. */
#define PEN_PORT_COLUMN \
    PEN_PORT_PRODUCTS \
    "   vadd.f32 s0, s0, s16\n" \
    "   vadd.f32 s1, s1, s17\n" \
    "   vadd.f32 s2, s2, s18\n" \
    "   vadd.f32 s3, s3, s19\n" \
    "   vadd.f32 s4, s4, s20\n" \
    "   vadd.f32 s5, s5, s21\n" \
    "   vadd.f32 s6, s6, s22\n" \
    "   vadd.f32 s7, s7, s23\n" \
    PEN_PORT_PRODUCTS \
    "   vadd.f32 s8, s8, s16\n" \
    "   vadd.f32 s9, s9, s17\n" \
    "   vadd.f32 s10, s10, s18\n" \
    "   vadd.f32 s11, s11, s19\n" \
    "   vadd.f32 s12, s12, s20\n" \
    "   vadd.f32 s13, s13, s21\n" \
    "   vadd.f32 s14, s14, s22\n" \
    "   vadd.f32 s15, s15, s23\n"
/* clang-format on */

/* s24-s27 = max(0, s24-s27), and NaN for Inf */
#define PEN_PORT_RELU \
    "   vabs.f32 s16, s24\n" \
    "   vabs.f32 s17, s25\n" \
    "   vabs.f32 s18, s26\n" \
    "   vabs.f32 s19, s27\n" \
    "   vadd.f32 s24, s24, s16\n" \
    "   vadd.f32 s25, s25, s17\n" \
    "   vadd.f32 s26, s26, s18\n" \
    "   vadd.f32 s27, s27, s19\n" \
    "   vmul.f32 s24, s24, %[half]\n" \
    "   vmul.f32 s25, s25, %[half]\n" \
    "   vmul.f32 s26, s26, %[half]\n" \
    "   vmul.f32 s27, s27, %[half]\n"

/* The last layer, one row, from s0-s15 into s24, doubled: no result is used by the instruction after it. */
#define PEN_PORT_LAST \
    "   vldmia   %[w]!, {s24}\n" \
    "   vldmia   %[w]!, {s16-s23}\n" \
    "   vabs.f32 s25, s0\n" \
    "   vabs.f32 s26, s1\n" \
    "   vadd.f32 s0, s0, s25\n" \
    "   vadd.f32 s24, s24, s24\n" \
    "   vadd.f32 s1, s1, s26\n" \
    "   vmul.f32 s0, s0, s16\n" \
    "   vmul.f32 s1, s1, s17\n" \
    "   vabs.f32 s25, s2\n" \
    "   vabs.f32 s26, s3\n" \
    "   vadd.f32 s2, s2, s25\n" \
    "   vadd.f32 s24, s24, s0\n" \
    "   vadd.f32 s3, s3, s26\n" \
    "   vmul.f32 s2, s2, s18\n" \
    "   vadd.f32 s24, s24, s1\n" \
    "   vmul.f32 s3, s3, s19\n" \
    "   vabs.f32 s25, s4\n" \
    "   vabs.f32 s26, s5\n" \
    "   vadd.f32 s4, s4, s25\n" \
    "   vadd.f32 s24, s24, s2\n" \
    "   vadd.f32 s5, s5, s26\n" \
    "   vmul.f32 s4, s4, s20\n" \
    "   vadd.f32 s24, s24, s3\n" \
    "   vmul.f32 s5, s5, s21\n" \
    "   vabs.f32 s25, s6\n" \
    "   vabs.f32 s26, s7\n" \
    "   vadd.f32 s6, s6, s25\n" \
    "   vadd.f32 s24, s24, s4\n" \
    "   vadd.f32 s7, s7, s26\n" \
    "   vmul.f32 s6, s6, s22\n" \
    "   vadd.f32 s24, s24, s5\n" \
    "   vmul.f32 s7, s7, s23\n" \
    "   vldmia   %[w]!, {s16-s23}\n" \
    "   vabs.f32 s25, s8\n" \
    "   vabs.f32 s26, s9\n" \
    "   vadd.f32 s8, s8, s25\n" \
    "   vadd.f32 s24, s24, s6\n" \
    "   vadd.f32 s9, s9, s26\n" \
    "   vmul.f32 s8, s8, s16\n" \
    "   vadd.f32 s24, s24, s7\n" \
    "   vmul.f32 s9, s9, s17\n" \
    "   vabs.f32 s25, s10\n" \
    "   vabs.f32 s26, s11\n" \
    "   vadd.f32 s10, s10, s25\n" \
    "   vadd.f32 s24, s24, s8\n" \
    "   vadd.f32 s11, s11, s26\n" \
    "   vmul.f32 s10, s10, s18\n" \
    "   vadd.f32 s24, s24, s9\n" \
    "   vmul.f32 s11, s11, s19\n" \
    "   vabs.f32 s25, s12\n" \
    "   vabs.f32 s26, s13\n" \
    "   vadd.f32 s12, s12, s25\n" \
    "   vadd.f32 s24, s24, s10\n" \
    "   vadd.f32 s13, s13, s26\n" \
    "   vmul.f32 s12, s12, s20\n" \
    "   vadd.f32 s24, s24, s11\n" \
    "   vmul.f32 s13, s13, s21\n" \
    "   vabs.f32 s25, s14\n" \
    "   vabs.f32 s26, s15\n" \
    "   vadd.f32 s14, s14, s25\n" \
    "   vadd.f32 s24, s24, s12\n" \
    "   vadd.f32 s15, s15, s26\n" \
    "   vmul.f32 s14, s14, s22\n" \
    "   vadd.f32 s24, s24, s13\n" \
    "   vmul.f32 s15, s15, s23\n" \
    "   vadd.f32 s24, s24, s14\n" \
    "   vadd.f32 s24, s24, s15\n"

PEN_PORT_INLINE float pen_port_net16(size_t hidden, const float w[], float x)
{
    float h[16]; /* the layer before */
    float *from;
    size_t turns;
    float y;

    /* clang-format off */ /* one instruction a line */
    __asm__ volatile("   vldmia   %[w]!, {s0-s15}    \n" /* first layer: biases, one column */
                     "   vmov.f32 s24, %[x]           \n"
                     "pen_column .req s24             \n" PEN_PORT_COLUMN
                     "1: vstmia   %[h], {s0-s15}      \n"
                     "   mov      %[from], %[h]       \n"
                     "   movs     %[turns], #4        \n"
                     "   vldmia   %[w]!, {s0-s15}     \n"
                     "2: vldmia   %[from]!, {s24-s27} \n" PEN_PORT_RELU PEN_PORT_COLUMN
                     ".unreq pen_column               \n"
                     "pen_column .req s25             \n" PEN_PORT_COLUMN
                     ".unreq pen_column               \n"
                     "pen_column .req s26             \n" PEN_PORT_COLUMN
                     ".unreq pen_column               \n"
                     "pen_column .req s27             \n" PEN_PORT_COLUMN
                     ".unreq pen_column               \n"
                     "   subs     %[turns], #1        \n"
                     "   bne.w    2b                  \n"
                     "   subs     %[hidden], #1       \n"
                     "   bne.w    1b                  \n" PEN_PORT_LAST
                     "   vmul.f32 %[y], s24, %[half]  \n"
                     : [hidden] "+&r"(hidden), [w] "+&r"(w), [from] "=&r"(from), [turns] "=&r"(turns), [y] "=t"(y)
                     : [h] "r"(h), [x] "t"(x), [half] "t"(0.5F)
                     : "cc", "memory", "s0", "s1", "s2", "s3", "s4", "s5", "s6", "s7", "s8", "s9", "s10", "s11", "s12",
                       "s13", "s14", "s15", "s16", "s17", "s18", "s19", "s20", "s21", "s22", "s23", "s24", "s25", "s26",
                       "s27");
    /* clang-format on */
    return y;
}

#endif
