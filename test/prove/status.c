/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * status RUNS SEED: in each run a good step, then one or two bad numbers somewhere, as if its memory were damaged, then
 * two steps. A bad number is a NaN, an Inf, or any bits at all. What must hold:
 *
 *   input          not finite: PEN_INPUT_NONFINITE, and only then; outside of its declared range: PEN_INPUT_RANGE, and only then
 *   range          an input at an edge, next to it on either side, or beyond. Outside: as the model file says, to the bit:
 *                  the step of that input (report), the step of the input at the edge (clamp), or none (hold)
 *   state          not finite: PEN_STATE_NONFINITE, and only then; the second copy is back, if that one is good
 *   weight         not finite: some flag at once, but for two kinds. An infinite bound of a trust envelope: exactly the
 *                  step of a bound at LARGE, which is none. A weight of a folded network, whose step reads its pieces:
 *                  exactly the undamaged step
 *   folded piece   value or slope: some flag, or exactly the step of the undamaged piece (another one was in use). Where
 *                  it starts: not finite, another piece may go on in its place; how often that was not flagged is counted
 *   both           what the step itself did not report, of a set or pieces that it may read: PEN_WEIGHT_NONFINITE within
 *                  SCRUB steps; never without such damage
 *   any of them    no advance: state and outputs to the bit as before; advance: all finite
 *   afterwards     once weights are as they were the next step is good. After a bad input on top of a damaged one, or
 *                  one so large that the step overflows, it is the one after that: a step takes two inputs. After damage to both copies of a state, once it is set; to both of an output: init
 *   calls          a set, a state or an input with NaN or Inf: refused by their flag, nothing changes; without an argument: PEN_BADARG
 *   counters       every flag of every step is counted, and PEN_BADARG, which has an instance to be counted in
 *
 * Exit code 1 and the first failures in words if it does not.
 */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include MODEL_HEADER

#define N      MODEL_SIZE(SET_LENGTH)
#define N_X    MODEL_SIZE(N_X)
#define N_U    MODEL_SIZE(N_U)
#define LARGE  ((pen_real_t)1e30)
#define KEPT   0U
#define LAST   1U
#define N_LAST (sizeof(model.row[0]) / sizeof(pen_real_t))

enum { INPUT, RANGE, STATE, BOTH_STATES, INPUT_BEFORE, WEIGHT, PIECE, STAGED, SET_STATE, SET_INPUT, NO_ARGUMENT, PLACES };
enum { REPORT, CLAMP, HOLD };

static const char *const place_name[PLACES] = { "input", "range",      "state",     "both states", "input before", "weight",
                                                "piece", "staged set", "set_state", "set_input",   "no argument" };
static const pen_real_t range[N_U][2] = { MODEL_RANGES }; /* declared, of each input; -Inf, Inf where none is */
static MODEL(t) model;
static MODEL(t) saved;
static MODEL(banks_t) banks;
static pen_real_t staged[N];
static unsigned long counted[PEN_STATUS_FLAGS]; /* what steps reported */
static unsigned long hits[PLACES];
static unsigned long flagged[PLACES];
static unsigned long misplaced;
static unsigned long scrubbed; /* runs in which the scrub had to find it */
static unsigned long latest;   /* steps it took, at most */
static unsigned long failures;
static unsigned long run;
static uint64_t seed;

static uint32_t draw(void)
{
    seed ^= seed << 13U;
    seed ^= seed >> 7U;
    seed ^= seed << 17U;
    return (uint32_t)(seed >> 16U);
}

static pen_real_t between(pen_real_t low, pen_real_t high)
{
    return low + ((high - low) * (pen_real_t)(draw() >> 8U) / (pen_real_t)0x1000000);
}

static pen_real_t of_bits(uint32_t bits)
{
    float value;

    memcpy(&value, &bits, sizeof(value));
    return value;
}

static pen_real_t bad_number(void)
{
    static const uint32_t bits[] = { 0x7F800000U, 0xFF800000U, 0x7FC00000U, 0xFFC00000U, 0x7F800001U, 0xFFFFFFFFU };
    const uint32_t which = draw() % 8U;

    return (which < 6U) ? of_bits(bits[which]) : (which == 6U) ? of_bits(0x7F800000U | draw()) : of_bits(draw());
}

static void fail(const char *what, uint32_t place, pen_real_t value, pen_status_t status)
{
    if (failures < 10U) {
        printf("run %lu, %s = %g: %s (status 0x%x)\n", run, place_name[place], (double)value, what, (unsigned int)status);
    }
    failures++;
}

static pen_status_t step(const pen_real_t u[N_U], MODEL(y_t) *y)
{
    MODEL(u_t) input;
    pen_status_t status;

    memcpy(&input, u, sizeof(input));
    status = MODEL(step)(&model, &input, y);
    for (uint32_t i = 0U; i < PEN_STATUS_FLAGS; i++) {
        counted[i] += (status >> i) & 1U;
    }
    return status;
}

static pen_real_t *weights(void)
{
    return (pen_real_t *)model.head.tuning.slot[model.head.tuning.active].value;
}

static bool all_finite(const void *values, size_t bytes)
{
    bool finite = true;

    for (size_t i = 0U; i < (bytes / sizeof(pen_real_t)); i++) {
        finite = finite && isfinite(((const pen_real_t *)values)[i]);
    }
    return finite;
}

/* A bound of a trust envelope: the only numbers of a set that a step compares with and does not compute with. */
static bool is_bound(size_t at)
{
    static const size_t bounds[] = { MODEL_BOUNDS };
    bool found = false;

    for (size_t i = 0U; i < (sizeof(bounds) / sizeof(bounds[0])); i++) {
        found = found || (at == bounds[i]);
    }
    return found;
}

/* Steps, the one with this status among them, until the scrub has met what is damaged. */
static void wait_for_scrub(pen_status_t status, uint32_t place, pen_real_t value)
{
    const pen_real_t u[N_U] = { 0 };
    pen_status_t now = status;
    unsigned long steps = 1U;
    MODEL(y_t) y;

    while (((now & PEN_WEIGHT_NONFINITE) == PEN_OK) && (steps < MODEL_SIZE(SCRUB))) {
        now = step(u, &y);
        steps++;
    }
    if ((now & PEN_WEIGHT_NONFINITE) == PEN_OK) {
        fail("not found by the scrub", place, value, now);
    }
    scrubbed++;
    latest = (steps > latest) ? steps : latest;
}

static pen_status_t out_of_range(const pen_real_t u[N_U])
{
    bool out = false;

    for (size_t i = 0U; i < N_U; i++) {
        out = out || (u[i] < range[i][0]) || (u[i] > range[i][1]);
    }
    return out ? PEN_INPUT_RANGE : PEN_OK;
}

/* At an edge of the range of input i, next to it, or beyond. */
static pen_real_t near_edge(size_t i)
{
    const uint32_t which = draw() % 2U;
    const pen_real_t edge = range[i][which];
    const pen_real_t away = (which == 0U) ? -INFINITY : INFINITY;
    const pen_real_t choice[] = { edge, nextafterf(edge, away), nextafterf(edge, -away), (pen_real_t)1.5 * edge };

    return isfinite(edge) ? choice[draw() % 4U] : (pen_real_t)0;
}

/* A set through the front door: good, or with a bad value and the checksum that fits it. */
static pen_status_t stage(const pen_set_t *from, size_t at, pen_real_t value)
{
    pen_set_head_t head = from->head;
    pen_status_t status;

    memcpy(staged, from->value, sizeof(staged));
    staged[at] = value;
    head.checksum = pen_set_checksum(staged, N);
    status = MODEL(tune_begin)(&model, &head);
    status |= MODEL(tune_write)(&model, 0U, staged, N);
    status |= MODEL(tune_commit)(&model);
    return status;
}

static void check_counters(void)
{
    pen_status_report_t report;

    (void)MODEL(status)(&model, &report);
    for (uint32_t i = 0U; i < PEN_STATUS_FLAGS; i++) {
        const bool followed = (i < PEN_STATUS_STEP) || ((PEN_SET_BADARG >> i) == 1U); /* of the tuning half only this one */
        if (followed && (report.times[i] != (uint32_t)counted[i])) {
            fail("a counter is wrong", 0U, (pen_real_t)i, report.times[i]);
        }
    }
}

static void start(void)
{
    static const pen_set_t *const sets[] = { MODEL_SETS };
    const pen_set_t *const set = sets[draw() % (sizeof(sets) / sizeof(sets[0]))];
    const pen_real_t u[N_U] = { 0 };
    MODEL(y_t) y;

    check_counters();
    memset(counted, 0, sizeof(counted));
    if ((MODEL(init)(&model, sets[0], &banks) != PEN_OK) || (stage(set, 0U, set->value[0]) != PEN_OK) ||
        ((step(u, &y) & PEN_ADOPTED) == PEN_OK)) {
        fail("cannot start", 0U, 0, 0);
    }
}

/* One step with a large finite weight, or without the damage, of the same instance as it was before. */
static pen_status_t other_step(pen_real_t *place, pen_real_t value, const pen_real_t u[N_U], MODEL(x_t) *x)
{
    static MODEL(t) other;
    const pen_real_t damaged = *place;
    MODEL(u_t) input;
    MODEL(y_t) y;
    pen_status_t status;

    *place = value;
    other = model;
    model = saved;
    *place = value; /* the place may be in the instance */
    memcpy(&input, u, sizeof(input));
    status = MODEL(step)(&model, &input, &y);
    (void)MODEL(get_state)(&model, x);
    model = other;
    *place = damaged;
    return status;
}

/* The step of the same instance as it was before, with the input that the model file says to take, must be this one. */
static void check_range(const pen_real_t u[N_U], const MODEL(x_t) *x_after, pen_status_t status)
{
    const bool out = (out_of_range(u) != PEN_OK);
    pen_real_t taken[N_U];
    MODEL(x_t) x;
    pen_real_t none = 0;
    pen_status_t other;

    for (size_t i = 0U; i < N_U; i++) {
        taken[i] = (MODEL_OUT_OF_RANGE == CLAMP) ? fminf(fmaxf(u[i], range[i][0]), range[i][1]) : u[i];
    }
    other = other_step(&none, 0, taken, &x);
    if ((MODEL_OUT_OF_RANGE == HOLD) && out) {
        if (((status & PEN_HELD) == PEN_OK) || (memcmp(model.u[0], saved.u[0], sizeof(model.u[0])) != 0)) {
            fail("out of range, and not held", RANGE, u[0], status);
        }
    } else if (((other | PEN_INPUT_RANGE) != (status | PEN_INPUT_RANGE)) || (memcmp(&x, x_after, sizeof(x)) != 0)) {
        fail("not the step that the model file asks for", RANGE, u[0], status);
    } else {
        /* as it says */
    }
}

static void refuse(pen_status_t reported, pen_status_t right, pen_status_t counts)
{
    if (reported != right) {
        fail("an argument is missing", NO_ARGUMENT, 0, reported);
    }
    for (uint32_t i = 0U; i < PEN_STATUS_FLAGS; i++) {
        counted[i] += (counts >> i) & 1U;
    }
}

static void leave_out_an_argument(void)
{
    MODEL(x_t) x;
    MODEL(u_t) u = { 0 };
    MODEL(y_t) y;
    MODEL(jacobian_t) j;

    switch (draw() % 8U) {
    case 0U: refuse(MODEL(step)(&model, NULL, &y), PEN_BADARG, PEN_BADARG); break;
    case 1U: refuse(MODEL(step)(&model, &u, NULL), PEN_BADARG, PEN_BADARG); break;
    case 2U: refuse(MODEL(step_jacobian)(&model, NULL, &y, &j), PEN_BADARG, PEN_BADARG); break;
    case 3U: refuse(MODEL(step_jacobian)(&model, &u, &y, NULL), PEN_BADARG, PEN_BADARG); break;
    case 4U: refuse(MODEL(set_state)(&model, NULL), PEN_BADARG, PEN_BADARG); break;
    case 5U: refuse(MODEL(set_input)(&model, NULL), PEN_BADARG, PEN_BADARG); break;
    case 6U: refuse(MODEL(tune_begin)(&model, NULL), PEN_SET_BADARG, PEN_SET_BADARG); break;
    default: refuse(MODEL(step)(NULL, &u, &y) | MODEL(get_state)(NULL, &x), PEN_BADARG, PEN_OK); break;
    }
}

static void one_run(void)
{
    pen_real_t u[N_U];
    MODEL(x_t) x;
    MODEL(x_t) x_after;
    MODEL(x_t) x_other;
    MODEL(y_t) y;
    MODEL(y_t) y_after;
    const uint32_t place = draw() % PLACES;
    const uint32_t second = ((draw() % 4U) == 0U) ? (uint32_t)INPUT : place;
    const pen_real_t value = bad_number();
    const bool bad = !isfinite(value);
    pen_real_t *weight = NULL;
    size_t index = 0U; /* of the weight */
    pen_real_t right = 0;
    pen_status_t status;
    pen_status_t must = PEN_OK;
    bool huge;
    bool starts = false;
    bool seen; /* by the scrub */

    for (size_t i = 0U; i < N_X; i++) {
        ((pen_real_t *)&x)[i] = between((pen_real_t)-0.02, (pen_real_t)0.02);
    }
    for (size_t i = 0U; i < N_U; i++) {
        u[i] = between((pen_real_t)-0.02, (pen_real_t)0.02);
    }
    status = MODEL(set_state)(&model, &x);
    status |= step(u, &y);
    if ((status & ~(PEN_OUTSIDE | PEN_ADOPTED)) != PEN_OK) {
        fail("a good step is not good", place, 0, status);
    }
    (void)MODEL(get_state)(&model, &x);
    saved = model;
    hits[place]++;
    if (place == INPUT) {
        u[draw() % N_U] = value;
    } else if (place == RANGE) {
        const size_t at = draw() % N_U;
        u[at] = near_edge(at);
    } else if (place == NO_ARGUMENT) {
        leave_out_an_argument();
    } else if (place == STATE) {
        model.row[LAST][draw() % N_LAST] = value;
        must |= bad ? PEN_STATE_NONFINITE : PEN_OK;
    } else if (place == BOTH_STATES) {
        const size_t at = draw() % N_LAST;
        model.row[LAST][at] = value;
        model.row[KEPT][at] = value;
        must |= bad ? PEN_STATE_NONFINITE : PEN_OK;
    } else if (place == INPUT_BEFORE) {
        model.u[0][draw() % N_U] = value;
    } else if (place == WEIGHT) {
        index = draw() % N;
        weight = &weights()[index];
#ifdef MODEL_FOLDED
    } else if (place == PIECE) {
        pen_real_t *const pieces = (pen_real_t *)model.piece[model.head.tuning.active];
        const size_t at = draw() % (sizeof(model.piece[0]) / sizeof(pen_real_t));
        starts = (at % 4U) == 0U;
        weight = ((at % 4U) == 3U) ? NULL : &pieces[at]; /* the fourth word of a piece is its status */
#endif
    } else if (place == STAGED) {
        const pen_status_t refused = stage(&MODEL(set_default), draw() % N, value);
        if (bad != (refused == PEN_SET_NONFINITE)) {
            fail("a set with it is not refused for it", place, value, refused);
        }
        (void)MODEL(tune_abort)(&model);
        if ((refused == PEN_OK) || ((MODEL_SIZE(FOLDS) != 0U) && (refused == PEN_SET_PIECES))) {
            model.head.tuning.pending = 0U; /* any bits may be a good set: not this time */
            model.head.tuning = saved.head.tuning;
        }
    } else if (place == SET_STATE) {
        MODEL(x_t) wrong = x;
        ((pen_real_t *)&wrong)[draw() % N_X] = value;
        status = MODEL(set_state)(&model, &wrong);
        counted[1] += (status == PEN_STATE_NONFINITE) ? 1U : 0U;
        if ((status == PEN_STATE_NONFINITE) != bad) {
            fail("not refused, or for nothing", place, value, status);
        }
        if (!bad) {
            (void)MODEL(set_state)(&model, &x);
        }
    } else if (place == SET_INPUT) {
        pen_real_t wrong[N_U];
        pen_status_t right;
        MODEL(u_t) input;
        memcpy(wrong, model.u[0], sizeof(wrong));
        wrong[draw() % N_U] = value;
        memcpy(&input, wrong, sizeof(input));
        status = MODEL(set_input)(&model, &input);
        right = (all_finite(wrong, sizeof(wrong)) ? PEN_OK : PEN_INPUT_NONFINITE) |
                ((MODEL_OUT_OF_RANGE != REPORT) ? out_of_range(wrong) : PEN_OK);
        for (size_t k = 0U; k < N_U; k++) {
            wrong[k] = (MODEL_OUT_OF_RANGE == CLAMP) ? fminf(fmaxf(wrong[k], range[k][0]), range[k][1]) : wrong[k];
        }
        for (uint32_t i = 0U; i < PEN_STATUS_STEP; i++) {
            counted[i] += (status >> i) & 1U;
        }
        (void)MODEL(get_input)(&model, &input);
        const bool taken = ((right & PEN_INPUT_NONFINITE) == PEN_OK) && ((MODEL_OUT_OF_RANGE != HOLD) || (right == PEN_OK));
        if ((status != right) || (memcmp(&input, taken ? wrong : saved.u[0], sizeof(input)) != 0)) {
            fail("not refused, or for nothing", place, value, status);
        }
        memcpy(&input, saved.u[0], sizeof(input));
        (void)MODEL(set_input)(&model, &input);
    } else {
        /* no pieces */
    }
    if (second != place) {
        u[draw() % N_U] = bad_number();
    }
    if (weight != NULL) {
        right = *weight;
        *weight = value;
    }
    seen = bad && (weight != NULL) && ((place == PIECE) || (MODEL_SIZE(READS_SET) != 0U));
    must |= all_finite(u, sizeof(u)) ? PEN_OK : PEN_INPUT_NONFINITE;
    must |= out_of_range(u);

    huge = (u[0] > LARGE) || (u[0] < -LARGE);
    status = step(u, &y_after);
    (void)MODEL(get_state)(&model, &x_after);
    flagged[place] += (status != PEN_OK) ? 1U : 0U;
    if ((status & (PEN_INPUT_NONFINITE | PEN_STATE_NONFINITE | PEN_INPUT_RANGE)) != must) {
        fail("not reported, or reported for nothing", place, value, status);
    }
    if (pen_advanced(status)) {
        if (!all_finite(&x_after, sizeof(x_after)) || !all_finite(&y_after, sizeof(y_after))) {
            fail("went on to numbers that are not finite", place, value, status);
        }
    } else if (((place != BOTH_STATES) && ((place != STATE) || bad) && (memcmp(&x, &x_after, sizeof(x)) != 0)) ||
               ((place != BOTH_STATES) && ((place != STATE) || bad) && (memcmp(&y, &y_after, sizeof(y)) != 0))) {
        fail("did not keep state and outputs", place, value, status);
    } else {
        /* kept */
    }
    if ((place == RANGE) && ((status & PEN_INPUT_NONFINITE) == PEN_OK)) {
        check_range(u, &x_after, status);
    }
    if (!seen && ((status & PEN_WEIGHT_NONFINITE) != PEN_OK)) {
        fail("the scrub found what is not there", place, value, status);
    }
    if ((weight != NULL) && bad && ((status & ~(PEN_WEIGHT_NONFINITE | PEN_INPUT_RANGE)) == PEN_OK)) {
        const bool folds = (MODEL_SIZE(FOLDS) != 0U); /* its step reads one piece of each network */
        const pen_real_t instead = folds ? right : copysignf(LARGE, value);
        if (!folds && !(is_bound(index) && isinf(value))) {
            fail("not flagged", place, value, status);
        } else {
            const pen_status_t other = other_step(weight, instead, u, &x_other);
            const bool changed = pen_advanced(other) && (memcmp(&x_other, &x_after, sizeof(x_after)) != 0);
            if (changed && starts) {
                misplaced++;
            } else if (changed) {
                fail("not flagged, and it changed the step", place, value, status);
            } else {
                /* it had no effect */
            }
        }
    }

    if (seen && ((status & (PEN_STEP_NONFINITE | PEN_SINGULAR)) == PEN_OK)) {
        wait_for_scrub(status, place, value);
        (void)MODEL(set_state)(&model, &x); /* it may have gone anywhere */
    }
    if (weight != NULL) {
        *weight = right;
    }
    if ((place == BOTH_STATES) || ((place == STATE) && !bad)) {
        (void)MODEL(set_state)(&model, &x);
    }
    if (!all_finite(&model.row[LAST][N_X], sizeof(y))) {
        start();
    }
    for (size_t i = 0U; i < N_U; i++) {
        u[i] = between((pen_real_t)-0.02, (pen_real_t)0.02);
    }
    if (pen_advanced(status)) {
        (void)MODEL(set_state)(&model, &x); /* it may have gone anywhere */
    }
    if (!all_finite(model.row[KEPT], sizeof(model.row[KEPT]))) {
        fail("the second copy stays bad", place, value, status);
    }
    status = step(u, &y_after);
    status = (((place == INPUT_BEFORE) || huge) && !pen_advanced(status)) ? step(u, &y_after) : status;
    if (!pen_advanced(status) || ((status & PEN_WEIGHT_NONFINITE) != PEN_OK)) {
        fail("does not go on", place, value, status);
    }
}

int main(int argc, char **argv)
{
    const unsigned long runs = (argc > 1) ? strtoul(argv[1], NULL, 10) : 1000U;

    seed = ((argc > 2) ? strtoull(argv[2], NULL, 10) : 1U) * 0x9E3779B97F4A7C15U;
    for (run = 0U; run < runs; run++) {
        if ((run % 1000U) == 0U) {
            start();
        }
        one_run();
    }
    check_counters();
    for (uint32_t k = 0U; k < PLACES; k++) {
        printf("%s: %lu, flagged %lu\n", place_name[k], hits[k], flagged[k]);
    }
    printf("misplaced %lu\nscrubbed %lu, after %lu of %u steps at most\nfailures %lu\n", misplaced, scrubbed, latest,
           (unsigned int)MODEL_SIZE(SCRUB), failures);
    return (failures == 0U) ? 0 : 1;
}
