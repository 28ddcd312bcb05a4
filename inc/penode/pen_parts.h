/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * Exponent and significand of a positive number, for pen_log.c and pen_root.c.
 */
#ifndef PEN_PARTS_H
#define PEN_PARTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "penode/pen_math.h"
#include "penode/pen_real.h"

#ifdef PEN_REAL_DOUBLE
typedef uint64_t pen_word_t;    /* as wide as pen_real_t */
#define PEN_PARTS_BITS      52U /* of the significand behind its leading 1 */
#define PEN_PARTS_BIAS      1023U
#define PEN_PARTS_LIFT_BITS 54U /* even, and enough to make any subnormal number a normal one */
#define PEN_PARTS_LIFT      0x1p54
#else
typedef uint32_t pen_word_t;
#define PEN_PARTS_BITS      23U
#define PEN_PARTS_BIAS      127U
#define PEN_PARTS_LIFT_BITS 24U
#define PEN_PARTS_LIFT      0x1p24F
#endif

/** x = significand * 2^(exponent - PEN_PARTS_BIAS - PEN_PARTS_BITS), but for a number that was lifted:
 * 2^PEN_PARTS_LIFT_BITS less. */
typedef struct {
    uint32_t exponent;
    pen_word_t significand; /* with its leading 1: from 2^PEN_PARTS_BITS on, below twice that */
    bool lifted;            /* x is below the normal numbers */
} pen_parts_t;

/** Of x above 0 and finite; of anything else parts without a meaning, but never undefined behaviour. */
static inline pen_parts_t pen_parts(pen_real_t x)
{
    const pen_word_t unit = 1U;
    const pen_word_t leading = unit << PEN_PARTS_BITS;
    const pen_word_t sign = unit << ((8U * sizeof x) - 1U);
    const bool lifted = x < PEN_REAL_MIN;
    const pen_real_t normal = x * pen_where(lifted, PEN_PARTS_LIFT, (pen_real_t)1);
    const uint32_t one = 1U;
    const uint8_t *const low = (const uint8_t *)&one; /* 1: the low byte lies first */
    const uint8_t *const byte = (const uint8_t *)&normal;
    const size_t size = sizeof normal;
    const size_t turn = ((size_t)1U - low[0]) * (size - 1U); /* 0, or what turns the bytes of a number round */
    pen_word_t word = 0U;
    pen_parts_t parts;

    PEN_PORT_UNROLL
    for (size_t b = 0U; b < size; b++) {
        const pen_word_t part = byte[b ^ turn];
        const pen_word_t shift = 8U * (pen_word_t)b;
        word |= part << shift;
    }
    word &= ~sign;
    parts.exponent = (uint32_t)(word >> PEN_PARTS_BITS);
    parts.significand = (word & (leading - 1U)) | leading;
    parts.lifted = lifted;
    return parts;
}

/** A whole number of up to 53 bits, exactly (no conversion of 64-bit integers, which is a call on many cores). */
static inline pen_real_t pen_parts_real(pen_word_t whole)
{
#ifdef PEN_REAL_DOUBLE
    return ((pen_real_t)(uint32_t)(whole >> 32U) * 0x1p32) + (pen_real_t)(uint32_t)(whole & UINT32_MAX);
#else
    return (pen_real_t)whole;
#endif
}

#endif
