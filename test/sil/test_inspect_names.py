# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""`penode inspect` on columns that the names of a model do not tell apart."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from click.testing import CliRunner

from penode_sil import cli

MODEL = """[model]
name = "cart"
sample_time = "10 ms"
[parameters]
m = { value = 2.0, unit = "kg" }
d = { value = 0.5, unit = "N*s/m" }
[bodies]
cart = { mass = "m", position = "x", velocity = "v" }
[elements]
rail = { between = ["cart", "ground"], law = "linear_damper", damping = "d" }
[outputs]
x = { value = "x", unit = "mm" }
[sensors]
laser = { value = "x", unit = "mm" }
"""


@pytest.fixture
def inspected(tmp_path):
    """What `penode inspect` prints of a recording with this header, by lines, with a model whose output and sensor measure the same."""
    (tmp_path / "cart.toml").write_text(MODEL)

    def run(header: str, *options: str) -> list[str]:
        rows = "".join(f"{0.01 * k:.2f},{30.0 * math.cos(0.01 * k):.3f}\n" for k in range(300))
        Path(tmp_path / "run.csv").write_text(f"{header}\n{rows}", encoding="utf-8")
        done = CliRunner().invoke(cli.cli, ["inspect", str(tmp_path / "run.csv"), str(tmp_path / "cart.toml"), *options])
        assert done.exit_code == 0
        return [" ".join(line.split()) for line in done.output.splitlines()]

    return run


def test_an_output_does_not_compete_with_a_sensor_for_the_only_column_of_its_unit(inspected):
    lines = inspected("time [s],Weg [mm]")
    assert 'sensor laser [mm] not found; say --channel "laser=Weg" (the only one left with such a unit)' in lines
    assert "output x [mm] not found; an output need not be recorded" in lines
    assert lines[-1] == '--channel "laser=Weg"'


def test_a_unit_that_an_option_gives_holds_for_every_use_of_the_column(inspected):
    lines = inspected("time [s],x", "--channel", "laser=x [mm]")
    assert "sensor laser [mm] is x" in lines and "output x [mm] found" in lines


def test_a_remedy_is_printed_once(inspected):
    (line,) = (line for line in inspected("t,Weg [mm]") if line.startswith("time time"))
    assert line.count("--channel") == 1 and line.endswith('say --channel "time=t [s]"')


def test_a_signal_without_any_candidate_gets_the_form_of_the_option(inspected):
    assert 'sensor laser [mm] not found; say --channel "laser=COLUMN [UNIT]"' in inspected("time [s],pressure [bar]")
