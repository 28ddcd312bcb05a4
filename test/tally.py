# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Run suites (targets of the Makefile), some at the same time, and add up what they report, in one last line.

Counted are Unity's summary lines, pytest's last line, and lines of gates that begin with "ok", "FAIL" or "skip". A
suite that ends badly without having reported a failure, or reports nothing at all, counts as one failure. Exit code 1
if anything failed.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor, as_completed
from typing import NamedTuple

UNITY = re.compile(r"\b(\d+) Tests (\d+) Failures (\d+) Ignored")
PYTEST = re.compile(r"^(?:=+ )?((?:\d+ \w+(?:, )?)+|no tests ran) in [\d.]+s")
GATE = re.compile(r"^(ok|FAIL|skip)  ")
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


def verdict(total: Count, code: int) -> Count:
    """The total of a suite that ended with this exit code."""
    silent = total == Count() or (code != 0 and total.failed == 0)
    return total.plus(Count(failed=1)) if silent else total


def run(suite: str) -> tuple[Count, str]:
    """Run one suite; its count, and all that it said between its name and its count."""
    print(f".. {suite}", flush=True)  # so that one sees what takes long
    start = time.monotonic()
    done = subprocess.run(
        ["make", "--no-print-directory", "-k", suite],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
    )
    total = Count()
    for line in done.stdout.splitlines():
        total = total.plus(count_line(line))
    total = verdict(total, done.returncode)
    return total, f"== {suite}\n{done.stdout}-- {suite}: {total} ({time.monotonic() - start:.0f} s)\n"


def main() -> int:
    """Run all suites, whatever becomes of each."""
    parse = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parse.add_argument("-j", "--jobs", type=int, default=1, help="suites at the same time (1)")
    parse.add_argument("suites", nargs="+")
    asked = parse.parse_args()
    total, pool = Count(), ThreadPoolExecutor(asked.jobs)
    try:
        for done in as_completed([pool.submit(run, suite) for suite in asked.suites]):
            count, text = done.result()
            print(text, flush=True)
            total = total.plus(count)
    finally:  # Ctrl-C: begin no other
        pool.shutdown(cancel_futures=True)
    print(total)
    return int(total.failed > 0)


if __name__ == "__main__":
    sys.exit(main())
