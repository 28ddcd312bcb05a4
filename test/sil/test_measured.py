# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Recordings with seeded trouble: good samples pass, others are masked, and every fault is reported."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

import penode_gen
from penode_sil.errors import UserError
from penode_sil.recordings.measured import load, with_shared_rails

N = 8000
T = np.round(np.arange(N) * 1e-3, 6)
DRAW = np.random.default_rng(3)
FOOT = 10.0 * np.sin(2.0 * np.pi * 1.5 * T + 1.0)  # mm
Z = 12.0 * np.sin(2.0 * np.pi * 1.5 * T + 0.7) + 0.02 * DRAW.normal(size=N)  # mm
A = -1.0 * np.sin(2.0 * np.pi * 1.5 * T + 0.7) + 0.01 * DRAW.normal(size=N)  # m/s^2


def write(path: Path, columns: dict[str, np.ndarray]) -> Path:
    with open(path, "w") as file:
        file.write(",".join(columns) + "\n")
        for row in zip(*columns.values(), strict=True):
            file.write(",".join("" if np.isnan(value) else f"{value:.9g}" for value in row) + "\n")
    return path


@pytest.fixture
def record(tmp_path):
    """record(changed columns) writes a good recording with these changed; a column that is None is left out."""

    def make(name: str = "r.csv", rows: np.ndarray | slice = slice(None), **changed) -> Path:
        columns = {"time [s]": T, "foot [mm]": FOOT, "z [mm]": Z, "a [m/s^2]": A}
        for key, values in changed.items():
            (full,) = [c for c in columns if c.startswith(key + " ")]
            columns[full] = values
        return write(tmp_path / name, {k: v[rows] for k, v in columns.items() if v is not None})

    return make


def problems(paths, model, *channels) -> list[str]:
    with pytest.raises(UserError) as caught:
        load(paths if isinstance(paths, list) else [paths], model, channels)
    assert all("\n" not in line and "; " in line for line in caught.value.problems)
    return caught.value.problems


def test_a_sound_recording_comes_through_as_it_is(record, oscillator):
    (one,) = load([record()], oscillator)
    assert one.quality.problems == () and one.part == 0 and one.title == "r.csv"
    assert one.time == pytest.approx(T, abs=1e-12) and one.u.shape == (N, 1) and set(one.z) == {"z", "a"}
    for got, sent in ((one.u[:, 0], FOOT * 1e-3), (one.z["z"], Z * 1e-3), (one.z["a"], A)):
        assert got == pytest.approx(sent, rel=1e-8, abs=1e-12)  # nine digits
    assert all(mask.all() for mask in one.mask.values()) and not one.rest.any()
    # 15 stretches of 1024, half of 320 bins: the level to sqrt(2.08 / (15 * 160)) / 2 = 1.5 %; four of them
    assert one.quality.channels["a"].noise.std == pytest.approx(0.01, rel=0.06)
    assert one.quality.channels["z"].noise.std == pytest.approx(2e-5, rel=0.06)


def test_several_recordings_and_any_subset_of_sensors(record, oscillator):
    first, second = load([record("1.csv", a=None), record("2.csv", z=None)], oscillator)
    assert list(first.z) == ["z"] and list(second.z) == ["a"] and first.path.name == "1.csv"


def test_missing_and_faulty_samples_are_masked_and_reported(record, oscillator):
    a, z = A.copy(), np.clip(Z, -8.0, None)
    a[100:120] = np.nan
    a[3000] += 1.0
    (one,) = load([record(a=a, z=z)], oscillator)
    assert not one.mask["a"][100:120].any() and not one.mask["a"][3000] and one.mask["a"].sum() == N - 21
    assert np.array_equal(one.mask["z"], z > -8.0) and one.quality.channels["z"].low == pytest.approx(-8e-3)
    text = "\n".join(one.quality.problems)
    assert re.search(r"r.csv:102: channel a has no value \(and in 19 more rows\); they are left out", text)
    assert re.search(r"r.csv:3002: channel a has a spike; they are left out", text)
    assert re.search(r"channel z is cut off at -8 mm \(and in \d+ more rows\); they are left out", text)
    assert one.quality.channels["a"].noise.std == pytest.approx(0.01, rel=0.06)  # as in the sound recording


def test_a_gap_parts_the_recording(record, oscillator):
    first, second = load([record(rows=np.r_[0:3000, 4000:N])], oscillator)
    assert (first.title, second.title) == ("r.csv, part 1", "r.csv, part 2")
    assert first.time.size == 3000 and second.time[0] == pytest.approx(4.0) and second.time.size == N - 4000
    assert second.u[:, 0] == pytest.approx(FOOT[4000:] * 1e-3, rel=1e-8, abs=1e-12)
    assert re.search(r"r.csv:3002: channel time has a gap of 1.001 s", first.quality.problems[0])


def test_a_gap_of_the_input_splits_the_recording_and_a_short_one_is_bridged(record, oscillator):
    foot = FOOT.copy()
    foot[1000:1003] = np.nan
    foot[5000:5004] = np.nan
    first, second = load([record(foot=foot)], oscillator)
    assert first.time.size == 5000 and second.time.size == N - 5004
    # a curve of third order over a hole of 4 h: (4 h 2 pi 1.5)^4 / 384 of 10 mm are 5e-11 m, digits of the file 1e-11 m
    assert first.u[1000:1003, 0] == pytest.approx(FOOT[1000:1003] * 1e-3, abs=1e-10)
    assert any("up to 3 in a row are bridged" in line for line in first.quality.problems)


def test_unsorted_and_repeated_times(record, oscillator):
    order = np.arange(N)
    order[[500, 501]] = 501, 500
    order = np.insert(order, 700, 699)
    (one,) = load([record(rows=np.delete(order, 700))], oscillator)
    assert one.z["a"] == pytest.approx(A, rel=1e-8, abs=1e-12)
    assert re.search(r"r.csv:503: channel time goes back there; rows are sorted", one.quality.problems[0])
    (one,) = load([record(rows=np.insert(np.arange(N), 700, 699))], oscillator)
    assert one.z["a"] == pytest.approx(A, rel=1e-8, abs=1e-12)
    assert re.search(r"r.csv:702: channel time has the same value as the row before; the first", one.quality.problems[0])
    (line,) = problems(record(rows=np.r_[0:N, 0:N]), oscillator)
    assert "split the recording where its clock restarts" in line


def test_times_without_a_value(record, oscillator):
    time = T.copy()
    time[10] = np.nan
    (one,) = load([record(time=time)], oscillator)
    assert one.time.size == N and not one.mask["a"][10] and one.mask["a"].sum() == N - 1
    assert "r.csv:12: channel time has no value there; such rows are left out" in one.quality.problems[0]


def test_rounded_stamps_are_a_regular_clock_and_scattered_ones_are_said(record, oscillator):
    (one,) = load([record(time=np.round(T * 1.024, 5))], oscillator)  # 1.024 ms: off by up to half a percent
    assert not any("time stamps" in line for line in one.quality.problems)
    time = T + 2e-4 * np.random.default_rng(1).uniform(-1.0, 1.0, N)
    foot, z = (size * np.sin(2.0 * np.pi * 1.5 * time + phase) for size, phase in ((10.0, 1.0), (12.0, 0.7)))
    (one,) = load([record(time=time, foot=foot, z=z)], oscillator)
    assert any(re.search(r"time stamps are off a regular clock of [\d.]+ s by up to \d+ %", line) for line in one.quality.problems)
    # straight lines of 1.4 ms at most: h^2/8 (2 pi 1.5)^2 12 mm = 2.6e-4 mm; the kernel that moves the even samples to
    # the raster adds less than 1e-5 of 12 mm at this frequency
    assert one.z["z"] * 1e3 == pytest.approx(12.0 * np.sin(2.0 * np.pi * 1.5 * one.time + 0.7), abs=4e-4)


def test_faster_rows_are_filtered_alike_and_bad_ones_spread_no_further_than_the_filter(tmp_path, oscillator):
    time = np.arange(16_000) * 5e-4

    def wave(phase):
        return np.sin(2.0 * np.pi * 40.0 * time + phase)

    a = wave(0.5) + 0.05 * np.random.default_rng(2).normal(size=time.size)
    a[4000:4010] = np.nan
    path = write(tmp_path / "r.csv", {"t_s": time, "foot_mm": wave(0.0), "a_m_s2": a, "z_mm": wave(2.0)})
    (one,) = load([path], oscillator)
    assert one.time.size == 8000 and any("low-passed without phase" in line for line in one.quality.problems)
    inner = slice(20, -20)  # half the kernel's length
    for got, size, phase in ((one.u[:, 0], 1e-3, 0.0), (one.z["z"], 1e-3, 2.0)):
        exact = size * np.sin(2.0 * np.pi * 40.0 * one.time + phase)
        assert got[inner] == pytest.approx(exact[inner], abs=2e-3 * size)  # the filter's ripple
    bad = np.flatnonzero(~one.mask["a"])
    assert 5 <= bad.size <= 5 + 2 * 18 and bad.min() >= 2000 - 18 and bad.max() <= 2005 + 18
    # white noise of 1 kHz, of which 0 to 450 Hz (the filter's middle) stay: its density stays what it was
    law = one.quality.channels["a"].noise
    assert law.density(np.array([200.0]), 1e-3)[0] == pytest.approx(2.0 * 5e-4 * 0.05**2, rel=0.12)


def test_a_rail_is_known_in_all_recordings_of_a_sensor(record, oscillator):
    """Cut off at 9 mm for long in one, for a single sample in another: masked in both. A third goes beyond: another sensor."""
    rarely = 8.99 * Z / np.max(Z)
    top = int(np.argmax(rarely))
    rarely[top] = 9.0
    recordings = [
        load([record(f"{name}.csv", z=z)], oscillator)[0] for name, z in (("long", np.minimum(Z, 9.0)), ("rarely", rarely), ("beyond", Z))
    ]
    assert recordings[0].quality.channels["z"].high == pytest.approx(9e-3) and recordings[1].mask["z"].all()
    long, short, beyond = with_shared_rails(recordings)
    assert np.array_equal(long.mask["z"], recordings[0].mask["z"]) and beyond.mask["z"].all()
    assert np.flatnonzero(~short.mask["z"]).tolist() == [top] and short.quality.channels["z"].saturated == 1


def test_a_slower_sensor_counts_once_per_row(tmp_path, oscillator):
    asammdf = pytest.importorskip("asammdf")
    slow = np.arange(800) * 1e-2
    with asammdf.MDF() as file:
        file.append([asammdf.Signal(FOOT, T, name="foot", unit="mm"), asammdf.Signal(A, T, name="a", unit="m/s^2")])
        file.append([asammdf.Signal(np.sin(slow), slow, name="z", unit="mm")])
        file.save(tmp_path / "r.mf4")
    (one,) = load([tmp_path / "r.mf4"], oscillator)
    assert np.flatnonzero(one.mask["z"]).tolist() == list(range(0, 8000, 10)) and one.mask["a"].all()
    assert one.z["z"][one.mask["z"]] == pytest.approx(1e-3 * np.sin(slow), abs=1e-15)
    assert one.u[:, 0] == pytest.approx(1e-3 * FOOT, rel=1e-12)


def test_a_standstill_is_found_and_no_fault_of_it(record, oscillator):
    moving = np.where(T > 3.0, 1.0 - np.cos(2.0 * np.pi * 1.5 * (T - 3.0)), 0.0)
    foot, a = 5.0 * moving, moving + 0.01 * DRAW.normal(size=N)
    (one,) = load([record(foot=foot, a=a, z=np.round(8.0 * moving, 1))], oscillator)
    assert one.quality.problems == ()
    assert one.rest[:2700].all() and not one.rest[3250:].any()
    assert one.quality.channels["a"].noise.above == 0.0
    # 3 s, 23 stretches of 256 in 100 bins: sqrt(2.08 * 2 / (23 * 100)) / 2 = 2 %; four of them
    assert one.quality.channels["a"].noise.std == pytest.approx(0.01, rel=0.08)


def test_a_recording_that_is_too_short_is_left_out_if_others_are_not(record, oscillator):
    short, none, whole = record("short.csv", slice(50)), record("none.csv", slice(1)), record("whole.csv")
    (one,) = load([short, whole, none], oscillator)
    assert one.path == whole and one.whole == N
    assert one.quality.problems == (
        f"{short}: its 50 samples of 1 ms are too few; the recording is left out",
        f"{none}: it has 1 rows with a time of their own; the recording is left out",
    )
    assert len(problems([short, none], oscillator)) == 2


def test_a_rail_is_at_its_place_in_units_with_another_zero(tmp_path):
    path = tmp_path / "heater.toml"
    path.write_text(
        '[model]\nname = "heater"\nsample_time = "1 ms"\n[parameters]\nC = { value = 9000.0, unit = "J/K" }\n'
        '[inputs]\nP = { unit = "W" }\n[states]\nT = { unit = "K", start = 293 }\n[equations]\nheat = "der(T)*C = P"\n'
        '[outputs]\ny = { value = "T", unit = "K" }\n[sensors]\nT_meas = { value = "T", unit = "K", noise = 0.05 }\n'
    )
    recording = write(tmp_path / "r.csv", {"time [s]": T, "P [W]": FOOT, "T_meas [°C]": np.minimum(20.0 + Z, 29.0)})
    (one,) = load([recording], penode_gen.load(path))
    assert one.z["T_meas"][one.mask["T_meas"]].max() < 302.15
    assert one.quality.channels["T_meas"].high == pytest.approx(302.15) and any("is cut off at 302.15 K" in p for p in one.quality.problems)
    assert any("0 of its unit is 273.15 K; it is read as a temperature" in p for p in one.quality.problems)


def test_what_cannot_be_used_is_refused(record, oscillator):
    (line,) = problems(record(foot=None), oscillator)
    assert "there is no channel foot, which drives the model; record it, or say --channel foot=NAME" in line
    (line,) = problems(record(a=None, z=None), oscillator)
    assert "it holds no sensor of the model; record at least one of: z, a" in line
    (line,) = problems(record(rows=slice(10)), oscillator)
    assert "its 10 samples of 1 ms are too few; record at least 100" in line
    (line,) = problems(record(foot=1000.0 * FOOT), oscillator)
    assert "reaches -10000 mm, the model's range ends at -20 mm; its numbers look like thousandths (mm for m)" in line
    for end in (1e9, 1e308):
        with np.errstate(over="raise"):
            (line,) = problems(record(time=np.where(np.arange(N) < N - 1, T, end)), oscillator)
        assert "it has far longer gaps than samples" in line
    assert any("channel foot has almost no valid sample" in line for line in problems(record(foot=np.nan * T), oscillator))
    lines = problems(record(a=np.full(N, 3.0), z=np.full(N, np.nan)), oscillator)
    assert "no sensor has 100 valid samples" in lines[0] and "channel a does not change; it is left out" in "\n".join(lines)
    both = problems([record("1.csv", foot=None), record("2.csv", rows=slice(10))], oscillator)
    assert len(both) == 2  # all recordings at once
    (line,) = problems(record(), oscillator, "feet=foot")
    assert 'the model has no input or sensor "feet"; use one of: foot, a, z' in line


def test_a_little_outside_of_the_range_is_a_remark(record, oscillator):
    (one,) = load([record(foot=3.0 * FOOT)], oscillator)
    assert any("reaches 30 mm, the model's range ends at 20 mm" in line for line in one.quality.problems)


def test_names_of_the_file_can_be_given(tmp_path, oscillator):
    path = write(tmp_path / "r.csv", {"t_s": T, "Weg_1": FOOT, "acc_m_s2": A})
    (one,) = load([path], oscillator, ["foot=Weg_1 [mm]", "a=acc_m_s2"])
    assert one.u[:, 0] == pytest.approx(FOOT * 1e-3, rel=1e-8, abs=1e-12) and one.z["a"] == pytest.approx(A, rel=1e-8)


@settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_any_fault_is_masked_or_refused(tmp_path, oscillator, data):
    n = data.draw(st.integers(0, 400))
    draw = np.random.default_rng(data.draw(st.integers(0, 99)))
    columns = {"time [s]": T[:n].copy(), "foot [mm]": FOOT[:n].copy(), "z [mm]": Z[:n].copy()}
    for _ in range(data.draw(st.integers(0, 4))):
        name = data.draw(st.sampled_from(list(columns)))
        first = data.draw(st.integers(0, 400))
        rows = slice(first, first + data.draw(st.integers(0, 400)))
        value = data.draw(st.sampled_from([np.nan, np.inf, 0.0, 5.0, 1e300, -1e-300]))
        columns[name][rows] = value if data.draw(st.booleans()) else draw.permutation(columns[name][rows])
    try:
        parts = load([write(tmp_path / "r.csv", columns)], oscillator)
    except UserError as exc:
        assert exc.problems and all("\n" not in line for line in exc.problems)
        return
    for part in parts:
        assert np.isfinite(part.u).all() and part.time.size >= 100
        assert all(np.isfinite(part.z[name][part.mask[name]]).all() for name in part.z)


FORCE = """
[model]
name = "damper"
sample_time = "1 ms"
[parameters]
k = { value = 1000, unit = "N/m" }
[inputs]
x = { unit = "m", min = -0.1, max = 0.1 }
[elements]
spring = { between = ["x", "ground"], law = "linear_spring", stiffness = "k" }
[sensors]
force = { value = "F_spring", unit = "N" }
[outputs]
f = { value = "F_spring", unit = "N" }
[sets.default]
"""


def test_public_measured_data_are_read_without_ado(tmp_path):
    shared = Path(os.environ.get("PENODE_SHARED", Path(__file__).resolve().parents[3] / "shared")) / "measured"
    if not shared.is_dir():
        pytest.skip(f"the measured data are not at {shared}; set PENODE_SHARED to their folder to run this")
    (tmp_path / "damper.toml").write_text(FORCE)
    model = penode_gen.load(tmp_path / "damper.toml")
    friction = load(sorted((shared / "friction_damper_backlash").glob("*.csv")), model)
    assert len(friction) == 4 and all(one.mask["force"].all() for one in friction)
    fluid = load(sorted((shared / "labcontrol_mr").glob("*.csv")), model, ["x=pos_mm"])
    assert len(fluid) == 4 and max(np.max(np.abs(one.u)) for one in fluid) < 0.1
    lines = problems(sorted((shared / "labcontrol_mr").glob("*.csv")), model, "x=pos_mm [m]")
    assert len(lines) == 4 and all("look like thousandths" in line for line in lines)


def test_nothing_of_it_is_loaded_for_help():
    code = "import sys, penode_sil.cli; sys.exit(any(m in sys.modules for m in ('asammdf', 'pandas')))"
    subprocess.run([sys.executable, "-c", code], check=True)
