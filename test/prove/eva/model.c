/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * For Frama-C: every function of a generated model, in any order, any number of times, with any arguments.
 *
 * in_order  starts with an instance of zeros: as called by a program that ignores all rules.
 * corrupted overwrites the whole instance with any bytes before each call. Its pointers then name any of the buffers, in
 *           any mix: that a pointer points somewhere is the one thing that no C program can check.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "__fc_builtin.h"

#include MODEL_HEADER

extern volatile uint32_t any; /* each read gives any number */

static MODEL(t) instance;
static MODEL(banks_t) banks;
static MODEL(u_t) input;
static MODEL(y_t) output;
static MODEL(x_t) state;
static MODEL(z_t) sensed;
static MODEL(jacobian_t) jacobian;
static pen_status_report_t report;
static pen_set_head_t head;
static pen_real_t flash[2][MODEL_SIZE(SET_LENGTH)];
static pen_real_t chunk[MODEL_SIZE(SET_LENGTH)];
static uint8_t bytes[sizeof chunk];
static uint8_t saved[MODEL_SIZE(SAVED)];
static bool pending;
static MODEL(sensors_jacobian_t) sensors_jacobian;
static pen_set_t set;

static void fill(void *at, size_t bytes)
{
    Frama_C_make_unknown((char *)at, bytes);
}

/* NULL or what is asked for */
#define OR_NULL(pointer) ((any == 0U) ? NULL : (pointer))

static void arguments(void)
{
    fill(&input, sizeof input);
    fill(&state, sizeof state);
    fill(&head, sizeof head);
    fill(flash, sizeof flash);
    fill(chunk, sizeof chunk);
    fill(bytes, sizeof bytes);
    fill(saved, sizeof saved);
    fill(&set.head, sizeof set.head);
    set.value = OR_NULL((any == 0U) ? flash[0] : flash[1]);
}

static void call(void)
{
    MODEL(t) *const self = OR_NULL(&instance);
    const uint32_t n = any;

    switch (any) {
    case 0U: MODEL(init)(self, OR_NULL(&set), OR_NULL(&banks)); break;
    case 1U: MODEL(step)(self, OR_NULL(&input), OR_NULL(&output)); break;
    case 2U: MODEL(step_jacobian)(self, OR_NULL(&input), OR_NULL(&output), OR_NULL(&jacobian)); break;
    case 3U: MODEL(get_state)(self, OR_NULL(&state)); break;
    case 4U: MODEL(set_state)(self, OR_NULL(&state)); break;
    case 5U: MODEL(sensors)(self, OR_NULL(&sensed)); break;
    case 6U: MODEL(status)(self, OR_NULL(&report)); break;
    case 7U: MODEL(tune_begin)(self, OR_NULL(&head)); break;
    case 8U: MODEL(tune_write)(self, any, (n <= MODEL_SIZE(SET_LENGTH)) ? OR_NULL(chunk) : NULL, n); break;
    case 9U: MODEL(tune_commit)(self); break;
    case 10U: MODEL(tune_abort)(self); break;
    case 11U: MODEL(tune_select)(self, OR_NULL(&set)); break;
    case 12U: MODEL(tune_rollback)(self); break;
    case 13U: MODEL(tune_hold)(self, any != 0U); break;
    case 14U: MODEL(tune_running)(self, OR_NULL(&head)); break;
    case 15U: MODEL(get_input)(self, OR_NULL(&input)); break;
    case 16U: MODEL(set_input)(self, OR_NULL(&input)); break;
    case 17U: MODEL(sensors_jacobian)(self, OR_NULL(&sensors_jacobian)); break;
    case 18U: MODEL(tune_begin_copy)(self, any); break;
    case 19U: MODEL(tune_write_bytes)(self, any, (n <= sizeof bytes) ? OR_NULL(bytes) : NULL, n); break;
    case 20U: MODEL(tune_expect)(self, any); break;
    case 21U: MODEL(tune_withdraw)(self); break;
    case 22U: MODEL(tune_pending)(self, OR_NULL(&pending)); break;
    case 23U: MODEL(verify)(self, any); break;
    case 24U: MODEL(save)(self, OR_NULL(saved)); break;
    default: MODEL(restore)(self, OR_NULL(saved)); break;
    }
}

void in_order(void)
{
    /*@ dynamic_split instance.head.ready == 0; */
    /*@ dynamic_split instance.head.tuning.open == 0; */
    /*@ dynamic_split instance.head.tuning.bank[0] == (void *)0; */
    /*@ dynamic_split instance.head.tuning.bank[1] == (void *)0; */
    while (any != 0U) {
        arguments();
        call();
    }
}

static pen_real_t *buffer(void)
{
    pen_real_t *const bank = (any == 0U) ? banks.value[0] : banks.value[1];
    pen_real_t *const set_value = (any == 0U) ? flash[0] : flash[1];

    return (any == 0U) ? bank : set_value;
}

void corrupted(void)
{
    while (any != 0U) {
        arguments();
        fill(&banks, sizeof banks);
        fill(&instance, sizeof instance);
        for (size_t i = 0U; i < 2U; i++) {
            instance.head.tuning.slot[i].value = buffer();
            instance.head.tuning.slot_check[i].value = OR_NULL(buffer());
            instance.head.tuning.bank[i] = OR_NULL(buffer());
            instance.head.tuning.bank_check[i] = OR_NULL(buffer());
        }
        instance.head.tuning.previous.value = OR_NULL(buffer());
        instance.head.tuning.replaced.value = OR_NULL(buffer());
        instance.head.tuning.initial.value = buffer();
        call();
    }
}
