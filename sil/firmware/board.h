/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * All that the programs of this folder and the tests ask of a board. Implemented by port/cortex-m (emulated machines,
 * semihosting) and port/host (standard C library). The board calls main() and ends the program with what it returns.
 */
#ifndef BOARD_H
#define BOARD_H

#include <stdbool.h>
#include <stdint.h>

#define BOARD_EXIT_FAULT 70U /* exit code after a processor fault; the report is printed before */

/* ---- text ---- */

void board_print(const char *text);
void board_print_number(uint32_t value);  /* decimal          */
void board_print_hex(uint32_t value);     /* 0x and 8 digits  */

/* ---- the program's surroundings ---- */

/** Copy a word of the command line; 1 is the first after the program's name. False if it is missing or does not fit. */
bool board_argument(uint32_t index, char text[], uint32_t size);

/** End the program; the code arrives in the shell. Does not return. */
void board_exit(uint32_t code);

/* ---- files of the host, in binary ---- */

/** Open for reading, or (write) make anew. @return a handle for the calls below; negative if it cannot be opened */
int32_t board_open(const char *name, bool write);

/** @return number of bytes read; less than asked for at the end of the file or on failure */
uint32_t board_read(int32_t file, void *data, uint32_t bytes);

/** @return number of bytes written; less than asked for on failure */
uint32_t board_write(int32_t file, const void *data, uint32_t bytes);

void board_close(int32_t file);

/* ---- measuring ---- */

/**
 * Count the instructions between the two calls, without those of the calls themselves. Exact on an emulated machine
 * whose clock goes by instructions (see port/cortex-m/run) as long as they are fewer than 4 million, or than fit a
 * period of the timer; 0 where nothing can be counted.
 */
void board_count_start(void);
uint32_t board_count_stop(void);

/** Paint the free part of the stack. */
void board_stack_paint(void);

/** @return bytes of stack below the caller of board_stack_paint() that were used since; 0 where it is not measured */
uint32_t board_stack_used(void);

/* ---- a periodic interrupt ---- */

/** Call board_timer() `rate` times a second (1 .. 100 000), from an interrupt. Once per program. */
void board_timer_start(uint32_t rate);

/** The program's own interrupt function; does nothing if the program has none. */
void board_timer(void);

#endif
