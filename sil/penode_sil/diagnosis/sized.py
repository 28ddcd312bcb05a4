# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""From fitted elementary laws to the parameters that a vehicle engineer asks for, with intervals: a kind a function.

Each parameter is a function of the whole curve of its kind, not of a formula: the friction force is where the curve ends, a gap where it
begins. Its interval follows from the covariance of all that was fitted (delta method).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from penode_gen import units
from penode_gen.model import Model

from .build import Term
from .catalogue import lines
from .explanation import Explanation, Group
from .hypotheses import HALVES, STRIBECK, Basis, Fault, lag, size, warm
from .naming import Curve, line
from .plant import Place, in_place, nominal
from .result import Value
from .study import Study

SLIDING = 0.1  # of the rates: friction there slides; its line, gone on to no rate, is the same however a damper beside it is parted from it
Array = NDArray[np.float64]
Values = Mapping[object, float]
Parameters = dict[str, tuple[str, Callable[[Values], float]]]  # name: unit, and value as a function of all that is free


@dataclass(frozen=True, eq=False)
class _Cause:
    """The terms of one cause with the names of their elements, their place, and where deflection [m] and rate [m/s] are looked at."""

    study: Study
    e: Explanation
    terms: Sequence[Term]
    names: Sequence[str]
    place: Place
    reach: float
    speed: float

    @property
    def curve(self) -> Curve:
        return Curve(self.terms, self.names)

    @property
    def s(self) -> Array:
        return np.linspace(-self.reach, self.reach, 401)

    @property
    def v(self) -> Array:
        return np.linspace(-self.speed, self.speed, 401)

    @property
    def zero(self) -> Array:
        """As many zeros as there are deflections, or rates."""
        return np.zeros(401)

    @property
    def up(self) -> Array:
        """The rates above zero."""
        return self.v[self.v > 0.0]

    def damping(self, p: Values) -> float:
        """Damping of the linear dampers at the place."""
        return nominal(self.study.model, self.place, "linear_damper", "damping", p)

    def stiffness(self, p: Values) -> float:
        """Stiffness of the linear springs at the place."""
        return nominal(self.study.model, self.place, "linear_spring", "stiffness", p)


def values(study: Study, e: Explanation, group: Group) -> dict[str, Value]:
    """All parameters of a cause with their intervals."""
    free = e.fit.free
    centre = {f.target: f.value for f in free}
    terms = [t for t in e.terms if t.group == group]
    what = terms[0].candidate.what
    reach, speed = size([s.motions[what.place] for s in study.seen]) if isinstance(what, Basis) else (1.0, 1.0)
    found = functions(study, e, group, reach, speed)
    covariance = e.fit.covariance() * max(1.0, e.fit.chi2 / len(e.fit.residual))
    deviation = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    result = {}
    for name, (unit, function) in in_place(found, what, study.places).items():
        middle = float(function(centre))
        slope = np.zeros(len(free))
        for i, f in enumerate(free):
            if f.target[0] == "skew" or (f.target[0] == "start" and group[0] != "damper_fading"):
                continue
            step = min(0.1 * deviation[i], 0.01) if f.log else 0.1 * deviation[i]
            if step > 0.0:
                moved = float(function(centre | {f.target: float(f.at(step))}))
                slope[i] = (moved - middle) / step
        sigma = float(np.sqrt(max(slope @ covariance @ slope, 0.0)))
        result[name] = Value(middle, unit, (middle - 1.96 * sigma, middle + 1.96 * sigma))
    return result


def functions(study: Study, e: Explanation, group: Group, reach: float, speed: float) -> Parameters:
    """The parameters of one cause."""
    terms, names = zip(*[(t, n) for t, n in zip(e.terms, e.built.names, strict=True) if t.group == group], strict=True)
    what = terms[0].candidate.what
    if isinstance(what, str):
        return {what: (study.model.parameters[what].unit, lambda p: p[what])}
    if isinstance(what, Fault):
        shown = max(float(np.max(np.abs(z[:, what.sensor]))) for z in e.fit.simulated)
        return _fault(study.model, group[0], what, shown)
    if isinstance(what, tuple):
        return _mass(names[0])  # others only help it
    return OF[group[0]](_Cause(study, e, terms, names, study.places[what.place], reach, speed))


def _mass(name: str) -> Parameters:
    m, k, d = (f"{name}_{key}" for key in ("mass", "stiffness", "damping"))
    return {
        "frequency": ("Hz", lambda p: np.sqrt(p[k] / p[m]) / (2 * np.pi)),
        "mass": ("kg", lambda p: p[m]),
        "damping_ratio": ("1", lambda p: p[d] / (2 * np.sqrt(p[k] * p[m]))),
    }


def having(terms: Sequence[Term], *shapes: str) -> list[int]:
    """Which terms have one of these shapes; others only correct their form."""
    return [i for i, t in enumerate(terms) if not t.candidate.what.shapes.keys().isdisjoint(shapes)]


def _fault(model: Model, kind: str, what: Fault, shown: float) -> Parameters:
    """Parameters of a fault of a sensor; `shown` is the largest value that it shows."""
    unit, j = model.sensors[what.sensor].unit, what.sensor
    si = units.si(unit)
    match kind:
        case "sensor_bias":
            return {"bias": (si, lambda p: p.get(("bias", j), 0.0))}
        case "sensor_scale":
            return {"scale": ("1", lambda p: 1.0 + p.get(("scale", j), 0.0))}
        case "sensor_delay":
            return {"delay": ("s", lambda p: p[("delay", j)])}
        case "sensor_clipping":  # limit of a smooth saturation, or the largest value shown where it has none
            return {"limit": (si, lambda p: 1.0 / p[("rail", j)] if ("rail", j) in p else shown)}
        case "clock_drift":
            return {"drift": ("1", lambda p: p[("clock", 0)])}
    return {}


def _coulomb_friction(c: _Cause) -> Parameters:
    curve, speed, up = c.curve, c.speed, c.up
    sliding = up[up > SLIDING * speed]
    return {"force": ("N", lambda p: line(np.ones_like(sliding), curve(np.zeros_like(sliding), sliding, p), sliding))}


def _stribeck_friction(c: _Cause) -> Parameters:
    terms, names, curve, speed = c.terms, c.names, c.curve, c.speed
    if [t.candidate.what.law for t in terms] == [STRIBECK]:
        n = names[0]
        return {
            "breakaway": ("N", lambda p: p[f"{n}_force"] * (1.0 + p[f"{n}_rise"])),
            "coulomb": ("N", lambda p: p[f"{n}_force"]),
            "stribeck_rate": ("m/s", lambda p: p[f"{n}_width"]),
        }
    fine = np.geomspace(1e-4 * speed, speed, 600)
    fz = np.zeros_like(fine)

    def rate(p: Values) -> float:
        f = curve(fz, fine, p)
        top = int(np.argmax(f))
        below = np.flatnonzero(f[top:] - f[-1] < (f[top] - f[-1]) / np.e)
        if not below.size or not below[0]:
            return float(fine[-1])
        k = top + below[0]
        level = f[-1] + (f[top] - f[-1]) / np.e
        return float(np.interp(level, f[k - 1 : k + 1][::-1], fine[k - 1 : k + 1][::-1]))

    return {
        "breakaway": ("N", lambda p: float(np.max(curve(fz, fine, p)))),
        "coulomb": ("N", lambda p: float(curve(fz[-1:], fine[-1:], p)[0])),
        "stribeck_rate": ("m/s", rate),
    }


def _cubic_spring(c: _Cause) -> Parameters:
    curve, s, zero = c.curve, c.s, c.zero
    return {"cubic": ("N/m^3", lambda p: line(s**3, curve(s, zero, p), s))}


def _asymmetric_spring(c: _Cause) -> Parameters:
    curve, s, zero = c.curve, c.s, c.zero
    return {"difference": ("N/m", lambda p: -2.0 * line(np.abs(s), curve(s, zero, p), s, np.ones_like(s)))}


def _bump_stop(c: _Cause) -> Parameters:
    terms, names, curve, reach = c.terms, c.names, c.curve, c.reach
    ends = np.array([-reach, reach])
    main = max(having(terms, "gap"), key=lambda i: np.max(np.abs(Curve(terms[i : i + 1], names[i : i + 1])(ends, 0.0 * ends, {}))))
    n, law = names[main], terms[main].candidate.what.law
    side = -1.0 if law == "rebound_stop" or "min" in law else 1.0

    def stiffness(p: Values) -> float:
        gap = p[f"{n}_gap"]
        x = side * np.linspace(gap, max(reach, 1.05 * gap), 50)
        return line(x - side * gap, curve(x, np.zeros_like(x), p))

    return {"gap": ("m", lambda p: p[f"{n}_gap"]), "stiffness": ("N/m", stiffness)}


def _backlash(c: _Cause) -> Parameters:
    terms, names = c.terms, c.names
    halves = [n for t, n in zip(terms, names, strict=True) if t.own and t.candidate.what.law in HALVES]
    if len(halves) == 2:
        return {"gap": ("m", lambda p: sum(p[f"{n}_gap"] for n in halves))}
    main = max(having(terms, "gap", "presliding"), key=lambda i: terms[i].gain)
    n, slack = names[main], terms[main].candidate.what.law == "slack_friction"
    return {"gap": ("m", lambda p: 1.4 * p[f"{n}_presliding"] if slack else 2.0 * p[f"{n}_gap"])}


def _asymmetric_damper(c: _Cause) -> Parameters:
    curve, up, d0 = c.curve, c.up, c.damping
    flat = np.zeros_like(up)
    return {
        "rebound": ("N*s/m", lambda p: d0(p) + line(up, curve(flat, up, p), np.ones_like(up))),
        "compression": ("N*s/m", lambda p: d0(p) + line(-up, curve(flat, -up, p), np.ones_like(up))),
    }


def _degressive_damper(c: _Cause) -> Parameters:
    curve, speed, d0, zero = c.curve, c.speed, c.damping, c.zero
    low = np.linspace(0.0, 0.05 * speed, 20)[1:]
    high = np.linspace(0.9 * speed, speed, 20)
    z = np.zeros(19)

    def knee(p: Values) -> float:
        a, b = d0(p) + line(low, curve(z, low, p)), d0(p) + line(high - high[0], curve(np.zeros(20), high, p), np.ones(20))
        top = d0(p) * speed + float(curve(zero[:1], np.array([speed]), p)[0])
        return float(np.clip((top - b * speed) / (a - b), 0.0, speed)) if a != b else speed

    return {
        "knee": ("m/s", knee),
        "low_rate_damping": ("N*s/m", lambda p: d0(p) + line(low, curve(z, low, p))),
        "high_rate_damping": ("N*s/m", lambda p: d0(p) + line(high, curve(np.zeros(20), high, p), np.ones(20))),
    }


def _quadratic_damper(c: _Cause) -> Parameters:
    curve, v, zero = c.curve, c.v, c.zero
    return {"coefficient": ("N*s^2/m^2", lambda p: line(v * np.abs(v), curve(zero, v, p), v))}


def _damper_fading(c: _Cause) -> Parameters:
    terms, names, d0, study, what, e = c.terms, c.names, c.damping, c.study, c.terms[0].candidate.what, c.e
    m, left = study.seen[0].motions[what.place], study.experiments[0].left
    recent = float(np.mean(m.v[m.t > m.t[-1] - max(left, 0.25)] ** 2))  # heat goes on like that while nothing is looked at

    def loss(p: Values) -> float:
        total = 0.0
        for t, n in zip(terms, names, strict=True):
            if t.candidate.what.law == "fading_damper":
                kept = np.exp(-(m.t[-1] + left) / p[f"{n}_time"])
                slow, end = "faded", 1.0 - kept
            elif t.candidate.what.law == "heating_damper":
                work, cooling = p[f"{n}_work"], p[f"{n}_cooling"]
                warmer, colder = recent * left / work, left / cooling
                slow, end = "warm", warm(m.v, m.t, work, cooling)[-1] * np.exp(-warmer - colder) + warmer
                kept = np.exp(-np.trapezoid(m.v**2, m.t) / work - m.t[-1] / cooling - warmer - colder)
            else:  # what only mends the form
                continue
            before = p.get(("start", 0, e.built.model.states.index(f"{n}_{slow}")), 0.0)
            total += p[f"{n}_damping"] * (end + kept * before)
        return -total / d0(p)

    return {"loss": ("1", loss)}


def _bouc_wen(c: _Cause) -> Parameters:
    terms, names, curve, speed, zero = c.terms, c.names, c.curve, c.speed, c.zero
    pairs = [(f"{n}_force", f"{n}_presliding") for n, t in zip(names, terms, strict=True) if "presliding" in t.candidate.what.shapes]

    def stiff(p: Values) -> float:
        return sum(p[f] / p[w] for f, w in pairs)

    def force(p: Values) -> float:
        return float(curve(zero[:1], np.array([speed]), p)[0])

    return {"force": ("N", force), "yield_deflection": ("m", lambda p: force(p) / max(stiff(p), 1e-300))}


def _maxwell_bushing(c: _Cause) -> Parameters:
    terms, names, study = c.terms, c.names, c.study
    times = {
        n: t.candidate.what.shapes["relaxation"][0] for n, t in zip(names, terms, strict=True) if t.candidate.what.law == "maxwell_bushing"
    }
    seen = min(study.model.sample_time, max(times.values(), default=0.0))  # what relaxes within a sample is a damper
    springs = [n for n, tau in times.items() if tau >= seen]
    loose = [(n, t) for n, t in zip(names, terms, strict=True) if t.candidate.what.law == "loose_damper"]
    series = [(t.own or f"{n}_damping", f"{n}_relaxation") for n, t in loose]

    def bushing(p: Values) -> tuple[float, float]:
        """Stiffnesses in series with a damper, and their dampings, summed."""
        parallel = [(p[f"{n}_stiffness"], p[f"{n}_relaxation"]) for n in springs]
        parallel += [(p[d] / p[tau], p[tau]) for d, tau in series]
        return sum(k for k, _ in parallel), sum(k * tau for k, tau in parallel)

    return {"stiffness": ("N/m", lambda p: bushing(p)[0]), "relaxation_time": ("s", lambda p: bushing(p)[1] / max(bushing(p)[0], 1e-300))}


def _tyre_liftoff(c: _Cause) -> Parameters:
    terms, names, curve, s, c0, zero = c.terms, c.names, c.curve, c.s, c.stiffness, c.zero
    main = max(range(len(terms)), key=lambda i: terms[i].gain * ("static" in terms[i].candidate.what.shapes))
    if "static" in terms[main].candidate.what.shapes:
        return {"preload": ("N", lambda p: c0(p) * p[f"{names[main]}_static"])}

    def preload(p: Values) -> float:
        """Where a curve has lost a twentieth of its final loss."""
        f = np.abs(curve(s, zero, p))
        return c0(p) * float(s[np.flatnonzero((s > 0.0) & (f > 0.05 * f[-1]))[0]])

    return {"preload": ("N", preload)}


def _tyre_damping(c: _Cause) -> Parameters:
    terms, names, study, what = c.terms, c.names, c.study, c.terms[0].candidate.what
    lagging = [n for t, n in zip(terms, names, strict=True) if t.candidate.what.law == "maxwell_bushing"]
    at_once = Curve([t for t, n in zip(terms, names, strict=True) if n not in lagging], [n for n in names if n not in lagging])
    met = [m.motions[what.place] for m in study.seen]

    def damping(p: Values) -> float:
        """Damping of the linear damper that dissipates the same work in the observed motion."""
        work = 0.0
        for m in met:
            late = sum(p[f"{n}_stiffness"] * p[f"{n}_relaxation"] * lag(m.v, p[f"{n}_relaxation"], m.t[1] - m.t[0]) for n in lagging)
            work += float(m.v @ (at_once(np.zeros_like(m.v), m.v, p) + late))
        return work / sum(float(m.v @ m.v) for m in met)

    return {"damping": ("N*s/m", damping)}


def _tyre_nonlinear(c: _Cause) -> Parameters:
    curve, s, zero = c.curve, c.s, c.zero
    return {"quadratic": ("N/m^2", lambda p: -line(s * s, curve(s, zero, p), s, s**3))}


def _network_extrapolation(c: _Cause) -> Parameters:
    curve, place, s, zero = c.curve, c.place, c.s, c.zero
    edge = max(abs(x) for _, quantity, low, high, _ in place.trained if quantity == "s" for x in (low, high))
    return {"force_at_peak": ("N", lambda p: float(np.max(np.abs(curve(s, zero, p))))), "edge": ("m", lambda p: edge)}


def _constant_force(c: _Cause) -> Parameters:
    names, place, model = c.names, c.place, c.study.model
    sense = 1.0 if any(end in {i.name for i in model.inputs} for end in place.ends) else -1.0
    return {"force": ("N", lambda p: sense * sum(p[f"{n}_force"] for n in names))}  # in the end


def _line(c: _Cause) -> Parameters:
    _, (name, unit) = lines.LINES[c.terms[0].candidate.kind]
    return {name: (unit, lambda p: sum(p[f"{n}_{name}"] for n in c.names))}


OF: dict[str, Callable[[_Cause], Parameters]] = {
    "coulomb_friction": _coulomb_friction,
    "stribeck_friction": _stribeck_friction,
    "cubic_spring": _cubic_spring,
    "asymmetric_spring": _asymmetric_spring,
    "bump_stop": _bump_stop,
    "backlash": _backlash,
    "asymmetric_damper": _asymmetric_damper,
    "degressive_damper": _degressive_damper,
    "quadratic_damper": _quadratic_damper,
    "damper_fading": _damper_fading,
    "bouc_wen": _bouc_wen,
    "maxwell_bushing": _maxwell_bushing,
    "tyre_liftoff": _tyre_liftoff,
    "tyre_damping": _tyre_damping,
    "tyre_nonlinear": _tyre_nonlinear,
    "network_extrapolation": _network_extrapolation,
    "constant_force": _constant_force,
    **dict.fromkeys(lines.KINDS, _line),
}
