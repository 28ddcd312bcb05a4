# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Other answers that physics allows: exactly, or because their best fit leaves less of the effect than the mis-modelling at its place."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from . import effects
from .effects import Array
from .signals import RATE, beside, rms
from .world import SAMPLE, World

LEFT = 1.0  # of the mis-modelling's RMS: what is left then is no larger than what is wrong anyway
BARE = {
    "time shift": "one sensor: plant and effects do not depend on time, a later input is a later answer",
    "linear": "one sensor and a linear plant: a factor of the input is a factor of the answer",
    "same force": "a constant on the input is a constant force on the body that it drives",
    "settled": "at rest a constant force is a constant deflection, and so is a bias of the sensor that alone sees it",
}


def curves(s: Array, v: Array, rate: float) -> Iterator[tuple[str, Array]]:
    """Textbook forms along a motion, over a grid of their shapes."""
    a, b = (float(np.sqrt(np.mean(x**2))) for x in (s, v))
    for w in (0.01, 0.03, 0.1, 0.2):
        yield "coulomb_friction", np.tanh(v / (w * b))
        for c in (0.3, 0.6, 1.0):
            for more in (0.3, 1.0, 2.0):
                yield "stribeck_friction", np.tanh(v / (w * b)) * (1 + more * np.exp(-((v / (c * b)) ** 2)))
    yield "cubic_spring", s**3
    yield "asymmetric_spring", np.minimum(s, 0)
    yield "asymmetric_damper", np.abs(v)
    yield "quadratic_damper", v * np.abs(v)
    for g in (0.3, 0.6, 0.9, 1.2, 1.5):
        yield "bump_stop", np.maximum(s - g * a, 0)
        yield "bump_stop", np.minimum(s + g * a, 0)
        yield "backlash", np.clip(s, -g * a, g * a)
        yield "degressive_damper", v * np.abs(v) / (g * b + np.abs(v))
    yield "damper_fading", v * np.linspace(0, 1, len(v))
    for x in (0.1, 0.2, 0.4, 0.8):
        yield "bouc_wen", slip(v, x * a, 1 / rate)
    for t in (0.3, 1.0, 3.0):
        n = max(t * a / b * rate, 1.0)
        yield "maxwell_bushing", s - effects.lagged(s, n)


def slip(v: Array, presliding: float, h: float) -> Array:
    """Hysteresis z' = (v - abs(v) z)/presliding, exact over a sample."""
    z = np.zeros(len(v))
    for i in range(1, len(v)):
        goal = np.sign(v[i])
        z[i] = goal + (z[i - 1] - goal) * np.exp(-abs(v[i]) * h / presliding)
    return z


def _near(world: World, i: int) -> list[dict]:
    e, r = world.effects[i], world.runs["train_1"]
    f = next(r.force[j] for j, law in enumerate(world.plant.laws) if law.role == f"effect{i}")
    wrong, columns = rms(world.wrong(e.site)), world.columns(e.site)
    best: dict[str, float] = {}
    for kind, curve in curves(r.s[e.site], r.v[e.site], 1 / SAMPLE):
        left = rms(beside(f, curve, *columns)) / wrong
        best[kind] = min(left, best.get(kind, np.inf))
    return [
        {"kind": k, "where": world.places(e), "why": f"its best fit leaves {x:.2f} of the mis-modelling there"}
        for k, x in best.items()
        if x < LEFT and k != e.kind
    ]


def equivalents(world: World, i: int) -> list[dict]:
    """Answers other than the effect itself that are right as well, each with the reason."""
    e, kind = world.effects[i], world.kind
    found: list[dict] = []
    one = list(kind.sensors) if len(kind.sensors) == 1 else []
    body = [kind.masses[0][0], *next((s.elements for s, _ in kind.sites.values() if s.coordinate == 0), ())]
    pushed = kind.drive() >= 0

    def also(what: str, where: list[str], why: str) -> None:
        found.append({"kind": what, "where": where, "why": BARE.get(why, why)})

    if e.kind in effects.STRUT:
        found += _near(world, i)
    if e.kind == "input_delay" and one:
        also("sensor_delay", one, "time shift")
    if e.kind == "sensor_delay" and one and pushed:
        also("input_delay", [*kind.inputs, "actuator"], "time shift")
    if e.kind == "input_gain" and one:
        also("sensor_scale", one, "linear")
    if e.kind == "input_gain" and world.tolerance is None:
        also("wrong_parameter", [], "no parameter is vouched for: a factor of the input is its inverse on all of them")
        found[-1]["parameters"] = list(kind.values)
    if e.kind in ("input_delay", "input_lag", "input_hold"):
        found += _late(world, e.kind)
    position = next((k for k, (_, _, what, _) in kind.sensors.items() if what == "q"), "")
    steady = kind.name in ("quarter", "rig", "joint")
    if e.kind == "input_offset":
        also("constant_force", body, "same force")
    if e.kind == "constant_force" and pushed:
        also("input_offset", [*kind.inputs, "actuator"], "same force")
    if e.kind in ("constant_force", "input_offset") and steady:
        also("sensor_bias", [position], "settled")
    if e.kind == "sensor_bias" and e.site == position and steady:
        also("constant_force", body, "settled")
        if pushed:
            also("input_offset", [*kind.inputs, "actuator"], "settled")
    return found


def _late(world: World, true: str) -> list[dict]:
    """Delay, lag and hold in place of each other, where what is left of the force is below the mis-modelling."""
    e = next(x for x in world.effects if x.kind == true)
    base = next(k for k, (s, _) in world.kind.sites.items() if s.coordinate == 0)
    u = world.records["train_1"].u[:, 0]
    acts = effects.input_changed(true, u, e.x, e.sign, RATE)[0]
    found = []
    for kind in ("input_delay", "input_lag", "input_hold"):
        sizes = e.x * np.geomspace(0.3, 3.0, 60)
        left = min(rms(effects.input_changed(kind, u, x, e.sign, RATE)[0] - acts) for x in sizes) / rms(world.wrong(base))
        if kind != true and left < LEFT:
            names = [*world.kind.inputs, "actuator"]
            found.append({"kind": kind, "where": names, "why": f"its best fit leaves {left:.2f} of the mis-modelling there"})
            if kind == "input_delay" and len(world.kind.sensors) == 1:
                found.append({"kind": "sensor_delay", "where": list(world.kind.sensors), "why": BARE["time shift"]})
    return found


def truth(world: World) -> dict:
    """Kind, place, parameters, sizes and equivalents of every effect."""
    found = [
        {
            "kind": e.kind,
            "where": world.places(e),
            "parameters": e.parameters,
            "ratio": round(e.ratio, 3),
            "share": round(e.share, 4),
            "equivalents": equivalents(world, i),
            "companions": world.companions(e),
        }
        for i, e in enumerate(world.effects)
    ]
    return {
        "seed": world.seed,
        "index": world.index,
        "stratum": world.stratum,
        "group": world.group or ("single" if found else "null"),
        "plant": world.kind.name,
        "tolerance": world.tolerance,
        "mismodelling": round(world.e, 4),
        "effects": found,
    }
