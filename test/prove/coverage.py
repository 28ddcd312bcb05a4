# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: the unit tests take every line, every branch and every condition (MC/DC) of runtime and models."""

from __future__ import annotations

import json
import os
import re
import shutil
import sys
import zlib
from pathlib import Path

import eva
import gate

WORK = gate.BUILD / "coverage"
MODELS = WORK / "models"
ALL = eva.MODELS | eva.PROMISED
UNIT = gate.ROOT / "test" / "unit"
UNITY = gate.ROOT / "build" / "unity"
NEEDED = ("test_pen_math", "test_pen_net", "test_pen_solve", "test_pen_step")  # without one of them something is not covered
KINDS = ("lines", "branches", "mcdc")
LENGTH = 1198  # values of a set of each model
# A double build and a size build have code of their own.
BUILDS = {"float": [], "double": ["-DPEN_REAL_DOUBLE"], "size": ["-D__OPTIMIZE_SIZE__"]}


def program(build: str, name: str, test: Path, others: list[Path], words: list[str]) -> Path:
    """Build a Unity test with counters in it, and run it; its path. SystemExit if it fails."""
    place = WORK / build
    place.mkdir(parents=True, exist_ok=True)
    runner, out = place / f"{name}_runner.c", place / name
    gate.make(["ruby", UNITY / "auto" / "generate_test_runner.rb", test, runner])
    gate.make(
        [
            "port/host/cc",
            "clang-19",
            "-std=c99",
            "-O1",
            "-g",
            "-fprofile-instr-generate",
            "-fcoverage-mapping",
            "-fcoverage-mcdc",
            f"-I{MODELS}",
            "-Itest/unit",
            "-Itest/prove",
            f"-I{UNITY}/src",
            "-include",
            "unity_config.h",
            *BUILDS[build],
            *words,
            "-o",
            out,
            runner,
            test,
            UNIT / "unity_output.c",
            UNITY / "src" / "unity.c",
            *sorted((gate.ROOT / "src").glob("*.c")),
            *others,
        ]
    )
    done = gate.run([out], env=os.environ | {"LLVM_PROFILE_FILE": f"{out}.profraw"})
    if done.returncode != 0:
        raise SystemExit(f"FAIL  coverage: {name}, {build}\n{done.stdout}{done.stderr}")
    return out


def unit_tests(build: str) -> list[Path]:
    """The programs of test/unit."""
    programs = []
    for test in sorted(UNIT.glob("test_*.c")):
        needs = re.search(r"needs: (.*) \*/", test.read_text())
        others = [MODELS / Path(n).name for n in needs[1].split()] if needs else []
        programs.append(program(build, test.stem, test, others, []))
    return programs


def refuses(model: str) -> bool:
    """Does a model refuse a set with more pieces than it has room for?"""
    return (model == "nqvm_folded" or "pieces = 96" in ALL[model]) and 'more_pieces = "layers"' not in ALL[model]


def refused(model: str) -> str:
    """What it says to it: a saw in its first network, the second, both; in the second it breaks a promise."""
    pieces = "PEN_SET_PIECES" if refuses(model) else "PEN_OK"
    return f"({pieces} | (((i) > 0U) ? PEN_SET_PROMISE : PEN_OK))" if model in eva.PROMISED else pieces


def unfelt(model: str) -> str:
    """A number that a step of `self` does not meet: of its last piece, or the lower bound of an envelope."""
    return "self->piece[self->head.tuning.active][MODEL_SIZE(PIECES) - 1U].slope" if refuses(model) else "value[SPRING]"


def chosen(model: str, key: str) -> str:
    """What the model file says of out_of_range or on_damage."""
    return next((line.split('"')[1] for line in ALL[model] if line.startswith(f"{key} = ")), "report")


def told(model: str) -> list[str]:
    """Options of coverage_model.c for a model."""
    range_flags = "(PEN_INPUT_RANGE | PEN_HELD)" if chosen(model, "out_of_range") == "hold" else "PEN_INPUT_RANGE"
    return [
        *eva.told(model),
        f"-DREFUSED(i)={refused(model)}",
        f"-DUNFELT={unfelt(model)}",
        f"-DOUT_OF_RANGE={range_flags}",
        f"-DON_DAMAGE=PEN_DAMAGE_{chosen(model, 'on_damage').upper()}",
    ]


def of_model(build: str, test: Path, model: str) -> tuple[list[Path], list[str]]:
    """Files that a test of coverage_*.c is linked with, and its options for a model and its sets."""
    zeros = zlib.crc32(bytes(LENGTH * (8 if build == "double" else 4)))  # the checksum of a set of zeros
    words = [*told(model), f"-DSET(name)={eva.owner(model)}_set_##name", f"-DZEROS=0x{zeros:08x}U"]
    names = [model, f"{model}_selftest"]
    if test.stem != "coverage_model_selftest":  # that has sets of its own
        names.append(f"{eva.owner(model)}_params")
    return [MODELS / f"{name}.c" for name in names], words


def model_tests(build: str) -> list[Path]:
    """The tests of coverage_model*.c for each model, those of coverage_promise.c for each that promises something."""
    return [
        program(build, f"{test.stem}_{model}", test, *of_model(build, test, model))
        for test in sorted(gate.HERE.glob("coverage_*.c"))
        for model in (eva.PROMISED if test.stem == "coverage_promise" else ALL)
    ]


def export(build: str, programs: list[Path], *words: str) -> str:
    """What llvm-cov has to say about what is ours."""
    objects = [f"-object={p}" for p in programs]
    ours = [gate.ROOT / "src", gate.ROOT / "inc", MODELS]
    data = WORK / build / "all.profdata"
    done = gate.run(["llvm-cov-19", "export", *words, f"-instr-profile={data}", *objects, "-sources", *ours])
    if done.returncode != 0:
        raise SystemExit(f"FAIL  coverage: {build}\n{done.stderr}")
    return done.stdout


def measure(build: str, programs: list[Path]) -> tuple[dict[str, tuple[int, int]], list[str]]:
    """Covered and all lines, branches and conditions; where something is not covered."""
    gate.make(["llvm-profdata-19", "merge", "-o", WORK / build / "all.profdata", *(f"{p}.profraw" for p in programs)])
    found: dict[str, dict[str, tuple[int, int]]] = {}
    missing = []
    # Lines of all copies of an inline function together; for branches and conditions one copy has to have them all.
    for record in export(build, programs, "-format=lcov").split("end_of_record")[:-1]:
        name = re.search(r"^SF:(.*)", record, re.M)[1]
        lines = re.findall(r"^DA:(\d+),(\d+)", record, re.M)
        found[name] = {"lines": (sum(n != "0" for _, n in lines), len(lines))}
        missing += [f"{build}: {Path(name).name}:{line} never executed" for line, n in lines if n == "0"]
    for file in json.loads(export(build, programs, "-summary-only", "-show-mcdc-summary"))["data"][0]["files"]:
        for kind in ("branches", "mcdc"):
            covered, count = file["summary"][kind]["covered"], file["summary"][kind]["count"]
            found[file["filename"]][kind] = (covered, count)
            missing += [f"{build}: {Path(file['filename']).name}: {covered} of {count} {kind}"] if covered != count else []
    total = {kind: (sum(f[kind][0] for f in found.values()), sum(f[kind][1] for f in found.values())) for kind in KINDS}
    if 0 in (count for _, count in total.values()):
        missing.append(f"{build}: nothing measured")
    return total, missing


def main() -> int:
    shutil.rmtree(WORK, ignore_errors=True)
    MODELS.mkdir(parents=True)
    eva.models(MODELS)
    good, figures = True, {}
    for build in BUILDS:
        programs = [*unit_tests(build), *model_tests(build)]
        total, missing = measure(build, programs)
        shares = ", ".join(f"{a} of {b} {kind}" for kind, (a, b) in total.items())
        good &= gate.report(f"coverage, {build}: {shares}", missing)
        figures[build] = {kind: f"{a} of {b}" for kind, (a, b) in total.items()}
    noticed = [bool(measure(build, [p for p in programs if p.name != name])[1]) for name in NEEDED]
    for name, found in zip(NEEDED, noticed, strict=True):
        good &= gate.report(f"coverage: seeded fault: {name} left out", [] if found else ["not found"])
    gate.keep("coverage", figures | {"faults": [f"{name} left out" for name in NEEDED], "faults found": sum(noticed)})
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
