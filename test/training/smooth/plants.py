# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Plants with smooth forces, drawn by number (plants.c): recordings, the model files to train, and what the forces are."""

from __future__ import annotations

import ctypes
import functools
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parent.parent))
import generator

Array = NDArray[np.float64]
KINDS = ("alone", "beside", "two", "tank")  # networks alone, networks beside laws, one tanh network of two inputs, a network in an equation
NOISE = 0.02, 0.1  # [m/s^2], times 1 or 5
LEAD, SECONDS = 8.0, 42.0


class _Car(ctypes.Structure):
    _fields_ = [(n, ctypes.c_double) for n in ("m_b", "m_w", "c_t", "d_t")]
    _fields_ += [("spring", ctypes.c_double * 6), ("damper", ctypes.c_double * 5), ("coupled", ctypes.c_double * 2)]


@dataclass(frozen=True, eq=False)
class Plant:
    """A drawn plant: its recording as rows of a file, the model file, and the forces of its networks as functions of where they were
    visited ([n] or [n, inputs]), with all inputs there."""

    kind: str
    number: int
    model: str
    table: str
    forces: dict[str, tuple[Callable[[Array], Array], Array]]

    def write(self, folder: Path) -> tuple[Path, Path]:
        """Model file and recording."""
        paths = folder / "plant.toml", folder / "rec.csv"
        for path, text in zip(paths, (self.model, self.table), strict=True):
            path.write_text(text)
        return paths


@functools.cache
def _library() -> ctypes.CDLL:
    folder = Path(tempfile.mkdtemp())
    source = Path(__file__).with_name("plants.c")
    subprocess.run(["gcc", "-std=c99", "-O2", "-fPIC", "-shared", str(source), "-lm", "-o", str(folder / "plants.so")], check=True)
    library, pointer, number = ctypes.CDLL(str(folder / "plants.so")), ctypes.c_void_p, ctypes.c_double
    for name, given in (
        ("spring", (pointer, number)),
        ("damper", (pointer, number)),
        ("both", (pointer, number, number)),
        ("lost", (pointer, number)),
    ):
        function = getattr(library, name)
        function.argtypes, function.restype = given, number
    library.drive.argtypes = (pointer, pointer, pointer, ctypes.c_int, ctypes.c_int, number, pointer)
    library.heat.argtypes = (pointer, number, pointer, ctypes.c_int, number, pointer)
    return library


def draw(kind: str, number: int, seconds: float = SECONDS) -> Plant:
    """The plant of a kind and a number."""
    random = np.random.default_rng([KINDS.index(kind), number, 51])
    return _tank(number, random, seconds / SECONDS) if kind == "tank" else _car(kind, number, random, seconds)


def _car(kind: str, number: int, random: np.random.Generator, seconds: float) -> Plant:
    u = random.uniform
    car = _Car(u(250, 450), u(35, 60), u(150e3, 250e3), u(0, 300))
    side = 1.0 if u() < 0.5 else -1.0
    car.spring[:] = u(10e3, 24e3), u(0, 4e6), u(-3e3, 12e3), side * u(0.01, 0.03), u(0, 60), u(0.005, 0.02)
    car.damper[:] = u(300, 900), u(50, 400), u(0.05, 0.4), u(-200, 700), (1.0 if u() < 0.5 else -1.0) * u(0.1, 0.5)
    car.coupled[:] = (u(1e3, 4e3), u(0.05, 0.3)) if kind == "two" else (0.0, 1.0)
    loud = 1.0 if u() < 0.5 else 5.0
    rows, every = round((LEAD + seconds) * 1000.0), 10
    height, rate = generator.road(1000 + number, 5.0, rows * 1e-3)
    y = np.zeros((rows, 4))
    _library().drive(ctypes.byref(car), height.ctypes.data, rate.ctypes.data, rows, every, 2.0 * generator.FINE, y.ctypes.data)
    lead = int(LEAD * 1000)
    shown, road = y[lead:], height[lead * 2 * every : rows * 2 * every : 2 * every]
    a = [shown[:, i] + loud * s * random.standard_normal(len(shown)) for i, s in enumerate(NOISE)]
    lines = (f"{k * 1e-3:.3f},{z:.9g},{b:.7g},{w:.7g}" for k, (z, b, w) in enumerate(zip(road, *a, strict=True)))
    table = "time [s],z_road [m],a_body [m/s^2],a_wheel [m/s^2]\n" + "\n".join(lines) + "\n"
    s, v, of = shown[:, 2], shown[:, 3], ctypes.byref(car)
    c, d = (8000.0, 300.0) if kind == "beside" else (0.0, 0.0)
    forces: dict[str, tuple[Callable[[Array], Array], Array]] = {
        "spring_net": (lambda x: np.array([_library().spring(of, k) - c * k for k in x]), s),
        "damper_net": (lambda x: np.array([_library().damper(of, k) - d * k for k in x]), v),
    }
    if kind == "two":
        forces = {"both_net": (lambda x: np.array([_library().both(of, *k) for k in x]), np.stack([s, v], axis=1))}
    return Plant(kind, number, _car_model(kind, car, loud, free=bool(u() < 0.5)), table, forces)


def _car_model(kind: str, car: _Car, loud: float, free: bool) -> str:
    """The model file; `free`: all parameters but one mass are a few per cent off and known to 10 %."""
    off = {"m_b": 1.0, "m_w": 0.96, "c_t": 1.05, "d_t": 0.95} if free else {}
    known = {n: "exact = true" if n == "m_b" or not free else "tolerance = 0.1" for n in ("m_b", "m_w", "c_t", "d_t")}
    unit = {"m_b": "kg", "m_w": "kg", "c_t": "N/m", "d_t": "N*s/m"}
    parameters = [f'{n} = {{ value = {getattr(car, n) * off.get(n, 1.0):.9g}, unit = "{unit[n]}", {known[n]} }}' for n in unit]
    elements = [
        'tyre = { between = ["wheel", "z_road"], law = "linear_spring", stiffness = "c_t" }',
        'tyre_damper = { between = ["wheel", "z_road"], law = "linear_damper", damping = "d_t" }',
    ]
    if kind == "beside":
        parameters += ['c = { value = 8000, unit = "N/m", exact = true }', 'd = { value = 300, unit = "N*s/m", exact = true }']
        elements += [
            'spring = { between = ["wheel", "body"], law = "linear_spring", stiffness = "c" }',
            'damper = { between = ["wheel", "body"], law = "linear_damper", damping = "d" }',
        ]
    if kind == "two":
        networks = ['both_net = { inputs = ["m", "m/s"], output = "N" }']
        shapes = ['both_net = { layers = [16, 16], activation = "tanh" }']
        elements += ['both = { between = ["wheel", "body"], law = "network", network = "both_net" }']
    else:
        networks = ['spring_net = { inputs = ["m"], output = "N" }', 'damper_net = { inputs = ["m/s"], output = "N" }']
        shapes = ["spring_net = { layers = [16, 16] }", "damper_net = { layers = [16, 16] }"]
        elements += [f'{n}_nn = {{ between = ["wheel", "body"], law = "network", network = "{n}_net" }}' for n in ("spring", "damper")]
    noise = [
        f'{n} = {{ value = "der({v})", unit = "m/s^2", noise = {loud * s:g} }}'
        for n, v, s in zip(("a_body", "a_wheel"), ("v_b", "v_w"), NOISE, strict=True)
    ]
    parts = [
        '[model]\nname = "plant"\nsample_time = "1 ms"',
        "[parameters]\n" + "\n".join(parameters),
        '[inputs]\nz_road = { unit = "m" }',
        '[bodies]\nbody = { mass = "m_b", position = "z_b", velocity = "v_b" }',
        'wheel = { mass = "m_w", position = "z_w", velocity = "v_w" }',
        "[elements]\n" + "\n".join(elements),
        "[networks]\n" + "\n".join(networks),
        '[outputs]\nz_b = { value = "z_b", unit = "m" }',
        "[sensors]\n" + "\n".join(noise),
        "[sets.default]\n" + "\n".join(shapes),
    ]
    return "\n\n".join(parts) + "\n"


TANK = """[model]
name = "plant"
sample_time = "60 s"

[parameters]
C = {{ value = {capacity:.9g}, unit = "J/K", tolerance = 0.1 }}
T0 = {{ value = 293, unit = "K", exact = true }}

[inputs]
P = {{ unit = "W" }}

[states]
T = {{ unit = "K", start = 293 }}

[variables]
Q = {{ unit = "W" }}

[networks]
loss = {{ inputs = ["K"], output = "W" }}

[equations]
heat = "der(T)*C = P - Q"
lost = "Q = loss({where})"

[outputs]
y = {{ value = "T", unit = "K" }}

[sensors]
T_meas = {{ value = "T", unit = "K", noise = {noise} }}

[sets.default]
loss = {{ layers = [16, 16] }}
"""


def _tank(number: int, random: np.random.Generator, part: float) -> Plant:
    """A network in an equation, of the temperature above the room, or of the absolute one."""
    u, rows = random.uniform, round(90 * 60 * part)
    capacity, a = u(150e3, 400e3), np.array([u(2, 5), u(0.0, 0.08), u(-1, 4), u(10, 30)])
    power = np.repeat(u(0, 500, 1 + rows // 60), np.resize(random.integers(60, 400, 12), 1 + rows // 60))[:rows]
    soft = np.hanning(27)[1:-1] / np.hanning(27).sum()
    power = np.convolve(np.pad(power, 12, "edge"), soft, "valid")
    above = np.zeros(rows)
    _library().heat(a.ctypes.data, capacity, power.ctypes.data, rows, 60.0, above.ctypes.data)
    noise, absolute = (0.03 if u() < 0.5 else 0.1), bool(u() < 0.5)
    shown = above + 293.0 + noise * random.standard_normal(rows)
    lines = (f"{k * 60},{p:.9g},{t:.9g}" for k, (p, t) in enumerate(zip(power, shown, strict=True)))
    table = "time [s],P [W],T_meas [K]\n" + "\n".join(lines) + "\n"
    model = TANK.format(capacity=capacity * u(0.93, 1.07), where="T" if absolute else "T - T0", noise=noise)
    away = 293.0 if absolute else 0.0
    return Plant(
        "tank", number, model, table, {"loss": (lambda x: np.array([_library().lost(a.ctypes.data, k - away) for k in x]), above + away)}
    )
