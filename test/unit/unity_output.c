/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#include "board.h"
#include "unity.h"

/* Line by line: each print stops an emulated machine for a while. */
void unity_output(int character)
{
    static char line[128];
    static uint32_t length;

    line[length] = (char)character;
    length++;
    if ((character == '\n') || (length == (sizeof(line) - 1U))) {
        line[length] = '\0';
        board_print(line);
        length = 0U;
    }
}
