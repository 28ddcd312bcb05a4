/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/** Unity writes through the board, so that the same tests run everywhere. */
#ifndef UNITY_CONFIG_H
#define UNITY_CONFIG_H

#include <stddef.h> /* Unity's macros use NULL */

#define UNITY_INCLUDE_DOUBLE
#define UNITY_SUPPORT_64
#define UNITY_OUTPUT_CHAR(character)         unity_output(character)
#define UNITY_OUTPUT_CHAR_HEADER_DECLARATION unity_output(int character)

#endif
