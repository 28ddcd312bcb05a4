# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Behavioral Model of an eFMU: Production Code and Algorithm Code keep to its trajectories, also across the recalibration."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from efmu_container import SCHEMAS, contents, export
from efmu_instance import PRECISIONS, Scenario, play, scenarios
from galec import Block

import penode_gen
from penode_gen import exports
from penode_gen.sets import layout


class Algorithm(Block):
    """The Algorithm Code with the same interface."""

    def __getitem__(self, name: str) -> Any:
        return self.values[name]

    def __setitem__(self, name: str, value: float) -> None:
        self.values[name] = self.real(value)


def block(efmu: dict[str, bytes], real: type) -> Algorithm:
    return Algorithm(efmu["AlgorithmCode/block.alg"].decode(), real)


def check(name: str, tested: Any, real: type, efmu: dict[str, bytes], capsys: pytest.CaptureFixture[str]) -> None:
    found = scenarios(efmu, PRECISIONS[real])
    assert list(found) == ["sweep", "recalibration"]
    worst = {s: play(tested, found[s]).max() for s in ([name] if name else found)}
    with capsys.disabled():
        print(f"{type(tested).__name__}, {PRECISIONS[real]}: " + ", ".join(f"{s} {w:.3f}" for s, w in worst.items()) + " of the tolerance")
    assert max(worst.values()) <= 1.0


@pytest.mark.parametrize("real", [np.float32, np.float64], ids=["32 bit", "64 bit"])
def test_the_code_keeps_to_the_trajectories(
    efmu: dict[str, bytes], production: Any, real: type, capsys: pytest.CaptureFixture[str]
) -> None:
    """Up to the recalibration it is the sweep."""
    check("recalibration", production(real), real, efmu, capsys)


@pytest.mark.long
@pytest.mark.parametrize("real", [np.float32, np.float64], ids=["32 bit", "64 bit"])
def test_the_block_keeps_to_the_trajectories(efmu: dict[str, bytes], real: type, capsys: pytest.CaptureFixture[str]) -> None:
    check("", block(efmu, real), real, efmu, capsys)


def test_the_weights_change_at_two_seconds(nqvm: Any, efmu: dict[str, bytes]) -> None:
    """All that differ between the sets, and once; from the row of 2 s on."""
    scenario = scenarios(efmu, "64-bit")["recalibration"]
    changes = [(time, values) for time, _, values in scenario.rows() if values]
    assert [time for time, _ in changes] == [0.0, 2.0]
    first = 1 + len(scenario.stimuli) + len(scenario.outputs)
    for (_, values), chosen in zip(changes, ("default", "altered_friction"), strict=True):
        expected = penode_gen.set_values(nqvm, chosen, np.float64)
        arrays = {f"'{a.name}'": np.ravel(layout.gather(a, expected)) for a in layout.arrays(nqvm)}
        assert all(values[at - first] == arrays[name][index] for name, index, at in scenario.tuned)
    sets = [penode_gen.set_values(nqvm, chosen, np.float64) for chosen in ("default", "altered_friction")]
    changed = {f"'{a.name}'" for a in layout.arrays(nqvm) if not np.array_equal(*(layout.gather(a, s) for s in sets))}
    assert {name for name, *_ in scenario.tuned} == changed and len(scenario.tuned) > 500


def test_faults_of_a_recalibration_are_found(efmu: dict[str, bytes], production: Any) -> None:
    """Left out, a row too late, a matrix transposed; in 32 bit, whose tolerance is the larger one."""
    scenario, tested = scenarios(efmu, "32-bit")["recalibration"], production(np.float32)
    names = [name for name, *_ in scenario.tuned]
    rows, heads = [line.split(",", 4) for line in scenario.lines], 2000

    def with_tail(k: int, late: int) -> str:
        return ",".join([*rows[k][:4], rows[0][4] if k < heads + late else rows[heads][4]])

    turned = [(n, (i % 16) * 16 + i // 16 if n == "'damper_net.weights_2'" and i is not None else i, at) for n, i, at in scenario.tuned]
    assert "'damper_net.weights_2'" in names
    wrong: dict[str, Scenario] = {
        "left out": replace(scenario, lines=[with_tail(k, 1_000_000) for k in range(len(rows))]),
        "late": replace(scenario, lines=[with_tail(k, 10) for k in range(len(rows))]),
        "turned": replace(scenario, tuned=turned),
    }
    for name, s in wrong.items():
        assert play(tested, s).max() > 1.0, name


def small(folder: Path, more: str = "") -> Any:
    """A lag with a tunable time constant in two sets."""
    path = folder / "lag.toml"
    path.write_text(
        '[model]\nname = "lag"\nsample_time = "10 ms"\nmethod = "heun"\n[parameters]\n'
        'T = { value = 1, unit = "s", tunable = true }\n[inputs]\nu = { unit = "m" }\n'
        '[states]\nx = { unit = "m" }\n[equations]\nlag = "der(x)*T = u - x"\n[outputs]\ny = { value = "x", unit = "m" }\n'
        f'[sets.default]\n[sets.slow]\nT = "2 s"\n{more}'
    )
    return penode_gen.load(path)


@SCHEMAS
def test_other_times_sets_and_none(tmp_path: Path) -> None:
    """A scalar is tuned without an index; --recalibration names time and set; a model of one set has one scenario."""
    model = small(tmp_path)
    files = contents(export(model, tmp_path, recalibration="0.5:slow"))
    found = scenarios(files, "64-bit")
    assert [(t, v) for t, _, v in found["recalibration"].rows() if v] == [(0.0, [1.0]), (0.5, [2.0])]
    assert found["recalibration"].tuned == [("T", None, 3)]
    tested = block(files, np.float64)
    assert max(play(tested, s).max() for s in found.values()) <= 1.0
    assert list(scenarios(contents(export(model, tmp_path, recalibration="none")), "64-bit")) == ["sweep"]


@SCHEMAS
@pytest.mark.parametrize(
    ("asked", "line"),
    [
        ("2", "--recalibration: '2' is no exchange; write a time in seconds, a colon and a set, such as 2.5:default"),
        ("2:fast", "--recalibration: the model file has no set 'fast'; use one of: default, slow"),
        ("0.505:slow", "--recalibration: 0.505 s is no multiple of the sample time"),
        (
            "1:slow, 2:default",
            "--recalibration: '1:slow, 2:default' is not one exchange; write a time in seconds, a colon and a set, or none",
        ),
        ("0:slow", "--recalibration: '0:slow' is at the start, before any sample; choose a later time"),
        ("", "--recalibration: '' is not one exchange"),
        ("50000:slow", "--recalibration: a table of 5000051 samples with 1 numbers each is too large; choose an earlier time, or none"),
    ],
)
def test_what_is_no_recalibration_is_one_line(tmp_path: Path, asked: str, line: str) -> None:
    with pytest.raises(exports.ExportError) as found:
        export(small(tmp_path), tmp_path, recalibration=asked)
    assert len(found.value.problems) == 1 and found.value.problems[0].startswith(line)
