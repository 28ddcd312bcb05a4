# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""sil/CALIBRATION.md, command by command: each prints what the page says."""

from __future__ import annotations

import importlib.util
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from penode_sil.calibration.virtual import free_port
from penode_sil.cli import cli

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "sil" / "CALIBRATION.md").read_text(encoding="utf-8")

pytestmark = pytest.mark.skipif(
    not (importlib.util.find_spec("pyxcp") and importlib.util.find_spec("elftools")),
    reason="pyxcp or pyelftools is not installed: pip install penode[xcp]",
)


def steps(port: int) -> Iterator[tuple[list[str], str]]:
    """Each command that the page shows the output of, and that output; all at one port."""
    text = PAGE.replace("5555", str(port)).replace("gen/nqvm", str(ROOT / "gen/nqvm")).replace("sil/scenarios", str(ROOT / "sil/scenarios"))
    for command, output in re.findall(r"^    penode ([^\n]*)\n\n```text\n(.*?)```", text, re.M | re.S):
        yield shlex.split(command), output


def test_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from asammdf import MDF

    monkeypatch.chdir(tmp_path)
    port = free_port("127.0.0.1", False)
    (serve, first), *others = steps(port)
    assert serve[0] == "serve" and len(others) == 6
    with subprocess.Popen([sys.executable, "-m", "penode_sil", *serve], cwd=tmp_path, stdout=subprocess.PIPE, text=True) as controller:
        try:
            assert controller.stdout and controller.stdout.readline() == first
            for command, output in others:
                done = CliRunner().invoke(cli, command, catch_exceptions=False, standalone_mode=False)
                assert done.exception is None
                expected = re.escape(output).replace(r"\ N\ ", r"\ [\d.]+\ ").replace("N\\ ", r"[\d.]+\ ")
                assert re.fullmatch(expected, done.stdout), done.stdout
        finally:
            controller.terminate()
    assert (tmp_path / "nqvm.a2l").stat().st_size > 0
    with MDF(tmp_path / "change.mf4") as log:
        ids, sample, z_b = (log.get(name) for name in ("set_in_force", "sample", "z_b"))
    assert z_b.unit == "m" and np.count_nonzero(np.diff(ids.samples)) == 1 and set(ids.samples) == {1, 1000}
    assert (np.diff(sample.samples.astype(int)) == 1).all()
