# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Time of FMUs: masters that add it up, far from zero, for long; the stop time; what a step costs."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import pytest
from native import Native, build, counter

import penode_gen
from penode_gen.model import Model

NQVM = Path(__file__).resolve().parents[3] / "gen" / "nqvm"
UNIX = 1.7e9  # s: seconds since 1970, which some masters start at
FLOAT = 0.001000000047497451  # s: 1 ms as a float


@pytest.fixture(scope="module", params=[3, 2], ids=["FMI 3", "FMI 2"])
def counting(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Native:
    folder = tmp_path_factory.mktemp("counter")
    return build(counter(folder), request.param, folder, "double")


@pytest.mark.parametrize(
    ("kind", "start", "size", "samples", "steps"),
    [
        ("add", 1e6, 1e-3, 1, 10**7),
        ("add", 0.0, FLOAT, 1, 10**6),
        ("add", UNIX, 3e-3, 3, 10**6),
        ("grid", 0.0, 1e-3, 1, 10**6),
        ("grid", 1e6, 1e-2, 10, 10**5),
        ("grid", UNIX, 1e-3, 1, 10**6),
        ("differences", 1e7, 1e-3, 1, 10**6),
        ("differences", UNIX, 1e-3, 1, 10**6),
    ],
)
def test_masters_that_keep_time_are_never_refused(counting: Native, kind: str, start: float, size: float, samples: int, steps: int) -> None:
    """However a master comes by its time, each step is one of as many samples as it is long."""
    assert counting.count(kind, start, size, samples, steps) == (0, 0)


@pytest.mark.parametrize("start", [0.0, 1e6, UNIX])
@pytest.mark.parametrize("size", [1.5e-3, 0.5e-3, 1.02e-3, 0.98e-3])
def test_a_step_of_a_wrong_size_is_refused_wherever_it_starts(counting: Native, start: float, size: float) -> None:
    assert counting.count("add", start, size, 1, 10)[0] == 10


def test_a_step_that_is_slightly_wrong_is_refused_once_that_adds_up(counting: Native) -> None:
    """0.1 % too long: after ten steps the master is a hundredth of a sample ahead."""
    (refused, _) = counting.count("add", 0.0, 1.001e-3, 1, 100)
    assert refused in (89, 90)


@pytest.mark.parametrize("version", [3, 2])
@pytest.mark.parametrize("name", ["nqvm", "nqvm_euler"])
def test_a_step_costs_little_more_than_plain_c(name: str, version: int, tmp_path: Path) -> None:
    """Steps alone: derivatives and sensors are computed when they are asked for. The median of pairs that are timed in turn."""
    native = build(penode_gen.load(NQVM / f"{name}.toml"), version, tmp_path)
    (ratio,) = native.numbers("cost", "z_road", 1000)
    assert ratio <= 1.3


@pytest.fixture(scope="module")
def slow(tmp_path_factory: pytest.TempPathFactory) -> Model:
    return counter(tmp_path_factory.mktemp("slow"))


@pytest.mark.skipif(importlib.util.find_spec("fmpy") is None, reason="FMPy is not installed")
@pytest.mark.parametrize("version", [3, 2])
def test_the_stop_time_is_not_passed(slow: Model, version: int, tmp_path: Path) -> None:
    """As both standards say: a step beyond a stop time that was defined is an error. Without one there is no end."""
    from fmpy.fmi1 import FMICallException
    from master import ERROR, Master, Unpacked, export

    unpacked = Unpacked(export(slow, version, tmp_path), tmp_path / "unpacked")

    def begun(start: float, stop: float | None) -> Any:
        master = Master(unpacked, start_time=start)
        if version == 3:
            master.fmu.enterInitializationMode(startTime=start, stopTime=stop)
        else:
            master.fmu.setupExperiment(startTime=start, stopTime=stop)
            master.fmu.enterInitializationMode()
        master.fmu.exitInitializationMode()
        return master

    for start in (0.0, UNIX):
        master = begun(start, start + 0.005)
        for k in range(5):
            master.fmu.doStep(start + k * 1e-3, 1e-3)
        assert master.get("samples") == 5
        with pytest.raises(FMICallException) as late:
            master.fmu.doStep(start + 0.005, 1e-3)
        assert late.value.status == ERROR and "but the stop time is" in master.log[-1][2]
        assert master.get("samples") == 5 and master.get("time") == pytest.approx([start + 0.005], rel=1e-15)
        master.fmu.terminate()
        master.fmu.reset()
        again = begun(start, None)
        for k in range(10):
            again.fmu.doStep(start + k * 1e-3, 1e-3)
    for start, stop in ((1.0, 0.5), (0.0, float("nan")), (float("inf"), None)):
        with pytest.raises(FMICallException):
            begun(start, stop)
