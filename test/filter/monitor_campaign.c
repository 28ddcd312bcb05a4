/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * The quarter vehicle of plant.py once more, in double, one run at a time, with its own noise; behind it the generated filter
 * and monitor in float. Arguments: seed, seconds, second from which on the friction acts, its force in N. Prints, from the
 * friction on: first alarms in s of the cause, of anything else, of a chi-square test of single samples and of one of blocks
 * (-1: none); then how often each of the four was raised in the whole run. NETS: weights, as monitor_campaign.py writes them.
 */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include "monitored_monitor.h"
#include "monitored_sets.h"

#include NETS /* struct net spring, damper; noises; BLOCK, BLOCK_LIMIT, SAMPLE_LIMIT */

#define H 1e-3

static uint64_t word[2];

/* xorshift128+, [0, 1) */
static double uniform(void)
{
    uint64_t a = word[0];
    const uint64_t b = word[1];
    word[0] = b;
    a ^= a << 23;
    word[1] = a ^ b ^ (a >> 18) ^ (b >> 5);
    return (double)((word[1] + b) >> 11) * 0x1p-53;
}

static double normal(void)
{
    return sqrt(-2.0 * log(1.0 - uniform())) * cos(6.283185307179586 * uniform());
}

/* The networks have one input, and ReLU between their layers; n_dense of them, row by row. */
static double net(const struct net *given, double v)
{
    double at[2][64];
    size_t width = 1;
    at[0][0] = (v - given->shift_in) * given->factor_in;
    for (size_t l = 0; l < given->n_dense; l++) {
        const struct dense *layer = &given->dense[l];
        for (size_t i = 0; i < layer->rows; i++) {
            double sum = layer->bias[i];
            for (size_t k = 0; k < width; k++) {
                sum += layer->weights[i * width + k] * at[l % 2][k];
            }
            at[(l + 1) % 2][i] = layer->relu && sum < 0.0 ? 0.0 : sum;
        }
        width = layer->rows;
    }
    return at[given->n_dense % 2][0] * given->factor_out + given->shift_out;
}

#define POINTS 65536

/* A network on a grid, straight lines between: what its kinks lose is some 1e-9 of its range. */
struct table {
    const struct net *net;
    double reach, value[POINTS + 1];
};

static struct table of_spring = { &spring, 0.05, { 0 } }, of_damper = { &damper, 1.0, { 0 } };

static void tabulate(struct table *table)
{
    for (int i = 0; i <= POINTS; i++) {
        table->value[i] = net(table->net, table->reach * (2.0 * i / POINTS - 1.0));
    }
}

static double look_up(const struct table *table, double v)
{
    const double at = (v / table->reach + 1.0) * (POINTS / 2.0);
    if (!(at >= 0.0 && at < POINTS)) {
        return net(table->net, v);
    }
    const int i = (int)at;
    return table->value[i] + (at - i) * (table->value[i + 1] - table->value[i]);
}

static void rates(const double x[4], double road, double friction, double dx[4])
{
    const double s = x[0] - x[1], v = x[2] - x[3];
    const double force = 10000.0 * s + 800.0 * v + look_up(&of_spring, s) + look_up(&of_damper, v) + friction * tanh(v / 0.02);
    dx[0] = x[2];
    dx[1] = x[3];
    dx[2] = -force / 350.0;
    dx[3] = (force - 300000.0 * (x[1] - road)) / 90.0;
}

static void advance(double x[4], double before, double now, double friction)
{
    static const double shares[4] = { 0.0, 0.5, 0.5, 1.0 }, weights[4] = { 1.0, 2.0, 2.0, 1.0 };
    double k[4] = { 0 }, total[4] = { 0 };
    for (int stage = 0; stage < 4; stage++) {
        double at[4];
        for (int i = 0; i < 4; i++) {
            at[i] = x[i] + H * shares[stage] * k[i];
        }
        rates(at, before + shares[stage] * (now - before), friction, k);
        for (int i = 0; i < 4; i++) {
            total[i] += weights[stage] * k[i];
        }
    }
    for (int i = 0; i < 4; i++) {
        x[i] += H / 6.0 * total[i];
    }
}

static void tell(int which, double time, double first[], unsigned long raised[], double from)
{
    raised[which]++;
    if (first[which] < 0.0 && time >= from) {
        first[which] = time;
    }
}

static monitored_ekf_t filter;
static monitored_monitor_t monitor;

static bool start(unsigned long long seed, double x[4], double *road)
{
    word[0] = seed * UINT64_C(0x9E3779B97F4A7C15) + 1;
    word[1] = UINT64_C(0xD1B54A32D192ED03) ^ word[0];
    tabulate(&of_spring);
    tabulate(&of_damper);
    for (int i = 0; i < 50; i++) {
        (void)uniform();
    }
    for (int i = 0; i < 4; i++) {
        x[i] = START[i] * normal();
    }
    *road = ROAD_NOISE * normal();
    return monitored_ekf_init(&filter, &monitored_set_default, NULL) == PEN_OK && monitored_monitor_init(&monitor) == PEN_OK;
}

/* One sample of the plant, then of filter and monitor. */
static void step(bool moves, double x[4], double *road, double friction)
{
    double dx[4];
    if (moves) {
        const double now = ROAD_DECAY * *road + ROAD_STEP * normal();
        advance(x, *road, now, friction);
        for (int i = 0; i < 4; i++) {
            x[i] += NOISE[i] * normal();
        }
        *road = now;
    }
    rates(x, *road, friction, dx);
    const monitored_u_t u = { 0 };
    const monitored_ekf_z_t z = { (pen_real_t)(dx[2] + SENSORS[0] * normal()), (pen_real_t)(dx[3] + SENSORS[1] * normal()) };
    (void)monitored_monitor_step(&monitor, &filter, monitored_ekf_step(&filter, &u, &z, MONITORED_EKF_ALL));
}

int main(int argc, char *argv[])
{
    double x[4], road, block = 0.0, first[4] = { -1.0, -1.0, -1.0, -1.0 };
    unsigned long raised[4] = { 0 };
    uint32_t before[2] = { 0, 0 };
    if (argc != 5) {
        return 2;
    }
    const unsigned long n = (unsigned long)(strtod(argv[2], NULL) / H);
    const double from = strtod(argv[3], NULL), size = strtod(argv[4], NULL);
    if (!start(strtoull(argv[1], NULL, 10), x, &road)) {
        return 1;
    }
    for (unsigned long k = 0; k < n; k++) {
        const double time = (double)k * H;
        double nis = 0.0;
        step(k > 0, x, &road, time >= from ? size : 0.0);
        for (uint32_t i = 0; i < 2; i++) {
            pen_monitor_test_t test;
            pen_ekf_test_t own;
            uint32_t count[PEN_EKF_VERDICTS];
            (void)monitored_monitor_test(&monitor, i, &test);
            if (test.count != before[i]) {
                tell((int)i, time, first, raised, from);
            }
            before[i] = test.count;
            (void)monitored_ekf_test(&filter, i, &own, count);
            nis += (double)own.ratio;
        }
        block += nis;
        if (nis > SAMPLE_LIMIT) {
            tell(2, time, first, raised, from);
        }
        if (k % BLOCK == BLOCK - 1) {
            if (block > BLOCK_LIMIT) {
                tell(3, time, first, raised, from);
            }
            block = 0.0;
        }
    }
    for (int i = 0; i < 4; i++) {
        printf("%.3f ", first[i]);
    }
    printf("%lu %lu %lu %lu\n", raised[0], raised[1], raised[2], raised[3]);
    return 0;
}
