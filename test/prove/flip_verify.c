/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * flip_verify EVERY: flips one bit of the memory that NAME_verify guards: the running set, its folded pieces, their checksum, its head
 * and address, the addresses of the banks, all their copies, and which slot is active. Every EVERY-th bit of values and
 * pieces. For several numbers of values a call:
 *
 *   found    at the first call where a head or an address is hit, and then the running set, which is poisoned, is not read;
 *            else within a round from its start, or two rounds from anywhere
 *   on_damage  report: the flag alone; hold: the next step holds; rollback: the next step runs the rollback set, whole and
 *            folded; if there is none or it is damaged the set given to init; if that is damaged, too, it holds
 *   open or pending  the flag alone
 *   guard    a bit of the guard's own place or checksum is no damage; nor is anything without a flip
 *
 * While a set is pending the step may change `active` at any time: it alone is not guarded, until the tuning context has
 * seen what became of that set. prepare() lets it see.
 */

#include <math.h>
#include <sanitizer/asan_interface.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include MODEL_HEADER

#define N        MODEL_SIZE(SET_LENGTH)
#define ROUND    MODEL_SIZE(VERIFY)
#define LIMIT(n) (((2U * ROUND) + (n) - 1U) / (n))

enum { REPORT, HOLD, ROLLBACK };                   /* MODEL_ON_DAMAGE */
enum { BOTH, NO_ROLLBACK, BAD_ROLLBACK, ALL_BAD }; /* what there is to go back to */
enum { IDLE, OPEN, PENDING };

typedef struct {
    MODEL(t) model;
    pen_real_t first[N]; /* the set given to init */
    MODEL(banks_t) banks;
} memory_t;

static const pen_set_t *const sets[] = { MODEL_SETS };
#define SETS (sizeof(sets) / sizeof(sets[0]))
static memory_t memory;
static memory_t kept;
static MODEL(t) twin;
static unsigned long flips;
static unsigned long failures;

static void fail(const char *what, const char *where, size_t bit, uint32_t n)
{
    if (failures < 10U) {
        printf("%s, bit %lu, %u values a call: %s\n", where, (unsigned long)bit, (unsigned int)n, what);
    }
    failures++;
}

static pen_status_t step(void)
{
    const MODEL(u_t) u = { 0 };
    MODEL(y_t) y;

    return MODEL(step)(&memory.model, &u, &y);
}

static pen_status_t stage(const pen_set_t *set)
{
    pen_status_t status = MODEL(tune_begin)(&memory.model, &set->head);

    status |= MODEL(tune_write)(&memory.model, 0U, set->value, N);
    status |= MODEL(tune_commit)(&memory.model);
    return status;
}

static uint32_t slot(void)
{
    return memory.model.head.tuning.active & 1U;
}

/* A set runs from a bank; the rollback set lies in the other one. */
static void prepare(uint32_t back, uint32_t situation)
{
    pen_set_t first = *sets[0];
    pen_status_t status;

    memcpy(memory.first, sets[0]->value, sizeof(memory.first));
    first.value = memory.first;
    status = MODEL(init)(&memory.model, &first, &memory.banks);
    status |= stage(sets[1]);
    status |= step() ^ PEN_ADOPTED;
    status |= stage(sets[2U % SETS]);
    status |= step() ^ PEN_ADOPTED;
    if (back == NO_ROLLBACK) { /* given up for the set that is opened, which is dropped */
        status |= MODEL(tune_begin)(&memory.model, &sets[0]->head);
        status |= MODEL(tune_abort)(&memory.model);
    }
    status |= MODEL(verify)(&memory.model, 0U); /* sees that the set is in force */
    if (situation == OPEN) {
        status |= MODEL(tune_begin)(&memory.model, &sets[0]->head);
        status |= MODEL(tune_write)(&memory.model, 0U, sets[0]->value, N / 2U);
    } else if (situation == PENDING) {
        status |= stage(sets[0]);
    } else {
        /* nothing open */
    }
    if ((status & ~PEN_OUTSIDE) != PEN_OK) {
        fail("cannot prepare", "", 0U, status);
    }
    if ((back == BAD_ROLLBACK) || (back == ALL_BAD)) {
        ((uint8_t *)memory.banks.value[0])[1] ^= 1U;
    }
    if (back == ALL_BAD) {
        ((uint8_t *)memory.first)[1] ^= 1U;
    }
    kept = memory;
}

/* Which call finds it: 1, 2, ...; 0: none of `calls`. */
static uint32_t look(uint32_t n, uint32_t calls)
{
    uint32_t found = 0U;

    for (uint32_t k = 1U; (k <= calls) && (found == 0U); k++) {
        const pen_status_t status = MODEL(verify)(&memory.model, n);
        found = (status == PEN_SET_DAMAGED) ? k : 0U;
        if ((status != PEN_OK) && (status != PEN_SET_DAMAGED)) {
            fail("neither good nor damaged", "verify", k, n);
        }
    }
    return found;
}

/* The next step runs this set, its values and pieces whole. */
static void expect_set(const pen_set_t *set, const char *where, size_t bit, uint32_t n)
{
    const pen_status_t status = step();
    pen_set_head_t head = { 0U, 0U, 0U, 0U };

    (void)MODEL(tune_running)(&memory.model, &head);
    if (((status & PEN_ADOPTED) == PEN_OK) || (head.id != set->head.id) ||
        (memcmp(memory.model.head.tuning.slot[slot()].value, set->value, sizeof(pen_real_t) * N) != 0)) {
        fail("the set to go back to does not run", where, bit, n);
    }
#ifdef MODEL_FOLDED
    (void)MODEL(init)(&twin, set, NULL);
    if (memcmp(memory.model.piece[slot()], twin.piece[0], sizeof(twin.piece[0])) != 0) {
        fail("its pieces are others", where, bit, n);
    }
#endif
}

static void expect_flag_alone(bool pending, const char *where, size_t bit, uint32_t n)
{
    const pen_status_t status = step() & (PEN_HELD | PEN_ADOPTED);

    if (status != (pending ? PEN_ADOPTED : PEN_OK)) {
        fail("more than reported", where, bit, n);
    }
}

static void expect_reaction(uint32_t back, uint32_t situation, const char *where, size_t bit, uint32_t n)
{
    if ((situation != IDLE) || (MODEL_ON_DAMAGE == REPORT)) {
        expect_flag_alone(situation == PENDING, where, bit, n);
    } else if ((MODEL_ON_DAMAGE == HOLD) || (back == ALL_BAD)) {
        if ((step() & (PEN_HELD | PEN_ADOPTED)) != PEN_HELD) {
            fail("does not hold", where, bit, n);
        }
    } else {
        expect_set((back == BOTH) ? sets[1] : sets[0], where, bit, n);
    }
}

static void one_flip(uint8_t *bytes, size_t bit, bool at_once, uint32_t back, uint32_t situation, const char *where)
{
    static const uint32_t some[] = { 1U, 3U, N, ROUND, ROUND + 5U };
    const uint32_t n = some[flips % (sizeof(some) / sizeof(some[0]))];
    const bool fresh = (((flips / 5U) % 2U) == 0U);
    const uint32_t before = fresh ? 0U : (1U + (ROUND / (3U * n)));
    const uint32_t calls = fresh ? ((ROUND + n - 1U) / n) : LIMIT(n);
    pen_real_t *const running = (pen_real_t *)kept.model.head.tuning.slot[kept.model.head.tuning.active & 1U].value;
    uint32_t found;

    memory = kept;
    if (look(n, before) != 0U) {
        fail("found what is not there", where, bit, n);
    }
    bytes[bit / 8U] ^= (uint8_t)(1U << (bit % 8U));
    if (at_once) {
        __asan_poison_memory_region(running, sizeof(pen_real_t) * N);
    }
    found = look(n, at_once ? 1U : calls);
    __asan_unpoison_memory_region(running, sizeof(pen_real_t) * N);
    if (found == 0U) {
        fail("not found", where, bit, n);
    } else {
        if (((situation != IDLE) || (MODEL_ON_DAMAGE != ROLLBACK) || (back == ALL_BAD))) {
            bytes[bit / 8U] ^= (uint8_t)(1U << (bit % 8U)); /* the step goes on with it: only what verify did is to be seen */
        }
        expect_reaction(back, situation, where, bit, n);
    }
    flips++;
}

static void all_bits(void *bytes, size_t size, size_t every, bool at_once, uint32_t back, uint32_t situation, const char *where)
{
    for (size_t bit = 0U; bit < (8U * size); bit += every) {
        one_flip(bytes, bit, at_once, back, situation, where);
    }
}

static void guarded(uint32_t back, uint32_t situation, size_t every)
{
    pen_tuning_t *const tuning = &memory.model.head.tuning;
    uint32_t active;

    prepare(back, situation);
    active = slot();
    all_bits((void *)tuning->slot[active].value, sizeof(pen_real_t) * N, every, false, back, situation, "values");
#ifdef MODEL_FOLDED
    all_bits(memory.model.piece[active], sizeof(memory.model.piece[0]), every, false, back, situation, "pieces");
    all_bits(&memory.model.head.guard.pieces[active], sizeof(uint32_t), 1U, false, back, situation, "checksum of the pieces");
#endif
    all_bits(&tuning->slot[active].head, sizeof(pen_set_head_t), 1U, true, back, situation, "head");
    all_bits(&tuning->slot[active].value, sizeof(pen_real_t *), 1U, true, back, situation, "address");
    all_bits(&tuning->slot_check[active].head, sizeof(pen_set_head_t), 1U, true, back, situation, "copy of the head");
    all_bits(&tuning->slot_check[active].value, sizeof(pen_real_t *), 1U, true, back, situation, "copy of the address");
    all_bits(tuning->bank, sizeof(tuning->bank), 1U, true, back, situation, "banks");
    all_bits(tuning->bank_check, sizeof(tuning->bank_check), 1U, true, back, situation, "copies of the banks");
    if (situation != PENDING) {
        all_bits((void *)&tuning->active, sizeof(tuning->active), 1U, true, back, situation, "active");
    }
}

/* The guard's own: found to be no damage. And nothing without a flip. */
static void no_damage(void)
{
    pen_guard_t *const guard = &memory.model.head.guard;
    uint8_t *const bytes[] = { (uint8_t *)&guard->at, (uint8_t *)&guard->crc, (uint8_t *)&guard->slot };

    prepare(BOTH, IDLE);
    for (size_t bit = 0U; bit < (4U * 32U); bit++) {
        for (uint32_t before = 1U; before < ROUND; before += 1U + (ROUND / 20U)) {
            memory = kept;
            (void)look(1U, before);
            if (bit < 96U) {
                bytes[bit / 32U][(bit % 32U) / 8U] ^= (uint8_t)(1U << (bit % 8U));
            }
            if (look(1U + (uint32_t)(bit % 5U), 2U * ROUND) != 0U) {
                fail("damage that is none", "guard", bit, before);
            }
            flips += (bit < 96U) ? 1U : 0U;
        }
    }
}

int main(int argc, char **argv)
{
    const size_t every = (argc > 1) ? strtoul(argv[1], NULL, 10) : 1U;

    no_damage();
    guarded(BOTH, IDLE, every);
    guarded(NO_ROLLBACK, IDLE, every);
    guarded(BOTH, OPEN, every);
    guarded(BOTH, PENDING, every);
    if (MODEL_ON_DAMAGE == ROLLBACK) {
        guarded(BAD_ROLLBACK, IDLE, every);
        guarded(ALL_BAD, IDLE, every);
    }
    printf("flips %lu\nfailures %lu\n", flips, failures);
    return (failures == 0U) ? 0 : 1;
}
