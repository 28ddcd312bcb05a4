/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * PiL: plays a tape to one instance of any generated model and records what it does, bit for bit, and what it costs.
 * The command line names two files: the tape to read and the record to write. Both are streams of 32-bit words in the
 * byte order of the target (little endian); a real is one word, or two with PEN_REAL_DOUBLE.
 *
 * tape    TAPE_MAGIC, sizeof(pen_real_t), sizes of x, u, y, z in bytes, SET_LENGTH, LAYOUT, number of the first set;
 *         then operations:
 *           0 end
 *           1 step      n, u[n]
 *           2 begin     layout, length, id, checksum
 *           3 write     offset, n, value[n]
 *           4 commit
 *           5 abort
 *           6 select    number of the set
 *           7 rollback
 *           8 hold      0 or 1
 *           9 state     x
 * record  for each sample of a step: sample_t, then the status of the step as one word; for each other operation: the
 *         status of the call as one word; at the end: for normal, adopting and holding steps how many there were, and
 *         the fewest and most instructions of one call; then the most stack that a step took, in bytes (of the first step
 *         of each operation 1: painting the stack is slow).
 */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "board.h"
#include "sample.h"

#define TAPE_MAGIC UINT32_C(0x314c4950) /* "PIL1" */
#define BLOCK      1024U                /* words of a buffer */

#define EXIT_GOOD   0U
#define EXIT_FILE   1U /* tape or record cannot be opened, read or written */
#define EXIT_TAPE   2U /* the tape is for another model or is broken       */
#define EXIT_REFUSE 3U /* the first set was refused                        */

enum { OP_END, OP_STEP, OP_BEGIN, OP_WRITE, OP_COMMIT, OP_ABORT, OP_SELECT, OP_ROLLBACK, OP_HOLD, OP_STATE };
enum { KIND_NORMAL, KIND_ADOPTING, KIND_HOLDING, KINDS };

typedef struct {
    int32_t file;
    uint32_t at;
    uint32_t filled;
    bool good; /* false once anything went wrong */
    uint32_t word[BLOCK];
} stream_t;

typedef struct {
    uint32_t steps;
    uint32_t least;
    uint32_t most;
} cost_t;

static const pen_set_t *const sets[] = { MODEL_SETS };
static stream_t tape;
static stream_t record;
static MODEL(t) model;
static MODEL(banks_t) banks;
static pen_real_t chunk[MODEL_SIZE(SET_LENGTH)];
static cost_t cost[KINDS];
static uint32_t stack_of_step; /* bytes */

/* The next word of the tape; 0 after its end, which is noted. */
static uint32_t get(void)
{
    uint32_t word = 0U;

    if (tape.good && (tape.at == tape.filled)) {
        tape.filled = board_read(tape.file, tape.word, sizeof(tape.word)) / sizeof(uint32_t);
        tape.at = 0U;
        tape.good = (tape.filled > 0U);
    }
    if (tape.good) {
        word = tape.word[tape.at];
        tape.at++;
    }
    return word;
}

static void get_words(void *target, size_t bytes)
{
    uint32_t *const word = (uint32_t *)target;

    for (size_t i = 0U; i < (bytes / sizeof(uint32_t)); i++) {
        word[i] = get();
    }
}

static void flush(void)
{
    const uint32_t bytes = record.at * (uint32_t)sizeof(uint32_t);

    record.good = record.good && (board_write(record.file, record.word, bytes) == bytes);
    record.at = 0U;
}

static void put(uint32_t word)
{
    record.word[record.at] = word;
    record.at++;
    if (record.at == BLOCK) {
        flush();
    }
}

static void put_words(const void *source, size_t bytes)
{
    const uint32_t *const word = (const uint32_t *)source;

    for (size_t i = 0U; i < (bytes / sizeof(uint32_t)); i++) {
        put(word[i]);
    }
}

/* Is the tape for this model? */
static bool header_fits(void)
{
    static const uint32_t expected[] = {
        TAPE_MAGIC,         (uint32_t)sizeof(pen_real_t), (uint32_t)SAMPLE_X, (uint32_t)sizeof(MODEL(u_t)), (uint32_t)sizeof(MODEL(y_t)),
        (uint32_t)SAMPLE_Z, MODEL_SIZE(SET_LENGTH),       MODEL_SIZE(LAYOUT),
    };
    bool fits = true;

    for (size_t i = 0U; i < (sizeof(expected) / sizeof(expected[0])); i++) {
        fits = (get() == expected[i]) && fits;
    }
    return fits;
}

static const pen_set_t *get_set(void)
{
    const uint32_t number = get();

    return (number < (sizeof(sets) / sizeof(sets[0]))) ? sets[number] : NULL;
}

static void note_cost(pen_status_t status, uint32_t instructions)
{
    cost_t *of = &cost[KIND_NORMAL];

    if (!pen_advanced(status)) {
        of = &cost[KIND_HOLDING];
    } else if ((status & PEN_ADOPTED) != PEN_OK) {
        of = &cost[KIND_ADOPTING];
    } else {
        /* normal */
    }
    of->least = ((of->steps == 0U) || (instructions < of->least)) ? instructions : of->least;
    of->most = (instructions > of->most) ? instructions : of->most;
    of->steps++;
}

static void play_steps(void)
{
    static sample_t sample; /* keeps the outputs of the sample before where a step holds */
    const uint32_t n = get();

    for (uint32_t k = 0U; (k < n) && tape.good; k++) {
        MODEL(u_t) u;
        pen_status_t status;
        uint32_t instructions;

        get_words(&u, sizeof(u));
        if (k == 0U) {
            board_stack_paint();
        }
        board_count_start();
        status = MODEL(step)(&model, &u, &sample.y);
        instructions = board_count_stop();
        if (k == 0U) {
            const uint32_t used = board_stack_used();
            stack_of_step = (used > stack_of_step) ? used : stack_of_step;
        }
        note_cost(status, instructions);
        sample_look(&model, &sample);
        put_words(&sample, sizeof(sample));
        put(status);
    }
}

static pen_status_t play_write(void)
{
    const uint32_t offset = get();
    const uint32_t n = get();
    pen_status_t status = PEN_SET_RANGE;

    if (n <= MODEL_SIZE(SET_LENGTH)) {
        get_words(chunk, (size_t)n * sizeof(pen_real_t));
        status = MODEL(tune_write)(&model, offset, chunk, n);
    } else {
        tape.good = false;
    }
    return status;
}

static pen_status_t play_state(void)
{
#ifdef MODEL_STATES
    MODEL(x_t) x;

    get_words(&x, sizeof(x));
    return MODEL(set_state)(&model, &x);
#else
    return PEN_BADARG;
#endif
}

static pen_status_t play_begin(void)
{
    pen_set_head_t head;

    head.layout = get();
    head.length = get();
    head.id = get();
    head.checksum = get();
    return MODEL(tune_begin)(&model, &head);
}

/* One operation; false at the end of the tape. */
static bool play(void)
{
    const uint32_t operation = get();
    bool more = tape.good;
    pen_status_t status = PEN_OK;

    switch (operation) {
    case OP_STEP: play_steps(); break;
    case OP_BEGIN: status = play_begin(); break;
    case OP_WRITE: status = play_write(); break;
    case OP_COMMIT: status = MODEL(tune_commit)(&model); break;
    case OP_ABORT: status = MODEL(tune_abort)(&model); break;
    case OP_SELECT: status = MODEL(tune_select)(&model, get_set()); break;
    case OP_ROLLBACK: status = MODEL(tune_rollback)(&model); break;
    case OP_HOLD: status = MODEL(tune_hold)(&model, get() != 0U); break;
    case OP_STATE: status = play_state(); break;
    case OP_END: more = false; break;
    default: tape.good = false; break;
    }
    if (more && (operation != OP_STEP)) {
        put(status);
    }
    return more && tape.good;
}

static uint32_t run(void)
{
    uint32_t code = EXIT_GOOD;

    if (!header_fits()) {
        code = EXIT_TAPE;
    } else if (MODEL(init)(&model, get_set(), &banks) != PEN_OK) {
        code = EXIT_REFUSE;
    } else {
        while (play()) {
            /* until the end of the tape */
        }
        put_words(cost, sizeof(cost));
        put(stack_of_step);
        flush();
        code = tape.good ? (record.good ? EXIT_GOOD : EXIT_FILE) : EXIT_TAPE;
    }
    return code;
}

int main(void)
{
    uint32_t code = EXIT_FILE;
    char name[128];

    tape.file = board_argument(1U, name, sizeof(name)) ? board_open(name, false) : -1;
    record.file = board_argument(2U, name, sizeof(name)) ? board_open(name, true) : -1;
    tape.good = (tape.file >= 0);
    record.good = (record.file >= 0);
    if (tape.good && record.good) {
        code = run();
        board_close(record.file);
        board_close(tape.file);
    }
    return (int)code;
}
