# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The elementary laws of every kind of force, on grids of shapes: a family a function."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import product
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import GROUND

from .catalogue import lines
from .hypotheses import BENDS, HALVES, KNEE, STRIBECK, Basis, Motion, bent, lag, losses, size, slips, warm
from .plant import Place

Array = NDArray[np.float64]
GAPS = (0.003, 0.01, 0.03, 0.06, 0.12, 0.25, 0.5)
GRID = (0.03, 0.06, 0.12, 0.25, 0.5)
STIFFNESS, DAMPING, FORCE = ("stiffness", "N/m"), ("damping", "N*s/m"), ("force", "N")  # gains: argument and unit


@dataclass(frozen=True, eq=False)
class _At:
    """A place with the motions seen there, per recording, their reach and speed, which kinds are wanted, and the forces along the motion of
    laws so far, of a law with its shapes, whatever its kind and sign."""

    place: int
    p: Place
    motions: Sequence[Motion]
    step: float
    prescribed: bool
    wanted: Callable[..., bool]
    reach: float
    speed: float
    forces: dict[object, tuple[Array, ...]] = field(default_factory=dict)

    def law(self, kind, name, gain, shapes, sign, function, companion=False, fixed=MappingProxyType({})) -> Basis | None:
        """A law whose force for gain 1 is a function of deflection, rate and time; None if its kind is not wanted."""
        if not self.wanted(kind):
            return None
        key = name, *shapes.items(), *fixed.items()
        if key not in self.forces:
            self.forces[key] = tuple(function(m.s, m.v, m.t) for m in self.motions)
        return Basis(kind, self.place, name, gain, shapes, sign, self.forces[key], companion, False, fixed)


def force_laws(
    place: int, p: Place, motions: Sequence[Motion], step: float, prescribed: bool, kinds: Collection[str] = ()
) -> Iterator[Basis]:
    """All elementary laws that may act at a place, or those of some kinds."""

    def wanted(*any_of: str) -> bool:
        return not kinds or not kinds.isdisjoint(any_of)

    if (p.role == "body" or GROUND in p.ends) and wanted("constant_force"):
        yield from _constant(place, motions)
    if p.role == "body":
        return
    at = _At(place, p, motions, step, prescribed, wanted, *size(motions))
    if at.reach > 0.0 and at.speed > 0.0:
        for family in (_tyre,) if p.role == "tyre" else (_lines, *FAMILIES):
            yield from filter(None, family(at))


def _tyre(at: _At) -> Iterator[Basis | None]:
    """Damping, loss of contact and bent stiffness of a tyre."""
    law, motions, speed, step = at.law, at.motions, at.speed, at.step
    yield law("tyre_damping", "linear_damper", DAMPING, {}, 1, lambda s, v, t: v)
    for tau in (0.0007, 0.002, 0.006, 0.02, 0.06):
        yield law(
            "tyre_damping", "maxwell_bushing", STIFFNESS, {"relaxation": (tau, "s")}, 1, lambda s, v, t, tau=tau: s - lag(s, tau, step)
        )
    yield law("tyre_damping", "quadratic_damper", ("coefficient", "N*s^2/m^2"), {}, 0, lambda s, v, t: v * np.abs(v), True)
    for w in (0.05, 0.2, 0.8):
        a = w * speed
        yield law(
            "tyre_damping",
            "degressive_damper",
            DAMPING,
            {"knee": (a, "m/s")},
            0,
            lambda s, v, t, a=a: -v * np.abs(v) / (a + np.abs(v)),
            True,
        )
    top = max(float(np.quantile(m.s, 0.9995)) for m in motions)
    for share in (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9):
        g = share * top
        yield law("tyre_liftoff", "liftoff", STIFFNESS, {"static": (g, "m")}, 1, lambda s, v, t, g=g: -np.maximum(s - g, 0.0))
    for sign in (1, -1):
        yield law("tyre_nonlinear", "quadratic_spring", ("quadratic", "N/m^2"), {}, sign, lambda s, v, t: s * s)
        yield law("tyre_nonlinear", "cubic_spring", ("cubic", "N/m^3"), {}, sign, lambda s, v, t: s**3)
        yield law("tyre_nonlinear", "k*s*abs(s)", ("k", "N/m^2"), {}, sign, lambda s, v, t: s * np.abs(s))
        yield law("tyre_nonlinear", "linear_spring", STIFFNESS, {}, sign, lambda s, v, t: s, True)


def _network(at: _At) -> Iterator[Basis | None]:
    """A network beyond the range that it was trained on."""
    law, motions, p = at.law, at.motions, at.p
    for _, what, low, high, stated in p.trained:
        for edge, side in ((high, 1), (low, -1)):
            far = max(float(np.quantile(side * (m.s if what == "s" else m.v), 0.995)) for m in motions)
            if far <= side * edge:
                continue
            gap = side * edge
            unit = "N/m" if what == "s" else "N*s/m"
            known = {"gap": (gap, "m" if what == "s" else "m/s")}
            over = f"max({what} - gap, 0)" if side > 0 else f"min({what} + gap, 0)"
            for sign in (1, -1):
                yield law(
                    "network_extrapolation",
                    f"k*{over}",
                    ("k", unit),
                    {} if stated else known,
                    sign,
                    lambda s, v, t, side=side, what=what, gap=gap: side * np.maximum(side * (s if what == "s" else v) - gap, 0.0),
                    fixed=known if stated else {},
                )
                yield law(
                    "network_extrapolation",
                    f"k*{over}^2",
                    ("k", "N/m^2" if what == "s" else "N*s^2/m^2"),
                    {} if stated else known,
                    sign,
                    lambda s, v, t, side=side, what=what, gap=gap: np.maximum(side * (s if what == "s" else v) - gap, 0.0) ** 2,
                    fixed=known if stated else {},
                )


def _friction(at: _At) -> Iterator[Basis | None]:
    """Odd, constant in rate, little or no deflection before it slides."""
    law, speed = at.law, at.speed
    slide = [0.003, 0.01, 0.03, 0.06]
    for w in slide:
        a = w * speed
        yield law("coulomb_friction", "coulomb_friction", FORCE, {"transition": (a, "m/s")}, 1, lambda s, v, t, a=a: np.tanh(v / a))
        yield law("stribeck_friction", "coulomb_friction", FORCE, {"transition": (a, "m/s")}, 1, lambda s, v, t, a=a: np.tanh(v / a), True)


def _hysteresis(at: _At) -> Iterator[Basis | None]:
    """Odd, with memory of the travel since the last reversal; with little of it, friction."""
    motions, reach, speed, step, wanted, prescribed, place = at.motions, at.reach, at.speed, at.step, at.wanted, at.prescribed, at.place
    widths = [w * reach for w in (0.003, 0.01, 0.03, 0.06, 0.12, 0.25, 0.5, 1.0)]
    if not wanted("bouc_wen", "coulomb_friction", "backlash"):
        widths = []
    widths = [w for w in widths if w > 0.3 * speed * step]  # a sample must not jump over it
    slipped = [slips(m.s, widths) if widths else np.empty((0, len(m.s))) for m in motions]
    for row, (name, a) in enumerate(product(("bouc_wen", "dahl_friction", "bouc_wen_loop"), widths)):
        kind = "coulomb_friction" if a < 0.05 * reach else "bouc_wen"
        shapes = {"presliding": (a, "m")} | ({"bend": (0.7, "1"), "share": (0.65, "1")} if name == "bouc_wen_loop" else {})
        yield Basis(kind, place, name, FORCE, shapes, 1, tuple(each_slip[row] for each_slip in slipped))
        if name == "bouc_wen" and kind == name and prescribed:  # a play shows in series with friction where no mass is in between
            flat = tuple(each_slip[row] ** 5 for each_slip in slipped)
            yield Basis("backlash", place, "slack_friction", FORCE, {"presliding": (a, "m")}, 1, flat)


def _stribeck(at: _At) -> Iterator[Basis | None]:
    """Friction that falls with the rate."""
    law, motions, reach, speed, step, wanted, place = at.law, at.motions, at.reach, at.speed, at.step, at.wanted, at.place
    for w in (0.01, 0.02, 0.04, 0.08, 0.16, 0.3):
        a = w * speed
        yield law(
            "stribeck_friction",
            "2.3316439815971242*k*exp(-(v/width)^2)*v/width",
            ("k", "N"),
            {"width": (a, "m/s")},
            1,
            lambda s, v, t, a=a: 2.3316439815971242 * np.exp(-((v / a) ** 2)) * v / a,
        )
    for w, fall, rise in product((0.005, 0.015), (0.03, 0.06, 0.12, 0.2), (0.4, 1.2)):
        a, b = w * speed, fall * speed
        yield law(
            "stribeck_friction",
            STRIBECK,
            FORCE,
            {"knee": (a, "m/s"), "width": (b, "m/s"), "rise": (rise, "1")},
            1,
            lambda s, v, t, a=a, rise=rise, b=b: np.tanh(v / a) * (1.0 + rise * np.exp(-((v / b) ** 2))),
        )
    for w in (0.003, 0.01, 0.03):
        for fall in (0.02, 0.06, 0.2):
            a, b = w * reach, fall * speed
            if a > 0.3 * speed * step and wanted("stribeck_friction"):
                slipped = [slips(m.s, [a])[1] for m in motions]
                rows = tuple(z / (1.0 + (m.v / b) ** 2) for z, m in zip(slipped, motions, strict=True))
                shapes = {"presliding": (a, "m"), "stribeck": (b, "m/s")}
                yield Basis("stribeck_friction", place, "falling_friction", FORCE, shapes, 1, rows)


def _relaxation(at: _At) -> Iterator[Basis | None]:
    """Linear, memory in time; in series with a spring or damper it takes some of that away."""
    law, step = at.law, at.step
    yield law("maxwell_bushing", "linear_damper", DAMPING, {}, -1, lambda s, v, t: v, True)
    yield law("maxwell_bushing", "linear_spring", STIFFNESS, {}, -1, lambda s, v, t: s, True)
    for tau in (0.0006, 0.0015, 0.004, 0.01, 0.025, 0.06, 0.15, 0.4, 1.0):
        yield law(
            "maxwell_bushing", "maxwell_bushing", STIFFNESS, {"relaxation": (tau, "s")}, 1, lambda s, v, t, tau=tau: s - lag(s, tau, step)
        )
    for tau in (0.01, 0.06, 0.4):
        yield law(
            "maxwell_bushing",
            "hardening_bushing",
            ("cubic", "N/m^3"),
            {"relaxation": (tau, "s")},
            0,
            lambda s, v, t, tau=tau: (s - lag(s, tau, step)) ** 3,
            True,
        )


def _in_series(at: _At) -> Iterator[Basis | None]:
    """A damper behind a spring, or a play, in series."""
    motions, reach, step, wanted, prescribed, place = at.motions, at.reach, at.step, at.wanted, at.prescribed, at.place
    ways = [(0.0, tau) for tau in (0.0007, 0.0015, 0.004, 0.012) if tau > 0.3 * step]
    if not prescribed:
        ways += [(w * reach, max(0.001, step)) for w in GAPS]
    if not wanted("backlash", "maxwell_bushing"):
        ways = []
    lost = [losses(m.s, step, *zip(*ways, strict=True)) if ways else np.empty((0, len(m.s))) for m in motions]
    for row, (gap, tau) in enumerate(ways):
        kind, known = ("backlash", {}) if gap else ("maxwell_bushing", {"gap": (gap, "m")})
        shapes = {"relaxation": (tau, "s")} | ({} if known else {"gap": (gap, "m")})
        yield Basis(
            kind,
            place,
            "loose_damper",
            DAMPING,
            shapes,
            1,
            tuple(each_lost[row] for each_lost in lost),
            fixed=known,
            least={"relaxation": 0.2 * step},
        )


def _damping(at: _At) -> Iterator[Basis | None]:
    """Odd and slower than linear, or odd and faster."""
    law, speed = at.law, at.speed
    for w in (0.06, 0.15, 0.4, 1.0, 2.5):
        a = w * speed
        yield law(
            "degressive_damper",
            "degressive_damper",
            DAMPING,
            {"knee": (a, "m/s")},
            1,
            lambda s, v, t, a=a: -v * np.abs(v) / (a + np.abs(v)),
        )
    for w in GRID:
        a = w * speed
        yield law(
            "degressive_damper",
            "-k*(max(v - knee, 0) + min(v + knee, 0))",
            ("k", "N*s/m"),
            {"knee": (a, "m/s")},
            1,
            lambda s, v, t, a=a: np.clip(v, -a, a) - v,
        )
        if w > 0.1:
            b = 0.1 * a
            yield law(
                "degressive_damper",
                KNEE,
                ("k", "N*s/m"),
                {"knee": (a, "m/s"), "round": (b, "m/s")},
                1,
                lambda s, v, t, b=b, a=a: -b * (np.logaddexp(0.0, (v - a) / b) - np.logaddexp(0.0, (-v - a) / b)),
            )
            yield law(
                "quadratic_damper",
                "k*(max(v - knee, 0) + min(v + knee, 0))",
                ("k", "N*s/m"),
                {"knee": (a, "m/s")},
                1,
                lambda s, v, t, a=a: v - np.clip(v, -a, a),
            )
    yield law("degressive_damper", "linear_damper", DAMPING, {}, 0, lambda s, v, t: v, True)
    yield law("quadratic_damper", "quadratic_damper", ("coefficient", "N*s^2/m^2"), {}, 1, lambda s, v, t: v * np.abs(v))
    yield law("quadratic_damper", "k*v^3", ("k", "N*s^3/m^3"), {}, 1, lambda s, v, t: v**3)
    yield law("quadratic_damper", "linear_damper", DAMPING, {}, 0, lambda s, v, t: v, True)


def _uneven_damping(at: _At) -> Iterator[Basis | None]:
    """Even in the rate."""
    law, speed = at.law, at.speed
    for sign in (1, -1):
        yield law("asymmetric_damper", "k*abs(v)", ("k", "N*s/m"), {}, sign, lambda s, v, t: np.abs(v))
        a = 0.01 * speed
        yield law("asymmetric_damper", BENDS["v"], ("k", "N*s/m"), {"knee": (a, "m/s")}, sign, lambda s, v, t, a=a: bent(v, a))
        yield law("asymmetric_damper", "k*v^2", ("k", "N*s^2/m^2"), {}, sign, lambda s, v, t: v * v)
        yield law("asymmetric_damper", "k*max(v, 0)^2", ("k", "N*s^2/m^2"), {}, sign, lambda s, v, t: np.maximum(v, 0.0) ** 2)
        yield law("asymmetric_damper", "k*min(v, 0)^2", ("k", "N*s^2/m^2"), {}, sign, lambda s, v, t: np.minimum(v, 0.0) ** 2)
        for w in (0.1, 0.3):
            a = w * speed
            yield law(
                "asymmetric_damper",
                "k*(max(v - knee, 0) - min(v + knee, 0))",
                ("k", "N*s/m"),
                {"knee": (a, "m/s")},
                sign,
                lambda s, v, t, a=a: np.maximum(np.abs(v) - a, 0.0),
            )
    yield law("asymmetric_damper", "linear_damper", DAMPING, {}, 0, lambda s, v, t: v, True)


def _fading(at: _At) -> Iterator[Basis | None]:
    """Slow in time, or with the heat of its work."""
    law, motions = at.law, at.motions
    last = max(float(m.t[-1]) for m in motions)
    for sign in (1, -1):
        for w in (0.1, 0.3, 1.0, 10.0):
            a = w * last
            yield law("damper_fading", "fading_damper", DAMPING, {"time": (a, "s")}, sign, lambda s, v, t, a=a: v * (1.0 - np.exp(-t / a)))
        work = max(float(np.trapezoid(m.v**2, m.t)) for m in motions)
        for w, cool in ((0.3, 10.0), (1.0, 10.0), (10.0, 10.0), (10.0, 1.0)):
            a, b = w * work, cool * last
            shapes = {"work": (a, "m^2/s"), "cooling": (b, "s")}
            yield law("damper_fading", "heating_damper", DAMPING, shapes, sign, lambda s, v, t, a=a, b=b: v * warm(v, t, a, b))


def _springs(at: _At) -> Iterator[Basis | None]:
    """Odd and faster or slower than linear, or even."""
    law, reach = at.law, at.reach
    for sign in (1, -1):
        yield law("cubic_spring", "cubic_spring", ("cubic", "N/m^3"), {}, sign, lambda s, v, t: s**3)
        yield law("cubic_spring", "k*s*abs(s)", ("k", "N/m^2"), {}, sign, lambda s, v, t: s * np.abs(s))
        yield law("cubic_spring", "k*s^5", ("k", "N/m^5"), {}, sign, lambda s, v, t: s**5)
        yield law("asymmetric_spring", "k*abs(s)", ("k", "N/m"), {}, sign, lambda s, v, t: np.abs(s))
        a = 0.01 * reach
        yield law("asymmetric_spring", BENDS["s"], ("k", "N/m"), {"knee": (a, "m")}, sign, lambda s, v, t, a=a: bent(s, a))
        yield law("asymmetric_spring", "k*max(s, 0)^2", ("k", "N/m^2"), {}, sign, lambda s, v, t: np.maximum(s, 0.0) ** 2)
        yield law("asymmetric_spring", "k*min(s, 0)^2", ("k", "N/m^2"), {}, sign, lambda s, v, t: np.minimum(s, 0.0) ** 2)
        yield law("asymmetric_spring", "k*max(s, 0)^3", ("k", "N/m^3"), {}, sign, lambda s, v, t: np.maximum(s, 0.0) ** 3)
        yield law("asymmetric_spring", "k*min(s, 0)^3", ("k", "N/m^3"), {}, sign, lambda s, v, t: np.minimum(s, 0.0) ** 3)
        yield law("asymmetric_spring", "quadratic_spring", ("quadratic", "N/m^2"), {}, sign, lambda s, v, t: s * s)
    yield law("cubic_spring", "linear_spring", STIFFNESS, {}, 0, lambda s, v, t: s, True)
    yield law("asymmetric_spring", "linear_spring", STIFFNESS, {}, 0, lambda s, v, t: s, True)


def _gaps(at: _At) -> Iterator[Basis | None]:
    """Beyond a gap, or missing within one."""
    law, motions, reach = at.law, at.motions, at.reach
    for side, name in ((1, "bump_stop"), (-1, "rebound_stop")):
        far = max(float(np.quantile(side * m.s, 0.9995)) for m in motions)
        for w in (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9):
            g = w * far
            if g <= 0.0:
                continue
            yield law(
                "bump_stop", name, STIFFNESS, {"gap": (g, "m")}, 1, lambda s, v, t, side=side, g=g: side * np.maximum(side * s - g, 0.0)
            )
            text = "k*max(s - gap, 0)^2" if side > 0 else "-k*min(s + gap, 0)^2"
            yield law(
                "bump_stop",
                text,
                ("k", "N/m^2"),
                {"gap": (g, "m")},
                1,
                lambda s, v, t, side=side, g=g: side * np.maximum(side * s - g, 0.0) ** 2,
            )
    for w in GAPS:
        g = w * reach
        yield law("backlash", "backlash", STIFFNESS, {"gap": (g, "m")}, 1, lambda s, v, t, g=g: -np.clip(s, -g, g))
        for side, text in zip((1, -1), HALVES, strict=True):
            yield law(
                "backlash",
                text,
                ("k", "N/m"),
                {"gap": (g, "m")},
                1,
                lambda s, v, t, side=side, g=g: -side * np.clip(side * s, 0.0, g),
                True,
            )


def _lines(at: _At) -> Iterator[Basis | None]:
    """What the model has no element for."""
    for kind in lines.lacking(at.p):
        name, gain = lines.LINES[kind]
        for sign in (lines.sign(kind),) if lines.sign(kind) else (1, -1):
            yield at.law(kind, name, gain, {}, sign, lambda s, v, t, name=name: v if name == "linear_damper" else s)


FAMILIES = (_network, _friction, _hysteresis, _stribeck, _relaxation, _in_series, _damping, _uneven_damping, _fading, _springs, _gaps)


def _constant(place: int, motions: Sequence[Motion]) -> Iterator[Basis]:
    ones = tuple(np.ones_like(m.t) for m in motions)
    for settled in (False, True):
        yield Basis("constant_force", place, "constant_force", ("force", "N"), {}, 0, ones, False, settled)
    for begin in (0.1, 0.2, 0.4, 0.6, 0.9):
        for share in (0.3, 0.6):
            grown = tuple(0.5 * (1.0 + np.tanh((m.t - begin) / (share * begin))) for m in motions)
            shapes = {"begin": (begin, "s"), "time": (share * begin, "s")}
            yield Basis("constant_force", place, "growing_force", ("force", "N"), shapes, 0, grown)
