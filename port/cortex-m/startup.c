/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* From reset to main(): FPU on, variables filled, memory protected, fault handlers on. */

#include "board.h"
#include "cortex_m.h"

extern uint32_t board_data[];
extern uint32_t board_data_end[];
extern uint32_t board_data_load[];
extern uint32_t board_bss[];
extern uint32_t board_bss_end[];

int main(void);

typedef void (*vector_t)(void);

/* Only the exceptions of the core: no program of ours uses an interrupt of the board. */
__attribute__((section(".vectors"), used)) static const vector_t vectors[16] = {
    (vector_t)(uintptr_t)board_stack_top,
    board_reset,
    board_fault, /* NMI */
    board_fault, /* HardFault */
    board_fault, /* MemManage */
    board_fault, /* BusFault */
    board_fault, /* UsageFault */
    board_fault, /* SecureFault */
    board_fault,
    board_fault,
    board_fault,
    board_fault, /* SVCall */
    board_fault, /* DebugMonitor */
    board_fault,
    board_fault, /* PendSV */
    board_tick,
};

#if __ARM_ARCH >= 8

/* The stack pointer has a limit of its own. Nothing may be written below the secure alias of the ROM, NULL included. */
static void protect(void)
{
    __asm__ volatile("msr msplim, %0" : : "r"(board_stack_limit));
    MPU_MAIR0 = 0x00000000U;               /* attribute 0: device                    */
    MPU_RNR = 0U;
    MPU_RBAR = 0x00000000U | 0x4U | 0x1U;  /* from 0: read only, never execute       */
    MPU_RLAR = 0x0FFFFFE0U | 0x1U;         /* to 0x0FFFFFFF                          */
    MPU_CTRL = 0x5U;                       /* on, the default map elsewhere          */
}

#else

/* The lowest 4 MB, which are ROM, can be read and executed only; the guard below the stack not even that. */
static void protect(void)
{
    MPU_RBAR = 0x00000000U | 0x10U | 0U;                           /* region 0 at 0               */
    MPU_RASR = (0x6U << 24U) | (0x2U << 16U) | (21U << 1U) | 0x1U; /* read only, normal, 2^22 bytes */
    MPU_RBAR = (uint32_t)board_guard | 0x10U | 1U;                 /* region 1                    */
    MPU_RASR = (0x1U << 28U) | (11U << 1U) | 0x1U;                 /* no access, 2^12 bytes       */
    MPU_CTRL = 0x5U;                                               /* on, the default map elsewhere */
}

#endif

void board_reset(void)
{
    const uint32_t *from = board_data_load;

    SCB_CPACR |= 0xFU << 20U;
    for (uint32_t *to = board_data; to < board_data_end; to++) {
        *to = *from;
        from++;
    }
    for (uint32_t *to = board_bss; to < board_bss_end; to++) {
        *to = 0U;
    }
    protect();
    SCB_SHCSR |= 0x7U << 16U; /* MemManage, BusFault and UsageFault have handlers */
    __asm__ volatile("dsb\n\tisb" : : : "memory");
    board_count_init();
    board_exit((uint32_t)main());
}
