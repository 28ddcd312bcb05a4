# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Names of a model file that are also those of an eFMU's own things: identifiers of its manifests, columns of its tables, words of its
C."""

from __future__ import annotations

import subprocess
from pathlib import Path
from xml.etree import ElementTree

import pytest
from efmu_container import SCHEMAS, contents, export, problems, unmapped

import penode_gen

LAG = """[model]
name = "m"
sample_time = "1 ms"
method = "heun"
[inputs]
{u} = {{ unit = "m" }}
[parameters]
{T} = {{ value = 1, unit = "s", tunable = true }}
[states]
{x} = {{ unit = "m", start = 0.5 }}
[equations]
lag = "der({x})*{T} = {u} - {x}"
[outputs]
{y} = {{ value = "{x}", unit = "m" }}
"""


def lag(folder: Path, u: str = "u", T: str = "T", x: str = "x", y: str = "y") -> dict[str, bytes]:
    """The container of a lag with these names."""
    path = folder / "m.toml"
    path.write_text(LAG.format(u=u, T=T, x=x, y=y))
    return contents(export(penode_gen.load(path), folder))


@SCHEMAS
@pytest.mark.parametrize(
    "names",
    [{"u": "clock", "y": "ErrorSignalStatus"}, {"u": "AlgorithmCode", "T": "recalibration", "y": "sweep"}],
    ids=lambda names: " ".join(names.values()),
)
def test_identifiers_of_the_manifests_are_clear_of_names(tmp_path: Path, names: dict[str, str]) -> None:
    files = lag(tmp_path, **names)
    assert problems(files) == [] and unmapped(files, "ProductionCode_32bit") == []


@SCHEMAS
def test_a_signal_called_time_has_a_column_of_its_own(tmp_path: Path) -> None:
    files = lag(tmp_path, u="time")
    header = files["BehavioralModel/sweep.csv"].split(b"\n", 1)[0].decode().split(",")
    mapping = ElementTree.fromstring(files["BehavioralModel/manifest.xml"]).find("CsvMappings/CsvMapping")
    assert mapping is not None and len(set(header)) == 3
    assert [c.get("columnName") for c in mapping.iter() if c.get("columnName")] == header and header[1] == "time"


@SCHEMAS
@pytest.mark.parametrize(
    "names",
    [{"u": "NONFINITE", "T": "FIRST_SET", "x": "REFUSED", "y": "first_set"}, {"u": "refused", "T": "T", "x": "known", "y": "report"}],
    ids=["capitals", "locals"],
)
def test_names_of_the_c_around_the_model_are_clear_of_names(tmp_path: Path, names: dict[str, str]) -> None:
    """Every macro that the wrapper defines starts with the block's own prefix, which no name of a model file has; it compiles without a
    warning."""
    for name, data in lag(tmp_path, **names).items():
        if name.startswith("ProductionCode_32bit/"):
            (tmp_path / Path(name).name).write_bytes(data)
    subprocess.run(
        ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-Wconversion", "-Wshadow", "-pedantic", "-fsyntax-only", "m_efmu.c"],
        cwd=tmp_path,
        check=True,
    )
