# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: a bit that flips in an instance or in its banks never makes it write beside them or hang; NAME_verify finds what it guards."""

from __future__ import annotations

import argparse
import os
import re
import shutil
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import gate

import penode_gen
from penode_sil.building import FLAGS, generated, model_options

WORK = gate.BUILD / "flip"
MODELS = ("nqvm/nqvm", "nqvm/nqvm_folded", "small/small_rollback")
GUARDED = {
    "small": 1,
    "small_rollback": 1,
    "small_hold": 1,
    "small_layers_rollback": 1,
    "nqvm_folded": 97,
}  # model, and which bits of its values
EVERY = 101  # bits of the banks, and ten times as many of the instance

# File, and fault: see gate.faulty. The first ones are for flip.c, the others for flip_verify.c with a model.
FAULTS = {
    "an address is written to unchecked": ("pen_set.c", ("(tuning->bank[0] == tuning->bank_check[0]) &&", 0, "")),
    "waits instead of reporting that a set waits": (
        "pen_set.c",
        (
            "    const bool done = !pen_tuning_pending(tuning);",
            0,
            "    while (pen_tuning_pending(tuning)) {\n    }\n    const bool done = true;",
        ),
    ),
}
VERIFY_FAULTS = {
    "pieces not covered": ("small_rollback", "pen_instance.c", ("good = (guard->crc == guard->pieces[guard->slot]);", 0, "good = true;")),
    "the status of a piece left out": (
        "small_rollback",
        "pen_instance.c",
        ("return pen_crc_word(next, piece->status);", 0, "return next;"),
    ),
    "values not compared if a call ends with the last": (
        "small_layers_rollback",
        "pen_instance.c",
        ("if (guard->at == length) {", 0, "if ((guard->at == length) && (*n > 0U)) {"),
    ),
    "the last value left out": (
        "small_layers_rollback",
        "pen_instance.c",
        (
            "if (guard->at < length) {",
            0,
            "if (guard->at == (length - 1U)) {\n        guard->at = length;\n        *n -= 1U;\n    } else if (guard->at < length) {",
        ),
    ),
    "which slot the guard is about not compared": ("small_rollback", "pen_instance.c", ("(self->guard.slot != slot) || ", 0, "")),
    "the head not compared": ("small_rollback", "pen_set.c", ("(differences == 0U) && ", 0, "")),
    "the address not compared": ("small_rollback", "pen_set.c", (" && (a->value == b->value)", 0, "")),
    "the addresses of the banks not compared": (
        "small_rollback",
        "pen_instance.c",
        ("return pen_tuning_banks_known(tuning) && fits", 0, "return fits"),
    ),
    "which slot is active not compared": (
        "small_rollback",
        "pen_instance.c",
        ("(tuning->settled == pen_port_load(&tuning->active))", 0, "true"),
    ),
    "a damaged rollback set taken": (
        "small_rollback",
        "pen_set.c",
        ("status = pen_set_check(&tuning->previous, layout, length);", 0, "status = PEN_OK;"),
    ),
    "the set given to init forgotten": ("small_rollback", "model", ("rank < 2U", 0, "rank < 1U")),
    "pieces of the set to go back to not made": (
        "small_rollback",
        "model",
        ("found = small_rollback_prepare(self, ready.value,", 0, "found = small_rollback_prepare(self, self->head.tuning.slot[0].value,"),
    ),
    "reacts while a set is open": ("small_rollback", "pen_instance.c", ("if (tuning->open == 0U) {", 0, "if (true) {")),
    "holds while a set is open": ("small_hold", "pen_instance.c", ("!good && idle &&", 0, "!good &&")),
    "does not hold without a set to go back to": (
        "small_rollback",
        "pen_instance.c",
        ("        pen_tuning_hold(&self->tuning, true);", 0, ""),
    ),
    "no confirmation": (
        "small_rollback",
        "pen_instance.c",
        ("good = whole(model, &tuning->slot[slot], own, &self->guard, round);", 0, "good = false;"),
    ),
}


def loaded(name: str) -> penode_gen.Model:
    """A model of gen/ or of small/, or one of these that holds or rolls back."""
    _folder, _, file = name.rpartition("/")
    if file in ("small_hold", "small_layers_rollback"):
        base, _, reaction = file.rpartition("_")
        model = penode_gen.load(gate.HERE / "small" / f"{base}.toml")
        return replace(model, name=file, guard=replace(model.guard, on_damage=reaction))
    place = gate.ROOT / "gen" / "nqvm" if file.startswith("nqvm") else gate.HERE / "small"
    return penode_gen.load(place / f"{file}.toml")


def program(what: str, model: penode_gen.Model, source: Path, src: Path) -> Path:
    """flip.c or flip_verify.c for a model."""
    elf, sets = WORK / f"{what}-{model.name}-{src.parent.name}", ",".join(f"&{model.name}_set_{other}" for other in model.sets)
    elf.parent.mkdir(parents=True, exist_ok=True)
    gate.make(
        [
            "clang-19",
            "-fsanitize=address",
            *(["-fsanitize-recover=address"] if what == "flip" else []),
            *FLAGS,
            "-D_GNU_SOURCE",
            "-O2",
            "-g",
            "-Wall",
            "-Wextra",
            f"-I{gate.ROOT}/inc",
            f"-I{gate.ROOT}/port/gnu",
            f"-I{source}",
            *model_options(model),
            f"-DMODEL_SETS={sets}",
            f"-DMODEL_ON_DAMAGE={model.guard.on_damage.upper()}",
            *(["-DMODEL_FOLDED"] if model.pieces else []),
            "-o",
            elf,
            gate.HERE / f"{what}.c",
            source / f"{model.name}.c",
            source / f"{model.owner}_params.c",
            *sorted(src.glob("*.c")),
        ]
    )
    return elf


def copied(fault: tuple[str, tuple[str, int, str]], model: penode_gen.Model, k: str) -> tuple[Path, Path]:
    """Folders of the model's C and of the runtime with a fault in one of them."""
    file, change = fault
    root = WORK / f"fault{k}"
    shutil.rmtree(root, ignore_errors=True)
    shutil.copytree(gate.ROOT / "src", root / "src")
    shutil.copytree(generated(model), root / "model")
    path = root / "model" / f"{model.name}.c" if file == "model" else root / "src" / file
    path.write_text(gate.faulty(path.read_text(), change))
    return root / "model", root / "src"


def verify(name: str, every: int, fault: tuple[str, tuple[str, int, str]] | None = None, k: str = "") -> tuple[int, str]:
    """Exit code and words of flip_verify.c."""
    model = loaded(name)
    source, src = copied(fault, model, k) if fault else (generated(model), gate.ROOT / "src")
    done = gate.run([program("flip_verify", model, source, src), every], limit=600, env=os.environ | {"ASAN_OPTIONS": "detect_leaks=0"})
    return done.returncode, done.stdout + done.stderr


def campaign(name: str, every: int = EVERY, fault: tuple[str, tuple[str, int, str]] | None = None, k: str = "") -> tuple[int, str]:
    """Exit code and words of flip.c for a model."""
    model = loaded(name)
    source, src = copied(fault, model, k) if fault else (generated(model), gate.ROOT / "src")
    options = "halt_on_error=0:handle_segv=0:handle_sigbus=0:detect_leaks=0"
    done = gate.run([program("flip", model, source, src), every], limit=100_000, env=os.environ | {"ASAN_OPTIONS": options})
    return done.returncode, done.stdout + done.stderr


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--every", type=int, default=EVERY, help="which bits: 1 is all")
    options.add_argument("--as", dest="key", default="flip", help="key in figures.json")
    given = options.parse_args()
    problems, figures, total = [], {}, 0
    with ThreadPoolExecutor() as pool:
        results = list(pool.map(lambda name: campaign(name, given.every), MODELS))
    for name, (code, said) in zip(MODELS, results, strict=True):
        counts = {what: int(n) for what, n in re.findall(r"^([a-z ]+): (\d+)$", said, re.M)}
        total += sum(counts.values())
        figures[name.split("/")[1]] = counts
        problems += [f"{name}:\n{said}"] if code or not counts else []
    good = gate.report(f"flip: {total} flipped bits: no write outside, no hang", problems)
    problems, guarded = [], {}
    for name, step in GUARDED.items():
        code, said = verify(name, step if given.every > 1 else 1)
        guarded[name] = int(n[1]) if (n := re.search(r"^flips (\d+)$", said, re.M)) else 0
        problems += [f"{name}:\n{said[-3000:]}"] if code or not guarded[name] else []
    good &= gate.report(
        f"flip: {sum(guarded.values())} flipped bits in guarded memory: each found in time, and followed by the reaction set", problems
    )
    missed = [f"not found: {what}" for k, (what, fault) in enumerate(FAULTS.items()) if not campaign("nqvm/nqvm", fault=fault, k=str(k))[0]]
    missed += [
        f"not found: {what}" for k, (what, (name, *fault)) in enumerate(VERIFY_FAULTS.items()) if not verify(name, 1, fault, f"v{k}")[0]
    ]
    total = len(FAULTS) + len(VERIFY_FAULTS)
    good &= gate.report(f"flip: {total - len(missed)} of {total} faults found", missed)
    gate.keep(
        given.key,
        figures | {"guarded bits": sum(guarded.values()), "faults": [*FAULTS, *VERIFY_FAULTS], "faults found": total - len(missed)},
    )
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
