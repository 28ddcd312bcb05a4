# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What both rivals need: a linear model file, its recordings, simulation with additional forces, and the answer's file."""

import argparse
import json
import re
import sys
import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.linalg import expm
from scipy.optimize import least_squares
from scipy.signal import lfilter, savgol_filter

Force = Callable[[np.ndarray, np.ndarray], np.ndarray]  # deflections, rates (places, lanes) -> additional forces, the same shape


class CannotAnswer(Exception):
    """The method does not apply to this model or these data; the text says why."""


@dataclass(frozen=True)
class Recording:
    """`given`: input and its rate (samples, 2); `seen`: sensor -> samples, NaN where there is none. SI."""

    step: float
    given: np.ndarray
    seen: dict[str, np.ndarray]


@dataclass(frozen=True)
class Linear:
    """x' = a x + b u + g f, deflection or rate = s x + su u, sensors = c x + e u + h f; u is an input and its rate, f a force per place."""

    a: np.ndarray
    b: np.ndarray
    g: np.ndarray
    s: np.ndarray
    su: np.ndarray
    c: np.ndarray
    e: np.ndarray
    h: np.ndarray

    def observe(self, x: np.ndarray, u: np.ndarray, f: np.ndarray) -> np.ndarray:
        """Sensors (samples, sensors, lanes) of states (samples, n, lanes), inputs (samples, 2) and forces (samples, places, lanes)."""
        return self.c @ x + (u @ self.e.T)[:, :, None] + self.h @ f


def modal(a: np.ndarray, inputs: np.ndarray, start: np.ndarray) -> np.ndarray:
    """States (samples, n, lanes) of x[k + 1] = a x[k] + inputs[k] from `start` (n, lanes), each mode by itself."""
    poles, shapes = np.linalg.eig(a)
    driven = np.vstack([np.zeros(len(a)), np.linalg.solve(shapes, inputs.T).T])[:-1]
    moved = np.stack([lfilter([1.0], [1.0, -pole], w) for pole, w in zip(poles, driven.T, strict=True)])
    faded = poles[:, None] ** np.arange(len(inputs))
    free = np.einsum("ij,jk,jl->kil", shapes, faded, np.linalg.solve(shapes, start.astype(complex)), optimize=True)
    return ((shapes @ moved).T[:, :, None] + free).real


def stepped(force: Force, both: np.ndarray, shifts: np.ndarray, g: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """States and forces (samples, rows, lanes): deflections, rates and the next states are both @ x[k] + shifts[k], and f acts by g.

    A force may have a faster `walk` of its own, which takes the rest.
    """
    places, now = g.shape[1], start
    x, f = np.zeros((len(shifts), *start.shape)), np.zeros((len(shifts), places, start.shape[1]))
    for k, shift in enumerate(shifts):
        x[k] = now
        now = both @ now + shift[:, None]
        f[k] = force(now[:places], now[places : 2 * places])
        now = now[2 * places :] + g @ f[k]
    return x, f


class Rig:
    """A model of masses on an axis with linear springs and dampers and one input. Places: pairs of ends with a spring or a damper."""

    def __init__(self, path: Path):
        text = tomllib.loads(path.read_text())
        self.parameters = {k: float(p["value"]) for k, p in text["parameters"].items()}
        self.tolerance = {k: float(p.get("tolerance", 0.01)) for k, p in text["parameters"].items()}
        self.bodies, self.elements = text.get("bodies", {}), text["elements"]
        self.sensors = {k: s["value"] for k, s in text["sensors"].items()}
        self.noise = {k: float(s["noise"]) for k, s in text["sensors"].items()}
        self.units = {k: s["unit"] for k, s in text["sensors"].items()}
        if len(text["inputs"]) != 1:
            raise CannotAnswer("more than one input")
        [(self.input, told)] = text["inputs"].items()
        self.units[self.input] = told["unit"]
        laws = {e["law"] for e in self.elements.values()}
        if not laws <= {"linear_spring", "linear_damper", "expression"}:
            raise CannotAnswer(f"only linear elements, not {', '.join(sorted(laws))}")
        self.places = list(dict.fromkeys(tuple(e["between"]) for e in self.elements.values() if e["law"] != "expression"))

    def element(self, place: int, law: str) -> str | None:
        """Name of the element of this law at a place."""
        found = (k for k, e in self.elements.items() if tuple(e["between"]) == self.places[place] and e["law"] == law)
        return next(found, None)

    def coefficient(self, place: int, law: str) -> str | None:
        """Name of the parameter of that element."""
        name = self.element(place, law)
        return name and self.elements[name]["stiffness" if law == "linear_spring" else "damping"]

    def _evaluate(self, values: Mapping[str, float], x: np.ndarray, u: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, ...]:
        """Rates of the states, deflections and rates of all places, sensors; every argument has a column per point."""
        n = len(self.bodies)
        at = {"ground": (0 * u[0], 0 * u[0]), self.input: (u[0], u[1])}
        at |= {k: (x[i], x[n + i]) for i, k in enumerate(self.bodies)}
        names = {self.input: u[0]}
        for k, b in self.bodies.items():
            names |= {b["position"]: at[k][0], b["velocity"]: at[k][1]}
        net = dict.fromkeys(at, 0 * u[0])
        pulls = [(ends, f[i]) for i, ends in enumerate(self.places)]
        for k, e in self.elements.items():
            (z1, v1), (z2, v2) = (at[end] for end in e["between"])
            if e["law"] == "expression":
                names[f"F_{k}"] = eval(e["force"], {"__builtins__": {}}, names)
            else:
                names[f"F_{k}"] = values[e["stiffness"]] * (z1 - z2) if "stiffness" in e else values[e["damping"]] * (v1 - v2)
            pulls.append((tuple(e["between"]), names[f"F_{k}"]))
        for i, ends in enumerate(self.places):  # a sensor of force sees the additional one too
            spring = next(e for e in self.elements if tuple(self.elements[e]["between"]) == ends)
            names[f"F_{spring}"] = names[f"F_{spring}"] + f[i]
        for (a, b), force in pulls:
            net[a], net[b] = net[a] - force, net[b] + force
        acceleration = [net[k] / values[b["mass"]] for k, b in self.bodies.items()]
        for i, b in enumerate(self.bodies.values()):
            names |= {f"der_{b['position']}": x[n + i], f"der_{b['velocity']}": acceleration[i]}
        moved = [(at[a][0] - at[b][0], at[a][1] - at[b][1]) for a, b in self.places]
        seen = [eval(re.sub(r"der\((\w+)\)", r"der_\1", s), {"__builtins__": {}}, names) for s in self.sensors.values()]
        return (
            np.array([*x[n:], *acceleration]).reshape(2 * n, len(u[0])),
            np.array([m[0] for m in moved] + [m[1] for m in moved]),
            np.array(seen),
        )

    def linear(self, values: Mapping[str, float]) -> Linear:
        """The matrices, column by column from unit vectors."""
        n, p = 2 * len(self.bodies), len(self.places)
        points = np.eye(n + 2 + p)
        rate, moved, seen = self._evaluate(values, points[:n], points[n : n + 2], points[n + 2 :])

        def cut(m):
            return (m[:, :n], m[:, n : n + 2], m[:, n + 2 :])

        (a, b, g), (s, su, _), (c, e, h) = cut(rate), cut(moved), cut(seen)
        return Linear(a, b, g, s, su, c, e, h)

    @cached_property
    def nominal(self) -> Linear:
        return self.linear(self.parameters)

    def read(self, path: Path) -> Recording:
        """A recording in the units of the model file, at 1 kHz at most."""
        head = path.open().readline().strip().split(",")
        columns = {m[1]: (i, m[2]) for i, c in enumerate(head) if (m := re.fullmatch(r"\s*(\S+) \[(.*)\]\s*", c))}
        data = np.genfromtxt(path, delimiter=",", skip_header=1)
        if self.input not in columns:
            raise CannotAnswer(f"{path.name} has no {self.input}")
        for name in columns.keys() & self.units.keys():
            if columns[name][1] != self.units[name]:
                raise CannotAnswer(f"{path.name}: {name} is in {columns[name][1]}, not {self.units[name]}")
        step = float(np.median(np.diff(data[:, 0])))
        every = max(1, round(1e-3 / step))
        u = data[:, columns[self.input][0]]
        u = np.interp(data[:, 0], data[np.isfinite(u), 0], u[np.isfinite(u)])
        given = np.column_stack([u, savgol_filter(u, 7, 3, deriv=1, delta=step)])
        seen = {k: data[::every, columns[k][0]] if k in columns else np.full(len(u[::every]), np.nan) for k in self.sensors}
        return Recording(step * every, given[::every], seen)

    def residual(self, seen: Recording, said: np.ndarray) -> np.ndarray:
        """Sensors less simulation (samples, sensors, lanes) in units of the stated noise; 0 where nothing was measured."""
        scale = np.array(list(self.noise.values()))[None, :, None]
        measured = np.column_stack([seen.seen[k] for k in self.sensors])[:, :, None]
        return np.nan_to_num((measured - said) / scale, nan=0.0)

    def simulate(
        self, given: Recording, start: np.ndarray, force: Force | None = None, lin: Linear | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """States, additional forces and sensors, each (samples, rows, lanes), from `start` (n, lanes); input linear between samples.

        The linear part is exact; the additional force is held over a step. What diverges becomes 1e9.
        """
        lin, u = lin or self.nominal, given.given
        n, lanes = start.shape
        places = len(self.places)
        drive, offset = self._steps(lin, given), u @ lin.su.T
        x, f = np.zeros((len(u), n, lanes)), np.zeros((len(u), places, lanes))
        if n == 0:
            moved = np.repeat(offset.T[:, :, None], lanes, axis=2)
            if force:
                f = np.stack([force(moved[:places, k], moved[places:, k]) for k in range(len(u))])
        else:
            a, g, inputs = drive
            with np.errstate(all="ignore"):
                if force:
                    walk = getattr(force, "walk", lambda *parts: stepped(force, *parts))
                    x, f = walk(np.vstack([lin.s, a]), np.hstack([offset, inputs]), g, start)
                else:
                    x = modal(a, inputs, start)
            x, f = (np.clip(np.nan_to_num(y, nan=1e9), -1e9, 1e9) for y in (x, f))
        return x, f, lin.observe(x, u, f)

    def _steps(self, lin: Linear, given: Recording) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Discrete a, g, and what the input does in each step; the input's own rate of change is constant in a step."""
        n, m = len(lin.a), lin.g.shape[1]
        block = np.zeros((n + 4 + m,) * 2)  # states, input, slope of the input, force
        block[:n] = np.hstack([lin.a, lin.b, np.zeros((n, 2)), lin.g])
        block[n : n + 2, n + 2 : n + 4] = np.eye(2)
        whole = expm(block * given.step)
        slope = np.vstack([np.diff(given.given, axis=0), np.zeros((1, 2))]) / given.step
        return whole[:n, :n], whole[:n, n + 4 :], given.given @ whole[:n, n : n + 2].T + slope @ whole[:n, n + 2 : n + 4].T

    def start(self, given: Recording, seconds: float = 3.0, lin: Linear | None = None) -> np.ndarray:
        """State (n, 1) at the first sample, by linear least squares over the first seconds; rest has a prior, so that noise moves
        little."""
        n = 2 * len(self.bodies)
        if n == 0:  # prescribed motion has no state
            return np.zeros((0, 1))
        first = int(seconds / given.step)
        short = Recording(given.step, given.given[:first], {k: y[:first] for k, y in given.seen.items()})
        lanes = np.hstack([np.zeros((n, 1)), 1e-3 * np.eye(n)])
        _, _, said = self.simulate(short, lanes, lin=lin)
        off = self.residual(short, said).reshape(-1, n + 1)
        found = np.linalg.lstsq(np.vstack([off[:, :1] - off[:, 1:], np.eye(n)]), np.concatenate([off[:, 0], np.zeros(n)]), rcond=None)[0]
        return 1e-3 * found[:, None]

    def fitted(self, recordings: Iterable[Recording]) -> dict[str, float]:
        """Parameters that fit the linear model best, held to the nominal ones by 0.4 of their tolerance."""
        names, recordings = list(self.parameters), list(recordings)

        def off(q: np.ndarray) -> np.ndarray:
            lin = self.linear({k: self.parameters[k] * (1 + 0.4 * self.tolerance[k] * z) for k, z in zip(names, q, strict=True)})
            parts = [self.residual(r, self.simulate(r, self.start(r, lin=lin), lin=lin)[2]).ravel() for r in recordings]
            return np.concatenate([*parts, q])

        best = least_squares(off, np.zeros(len(names)), diff_step=1e-3, max_nfev=4).x
        return {k: self.parameters[k] * (1 + 0.4 * self.tolerance[k] * z) for k, z in zip(names, best, strict=True)}

    def gain(self, holdout: Recording, force: Force | None, lin: Linear | None = None) -> dict[str, dict[str, float]]:
        """RMSE of every sensor on the hold-out: the file as it is, and with other parameters and the additional forces."""

        def rmse(r: np.ndarray) -> np.ndarray:
            return np.sqrt(np.mean(r[:, :, 0] ** 2, axis=0)) * np.array(list(self.noise.values()))

        before = rmse(self.residual(holdout, self.simulate(holdout, self.start(holdout))[2]))
        after = rmse(self.residual(holdout, self.simulate(holdout, self.start(holdout, lin=lin), force, lin)[2]))
        found = {}
        for i, (k, floor) in enumerate(self.noise.items()):
            if np.isfinite(holdout.seen[k]).any():
                share = float((before[i] - after[i]) / (before[i] - floor)) if before[i] > 1.05 * floor else None
                found[k] = {
                    "before_rmse": float(before[i]),
                    "after_rmse": float(after[i]),
                    "noise_floor": floor,
                    "share_of_achievable": share,
                }
        return found


def run(method: Callable[[Rig, list[Recording], Recording], dict], title: str) -> None:
    """The program of a rival: reads, lets the method answer, writes DIR/diagnosis.json."""
    parse = argparse.ArgumentParser(description=title)
    parse.add_argument("model", type=Path)
    parse.add_argument("--data", type=Path, nargs="+", required=True)
    parse.add_argument("--holdout", type=Path, required=True)
    parse.add_argument("-o", dest="out", type=Path, required=True)
    asked = parse.parse_args()
    try:
        rig = Rig(asked.model)
        answer = method(rig, [rig.read(f) for f in asked.data], rig.read(asked.holdout))
    except CannotAnswer as problem:
        print(problem, file=sys.stderr)
        answer = {"verdict": "not_identifiable", "causes": [], "gain": {}, "notes": [str(problem)]}
    asked.out.mkdir(parents=True, exist_ok=True)
    (asked.out / "diagnosis.json").write_text(json.dumps(answer, indent=1))
