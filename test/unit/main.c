/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/** Runs the files of tests that UNITS lists, or those from one to another: program FIRST LAST. Prints each name first. */
#include <string.h>

#include "board.h"
#include "unity.h"

#define UNIT(name) int main_##name(void); /* what Unity's generator calls the main function of a file's runner */
UNITS
#undef UNIT
#define UNIT(name) { #name, main_##name },

static const struct {
    const char *name;
    int (*run)(void);
} FILES[] = { UNITS };

/* Unity calls these in a runner that no file here uses; each file has its own. */
void setUp(void) {}
void tearDown(void) {}

int main(void)
{
    char first[64];
    char last[64];
    const bool some = board_argument(1U, first, sizeof(first)) && board_argument(2U, last, sizeof(last));
    bool running = !some;
    int failed = 0;
    size_t i;

    for (i = 0U; i < (sizeof(FILES) / sizeof(FILES[0])); i++) {
        running = running || (strcmp(FILES[i].name, first) == 0);
        if (running) {
            board_print("== ");
            board_print(FILES[i].name);
            board_print("\n");
            failed += (FILES[i].run() != 0);
        }
        running = running && !(some && (strcmp(FILES[i].name, last) == 0));
    }
    return failed != 0;
}
