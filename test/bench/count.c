/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * TCG plugin of QEMU: counts what chosen functions execute, call by call. Made and read by cycles.py.
 *
 * table=FILE  words of 32 bits: one instruction_t for each instruction of the program, by address; then the entries of
 *             the functions, in rows whose size is 0
 * calls=FILE  written: for each call that is not inside of another one, what it executed, as call_t
 * hits=FILE   written: for each instruction of the table, how often such a call reached it from above and by a jump
 *
 * The interface of version 1 is declared here: Debian has no header for it, and this is all that is needed.
 */

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef uint64_t qemu_plugin_id_t;
struct qemu_plugin_tb;
struct qemu_plugin_insn;
extern void qemu_plugin_register_vcpu_tb_trans_cb(qemu_plugin_id_t id, void (*cb)(qemu_plugin_id_t, struct qemu_plugin_tb *));
extern void qemu_plugin_register_vcpu_insn_exec_cb(struct qemu_plugin_insn *insn, void (*cb)(unsigned int, void *), int flags, void *data);
extern void qemu_plugin_register_atexit_cb(qemu_plugin_id_t id, void (*cb)(qemu_plugin_id_t, void *), void *data);
extern size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb *tb);
extern struct qemu_plugin_insn *qemu_plugin_tb_get_insn(const struct qemu_plugin_tb *tb, size_t index);
extern uint64_t qemu_plugin_insn_vaddr(const struct qemu_plugin_insn *insn);
int qemu_plugin_install(qemu_plugin_id_t id, const void *info, int argc, char **argv);

int qemu_plugin_version = 1;

typedef struct {
    uint32_t address;
    uint32_t size;     /* 0: address is the entry of a function to count */
    uint32_t below[2]; /* cycles, low and high, after the instruction above */
    uint32_t jumped[2]; /* after a jump to it                                */
    uint32_t away[2];  /* more, if it jumps itself                          */
} instruction_t;

typedef struct {
    uint64_t entry;
    uint64_t instructions;
    uint64_t cycles[2];
} call_t;

static instruction_t *table;
static size_t instructions;
static size_t rows;
static uint64_t (*hits)[2];
static FILE *calls;
static FILE *hits_file;
static const instruction_t *last;
static const instruction_t *elsewhere; /* an instruction that no table knows */
static uint64_t back; /* where the call returns to; 0 outside of calls */
static call_t call;

static int by_address(const void *a, const void *b)
{
    const uint32_t left = ((const instruction_t *)a)->address;
    const uint32_t right = ((const instruction_t *)b)->address;

    return (left > right) - (left < right);
}

static const instruction_t *find(uint64_t address)
{
    const instruction_t key = { .address = (uint32_t)address };
    const instruction_t *found = bsearch(&key, table, instructions, sizeof(key), by_address);

    return (found != NULL) ? found : elsewhere;
}

static bool is_entry(const instruction_t *at)
{
    bool found = false;

    for (size_t k = instructions; k < rows; k++) {
        found = found || (table[k].address == at->address);
    }
    return found;
}

static void add(const instruction_t *at)
{
    const bool jump = (last->address + last->size) != at->address;
    const uint32_t *const cost = jump ? at->jumped : at->below;

    if (at == elsewhere) {
        fprintf(stderr, "count: an instruction after 0x%x is not in the table\n", (unsigned int)last->address);
        exit(1);
    }
    for (size_t k = 0; k < 2; k++) {
        call.cycles[k] += cost[k] + ((jump && (call.instructions > 0)) ? last->away[k] : 0);
    }
    call.instructions++;
    hits[at - table][jump]++;
}

static void end_call(void)
{
    call.cycles[0] += last->away[0];
    call.cycles[1] += last->away[1];
    fwrite(&call, sizeof(call), 1, calls);
    back = 0;
}

static void executed(unsigned int cpu, void *data)
{
    const instruction_t *const at = data;

    (void)cpu;
    if ((back != 0) && (at->address == back)) {
        end_call();
    }
    if (back != 0) {
        add(at);
    }
    last = at;
}

static void entered(unsigned int cpu, void *data)
{
    if (back == 0) {
        back = last->address + last->size;
        memset(&call, 0, sizeof(call));
        call.entry = ((const instruction_t *)data)->address;
    }
    executed(cpu, data);
}

static void translated(qemu_plugin_id_t id, struct qemu_plugin_tb *tb)
{
    (void)id;
    for (size_t k = 0; k < qemu_plugin_tb_n_insns(tb); k++) {
        struct qemu_plugin_insn *const insn = qemu_plugin_tb_get_insn(tb, k);
        const instruction_t *const at = find(qemu_plugin_insn_vaddr(insn));
        qemu_plugin_register_vcpu_insn_exec_cb(insn, is_entry(at) ? entered : executed, 0, (void *)at);
    }
}

static void ended(qemu_plugin_id_t id, void *data)
{
    (void)id;
    (void)data;
    fwrite(hits, sizeof(hits[0]), instructions, hits_file);
    fclose(hits_file);
    fclose(calls);
}

static FILE *opened(int argc, char **argv, const char *name, const char *mode)
{
    FILE *file = NULL;

    for (int k = 0; k < argc; k++) {
        const size_t length = strlen(name);
        if ((strncmp(argv[k], name, length) == 0) && (argv[k][length] == '=')) {
            file = fopen(&argv[k][length + 1], mode);
        }
    }
    if (file == NULL) {
        fprintf(stderr, "count: %s= is missing or cannot be opened\n", name);
        exit(1);
    }
    return file;
}

int qemu_plugin_install(qemu_plugin_id_t id, const void *info, int argc, char **argv)
{
    static const instruction_t unknown = { .address = 1, .size = 0 }; /* odd, as no address of an instruction is */
    FILE *const file = opened(argc, argv, "table", "rb");

    (void)info;
    fseek(file, 0, SEEK_END);
    rows = (size_t)ftell(file) / sizeof(instruction_t);
    rewind(file);
    table = calloc(rows, sizeof(instruction_t));
    if (fread(table, sizeof(instruction_t), rows, file) != rows) {
        return 1;
    }
    fclose(file);
    while ((instructions < rows) && (table[instructions].size > 0)) {
        instructions++;
    }
    hits = calloc(instructions, sizeof(hits[0]));
    calls = opened(argc, argv, "calls", "wb");
    hits_file = opened(argc, argv, "hits", "wb");
    elsewhere = &unknown;
    last = elsewhere;
    qemu_plugin_register_vcpu_tb_trans_cb(id, translated);
    qemu_plugin_register_atexit_cb(id, ended, NULL);
    return 0;
}
