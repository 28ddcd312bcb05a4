/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* stack FILE: calls every entry of a model on painted stack; FILE gets what each took [bytes], as words. */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "board.h"

#include MODEL_HEADER

#define WAY(name) __attribute__((noinline, used)) void call_##name(void)

static const pen_set_t *const sets[] = { MODEL_SETS };
static MODEL(t) model;
static MODEL(banks_t) banks;
static MODEL(u_t) u;
static MODEL(y_t) y;
static MODEL(x_t) x;
static MODEL(z_t) z;
static MODEL(jacobian_t) jacobian;
static pen_status_report_t report;
static pen_set_head_t head;
static MODEL(sensors_jacobian_t) sensors_jacobian;
static uint8_t saved[MODEL_SIZE(SAVED)];
static bool pending;
static volatile pen_status_t status; /* of the last call, so that none is a jump */

/* clang-format off */ /* one way a line */
WAY(init) { status = MODEL(init)(&model, sets[0], &banks); }
WAY(step) { status = MODEL(step)(&model, &u, &y); }
WAY(step_jacobian) { status = MODEL(step_jacobian)(&model, &u, &y, &jacobian); }
WAY(get_state) { status = MODEL(get_state)(&model, &x); }
WAY(set_state) { status = MODEL(set_state)(&model, &x); }
WAY(sensors) { status = MODEL(sensors)(&model, &z); }
WAY(status) { status = MODEL(status)(&model, &report); }
WAY(tune_begin) { status = MODEL(tune_begin)(&model, &sets[0]->head); }
WAY(tune_write) { status = MODEL(tune_write)(&model, 0U, sets[0]->value, sets[0]->head.length); }
WAY(tune_commit) { status = MODEL(tune_commit)(&model); }
WAY(tune_abort) { status = MODEL(tune_abort)(&model); }
WAY(tune_select) { status = MODEL(tune_select)(&model, sets[0]); }
WAY(tune_rollback) { status = MODEL(tune_rollback)(&model); }
WAY(tune_hold) { status = MODEL(tune_hold)(&model, false); }
WAY(sensors_jacobian) { status = MODEL(sensors_jacobian)(&model, &sensors_jacobian); }
WAY(get_input) { status = MODEL(get_input)(&model, &u); }
WAY(set_input) { status = MODEL(set_input)(&model, &u); }
WAY(tune_begin_copy) { status = MODEL(tune_begin_copy)(&model, 3U); }
WAY(tune_write_bytes) { status = MODEL(tune_write_bytes)(&model, 0U, (const uint8_t *)sets[0]->value, 4U * sets[0]->head.length); }
WAY(tune_expect) { status = MODEL(tune_expect)(&model, sets[0]->head.checksum); }
WAY(tune_withdraw) { status = MODEL(tune_withdraw)(&model); }
WAY(tune_pending) { status = MODEL(tune_pending)(&model, &pending); }
WAY(verify) { status = MODEL(verify)(&model, MODEL_SIZE(VERIFY)); }
WAY(save) { status = MODEL(save)(&model, saved); }
WAY(restore) { status = MODEL(restore)(&model, saved); }
WAY(tune_running) { status = MODEL(tune_running)(&model, &head); }

/* In an order in which none is refused; a step adopts what is published. */
static void (*const call[])(void) = { call_init,       call_step,        call_step_jacobian, call_get_state,   call_set_state,
                                      call_sensors,    call_status,      call_tune_begin,    call_tune_write,  call_tune_commit,
                                      call_step,       call_tune_begin,  call_tune_abort,    call_tune_select, call_step,
                                      call_tune_rollback, call_step,     call_tune_hold,     call_tune_running,
                                      call_sensors_jacobian, call_get_input, call_set_input, call_tune_begin_copy, call_tune_write_bytes,
                                      call_tune_expect, call_tune_commit, call_tune_withdraw, call_step, call_tune_pending,
                                      call_verify,     call_save,        call_restore,       call_verify };
/* clang-format on */
#define CALLS (sizeof(call) / sizeof(call[0]))

int main(void)
{
    static uint32_t used[CALLS];
    char name[128];
    const int32_t file = board_argument(1U, name, sizeof(name)) ? board_open(name, true) : -1;
    bool good = (file >= 0);

    for (size_t k = 0U; k < CALLS; k++) {
        board_stack_paint();
        call[k]();
        used[k] = board_stack_used();
        good = good && ((status & ~(PEN_ADOPTED | PEN_OUTSIDE | PEN_WITHDRAWN)) == PEN_OK);
    }
    good = good && (board_write(file, used, sizeof(used)) == sizeof(used));
    board_close(file);
    return good ? 0 : 1;
}
