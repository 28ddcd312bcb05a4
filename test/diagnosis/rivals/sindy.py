# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Rival of the diagnosis: sparse regression with PySINDy on the force that the model lacks, as its users do.

Deflections, rates and accelerations come from the sensors by Savitzky-Golay filters, and from the nominal simulation where there is no
sensor. The missing force of each place is balanced from the accelerations; terms that survive thresholded least squares are read as kinds
of the list.
"""

from collections.abc import Callable

import numpy as np
import pysindy as ps
from rig import CannotAnswer, Force, Recording, Rig, run
from scipy.signal import savgol_filter

WINDOW = 0.02  # s, of the filters
THRESHOLD = 0.03  # of the place's own force: the widest tolerance
DOMINANT = 0.25  # of the strongest term's force: what is less is taken for a correction of it
MODELS = 20  # of the ensemble, by bagging
SLOW = 0.1  # of the rms rate: where tanh bends
TERMS: dict[str, Callable[[np.ndarray, np.ndarray], np.ndarray]] = {  # of deflection and rate over their rms
    "1": lambda s, v: 1.0 + 0 * s,
    "s": lambda s, v: s,
    "abs(s)": lambda s, v: abs(s),
    "s^2": lambda s, v: s * s,
    "s^3": lambda s, v: s**3,
    "v": lambda s, v: v,
    "abs(v)": lambda s, v: abs(v),
    "v abs(v)": lambda s, v: v * abs(v),
    "tanh(v)": lambda s, v: np.tanh(v / SLOW),
}


def smooth(y: np.ndarray, step: float, order: int = 0) -> np.ndarray:
    """Filtered samples, or their derivative of an order; gaps are bridged."""
    good = np.isfinite(y)
    y = np.interp(np.arange(len(y)), np.flatnonzero(good), y[good])
    return savgol_filter(y, 2 * round(WINDOW / step / 2) + 1, 3, deriv=order, delta=step)


def states(rig: Rig, r: Recording) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Deflections, rates and missing forces (samples, places)."""
    n, places, lin, u = len(rig.bodies), len(rig.places), rig.nominal, r.given
    x, _f, _ = rig.simulate(r, rig.start(r))
    x = x[:, :, 0]
    acceleration = (x @ lin.a.T + u @ lin.b.T)[:, n:]
    moved = x @ lin.s.T + u @ lin.su.T
    written = {k: text.replace(" ", "") for k, text in rig.sensors.items() if np.isfinite(r.seen[k]).any()}
    for i, body in enumerate(rig.bodies.values()):
        position, rate = body["position"], body["velocity"]
        for k, text in written.items():
            if text == position:
                x[:, i], x[:, n + i], acceleration[:, i] = (smooth(r.seen[k], r.step, order) for order in (0, 1, 2))
        for k, text in written.items():
            if text == f"der({rate})":
                acceleration[:, i] = smooth(r.seen[k], r.step)
    moved = x @ lin.s.T + u @ lin.su.T
    at = {k: b["position"] for k, b in rig.bodies.items()} | {rig.input: rig.input}
    for i, (a, b) in enumerate(rig.places):
        for k, text in written.items():
            if text == f"{at.get(a)}-{at.get(b)}":
                moved[:, i], moved[:, places + i] = smooth(r.seen[k], r.step), smooth(r.seen[k], r.step, 1)
    s, v = moved[:, :places], moved[:, places:]
    known = np.column_stack([own(rig, i, s[:, i], v[:, i]) for i in range(places)])
    if n == 0:
        [sensor] = written
        return s, v, smooth(r.seen[sensor], r.step)[:, None] - known
    mass = np.array([rig.parameters[b["mass"]] for b in rig.bodies.values()])
    outer = u @ lin.b.T[:, n:] * mass  # force of the input on each body, which is linear
    pull = np.zeros((n, places))
    for i, (a, b) in enumerate(rig.places):
        for k, body in enumerate(rig.bodies):
            pull[k, i] = (b == body) - (a == body)
        if rig.input in (a, b):  # then the deflection has it already
            outer = outer * 0
    if n != places:
        raise CannotAnswer("the accelerations do not determine the forces of all places")
    return s, v, (acceleration * mass - outer - known @ pull.T) @ np.linalg.inv(pull).T


def balanced(rig: Rig, data: list[Recording]) -> list[int]:
    """Places whose force follows from what was measured: walking outwards, every body on the way needs an acceleration."""
    measured = " ".join(text.replace(" ", "") for k, text in rig.sensors.items() if all(np.isfinite(r.seen[k]).any() for r in data))
    found = []
    for place, body in enumerate(rig.bodies.values()):
        if f"der({body['velocity']})" not in measured and body["position"] not in measured.split():
            break
        found.append(place)
    if rig.bodies and not found:
        raise CannotAnswer(f"no acceleration of {next(iter(rig.bodies))}: no force can be balanced")
    return found if rig.bodies else [0]


def cost(rig: Rig, r: Recording, force: Force | None) -> float:
    """Sum of squares of a simulation with the additional forces."""
    return float(np.sum(rig.residual(r, rig.simulate(r, rig.start(r), force)[2]) ** 2))


def own(rig: Rig, place: int, s: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Force [N] of the nominal spring and damper of a place."""
    both = ((s, "linear_spring"), (v, "linear_damper"))
    return sum((rig.parameters[p] * y for y, law in both if (p := rig.coefficient(place, law))), 0 * s)


def name(rig: Rig, place: int, term: str, k: float) -> tuple[str, str, dict[str, float]]:
    """Kind, element and parameters of a term with coefficient k in SI."""
    spring, damper = rig.element(place, "linear_spring") or "", rig.element(place, "linear_damper")
    if damper is None:  # a tyre
        stiffness = rig.coefficient(place, "linear_spring") or ""
        return {
            "s": ("wrong_parameter", "", {stiffness: rig.parameters[stiffness] + k}),
            "s^2": ("tyre_nonlinear", spring, {"quadratic": k}),
            "abs(s)": ("tyre_liftoff", spring, {}),
            "v": ("tyre_damping", spring, {"damping": k}),
        }.get(term, ("outside_taxonomy", spring, {}))
    c, d = rig.coefficient(place, "linear_spring"), rig.coefficient(place, "linear_damper")
    slope = rig.parameters[d]
    found = {
        "1": ("constant_force", spring, {"force": -k}),
        "s^2": ("asymmetric_spring", spring, {}),
        "abs(s)": ("asymmetric_spring", spring, {"difference": -2 * k}),
        "s^3": ("cubic_spring", spring, {"cubic": k}),
        "v": ("wrong_parameter", "", {d: slope + k}),
        "abs(v)": ("asymmetric_damper", damper, {"rebound": slope + k, "compression": slope - k}),
        "v abs(v)": ("quadratic_damper", damper, {"coefficient": k}) if k > 0 else ("degressive_damper", damper, {}),
        "tanh(v)": ("coulomb_friction", damper, {"force": k}),
    }
    return ("wrong_parameter", "", {c: rig.parameters[c] + k}) if term == "s" and c else found.get(term, ("outside_taxonomy", damper, {}))


def power(term: str) -> tuple[int, int]:
    """Powers of deflection and rate in a term: what its scale is."""
    return {"s": (1, 0), "abs(s)": (1, 0), "s^2": (2, 0), "s^3": (3, 0), "v": (0, 1), "abs(v)": (0, 1), "v abs(v)": (0, 2)}.get(
        term, (0, 0)
    )


def answer(rig: Rig, data: list[Recording], holdout: Recording) -> dict:
    parts = [states(rig, r) for r in data]
    s, v, lacks = (np.vstack(p) for p in zip(*parts, strict=True))
    places, kept, causes = len(rig.places), [], []
    places_seen = balanced(rig, data)
    for place in range(places):
        if place not in places_seen:
            continue
        wide, fast = s[:, place].std(), v[:, place].std()
        scale = own(rig, place, s[:, place], v[:, place]).std()
        x = np.column_stack([s[:, place] / wide, v[:, place] / fast])
        library = ps.CustomLibrary(list(TERMS.values()))
        np.random.seed(0)  # noqa: NPY002 - the ensemble of pysindy draws from this generator
        optimizer = ps.EnsembleOptimizer(ps.STLSQ(threshold=THRESHOLD, alpha=1e-6), bagging=True, n_models=MODELS)
        sparse = ps.SINDy(optimizer=optimizer, feature_library=library)
        sparse.fit(x, t=data[0].step, x_dot=np.column_stack([lacks[:, place], lacks[:, place]]) / scale)
        columns = np.column_stack([f(*x.T) for f in TERMS.values()])
        many = np.array([np.asarray(c)[0] for c in optimizer.coef_list])
        best = np.where(np.mean(many != 0, axis=0) > 0.6, np.median(many, axis=0), 0.0)  # a term of most models
        strength = abs(best) * np.sqrt(np.mean(columns**2, axis=0))
        kept.append((place, wide, fast, scale, best))
        for i in np.argsort(-strength):
            if strength[i] > DOMINANT * strength.max() and strength[i] > THRESHOLD:
                term = list(TERMS)[i]
                by_s, by_v = power(term)
                si = scale / (wide**by_s * fast**by_v)
                kind, where, values = name(rig, place, term, best[i] * si)
                edges = [name(rig, place, term, q * si)[2] for q in np.quantile(many[:, i], (0.025, 0.975))]
                told = {k: {"value": y, "unit": "", "ci95": sorted(e.get(k, y) for e in edges)} for k, y in values.items()}
                causes.append((strength[i] * scale, {"kind": kind, "where": where, "parameters": told, "alternatives": []}))

    def force(s: np.ndarray, v: np.ndarray) -> np.ndarray:
        f = np.zeros_like(s)
        for i, wide, fast, scale, best in kept:
            for k, term in zip(best, TERMS.values(), strict=True):
                f[i] += k * scale * term(s[i] / wide, v[i] / fast) if k else 0.0
        return f

    strongest = max((c[0] for c in causes), default=0.0)
    named = [c for strength, c in causes if strength > DOMINANT * strongest]
    better = named and sum(cost(rig, r, force) for r in data) < sum(cost(rig, r, None) for r in data)  # else nobody would ship it
    return {"verdict": "explained" if named else "no_discrepancy", "causes": named, "gain": rig.gain(holdout, force if better else None)}


if __name__ == "__main__":
    run(answer, __doc__)
