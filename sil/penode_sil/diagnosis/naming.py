# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""From fitted elementary laws to the parameters that a vehicle engineer asks for, with intervals.

Each parameter is a function of the whole curve of its kind, not of a formula: the friction force is where the curve ends,
a gap where it begins. Its interval follows from the covariance of all that was fitted (delta method).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from penode_gen import units
from penode_gen.model import Model

from .build import Term
from .hypotheses import HALVES, STRIBECK, Basis, Fault, lag, size, warm
from .plant import Place, in_place, nominal
from .fit import Fit
from .result import Value
from .score import where
from .study import Study

if TYPE_CHECKING:
    from .search import Explanation, Group

ELASTIC = 0.04  # of the reach: friction that yields farther before it slides is hysteresis of the element
FRICTION = ("coulomb_friction", "stribeck_friction", "bouc_wen")
DAMPERS = ("asymmetric_damper", "degressive_damper", "quadratic_damper")
SPRINGS = ("asymmetric_spring", "cubic_spring", "bump_stop", "network_extrapolation")
TYRES = ("tyre_nonlinear", "tyre_liftoff")
QUIET = 0.25  # of the largest force that an element is wrong by: less where its network was trained, and it is not the element
UNEVEN = 0.5  # even part of a curve over its odd one, without a line, that makes it asymmetric
EDGE = 0.15  # of the reach: a stop or a loss of contact that begins nearer than that to the middle is an element that bends there
MENDING = 0.2  # of the largest force of a stop on one side at the reach: with less, another only mends its form
STRAIGHT = 0.02  # of the straight part of a curve: less than that beside it, and it is a straight line
FLAT = 0.015  # of what a tyre lacks when stretched: bent by less than that when pressed in, it only loses contact
SLIDING = 0.1  # of the rates: friction there slides; its line, gone on to no rate, is the same however a damper beside it is parted from it
PEAK = 1.2  # friction at low rates over that at higher ones that makes it Stribeck's
FAST = 0.3  # of the rates: from there on the line in a curve is a damper's
STEP = 0.65  # of its greatest force from a twentieth of the rates on that friction without memory has there: with less, it is a damper
Array = NDArray[np.float64]
Values = Mapping[object, float]


def with_kinds(terms: Sequence[Term], names: Sequence[str], fit: Fit, study: Study) -> tuple[Term, ...]:
    """The terms of friction, dampers and springs named by what their fitted curve does, not by the laws that it was put
    together from."""
    values = {f.target: f.value for f in fit.free}
    named = list(terms)
    for kinds, name in ((FRICTION, _friction), (DAMPERS, _damper), (SPRINGS, _spring), (TYRES, _tyre)):
        for place in {t.candidate.what.place for t in terms if t.candidate.kind in kinds}:
            own = [i for i, t in enumerate(terms) if t.candidate.kind in kinds and t.candidate.what.place == place]
            curve = Curve([terms[i] for i in own], [names[i] for i in own])
            kind = name([terms[i] for i in own], [names[i] for i in own], values, *study.sizes[place])
            if kinds is SPRINGS and _beyond(curve, values, study.places[place], study.sizes[place][0]):
                kind = "network_extrapolation"
            for i in own:
                candidate = replace(terms[i].candidate, kind=kind, where=where(kind, study.places[place], study.model))
                named[i] = replace(terms[i], candidate=candidate)
    return tuple(named)


def _friction(terms: Sequence[Term], names: Sequence[str], values: Values, reach: float, speed: float) -> str:
    own = [name for term, name in zip(terms, names) if term.candidate.what.gain[0] == "force"]
    travel = sum(values[f"{name}_force"] * values.get(f"{name}_presliding", 0.0) for name in own)
    v = np.geomspace(0.004 * speed, speed, 200)
    f = Curve(terms, names)(np.zeros_like(v), v, values)
    if travel > ELASTIC * reach * np.max(f):
        return "bouc_wen"
    alone = _slid(v, f)
    if not travel and not _steps(v, alone):
        return "degressive_damper"
    return _rubbing(alone)


def _slid(v: Array, f: Array) -> Array:
    """A force at rates v > 0 without the line that it has at high ones: friction without the damper beside it."""
    fast = v > FAST * v[-1]
    return f - line(v[fast], f[fast], np.ones_like(v[fast])) * v


def _steps(v: Array, f: Array) -> bool:
    """Is a force at rates v > 0 without its line there from the lowest ones on? Dampers with a knee have 0.5 of it at a
    twentieth of the rates at the most, friction 0.86 at the least (54 and 60 hidden ones)."""
    here = float(np.interp(0.05 * v[-1], v, f))
    return here > STEP * max(here, float(np.max(f[v > 0.05 * v[-1]]))) > 0.0


def _rubbing(f: Array) -> str:
    """Does friction fall as the rate grows?"""
    least = np.minimum.accumulate(f[::-1])[::-1]  # from each rate on
    return "stribeck_friction" if np.any(f > PEAK * least) else "coulomb_friction"


def _damper(terms: Sequence[Term], names: Sequence[str], values: Values, reach: float, speed: float) -> str:
    v = np.linspace(-speed, speed, 401)
    f = Curve(terms, names)(np.zeros_like(v), v, values)
    odd, even = _parts(v, f)
    if _size(even) > UNEVEN * _size(odd):
        return "asymmetric_damper"
    if odd @ v**3 > line(v, v**3) * (odd @ v):
        return "quadratic_damper"
    fine = np.geomspace(0.004 * speed, speed, 200)
    both = Curve(terms, names)(np.zeros(2 * len(fine)), np.concatenate([fine, -fine]), values)
    alone = _slid(fine, 0.5 * (both[: len(fine)] - both[len(fine) :]))
    return _rubbing(alone) if _steps(fine, alone) else "degressive_damper"


def _spring(terms: Sequence[Term], names: Sequence[str], values: Values, reach: float, speed: float) -> str:
    s = np.linspace(-reach, reach, 401)
    odd, even = _parts(s, Curve(terms, names)(s, np.zeros_like(s), values))
    found = {t.candidate.kind for t in terms}
    if _contact(terms, names, values, reach) < EDGE * reach:
        return "asymmetric_spring" if _size(even) > UNEVEN * _size(odd) else "cubic_spring"
    if found & {"bump_stop", "network_extrapolation"}:
        return terms[0].candidate.kind
    if found == {"asymmetric_spring"} and _size(even) < UNEVEN * _size(odd):
        return "cubic_spring"
    return "asymmetric_spring" if found == {"cubic_spring"} and _size(even) > UNEVEN * _size(odd) else terms[0].candidate.kind


def _contact(terms: Sequence[Term], names: Sequence[str], values: Values, reach: float) -> float:
    """Deflection where stops come into contact, on the side where they do later; `reach` without any. Laws with a smaller part of
    the force there mend the form of others."""
    stops = [(t, n) for t, n in zip(terms, names) if t.candidate.kind == "bump_stop"]
    ends = np.array([-reach, reach])
    forces = np.array([np.abs(Curve([t], [n])(ends, np.zeros(2), values)) for t, n in stops]).reshape(-1, 2)
    gaps = np.array([abs(values.get(f"{n}_gap", reach)) for _, n in stops])
    return max((float(np.min(gaps[f > MENDING * np.max(f)])) for f in forces.T if np.any(f > 0.0)), default=reach)


def _tyre(terms: Sequence[Term], names: Sequence[str], values: Values, reach: float, speed: float) -> str:
    lost = [values[f"{n}_static"] for t, n in zip(terms, names) if t.candidate.what.law == "liftoff"]
    if lost and max(lost) > EDGE * reach:
        return "tyre_liftoff"
    s = np.linspace(-reach, reach, 401)
    f = Curve(terms, names)(s, np.zeros_like(s), values)
    pressed = s < 0.0
    slope, level = np.polyfit(s[pressed], f[pressed], 1)
    off = f - slope * s - level
    return "tyre_liftoff" if not lost and _size(off[pressed]) < -FLAT * off[-1] else "tyre_nonlinear"


def straight(
    model: Model, places: Sequence[Place], terms: Sequence[Term], names: Sequence[str], group: Group, values: Values
) -> str:
    """The parameter of the linear element that a curve beside it only changes; empty if it is a curve, or there is none."""
    own = [(t, n) for t, n in zip(terms, names) if t.group == group]
    if group[0] not in (*DAMPERS, "cubic_spring", "asymmetric_spring", "tyre_nonlinear"):
        return ""
    law, argument = ("linear_damper", "damping") if group[0] in DAMPERS else ("linear_spring", "stiffness")
    size = {True: 0.0, False: 0.0}  # of what is straight, and of what is not
    for term, name in own:
        what = term.candidate.what
        gain = values.get(f"{name}_{what.gain[0]}", term.gain)
        size[what.law == law] += abs(gain) * float(np.sqrt(np.mean(np.concatenate(what.series) ** 2)))
    elements = {name for name, _ in places[own[0][0].candidate.what.place].elements}
    found = [e.arguments[argument] for e in model.elements if e.law == law and e.name in elements]
    return found[0] if size[False] < STRAIGHT * size[True] and found and model.parameters[found[0]].tolerance > 0.0 else ""


def _beyond(curve: Curve, values: Values, place: Place, reach: float) -> bool:
    """Is a curve one of where a network was not trained, and next to nothing where it was?"""
    inside = [(low, high) for _, what, low, high, _ in place.trained if what == "s"]
    s = np.linspace(-reach, reach, 401)
    f = np.abs(curve(s, np.zeros_like(s), values))
    return any(np.max(f[(s >= low) & (s <= high)], initial=0.0) < QUIET * np.max(f) for low, high in inside)


def _parts(x: Array, f: Array) -> tuple[Array, Array]:
    """Odd part less its line, and even part, of a curve over a symmetric range."""
    odd, even = (f - f[::-1]) / 2.0, (f + f[::-1]) / 2.0
    return odd - line(x, odd) * x, even - even[len(x) // 2]


def _size(f: Array) -> float:
    return float(np.sqrt(np.mean(f * f)))


class Curve:
    """The force of a group of terms over deflection or rate, for any values of what is free."""

    def __init__(self, terms: Sequence[Term], names: Sequence[str]):
        self.parts = [(t, n) for t, n in zip(terms, names) if isinstance(t.candidate.what, Basis)]

    def __call__(self, s: Array, v: Array, values: Values) -> Array:
        total = np.zeros_like(s)
        for term, name in self.parts:
            what = term.candidate.what
            gain = values.get(f"{name}_{what.gain[0]}", term.gain)
            a = {k: values.get(f"{name}_{k}", x) for k, (x, _) in (what.shapes | what.fixed).items()}
            total = total + gain * shape(what.law, s, v, a)
        return total


def shape(law: str, s: Array, v: Array, a: Mapping[str, float]) -> Array:
    """A memoryless elementary law for gain 1; hysteresis as it is long after a reversal, relaxation as it is at first."""
    match law:
        case "linear_spring" | "maxwell_bushing":
            return s
        case "hardening_bushing":
            return s**3
        case "linear_damper":
            return v
        case "coulomb_friction":
            return np.tanh(v / a["transition"])
        case "bouc_wen" | "bouc_wen_loop" | "dahl_friction" | "slack_friction":
            return np.sign(v)
        case "degressive_damper":
            return -v * np.abs(v) / (a["knee"] + np.abs(v))
        case "quadratic_damper":
            return v * np.abs(v)
        case "cubic_spring":
            return s**3
        case "quadratic_spring":
            return s * s
        case "bump_stop":
            return np.maximum(s - a["gap"], 0.0)
        case "rebound_stop":
            return np.minimum(s + a["gap"], 0.0)
        case "backlash":
            return -np.clip(s, -a["gap"], a["gap"])
        case "liftoff":
            return -np.maximum(s - a["static"], 0.0)
        case "loose_damper":
            return np.zeros_like(s)
        case "constant_force" | "growing_force":
            return np.ones_like(s)
        case "falling_friction":
            return np.sign(v) / (1.0 + (v / a["stribeck"]) ** 2)
        case "fading_damper" | "heating_damper":
            return v
    words = {"softplus": lambda x: np.logaddexp(0.0, x)} | {"s": s, "v": v, "k": 1.0, "force": 1.0, "abs": np.abs, "exp": np.exp, "tanh": np.tanh, "max": np.maximum, "min": np.minimum} | dict(a)
    return eval(law.replace("^", "**"), {"__builtins__": {}}, words)  # one of our own texts


def line(x: Array, y: Array, *others: Array) -> float:
    """Least-squares factor of x in y, beside others."""
    return float(np.linalg.lstsq(np.stack([x, *others], axis=1), y, rcond=None)[0][0])


def functions(
    study: Study, e: Explanation, group: Group, reach: float, speed: float
) -> dict[str, tuple[str, Callable[[Values], float]]]:
    """Name, unit and value as a function of all that is free, for the parameters of one cause."""
    kind = group[0]
    terms, names = zip(*[(t, n) for t, n in zip(e.terms, e.built.names) if t.group == group])
    what = terms[0].candidate.what
    model = study.model
    curve = Curve(terms, names)
    if isinstance(what, str):
        unit = model.parameters[what].unit
        return {what: (unit, lambda p: p[what])}
    if isinstance(what, Fault):
        return _fault(model, kind, what)
    if isinstance(what, tuple):
        n = names[0]  # others only help it
        m, k, d = (f"{n}_{key}" for key in ("mass", "stiffness", "damping"))
        return {
            "frequency": ("Hz", lambda p: np.sqrt(p[k] / p[m]) / (2 * np.pi)),
            "mass": ("kg", lambda p: p[m]),
            "damping_ratio": ("1", lambda p: p[d] / (2 * np.sqrt(p[k] * p[m]))),
        }
    place = study.places[what.place]
    v = np.linspace(-speed, speed, 401)
    s = np.linspace(-reach, reach, 401)
    zero = np.zeros_like(v)
    d0 = lambda p: nominal(model, place, "linear_damper", "damping", p)
    c0 = lambda p: nominal(model, place, "linear_spring", "stiffness", p)
    up = v[v > 0.0]
    flat = np.zeros_like(up)
    match kind:
        case "coulomb_friction":
            sliding = up[up > SLIDING * speed]
            return {"force": ("N", lambda p: line(np.ones_like(sliding), curve(np.zeros_like(sliding), sliding, p), sliding))}
        case "stribeck_friction":
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
        case "cubic_spring":
            return {"cubic": ("N/m^3", lambda p: line(s**3, curve(s, zero, p), s))}
        case "asymmetric_spring":
            return {"difference": ("N/m", lambda p: -2.0 * line(np.abs(s), curve(s, zero, p), s, np.ones_like(s)))}
        case "bump_stop":
            ends = np.array([-reach, reach])
            main = max(having(terms, "gap"), key=lambda i: np.max(np.abs(Curve(terms[i : i + 1], names[i : i + 1])(ends, 0.0 * ends, {}))))
            n, law = names[main], terms[main].candidate.what.law
            side = -1.0 if law == "rebound_stop" or "min" in law else 1.0

            def stiffness(p: Values) -> float:
                gap = p[f"{n}_gap"]
                x = side * np.linspace(gap, max(reach, 1.05 * gap), 50)
                return line(x - side * gap, curve(x, np.zeros_like(x), p))

            return {"gap": ("m", lambda p: p[f"{n}_gap"]), "stiffness": ("N/m", stiffness)}
        case "backlash":
            halves = [n for t, n in zip(terms, names) if t.own and t.candidate.what.law in HALVES]
            if len(halves) == 2:
                return {"gap": ("m", lambda p: sum(p[f"{n}_gap"] for n in halves))}
            main = max(having(terms, "gap", "presliding"), key=lambda i: terms[i].gain)
            n, slack = names[main], terms[main].candidate.what.law == "slack_friction"
            return {"gap": ("m", lambda p: 1.4 * p[f"{n}_presliding"] if slack else 2.0 * p[f"{n}_gap"])}
        case "asymmetric_damper":
            return {
                "rebound": ("N*s/m", lambda p: d0(p) + line(up, curve(flat, up, p), np.ones_like(up))),
                "compression": ("N*s/m", lambda p: d0(p) + line(-up, curve(flat, -up, p), np.ones_like(up))),
            }
        case "degressive_damper":
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
        case "quadratic_damper":
            return {"coefficient": ("N*s^2/m^2", lambda p: line(v * np.abs(v), curve(zero, v, p), v))}
        case "damper_fading":
            m, left = study.seen[0].motions[what.place], study.experiments[0].left
            recent = float(np.mean(m.v[m.t > m.t[-1] - max(left, 0.25)] ** 2))  # heat goes on like that while nothing is looked at

            def loss(p: Values) -> float:
                total = 0.0
                for t, n in zip(terms, names):
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
        case "bouc_wen":
            pairs = [(f"{n}_force", f"{n}_presliding") for n, t in zip(names, terms) if "presliding" in t.candidate.what.shapes]
            stiff = lambda p: sum(p[f] / p[w] for f, w in pairs)
            force = lambda p: float(curve(zero[:1], np.array([speed]), p)[0])
            return {"force": ("N", force), "yield_deflection": ("m", lambda p: force(p) / max(stiff(p), 1e-300))}
        case "maxwell_bushing":
            times = {n: t.candidate.what.shapes["relaxation"][0] for n, t in zip(names, terms) if t.candidate.what.law == "maxwell_bushing"}
            seen = min(study.model.sample_time, max(times.values(), default=0.0))  # what relaxes within a sample is a damper
            springs = [n for n, tau in times.items() if tau >= seen]
            loose = [(n, t) for n, t in zip(names, terms) if t.candidate.what.law == "loose_damper"]
            series = [(t.own or f"{n}_damping", f"{n}_relaxation") for n, t in loose]

            def bushing(p: Values) -> tuple[float, float]:
                """Stiffnesses in series with a damper, and their dampings, summed."""
                parallel = [(p[f"{n}_stiffness"], p[f"{n}_relaxation"]) for n in springs]
                parallel += [(p[d] / p[tau], p[tau]) for d, tau in series]
                return sum(k for k, _ in parallel), sum(k * tau for k, tau in parallel)

            return {
                "stiffness": ("N/m", lambda p: bushing(p)[0]),
                "relaxation_time": ("s", lambda p: bushing(p)[1] / max(bushing(p)[0], 1e-300)),
            }
        case "tyre_liftoff":
            main = max(range(len(terms)), key=lambda i: terms[i].gain * ("static" in terms[i].candidate.what.shapes))
            if "static" in terms[main].candidate.what.shapes:
                return {"preload": ("N", lambda p: c0(p) * p[f"{names[main]}_static"])}

            def preload(p: Values) -> float:
                """Where a bent curve has taken a twentieth of what it takes at last."""
                f = np.abs(curve(s, zero, p))
                return c0(p) * float(s[np.flatnonzero((s > 0.0) & (f > 0.05 * f[-1]))[0]])

            return {"preload": ("N", preload)}
        case "tyre_damping":
            lagging = [n for t, n in zip(terms, names) if t.candidate.what.law == "maxwell_bushing"]
            at_once = Curve([t for t, n in zip(terms, names) if n not in lagging], [n for n in names if n not in lagging])
            met = [m.motions[what.place] for m in study.seen]

            def damping(p: Values) -> float:
                """Of the linear damper that takes as much work from the motion that was met."""
                work = 0.0
                for m in met:
                    late = sum(p[f"{n}_stiffness"] * p[f"{n}_relaxation"] * lag(m.v, p[f"{n}_relaxation"], m.t[1] - m.t[0]) for n in lagging)
                    work += float(m.v @ (at_once(np.zeros_like(m.v), m.v, p) + late))
                return work / sum(float(m.v @ m.v) for m in met)

            return {"damping": ("N*s/m", damping)}
        case "tyre_nonlinear":
            return {"quadratic": ("N/m^2", lambda p: -line(s * s, curve(s, zero, p), s, s**3))}
        case "network_extrapolation":
            edge = max(abs(x) for _, quantity, low, high, _ in place.trained if quantity == "s" for x in (low, high))
            return {"force_at_peak": ("N", lambda p: float(np.max(np.abs(curve(s, zero, p))))), "edge": ("m", lambda p: edge)}
        case "constant_force":
            sense = 1.0 if any(end in {i.name for i in model.inputs} for end in place.ends) else -1.0
            return {"force": ("N", lambda p: sense * sum(p[f"{n}_force"] for n in names))}  # in the end
    raise AssertionError(f"no parameters are known for {kind}")


def having(terms: Sequence[Term], *shapes: str) -> list[int]:
    """Which terms have one of these shapes; others only mend their form."""
    return [i for i, t in enumerate(terms) if not t.candidate.what.shapes.keys().isdisjoint(shapes)]


def _fault(model: Model, kind: str, what: Fault) -> dict[str, tuple[str, Callable[[Values], float]]]:
    unit, j = model.sensors[what.sensor].unit, what.sensor
    si = units.si(unit)
    match kind:
        case "sensor_bias":
            return {"bias": (si, lambda p: p.get(("bias", j), 0.0))}
        case "sensor_scale":
            return {"scale": ("1", lambda p: 1.0 + p.get(("scale", j), 0.0))}
        case "sensor_delay":
            return {"delay": ("s", lambda p: p[("delay", j)])}
        case "clock_drift":
            return {"drift": ("1", lambda p: p[("clock", 0)])}
    return {}


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
            if f.target[0] == "skew" or f.target[0] == "start" and group[0] != "damper_fading":
                continue
            step = min(0.1 * deviation[i], 0.01) if f.log else 0.1 * deviation[i]
            if step > 0.0:
                moved = float(function(centre | {f.target: float(f.at(step))}))
                slope[i] = (moved - middle) / step
        sigma = float(np.sqrt(max(slope @ covariance @ slope, 0.0)))
        result[name] = Value(middle, unit, (middle - 1.96 * sigma, middle + 1.96 * sigma))
    return result
