# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Pictures of plants of five kinds: drawn to the scale of their data, with forces that are those that were hidden."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from test_diagnosis import MODEL, drive, record, road

import penode_gen
from penode_sil.diagnosis.catalogue import MEANING, experiments
from penode_sil.diagnosis.report import figure as fig, forces, panels
from penode_sil.diagnosis.study import residual, restoring, study
from penode_sil.diagnosis.study.driven import experiment
from penode_sil.recordings.measured import load

FACTOR = 3.0  # between an axis and what is drawn in it
FINE = 20  # steps of the integration in an interval
SHARES = ("coherence", "share of residual over noise")  # axes from 0 to 1, whatever is drawn
LOST = 700  # samples from one stretch of three that is lost to the next


@dataclass(frozen=True)
class Plant:
    """A plant that is not what its file says. `rates`(x, u) of its states; `measured` of them; `hidden`(s, v): the force that the file
    lacks at `place`, positive where it pulls the ends together."""

    text: str
    step: float
    samples: int
    noise: float
    start: tuple[float, ...]
    drive: Callable[[np.ndarray], np.ndarray] | None
    rates: Callable[[np.ndarray, float], list[float]]
    measured: tuple[int, ...]
    place: str = ""
    hidden: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None

    def write(self, path: Path) -> tuple[Path, Path]:
        """Its model file and a recording; of a plant with a hidden force some samples of the last sensor are lost."""
        path.write_text(self.text)
        time, h = np.arange(self.samples) * self.step, self.step / FINE
        u = self.drive(time) if self.drive else np.zeros_like(time)
        x, states = np.array(self.start), []
        for a, b in zip(u, np.append(u[1:], u[-1]), strict=True):
            states.append(x)
            for j in range(FINE):
                at = a + (b - a) * (j + 0.5) / FINE
                x = x + h * np.array(self.rates(x + 0.5 * h * np.array(self.rates(x, at)), at))
        z = np.array(states)[:, self.measured]
        z = z + self.noise * np.random.default_rng(5).standard_normal(z.shape)
        loaded = penode_gen.load(path)
        rows = [",".join(f"{s.name} [{s.unit}]" for s in (*loaded.inputs, *loaded.sensors))]
        for k, values in enumerate(np.column_stack([u, z] if self.drive else [z])):
            texts = [f"{v:.9g}" for v in values]
            rows.append(",".join([*texts[:-1], "" if self.hidden and k % LOST in range(300, 303) else texts[-1]]))
        recording = path.with_suffix(".csv")
        recording.write_text("\n".join(f"{t},{row}" for t, row in zip(["time [s]", *time], rows, strict=True)) + "\n")
        return path, recording


def tones(seed: int, size: float, low: float, high: float) -> Callable[[np.ndarray], np.ndarray]:
    """A sum of ten sines of frequencies [Hz] between two."""
    draw = np.random.default_rng(seed)
    parts = [(draw.uniform(0.3, 1.0) * size, draw.uniform(low, high), draw.uniform(0, 6)) for _ in range(10)]
    return lambda t: sum(a * np.sin(2 * np.pi * f * t + p) for a, f, p in parts)


def text(name: str, step: str, values: dict[str, tuple[float, str]], rest: str) -> str:
    """A model file of exact parameters."""
    lines = [f'{k} = {{ value = {v}, unit = "{unit}", exact = true }}' for k, (v, unit) in values.items()]
    return "\n".join([f'[model]\nname = "{name}"\nsample_time = "{step}"\n[parameters]', *lines, rest, ""])


PLANTS = {
    "pendulum": Plant(
        text(
            "pendulum",
            "2 ms",
            {"J": (1.0, "kg*m^2"), "k": (64.0, "N*m/rad"), "d": (0.06, "N*m*s/rad")},
            '[bodies]\narm = { inertia = "J", position = "phi", velocity = "w" }\n[elements]\n'
            'gravity = { between = ["arm", "ground"], law = "linear_spring", stiffness = "k" }\n'
            'bearing = { between = ["arm", "ground"], law = "linear_damper", damping = "d" }\n'
            '[outputs]\ny = { value = "phi", unit = "rad" }\n[sensors]\nangle = { value = "phi", unit = "rad", noise = 1e-4 }',
        ),
        *(2e-3, 4000, 1e-4, (1.2, 0.0), None),
        lambda x, u: [x[1], -64.0 * np.sin(x[0]) - 0.06 * x[1]],
        *((0,), "gravity", lambda s, v: 64.0 * (np.sin(s) - s)),
    ),
    "two-mass drive": Plant(
        text(
            "drive",
            "2 ms",
            {"J_m": (0.02, "kg*m^2"), "J_l": (0.1, "kg*m^2"), "k": (60.0, "N*m/rad"), "d": (0.06, "N*m*s/rad"), "d_l": (0.2, "N*m*s/rad")},
            '[inputs]\ntau = { unit = "N*m" }\n[bodies]\nmotor = { inertia = "J_m", position = "p_m", velocity = "w_m" }\n'
            'load = { inertia = "J_l", position = "p_l", velocity = "w_l" }\n[elements]\n'
            'shaft = { between = ["motor", "load"], law = "linear_spring", stiffness = "k" }\n'
            'loss = { between = ["motor", "load"], law = "linear_damper", damping = "d" }\n'
            'bearing = { between = ["load", "ground"], law = "linear_damper", damping = "d_l" }\n'
            'gap = { between = ["motor", "ground"], law = "expression", force = "-tau" }\n'
            '[outputs]\ny = { value = "w_l", unit = "rad/s" }\n[sensors]\nfast = { value = "w_m", unit = "rad/s", noise = 0.02 }\n'
            'slow = { value = "w_l", unit = "rad/s", noise = 0.02 }',
        ),
        *(2e-3, 5000, 0.02, (0.0, 0.0, 0.0, 0.0), tones(1, 0.6, 0.1, 8.0)),
        lambda x, u: [
            *x[2:],
            (u - 60.0 * (x[0] - x[1]) - 0.06 * (x[2] - x[3])) / 0.02,
            (60.0 * (x[0] - x[1]) + 0.06 * (x[2] - x[3]) - 0.2 * x[3] - 0.25 * np.tanh(x[3] / 0.05)) / 0.1,
        ],
        *((2, 3), "bearing", lambda s, v: 0.25 * np.tanh(v / 0.05)),
    ),
    "model car": Plant(
        text(
            "car",
            "20 ms",
            {"m": (1.6, "kg"), "F": (10.0, "N"), "d": (0.7, "N*s/m")},
            '[inputs]\nu = { unit = "1" }\n[bodies]\ncar = { mass = "m", position = "x", velocity = "v" }\n[elements]\n'
            'losses = { between = ["car", "ground"], law = "linear_damper", damping = "d" }\n'
            'motor = { between = ["car", "ground"], law = "expression", force = "-F*u" }\n'
            '[outputs]\ny = { value = "v", unit = "m/s" }\n[sensors]\nspeed = { value = "v", unit = "m/s", noise = 0.01 }',
        ),
        *(0.02, 2000, 0.01, (0.0, 0.0), lambda t: 0.3 + tones(3, 0.08, 0.03, 0.4)(t)),
        lambda x, u: [x[1], (10.0 * u - 0.7 * x[1] - 1.2 * np.tanh(x[1] / 0.1)) / 1.6],
        *((1,), "losses", lambda s, v: 1.2 * np.tanh(v / 0.1)),
    ),
    "tank": Plant(
        text(
            "tank",
            "60 s",
            {"C": (250000.0, "J/K"), "k": (4.0, "W/K"), "T0": (293.0, "K")},
            '[inputs]\nP = { unit = "W" }\n[states]\nT = { unit = "K", start = 293 }\n[equations]\nheat = "der(T)*C = P - k*(T - T0)"\n'
            '[outputs]\ny = { value = "T", unit = "K" }\n[sensors]\nT_meas = { value = "T", unit = "K", noise = 0.03 }',
        ),
        *(60.0, 1200, 0.03, (293.0,), lambda t: 250.0 + tones(4, 60.0, 1e-5, 3e-4)(t)),
        lambda x, u: [(u - 4.0 * (x[0] - 293.0) - 0.06 * (x[0] - 293.0) ** 2) / 250000.0],
        (0,),
    ),
}
NAMES = ("quarter car", *PLANTS)


@pytest.fixture(scope="module", params=NAMES)
def plant(request, tmp_path_factory):
    """Name, study, pictures of all sensors, and of all places."""
    folder = tmp_path_factory.mktemp("plant")
    if request.param in PLANTS:
        file, recording = PLANTS[request.param].write(folder / "plant.toml")
    else:
        z = road(11)
        file, recording = folder / "car.toml", record(folder / "a.csv", z, drive(z, lambda s, v: 3e8 * s**3), 12)
        file.write_text(MODEL)
    model = penode_gen.load(file)
    found = study.begin(model, [experiment(m, model) for m in load([recording], model)])
    e, before = found.experiments[0], found.null.simulated[0]
    shown = residual.channels(e, model, before, None, residual.noise_floor(found, 0))
    surfaces = restoring.surfaces(found, None, None)
    return request.param, found, [panels.panel(c, 2000) for c in shown], [forces.surface(s) for s in surfaces]


def extent(f: fig.Figure) -> tuple[float, float]:
    """The shares of the plot, across and up, that its lines, points and tiles take; above 1 where some are outside."""
    across, up = [], []
    for m in (m for m in f.marks if m.kind in ("line", "dots", "tile")):
        for part in m.path.split("M")[1:]:
            if m.kind == "tile":
                x0, y0, x1, y1, _ = (int(n) for n in re.findall(r"-?\d+", part))
                across += [x0, x1]
                up += [y0, y1]
                continue
            n = [int(k) for k in re.findall(r"-?\d+", part)]
            across += list(np.cumsum([n[0], *(n[2::2] if "l" in part else [])]))
            up += list(np.cumsum([n[1], *(n[3::2] if "l" in part else [])]))
    return (max(across) - min(across)) / fig.WIDE, (max(up) - min(up)) / fig.HIGH


def test_axes_have_the_scale_of_their_data(plant):
    name, _, sensors, places = plant
    figures = [f for p in (*sensors, *places) for f in p.figures]
    assert len(figures) >= 3 and (places or name == "tank")
    for f in figures:
        wide, high = extent(f)
        assert 1.0 / FACTOR < wide < FACTOR, (name, f.title, wide)
        assert f.y.name in SHARES or 1.0 / FACTOR < high < FACTOR, (name, f.title, high)
        assert f.says.endswith(".") and len(f.says) > 20


def test_missing_forces_are_those_that_were_hidden(plant):
    """Also where samples are lost: a residual taken for 0 there would be a jump that takes a force of many times that size."""
    name, _, _, places = plant
    if name not in PLANTS or PLANTS[name].hidden is None:
        return
    (s,) = (p.s for p in places if p.s.place == PLANTS[name].place)
    missing, hidden = s.measured - s.nominal, PLANTS[name].hidden(s.s, s.v)
    assert restoring.rms(missing - hidden) < 0.5 * restoring.rms(hidden)
    assert 1.0 / FACTOR < np.max(np.abs(missing)) / np.max(np.abs(hidden)) < FACTOR


def test_deflections_that_no_sensor_shows_are_not_drawn(plant):
    name, _, _, places = plant
    known = {(p.s.place, p.s.located) for p in places}
    want = {
        "quarter car": {("spring", True), ("tyre", True)},
        "pendulum": {("gravity", True)},
        "two-mass drive": {("shaft", True), ("bearing", False)},
        "model car": {("losses", False)},
        "tank": set(),
    }
    assert known == want[name]
    for p in places:
        drawn = {f.x.name for f in p.figures} & {"deflection", "angle"}
        assert bool(drawn) == p.s.located and bool(p.note) != p.s.located


def test_the_next_experiment_fits_the_plant(plant):
    name, found, _, _ = plant
    want = {
        "quarter car": ("move z_road as a slow triangle", "broadband noise"),
        "pendulum": ("release it", "release it"),
        "two-mass drive": ("switch tau off and let it coast", "coast to rest"),
        "model car": ("switch u off and let it coast", "coast to rest"),
        "tank": ("step P to two levels", "step P to two levels"),
    }[name]
    assert want[0] in experiments.proposed(found.model, ["coulomb_friction"]) and want[1] in experiments.proposed(found.model)
    for kind in MEANING:
        assert "{" not in experiments.proposed(found.model, [kind])


def test_experiments_are_for_kinds_of_the_catalogue():
    assert set(experiments.BY_KIND) <= set(MEANING)
    assert sum(map(len, experiments.SHOWN.values())) == len(experiments.BY_KIND)
