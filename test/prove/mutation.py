# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: small faults put into src/ (universalmutator) are found by the unit tests; those that are not stand in a list.

mutation.py            every fault: hours
mutation.py --share N  every N-th fault, and all of the list: minutes
mutation.py --found F  remember in the file F what was found, and do not try that again: to work on the list

mutation_survivors.txt names each fault that lives, with the reason. One that changes nothing a caller could see counts as
none ("equivalent: ..."); of the others at least 95 % have to be found. A fault in the list that is found is a failure, too.
"""

from __future__ import annotations

import argparse
import difflib
import hashlib
import json
import re
import resource
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import coverage
import eva
import gate

WORK = gate.BUILD / "mutation"
LIST = gate.HERE / "mutation_survivors.txt"
MUTATE = gate.ROOT / "build" / "proof" / "bin" / "mutate"
LEAST = 0.95
SECONDS = 20  # of processor time for a test; a good one takes less than one
SANITIZE = ["-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all"]
FLAGS = ["-std=c99", "-ffp-contract=off", "-Iinc", "-Iport/gnu"]


class Fault(NamedTuple):
    """One line of a file, before and after."""

    file: str
    old: str
    new: str

    def __str__(self) -> str:
        return f"{self.file}: {self.old}  ->  {self.new}"


def faults(source: Path) -> Iterator[tuple[Fault, Path]]:
    """All mutants of a file that compile, differ from it in what they do, and from each other."""
    place = WORK / source.stem
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    gate.make([MUTATE, source, "c", "--noCheck", "--mutantDir", place])
    seen = {assembly(source)}
    before = source.read_text().splitlines()
    for mutant in sorted(place.glob("*.c"), key=lambda path: int(re.findall(r"\d+", path.stem)[-1])):
        text = assembly(mutant)
        if text is not None and text not in seen:
            seen.add(text)
            lines = list(difflib.unified_diff(before, mutant.read_text().splitlines(), n=0, lineterm=""))[3:]
            old, new = (" ".join(line[1:].strip() for line in lines if line[0] == sign) for sign in "-+")
            yield Fault(source.name, old, new), mutant


def assembly(source: Path) -> str | None:
    """A fingerprint of what the compiler makes of a file; None if it refuses."""
    done = gate.run(["gcc", *FLAGS, "-O2", "-w", "-g0", "-S", "-o", "-", source], errors="replace")
    return hashlib.sha256(re.sub(r"\.file\t.*", "", done.stdout).encode()).hexdigest() if done.returncode == 0 else None


def compiled(source: Path, out: Path, *words: str) -> Path:
    """An object with sanitizers in it."""
    gate.make(["gcc", *FLAGS, "-O1", "-w", *SANITIZE, *words, "-c", "-o", out, source])
    return out


def tests() -> dict[str, list[Path]]:
    """Objects of all test programs, without the runtime: those of test/unit, and coverage_model.c of two models."""
    unity = coverage.UNITY
    words = [f"-I{coverage.MODELS}", "-Itest/unit", f"-I{unity}/src", "-include", "unity_config.h", "-Isil/firmware"]
    shared = [unity / "src" / "unity.c", coverage.UNIT / "unity_output.c", gate.ROOT / "port" / "host" / "board.c"]
    common = [compiled(source, WORK / f"{source.stem}.o", *words) for source in shared]
    programs = {}
    wanted = [(test, None) for test in sorted(coverage.UNIT.glob("test_*.c"))]
    wanted += [(gate.HERE / "coverage_model.c", model) for model in ("nqvm_folded", "fading")]
    for test, model in wanted:
        name = model or test.stem
        told = [*eva.told(model), f"-DREFUSED={coverage.refused(model)}"] if model else []
        runner = WORK / f"{name}_runner.c"
        gate.make(["ruby", unity / "auto" / "generate_test_runner.rb", test, runner])
        models = re.search(r"needs: (.*) \*/", test.read_text())
        needs = [coverage.MODELS / Path(n).name for n in (models[1].split() if models else [])]
        needs += [coverage.MODELS / f"{model}.c", coverage.MODELS / f"{model}_params.c"] if model else []
        mine = [compiled(source, WORK / f"{name}-{source.stem}.o", *words, *told) for source in (runner, test, *needs)]
        programs[name] = common + mine
    return programs


def passes(program: Path) -> bool:
    """Does a test program end well, in time?"""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))

    done = subprocess.run([program], stdin=subprocess.DEVNULL, capture_output=True, preexec_fn=limit, check=False)
    return done.returncode == 0


def lives(fault: Fault, mutant: Path, programs: dict[str, list[Path]], runtime: dict[str, Path]) -> bool:
    """Does every test still pass with this fault?"""
    out = WORK / "mutant.o"
    try:
        compiled(mutant, out, "-Isrc")
    except SystemExit:
        return False  # so wrong that a sanitizer's compiler sees it
    objects = [out if name == fault.file else path for name, path in runtime.items()]
    own = f"test_{Path(fault.file).stem}"
    for name in sorted(programs, key=lambda name: name != own):
        program = WORK / "program"
        gate.make(["gcc", *SANITIZE, "-o", program, *programs[name], *objects])
        if not passes(program):
            return False
    return fault.file != "pen_math.c" or accurate(mutant)


def accurate(mutant: Path) -> bool:
    """Does the comparison with wider arithmetic still pass, for every 4099th number?"""
    program = WORK / "accuracy"
    gate.make(["gcc", *FLAGS, "-O2", "-w", "-pthread", "-o", program, "test/accuracy/pen_math_accuracy.c", mutant, "-lm"])
    return gate.run([program, "4099", "1"], limit=300).returncode == 0


def listed() -> dict[Fault, str]:
    """The faults that may live, and why."""
    found, file, old, new = {}, "", "", ""
    for line in LIST.read_text().splitlines() if LIST.exists() else []:
        if line.startswith("== "):
            file = line[3:]
        elif line.startswith("- "):
            old = line[2:].strip()
        elif line.startswith("+"):
            new = line[1:].strip()
        elif line.startswith("  "):
            found[Fault(file, old, new)] = line.strip()
    return found


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--share", type=int, default=1)
    parser.add_argument("--found", type=Path)
    parser.add_argument("files", nargs="*")
    options = parser.parse_args()
    known = set(json.loads(options.found.read_text())) if options.found and options.found.exists() else set()
    shutil.rmtree(WORK, ignore_errors=True)
    shutil.rmtree(coverage.MODELS, ignore_errors=True)
    for place in (WORK, coverage.MODELS):
        place.mkdir(parents=True)
    eva.models(coverage.MODELS)
    programs = tests()
    sources = sorted((gate.ROOT / "src").glob("*.c"))
    runtime = {source.name: compiled(source, WORK / f"{source.stem}.o") for source in sources}
    may_live, good, figures = listed(), True, {}
    for source in sources:
        if options.files and source.name not in options.files:
            continue
        alive, total, wrong = {}, 0, []
        for number, (fault, mutant) in enumerate(faults(source)):
            if number % options.share and fault not in may_live:
                continue
            total += 1
            key = hashlib.sha256(f"{fault}{mutant.name}".encode()).hexdigest()
            if key in known:
                continue
            if lives(fault, mutant, programs, runtime):
                alive[fault] = may_live.get(fault, "")
                wrong += [f"lives and is not in the list: {fault}"] if fault not in may_live else []
            elif fault in may_live:
                wrong.append(f"is in the list and was found: {fault}")
            elif options.found:
                known.add(key)
                options.found.write_text(json.dumps(sorted(known)))
        counted = total - sum(why.startswith("equivalent") for why in alive.values())
        killed = total - len(alive)
        share = killed / counted if counted else 0.0
        wrong += [f"found {share:.1%}, at least {LEAST:.0%} wanted"] if share < LEAST else []
        good &= gate.report(f"mutation: {source.name}: {killed} of {counted} faults found, {total - counted} change nothing", wrong)
        figures[source.name] = {"found": killed, "of": counted, "equivalent": total - counted}
    if options.share == 1 and not options.files:
        gate.keep("mutation", figures)
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
