# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The example firmware under emulation: interrupt, chunks from the main loop, status line, exit code 0."""

from __future__ import annotations

import os
import re
import shutil
import subprocess

import pytest
from places import ROOT
from samples import sample

from penode_sil.building import generated
from penode_sil.targets import MACHINES


@pytest.mark.parametrize("machine", sample([name for name, board in MACHINES.items() if board], "m3", "m4f", "m33"))
def test_example_recalibrates_under_a_timer_interrupt(nqvm, machine, tmp_path, show):
    for program in ("qemu-system-arm", "arm-none-eabi-gcc"):
        if shutil.which(program) is None:
            pytest.skip(f"{program} is not installed; make test installs it")
    source, port, elf = generated(nqvm), ROOT / "port" / "cortex-m", tmp_path / "example.elf"
    files = [ROOT / "sil" / "firmware" / "example.c", source / "nqvm.c", source / "nqvm_params.c", *sorted((ROOT / "src").glob("*.c"))]
    subprocess.run(
        [port / "cc", MACHINES[machine], "-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", f"-I{source}", *files, "-o", elf], check=True
    )
    # 2 ns an instruction: a millisecond holds 500 000, a step on the M3 takes 300 000
    environment = os.environ | {"SHIFT": "1", "LIMIT": "30"}
    result = subprocess.run(
        [port / "run", MACHINES[machine], elf], env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    if machine == "m4f":
        for line in result.stdout.splitlines():
            show(line)
    assert result.returncode == 0, result.stdout
    lines = result.stdout.splitlines()
    # 100 samples, then 75 frames of 16 values, one a millisecond
    first = int(re.fullmatch(r"set 2 received in chunks, adopted at sample (\d+)", lines[0])[1])
    assert 175 <= first <= 185
    assert re.fullmatch(r"set 1 back by rollback at sample \d+", lines[1])
    assert re.fullmatch(r"set 2 selected in flash at sample \d+", lines[2])
    held = int(re.fullmatch(r"status: \d+ samples, held (\d+), sets adopted 3, flags 0x[0-9a-f]{8}", lines[3])[1])
    assert 4 <= held <= 7
    assert lines[4:] == ["example: good"]
