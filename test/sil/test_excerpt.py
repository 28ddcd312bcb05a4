# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What is taken of long recordings: bounded, the stretches that tell most, the rest to test on."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import penode_gen
from penode_sil.cli import cli
from penode_sil.recordings import excerpt
from penode_sil.recordings.excerpt import LENGTH, MOST, excerpted
from penode_sil.recordings.measured import Measured, Quality, load


def recording(size: np.ndarray, name: str = "long.csv") -> Measured:
    """An input and a sensor of these sizes, one for each LENGTH samples."""
    draw = np.random.default_rng(0)
    scale = np.repeat(size, LENGTH)
    n = scale.size
    u, z = scale * draw.normal(size=n), scale * draw.normal(size=n)
    good = np.ones(n, dtype=bool)
    return Measured(Path(name), 0, np.arange(n) * 1e-3, u[:, None], {"z": z}, {"z": good}, {"z": good}, ~good, Quality({}, ()), n)


def test_short_recordings_stay_as_they_are():
    m = recording(np.ones(MOST // LENGTH))
    train, held = excerpted([m], [m])
    assert (train[0], held[0]) == (m, m)


def test_motion_is_learnt_from_and_the_rest_is_tested_on():
    """Six stretches among sixty move; learnt from are these, and each sample is used at most once."""
    moving = np.arange(3, 60, 10)
    size = np.full(60, 0.01)
    size[moving] = 1.0
    m = recording(size)
    train, held = excerpted([m], [])
    assert sum(t.time.size for t in train) <= MOST
    assert sum(h.time.size for h in held) <= MOST
    begins = {round(float(t.time[0]) * 1e3) // LENGTH for t in train}
    assert begins <= set(moving)
    assert len(begins) == (MOST - 1) // LENGTH or len(begins) == MOST // LENGTH
    learnt = np.concatenate([t.time for t in train])
    assert not set(np.round(learnt * 1e3)) & set(np.round(np.concatenate([h.time for h in held]) * 1e3))
    for t in train:
        first = round(float(t.time[0]) * 1e3)
        assert np.array_equal(t.z["z"], m.z["z"][first : first + t.time.size])
        assert t.u.shape == (t.time.size, 1)
    parts = [m.part for m in (*train, *held)]
    assert parts == list(range(1, len(parts) + 1))  # their titles are keys
    said = train[0].quality.problems
    assert len(said) == 2
    assert f"of {m.time.size} samples are used for training" in said[0]
    assert "not used for training are used for testing" in said[1]


def test_a_given_hold_out_is_thinned_over_its_length():
    m = recording(np.ones(40))
    train, held = excerpted([recording(np.ones(2), "short.csv")], [m])
    assert train[0].time.size == 2 * LENGTH
    assert sum(h.time.size for h in held) <= MOST
    assert len(held) == MOST // LENGTH
    assert held[0].time[0] == 0.0
    assert held[-1].time[-1] > 0.9 * m.time[-1]
    assert {h.path.name for h in held} == {"long.csv"}


def test_sensors_that_only_some_recordings_have():
    a, b = recording(np.ones(10), "a.csv"), recording(np.ones(10), "b.csv")
    b = replace(b, z={}, mask={}, shown={})
    train, _ = excerpted([a, b], [])
    assert {t.path.name for t in train} == {"a.csv", "b.csv"} or all(t.z for t in train)


@pytest.mark.parametrize("n", [LENGTH // 3, LENGTH, 5 * LENGTH + 17])
def test_stretches_cover_all_samples(n):
    m = recording(np.ones(6))
    m = replace(m, time=m.time[:n])
    cut = excerpt._cut([m])
    assert [s.begin for s in cut] == [0, *(s.end for s in cut[:-1])]
    assert cut[-1].end == n


def test_figures_of_a_part_are_those_of_its_own_samples(tmp_path, monkeypatch):
    """What is learnt from does not count as hold-out: errors of the rows that `penode simulate` writes, over the times of each part."""
    monkeypatch.setattr(excerpt, "LENGTH", 400)
    monkeypatch.setattr(excerpt, "MOST", 2000)
    folder = Path(__file__).resolve().parents[2] / "sil" / "recordings" / "friction"
    data, out = folder / "train.csv", tmp_path / "out"

    def call(*words: object) -> str:
        return CliRunner().invoke(cli, [str(w) for w in words], catch_exceptions=False).stdout

    found = json.loads(call("diagnose", folder / "model.toml", "--data", data, "-o", out, "--json"))
    options = found["simulated"].split() if isinstance(found["simulated"], str) else []
    call("simulate", out / "model_extended.toml", "--input", data, "-o", tmp_path / "p.csv", *options)
    with (tmp_path / "p.csv").open() as file:
        rows = list(csv.DictReader(file))
    time = np.array([float(r["time [s]"]) for r in rows])
    parts = excerpted(load([data], penode_gen.load(folder / "model.toml")), [])
    title = {m.title: m for some in parts for m in some}
    assert {f["recording"] for f in found["figures"]} == set(title) and len(parts[1]) > 0
    for f in found["figures"]:
        m, own = title[f["recording"]], next(k for k in rows[0] if k.startswith(f"{f['signal']} ["))
        predicted = np.interp(m.time, time, [float(r[own]) for r in rows])
        error = (m.z[f["signal"]] - predicted)[m.mask[f["signal"]]]
        assert f["extended"] == pytest.approx(float(np.sqrt(np.mean(error**2))), rel=1e-4)  # of nine digits, and samples beside a burst
        assert f["samples"] == error.size
