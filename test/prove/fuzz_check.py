# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: any calls of a model's C interface, in any order, say and do what an oracle says: fuzz.c under libFuzzer."""

from __future__ import annotations

import argparse
import re
import shutil
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import gate

import penode_gen
from penode_sil.building import FLAGS, generated, model_options

WORK = gate.BUILD / "fuzz"
FAULT_RUNS = 60_000
MODELS = ("small", "small_layers")

# File, and fault: see gate.faulty.
FAULTS = {
    "a gap is not refused": ("pen_set.c", ("(offset > tuning->fill) || (offset > size)", 0, "(offset > size)")),
    "a chunk may run past the end": ("pen_set.c", (" || (n > (size - offset))", 0, "")),
    "a short set may be committed": ("pen_set.c", ("tuning->fill != (SIZE * length)", 0, "false")),
    "fill is not reset": ("pen_set.c", ("        tuning->fill = 0U;\n        tuning->open = YES;", 0, "        tuning->open = YES;")),
    "abort leaves the set open": ("pen_set.c", ("    tuning->open = NO;\n    return status;", 0, "    return status;")),
    "select leaves the set open": ("pen_set.c", ("    tuning->open = NO;\n    tuning->published", 0, "    tuning->published")),
    "the rollback set is not given up": ("pen_set.c", ("            tuning->previous.value = NULL;\n        }", 0, "        }")),
    "the rollback set is not kept": ("pen_set.c", ("    pen_set_copy(&tuning->previous, &tuning->slot[slot ^ 1U]);", 0, "")),
    "the checksum is not compared": ("pen_set.c", ("pen_set_checksum(set->value, length) != set->head.checksum", 0, "false")),
    "NaN is not refused": ("pen_set.c", ("!pen_finite(length, set->value)", 0, "false")),
    "the layout is not compared": ("pen_set.c", ("(head->layout == layout) && ", 0, "")),
    "a set may be begun while one waits": ("pen_set.c", ("!pen_tuning_settle(tuning)", 0, "false")),
    "not adopted while holding": ("pen_set.c", ("if (pending != 0U) {", 0, "if ((status == PEN_OK) && (pending != 0U)) {")),
    "a withdrawn set is adopted": (
        "pen_set.c",
        (
            "if (pending == command(ADOPT, other)) {",
            0,
            "if ((pending == command(ADOPT, other)) || (pending == command(WITHDRAW, other))) {",
        ),
    ),
    "a withdrawal is not reported": ("pen_set.c", ("status |= PEN_WITHDRAWN;", 0, "status |= PEN_OK;")),
    "a withdrawal leaves another rollback set": (
        "pen_set.c",
        ("pen_set_copy(&tuning->previous, &tuning->replaced); /* it was", 0, "/* it was"),
    ),
    "a copy without its checksum": ("pen_set.c", ("{ layout, length, id, running->head.checksum }", 0, "{ layout, length, id, 0U }")),
    "the checksum to expect is forgotten": ("pen_set.c", (".head.checksum = checksum;", 0, ".head.checksum ^= 0U * checksum;")),
    "bytes at another place": (
        "pen_set.c",
        ("pen_serial_get_bytes(bank, offset, n, byte);", 0, "pen_serial_get_bytes(bank, offset & ~3U, n, byte);"),
    ),
    "damaged bytes are restored": ("pen_saved.c", ("status = PEN_SET_CHECKSUM;", 0, "status = PEN_OK;")),
    "banks are not compared": ("pen_saved.c", ("(pen_serial_get(&byte[12]) != banks) ||", 0, "")),
    "the set given to init is not compared": (
        "pen_saved.c",
        (
            (
                "(pen_serial_get(&byte[INITIAL_AT]) != tuning->initial.head.checksum) ||\n"
                "               (pen_serial_get(&byte[INITIAL_AT + 4U]) != initial) ||"
            ),
            0,
            "",
        ),
    ),
    "inputs are not restored": (
        "pen_saved.c",
        ("        get_values(inputs, u, byte, &at);", 0, "        at += (size_t)inputs * sizeof(pen_real_t);"),
    ),
    "fill is not restored": ("pen_saved.c", ("tuning->fill = get(byte, at);", 0, "(void)get(byte, at);")),
    "what a withdrawal brings back is not restored": (
        "pen_saved.c",
        ("    get_set(model, tuning, &tuning->replaced, byte, at);", 0, "    *at += 20U;"),
    ),
    "counters are not restored": ("pen_saved.c", ("self->log.count[i] = get(byte, at);", 0, "(void)get(byte, at);")),
    "pieces are not made anew": ("model", ("(void)small_prepare(self, self->head.tuning.slot[i].value, i);", 0, "")),
    "the input before is not set": ("model", ("pen_step_copy(SMALL_N_DRIVE, finite ? input : self->u[0], self->u[0]);", 0, "")),
    "a missing argument is not counted": ("model", ("pen_status_note_step(&self->head.log, status);", 0, "")),
}


def program(model: str, fault: tuple[str, tuple[str, int, str]] | None = None, k: str = "") -> Path:
    """fuzz.c for a model of small/, with a fault in its C or in the runtime."""
    loaded = penode_gen.load(gate.HERE / "small" / f"{model}.toml")
    source, src, elf = generated(loaded), gate.ROOT / "src", WORK / f"{model}{k}"
    elf.parent.mkdir(parents=True, exist_ok=True)
    if fault:
        file, change = fault
        root = WORK / f"fault{k}"
        shutil.rmtree(root, ignore_errors=True)
        source, src = shutil.copytree(source, root / "model"), shutil.copytree(src, root / "src")
        path = source / f"{model}.c" if file == "model" else src / file
        path.write_text(gate.faulty(path.read_text(), change))
    sets = ",".join(f"&{model}_set_{name}" for name in loaded.sets)
    gate.make(
        [
            "clang-19",
            "-fsanitize=fuzzer,address,undefined",
            "-fno-sanitize-recover=all",
            *FLAGS,
            "-D_GNU_SOURCE",
            "-O2",
            "-g",
            "-Wall",
            "-Wextra",
            "-fno-strict-aliasing",
            f"-I{gate.ROOT}/inc",
            f"-I{gate.ROOT}/port/gnu",
            f"-I{source}",
            *model_options(loaded),
            f"-DMODEL_SETS={sets}",
            f"-D{model.upper()}_FOLDS={int(loaded.pieces > 0)}U",
            "-o",
            elf,
            gate.HERE / "fuzz.c",
            source / f"{model}.c",
            source / f"{loaded.owner}_params.c",
            *sorted(src.glob("*.c")),
            "-lm",
        ]
    )
    return elf


def seeds(corpus: Path) -> None:
    """Long sequences that change alone would take long to find, in the bytes that fuzz.c reads."""
    start, step, drop, back, look, hold, go_on = [0, 0, 0, 0, 0, 1], [21, 100, 0, 140], [7], [9], [11], [12, 1], [12, 0]
    begin, write, commit, select, known = [1, 1, 0, 2, 0], [3, 0], [5], [8, 9, 2, 0, 3], [8, 200, 0, 0, 1]
    withdraw, copy, write_bytes, some_bytes, checksum = [13], [14, 7], [15, 0], [15, 64, 5], [16, 0]
    verify, put_in, move, leave_out = [17, 200, 9, 9, 9, 9], [18, 0, 150], [19, 1, 3, 0, 0, 0], [20, 0]
    stage = [*begin, *write, *commit]
    sequences = {
        "exchanges": [*stage, *step, *stage, *step, *stage, *step, *look],
        "lost way back": [*stage, *step, *stage, *step, *begin, *back, *step, *look],
        "to and fro": [*stage, *step, *back, *step, *back, *step, *select, *step, *back, *step, *look],
        "dropped": [*stage, *step, *begin, *write, *drop, *commit, *begin, *write, *select, *commit, *step, *look],
        "withdrawn": [*stage, *step, *stage, *withdraw, *step, *back, *withdraw, *step, *back, *step, *look],
        "too late": [*stage, *step, *withdraw, *stage, *step, *withdraw, *back, *step, *look],
        "copied": [*stage, *step, *copy, *commit, *step, *copy, 15, 200, 3, 1, *checksum, *commit, *step, *look],
        "in bytes": [*begin, *some_bytes, *some_bytes, *write_bytes, *commit, *step, *begin, *some_bytes, *write, *commit, *step, *look],
        "moved": [*stage, *step, *move, *step, *begin, *some_bytes, *move, *write_bytes, *commit, *move, *step, *back, *move, *step, *look],
        "moved and withdrawn": [*known, *step, *stage, *step, *stage, *move, *withdraw, *move, *step, *back, *step, *look],
        "verified": [*stage, *verify, *step, *verify, *begin, *verify, *write, *commit, *verify, *step, *verify, *look],
        "put in": [*put_in, *step, *put_in, *move, *step, *leave_out, *step, *look],
        "held": [*hold, *stage, *step, *step, *go_on, *step, *back, *back, *step, *look],
    }
    corpus.mkdir(parents=True, exist_ok=True)
    for name, sequence in sequences.items():
        (corpus / name.replace(" ", "_")).write_bytes(bytes(start + sequence))


def fuzz(elf: Path, runs: int, corpus: Path, limit: float = 100_000) -> tuple[int, int, str]:
    """Exit code, runs and words of libFuzzer; new inputs that reach something go into the corpus."""
    seeds(corpus)
    done = gate.run(
        [elf, f"-runs={runs}", "-seed=1", "-max_len=400", "-print_final_stats=1", f"-artifact_prefix={WORK}/", corpus], limit=limit
    )
    said = done.stdout + done.stderr
    number = re.search(r"number_of_executed_units: (\d+)", said)
    return done.returncode, int(number[1]) if number else 0, said


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--runs", type=int, default=400_000, help="of each model")
    options.add_argument("--as", dest="key", default="fuzz", help="key in figures.json")
    given = options.parse_args()
    problems, total = [], 0
    for model in MODELS:
        shutil.rmtree(WORK / f"corpus-{model}", ignore_errors=True)
    with ThreadPoolExecutor() as pool:
        results = list(pool.map(lambda model: fuzz(program(model), given.runs, WORK / f"corpus-{model}"), MODELS))
    for model, (code, runs, said) in zip(MODELS, results, strict=True):
        total += runs
        problems += [f"{model}:\n{said[-3000:]}"] if code else []
    good = gate.report(f"fuzz: {total} sequences of calls: each as the oracle says", problems)
    missed = []
    for k, (what, fault) in enumerate(FAULTS.items()):
        corpus = WORK / "corpus-faulty"
        shutil.rmtree(corpus, ignore_errors=True)
        shutil.copytree(WORK / "corpus-small", corpus)
        missed += [] if fuzz(program("small", fault, str(k)), FAULT_RUNS, corpus, limit=300)[0] else [f"not found: {what}"]
    good &= gate.report(f"fuzz: {len(FAULTS) - len(missed)} of {len(FAULTS)} faults found", missed)
    gate.keep(given.key, {"runs": total, "failures": len(problems), "faults": list(FAULTS), "faults found": len(FAULTS) - len(missed)})
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
