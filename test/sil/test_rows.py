# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a table repeats, joins, leaves out or rounds is no fault of a vehicle, and hides none: whole diagnoses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import penode_gen
from penode_sil.diagnosis import diagnose
from penode_sil.recordings.measured import load

STEP, FINE, ROWS = 2e-3, 8, 2000
NOISE = {"a_body": 0.0171, "a_wheel": 0.0897, "travel": 0.000115}
UNITS = {"time": "s", "z_road": "m", "a_body": "m/s^2", "a_wheel": "m/s^2", "travel": "m"}
MODEL = """[model]
name = "quarter"
sample_time = "2 ms"
[parameters]
m_b = { value = 380.0, unit = "kg", tolerance = 0.01 }
m_w = { value = 42.0, unit = "kg", tolerance = 0.01 }
c = { value = 20000.0, unit = "N/m", tolerance = 0.01 }
d = { value = 1400.0, unit = "N*s/m", tolerance = 0.01 }
c_t = { value = 200000.0, unit = "N/m", tolerance = 0.01 }
[inputs]
z_road = { unit = "m" }
[bodies]
body = { mass = "m_b", position = "z_b", velocity = "v_b" }
wheel = { mass = "m_w", position = "z_w", velocity = "v_w" }
[elements]
spring = { between = ["body", "wheel"], law = "linear_spring", stiffness = "c" }
damper = { between = ["body", "wheel"], law = "linear_damper", damping = "d" }
tyre = { between = ["wheel", "z_road"], law = "linear_spring", stiffness = "c_t" }
[outputs]
out = { value = "z_b - z_w", unit = "m" }
[sensors]
a_body = { value = "der(v_b)", unit = "m/s^2", noise = 0.0171 }
a_wheel = { value = "der(v_w)", unit = "m/s^2", noise = 0.0897 }
travel = { value = "z_b - z_w", unit = "m", noise = 0.000115 }
"""


def road(time: np.ndarray) -> np.ndarray:
    """0.3 to 25 Hz, from rest."""
    draw = np.random.default_rng(3)
    waves = (
        np.sin(2.0 * np.pi * f * time + draw.uniform(0.0, 6.28)) / np.sqrt(f / 0.3) / (1.0 + f / 6.0) for f in np.geomspace(0.3, 25.0, 50)
    )
    start = np.clip(time / 0.5, 0.0, 1.0)
    return 0.004 * sum(waves) * start**3 * (10.0 - 15.0 * start + 6.0 * start**2)


def drive(z: np.ndarray, h: float, friction: float) -> dict[str, np.ndarray]:
    """Sensors without noise; z is constant in each step of Runge and Kutta."""

    def rates(x, u):
        s, v = x[0] - x[2], x[1] - x[3]
        force = 20000.0 * s + 1400.0 * v + friction * np.tanh(v / 0.01)
        return np.array([x[1], -force / 380.0, x[3], (force - 200000.0 * (x[2] - u)) / 42.0])

    x, seen = np.zeros(4), []
    for u in z:
        k = rates(x, u)
        seen.append((k[1], k[3], x[0] - x[2]))
        k2 = rates(x + 0.5 * h * k, u)
        k3 = rates(x + 0.5 * h * k2, u)
        x = x + h / 6.0 * (k + 2.0 * k2 + 2.0 * k3 + rates(x + h * k3, u))
    return dict(zip(NOISE, np.array(seen).T, strict=True))


class Bench:
    """Signals at the steps of the integration; those of the sensors with noise."""

    def __init__(self, friction: float = 0.0, held: int = 0):
        h = STEP / FINE
        self.time = np.arange(ROWS * FINE) * h
        self.road = road(self.time)
        # a smooth road is constant over a step at its middle; a stepping one at the sample before
        taken = self.road[np.arange(self.time.size) // (held * FINE) * held * FINE] if held else road(self.time + 0.5 * h)
        draw = np.random.default_rng(4)
        exact = drive(taken, h, friction)
        exact["a_wheel"] += 200000.0 / 42.0 * (0.0 if held else self.road - taken)  # it feels the road of that very instant
        self.sensors = {name: value + NOISE[name] * draw.normal(size=value.size) for name, value in exact.items()}
        self.road = taken if held else self.road

    def rows(self) -> dict[str, np.ndarray]:
        cut = slice(None, None, FINE)
        return {"time": self.time[cut], "z_road": self.road[cut], **{name: value[cut] for name, value in self.sensors.items()}}

    def at(self, name: str, instants: np.ndarray) -> np.ndarray:
        """A sensor at instants of its own, to a step of the integration."""
        return self.sensors[name][np.rint(instants / (STEP / FINE)).astype(int)]


def held(bench: Bench, name: str, every: float) -> np.ndarray:
    """A sensor repeated between its samples, which are `every` rows apart."""
    rows = np.arange(ROWS)
    last = np.floor(rows / every + 1e-9) * every
    return bench.at(name, np.round(last * FINE) / FINE * STEP)


def union(bench: Bench) -> dict[str, np.ndarray]:
    """The body's sensor on a clock of its own, 7 ms, in cells between empty ones."""
    own = np.arange(0.25 * STEP, (ROWS - 2) * STEP, 3.5 * STEP)
    table = bench.rows()
    base = np.sort(np.concatenate([table["time"], own]))
    wide = {name: np.full(base.size, np.nan) for name in table}
    for name, values in table.items():
        wide[name][np.searchsorted(base, table["time"])] = values
    wide["time"], wide["a_body"] = base, np.full(base.size, np.nan)
    wide["a_body"][np.searchsorted(base, own)] = bench.at("a_body", own)
    return wide


def lost(table: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    gone = np.random.default_rng(5).random(ROWS) < 0.3
    return {**table, "a_wheel": np.where(gone, np.nan, table["a_wheel"])}


def singles(table: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Seconds in single precision after 10 hours: in steps of 4 ms at rows of 2 ms."""
    return {**table, "time": (table["time"] + 36000.0).astype(np.float32).astype(float)}


def diagnosed(folder: Path, table: dict[str, np.ndarray]):
    (folder / "model.toml").write_text(MODEL)
    header = ",".join(f"{name} [{UNITS[name]}]" for name in table)
    lines = (",".join("" if np.isnan(v) else f"{v:.9g}" for v in row) for row in zip(*table.values(), strict=True))
    (folder / "run.csv").write_text("\n".join([header, *lines]) + "\n")
    model = penode_gen.load(folder / "model.toml")
    recordings = load([folder / "run.csv"], model)
    return diagnose(model, recordings), recordings[0].quality


@pytest.fixture(scope="module")
def sound() -> Bench:
    return Bench()


@pytest.mark.parametrize(
    "made, said",
    [
        (lambda b: {**b.rows(), "a_body": held(b, "a_body", 4.4)}, "a_body repeats its last value"),
        (union, "a_body has empty cells"),
        (lambda b: lost(b.rows()), "a_wheel has no value"),
        (lambda b: singles(b.rows()), "spread evenly"),
        (lambda b: {**b.rows(), "z_road": b.rows()["z_road"][np.arange(ROWS) // 4 * 4]}, "z_road repeats its last value"),
    ],
    ids=["held", "union", "lost", "single", "smooth input, held"],
)
def test_rows_of_a_table_are_no_cause(sound, made, said, tmp_path):
    found, quality = diagnosed(tmp_path, made(sound))
    assert found.verdict == "no_discrepancy" and found.causes == (), found.causes
    assert any(said in line for line in quality.problems)
    if "z_road" in said:
        assert "driven by a smooth one" in found.notes[0]


def test_an_input_in_steps_is_no_cause(tmp_path):
    found, _ = diagnosed(tmp_path, Bench(held=4).rows())
    assert found.verdict == "no_discrepancy" and found.causes == (), found.causes
    assert "driven by its steps" in found.notes[0]


def test_friction_is_found_beside_faults_of_the_file(tmp_path):
    """A held sensor, lost samples and stamps in single precision at once, from a start in motion."""
    bench = Bench(friction=47.0)
    table = bench.rows()
    table["a_body"] = held(bench, "a_body", 4.4)
    found, _ = diagnosed(tmp_path, {name: values[300:] for name, values in singles(lost(table)).items()})
    assert [(c.kind, c.where) for c in found.causes] == [("coulomb_friction", "damper")]
    force = found.causes[0].parameters["force"]
    wide = force.ci95[1] - force.ci95[0]  # twice 1.96 standard deviations; a true value lies beyond 1.5 times that once in 300
    assert abs(force.value - 47.0) < 0.75 * wide < 5.0
