/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* A fault ends the program with one line that says what and where, and with BOARD_EXIT_FAULT. */

#include "board.h"
#include "cortex_m.h"

#define CFSR_MMARVALID (1U << 7U)
#define CFSR_BFARVALID (1U << 15U)
#define CFSR_NO_FRAME  ((1U << 4U) | (1U << 12U) | (1U << 20U)) /* MSTKERR, STKERR, STKOF */
#define FRAME_LR       5U
#define FRAME_PC       6U

void board_fault_report(const uint32_t frame[], uint32_t exception);

/* Our own stack first: the old one may be the cause, and its limit would stop us again. */
__attribute__((naked)) void board_fault(void)
{
    __asm__ volatile("mrs r0, msp\n\t"
                     "mrs r1, ipsr\n\t"
#if __ARM_ARCH >= 8
                     "movs r2, #0\n\t"
                     "msr msplim, r2\n\t"
#endif
                     "ldr r2, =board_fault_stack_top\n\t"
                     "mov sp, r2\n\t"
                     "b board_fault_report\n\t"
                     ".ltorg");
}

static const char *name_of(uint32_t exception)
{
    static const char *const name[8] = {
        "exception", "exception", "NMI", "HardFault", "MemManage", "BusFault", "UsageFault", "SecureFault"
    };

    return name[(exception < 8U) ? exception : 0U];
}

static void print_word(const char *label, uint32_t value)
{
    board_print(label);
    board_print_hex(value);
}

__attribute__((used)) void board_fault_report(const uint32_t frame[], uint32_t exception)
{
    const uint32_t cfsr = SCB_CFSR;

    board_print("\nfault: ");
    board_print(name_of(exception));
    if ((cfsr & CFSR_NO_FRAME) != 0U) {
        board_print(", stack overflow");
    } else {
        print_word(" pc ", frame[FRAME_PC]);
        print_word(" lr ", frame[FRAME_LR]);
    }
    if ((cfsr & CFSR_MMARVALID) != 0U) {
        print_word(" address ", SCB_MMFAR);
    } else if ((cfsr & CFSR_BFARVALID) != 0U) {
        print_word(" address ", SCB_BFAR);
    } else {
        /* a fault without an address */
    }
    print_word(" cfsr ", cfsr);
    print_word(" hfsr ", SCB_HFSR);
    board_print("\n");
    board_exit(BOARD_EXIT_FAULT);
}
