/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * For libFuzzer: its bytes are calls of the whole interface of a model in any order with any arguments. The expected
 * return value and effect of each come from an oracle, a second implementation from the headers: where sets lie, which runs,
 * which waits, whether it is withdrawn, which is the rollback set. A twin without banks that is only given whole sets steps
 * along; state and outputs of the two must be the same to the bit. Now and then the instance is saved as bytes and goes on
 * as another one that was restored from them, the first one's memory spoilt. AddressSanitizer sees to the memory.
 */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include MODEL_HEADER

#define N       MODEL_SIZE(SET_LENGTH)
#define N_X     MODEL_SIZE(N_X)
#define FLASH   2U
#define NOWHERE 3U
#define KNOWN   4U /* a set of the model file */
#define POOL    8U

/* ---- the oracle ---- */

typedef struct {
    uint32_t id;
    uint32_t place; /* bank 0 or 1, FLASH, NOWHERE or KNOWN */
    pen_set_t set;  /* its values in `keep` */
    pen_real_t keep[N];
} known_t;

static known_t running, previous, waiting, opened;
static known_t replaced; /* the rollback set again, if what waits is withdrawn */
static bool waits, withdrawn, open_now, holding, usable;
static uint32_t fill;           /* bytes */
static uint32_t times[PEN_STATUS_FLAGS];

/* ---- what is tested ---- */

static const pen_set_t *const sets[] = { MODEL_SETS };
#define SETS (sizeof(sets) / sizeof(sets[0]))

static MODEL(t) instance[2], twin;
static MODEL(t) *model = &instance[0];
static MODEL(banks_t) *both_banks[2]; /* on the heap, so that each write beyond is seen */
static uint32_t own;                  /* which instance, and which banks */
static bool with_banks;
static pen_set_t initial; /* given to init */
static pen_real_t pool[POOL][N]; /* sets in flash: they must stay as they are while they may be used */
static uint32_t next_in_pool;
static pen_real_t twin_values[2][N]; /* what the twin runs, in turn */
static uint32_t twin_turn;

/* ---- the fuzzer's bytes ---- */

static const uint8_t *at;
static size_t left;

static uint32_t byte(void)
{
    const uint32_t value = (left > 0U) ? *at : 0U;

    at = (left > 0U) ? &at[1] : at;
    left -= (left > 0U) ? 1U : 0U;
    return value;
}

static uint32_t word(void)
{
    uint32_t value = byte();

    value |= byte() << 8U;
    value |= byte() << 16U;
    return value | (byte() << 24U);
}

static pen_real_t number(void)
{
    const uint32_t kind = byte();
    pen_real_t value = (pen_real_t)((int32_t)byte() - 128) / (pen_real_t)64;

    if (kind >= 240U) {
        const uint32_t bits = word();
        memcpy(&value, &bits, sizeof(value));
    }
    return value;
}

static void expect(bool good, const char *what, uint32_t said, uint32_t right)
{
    if (!good) {
        fprintf(stderr, "oracle: %s: 0x%x, should be 0x%x\n", what, (unsigned int)said, (unsigned int)right);
        abort();
    }
}

static void tuned(const char *call, pen_status_t said, pen_status_t right)
{
    expect(said == right, call, said, right);
    for (uint32_t i = PEN_STATUS_STEP; usable && (i < PEN_STATUS_FLAGS); i++) {
        times[i] += (right >> i) & 1U;
    }
}

/* ---- sets ---- */

static bool all_finite(const pen_real_t values[])
{
    bool good = true;

    for (size_t i = 0U; i < N; i++) {
        good = good && isfinite(values[i]);
    }
    return good;
}

/* CRC-32, bit by bit, as IEEE 802.3 has it. */
static uint32_t checksum(const pen_real_t values[])
{
    uint8_t bytes[sizeof(pen_real_t) * N];
    uint32_t crc = 0xFFFFFFFFU;

    memcpy(bytes, values, sizeof(bytes));
    for (size_t i = 0U; i < sizeof(bytes); i++) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; bit++) {
            crc = (crc >> 1U) ^ (((crc & 1U) != 0U) ? 0xEDB88320U : 0U);
        }
    }
    return ~crc;
}

/* Some values: those of a set, with none, one or all changed; and a head, mostly a right one. */
static pen_set_head_t make_set(pen_real_t values[])
{
    const pen_set_t *const from = sets[byte() % SETS];
    const uint32_t kind = byte();
    pen_set_head_t head = { MODEL_SIZE(LAYOUT), N, byte(), 0U };

    memcpy(values, from->value, sizeof(pen_real_t) * N);
    for (uint32_t k = kind % 4U; k > 0U; k--) {
        values[byte() % N] = number();
    }
    head.checksum = checksum(values);
    if (kind >= 250U) {
        head.checksum ^= UINT32_C(1) << (byte() % 32U);
    } else if (kind >= 246U) {
        head.layout ^= UINT32_C(1) << (byte() % 32U);
    } else if (kind >= 242U) {
        head.length = word();
    } else {
        /* a good head */
    }
    return head;
}

static pen_status_t check(const pen_set_head_t *head, const pen_real_t values[])
{
    pen_status_t status = PEN_OK;

    if ((head->layout != MODEL_SIZE(LAYOUT)) || (head->length != N)) {
        status = PEN_SET_LAYOUT;
    } else if (head->checksum != checksum(values)) {
        status = PEN_SET_CHECKSUM;
    } else if (!all_finite(values)) {
        status = PEN_SET_NONFINITE;
    } else {
        /* good */
    }
    return status;
}

/* A set that is good may still have too many pieces. It must say so at each try, and then nothing has changed. */
static bool published(known_t *ready, pen_status_t said)
{
    if (said == PEN_OK) {
        waiting = *ready;
        waits = true;
        withdrawn = false;
        replaced = previous;
        previous = running;
        open_now = false;
    }
    return said == PEN_OK;
}

/* The argument is missing: not counted where there is no instance. */
static void missing(const char *call, pen_status_t said)
{
    expect(said == PEN_BADARG, call, said, PEN_BADARG);
    times[7] += usable ? 1U : 0U;
}

static pen_status_t or_pieces(pen_status_t right, pen_status_t said)
{
    return ((MODEL_SIZE(FOLDS) != 0U) && (right == PEN_OK) && (said == PEN_SET_PIECES)) ? said : right;
}

/* ---- calls ---- */

static void start(void)
{
    const bool bad = (byte() >= 240U);
    pen_set_t set = { { 0U, 0U, 0U, 0U }, pool[next_in_pool] };
    pen_status_t right;
    pen_status_t said;

    with_banks = (byte() < 220U);
    set.head = make_set(pool[next_in_pool]);
    if (!bad) {
        set.head.layout = MODEL_SIZE(LAYOUT);
        set.head.length = N;
    }
    right = check(&set.head, set.value);
    said = MODEL(init)(model, &set, with_banks ? both_banks[own] : NULL);
    right = or_pieces(right, said);
    expect(said == right, "init", said, right);
    usable = (said == PEN_OK);
    if (usable) {
        running.id = set.head.id;
        running.place = FLASH;
        memcpy(running.keep, set.value, sizeof(running.keep));
        running.set = set;
        initial = set;
        previous.place = NOWHERE;
        replaced.place = NOWHERE;
        next_in_pool = (next_in_pool + 1U) % POOL;
        waits = false;
        open_now = false;
        holding = false;
        memset(times, 0, sizeof(times));
        memcpy(twin_values[0], running.keep, sizeof(running.keep));
        set.value = twin_values[0];
        twin_turn = 0U;
        expect(MODEL(init)(&twin, &set, NULL) == PEN_OK, "twin", 0U, 0U);
    }
}

/* A set was opened, in the bank that holds neither the running nor, if it can be kept, the rollback set. */
static void note_opened(const pen_set_head_t *head, const pen_real_t values[])
{
    const bool no_room = (running.place < FLASH) && (previous.place < FLASH) && (running.place != previous.place);
    const uint32_t taken = (running.place < FLASH) ? running.place : previous.place;

    opened.place = no_room ? previous.place : ((taken < FLASH) ? (1U - taken) : 0U);
    previous.place = no_room ? NOWHERE : previous.place;
    opened.id = head->id;
    opened.set.head = *head;
    opened.set.value = both_banks[own]->value[opened.place];
    memcpy(opened.keep, values, sizeof(opened.keep)); /* what is to be sent; checked later as what has been */
    open_now = true;
    fill = 0U;
}

static void begin(void)
{
    pen_real_t values[N];
    const pen_set_head_t head = make_set(values);
    const bool none = (byte() >= 250U);
    pen_status_t right = PEN_OK;
    pen_status_t said;

    if (!usable || none || !with_banks) {
        right = PEN_SET_BADARG;
    } else if (waits) {
        right = PEN_SET_BUSY;
    } else if ((head.layout != MODEL_SIZE(LAYOUT)) || (head.length != N)) {
        right = PEN_SET_LAYOUT;
    } else {
        /* good */
    }
    said = MODEL(tune_begin)(model, none ? NULL : &head);
    tuned("begin", said, right);
    if (right == PEN_OK) {
        note_opened(&head, values);
    }
}

static void begin_copy(void)
{
    pen_set_head_t head = { MODEL_SIZE(LAYOUT), N, byte(), running.set.head.checksum };
    pen_status_t right = PEN_OK;
    pen_status_t said;

    if (!usable) {
        right = PEN_SET_BADARG;
    } else if (waits) {
        right = PEN_SET_BUSY;
    } else if (!with_banks) {
        right = PEN_SET_BADARG;
    } else {
        /* good */
    }
    said = MODEL(tune_begin_copy)(model, head.id);
    tuned("begin_copy", said, right);
    if (right == PEN_OK) {
        note_opened(&head, running.keep);
        fill = (uint32_t)sizeof(opened.keep);
    }
}

static void expect_checksum(void)
{
    const uint32_t value = (byte() < 240U) ? checksum(opened.keep) : word();

    tuned("expect", MODEL(tune_expect)(model, value), !usable ? PEN_SET_BADARG : open_now ? PEN_OK : PEN_SET_CLOSED);
    opened.set.head.checksum = (usable && open_now) ? value : opened.set.head.checksum;
}

/* The same as write, in bytes, at any of them. */
static void write_bytes(void)
{
    const uint32_t kind = byte();
    const uint32_t size = (uint32_t)sizeof(opened.keep);
    uint32_t offset = (kind < 128U) ? fill : (byte() % (size + 2U));
    uint32_t n = (kind < 64U) ? (size - fill) : (byte() % (size + 2U));
    uint8_t bytes[sizeof(opened.keep) + 2U];
    pen_status_t right = PEN_OK;
    pen_status_t said;

    offset = (kind >= 250U) ? word() : offset;
    n = ((kind >= 246U) && (kind < 252U)) ? word() : n;
    for (uint32_t i = 0U; i < sizeof(bytes); i++) {
        const bool inside = (offset < size) && (i < (size - offset));
        bytes[i] = (kind < 230U) ? (inside ? ((uint8_t *)opened.keep)[offset + i] : 0U) : (uint8_t)byte();
    }
    if (!usable) {
        right = PEN_SET_BADARG;
    } else if (!open_now) {
        right = PEN_SET_CLOSED;
    } else if (kind == 245U) {
        right = PEN_SET_BADARG;
    } else if ((offset > fill) || (((uint64_t)offset + n) > size)) {
        right = PEN_SET_RANGE;
    } else {
        memcpy(&((uint8_t *)opened.keep)[offset], bytes, n);
        fill = ((offset + n) > fill) ? (offset + n) : fill;
    }
    said = MODEL(tune_write_bytes)(model, offset, (kind == 245U) ? NULL : bytes, n);
    tuned("write_bytes", said, right);
}

static void write_values(void)
{
    const uint32_t kind = byte();
    const uint32_t whole = fill / (uint32_t)sizeof(pen_real_t); /* values */
    uint32_t offset = (kind < 128U) ? whole : (byte() % (N + 2U));
    uint32_t n = (kind < 64U) ? (N - whole) : (byte() % (N + 2U));
    pen_real_t values[N + 2U];
    pen_status_t right = PEN_OK;
    pen_status_t said;

    if (kind >= 250U) {
        offset = word();
    }
    if ((kind >= 246U) && (kind < 252U)) {
        n = word();
    }
    for (uint32_t i = 0U; i < (N + 2U); i++) {
        values[i] = (kind < 230U) ? (((offset + i) < N) ? opened.keep[offset + i] : 0) : number();
    }
    if (!usable) {
        right = PEN_SET_BADARG;
    } else if (!open_now) {
        right = PEN_SET_CLOSED;
    } else if (kind == 245U) {
        right = PEN_SET_BADARG;
    } else if ((((uint64_t)offset * sizeof(pen_real_t)) > fill) || (((uint64_t)offset + n) > N)) {
        right = PEN_SET_RANGE;
    } else {
        const uint32_t end = (offset + n) * (uint32_t)sizeof(pen_real_t);
        memcpy(&opened.keep[offset], values, n * sizeof(pen_real_t));
        fill = (end > fill) ? end : fill;
    }
    said = MODEL(tune_write)(model, offset, (kind == 245U) ? NULL : values, n);
    tuned("write", said, right);
}

static void commit(void)
{
    pen_status_t right;
    pen_status_t said;

    if (!usable) {
        right = PEN_SET_BADARG;
    } else if (!open_now) {
        right = PEN_SET_CLOSED;
    } else if (fill != sizeof(opened.keep)) {
        right = PEN_SET_SHORT;
    } else {
        right = check(&opened.set.head, opened.keep);
    }
    said = MODEL(tune_commit)(model);
    right = or_pieces(right, said);
    tuned("commit", said, right);
    (void)published(&opened, said);
}

static void drop(void)
{
    tuned("abort", MODEL(tune_abort)(model), usable ? (open_now ? PEN_OK : PEN_SET_CLOSED) : PEN_SET_BADARG);
    open_now = false;
}

static bool in_pool(const pen_real_t *values)
{
    return (running.set.value == values) || (previous.set.value == values) || (initial.value == values) || (replaced.set.value == values) ||
           (waits && (waiting.set.value == values));
}

static void pick(void)
{
    const uint32_t kind = byte();
    known_t ready;
    pen_status_t right;
    pen_status_t said;

    while (in_pool(pool[next_in_pool])) {
        next_in_pool = (next_in_pool + 1U) % POOL;
    }
    ready.set.head = make_set(pool[next_in_pool]);
    ready.set.value = (kind == 1U) ? NULL : pool[next_in_pool];
    ready.place = FLASH;
    memcpy(ready.keep, pool[next_in_pool], sizeof(ready.keep));
    if (kind >= 128U) {
        ready.set = *sets[kind % SETS];
        ready.place = KNOWN;
        memcpy(ready.keep, ready.set.value, sizeof(ready.keep));
    }
    ready.id = ready.set.head.id;
    if (!usable || (kind < 2U)) {
        right = PEN_SET_BADARG;
    } else if (waits) {
        right = PEN_SET_BUSY;
    } else {
        right = check(&ready.set.head, ready.keep);
    }
    said = MODEL(tune_select)(model, (kind == 0U) ? NULL : &ready.set);
    right = or_pieces(right, said);
    tuned("select", said, right);
    (void)published(&ready, said);
}

static void back(void)
{
    known_t ready = previous;
    pen_status_t right = PEN_OK;
    pen_status_t said;

    if (!usable) {
        right = PEN_SET_BADARG;
    } else if (waits) {
        right = PEN_SET_BUSY;
    } else if (previous.place == NOWHERE) {
        right = PEN_SET_NO_PREVIOUS;
    } else {
        /* good */
    }
    said = MODEL(tune_rollback)(model);
    tuned("rollback", said, right);
    (void)published(&ready, said);
}

static void withdraw(void)
{
    tuned("withdraw", MODEL(tune_withdraw)(model), !usable ? PEN_SET_BADARG : waits ? PEN_OK : PEN_SET_IDLE);
    withdrawn = waits;
}

/* Nothing is damaged here. */
static void verify(void)
{
    tuned("verify", MODEL(verify)(model, (byte() < 128U) ? byte() : word()), usable ? PEN_OK : PEN_SET_BADARG);
}

/* Is this set where restore would find it, if there is one? */
static bool findable(const known_t *known)
{
    return (known->place != FLASH) || (known->set.value == initial.value);
}

/* Saved, restored into the other instance, which goes on; the first one and its banks are spoilt. */
static void move(void)
{
    static uint8_t bytes[MODEL_SIZE(SAVED)];
    MODEL(t) *const other = &instance[1U - own];
    const uint32_t kind = byte();
    const bool found = usable && findable(&running) && findable(&previous) && (!waits || (findable(&waiting) && findable(&replaced)));
    pen_status_t said = MODEL(save)(model, (kind == 0U) ? NULL : bytes);

    expect(said == ((found && (kind != 0U)) ? PEN_OK : PEN_SET_BADARG), "save", said, found ? 1U : 0U);
    if (said == PEN_OK) {
        const uint32_t damaged = word() % (8U * (uint32_t)sizeof(bytes));
        pen_set_t wrong = *sets[0];
        expect(MODEL(init)(other, &initial, with_banks ? NULL : both_banks[1U - own]) == PEN_OK, "init", 0U, 0U);
        expect(MODEL(restore)(other, bytes) == PEN_SET_LAYOUT, "restore with other banks", 0U, 0U);
        if (wrong.head.checksum != initial.head.checksum) {
            expect(MODEL(init)(other, &wrong, with_banks ? both_banks[1U - own] : NULL) == PEN_OK, "init", 0U, 0U);
            expect(MODEL(restore)(other, bytes) == PEN_SET_LAYOUT, "restore of another set", 0U, 0U);
        }
        expect(MODEL(init)(other, &initial, with_banks ? both_banks[1U - own] : NULL) == PEN_OK, "init", 0U, 0U);
        expect(MODEL(restore)(other, NULL) == PEN_SET_BADARG, "restore of nothing", 0U, 0U);
        bytes[damaged / 8U] ^= (uint8_t)(1U << (damaged % 8U));
        expect(MODEL(restore)(other, bytes) == PEN_SET_CHECKSUM, "restore of damaged bytes", 0U, damaged);
        bytes[damaged / 8U] ^= (uint8_t)(1U << (damaged % 8U));
        expect(MODEL(restore)(other, bytes) == PEN_OK, "restore", 0U, 0U);
        memset(model, 0xA5, sizeof(*model));
        memset(both_banks[own], 0xA5, sizeof(*both_banks[own]));
        own = 1U - own;
        model = other;
    }
}

static void input(void)
{
    MODEL(u_t) u;
    MODEL(u_t) now;
    bool good = true;
    pen_status_t said;

    for (size_t i = 0U; i < MODEL_SIZE(N_U); i++) {
        ((pen_real_t *)&u)[i] = number();
        good = good && isfinite(((pen_real_t *)&u)[i]);
    }
    said = MODEL(set_input)(model, &u);
    expect(said == (usable ? (good ? PEN_OK : PEN_INPUT_NONFINITE) : PEN_BADARG), "set_input", said, 0U);
    if (usable) {
        (void)MODEL(set_input)(&twin, &u);
        times[0] += good ? 0U : 1U;
        expect(MODEL(get_input)(model, &now) == PEN_OK, "get_input", 0U, 0U);
        expect(!good || (memcmp(&u, &now, sizeof(u)) == 0), "get_input", 0U, 0U);
        (void)MODEL(get_input)(&twin, &u);
        expect(memcmp(&u, &now, sizeof(u)) == 0, "input kept", 0U, 0U);
    }
}

static void leave_out(void)
{
    MODEL(u_t) u = { 0 };
    MODEL(y_t) y;
    MODEL(jacobian_t) jacobian;

    switch (byte() % 8U) {
    case 0U: missing("step", MODEL(step)(model, NULL, &y)); break;
    case 1U: missing("step", MODEL(step)(model, &u, NULL)); break;
    case 2U: missing("step_jacobian", MODEL(step_jacobian)(model, NULL, &y, &jacobian)); break;
    case 3U: missing("step_jacobian", MODEL(step_jacobian)(model, &u, NULL, &jacobian)); break;
    case 4U: missing("step_jacobian", MODEL(step_jacobian)(model, &u, &y, NULL)); break;
    case 5U: missing("set_state", MODEL(set_state)(model, NULL)); break;
    case 6U: missing("set_input", MODEL(set_input)(model, NULL)); break;
    default:
        expect(MODEL(get_state)(model, NULL) == PEN_BADARG, "get_state", 0U, 0U);
        expect(MODEL(get_input)(model, NULL) == PEN_BADARG, "get_input", 0U, 0U);
        expect(MODEL(sensors)(model, NULL) == PEN_BADARG, "sensors", 0U, 0U);
        expect(MODEL(status)(model, NULL) == PEN_BADARG, "status", 0U, 0U);
        expect(MODEL(tune_running)(model, NULL) == PEN_SET_BADARG, "running", 0U, 0U);
        expect(MODEL(tune_pending)(model, NULL) == PEN_SET_BADARG, "pending", 0U, 0U);
        break;
    }
}

static void step(void)
{
    MODEL(u_t) u;
    MODEL(y_t) y;
    MODEL(y_t) y_twin;
    MODEL(x_t) x;
    MODEL(x_t) x_twin;
    MODEL(jacobian_t) jacobian;
    const uint32_t kind = byte();
    pen_status_t said;
    pen_status_t right;

    for (size_t i = 0U; i < MODEL_SIZE(N_U); i++) {
        ((pen_real_t *)&u)[i] = number();
    }
    memset(&y, 0, sizeof(y));
    memset(&y_twin, 0, sizeof(y_twin));
    if (!usable || (kind < 2U)) {
        said = MODEL(step)((kind == 0U) ? NULL : model, (kind == 1U) ? NULL : &u, &y);
        expect(said == PEN_BADARG, "step", said, PEN_BADARG);
        times[7] += (usable && (kind == 1U)) ? 1U : 0U;
    } else {
        pen_status_t answer = PEN_OK;
        if (waits && withdrawn) {
            previous = replaced;
            answer = PEN_WITHDRAWN;
        } else if (waits) {
            pen_set_t set = waiting.set;
            twin_turn = 1U - twin_turn;
            memcpy(twin_values[twin_turn], waiting.keep, sizeof(waiting.keep));
            set.value = twin_values[twin_turn];
            expect(MODEL(tune_select)(&twin, &set) == PEN_OK, "twin", 1U, 1U);
            running = waiting;
            answer = PEN_ADOPTED;
        } else {
            /* nothing waits */
        }
        waits = false;
        said = (kind < 64U) ? MODEL(step_jacobian)(model, &u, &y, &jacobian) : MODEL(step)(model, &u, &y);
        right = MODEL(step)(&twin, &u, &y_twin);
        expect((said & (PEN_ADOPTED | PEN_WITHDRAWN)) == answer, "answer", said, answer);
        expect((said & ~PEN_WITHDRAWN) == right, "step", said, right);
        expect(((said & PEN_HELD) != PEN_OK) == holding, "held", said, holding);
        expect(((said & PEN_INPUT_NONFINITE) != PEN_OK) == !isfinite(((pen_real_t *)&u)[0]), "input", said, 0U);
        expect(((said & PEN_INPUT_RANGE) != PEN_OK) == (fabsf(((pen_real_t *)&u)[0]) > (pen_real_t)1), "range", said, 0U);
        expect(memcmp(&y, &y_twin, sizeof(y)) == 0, "outputs", 0U, 0U);
        (void)MODEL(get_state)(model, &x);
        (void)MODEL(get_state)(&twin, &x_twin);
        expect(memcmp(&x, &x_twin, sizeof(x)) == 0, "state", 0U, 0U);
        for (size_t i = 0U; i < N_X; i++) {
            expect(isfinite(((pen_real_t *)&x)[i]), "finite", 0U, 0U);
        }
        for (uint32_t i = 0U; i < PEN_STATUS_STEP; i++) {
            times[i] += (said >> i) & 1U;
        }
    }
}

static void state(void)
{
    MODEL(x_t) x;
    MODEL(x_t) now;
    bool good = true;
    pen_status_t said;

    for (size_t i = 0U; i < N_X; i++) {
        ((pen_real_t *)&x)[i] = number();
        good = good && isfinite(((pen_real_t *)&x)[i]);
    }
    said = MODEL(set_state)(model, &x);
    expect(said == (usable ? (good ? PEN_OK : PEN_STATE_NONFINITE) : PEN_BADARG), "set_state", said, 0U);
    if (usable) {
        (void)MODEL(set_state)(&twin, &x);
        times[1] += good ? 0U : 1U;
        (void)MODEL(get_state)(model, &now);
        expect(!good || (memcmp(&x, &now, sizeof(x)) == 0), "get_state", 0U, 0U);
    }
}

static void look(void)
{
    pen_set_head_t head = { 0U, 0U, 0U, 0U };
    pen_status_report_t report;
    MODEL(z_t) z;
    MODEL(z_t) z_twin;
    pen_status_t said = MODEL(tune_running)(model, &head);

    bool pending = !waits;

    expect(said == (usable ? PEN_OK : PEN_SET_BADARG), "running", said, 0U);
    said = MODEL(tune_pending)(model, &pending);
    expect(said == (usable ? PEN_OK : PEN_SET_BADARG), "pending", said, 0U);
    expect(!usable || (pending == waits), "pending", pending ? 1U : 0U, waits ? 1U : 0U);
    expect(!usable || ((head.id == running.id) && (head.layout == MODEL_SIZE(LAYOUT))), "id", head.id, running.id);
    said = MODEL(status)(model, &report);
    expect(said == (usable ? PEN_OK : PEN_BADARG), "status", said, 0U);
    for (uint32_t i = 0U; usable && (i < PEN_STATUS_FLAGS); i++) {
        expect(report.times[i] == times[i], "times", report.times[i], times[i]);
        expect(((report.flags >> i) & 1U) == ((times[i] > 0U) ? 1U : 0U), "flags", report.flags, i);
        times[i] = 0U;
    }
    memset(&z, 0, sizeof(z));
    memset(&z_twin, 0, sizeof(z_twin));
    said = MODEL(sensors)(model, &z);
    if (usable && !waits) {
        expect(said == MODEL(sensors)(&twin, &z_twin), "sensors", said, 0U);
        expect(memcmp(&z, &z_twin, sizeof(z)) == 0, "sensor values", 0U, 0U);
    }
}

static void stay(void)
{
    const bool on = (byte() % 2U) == 1U;
    const pen_status_t said = MODEL(tune_hold)(model, on);

    expect(said == (usable ? PEN_OK : PEN_SET_BADARG), "hold", said, 0U);
    if (usable) {
        (void)MODEL(tune_hold)(&twin, on);
        holding = on;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    at = data;
    left = size;
    usable = false;
    open_now = false;
    waits = false;
    own = 0U;
    model = &instance[0];
    both_banks[0] = malloc(sizeof(*both_banks[0]));
    both_banks[1] = malloc(sizeof(*both_banks[1]));
    memset(instance, (int)byte(), sizeof(instance));
    instance[0].head.ready = 0U; /* by chance it might be the fingerprint */
    instance[1].head.ready = 0U;
    running.set.value = NULL;
    previous.set.value = NULL;
    replaced.set.value = NULL;
    initial.value = NULL;
    start();
    while (left > 0U) {
        switch (byte() % 24U) {
        case 0U: start(); break;
        case 1U:
        case 2U: begin(); break;
        case 3U:
        case 4U: write_values(); break;
        case 5U:
        case 6U: commit(); break;
        case 7U: drop(); break;
        case 8U: pick(); break;
        case 9U: back(); break;
        case 10U: state(); break;
        case 11U: look(); break;
        case 12U: stay(); break;
        case 13U: withdraw(); break;
        case 14U: begin_copy(); break;
        case 15U: write_bytes(); break;
        case 16U: expect_checksum(); break;
        case 17U: verify(); break;
        case 18U: input(); break;
        case 19U: move(); break;
        case 20U: leave_out(); break;
        default: step(); break;
        }
    }
    look();
    free(both_banks[0]);
    free(both_banks[1]);
    return 0;
}
