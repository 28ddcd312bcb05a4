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
from penode_sil.targets import FLAGS, generated, model_options

WORK = gate.BUILD / "fuzz"
SET = gate.ROOT / "src" / "pen_set.c"
FAULT_RUNS = 60_000
MODELS = ("small", "small_layers")

# Faults of pen_set.c: see gate.faulty.
FAULTS = {
    "a gap is not refused": ("(offset > tuning->fill) || (offset > length)", 0, "(offset > length)"),
    "a chunk may run past the end": (" || (n > (length - offset))", 0, ""),
    "a short set may be committed": ("tuning->fill != length", 0, "false"),
    "fill is not reset": ("        tuning->fill = 0U;\n        tuning->open = YES;", 0, "        tuning->open = YES;"),
    "abort leaves the set open": ("    tuning->open = NO;\n    return status;", 0, "    return status;"),
    "select leaves the set open": ("    tuning->open = NO;\n    pen_port_barrier();", 0, "    pen_port_barrier();"),
    "the way back is not given up": ("            tuning->previous.value = NULL;\n        }", 0, "        }"),
    "the way back is not kept": ("    tuning->previous = tuning->slot[spare ^ 1U];", 0, ""),
    "the checksum is not compared": ("pen_set_checksum(set->value, length) != set->head.checksum", 0, "false"),
    "NaN is not refused": ("!pen_finite(length, set->value)", 0, "false"),
    "the layout is not compared": ("(head->layout == layout) && ", 0, ""),
    "a set may be begun while one waits": ("!settled(tuning)", 0, "false"),
    "not adopted while holding": ("if (pen_port_load(&tuning->pending) == YES) {", 0, "if ((status == PEN_OK) && (pen_port_load(&tuning->pending) == YES)) {"),
}  # fmt: skip


def program(model: str, pen_set: Path = SET) -> Path:
    """fuzz.c for a model of small/."""
    loaded = penode_gen.load(gate.HERE / "small" / f"{model}.toml")
    source, elf = generated(loaded), WORK / f"{model}-{pen_set.stem}"
    elf.parent.mkdir(parents=True, exist_ok=True)
    sets = ",".join(f"&{model}_set_{name}" for name in loaded.sets)
    sources = [path for path in sorted((gate.ROOT / "src").glob("*.c")) if path != SET]
    gate.make(
        ["clang-19", "-fsanitize=fuzzer,address,undefined", "-fno-sanitize-recover=all", *FLAGS, "-D_GNU_SOURCE", "-O2", "-g", "-Wall", "-Wextra",
         "-fno-strict-aliasing", f"-I{gate.ROOT}/inc", f"-I{gate.ROOT}/port/gnu", f"-I{source}", *model_options(loaded), f"-DMODEL_SETS={sets}",
         f"-D{model.upper()}_FOLDS={int(loaded.pieces > 0)}U", "-o", elf,
         gate.HERE / "fuzz.c", source / f"{model}.c", source / f"{model}_params.c", *sources, pen_set, "-lm"]
    )  # fmt: skip
    return elf


def seeds(corpus: Path) -> None:
    """Long sequences that change alone would take long to find, in the bytes that fuzz.c reads."""
    start, step, drop, back, look, hold, go_on = [0, 0, 0, 0, 0, 1], [13, 100, 0, 140], [7], [9], [11], [12, 1], [12, 0]
    begin, write, commit, select = [1, 1, 0, 2, 0], [3, 0], [5], [8, 9, 2, 0, 3]
    stage = [*begin, *write, *commit]
    sequences = {
        "exchanges": [*stage, *step, *stage, *step, *stage, *step, *look],
        "lost way back": [*stage, *step, *stage, *step, *begin, *back, *step, *look],
        "to and fro": [*stage, *step, *back, *step, *back, *step, *select, *step, *back, *step, *look],
        "dropped": [*stage, *step, *begin, *write, *drop, *commit, *begin, *write, *select, *commit, *step, *look],
        "held": [*hold, *stage, *step, *step, *go_on, *step, *back, *back, *step, *look],
    }
    corpus.mkdir(parents=True, exist_ok=True)
    for name, sequence in sequences.items():
        (corpus / name.replace(" ", "_")).write_bytes(bytes(start + sequence))


def fuzz(elf: Path, runs: int, corpus: Path, limit: float = 100_000) -> tuple[int, int, str]:
    """Exit code, runs and words of libFuzzer; new inputs that reach something go into the corpus."""
    seeds(corpus)
    done = gate.run([elf, f"-runs={runs}", "-seed=1", "-max_len=400", "-print_final_stats=1", f"-artifact_prefix={WORK}/", corpus], limit=limit)
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
    for k, (fault, change) in enumerate(FAULTS.items()):
        copy, corpus = WORK / f"fault{k}.c", WORK / "corpus-faulty"
        copy.write_text(gate.faulty(SET.read_text(), change))
        shutil.rmtree(corpus, ignore_errors=True)
        shutil.copytree(WORK / "corpus-small", corpus)
        missed += [] if fuzz(program("small", copy), FAULT_RUNS, corpus, limit=300)[0] else [f"not found: {fault}"]
    good &= gate.report(f"fuzz: {len(FAULTS) - len(missed)} of {len(FAULTS)} faults found", missed)
    gate.keep(given.key, {"runs": total, "failures": len(problems), "faults": list(FAULTS), "faults found": len(FAULTS) - len(missed)})
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
