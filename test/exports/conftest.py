# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What the tests of exports share: the case study's model, and a variant with held inputs to compare with."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

import pytest

import penode_gen

sys.path.insert(0, str(Path(__file__).parent / "fmu"))
sys.path.insert(0, str(Path(__file__).parent))

from case_study import NQVM  # needs the paths above

if importlib.util.find_spec("fmpy") is None:
    collect_ignore = ["test_fmu.py", "test_fmu_derivatives.py", "test_fmu_long.py"]


def pytest_report_header() -> str:
    """A line where tests are missing."""
    return "" if importlib.util.find_spec("fmpy") else "FMPy is not installed: nothing is checked about FMUs (pip install penode[fmi])"


@pytest.fixture(scope="session")
def nqvm() -> Any:
    return penode_gen.load(NQVM)


@pytest.fixture(scope="session")
def held(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The same model with inputs held between samples."""
    path = tmp_path_factory.mktemp("held") / "held.toml"
    path.write_text(f'[model]\nextends = "{NQVM}"\nname = "nqvm_held"\ninput = "held"\n')
    return penode_gen.load(path)


@pytest.fixture(scope="session", params=[3, 2], ids=["FMI 3", "FMI 2"])
def unpacked(request: pytest.FixtureRequest, nqvm: Any, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Its FMU of either version, in a folder; tests leave it as it is."""
    from master import Unpacked, export

    folder = tmp_path_factory.mktemp("fmu")
    return Unpacked(export(nqvm, request.param, folder), folder / "unpacked")


@pytest.fixture(scope="session")
def efmu(nqvm: Any, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The files of its eFMU, without eFMU/."""
    from efmu_container import contents, export

    pytest.importorskip("rumoca", reason="rumoca, which has the schemas, is not installed: pip install penode[efmu]")
    return contents(export(nqvm, tmp_path_factory.mktemp("efmu")))


@pytest.fixture(scope="session")
def production(efmu: dict[str, bytes], tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Makes instances of its Production Code, in a number type; each is compiled once."""
    from efmu_instance import Production

    folders: dict[type, Path] = {}

    def made(real: type) -> Any:
        if real not in folders:
            folders[real] = tmp_path_factory.mktemp("code")
        return Production(efmu, real, folders[real])

    return made
