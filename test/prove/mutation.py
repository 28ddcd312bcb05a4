# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: small faults put into src/ and pen_ekf.h (universalmutator, float build) are found by the unit tests; the rest stand in a list.

mutation.py             every fault
mutation.py --share N   every N-th fault, and all of the list; --first K: others of them, beginning with number K, below N
mutation.py pen_set.c   those of one file
mutation.py --tests 'test_pen_xcp*' pen_xcp.c ...   with these test programs only: for files that no other one calls

mutation.toml says of each fault that lives why it may: one that changes nothing a caller could see ("equivalent: ...")
counts as none; of the others at least 95 % have to be found. A fault in the list that is found is a failure, too.
"""

from __future__ import annotations

import argparse
import difflib
import hashlib
import math
import re
import resource
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path
from typing import NamedTuple

import coverage
import eva
import gate

WORK = gate.BUILD / "mutation"
LIST = gate.HERE / "mutation.toml"
MUTATE = gate.ROOT / "build" / "proof" / "bin" / "mutate"
LEAST = 0.95
SOURCES = sorted((gate.ROOT / "src").glob("*.c"))
HEADERS = [gate.ROOT / "inc" / "penode" / "pen_ekf.h"]  # an algorithm in inline functions: its own tests are made again for each fault
FLAGS = ["-std=c99", "-ffp-contract=off", "-fPIC", "-Werror=implicit-function-declaration", "-Iinc", "-Iport/gnu", "-Isrc"]
SANITIZE = ["-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all"]
KEEP = "-Dinline=__attribute__((used))"  # of headers: what nothing calls is compiled, too
# A fault that makes the same code as none, however it is compiled, changes nothing.
COMPILERS = (["gcc", "-O2"], ["gcc", "-O3"], ["clang-19", "-O2"])


class Fault(NamedTuple):
    """One line, before and after, in a function of a file."""

    file: str
    function: str
    old: str
    new: str


@dataclass(frozen=True)
class Bench:
    """Test programs, linked with the runtime as a shared library, which is made again for each fault."""

    place: Path
    flags: list[str]
    programs: dict[str, list[object]]
    made: dict[str, list[object]]  # how the compiler was called for them
    seconds: dict[str, int]  # of processor time, five times what a test takes without a fault


def compiled(text: str, compiler: list[str], header: bool) -> bytes | None:
    """The object made of a source, or of a header with its inline functions; None if the compiler refuses."""
    out, keep = WORK / "compiled.o", [KEEP] * header
    words = ["timeout", "60", *compiler, *FLAGS, *keep, "-g0", "-x", "c", "-c", "-o", out, "-"]
    done = subprocess.run(words, cwd=gate.ROOT, input=text.encode(), capture_output=True, check=False)
    return out.read_bytes() if done.returncode == 0 else None


def link(bench: Bench, source: str, mutant: Path) -> bool:
    """Make the library with a mutant in the place of a source; False if the compiler refuses."""
    out = bench.place / "mutant.o"
    objects = [out if file.name == source else bench.place / f"{file.stem}.o" for file in SOURCES]
    first = gate.run(["gcc", *FLAGS, *bench.flags, "-c", "-o", out, mutant])
    if first.returncode == 0:
        gate.make(["gcc", *bench.flags, "-shared", "-o", bench.place / "libruntime.so", *objects])
    return first.returncode == 0


def passes(bench: Bench, name: str) -> bool:
    """Does a test program end well, in time?"""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (bench.seconds.get(name, 60), bench.seconds.get(name, 60)))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

    command = [*map(str, bench.programs[name])]
    quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.run(command, preexec_fn=limit, check=False, **quiet).returncode == 0


def bench(name: str, flags: list[str], only: str = "*") -> Bench:
    """Test programs of test/unit, coverage_model.c of two models, and the comparison with wider arithmetic; of them those named `only`."""
    place = WORK / name
    place.mkdir()
    unity = coverage.UNITY
    for source in SOURCES:
        gate.make(["gcc", *FLAGS, *flags, "-c", "-o", place / f"{source.stem}.o", source])
    made = Bench(place, flags, {}, {}, {})
    link(made, SOURCES[0].name, SOURCES[0])
    linked = ["-L", place, f"-Wl,-rpath,{place}", "-lruntime"]
    words = [f"-I{coverage.MODELS}", "-Itest/unit", "-Itest/prove", f"-I{unity}/src", "-include", "unity_config.h", "-Isil/firmware"]
    words += ["-Wl,--wrap=longjmp"]  # with which Unity leaves a test: the first assertion that fails ends the program
    stop = place / "stop.c"
    stop.write_text("#include <stdlib.h>\nvoid __wrap_longjmp(void *to, int value) { (void)to; (void)value; abort(); }\n")
    shared = [stop, unity / "src" / "unity.c", coverage.UNIT / "unity_output.c", gate.ROOT / "port" / "host" / "board.c"]
    wanted = [(test, None) for test in sorted(coverage.UNIT.glob("test_*.c"))]
    wanted += [(test, model) for test in sorted(gate.HERE.glob("coverage_model*.c")) for model in ("nqvm_folded", "fading", "implicit")]
    wanted += [(gate.HERE / "coverage_promise.c", "promised")]
    for test, model in (pair for pair in wanted if fnmatch(pair[0].stem, only)):
        files, told = coverage.of_model("float", test, model) if model else ([], [])
        needs = re.search(r"needs: (.*) \*/", test.read_text())
        files += [coverage.MODELS / Path(n).name for n in (needs[1].split() if needs else [])]
        out = place / (f"{test.stem}_{model}" if model else test.stem)
        runner = f"{out}_runner.c"
        gate.make(["ruby", unity / "auto" / "generate_test_runner.rb", test, runner])
        sources = [runner, test, *shared, *files]
        made.made[out.name] = ["gcc", "-O1", *FLAGS, *words, *told, *flags, "-o", out, *sources, *linked]
        gate.make(made.made[out.name])
        made.programs[out.name] = [out]
    if fnmatch("accuracy", only):
        out = place / "accuracy"
        gate.make(["gcc", "-O2", *FLAGS, *flags, "-pthread", "-o", out, "test/accuracy/pen_math_accuracy.c", *linked, "-lm"])
        made.programs["accuracy"] = [out, 4099, 1]
    for program in made.programs:
        start = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        if not passes(made, program):
            raise SystemExit(f"FAIL  mutation: {program} fails without a fault")
        made.seconds[program] = math.ceil(5 * (resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - start) + 0.5)
    return made


def faults(source: Path, share: int, first: int, must: set[Fault]) -> Iterator[tuple[Fault, Path]]:
    """The mutants of a file that compile, differ from it in what they do, and from each other: each `share`-th from `first` on, and those
    of `must`."""
    place = WORK / source.name
    place.mkdir()
    gate.make([MUTATE, source, "c", "--noCheck", "--mutantDir", place])
    before = source.read_text().splitlines()
    header = source.suffix == ".h"
    seen = {compiled(source.read_text(), ["gcc", "-O1"], header)}
    texts = {preprocessed(source)}
    for number, mutant in enumerate(sorted(place.glob(f"*{source.suffix}"), key=lambda path: int(re.findall(r"\d+", path.stem)[-1]))):
        found = fault(source.name, before, mutant.read_text().splitlines())
        if number % share != first and found not in must:
            continue
        text = preprocessed(mutant)
        if text is None or text in texts:  # in a comment, or in the double build
            continue
        texts.add(text)
        made = compiled(mutant.read_text(), ["gcc", "-O1"], header)
        if made is not None and made not in seen:
            seen.add(made)
            yield found, mutant


def preprocessed(source: Path) -> str | None:
    """A fingerprint of a source without comments and parts that are not compiled; None if it cannot be read."""
    done = gate.run(["gcc", *FLAGS, "-E", "-P", source])
    return hashlib.sha256(done.stdout.encode()).hexdigest() if done.returncode == 0 else None


def fault(file: str, before: list[str], after: list[str]) -> Fault:
    """What a mutant changes."""
    lines = list(difflib.unified_diff(before, after, n=0, lineterm=""))[2:]
    at = int(re.match(r"@@ -(\d+)", lines[0])[1])
    heads = [m[1] for line in before[:at] if (m := re.match(r"(?!#|typedef)\w[\w *]*?\b(\w+)\(", line))]
    old, new = (" ".join(line[1:].strip() for line in lines[1:] if line[0] == sign) for sign in "-+")
    if not old:  # a line more, after this one
        old, new = before[at - 1].strip(), f"{before[at - 1].strip()} {new}"
    return Fault(file, heads[-1] if heads else "", old, new)


def includes(bench: Bench, name: str, mutant: Path, header: str) -> bool:
    """Make a test program with a mutant in the place of a header; False if the compiler refuses."""
    (bench.place / "penode").mkdir(exist_ok=True)
    shutil.copyfile(mutant, bench.place / "penode" / header)
    compiler, *words = bench.made[name]
    return gate.run([compiler, f"-I{bench.place}", *words]).returncode == 0


def lives(mutant: Path, file: str, benches: list[Bench]) -> bool:
    """Does every test still pass with this fault, and does some compiler make something of it?"""
    own = f"test_{Path(file).stem}"
    if mutant.suffix == ".h":
        return all(
            includes(place, name, mutant, file) and passes(place, name) for place in benches for name in place.made if name.startswith(own)
        )
    for place in benches:
        if not link(place, file, mutant):
            return False  # so wrong that a sanitizer's compiler sees it
        for name in sorted(place.programs, key=lambda name: name != own):
            if (name != "accuracy" or file == "pen_math.c") and not passes(place, name):
                return False
    return True


def same_code(mutant: Path, source: Path) -> bool:
    """Does a compiler make of it what it makes of the source?"""
    header = source.suffix == ".h"
    return any(compiled(mutant.read_text(), words, header) == compiled(source.read_text(), words, header) for words in COMPILERS)


def listed() -> dict[Fault, str]:
    """The faults that may live, and why."""
    groups = tomllib.loads(LIST.read_text())["lives"] if LIST.exists() else []
    return {Fault(g["file"], g["function"], *f): g["why"] for g in groups for f in g["faults"]}


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--share", type=int, default=1)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--tests", default="*")
    parser.add_argument("files", nargs="*")
    options = parser.parse_args()
    whole = options.share == 1 and not options.files and options.tests == "*"
    for place in (WORK, coverage.MODELS):
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir(parents=True)
    eva.models(coverage.MODELS)
    benches = [bench("plain", ["-O1"], options.tests), bench("checked", ["-O1", "-g", *SANITIZE], options.tests)]
    may_live, good, figures = listed(), True, {}
    for source in [*SOURCES, *HEADERS]:
        if options.files and source.name not in options.files:
            continue
        mine = {fault for fault in may_live if fault.file == source.name}
        alive, total, same, wrong = [], 0, 0, []
        for place in benches if source.suffix == ".h" else ():
            link(place, SOURCES[0].name, SOURCES[0])  # the library without the last fault of a source
        for found, mutant in faults(source, options.share, options.first, mine):
            total += 1
            if lives(mutant, source.name, benches):
                if same_code(mutant, source):
                    same += 1
                else:
                    alive.append(found)
        wrong += [f"lives and is not in the list: {f.function}: {[f.old, f.new]}" for f in alive if f not in mine]
        wrong += [f"is in the list and does not live: {f.function}: {[f.old, f.new]}" for f in mine if f not in alive]
        equivalent = same + sum(may_live.get(f, "").startswith("equivalent") for f in alive)
        counted, killed = total - equivalent, total - same - len(alive)
        share = killed / counted if counted else 0.0
        wrong += [f"found {share:.1%}, at least {LEAST:.0%} wanted"] if share < LEAST and options.share == 1 else []
        good &= gate.report(f"mutation: {source.name}: {killed} of {counted} faults found, {equivalent} change nothing", wrong)
        figures[source.name] = {"found": killed, "of": counted, "equivalent": equivalent}
    if whole:
        gate.keep("mutation", figures)
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
