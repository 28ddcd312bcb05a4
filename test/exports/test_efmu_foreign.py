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
from pathlib import Path
from typing import Any

import pytest
from efmu_container import SCHEMAS as WITH_SCHEMAS
from efmu_container import Schemas, contents, export, problems, unmapped
from efmu_instance import FOLDERS

from penode_gen.exports.archive import zipped

EFMI = Path(os.environ["EFMI_DIR"]) if os.environ.get("EFMI_DIR") else None
SCHEMAS = next((p.parent for p in sorted(EFMI.rglob("efmiContainerManifest.xsd")) if 'fixed="0.10.0"' in p.read_text(encoding="utf-8-sig")), None) if EFMI else None
pytestmark = WITH_SCHEMAS
CHECKER = next((p.parent for p in sorted(EFMI.rglob("ComplianceChecker.py"))), None) if EFMI else None


@pytest.mark.skipif(SCHEMAS is None, reason="EFMI_DIR names no folder with the schemas of an eFMU of Dymola (container 0.10.0)")
def test_the_dialect_of_dymola(nqvm: Any, tmp_path: Path) -> None:
    """Valid against its own schemas; the Algorithm Code is that of the other dialect."""
    files = contents(export(nqvm, tmp_path, dialect="dymola", schemas=str(SCHEMAS)))
    assert problems(files) == [] and Schemas(files, tmp_path).errors_of_all(files) == []
    assert [unmapped(files, folder) for folder in FOLDERS.values()] == [[], []]
    assert Schemas(files, tmp_path).errors("AlgorithmCode", files["AlgorithmCode/manifest.xml"].replace(b'xsdVersion="0.13.0"', b'xsdVersion="0.14.0"'))


def check(files: dict[str, bytes], folder: Path) -> tuple[int, str]:
    """Return code and text of the checker, which keeps working files beside itself: a copy, in which Python's mode rU, gone since 3.11, is r."""
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


@pytest.mark.long
@pytest.mark.skipif(CHECKER is None or not (EFMI / "venv" / "bin" / "python").exists(), reason="EFMI_DIR names no checkout of efmi-compliancechecker with a venv/ beside it")  # type: ignore[operator]
@pytest.mark.parametrize("dialect", ["beta1", pytest.param("dymola", marks=pytest.mark.skipif(SCHEMAS is None, reason="EFMI_DIR has no schemas of Dymola"))])
def test_the_public_checker_accepts_it(nqvm: Any, tmp_path: Path, dialect: str) -> None:
    """Judged by its return code, which is another one for a fault in a type, a shape and a name."""
    files = contents(export(nqvm, tmp_path, dialect=dialect, recalibration="0.1:altered_friction", **({"schemas": str(SCHEMAS)} if dialect == "dymola" else {})))
    code, text = check(files, tmp_path)
    assert code == 0, text[-2000:]
    block = files["AlgorithmCode/block.alg"]
    for old, new in ((b"self.z_b := 0.0;", b"self.z_c := 0.0;"), (b"Real z_road;\n  output", b"Real z_street;\n  output"), (b"s in 1:4", b"s in 1:4:")):
        assert old in block and check(files | {"AlgorithmCode/block.alg": block.replace(old, new)}, tmp_path)[0] != 0
