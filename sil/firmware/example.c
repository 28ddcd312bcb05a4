/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * Example: the nQVM on a microcontroller. A timer interrupt takes one step a millisecond; the main loop receives another
 * damper set from a bus, a few values at a time, and hands it over while the interrupt goes on. Every call of the
 * generated interface is used once, in the place where an application would use it.
 *
 * Ends with 0 if all went as it should, with 1 if not.
 */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "board.h"
#include "nqvm.h"
#include "penode/pen_real.h"
#include "penode/pen_set.h"
#include "penode/pen_status.h"

#define RATE  1000U /* steps a second */
#define FRAME 16U   /* values in a frame of the bus */
#define NEVER UINT32_MAX

/* ---- what interrupt and main loop share: one writer each ---- */

static nqvm_t model;
static volatile uint32_t paused;             /* written by the main loop: 1 while it uses the instance itself */
static volatile uint32_t samples;            /* written by the interrupt: steps so far                       */
static volatile uint32_t missed;             /* written by the interrupt: steps that did not advance         */
static volatile uint32_t adopted_at = NEVER; /* written by the interrupt: sample that first ran the last set */

/* ---- the interrupt ---- */

/* Road height [m]: waves of 0.5 s and 10 mm made of parabolas, smooth enough for a road. */
static pen_real_t road(uint32_t sample)
{
    const uint32_t phase = sample % 250U;
    const pen_real_t along = (pen_real_t)phase * (pen_real_t)0.004; /* 0 .. 1 over half a wave */
    const pen_real_t hill = ((pen_real_t)0.04 * along) * ((pen_real_t)1.0 - along);

    return ((sample % 500U) < 250U) ? hill : -hill;
}

void board_timer(void)
{
    if (paused == 0U) {
        const uint32_t now = samples;
        const nqvm_u_t u = { road(now) };
        nqvm_y_t y;
        const pen_status_t status = nqvm_step(&model, &u, &y);

        if ((status & PEN_ADOPTED) != PEN_OK) {
            adopted_at = now;
        }
        if (!pen_advanced(status)) {
            missed++;
        }
        samples = now + 1U;
    }
}

/* ---- the main loop ---- */

static void print_pair(const char *what, uint32_t value)
{
    board_print(what);
    board_print_number(value);
}

/* Until the interrupt has taken n more steps. */
static void wait(uint32_t n)
{
    const uint32_t end = samples + n;

    while (samples != end) {
        /* a real application sleeps here */
    }
}

/* The bus: frame by frame the values of a set; here they lie in flash. Returns how many there are in this frame. */
static uint32_t receive(uint32_t offset, const pen_real_t **value)
{
    const uint32_t left = NQVM_SET_LENGTH - offset;

    *value = &nqvm_set_altered_friction.value[offset];
    return (left < FRAME) ? left : FRAME;
}

/* Take a whole set from the bus, a frame a millisecond, into the buffer that the step does not use. */
static pen_status_t recalibrate(void)
{
    pen_status_t status = nqvm_tune_begin(&model, &nqvm_set_altered_friction.head);
    uint32_t offset = 0U;

    while ((status == PEN_OK) && (offset < NQVM_SET_LENGTH)) {
        const pen_real_t *value = NULL;
        const uint32_t n = receive(offset, &value);

        status = nqvm_tune_write(&model, offset, value, n);
        offset += n;
        wait(1U);
    }
    return (status == PEN_OK) ? nqvm_tune_commit(&model) : status;
}

/* A transfer that breaks off: what came is dropped, the running set is untouched. */
static pen_status_t break_off(void)
{
    const pen_real_t *value = NULL;
    const uint32_t n = receive(0U, &value);
    pen_status_t status = nqvm_tune_begin(&model, &nqvm_set_altered_friction.head);

    if (status == PEN_OK) {
        status = nqvm_tune_write(&model, 0U, value, n);
    }
    if (status == PEN_OK) {
        status = nqvm_tune_abort(&model);
    }
    return status;
}

/* Wait for the next step and say which set runs since when. */
static bool report_adoption(const char *how, uint32_t expected)
{
    pen_set_head_t running = { 0U, 0U, 0U, 0U };
    bool good;

    wait(2U);
    good = (nqvm_tune_running(&model, &running) == PEN_OK);
    print_pair("set ", running.id);
    board_print(how);
    print_pair(" at sample ", adopted_at);
    board_print("\n");
    return good && (running.id == expected) && (adopted_at != NEVER);
}

/* What an observer does between two samples: correct the state, and ask how the next step depends on it. */
static bool observe(void)
{
    const nqvm_u_t u = { road(samples) };
    nqvm_x_t x;
    nqvm_y_t y;
    nqvm_z_t z;
    nqvm_jacobian_t j;
    pen_status_t status;

    paused = 1U;
    status = nqvm_get_state(&model, &x);
    if (status == PEN_OK) {
        x.z_b += (pen_real_t)0.0001;
        status = nqvm_set_state(&model, &x);
    }
    if (status == PEN_OK) {
        status = nqvm_step_jacobian(&model, &u, &y, &j);
    }
    if (status == PEN_OK) {
        samples++;
        status = nqvm_sensors(&model, &z);
    }
    paused = 0U;
    /* the corrected height must show in the next one: d z_b(k) / d z_b(k-1) is close to 1 */
    return (status == PEN_OK) && (j.x_x[0][0] > (pen_real_t)0.9) && (j.x_x[0][0] < (pen_real_t)1.1);
}

/* Print what was raised since the start; true if it is what this program provoked. */
static bool report_status(void)
{
    pen_status_report_t report;
    const pen_status_t status = nqvm_status(&model, &report);

    print_pair("status: ", samples);
    print_pair(" samples, held ", pen_status_times(&report, PEN_HELD));
    print_pair(", sets adopted ", pen_status_times(&report, PEN_ADOPTED));
    board_print(", flags ");
    board_print_hex(report.flags);
    board_print("\n");
    return (status == PEN_OK) && ((report.flags & ~PEN_OUTSIDE) == (PEN_HELD | PEN_ADOPTED)) &&
           (pen_status_times(&report, PEN_ADOPTED) == 3U);
}

int main(void)
{
    static nqvm_banks_t banks; /* two buffers for sets that are received */
    bool good = (nqvm_init(&model, &nqvm_set_default, &banks) == PEN_OK);

    if (good) {
        board_timer(); /* the sample at time 0 */
        board_timer_start(RATE);
        wait(100U);
        good = (break_off() == PEN_OK);
        good = (recalibrate() == PEN_OK) && good;
        good = report_adoption(" received in chunks, adopted", nqvm_set_altered_friction.head.id) && good;
        wait(50U);
        good = (nqvm_tune_rollback(&model) == PEN_OK) && good;
        good = report_adoption(" back by rollback", nqvm_set_default.head.id) && good;
        good = (nqvm_tune_select(&model, &nqvm_set_altered_friction) == PEN_OK) && good;
        good = report_adoption(" selected in flash", nqvm_set_altered_friction.head.id) && good;
        good = (missed == 0U) && good; /* no sample was missed by any of it */
        good = (nqvm_tune_hold(&model, true) == PEN_OK) && good;
        wait(5U);
        good = (nqvm_tune_hold(&model, false) == PEN_OK) && good;
        wait(5U);
        good = observe() && good;
        good = report_status() && good;
    }
    board_print(good ? "example: good\n" : "example: something went wrong\n");
    return good ? 0 : 1;
}
