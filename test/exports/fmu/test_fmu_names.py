# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Names of the variables of an FMU where the model file uses one twice."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("fmpy", reason="FMPy is not installed: pip install penode[fmi]")

from fmpy.validation import validate_fmu
from master import Master, Unpacked, export

import penode_gen

STEP = 1e-3


def test_a_sensor_with_the_name_of_an_output(tmp_path: Path) -> None:
    """Both are there: the sensor as sensor.NAME, as in an A2L."""
    path = tmp_path / "same.toml"
    path.write_text(
        '[model]\nname = "same"\nsample_time = "1 ms"\n[inputs]\nu = { unit = "m" }\n[states]\nx = { unit = "m" }\n'
        '[parameters]\nT = { value = 0.1, unit = "s" }\n[equations]\nq = "der(x) = (u - x)/T"\n'
        '[outputs]\nx = { value = "x", unit = "m" }\n[sensors]\nx = { value = "x", unit = "m" }\nz = { value = "x - u", unit = "m" }\n'
    )
    fmu = export(penode_gen.load(path), 2, tmp_path)
    assert validate_fmu(str(fmu)) == []
    master = Master(Unpacked(fmu, tmp_path / "unpacked")).initialise(u=1.0)
    master.step(STEP)
    assert master.get("x") == master.get("sensor.x") > 0.0 and master.get("z") == pytest.approx(master.get("x") - 1.0)
