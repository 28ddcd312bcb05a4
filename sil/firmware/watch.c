/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * Example: virtual sensors and a fault monitor on a microcontroller, for the model file sil/filter/watched.toml. A timer
 * interrupt takes a sample a millisecond: measurements, filter, monitor. The main loop prints a status line a second, and
 * hands over another set, a few values at a time, while the interrupt goes on.
 *
 * The vehicle is simulated, with noise; the filter sees its two accelerations and nothing else. After 2 s the damper
 * begins to rub, and the monitor's flag rises. After 4 s the filter receives the set that has this friction, and the flag
 * falls: state and covariance stay. With the argument "healthy" nothing rubs, nothing is received, and no flag may rise.
 *
 * Ends with 0 if all went as it should, with 1 if not.
 */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "board.h"
#include "penode/pen_real.h"
#include "penode/pen_set.h"
#include "penode/pen_status.h"
#include "watched.h"
#include "watched_ekf.h"
#include "watched_monitor.h"
#include "watched_sets.h"

#define RATE     1000U /* samples a second: WATCHED_SAMPLE_TIME */
#define SECONDS  6U
#define RUBS     2U    /* s: the vehicle begins to rub */
#define RECEIVES 4U    /* s: the filter gets the set   */
#define FRAME    16U   /* values in a frame of the bus */

/* ---- the vehicle, which measures: in its place come your sensors, in SI units ---- */

static watched_t vehicle;

/* A number whose mean is 0 and whose variance is 1: the sum of four that are uniform. */
static pen_real_t noise(void)
{
    static uint32_t word = 1U;
    pen_real_t sum = (pen_real_t)-2;

    for (size_t i = 0U; i < 4U; i++) {
        word = (word * 1664525U) + 1013904223U;
        const uint32_t upper = word >> 8U;
        sum += (pen_real_t)upper * (pen_real_t)5.9604644775390625e-8; /* 2^-24 */
    }
    return sum * (pen_real_t)1.7320508;
}

/* Road height [m]: as rough as the filter expects it. */
static pen_real_t road(void)
{
    static pen_real_t height = (pen_real_t)0;

    height = ((pen_real_t)0.998 * height) + ((pen_real_t)3.16e-4 * noise());
    return height;
}

/* Take a sample. The deflection is what the filter does not see. */
static void measure(watched_ekf_z_t *z, pen_real_t *deflection)
{
    const watched_u_t u = { road() };
    watched_y_t y;
    watched_z_t seen;

    (void)watched_step(&vehicle, &u, &y);
    if (pen_advanced(watched_sensors(&vehicle, &seen))) {
        z->a_body = seen.a_body + ((pen_real_t)0.02 * noise());
        z->a_wheel = seen.a_wheel + ((pen_real_t)0.1 * noise());
        *deflection = seen.deflection;
    }
}

/* ---- what interrupt and main loop share: the interrupt writes ---- */

typedef struct {
    int32_t deflection; /* um, estimated without a sensor for it */
    int32_t off;        /* um, estimated less true               */
    int32_t deviation;  /* um, standard deviation of it          */
    uint32_t refused;   /* measurements, so far                  */
    uint32_t rubbing;   /* sample of the first alarm with this set, 0: none */
    uint32_t others;    /* alarms of anything else with this set            */
} line_t;

static watched_ekf_t filter; /* the main loop uses filter.model, by its tuning calls */
static watched_monitor_t monitor;
static volatile line_t line;      /* of the last whole second                             */
static volatile uint32_t samples; /* so far                                               */
static volatile uint32_t alarm;   /* sample of the first alarm with this set, 0: none yet */
static volatile uint32_t adopted; /* first sample with this set                           */
static volatile uint32_t missed;  /* samples in which the filter held                     */

/* ---- the interrupt ---- */

static int32_t micrometres(pen_real_t metres)
{
    const pen_real_t scaled = metres * (pen_real_t)1e6;

    return (int32_t)(scaled + ((scaled < (pen_real_t)0) ? (pen_real_t)-0.5 : (pen_real_t)0.5));
}

/* How often a measurement was refused. */
static uint32_t refused(uint32_t number)
{
    uint32_t count[PEN_EKF_VERDICTS] = { 0U, 0U, 0U, 0U };
    pen_ekf_test_t test;

    (void)watched_ekf_test(&filter, number, &test, count);
    return count[PEN_EKF_IS_REFUSED];
}

static void show(pen_real_t deflection)
{
    pen_monitor_test_t other = { (pen_real_t)0, 0U, 0U };
    watched_ekf_estimate_t estimate;

    if (pen_advanced(watched_ekf_estimate(&filter, &estimate))) {
        line.deflection = micrometres(estimate.z.deflection);
        line.off = micrometres(estimate.z.deflection - deflection);
        line.deviation = micrometres(estimate.z_deviation.deflection);
    }
    (void)watched_monitor_test(&monitor, WATCHED_MONITOR_OTHER, &other);
    line.refused = refused(WATCHED_EKF_A_BODY) + refused(WATCHED_EKF_A_WHEEL);
    line.rubbing = alarm;
    line.others = other.count;
}

void board_timer(void)
{
    const watched_u_t u = { (pen_real_t)0 }; /* the road is estimated */
    const uint32_t now = samples;
    watched_ekf_z_t z = { (pen_real_t)0, (pen_real_t)0 };
    pen_real_t deflection = (pen_real_t)0;
    pen_status_t status;

    measure(&z, &deflection);
    status = watched_ekf_step(&filter, &u, &z, WATCHED_EKF_ALL);
    if ((status & PEN_ADOPTED) != PEN_OK) { /* what was found with another set says nothing about this one */
        (void)watched_monitor_init(&monitor);
        alarm = 0U;
        adopted = now;
    }
    if ((watched_monitor_step(&monitor, &filter, status) & PEN_MONITOR_CAUSE) != PEN_OK) {
        alarm = (alarm == 0U) ? now : alarm; /* kept: the test itself falls when its sum is back at 0 */
    }
    if ((status & PEN_EKF_HOLDING) != PEN_OK) {
        missed++;
    }
    if ((now % RATE) == 0U) {
        show(deflection);
    }
    samples = now + 1U;
}

/* ---- the main loop ---- */

/* Until the interrupt has taken this sample. */
static void wait_for(uint32_t sample)
{
    while (samples <= sample) {
        /* a real application sleeps here */
    }
}

static void print_pair(const char *what, uint32_t value)
{
    board_print(what);
    board_print_number(value);
}

static void print_signed(const char *what, int32_t value)
{
    board_print(what);
    if (value < 0) {
        board_print("-");
    }
    board_print_number((uint32_t)((value < 0) ? -value : value));
}

/* The status line of a second, which the interrupt has written. */
static void print_line(uint32_t second)
{
    print_pair("", second);
    print_signed(" s: deflection ", line.deflection);
    print_signed(" um, 3 sigma ", 3 * line.deviation);
    print_signed(" um, off by ", line.off);
    print_pair(" um, refused ", line.refused);
    if (line.rubbing != 0U) {
        print_pair(", RUBBING since sample ", line.rubbing);
    } else {
        board_print(", not rubbing");
    }
    print_pair(", other alarms ", line.others);
    board_print("\n");
}

/* Take the set with the friction from the bus, a frame a millisecond, into the buffer that the filter does not use. */
static pen_status_t receive(void)
{
    pen_status_t status = watched_tune_begin(&filter.model, &watched_set_worn.head);
    uint32_t offset = 0U;

    while ((status == PEN_OK) && (offset < WATCHED_SET_LENGTH)) {
        const uint32_t left = WATCHED_SET_LENGTH - offset;
        const uint32_t n = (left < FRAME) ? left : FRAME;

        status = watched_tune_write(&filter.model, offset, &watched_set_worn.value[offset], n);
        offset += n;
        wait_for(samples);
    }
    return (status == PEN_OK) ? watched_tune_commit(&filter.model) : status;
}

/* What happens at the seconds of the example. */
static bool act(uint32_t second)
{
    bool good = true;

    if (second == RUBS) {
        good = (watched_tune_select(&vehicle, &watched_set_worn) == PEN_OK);
        board_print("the damper begins to rub with 30 N\n");
    }
    if (second == RECEIVES) {
        good = (receive() == PEN_OK);
        wait_for(samples + 1U);
        print_pair("set received, in force at sample ", adopted);
        board_print("\n");
    }
    return good;
}

/* Is the flag as it should be at the end of a second? */
static bool flag_is_right(uint32_t second, bool healthy)
{
    const bool rubs = (!healthy) && (second > RUBS) && (second <= RECEIVES);
    const bool shown = line.rubbing != 0U;

    return rubs == shown;
}

int main(void)
{
    static watched_banks_t banks; /* two buffers for sets that are received */
    char argument[16];
    const bool healthy = board_argument(1U, argument, sizeof(argument)); /* any word */
    bool good = (watched_init(&vehicle, &watched_set_default, NULL) == PEN_OK);

    good = (watched_ekf_init(&filter, &watched_set_default, &banks) == PEN_OK) && good;
    good = (watched_monitor_init(&monitor) == PEN_OK) && good;
    if (good) {
        board_timer(); /* the sample at time 0 */
        board_timer_start(RATE);
        for (uint32_t second = 1U; second <= SECONDS; second++) {
            wait_for(second * RATE);
            print_line(second);
            good = flag_is_right(second, healthy) && good;
            good = (healthy || act(second)) && good;
        }
        good = (missed == 0U) && good;
    }
    board_print(good ? "watch: good\n" : "watch: something went wrong\n");
    return good ? 0 : 1;
}
