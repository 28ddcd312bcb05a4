# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What the last line of `make test` adds up."""

import subprocess
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tally import Count, count_line, verdict  # needs the path above


@pytest.mark.parametrize(
    ("line", "count"),
    [
        ("test_pen_set      gcc    12 Tests 2 Failures 1 Ignored ", Count(9, 2, 1)),
        ("ok    symbols gcc -O2", Count(1, 0, 0)),
        ("FAIL  symbols gcc -O2", Count(0, 1, 0)),
        ("skip  cmock: no CMock", Count(0, 0, 1)),
        ("okay, or a line of a log", Count()),
        ("    ok    as quoted by a failing check", Count()),
        ("18 passed in 0.52s", Count(18, 0, 0)),
        ("2 failed, 18 passed, 3 skipped, 4 warnings, 1 error in 61.52s (0:01:01)", Count(18, 3, 3)),
        ("======= 1 xfailed, 1 xpassed in 0.01s =======", Count(1, 1, 0)),
        ("no tests ran in 0.01s", Count()),
    ],
)
def test_each_kind_of_report_is_counted(line, count):
    assert count_line(line) == count


@pytest.mark.parametrize(
    ("total", "code", "failed"),
    [
        (Count(5, 0, 0), 0, 0),
        (Count(5, 0, 0), 2, 1),  # a program did not compile, say
        (Count(5, 2, 0), 2, 2),
        (Count(), 0, 1),  # a suite that checks nothing
        (Count(0, 0, 1), 0, 0),
    ],
)
def test_a_suite_cannot_fail_or_check_nothing_unnoticed(total, code, failed):
    assert verdict(total, code).failed == failed


def test_a_failing_suite_does_not_keep_the_next_from_running(tmp_path):
    """Nor do suites that run at the same time mix what they say."""
    good = 'good:\n\t@echo "ok    this"; sleep 0.2; echo "ok    that"\n'
    (tmp_path / "Makefile").write_text('bad:\n\t@sleep 0.1; echo "FAIL  this"; exit 1\n' + good)
    tally = Path(__file__).resolve().parents[1] / "tally.py"
    done = subprocess.run([sys.executable, tally, "-j2", "bad", "good"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1
    assert "== good\nok    this\nok    that\n-- good: 2 passed, 0 failed, 0 skipped (0 s)\n" in done.stdout
    assert done.stdout.splitlines()[-1] == "2 passed, 1 failed, 0 skipped"
