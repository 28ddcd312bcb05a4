# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What the last line of `make test` adds up."""

import json
import os
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
    ("total", "bad", "failed"),
    [
        (Count(5, 0, 0), False, 0),
        (Count(5, 0, 0), True, 1),  # a program did not compile, say
        (Count(5, 2, 0), True, 2),
        (Count(), False, 1),  # a gate that checks nothing
        (Count(0, 0, 1), False, 0),
    ],
)
def test_a_gate_cannot_fail_or_check_nothing_unnoticed(total, bad, failed):
    assert verdict(total, bad).failed == failed


MAKEFILE = """
good:
	@echo "ok    this"; sleep 0.2; echo "ok    that"
bad:
	@sleep 0.1; echo "FAIL  this"; exit 1
silent:
	@true
unreported:
	@echo "ok    this"; exit 3
unbuilt: part.o
	@echo "ok    this"
part.o:
	@echo "ok    a compiler's words"; false
unknown: nothing.c
	@echo "ok    this"
value:
	@[ "$(X)" = 5 ] && echo "ok    this"
"""
TALLY, SHOW = (Path(__file__).resolve().parents[1] / name for name in ("tally.py", "unit/show"))


def tally(folder, *words, **environment):
    """Run it in a folder on MAKEFILE: exit code, what it said, line by line."""
    (folder / "Makefile").write_text(MAKEFILE)
    done = subprocess.run([sys.executable, TALLY, *words], cwd=folder, capture_output=True, text=True, env=os.environ | environment)
    return done.returncode, done.stdout.splitlines()


@pytest.mark.parametrize("jobs", [1, 3])
def test_a_failing_gate_does_not_keep_the_next_from_running(jobs, tmp_path):
    """Nor do gates that run at the same time mix what they say."""
    code, said = tally(tmp_path, f"-j{jobs}", "bad", "good")
    at = said.index("== good")
    assert said[at + 1 : at + 3] == ["ok    this", "ok    that"]
    assert (code, said[-2:]) == (1, ["FAILED bad: 0 passed, 1 failed, 0 skipped", "2 passed, 1 failed, 0 skipped"])


@pytest.mark.parametrize(
    ("gate", "total"),
    [
        ("silent", "0 passed, 1 failed, 0 skipped"),
        ("unreported", "1 passed, 1 failed, 0 skipped"),
        ("unbuilt", "0 passed, 1 failed, 0 skipped"),
        ("unknown", "0 passed, 1 failed, 0 skipped"),
        ("absent", "0 passed, 1 failed, 0 skipped"),
    ],
)
@pytest.mark.parametrize("level", "01")
def test_each_bad_gate_is_one_failure(gate, total, level, tmp_path):
    """Called from a make too, which then puts its level into what it says."""
    code, said = tally(tmp_path, "-j2", gate, "good", MAKELEVEL=level)
    assert code == 1 and f"FAILED {gate}: {total}" in said


def test_variables_of_the_command_line_reach_the_gates(tmp_path):
    assert tally(tmp_path, "value", MAKEFLAGS=" -j4 -- X=5")[1][-1] == "1 passed, 0 failed, 0 skipped"


def test_gates_and_python_tests_share_one_core(tmp_path):
    """And what they took is kept. A test that ends its worker is a failure, and keeps none from running."""
    (tmp_path / "test_one.py").write_text("import os\ndef test_good(): pass\ndef test_end(): os._exit(1)\ndef test_bad(): assert 0\n")
    code, said = tally(tmp_path, "-j1", "--python", "test_one.py", "--", "good")
    assert (code, said[-1]) == (1, "3 passed, 2 failed, 0 skipped")
    assert {"good", "test_one.py::test_good"} <= set(json.loads((tmp_path / "build/test/durations.json").read_text()))


def show(tmp_path, program, *files):
    """Exit code and lines of test/unit/show with a script as the program of files."""
    (tmp_path / "program").write_text(program)
    done = subprocess.run([SHOW, "here", "bash", tmp_path / "program", "--", *files], capture_output=True, text=True)
    return done.returncode, [" ".join(line.split()) for line in done.stdout.splitlines()]


GOOD = 'echo "2 Tests 0 Failures 0 Ignored"'


@pytest.mark.parametrize(
    ("program", "bad", "lines"),
    [
        (f"echo == a; {GOOD}; echo == b; {GOOD}", 0, ["a here 2 Tests 0 Failures 0 Ignored", "b here 2 Tests 0 Failures 0 Ignored"]),
        (
            f"if [ $1 = a ]; then echo == a; echo fault; exit 70; fi; echo == b; {GOOD}",
            1,
            [
                "a here 1 Tests 1 Failures 0 Ignored: ended with exit code 70 before its summary",
                "fault",
                "b here 2 Tests 0 Failures 0 Ignored",
            ],
        ),
        (
            f"if [ $1 = a ]; then echo == a; {GOOD}; echo == b; fi; exit 3",
            1,
            ["a here 2 Tests 0 Failures 0 Ignored", "b here 1 Tests 1 Failures 0 Ignored: ended with exit code 3 before its summary"],
        ),
        (
            f"echo == a; echo x.c:1:test_x:FAIL; echo '2 Tests 1 Failures 0 Ignored'; echo == b; {GOOD}; exit 1",
            1,
            ["a here 2 Tests 1 Failures 0 Ignored", "x.c:1:test_x:FAIL", "b here 2 Tests 0 Failures 0 Ignored"],
        ),
        (
            f"echo == a; {GOOD}; echo == b; {GOOD}; exit 23",
            1,
            ["a here 2 Tests 0 Failures 0 Ignored", "b here 1 Tests 1 Failures 0 Ignored: ended with exit code 23 after its summary"],
        ),
    ],
)
def test_a_unity_file_that_ends_its_program_is_one_failure_and_the_others_run(program, bad, lines, tmp_path):
    code, said = show(tmp_path, program, "a", "b")
    assert (code, [line for line in said if "2 Tests 0 Failures" in line or line in lines or "1 Tests" in line]) == (bad, lines)
