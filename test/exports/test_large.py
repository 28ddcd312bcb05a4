# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A network of four layers of 256 neurons through every export: time, size and memory; make python-long."""

from __future__ import annotations

import itertools
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from lag import lag

FORMATS = {"fmu3": ("big.fmu",), "fmu2": ("big.fmu",), "modelica": ("big.mo",), "ssp": ("big.ssp",), "efmu": ("big.fmu",)}


def write_model(folder: Path) -> Path:
    """Some 198 000 parameters, drawn."""
    rng = np.random.default_rng(1)
    widths = (1, 256, 256, 256, 256, 1)
    layers = [
        {
            "activation": "relu" if n_out > 1 else "identity",
            "weights": (rng.standard_normal((n_out, n_in)) / 16).tolist(),
            "bias": [0.0] * n_out,
        }
        for n_in, n_out in itertools.pairwise(widths)
    ]
    (folder / "big.json").write_text(json.dumps({"layers": layers}))
    (folder / "big.toml").write_text(lag("big", "big.json"))
    return folder / "big.toml"


@pytest.mark.long
@pytest.mark.parametrize("name", FORMATS)
def test_a_large_network(tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """At most 10 s of processor time (compilers and start of Python included), 20 MB and 500 MB of memory."""
    if name == "efmu":
        pytest.importorskip("rumoca", reason="rumoca, which has the schemas, is not installed: pip install penode[efmu]")
    output = tmp_path / FORMATS[name][0]
    command = [sys.executable, "-m", "penode_sil", "export", str(write_model(tmp_path)), "--format", name, "-o", str(output)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)  # of the process and of those that it waited for
    process.returncode = os.waitstatus_to_exitcode(status)
    seconds, size, memory = used.ru_utime + used.ru_stime, output.stat().st_size / 1e6, used.ru_maxrss / 1e3
    with capsys.disabled():
        print(f"{name}: {seconds:.1f} s, {size:.1f} MB, {memory:.0f} MB of memory")
    assert process.returncode == 0 and seconds <= 10.0 and size <= 20.0 and memory <= 500.0
