# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Environment variables that nothing can be done with: a line each and code 2, before any library falls over them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from penode_sil.building import build_directory
from penode_sil.environment import LAST, problems

COMMAND = [sys.executable, "-m", "penode_sil", "--version"]


def called(**variables: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(COMMAND, env=os.environ | variables, capture_output=True, text=True)


def test_a_time_that_is_none_is_a_line_of_every_command() -> None:
    """numpy alone would end in a traceback; seeded: it does where the module is passed over."""
    done = called(SOURCE_DATE_EPOCH="")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "penode: SOURCE_DATE_EPOCH: '' is not a time in seconds; remove it or give a whole number\n"
    module = "sys.modules['penode_sil.environment'] = types.ModuleType('penode_sil.environment')"
    code = f"import sys, types; {module}; import penode_sil.simulate"
    unguarded = subprocess.run([sys.executable, "-c", code], env=os.environ | {"SOURCE_DATE_EPOCH": ""}, capture_output=True, text=True)
    assert unguarded.returncode == 1 and "Traceback" in unguarded.stderr


@pytest.mark.parametrize("wrong", ["", " ", "abc", "-5", "1.5", "1e3", "9" * 5000, str(LAST + 1), "\u0663", "0x10", "+1", "1_0"])
def test_times(wrong: str) -> None:
    assert len(problems({"SOURCE_DATE_EPOCH": wrong})) == 1
    assert problems({"SOURCE_DATE_EPOCH": str(LAST)}) == problems({}) == problems({"SOURCE_DATE_EPOCH": "0"}) == []


def test_a_build_directory_that_is_a_file(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    done = called(PENODE_BUILD=str(tmp_path / "file"), SOURCE_DATE_EPOCH="x")
    assert done.returncode == 2 and [line.split(":")[1] for line in done.stderr.splitlines()] == [" SOURCE_DATE_EPOCH", " PENODE_BUILD"]
    assert "name a directory" in done.stderr


@pytest.mark.parametrize("name", ["", "build here"])
def test_a_build_directory_that_is_empty_or_relative(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A library is loaded by its path only where that is absolute; an empty name is none."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PENODE_BUILD", name)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert build_directory() == tmp_path / (name or "cache/penode")
    monkeypatch.setenv("XDG_CACHE_HOME", "")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert build_directory() == tmp_path / (name or "home/.cache/penode")


def test_variables_that_libraries_read_do_no_harm() -> None:
    variables = {"MPLBACKEND": "foo", "MATPLOTLIBRC": "/nonexistent", "COLUMNS": "abc", "XDG_CACHE_HOME": ""}
    done = subprocess.run(
        [sys.executable, "-c", "import penode_sil.cli, penode_sil.plots"], env=os.environ | variables, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
