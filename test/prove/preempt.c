/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * preempt ALL FILE: every tuning call of small.toml is pre-empted by a step, and every step by a tuning call, once at each
 * boundary between two instructions, with and without a set that waits; for preempt_check.py. The delay before the interrupt
 * grows by TICKS from run to run.
 * ALL: 0: nothing is interrupted (to count what is executed); 1: all. FILE gets a bit for each halfword at which a call was
 * interrupted, then a step.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include "board.h"
#include "cortex_m.h"
#include "small.h"

#define N SMALL_SET_LENGTH

enum { BEGIN, WRITE, COMMIT, ABORT, SELECT, ROLLBACK, HOLD, RUNNING, REPORT, WITHDRAW, VERIFY, EXCHANGE, KINDS };
enum { SOFT, STIFF, KINKED, SETS }; /* runs first, is selected, is staged */

static const pen_set_t *const set[SETS] = { &small_set_default, &small_set_stiff, &small_set_kinked };
static const char *const name[KINDS] = { "begin", "write",   "commit", "abort",    "select", "rollback",
                                         "hold",  "running", "status", "withdraw", "verify", "exchange" };
static small_t model;
static small_banks_t banks;
static pen_real_t expected[SETS];
static bool step_interrupts;

/* of one run */
static volatile pen_status_t result; /* of the tuning call */
static uint32_t kind;
static uint32_t in_force;  /* set */
static uint32_t waiting;   /* set, or SETS if none waits */
static uint32_t target;    /* set that the call publishes, or SETS */
static uint32_t adopted;   /* how often */
static uint32_t withdrawn; /* how often */
static uint32_t reported;  /* of those adopted */
static pen_real_t last;
static uint32_t failures;
static uint32_t runs;

#include "interrupt.inc"

static void fail(const char *what)
{
    if (failures < 10U) {
        board_print(step_interrupts ? "step in a call, " : "call in a step, ");
        board_print(name[kind]);
        board_print(" in run ");
        board_print_number(runs);
        board_print(": ");
        board_print(what);
        board_print("\n");
    }
    failures++;
}

static void expect(bool good, const char *what)
{
    if (!good) {
        fail(what);
    }
}

/* ---- what interrupts and is interrupted ---- */

static pen_status_t open_set(void)
{
    return small_tune_begin(&model, &set[KINKED]->head);
}

static pen_status_t fill_set(uint32_t from, uint32_t n)
{
    return small_tune_write(&model, from, &set[KINKED]->value[from], n);
}

__attribute__((noinline)) void tune(void)
{
    pen_status_t status = PEN_OK;
    pen_set_head_t head;
    pen_status_report_t report;

    switch (kind) {
    case BEGIN: status = open_set(); break;
    case WRITE: status = fill_set(0U, N); break;
    case COMMIT: status = small_tune_commit(&model); break;
    case ABORT: status = small_tune_abort(&model); break;
    case SELECT: status = small_tune_select(&model, set[STIFF]); break;
    case ROLLBACK: status = small_tune_rollback(&model); break;
    case HOLD: status = small_tune_hold(&model, true); break;
    case RUNNING:
        status = small_tune_running(&model, &head);
        expect((head.id == set[in_force]->head.id) || (head.id == set[SOFT]->head.id) || (head.id == set[STIFF]->head.id), "head");
        break;
    case REPORT:
        status = small_status(&model, &report);
        reported = pen_status_times(&report, PEN_ADOPTED);
        break;
    case WITHDRAW: status = small_tune_withdraw(&model); break;
    case VERIFY: status = small_verify(&model, SMALL_VERIFY); break;
    default:
        status = open_set();
        if (status == PEN_OK) {
            status |= fill_set(0U, 4U);
            status |= fill_set(4U, N - 4U);
            status |= small_tune_commit(&model);
        }
        break;
    }
    result = status;
}

static pen_status_t stepped;
static small_y_t y;

__attribute__((noinline)) void step(void)
{
    static const small_u_t u = { (pen_real_t)0.5 };

    stepped = small_step(&model, &u, &y);
}

/* A step is one whole set's, as its status says. */
static void judge(bool must, bool may)
{
    const bool adopts = (stepped & PEN_ADOPTED) != 0U;
    const bool leaves = (stepped & PEN_WITHDRAWN) != 0U;
    const bool held = (stepped & PEN_HELD) != 0U;

    expect(!must || adopts || leaves, "lost");
    expect(may || !adopts, "adopted twice or never published");
    expect(!leaves || ((kind == WITHDRAW) && (waiting != SETS) && !adopts), "withdrawn, and nobody asked");
    expect((stepped & ~(PEN_ADOPTED | PEN_HELD | PEN_WITHDRAWN)) == PEN_OK, "flags");
    expect(!held || (kind == HOLD), "held");
    if (adopts) {
        in_force = (waiting != SETS) ? waiting : target;
        target = (waiting != SETS) ? target : SETS;
        waiting = SETS;
        adopted++;
    } else if (leaves) {
        waiting = SETS;
        withdrawn++;
    } else {
        /* nothing has come */
    }
    expect((in_force < SETS) && same(y.v, held ? last : expected[in_force]), "torn");
    last = y.v;
}

/* ---- the interrupt ---- */

static void pre_empt(void)
{
    if (step_interrupts) {
        const bool due = (waiting != SETS);
        from_start();
        step();
        judge(due, due || (target != SETS));
    } else {
        tune();
    }
}

/* ---- one run ---- */

static void prepare(bool pending)
{
    in_force = SOFT;
    waiting = SETS;
    target = SETS;
    adopted = 0U;
    withdrawn = 0U;
    reported = 0U;
    (void)small_init(&model, set[SOFT], &banks);
    step();
    last = y.v;
    if (kind == ROLLBACK) {
        (void)small_tune_select(&model, set[KINKED]);
        from_start();
        step();
        in_force = KINKED;
        last = y.v;
        adopted = 1U;
    }
    if ((kind == WRITE) || (kind == COMMIT) || (kind == ABORT)) {
        (void)open_set();
    }
    if (kind == COMMIT) {
        (void)fill_set(0U, N);
    }
    if (pending) {
        (void)small_tune_select(&model, set[STIFF]);
        waiting = STIFF;
    }
    target = (kind == SELECT) ? STIFF : target;
    target = ((kind == EXCHANGE) || ((kind == COMMIT) && !pending)) ? KINKED : target;
    target = (kind == ROLLBACK) ? (pending ? KINKED : SOFT) : target;
    from_start();
}

/* What the call may say: with a set waiting it is refused, unless a step has just taken that set. */
static void judge_call(bool pending, bool taken)
{
    const bool needs_open = (kind == WRITE) || (kind == COMMIT) || (kind == ABORT);
    const bool needs_quiet = (kind == BEGIN) || (kind == SELECT) || (kind == ROLLBACK) || (kind == EXCHANGE);

    if (pending && needs_open) {
        expect(result == PEN_SET_CLOSED, "not closed");
    } else if (pending && needs_quiet) {
        expect((result == PEN_SET_BUSY) || (taken && (result == PEN_OK)), "neither busy nor good");
    } else if (kind == WITHDRAW) {
        expect((result == (pending ? PEN_OK : PEN_SET_IDLE)) || (taken && (result == PEN_SET_IDLE)), "neither asked nor idle");
    } else {
        expect(result == PEN_OK, "refused");
    }
    target = (result == PEN_OK) ? target : SETS;
}

/* What is left to do after a call, so that all that it began is used. */
static void go_on(void)
{
    if ((result == PEN_OK) && (kind == HOLD)) {
        (void)small_tune_hold(&model, false);
    } else if ((result == PEN_OK) && ((kind == BEGIN) || (kind == WRITE))) {
        expect(fill_set(0U, N) == PEN_OK, "write");
        expect(small_tune_commit(&model) == PEN_OK, "commit");
        target = KINKED;
    } else if ((result != PEN_SET_BUSY) && (kind == ABORT)) {
        expect(small_tune_commit(&model) == PEN_SET_CLOSED, "closed");
    } else {
        /* all is done */
    }
}

static void next_step(void)
{
    const bool due = (waiting != SETS) || (target != SETS);

    from_start();
    step();
    judge(due, due);
}

static void end(bool was_waiting)
{
    pen_status_report_t report;

    if (was_waiting && (waiting != SETS)) {
        next_step(); /* it began before the call did: its set comes first */
    }
    go_on();
    next_step();
    next_step();
    expect((waiting == SETS) && (target == SETS), "lost in the end");
    (void)small_status(&model, &report);
    expect((reported + pen_status_times(&report, PEN_ADOPTED)) == adopted, "counter");
    expect(pen_status_times(&report, PEN_WITHDRAWN) == withdrawn, "counter");
    if (kind == WITHDRAW) { /* the rollback set is the one before what was adopted: none if that was withdrawn */
        expect(small_tune_rollback(&model) == ((adopted > 0U) ? PEN_OK : PEN_SET_NO_PREVIOUS), "rollback set");
    }
    runs++;
}

/* Other names distinguish them from those that nothing interrupts. */
__attribute__((noinline)) void the_call(void)
{
    tune();
}

__attribute__((noinline)) void the_step(void)
{
    step();
}

/* The last run of each is not interrupted any more: the delay was longer than the call. */
static void sweep(bool pending, bool all)
{
    uint32_t delay = all ? TICKS : 0U;
    bool early = false;

    while (!early) {
        prepare(pending);
        if (step_interrupts) {
            early = interrupt(the_call, delay);
            judge_call(pending, fired);
        } else {
            early = interrupt(the_step, delay);
            if (fired) {
                judge_call(pending, true);
            } else {
                result = PEN_SET_BUSY; /* not called */
                target = SETS;
            }
            judge(pending, pending || (target != SETS));
        }
        end(pending);
        delay += TICKS;
    }
}

int main(void)
{
    char text[128];
    const bool all = board_argument(1U, text, sizeof(text)) && (text[0] == '1');
    const int32_t file = board_argument(2U, text, sizeof(text)) ? board_open(text, true) : -1;

    take_vector();
    for (uint32_t s = 0U; s < SETS; s++) {
        (void)small_init(&model, set[s], &banks);
        step();
        from_start();
        step();
        expected[s] = y.v;
        expect((s == 0U) || !same(expected[s], expected[s - 1U]), "sets are alike");
    }
    for (uint32_t way = 0U; way < 2U; way++) {
        step_interrupts = (way == 0U);
        runs = 0U;
        for (kind = BEGIN; kind < KINDS; kind++) {
            sweep(false, all);
            sweep(true, all);
        }
        board_print(step_interrupts ? "calls interrupted " : "steps interrupted ");
        board_print_number(runs);
        board_print("\n");
    }
    board_print("failures ");
    board_print_number(failures);
    board_print("\n");
    keep_met(file);
    return (failures == 0U) ? 0 : 1;
}
