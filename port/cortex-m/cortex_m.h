/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/** What the files of this port share: symbols of program.ld, core registers, semihosting. */
#ifndef CORTEX_M_H
#define CORTEX_M_H

#include <stdint.h>

/* ---- places, from program.ld ---- */

extern uint32_t board_guard[];
extern uint32_t board_stack_limit[];
extern uint32_t board_stack_top[];
extern uint32_t board_fault_stack_top[];

/* ---- registers (Armv7-M and Armv8-M Architecture Reference Manuals) ---- */

#define REGISTER(address) (*(volatile uint32_t *)(address))

#define SYST_CSR  REGISTER(0xE000E010U) /* SysTick: control, reload, current value (counts down, 24 bits) */
#define SYST_RVR  REGISTER(0xE000E014U)
#define SYST_CVR  REGISTER(0xE000E018U)
#define SCB_SHCSR REGISTER(0xE000ED24U) /* fault handlers on                   */
#define SCB_CFSR  REGISTER(0xE000ED28U) /* causes of a fault                   */
#define SCB_HFSR  REGISTER(0xE000ED2CU)
#define SCB_MMFAR REGISTER(0xE000ED34U) /* address of a memory management fault */
#define SCB_BFAR  REGISTER(0xE000ED38U) /* address of a bus fault               */
#define SCB_CPACR REGISTER(0xE000ED88U) /* access to the FPU                    */
#define MPU_CTRL  REGISTER(0xE000ED94U)
#define MPU_RNR   REGISTER(0xE000ED98U)
#define MPU_RBAR  REGISTER(0xE000ED9CU)
#define MPU_RASR  REGISTER(0xE000EDA0U) /* Armv7-M */
#define MPU_RLAR  REGISTER(0xE000EDA0U) /* Armv8-M */
#define MPU_MAIR0 REGISTER(0xE000EDC0U) /* Armv8-M */

/* ---- semihosting: the debugger's, here the emulator's, services ---- */

#define HOST_OPEN    0x01U
#define HOST_CLOSE   0x02U
#define HOST_WRITE0  0x04U
#define HOST_WRITE   0x05U
#define HOST_READ    0x06U
#define HOST_CMDLINE 0x15U
#define HOST_EXIT    0x20U

/** @param argument  a text for HOST_WRITE0, else the block of words that the service takes */
static inline uint32_t host_call(uint32_t service, const void *argument)
{
    register uint32_t r0 __asm__("r0") = service;
    register const void *r1 __asm__("r1") = argument;

    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

/* ---- between the files of the port ---- */

void board_reset(void);      /* vector 1 */
void board_fault(void);      /* all fault vectors */
void board_tick(void);       /* SysTick vector */
void board_count_init(void); /* start SysTick and find out how long an instruction takes */

#endif
