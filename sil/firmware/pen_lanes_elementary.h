/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * pen_elementary on lanes: each lane by itself, with the bits of the runtime. Sums must not be reordered here even where the
 * batch library allows it: the reduction of an angle and the roots rest on what rounding leaves.
 */
#ifndef PEN_LANES_ELEMENTARY_H
#define PEN_LANES_ELEMENTARY_H

#include "pen_lanes.h"

#ifdef LANES_SIMPLE
#pragma GCC push_options
#pragma GCC optimize("O3")
#endif
#if defined(LANES_FLUSH) && defined(__clang__)
#pragma clang fp reassociate(off) contract(off)
#elif defined(LANES_FLUSH) && defined(__GNUC__)
#pragma GCC push_options
#pragma GCC optimize("no-associative-math", "signed-zeros", "fp-contract=off")
#endif
#include "pen_atan.c"
#include "pen_log.c"
#include "pen_root.c"
#include "pen_trig.c"
#if defined(LANES_FLUSH) && defined(__clang__)
#pragma clang fp reassociate(on)
#elif defined(LANES_FLUSH) && defined(__GNUC__)
#pragma GCC pop_options
#endif
#ifdef LANES_SIMPLE
#pragma GCC pop_options
#endif

LANES_EACH(pen_atan)
LANES_EACH(pen_cos)
LANES_EACH(pen_log)
LANES_EACH(pen_sin)
LANES_EACH(pen_sqrt)
#define lanes_atan lanes_pen_atan
#define lanes_cos  lanes_pen_cos
#define lanes_log  lanes_pen_log
#define lanes_sin  lanes_pen_sin
#define lanes_sqrt lanes_pen_sqrt

#endif
