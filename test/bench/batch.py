# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Host speed: many runs at once against one instance in a C loop and against NumPy and SciPy, measured in turns in one run.

Every contender gives states, outputs and sensors of each sample. The C loop is the SiL library (sil/firmware/sil.c) at
the faster of gcc -O2 and -O3 -march=native; NumPy evaluates the same RK4 step in float64, each network layer a
matrix product; SciPy's solve_ivp (RK45) takes one step a sample. Times are of one thread, the best of several rounds.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

import penode_gen
from penode_gen.networks import Affine
from penode_sil.batch import Batch
from penode_sil.signals import VelocityChirp
from penode_sil.targets import Sil

ROOT = Path(__file__).resolve().parents[2]
RUNS, SAMPLES, ROUNDS = 64, 10_000, 5
FLAGS = (("gcc", "-O2"), ("gcc", "-O3", "-march=native"))
LEAST = {"loop": 2.5, "interpreted": 1000.0}  # what is promised: against the C loop, and against NumPy and SciPy
PIECES = 96

# What an explainer fits: a quarter vehicle with many candidate effects at once, 12 states, 35 parameters, no network.
HYPOTHESIS = """
[model]
name = "hypothesis"
sample_time = "1 ms"
[parameters]
m_b = { value = 350, unit = "kg" }
m_w = { value = 90, unit = "kg" }
m_s = { value = 30, unit = "kg" }
c = { value = 10000, unit = "N/m" }
d = { value = 800, unit = "N*s/m" }
c_t = { value = 300000, unit = "N/m" }
d_t = { value = 50, unit = "N*s/m" }
cubic = { value = 1e6, unit = "N/m^3" }
F_c = { value = 35, unit = "N" }
F_s = { value = 50, unit = "N" }
v_s = { value = 0.1, unit = "m/s" }
v_t = { value = 0.01, unit = "m/s" }
quadratic = { value = 200, unit = "N*s^2/m^2" }
d_r = { value = 300, unit = "N*s/m" }
c_bump = { value = 50000, unit = "N/m" }
gap_bump = { value = 0.05, unit = "m" }
c_droop = { value = 40000, unit = "N/m" }
gap_droop = { value = 0.06, unit = "m" }
c_m = { value = 20000, unit = "N/m" }
tau_m = { value = 0.02, unit = "s" }
c_s = { value = 200000, unit = "N/m" }
d_s = { value = 300, unit = "N*s/m" }
alpha = { value = 5000, unit = "N/m" }
beta = { value = 100, unit = "1/m" }
gamma = { value = 50, unit = "1/m" }
reach = { value = 1, unit = "1" }
heat = { value = 400, unit = "J/K" }
fading = { value = 0.004, unit = "1/K" }
loss = { value = 2, unit = "W/K" }
tau_1 = { value = 5, unit = "ms" }
tau_2 = { value = 8, unit = "ms" }
bias = { value = 0.1, unit = "m/s^2" }
scale = { value = 1.02, unit = "1" }
pull = { value = 10, unit = "N" }
load = { value = 4400, unit = "N" }
[inputs]
z_road = { unit = "m" }
[bodies]
body = { mass = "m_b", position = "z_b", velocity = "v_b" }
wheel = { mass = "m_w", position = "z_w", velocity = "v_w" }
seat = { mass = "m_s", position = "z_s", velocity = "v_seat" }
[elements]
spring = { between = ["body", "wheel"], law = "linear_spring", stiffness = "c" }
hard = { between = ["body", "wheel"], law = "cubic_spring", cubic = "cubic" }
damper = { between = ["body", "wheel"], law = "expression", force = "d*v*(1 - fading*T)" }
friction = { between = ["body", "wheel"], law = "stribeck_friction", breakaway = "F_s", coulomb = "F_c", \
stribeck = "v_s", transition = "v_t" }
square = { between = ["body", "wheel"], law = "quadratic_damper", coefficient = "quadratic" }
rebound = { between = ["body", "wheel"], law = "rebound_damper", damping = "d_r" }
bump = { between = ["body", "wheel"], law = "bump_stop", stiffness = "c_bump", gap = "gap_bump" }
droop = { between = ["body", "wheel"], law = "rebound_stop", stiffness = "c_droop", gap = "gap_droop" }
bushing = { between = ["body", "wheel"], law = "expression", force = "c_m*(s - q_m)" }
hysteresis = { between = ["body", "wheel"], law = "expression", force = "alpha*q_h" }
seat_spring = { between = ["seat", "body"], law = "linear_spring", stiffness = "c_s" }
seat_damper = { between = ["seat", "body"], law = "linear_damper", damping = "d_s" }
weight = { between = ["body", "ground"], law = "constant_force", force = "pull" }
tyre = { between = ["wheel", "z_road"], law = "expression", force = "max(c_t*s + d_t*v, 0 - load)" }
[states]
q_m = { unit = "m" }
q_h = { unit = "m" }
T = { unit = "K" }
a_1 = { unit = "m/s^2" }
a_2 = { unit = "m/s^2" }
a_3 = { unit = "m/s^2" }
[equations]
bushing = "der(q_m)*tau_m = s_spring - q_m"
hysteresis = "der(q_h) = reach*v_spring - beta*abs(v_spring)*q_h - gamma*v_spring*abs(q_h)"
heating = "der(T)*heat = d*v_spring^2 - loss*T"
sensor_1 = "der(a_1)*tau_1 = der(v_b) - a_1"
sensor_2 = "der(a_2)*tau_2 = der(v_w) - a_2"
sensor_3 = "der(a_3)*tau_2 = der(v_seat) - a_3"
[outputs]
z_b = { value = "z_b", unit = "m" }
[sensors]
a_body = { value = "scale*a_1 + bias", unit = "m/s^2", noise = 0.02 }
a_wheel = { value = "a_2", unit = "m/s^2", noise = 0.1 }
deflection = { value = "z_b - z_w", unit = "m", noise = 1e-4 }
"""


def road(samples: int) -> np.ndarray:
    """The published chirp [samples, 1], 1 ms."""
    return VelocityChirp(0.15, 1.0, 0.25, np.pi / 2).value(np.arange(samples) * 1e-3)[:, None]


def models(folder: Path) -> dict[str, penode_gen.Model]:
    """The models to run: the nQVM layer by layer and folded, and a hypothesis without networks."""
    nqvm = ROOT / "gen" / "nqvm" / "nqvm.toml"
    (folder / "folded.toml").write_text(f'[model]\nextends = "{nqvm}"\nname = "folded"\npieces = {PIECES}\n')
    (folder / "layered.toml").write_text(f'[model]\nextends = "{nqvm}"\nname = "layered"\npieces = 0\n')
    (folder / "hypothesis.toml").write_text(HYPOTHESIS)
    names = {"nQVM, layer by layer": "layered", "nQVM, folded": "folded", "hypothesis, 12 states": "hypothesis"}
    return {title: penode_gen.load(folder / f"{name}.toml") for title, name in names.items()}


def numpy_rates(model: penode_gen.Model) -> Callable[[float, np.ndarray, float], np.ndarray]:
    """Right-hand side of the nQVM as one would write it in NumPy."""
    value = {name: p.value for name, p in model.parameters.items()}
    networks = {
        name: [(a.shift, a.factor, a.form) if isinstance(a, Affine) else (a.weights, a.bias, a.activation) for a in net.layers]
        for name, net in model.sets["default"].networks.items()
    }

    def evaluate(name: str, x: float) -> float:
        h = np.array([x])
        for a, b, kind in networks[name]:
            if kind == "centre":
                h = (h - a) * b
            elif kind == "rescale":
                h = h * b + a
            else:
                h = a @ h + b
                h = np.maximum(h, 0.0) if kind == "relu" else h
        return float(h[0])

    def rates(t: float, x: np.ndarray, foot: float) -> np.ndarray:
        z_b, z_w, v_b, v_w = x
        force = value["c"] * (z_b - z_w) + value["d"] * (v_b - v_w)
        force += evaluate("spring_net", z_b - z_w) + evaluate("damper_net", v_b - v_w)
        return np.array([v_b, v_w, -force / value["m_b"], (force - value["c_t"] * (z_w - foot)) / value["m_w"]])

    return rates


def numpy_loop(model: penode_gen.Model, u: np.ndarray) -> np.ndarray:
    """States [n, 4] of the RK4 step, one sample after the other."""
    f, h, x, found = numpy_rates(model), model.sample_time, np.zeros(4), []
    for before, now in zip(np.append(u[0], u[:-1]), u[:, 0], strict=True):
        if found:
            k1 = f(0.0, x, before)
            k2 = f(0.0, x + 0.5 * h * k1, 0.5 * (before + now))
            k3 = f(0.0, x + 0.5 * h * k2, 0.5 * (before + now))
            x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + f(0.0, x + h * k3, now))
        found.append(x)
    return np.array(found)


def scipy_loop(model: penode_gen.Model, u: np.ndarray) -> np.ndarray:
    """States [n, 4] by solve_ivp with one step a sample: the tolerances never reject one."""
    f, times = numpy_rates(model), np.arange(len(u)) * model.sample_time

    def right(t, x):
        return f(t, x, np.interp(t, times, u[:, 0]))

    h = model.sample_time
    return solve_ivp(right, (0.0, times[-1]), np.zeros(4), "RK45", times, first_step=h, max_step=h, rtol=1e3, atol=1e3).y.T


def best(contenders: dict[str, tuple[Callable[[], object], int]]) -> dict[str, float]:
    """Nanoseconds a step [thread time] of each contender (what to run, steps it takes): in turns, the best round."""
    found = dict.fromkeys(contenders, np.inf)
    for _ in range(ROUNDS):
        for name, (run, steps) in contenders.items():
            start = time.thread_time_ns()
            run()
            found[name] = min(found[name], (time.thread_time_ns() - start) / steps)
    return found


def measure() -> list[dict[str, str | float]]:
    """How many steps the batch takes in the time of one of the C loop, of NumPy, of SciPy."""
    rows: list[dict[str, str | float]] = []
    fastest, u, few = np.inf, road(SAMPLES), road(100)
    with tempfile.TemporaryDirectory() as folder:
        all_models = models(Path(folder))
        for title, model in all_models.items():
            for dtype in (np.float32, np.float64):
                batch, name = Batch(model, dtype), next(iter(model.parameters))
                varied = {name: model.parameters[name].value * np.linspace(0.9, 1.1, RUNS)}
                keep = {"outputs": [s.name for s in model.outputs], "states": model.states}
                contenders: dict[str, tuple[Callable[[], object], int]] = {
                    " ".join(c): (partial(Sil(model, dtype, c).instance().run, u), SAMPLES) for c in FLAGS
                }
                contenders["batch"] = (lambda b=batch, p=varied, k=keep: b.run(u, parameters=p, **k), RUNS * SAMPLES)
                ns = best(contenders)
                if title.startswith("nQVM"):
                    fastest = min(fastest, ns["batch"])
                rows.append(
                    {"model": title, "real": np.dtype(dtype).name, "ratio": round(min(ns[" ".join(c)] for c in FLAGS) / ns["batch"], 1)}
                )
        model = all_models["nQVM, layer by layer"]
        exact = Batch(model).run(few, states=model.states).x[0]
        for loop, apart in ((numpy_loop, 1e-12), (scipy_loop, 1e-3)):  # SciPy's method is another one
            assert np.abs(loop(model, few) - exact).max() < apart * np.abs(exact).max(), f"{loop.__name__} computes something else"
        ns = best({"NumPy": (lambda: numpy_loop(model, few), 100), "SciPy": (lambda: scipy_loop(model, few), 100)})
    return rows + [{"model": f"a loop in {name}, against nQVM folded in float", "ratio": round(ns[name] / fastest)} for name in ns]


def too_slow(rows: list[dict[str, str | float]]) -> list[str]:
    """What falls short of the promise."""
    return [
        f"{row['model']}: {row['ratio']} times instead of {LEAST[kind]}"
        for row in rows
        if float(row["ratio"]) < LEAST[kind := "loop" if "real" in row else "interpreted"]
    ]


if __name__ == "__main__":
    for found in measure():
        print(*found.values())
