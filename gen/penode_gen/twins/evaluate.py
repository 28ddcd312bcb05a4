# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
The generated step in NumPy, to the bit: the emitter's lines translated (translate.py), the kernels (kernels.py, fold_walk.py),
and here the methods and the interpolation of inputs, in the order of the templates.

Nothing of it runs the C. So what it computes is a known answer for a self-test of the C (selftest.py).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..algebra.sampled import Past
from ..sets import packing
from ..sets.packing import RealType
from .fold_walk import Walk, find, value
from .kernels import Array, Kernels
from .translate import expression, function

_RESULTS = {"rates": ["dx"], "rates_jacobian": ["dx", "fx", "fu"], "outputs": ["y"]}


class _Folded:
    """The pieces of all folded networks, one after the other: f[k * room:] are those of network k."""

    def __init__(self, room: int, pieces: list[Any]):
        self._room, self._pieces = room, pieces

    def __getitem__(self, at: slice) -> Any:
        return self._pieces[int(at.start) // self._room]


class Evaluator:
    """One instance of a model with its set `default`; `context` is what the emitter gives to the templates."""

    def __init__(self, context: dict[str, Any], real: RealType):
        self.context, self.real, self.k = context, real, Kernels(real)
        self.model = context["model"]
        self.n_x, self.n_u, self.n_y = context["n_x"], context["n_u"], context["n_y"]
        self.calls = self.outside = 0  # evaluations of networks, and those outside of their trust envelope
        self.p = packing.set_values(self.model, "default", real)
        scope = self._scope()
        self.f = _Folded(self.model.pieces, [self._fold(name, code) for name, code in context["folded"]])
        self.functions = {
            name: function(name, [f"v_{a}" for a in ("p", "f", "x", "u", *results)], context["functions"][name]["lines"], scope, real)
            for name, results in _RESULTS.items()
            if context["functions"][name] and (self.n_x or name == "outputs")
        }
        self.sample_time = real(self.model.sample_time)
        self.h = self.sample_time / real(self.model.substeps) if self.model.substeps > 1 else self.sample_time
        self.stages = [
            (expression(n, {}, real), expression(w, {}, real)) for n, w in zip(context["nodes"], context["weights"], strict=True)
        ]
        self.x = np.array(self.model.start, real)
        self.y = np.zeros(self.n_y, real)
        self.running = 0
        self.before: dict[str, Array] = {}
        self.past = Past(context["sampled"])
        self.steps = [s["at"] for s in context["sampled"] if s["law"] == "held"]

    # -- what the lines call and name -----------------------------------------------------------------------------

    def _scope(self) -> dict[str, Any]:
        scope: dict[str, Any] = {n: getattr(self.k, n) for n in dir(self.k) if n.startswith("pen_")}
        scope |= {"v_status": None, "pen_fold_find": lambda n, pieces, x: self._find(pieces, x)}
        scope |= {"pen_fold_value": lambda pieces, at, x, status: value(pieces, at, x)}
        scope |= {f"v_{self.context['prefix']}_PIECES": self.model.pieces}
        for line in self.context["offsets"]:
            scope[f"v_{self.context['prefix']}_AT_{line['name'].upper()}"] = int(line["at"].removesuffix("U"))
        for c in self.context["constants"]:
            scope[f"v_{c['name']}"] = expression(c["text"], {}, self.real)
        for code in self.context["networks"]:
            for name, call in self._network(code, scope).items():
                scope[name] = call
        return scope

    def _network(self, code: Any, scope: dict[str, Any]) -> dict[str, Callable[..., Any]]:
        """A network's functions: value, value and slope, and either of them by pieces where they fit."""
        real, n, width = self.real, code.n, code.width
        buffers = {"h": (width,), "g": (width,), "t": (n, width), "s": (n, width)}
        names = [f"v_{b}" for b in ("p", "in", "slope", *buffers)]
        lines = {"": self.context["network_lines"][code.name]["lines"], "_slope": self.context["slope_lines"][code.name]}
        bodies = {part: function(code.name + part, names, text, scope, real) for part, text in lines.items()}

        def evaluate(part: str, p: Array, x: Any, slope: Any) -> Any:
            self.calls += 1
            self.outside += not (np.all(p[:n] <= x) and np.all(x <= p[n : 2 * n]))
            return bodies[part](p, x, slope, *(np.zeros(size, real) for size in buffers.values()))

        def or_pieces(part: str, p: Array, pieces: Any, x: Any, slope: Any) -> Any:
            if pieces is None:
                return evaluate(part, p, x, slope)
            at = self._find(pieces, x)
            if part:
                slope[0] = at.slope
            return value(pieces, at, x)

        return {
            code.name: lambda p, x, status: evaluate("", p, x, None),
            f"{code.name}_slope": lambda p, x, slope, status: evaluate("_slope", p, x, slope),
            f"{code.name}_or_pieces": lambda p, f, x, status: or_pieces("", p, f, x, None),
            f"{code.name}_or_pieces_slope": lambda p, f, x, slope, status: or_pieces("_slope", p, f, x, slope),
        }

    def _fold(self, name: str, code: Any) -> Any:
        at = packing.offsets(self.model)[name]
        return Walk(self.k, code.network, self.p[at:], self.model.outside == "clamp").pieces(self.model.pieces)

    def _find(self, pieces: Any, x: Any) -> Any:
        at = find(pieces, x)
        self.calls += 1
        self.outside += at.outside
        return at

    def _call(self, name: str, x: Array, u: Array) -> tuple[Array, ...]:
        """Results of one of the model's functions."""
        drive, n_x, real = len(u), self.n_x, self.real
        shapes = {"dx": (n_x,), "fx": (n_x, n_x), "fu": (n_x, drive), "y": (self.n_y,)}
        results = tuple(np.zeros(shapes[r], real) for r in _RESULTS[name])
        self.functions[name](self.p, self.f, x, u, *results)
        return results

    # -- interpolation of the inputs ------------------------------------------------------------------------------

    def _receive(self, u: Array) -> dict[str, Array]:
        """The input with its differences to those before and, where the model uses it, its rate."""
        c, r = self.context, self.real
        flags = [r((self.running >> bit) & 1) for bit in range(3)]
        now: dict[str, Array] = {"u": u, "from": self.before["u"] if self.running & 1 else u}
        change = now["from"]
        if c["curved"] or c["uses_input_rate"]:
            change = now["change"] = u - now["from"]
            rate = change
        if c["curved"]:
            zero = np.zeros_like(u)
            second = now["second"] = flags[1] * (change - self.before.get("change", zero))
            more = second
            if c["cubic"]:
                third = now["third"] = flags[2] * (second - self.before.get("second", zero))
                more = second + (third / r(1.5))
            rate = change + (r(0.5) * more)
        now["drive"] = np.concatenate([u, rate / self.sample_time]) if c["uses_input_rate"] else u
        return now

    def _drive(self, share: Any, now: dict[str, Array]) -> Array:
        """Inputs, and their rates behind them, at a share of the sample."""
        r, c = self.real, self.context
        if self.model.interpolation == "held":
            return now["from"]
        change = now["u"] - now["from"]
        inner = change
        if c["curved"]:
            second = now["second"]
            if c["cubic"]:
                second = second + (((share + r(1)) / r(3)) * now["third"])
            inner = change + ((r(0.5) * (share - r(1))) * second)
        at = now["from"] + (share * inner)
        at[self.steps] = now["from"][self.steps]
        return np.concatenate([at, self._slope(share, now) / self.sample_time]) if c["uses_input_rate"] else at

    def _slope(self, share: Any, now: dict[str, Array]) -> Array:
        """Rate of the inputs for a sample of one second."""
        r, change = self.real, now["u"] - now["from"]
        if self.context["curved"]:
            change = change + ((share - r(0.5)) * now["second"])
        if self.context["cubic"]:
            change = change + (((r(0.5) * (share * share)) - (r(1) / r(6))) * now["third"])
        return change

    def _drive_rate(self, share: Any, now: dict[str, Array]) -> Array:
        c = self.context
        rate = self._slope(share, now) / self.sample_time
        rate[self.steps] = 0
        if not c["uses_input_rate"]:
            return rate
        turn = np.zeros_like(rate)
        if c["curved"]:
            turn = now["second"] + (share * now["third"]) if c["cubic"] else now["second"]
            turn = (turn / self.sample_time) / self.sample_time
        return np.concatenate([rate, turn])

    # -- methods --------------------------------------------------------------------------------------------------

    def _euler(self, x: Array, i: Any, now: dict[str, Array], advance: Any) -> tuple[Array, bool]:
        (k,) = self._call("rates", x, self._drive(self._share(i, self.real(0)), now))
        return x + ((advance * self.h) * k), True

    def _share(self, i: Any, node: Any) -> Any:
        return (i + node) / self.real(self.model.substeps) if self.model.substeps > 1 else node

    def _runge_kutta(self, x: Array, i: Any, now: dict[str, Array], advance: Any) -> tuple[Array, bool]:
        k, total = np.zeros_like(x), np.zeros_like(x)
        for node, weight in self.stages:
            at = x + ((self.h * node) * k)
            (k,) = self._call("rates", at, self._drive(self._share(i, node), now))
            total = total + weight * k
        return x + ((advance * (self.h / self.real(self.context["divisor"]))) * total), True

    def _solve(self, gh: Any, fx: Array, k: Array) -> bool:
        """(I - gh fx) k = k; False if singular."""
        q = self.context["n_q"]
        w = self.n_x - q
        a = np.zeros((w, w), self.real)
        rows = fx[q:]
        for c in range(q):
            a[:, c] = -(gh * (rows[:, q + c] + (gh * rows[:, c])))
            k[q:] += gh * (rows[:, c] * k[c])
        if self.n_x > 2 * q:
            a[:, q:w] = -(gh * rows[:, 2 * q :])
        a[np.arange(w), np.arange(w)] += self.real(1)
        good = self.k.pen_solve2(a.reshape(-1), k[q:]) if w == 2 else self.k.pen_solve(w, a.reshape(-1), k[q:])
        k[:q] += gh * k[q : 2 * q]
        return good

    def _inner(self, a: Array, b: Array) -> Array:
        """Row by row a[0] b[0] + a[1] b[1] + ..., from zero on."""
        total = np.zeros(len(a), self.real)
        for i in range(len(b)):
            total = total + a[:, i] * b[i]
        return total

    def _ros1(self, x: Array, i: Any, now: dict[str, Array], advance: Any) -> tuple[Array, bool]:
        k, fx, _ = self._call("rates_jacobian", x, self._drive(self._share(i, self.real(1)), now))
        good = self._solve(self.h, fx, k)
        return x + ((advance * self.h) * k), good

    def _ros2(self, x: Array, i: Any, now: dict[str, Array], advance: Any) -> tuple[Array, bool]:
        r, joined = self.real, self.model.interpolation != "held"
        gh = r(0.2928932188134524) * self.h
        before, after = self._share(i, r(0)), self._share(i, r(1))
        k, fx, fu = self._call("rates_jacobian", x, self._drive(before, now))
        if joined:
            moving = gh * self._inner(fu, self._drive_rate(before, now))
            k = k + moving
        good = self._solve(gh, fx, k)
        (k2,) = self._call("rates", x + (self.h * k), self._drive(after, now))
        k2 = k2 - r(2) * k
        if joined:
            k2 = k2 - moving
        good &= self._solve(gh, fx, k2)
        return x + ((advance * self.h) * ((r(1.5) * k) + (r(0.5) * k2))), good

    # -- one sample -----------------------------------------------------------------------------------------------

    def step(self, u: Array) -> bool:
        """One sample with a finite input. False if state and outputs stay as they were."""
        method = {"euler": self._euler, "ros1": self._ros1, "ros2": self._ros2}.get(self.model.method, self._runge_kutta)
        with np.errstate(all="ignore"):
            now = self._receive(self.past.beside(np.asarray(u, self.real)))
            x, good, advance = self.x, True, self.real(self.running & 1)
            for i in range(self.model.substeps if self.n_x else 0):
                x, solved = method(x, self.real(i), now, advance)
                good &= solved
            (y,) = self._call("outputs", x, now["drive"])
        good = bool(good and np.isfinite(x).all() and np.isfinite(y).all())
        if good:
            self.x, self.y = x, y
        self.running = ((self.running << int(good)) | int(good)) & (7 if self.context["cubic"] else 3 if self.context["curved"] else 1)
        self.before = now
        return good
