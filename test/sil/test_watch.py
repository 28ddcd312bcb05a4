# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The example of filter and monitor under emulation: status line, flag, set exchange; the same bits on each machine."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from places import ROOT
from samples import sample

import penode_gen
from penode_sil.building import generated
from penode_sil.targets import MACHINES

LINE = re.compile(
    r"(?P<second>\d+) s: deflection -?\d+ um, 3 sigma (?P<three>\d+) um, off by (?P<off>-?\d+) um, refused \d+, "
    r"(?:RUBBING since sample (?P<since>\d+)|not rubbing), other alarms (?P<others>\d+)"
)
RUBS, RECEIVES = 2, 4  # s, as in watch.c


def build(machine: str, folder: Path, source: Path = ROOT / "sil/firmware/watch.c") -> Path:
    for program in ("qemu-system-arm", "arm-none-eabi-gcc"):
        if shutil.which(program) is None:
            pytest.skip(f"{program} is not installed; make test installs it")
    c, elf = generated(penode_gen.load(ROOT / "sil/filter/watched.toml")), folder / f"{machine}.elf"
    files = [source, *(c / f"watched{part}.c" for part in ("", "_params", "_ekf", "_monitor")), *sorted((ROOT / "src").glob("*.c"))]
    options = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", f"-I{c}"]
    subprocess.run([ROOT / "port/cortex-m/cc", MACHINES[machine], *options, *files, "-o", elf], check=True)
    return elf


def run(machine: str, elf: Path, *arguments: str, shift: int = 2) -> list[str]:
    """Lines of a run; 2^shift ns an instruction."""
    done = subprocess.run(
        [ROOT / "port/cortex-m/run", MACHINES[machine], elf, *arguments],
        env=os.environ | {"SHIFT": str(shift), "LIMIT": "120"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert done.returncode == 0, done.stdout
    return done.stdout.splitlines()


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build("m4f", tmp_path_factory.mktemp("watch"))


@pytest.fixture(scope="module")
def healthy(program: Path) -> list[str]:
    """What it prints where nothing rubs."""
    return run("m4f", program, "healthy")


def test_flag_rises_with_the_friction_and_falls_with_its_set(program: Path, show: Callable[[str], None]) -> None:
    lines = run("m4f", program)
    for line in lines:
        show(line)
    seconds = {int(m["second"]): m for m in map(LINE.fullmatch, lines) if m}
    assert sorted(seconds) == [1, 2, 3, 4, 5, 6]
    for second, m in seconds.items():
        assert (m["since"] is not None) == (RUBS < second <= RECEIVES), m[0]
    assert 1000 * RUBS < int(seconds[RECEIVES]["since"]) < 1000 * RUBS + 100
    assert lines[RUBS] == "the damper begins to rub with 30 N"
    adopted = int(re.fullmatch(r"set received, in force at sample (\d+)", lines[RECEIVES + 1])[1])
    assert 75 <= adopted - 1000 * RECEIVES <= 85  # 75 frames of 16 values, one a millisecond
    assert lines[-1] == "watch: good"


def test_no_flag_without_friction(healthy: list[str]) -> None:
    """And the deflection, which no sensor shows, is within its deviation."""
    found = [m for m in map(LINE.fullmatch, healthy) if m]
    assert [m["since"] for m in found] == [None] * 6 and [m["others"] for m in found] == ["0"] * 6
    assert sum((3 * int(m["off"]) / int(m["three"])) ** 2 for m in found) < 16.8  # 99 % of a chi-square of 6
    assert healthy[-1] == "watch: good"


@pytest.mark.parametrize("machine", sample([name for name, board in MACHINES.items() if board and name != "m4f"], "m33"))
def test_each_machine_has_the_same_bits(healthy: list[str], machine: str, tmp_path: Path) -> None:
    assert run(machine, build(machine, tmp_path), "healthy", shift=1 if machine == "m3" else 2) == healthy
