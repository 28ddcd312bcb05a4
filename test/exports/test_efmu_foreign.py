# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
eFMU and what others made: the schemas of Dymola, and the public compliance checker of the Modelica Association.

EFMI_DIR names a folder with either or both: schemas of an eFMU of Dymola (a folder with efmiContainerManifest.xsd), a checkout of
efmi-compliancechecker, and for it a Python environment venv/ with lark-parser 0.12, lxml, numpy and colorama.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from case_study import ROOT
from efmu_container import SCHEMAS as WITH_SCHEMAS, Schemas, contents, export, problems, unmapped
from efmu_instance import FOLDERS

import penode_gen
from penode_gen.exports.archive import zipped

sys.path.append(str(ROOT / "test" / "gen"))
from models import BARE, network_file  # needs the path above

EFMI = Path(os.environ["EFMI_DIR"]) if os.environ.get("EFMI_DIR") else None
SCHEMAS = (
    next((p.parent for p in sorted(EFMI.rglob("efmiContainerManifest.xsd")) if 'fixed="0.10.0"' in p.read_text(encoding="utf-8-sig")), None)
    if EFMI
    else None
)
pytestmark = WITH_SCHEMAS
CHECKER = next((p.parent for p in sorted(EFMI.rglob("ComplianceChecker.py"))), None) if EFMI else None


@pytest.mark.skipif(SCHEMAS is None, reason="EFMI_DIR names no folder with the schemas of an eFMU of Dymola (container 0.10.0)")
def test_the_dialect_of_dymola(nqvm: Any, tmp_path: Path) -> None:
    """Valid against its own schemas; the Algorithm Code is that of the other dialect."""
    files = contents(export(nqvm, tmp_path, dialect="dymola", schemas=str(SCHEMAS)))
    assert problems(files) == [] and Schemas(files, tmp_path).errors_of_all(files) == []
    assert [unmapped(files, folder) for folder in FOLDERS.values()] == [[], []]
    assert Schemas(files, tmp_path).errors(
        "AlgorithmCode", files["AlgorithmCode/manifest.xml"].replace(b'xsdVersion="0.13.0"', b'xsdVersion="0.14.0"')
    )


def check(files: dict[str, bytes], folder: Path) -> tuple[int, str]:
    """Return code and text of the checker, which keeps working files beside itself: a copy, in which Python's mode rU, gone since 3.11, is
    r."""
    assert CHECKER is not None and EFMI is not None
    program = folder / "checker"
    if not program.exists():
        shutil.copytree(CHECKER, program)
        for path in program.rglob("*.py"):
            path.write_text(path.read_text(encoding="utf-8").replace('mode="rU"', 'mode="r"'), encoding="utf-8")
    (folder / "checked.fmu").write_bytes(zipped({f"eFMU/{name}": data for name, data in files.items()}))
    command = [str(EFMI / "venv" / "bin" / "python"), "main.py", str(folder / "checked.fmu")]
    done = subprocess.run(command, cwd=program, capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=1200)
    return done.returncode, done.stdout + done.stderr


RUNS = pytest.mark.skipif(
    CHECKER is None or EFMI is None or not (EFMI / "venv" / "bin" / "python").exists(),
    reason="EFMI_DIR names no checkout of efmi-compliancechecker with a venv/ beside it",
)


@RUNS
@pytest.mark.long
@pytest.mark.parametrize(
    "dialect", ["beta1", pytest.param("dymola", marks=pytest.mark.skipif(SCHEMAS is None, reason="EFMI_DIR has no schemas of Dymola"))]
)
def test_the_public_checker_accepts_it(nqvm: Any, tmp_path: Path, dialect: str) -> None:
    """Judged by its return code. Half a minute of processor time for 26 KB of weights."""
    schemas = {"schemas": str(SCHEMAS)} if dialect == "dymola" else {}
    code, text = check(contents(export(nqvm, tmp_path, dialect=dialect, recalibration="0.1:altered_friction", **schemas)), tmp_path)
    assert code == 0, text[-2000:]


@RUNS
@pytest.mark.long
def test_the_public_checker_finds_faults(tmp_path: Path) -> None:
    """In a small model: a name, a declaration, a statement."""
    network_file(tmp_path / "net.json", [2, 3, 1], ["relu", "identity"], 1)
    (tmp_path / "bare.toml").write_text(
        BARE.format(outside="extrapolate", inputs='a = { unit = "1" }\nb = { unit = "1" }', units=["1", "1"], names="a, b")
    )
    files = contents(export(penode_gen.load(tmp_path / "bare.toml"), tmp_path))
    assert check(files, tmp_path)[0] == 0
    block = files["AlgorithmCode/block.alg"]
    for old, new in ((b"self.y := 0.0;", b"self.z := 0.0;"), (b"input Real b;", b"input Real c;"), (b"1:3 loop", b"1: loop")):
        assert old in block and check(files | {"AlgorithmCode/block.alg": block.replace(old, new)}, tmp_path)[0] != 0
