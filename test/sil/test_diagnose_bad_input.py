# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Recordings that are wrong, foreign or poor: a clear verdict or one clear line, and never a name."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from samples import sample
from scipy.signal import StateSpace, lsim

from penode_sil.cli import main
from penode_sil.diagnosis.checks.plausible import mixed, off_by

STEP, SAMPLES, G = 2e-3, 3000, 9.80665
NOISE = {"a_body": 0.02, "a_wheel": 0.1, "deflection": 1e-4}
CAR = {"m_b": 400.0, "m_w": 45.0, "c": 22e3, "d": 1500.0, "c_t": 210e3}
UNITS = {"m_b": "kg", "m_w": "kg", "c": "N/m", "d": "N*s/m", "c_t": "N/m"}
MODEL = "\n".join(
    [
        '[model]\nname = "car"\nsample_time = "2 ms"\n[parameters]',
        *(f'{name} = {{ value = {value}, unit = "{UNITS[name]}", tolerance = 0.02 }}' for name, value in CAR.items()),
        '[inputs]\nz_road = { unit = "m" }',
        '[bodies]\nbody = { mass = "m_b", position = "z_b", velocity = "v_b" }',
        'wheel = { mass = "m_w", position = "z_w", velocity = "v_w" }',
        '[elements]\nspring = { between = ["body", "wheel"], law = "linear_spring", stiffness = "c" }',
        'damper = { between = ["body", "wheel"], law = "linear_damper", damping = "d" }',
        'tyre = { between = ["wheel", "z_road"], law = "linear_spring", stiffness = "c_t" }',
        '[outputs]\nz_b = { value = "z_b", unit = "m" }',
        f'[sensors]\na_body = {{ value = "der(v_b)", unit = "m/s^2", noise = {NOISE["a_body"]} }}',
        f'a_wheel = {{ value = "der(v_w)", unit = "m/s^2", noise = {NOISE["a_wheel"]} }}',
        f'deflection = {{ value = "z_b - z_w", unit = "m", noise = {NOISE["deflection"]} }}',
    ]
)
HEADER = {"time": "s", "z_road": "m", "a_body": "m/s^2", "a_wheel": "m/s^2", "deflection": "m"}
TIME = np.arange(SAMPLES) * STEP


def road(seed: int) -> np.ndarray:
    """Height [m]: noise with a falling spectrum up to 12 Hz, from rest."""
    rng = np.random.default_rng(seed)
    f = np.fft.rfftfreq(SAMPLES, STEP)
    shape = np.where((f > 0.3) & (f < 12.0), 1.0 / np.maximum(f, 0.3), 0.0)
    z = np.fft.irfft(shape * np.exp(2j * np.pi * rng.random(f.size)), SAMPLES)
    return 0.006 * z / np.std(z) * np.minimum(TIME, 1.0) ** 2


def drive(seed: int = 1, noise: int = 2, **changed: float) -> dict[str, np.ndarray]:
    """A recording of a linear quarter vehicle in SI, with noise."""
    p = CAR | changed
    a = np.zeros((4, 4))
    a[:2, 2:] = np.eye(2)
    a[2, :] = np.array([-p["c"], p["c"], -p["d"], p["d"]]) / p["m_b"]
    a[3, :] = np.array([p["c"], -p["c"] - p["c_t"], p["d"], -p["d"]]) / p["m_w"]
    b = np.array([[0.0], [0.0], [0.0], [p["c_t"] / p["m_w"]]])
    c, d = np.vstack([a[2:], [1.0, -1.0, 0.0, 0.0]]), np.vstack([b[2:], [0.0]])
    z = road(seed)
    _, y, _ = lsim(StateSpace(a, b, c, d), z, TIME)
    rng = np.random.default_rng(noise)
    return {"time": TIME, "z_road": z} | {k: y[:, j] + s * rng.standard_normal(SAMPLES) for j, (k, s) in enumerate(NOISE.items())}


def write(path: Path, columns: dict[str, np.ndarray]) -> Path:
    header = ",".join(f"{name} [{HEADER[name]}]" for name in columns)
    np.savetxt(path, np.stack(list(columns.values()), axis=1), delimiter=",", header=header, comments="", fmt="%.9g")
    return path


@pytest.fixture
def diagnose(tmp_path, monkeypatch, capsys):
    """diagnose(columns or path, words): exit code 0 and diagnosis.json, or 2 and the lines of stderr; then nothing is written."""
    (tmp_path / "car.toml").write_text(MODEL)

    def run(data, *words):
        path = data if isinstance(data, Path) else write(tmp_path / "r.csv", data)
        line = ["penode", "diagnose", tmp_path / "car.toml", "--data", path, "-o", tmp_path / "out", "--json", *words]
        monkeypatch.setattr(sys, "argv", list(map(str, line)))
        try:
            main()
        except SystemExit as exc:
            lines = capsys.readouterr().err.splitlines()
            assert exc.code == 2 and not (tmp_path / "out").exists(), lines
            assert lines and all(line.startswith("penode: ") and "; " in line for line in lines), lines
            return lines
        return json.loads(capsys.readouterr().out)

    return run


def without(columns: dict[str, np.ndarray], *names: str) -> dict[str, np.ndarray]:
    return {name: values for name, values in columns.items() if name not in names}


@pytest.mark.parametrize(
    "changes, line",
    [
        ({"a_body": 1 / G}, "r.csv: a_body is 1/9.807 of what fits the model, like g and m/s^2; correct its unit"),
        ({"a_body": 1 / G, "a_wheel": 1 / G}, "r.csv: a_wheel is 1/9.807 of what fits the model, like g and m/s^2; correct"),
        ({"deflection": 1e3}, "r.csv: deflection is 1000 times what fits the model, like mm and m; correct its unit"),
        ({"z_road": 1e3}, "r.csv: z_road is 1000 times what fits the model, like mm and m; correct its unit"),
        ({"z_road": 100.0}, "r.csv: z_road is 100 times what fits the model, like cm and m; correct its unit"),
        ({"z_road": 1e-3}, "r.csv: z_road is 1/1000 of what fits the model, like mm and m; correct its unit"),
    ],
)
def test_a_wrong_unit_is_an_error_with_its_name(diagnose, changes, line):
    columns = drive()
    lines = diagnose({name: changes.get(name, 1.0) * values for name, values in columns.items()})
    assert len(lines) == sum(name != "z_road" for name in changes) or (list(changes) == ["z_road"] and len(lines) == 1)
    assert any(line in text for text in lines), lines


def test_a_wrong_unit_of_the_hold_out_is_an_error_too(diagnose, tmp_path):
    columns = drive()
    held = write(tmp_path / "h.csv", {k: v / G if k == "a_body" else v for k, v in drive(3, 4).items()})
    (line,) = diagnose(columns, "--holdout", held)
    assert "h.csv: a_body is 1/9.807 of what fits the model" in line


@pytest.mark.parametrize(
    "ratio, unit, known", [(9.0, "m/s^2", 9.80665), (1.1e-3, "m", 1e-3), (9.8, "m", None), (1.9, "m", None), (0.4, "N", None)]
)
def test_only_known_factors_within_a_seventh_are_taken_for_wrong_units(ratio, unit, known):
    found = mixed(ratio, unit)
    assert (found and found[0]) == known
    assert mixed(-1.0, unit)[0] == -1.0 and mixed(-2.0, unit) is None


def test_signals_that_are_not_alike_have_no_ratio():
    rng = np.random.default_rng(1)
    a, good = rng.standard_normal(1000), np.ones(1000, dtype=bool)
    assert off_by(3.0 * a + 7.0, a, good) == pytest.approx(3.0) and off_by(-a, a, good) == pytest.approx(-1.0)
    assert off_by(rng.standard_normal(1000), a, good) is None
    assert off_by(a, np.zeros(1000), good) is None and off_by(a, a, ~good) is None


def test_what_cannot_be_a_recording_of_the_model_is_refused(diagnose, tmp_path):
    columns = drive()
    (line,) = diagnose(without(columns, "z_road"))
    assert "r.csv: there is no channel z_road, which drives the model; record it, or say --channel z_road=NAME" in line
    (line,) = diagnose(without(columns, *NOISE))
    assert "it holds no sensor of the model; record at least one of: z_b, a_body, a_wheel, deflection" in line
    (line,) = diagnose({name: values[:10] for name, values in columns.items()})
    assert "its 10 samples of 2 ms are too few; record at least 100" in line
    lines = diagnose(columns | dict.fromkeys(NOISE, np.ones(SAMPLES)))
    assert "no sensor has 100 valid samples" in lines[0] and sum("does not change" in line for line in lines) == 3
    short = write(tmp_path / "h.csv", {name: values[:50] for name, values in columns.items()})
    (line,) = diagnose(columns, "--holdout", short)
    assert "h.csv: its 50 samples of 2 ms are too few; record at least 100" in line
    broken = tmp_path / "b.csv"
    broken.write_text("time [s],z_road [m]\n0,nothing\n")
    line, rows = diagnose(broken)
    assert 'b.csv:2: channel z_road: "nothing" is not a number; correct the cell' in line
    assert "it has 1 rows with a time of their own" in rows


def test_a_truncated_mdf_file_is_refused(diagnose, tmp_path):
    asammdf = pytest.importorskip("asammdf")
    columns = drive()
    with asammdf.MDF() as file:
        file.append([asammdf.Signal(v, TIME, name=k, unit=HEADER[k]) for k, v in columns.items() if k != "time"])
        file.save(tmp_path / "r.mf4")
    content = (tmp_path / "r.mf4").read_bytes()
    for share in (0.1, 0.5, 0.9):
        (tmp_path / "cut.mf4").write_bytes(content[: int(share * len(content))])
        (line,) = diagnose(tmp_path / "cut.mf4")
        assert "cut.mf4: " in line and ("not a valid MDF" in line or "too few" in line), line


FOREIGN = {
    "heavier": (drive(m_b=650.0, m_w=60.0, c=35e3, d=3500.0, c_t=280e3), "data seem to be of another plant, with"),
    "lighter": (drive(m_b=150.0, m_w=25.0, c=15e3, d=700.0, c_t=120e3), "data seem to be of another plant, with"),
    "still road": (drive() | {"z_road": np.zeros(SAMPLES)}, "check that the signals were recorded together, and with this plant"),
    "other road": (drive() | {"z_road": road(9)}, "check that the signals were recorded together, and with this plant"),
}


@pytest.mark.parametrize("case", sample(FOREIGN, "lighter"))
def test_data_of_something_else_get_no_name(diagnose, case):
    other, text = FOREIGN[case]
    found = diagnose(other)
    assert found["verdict"] == "unexplained" and [c["kind"] for c in found["causes"]] == ["outside_taxonomy"]
    assert any(text in note for note in found["notes"]), found["notes"]


def test_faults_of_a_recorder_cause_no_finding_on_a_correct_model(diagnose, tmp_path):
    """NaN, a repeated time, a spike, a constant sensor; the hold-out has one sensor only."""
    columns = drive()
    columns["a_body"][500:520] = np.nan
    columns["a_wheel"] = np.full(SAMPLES, 3.0)
    rows = np.insert(np.arange(SAMPLES), 700, 699)
    held = write(tmp_path / "h.csv", without(drive(3, 4), "a_wheel", "deflection"))
    found = diagnose({name: values[rows] for name, values in columns.items()}, "--holdout", held)
    assert [c["kind"] for c in found["causes"]] in ([], ["sensor_dropout"]) and list(found["gain"]) == ["a_body"]
    told = "\n".join(found["data"][0]["problems"])
    assert all(text in told for text in ("a_body has no value", "a_wheel does not change", "time has the same value"))


def test_a_sound_vehicle_stays_sound_at_mixed_rates(diagnose, tmp_path):
    asammdf = pytest.importorskip("asammdf")
    columns, slow = drive(), TIME[::5]
    with asammdf.MDF() as file:
        file.append([asammdf.Signal(columns[k], TIME, name=k, unit=HEADER[k]) for k in ("z_road", "a_body", "a_wheel")])
        file.append([asammdf.Signal(columns["deflection"][::5], slow, name="deflection", unit="m")])
        file.save(tmp_path / "r.mf4")
    found = diagnose(tmp_path / "r.mf4")
    assert found["verdict"] == "no_discrepancy" and found["causes"] == []
