# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""simulate on recordings: several at once, starts, replays, and what was measured beside the prediction."""

from __future__ import annotations

import json

import numpy as np
import pytest
from places import HERE
from test_cli import table

import penode_gen
from penode_sil import replay, starts
from penode_sil.choices import REPLAYS
from penode_sil.recordings import mdf

SWING = """
[model]
name = "swing"
sample_time = "5 ms"
[parameters]
w = { value = 40, unit = "1/s^2" }
drag = { value = 0.2, unit = "1/s" }
[inputs]
push = { unit = "rad/s^2" }
[states]
phi = { unit = "rad", start = 0.1 }
omega = { unit = "rad/s" }
[equations]
turn = "der(phi) = omega"
swing = "der(omega) = push - w*sin(phi) - drag*omega"
[outputs]
phi = { value = "phi", unit = "rad" }
[sensors]
angle = { value = "phi", unit = "rad", noise = 0.001 }
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "swing.toml").write_text(SWING)
    return tmp_path


def record(path, start, noise=0.0, n=600, unit="rad", scale=1.0):
    """A swing from `start` (angle, rate), integrated by classical Runge-Kutta at 1/20 of the sample; angle with noise."""
    x, h, rows, draw = np.array(start, float), 0.25e-3, [], np.random.default_rng(3)

    def rates(x, t):
        return np.array([x[1], 2 * np.sin(3 * t) - 40 * np.sin(x[0]) - 0.2 * x[1]])

    for k in range(n * 20):
        t = k * h
        if k % 20 == 0:
            rows.append(f"{t:.4f},{2 * np.sin(3 * t):.9g},{scale * (x[0] + noise * draw.standard_normal()):.9g}")
        a = rates(x, t)
        b = rates(x + h / 2 * a, t + h / 2)
        c = rates(x + h / 2 * b, t + h / 2)
        x = x + h / 6 * (a + 2 * b + 2 * c + rates(x + h * c, t + h))
    path.write_text(f"time [s],push [rad/s^2],angle [{unit}]\n" + "\n".join(rows) + "\n")


def test_fitted_start_finds_the_true_one(penode, folder):
    """Noise of 1 mrad over n = 100 samples: angle to about 1 mrad * 2 / sqrt(n) = 0.2 mrad, rate to that times w0 = 6.3/s. Held to
    four standard deviations; and from there the prediction is off by no more than the noise and what is left of the start."""
    record(folder / "a.csv", (1.2, -3.0), noise=1e-3)
    out = json.loads(penode("simulate", "swing.toml", "--input", "a.csv", "--start", "measured:100", "-o", "p.csv", "--json"))
    assert "first 100 samples (0.5 s)" in out["start"]
    model = penode_gen.load("swing.toml")
    one = replay.load(folder / "a.csv", model, None, (), "linear", print)
    found, _ = starts.fit(model, "default", one, starts.Start({}, True, 100))
    assert abs(found["phi"] - 1.2) < 0.8e-3 and abs(found["omega"] + 3.0) < 5e-3
    rmse = out["instances"][0]["rmse"]["angle"]
    assert rmse["unit"] == "rad" and rmse["samples"] == 600 and 0.9e-3 < rmse["value"] < 1.6e-3
    away = json.loads(penode("simulate", "swing.toml", "--input", "a.csv", "-o", "p.csv", "--json"))
    assert away["start"] == "" and away["instances"][0]["rmse"]["angle"]["value"] > 0.3


def test_given_start_is_converted_and_stays(penode, folder):
    record(folder / "a.csv", (0.5, 0.0), unit="deg", scale=180 / np.pi)
    words = ["simulate", "swing.toml", "--input", "a.csv", "--on", "mil", "-o", "p.csv", "--json", "--start"]
    out = json.loads(penode(*words, "phi=28.64788975654116 deg", "omega = 0 rad/s"))
    assert table(folder / "p.csv")[1][0, 2] == pytest.approx(0.5, rel=1e-12)
    # the input between its rows is a straight line: h^2/8 * 18 rad/s^4 = 6e-5 rad/s^2 over w = 40
    assert out["instances"][0]["rmse"]["angle"]["value"] < 1e-5
    penode(*words, "measured", "omega=0.4 rad/s")
    start = starts.parse(["measured", "omega=0.4 rad/s"], penode_gen.load("swing.toml"))
    assert (start.fitted, start.samples, start.given) == (True, 0, {"omega": 0.4})


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["--start", "measured:1"], "fits too few samples"),
        (["--start", "phi=3 m"], "phi: m cannot be turned into rad"),
        (["--start", "fi=3 rad"], 'no state "fi"'),
        (["--start", "somewhere"], "is not understood"),
        (["--start", "measured", "phi=0 rad", "omega=0 rad/s"], "all states are given"),
        (["--input", "a.csv", "b.csv", "-o", "x.csv"], "several recordings need several files"),
        (["--input", "a.csv", "other/a.csv", "-o", "x"], "two recordings would be written to it"),
        (["-o", "a.csv"], "this is the recording itself"),
        (["-o", "x/p.xls"], 'cannot be written as ".xls"'),
        (["--input", "a.csv", "b.csv", "-o", "x", "--plot", "p.png"], "draws one recording"),
        (["--input", "bare.csv", "--start", "measured"], "needs a sensor of the model"),
    ],
)
def test_wrong_words_are_refused_and_nothing_is_made(penode, folder, words, expected):
    for name in ("a", "b"):
        record(folder / f"{name}.csv", (0.1, 0.0), n=30)
    (folder / "bare.csv").write_text("time [s],push [rad/s^2]\n" + "".join(f"{k / 200},0\n" for k in range(30)))
    before = sorted(p.name for p in folder.rglob("*"))
    words = [*words, *([] if "--input" in words else ["--input", "a.csv"]), *([] if "-o" in words else ["-o", "o/p.csv"])]
    lines = penode("simulate", "swing.toml", *words, code=2)
    assert len(lines) == 1 and expected in lines[0], lines
    assert sorted(p.name for p in folder.rglob("*")) == before


def test_several_recordings_are_compiled_once_and_written_to_folders(penode, folder, monkeypatch):
    from penode_sil import simulate

    made = []
    monkeypatch.setattr(simulate, "Sil", lambda model: made.append(model) or real(model))
    real = starts.Sil
    for name in ("a", "b"):
        record(folder / f"{name}.csv", (0.3, 0.0), n=60)
    out = penode("simulate", "swing.toml", "--input", "a.csv", "b.csv", "-o", "far/away")
    assert len(made) == 1 and sorted(p.name for p in (folder / "far" / "away").iterdir()) == ["a.csv", "b.csv"]
    assert out.count("RMSE angle: ") == 2
    penode("simulate", "swing.toml", "--input", "a.csv", "b.csv", "-o", "out/{name}_seen.mf4")
    assert sorted(p.name for p in (folder / "out").iterdir()) == ["a_seen.mf4", "b_seen.mf4"]
    header, values = table(folder / "far" / "away" / "a.csv")
    [(units, columns, _)], _ = mdf.read(folder / "out" / "a_seen.mf4", None)
    assert {f"{n} [{u}]" for n, u in units.items()} == set(header)
    for name, column in zip(header, values.T, strict=True):
        assert np.allclose(columns[name.partition(" ")[0]], column, rtol=1e-8)  # nine digits in the text


def test_replays_differ_between_rows_only(folder):
    """Rows at 20 ms for a model at 5 ms, a sine of 8 Hz, a third of the rows' Nyquist frequency: band-limited replay is within the
    kernel's 0.1 % where it has rows on both sides, lines are off by up to (w T)^2 / 8 = 13 %, held by w T = 1."""
    model = penode_gen.load(folder / "swing.toml")
    t = np.arange(200) * 0.02

    def sine(t):
        return np.sin(2 * np.pi * 8 * t)

    (folder / "r.csv").write_text("time [s],push [rad/s^2]\n" + "".join(f"{a:.2f},{sine(a):.12g}\n" for a in t))
    seen = {how: replay.load(folder / "r.csv", model, None, (), how, lambda text: None) for how in REPLAYS}
    for one in seen.values():
        assert np.allclose(one.u[120:-120:4, 0], sine(one.times[120:-120:4]), atol=1e-3)
    inner = slice(120, -120)
    error = {how: np.max(np.abs(one.u[inner, 0] - sine(one.times[inner]))) for how, one in seen.items()}
    assert error["bandlimited"] < 1e-3 and 0.05 < error["linear"] < 0.14 and 0.5 < error["held"] < 1.01
    held = seen["held"].u[:, 0]
    rows = held[: held.size // 4 * 4].reshape(-1, 4)
    assert (rows == rows[:, :1]).all()


def test_start_states_of_an_extending_file(folder):
    """Two in a row; what they do not name stays."""
    (folder / "one.toml").write_text('[model]\nextends = "swing.toml"\nname = "one"\n[states]\nphi = { start = 0.7 }\n')
    (folder / "two.toml").write_text('[model]\nextends = "one.toml"\n[states]\nomega = { start = -2 }\n')
    model = penode_gen.load(folder / "two.toml")
    assert model.start == (0.7, -2.0) and model.name == "one" and model.owner == "swing"
    (folder / "o.toml").write_text((HERE / "models" / "oscillator.toml").read_text())
    (folder / "p.toml").write_text('[model]\nextends = "o.toml"\n[bodies]\nmass = { start_position = "3 mm" }\n')
    assert penode_gen.load(folder / "p.toml").start == (0.003, 0.0)


def test_recording_without_inputs_takes_its_times_from_the_sensors(folder):
    """Two sensors on clocks of their own in one file; a gap in one of them is no fault of a simulation."""
    from types import SimpleNamespace

    signals = (SimpleNamespace(name="a", unit="rad"), SimpleNamespace(name="b", unit="mm"))
    model = SimpleNamespace(inputs=(), sensors=signals, outputs=(), sets={"default": None}, name="free", sample_time=0.005)
    rows = [(0.1 + 0.01 * k, f"{k}", f"{10 * k}" if k > 4 else "") for k in range(50) if k not in (20, 21, 22)]
    (folder / "free.csv").write_text("time [s],a [rad],b [mm]\n" + "".join(f"{t:.2f},{a},{b}\n" for t, a, b in rows))
    one = replay.load(folder / "free.csv", model, None, (), "linear", print)
    assert one.u.shape == (89, 0) and one.offset == pytest.approx(0.15) and one.times[-1] == pytest.approx(0.44)
    assert one.sensed["a"].values.size == 47 and one.sensed["b"].values[0] == pytest.approx(0.05)
