# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Run gates (targets of the Makefile) and Python tests on all cores, and add up what they report, in one last line.

Counted are Unity's summary lines, pytest's last line, and lines of gates that begin with "ok", "FAIL" or "skip". A gate
that ends badly without having reported a failure, that could not be built, or that reports nothing at all, counts as one
failure; so does a run of pytest. Exit code 1 if anything failed.

make and the workers of pytest share the cores by make's job server, so that no core waits while anything is left. Those
that took longest in the last run begin; build/test/durations.json has the seconds of all.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).resolve().parent
KEPT = Path("build/test")
MANY = 4096  # tokens when make has ended: the workers of pytest are no more than cores, and one that dies takes its token along
SLOW = 20.0  # seconds; tests that took longer are named at the end

UNITY = re.compile(r"\b(\d+) Tests (\d+) Failures (\d+) Ignored")
PYTEST = re.compile(r"^(?:=+ )?((?:\d+ \w+(?:, )?)+|no tests ran) in [\d.]+s")
GATE = re.compile(r"^(ok|FAIL|skip)  ")
BEGIN, END = re.compile(r"^== (\S+)$"), re.compile(r"^-- (\S+): (\d+) ms(, exit \d+)?$")
BAD = re.compile(
    r"^make(?:\[\d+\])?: (?:\*\*\* \[.*?(?:: )?([^\s:]+)\] |Target '(.*)' not remade|\*\*\* No rule to make target '(.*?)'[ .])"
)
PYTEST_WORDS = {
    "passed": "passed",
    "xfailed": "passed",
    "failed": "failed",
    "error": "failed",
    "errors": "failed",
    "xpassed": "failed",
    "skipped": "skipped",
}


class Count(NamedTuple):
    """Numbers of checks."""

    passed: int = 0
    failed: int = 0
    skipped: int = 0

    def plus(self, other: Count) -> Count:
        return Count(*(a + b for a, b in zip(self, other, strict=True)))

    def __str__(self) -> str:
        return f"{self.passed} passed, {self.failed} failed, {self.skipped} skipped"


class Result(NamedTuple):
    """What one gate, or all of pytest, came to."""

    name: str
    count: Count
    seconds: float


def count_line(line: str) -> Count:
    """What one line of output reports; zeros if it is no report."""
    if match := UNITY.search(line):
        tests, failures, ignored = map(int, match.groups())
        return Count(tests - failures - ignored, failures, ignored)
    if match := GATE.match(line):
        return {"ok": Count(passed=1), "FAIL": Count(failed=1), "skip": Count(skipped=1)}[match[1]]
    if match := PYTEST.match(line):
        totals = {"passed": 0, "failed": 0, "skipped": 0}
        for number, word in re.findall(r"(\d+) (\w+)", match[1]):
            if word in PYTEST_WORDS:
                totals[PYTEST_WORDS[word]] += int(number)
        return Count(**totals)
    return Count()


def verdict(total: Count, bad: bool) -> Count:
    """The total of a gate that ended well or badly."""
    silent = total == Count() or (bad and total.failed == 0)
    return total.plus(Count(failed=1)) if silent else total


def read(lines: Iterable[str], gates: Iterable[str]) -> list[Result]:
    """The results of gates from what make says while it runs them in test/gate, each gate's lines together."""
    counts, seconds, bad, current = dict.fromkeys(gates, Count()), defaultdict(float), set(), ""
    for line in lines:
        print(line, end="", flush=True)
        if (match := BEGIN.match(line)) and match[1] in counts:
            current = match[1]
        elif (match := END.match(line)) and match[1] == current:
            seconds[match[1]] += int(match[2]) / 1000
            bad |= {match[1]} if match[3] else set()
            current = ""
        elif match := BAD.match(line):
            bad.add(next(filter(None, match.groups())))
        elif current:
            counts[current] = counts[current].plus(count_line(line))
    return [Result(name, verdict(count, name in bad), seconds[name]) for name, count in counts.items()]


class Cores:
    """A budget of cores: what make calls a job server, a pipe with a byte for each core but the one that make has anyway."""

    def __init__(self, folder: str, number: int):
        self.number, self.path = number, Path(folder, "cores")
        os.mkfifo(self.path)
        self.pipe = os.open(self.path, os.O_RDWR)
        self.free(number - 1)

    def free(self, number: int) -> None:
        """Put tokens into the pipe."""
        os.write(self.pipe, b"+" * number)


def run_gates(gates: list[str], cores: Cores) -> list[Result]:
    """Let make run gates, whatever becomes of each."""
    shell = [f"--eval={' '.join(gates)}: private {v}" for v in (f"SHELL := {HERE / 'gate'}", ".SHELLFLAGS = $@")]
    flags, *variables = re.sub(r"-j\S*|--jobserver\S*", "", os.environ.get("MAKEFLAGS", "")).partition("-- ")  # of the make that called us
    flags = f"{flags} -j --jobserver-auth={cores.pipe},{cores.pipe} {''.join(variables)}"
    with subprocess.Popen(
        ["make", "--no-print-directory", "-k", "--output-sync=target", *shell, *gates],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        env={**os.environ, "MAKEFLAGS": flags, "LC_ALL": "C"},
        pass_fds=[cores.pipe],
    ) as make:
        found = read(make.stdout or [], gates)
    if make.returncode != 0 and not any(result.count.failed for result in found):
        found.append(Result("make", Count(failed=1), 0.0))
    cores.free(MANY)
    return found


def run_python(folders: list[str], cores: Cores) -> list[Result]:
    """Run the Python tests of folders, in as many processes as there are cores."""
    start = time.monotonic()
    own = {
        "PENODE_TOKENS": str(cores.path),
        "PENODE_DURATIONS": str((KEPT / "python.json").absolute()),
        "PYTHONPATH": os.pathsep.join(filter(None, [str(HERE), os.environ.get("PYTHONPATH", "")])),
        "HYPOTHESIS_STORAGE_DIRECTORY": "build/hypothesis",
        "OPENBLAS_NUM_THREADS": "1",  # one thread each
    }
    words = ["-q", "-p", "schedule", "-n", str(cores.number), "--no-loadscope-reorder", *folders]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *words],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        env=os.environ | own,
    )
    print(f"== python\n{done.stdout}", flush=True)
    count = Count()
    for line in done.stdout.splitlines():
        count = count.plus(count_line(line))
    return [Result("python", verdict(count, done.returncode != 0), time.monotonic() - start)]


def kept(file: str) -> dict[str, float]:
    """Seconds of an earlier run."""
    try:
        return json.loads((KEPT / file).read_text())
    except (OSError, ValueError):
        return {}


def slow(seconds: dict[str, float]) -> Iterator[str]:
    """Lines about what took long."""
    for name, took in sorted(seconds.items(), key=lambda row: -row[1]):
        if took > SLOW:
            yield f"{took:6.0f} s  {name}"


def main() -> int:
    """Run everything, whatever becomes of each."""
    parse = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parse.add_argument("-j", "--jobs", type=int, default=1, help="cores (1)")
    parse.add_argument("--python", nargs="*", default=[], metavar="FOLDER", help="folders of Python tests")
    parse.add_argument("gates", nargs="*")
    asked = parse.parse_args()
    before = kept("gates.json")
    gates = sorted(asked.gates, key=lambda gate: -before.get(gate, 0.0))
    KEPT.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(2) as pool:
        cores = Cores(folder, asked.jobs)
        if not gates:
            cores.free(MANY)
        parts = [pool.submit(run_gates, gates, cores)] if gates else []
        parts += [pool.submit(run_python, asked.python, cores)] if asked.python else []
        results = [result for part in parts for result in part.result()]
    of_gates = {result.name: result.seconds for result in results if result.name != "python"}
    (KEPT / "gates.json").write_text(json.dumps(before | of_gates, indent=0))
    seconds = of_gates | (kept("python.json") if asked.python else {})
    (KEPT / "durations.json").write_text(json.dumps(seconds, indent=0))
    print("\n".join(["", *slow(seconds)]))
    total = Count()
    for result in results:
        total = total.plus(result.count)
        if result.count.failed:
            print(f"FAILED {result.name}: {result.count}")
    print(total)
    return int(total.failed > 0)


if __name__ == "__main__":
    sys.exit(main())
