# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The wheel with other interpreters, as far as they are installed here, and the packages for them: make pythons."""

from __future__ import annotations

import filecmp
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from wheels import ROOT, install

OTHERS = [v for v in ("3.11", "3.12", "3.13", "3.14") if v != f"{sys.version_info.major}.{sys.version_info.minor}"]


@pytest.mark.parametrize("version", OTHERS)
def test_another_python(version: str, wheel: Path, repository: Path, tmp_path: Path) -> None:
    """Its C, its run and its FMU have the bits of the repository."""
    python = shutil.which(f"python{version}")
    if python is None or subprocess.run([python, "--version"], capture_output=True).returncode:
        pytest.skip(f"python{version} is not installed")
    packages = ROOT / "build" / "pythons" / version / "lib" / f"python{version}" / "site-packages"
    if not packages.exists():
        pytest.skip(f"python{version} has not the packages that penode needs: make pythons")
    installed = install(wheel, tmp_path, python, str(packages))
    answers = installed.session(
        {
            "generate": ["generate", "nqvm.toml", "-o", "c"],
            "simulate": ["simulate", "nqvm.toml", "--scenario", "exchange.toml", "--on", "sil", "-o", "sil.csv"],
            "export": ["export", "nqvm.toml", "--format", "fmu3", "-o", "nqvm.fmu3.fmu"],
        }
    )
    assert Path(answers["imported"]["penode_gen"]).is_relative_to(tmp_path / "venv" / "lib" / f"python{version}")
    for name, answer in answers["commands"].items():
        assert not answer["error"], f"{name}: {answer['error']}"
    for path in (installed.place / "c").iterdir():
        assert filecmp.cmp(path, ROOT / "gen" / "nqvm" / "c" / path.name, shallow=False), path.name
    for name in ("sil.csv", "nqvm.fmu3.fmu"):
        assert (installed.place / name).read_bytes() == (repository / name).read_bytes(), name
