/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * Keeps the compiler from contracting a product and a sum to an FMA, which rounds once and so changes bits. No macro
 * reveals contraction: GCC does it by default (-std=gnu17), clang within an expression. Every C file of the
 * library and of a model includes this header before anything else; then no flag is needed. Programs need not include it.
 *
 * Options and pragmas, by compiler:
 *
 * - GCC ignores the pragma of C99, so the option is set inside the file, where the core has such an instruction.
 *   That pragma resets all options and loses what -ffreestanding and -Os on Thumb-2 imply, so both are set again: loops
 *   stay loops (no copy becomes a call of memcpy), and registers are saved in one place. With this list the code is
 *   the same, instruction by instruction, as with -ffp-contract=off on the command line and without this header.
 * - for clang also: no reordering of sums and no division by reciprocals: no macro of clang reveals these flags; GCC
 *   has one for each (see penode/pen_real.h).
 * - any other compiler gets the pragma of C99.
 *
 * What remains: clang obeys -ffp-contract=fast in spite of any pragma, and defines no macro for -fno-signed-zeros.
 */
#ifndef PEN_EXACT_H
#define PEN_EXACT_H

#if !defined(__GNUC__) || defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__FP_FAST_FMAF) || defined(__FP_FAST_FMA)
#if defined(__OPTIMIZE_SIZE__) && defined(__thumb2__)
#pragma GCC optimize("fp-contract=off", "no-tree-loop-distribute-patterns", "no-shrink-wrap")
#else
#pragma GCC optimize("fp-contract=off", "no-tree-loop-distribute-patterns")
#endif
#endif

#ifdef __clang__
#pragma clang fp reassociate(off)
#if __clang_major__ >= 19
#pragma clang fp reciprocal(off)
#endif
#endif

#endif
