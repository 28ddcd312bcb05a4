# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Rows at uneven intervals, and rows that are lost: what of them is a measurement, and what drives a model between them."""

from __future__ import annotations

import re

import numpy as np
import pytest

from penode_sil.errors import UserError
from penode_sil.recordings import on_raster, read
from penode_sil.recordings.look import look
from penode_sil.recordings.measured import load
from penode_sil.recordings.uneven import held_rows, joined, longest, measured_near

STEP, N = 1e-3, 8000  # of the model
SIZE = {"foot": 10.0, "z": 12.0}  # mm
NOISE = 0.02  # mm


def foot(time):
    return SIZE["foot"] * np.sin(2.0 * np.pi * 9.0 * time + 1.0)


def z(time):
    return SIZE["z"] * np.sin(2.0 * np.pi * 9.0 * time + 0.7)


def jittered(jitter: float, lost: float = 0.0) -> np.ndarray:
    """Instants with intervals of STEP (1 +- jitter), or, beyond 1, stamps that are early and late by up to half of it; some are lost."""
    draw = np.random.default_rng(round(100 * jitter + 10 * lost) + 3)
    if jitter <= 1.0:
        time = np.cumsum(STEP * (1.0 + jitter * draw.uniform(-0.999, 1.0, N)))
    else:
        time = np.sort(STEP * (np.arange(N) + 0.5 * jitter * draw.uniform(-1.0, 1.0, N)))
    return time[draw.random(N) >= lost]


CLOCKS = {f"jitter {j:g}, lost {lost:g}": jittered(j, lost) for j in (0.1, 0.5, 1.0, 2.0) for lost in (0.0, 0.3)}
CLOCKS["as polled"] = np.cumsum(STEP * np.random.default_rng(2).exponential(1.0, N))
CLOCKS["lost"] = jittered(0.0, 0.3)
CLOCKS["one to three"] = np.cumsum(np.random.default_rng(1).choice([1e-3, 2e-3, 3e-3], N // 2))


def write(path, time, **columns):
    rows = np.column_stack([time, *columns.values()])
    names = ",".join(["time [s]", *(f"{name} [mm]" for name in columns)])
    path.write_text(names + "\n" + "".join(",".join(f"{x:.9g}" for x in row) + "\n" for row in rows))
    return path


@pytest.mark.parametrize("name", CLOCKS)
def test_uneven_rows_are_a_clock_like_any_other(tmp_path, oscillator, name):
    time = CLOCKS[name]
    noise = NOISE * np.random.default_rng(7).normal(size=time.size)
    (one,) = load([write(tmp_path / "r.csv", time, foot=foot(time), z=z(time) + noise)], oscillator)
    assert one.time.size > 0.98 * (time[-1] - time[0]) / STEP
    assert 1e3 * one.u[:, 0] == pytest.approx(foot(one.time), abs=0.03)  # of 10 mm
    off = (1e3 * one.z["z"] - z(one.time))[one.mask["z"]]
    cells = np.unique(np.rint((time - one.time[0]) / STEP)).size
    assert off.size > 0.8 * cells  # nearly each instant that has a row near it counts
    assert np.std(off) < 1.15 * NOISE  # and has the noise of a row
    follows = one.mask["z"][1:] & one.mask["z"][:-1]
    both = (1e3 * one.z["z"] - z(one.time))[1:][follows], (1e3 * one.z["z"] - z(one.time))[:-1][follows]
    assert abs(np.corrcoef(*both)[0, 1]) < 0.2  # of its own


def test_a_gap_among_uneven_rows_parts_the_recording(tmp_path, oscillator):
    time = CLOCKS["as polled"]
    some = time[(time < 3.0) | (time > 3.1)]
    parts = load([write(tmp_path / "r.csv", some, foot=foot(some), z=z(some))], oscillator)
    assert [p.part for p in parts] == [1, 2] and parts[0].time[-1] < 3.0 < parts[1].time[0]
    assert any(
        re.search(r"has a gap of 0\.1\d* s before that row \(rows are usually 0\.00\d+ s apart\); no", p) for p in parts[0].quality.problems
    )


def test_what_is_a_gap_follows_from_the_intervals():
    draw = np.random.default_rng(4)
    assert longest(np.r_[np.ones(1000), 3.0], 1.5) == 1.5  # one
    assert 6.0 < longest(draw.exponential(1.0, 5000), 4.5) < 18.0  # e^-14 of 5000 is none
    assert 4.5 < longest(np.diff(np.flatnonzero(draw.random(5000) > 0.3)).astype(float), 4.5) < 18.0  # a third is lost
    assert longest(np.r_[draw.exponential(1.0, 5000), np.full(20, 300.0)], 4.5) < 18.0


def test_steps_are_joined_by_lines_and_curves_by_curves():
    time = np.cumsum(np.random.default_rng(3).uniform(0.5, 1.5, 300))
    at = np.linspace(time[0], time[-1], 3000)
    square = np.sign(np.sin(0.3 * time))
    assert np.max(np.abs(joined(time, square, at))) <= 1.0  # no overshoot
    assert joined(time, np.sin(0.5 * time), at) == pytest.approx(np.sin(0.5 * at), abs=6e-3)  # lines: up to 0.07
    assert joined(time[:3], time[:3], at[:5]) == pytest.approx(at[:5])
    out, usable = measured_near(at, 0.1, np.array([time[0]]), np.array([2.0]), 1e-3)
    assert usable.sum() <= 1 and np.all(out == 2.0)


def test_uneven_rows_drive_a_simulation_too(tmp_path):
    for time in (CLOCKS["as polled"], CLOCKS["jitter 0.5, lost 0.3"], np.arange(N) * 0.9984e-3):
        path = write(tmp_path / "r.csv", time, foot=foot(time))
        raster, u, _ = on_raster(read(path), {"foot": "m"}, STEP)
        assert 1e3 * u[:, 0] == pytest.approx(foot(raster), abs=0.03)
    gap = time[(time < 3.0) | (time > 3.1)]
    with pytest.raises(UserError, match="has a gap"):
        on_raster(read(write(tmp_path / "r.csv", gap, foot=foot(gap))), {"foot": "m"}, STEP)


def test_inspect_says_that_rows_are_uneven(tmp_path):
    time = CLOCKS["as polled"]
    (table,) = look(write(tmp_path / "r.csv", time, foot=foot(time))).tables
    assert table.gaps == 0 and any(re.search(r"rows are unevenly 0\.0\d+ to 4\.\d+ ms apart", note) for note in table.notes)
    (table,) = look(write(tmp_path / "r.csv", np.arange(N) * STEP, foot=foot(np.arange(N) * STEP))).tables
    assert not table.notes


def test_a_row_beside_its_sample_rings_no_more_than_the_signal(tmp_path, oscillator):
    """Rows 0.16 % off the model's rate, and a signal that jumps: a low-pass would ring."""
    time = np.arange(N) * 0.9984e-3
    jump = np.where(np.sin(2.0 * np.pi * 0.8 * time) > 0.0, 10.0, -10.0)
    (one,) = load([write(tmp_path / "r.csv", time, foot=jump, z=jump)], oscillator)
    assert np.max(np.abs(one.u)) <= 0.010 * (1.0 + 1e-12)
    raster, u, _ = on_raster(read(one.path), {"foot": "m"}, STEP)  # as a simulation has it
    assert np.array_equal(raster, one.time) and u == pytest.approx(one.u, abs=1e-12)
    near = np.rint((one.time - time[0]) / 0.9984e-3).astype(int).clip(2, N - 3)
    calm = np.all([jump[near + k] == jump[near] for k in (-2, -1, 1, 2)], axis=0)
    assert 1e3 * one.z["z"][calm] == pytest.approx(jump[near][calm], abs=0.05) and one.mask["z"].mean() > 0.99


@pytest.mark.parametrize("jitter", [0.0, 0.003, 0.1])
def test_jitter_of_a_logger_delays_no_held_value(jitter):
    """Each row is that of its sample, also where the raster begins at a row that is early. A clock that is slower by a sixtieth is no
    jitter: there the last row counts that is not later."""
    time = STEP * (np.arange(N) + jitter * np.random.default_rng(4).uniform(-1.0, 1.0, N))
    assert (held_rows(time, time[0] + STEP * np.arange(N)) == np.arange(N)).all()
    assert held_rows(time, time[:1] - 0.4 * STEP)[0] == -1  # nothing is held yet
    slow = STEP * np.arange(N) * 61.0 / 60.0
    late = (raster := STEP * np.arange(N)) - slow[held_rows(slow, raster)]
    assert np.min(late) > -1e-3 * STEP and np.max(late) < 1.02 * STEP
