# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What may be wrong: every kind of cause as a family of elementary laws, none of which is a formula of its own.

A kind is known by its features (odd or even, growing faster or slower than linear, one side, threshold, memory of amplitude
or of rate, slow in time), and its family is a set of basis functions with exactly those features, on a grid of shapes. A sum
of a few of them with the signs of the kind comes close to any curve of that kind; the textbook law is a sum of one.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.polynomial import Legendre
from numpy.typing import NDArray
from scipy import fft
from scipy.linalg import solve_banded

import penode_gen
from penode_gen.model import GROUND

from ..batch import Batch
from .plant import Place

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Basis:
    """One elementary law at a place: `law` is a named one, or an expression; `gain` names the argument that multiplies it,
    `shapes` are the others; `sign` is that of the gain (0: either). `series` is its force for gain 1, per recording."""

    kind: str
    place: int
    law: str
    gain: tuple[str, str]
    shapes: dict[str, tuple[float, str]]
    sign: int
    series: tuple[Array, ...] = field(repr=False)
    companion: bool = False  # may help another of its kind, but is no cause alone
    settled: bool = False  # acted already long before the start
    fixed: dict[str, tuple[float, str]] = field(default_factory=dict)  # shapes that are known
    least: dict[str, float] = field(default_factory=dict)  # what shapes may be at least: less cannot be told


VALUED = ("bias", "scale", "delay", "roll_off", "rail", "sharpness", "clock")  # faults of a value alone; the others add a series
ROLLED = 0.006  # [s] lag of the filter that a sensor may be behind: it only has to be of the size of one
CLOCK = "clock_drift"  # kind of what is not on the list, but would pass for something that is


@dataclass(frozen=True, eq=False)
class Fault:
    """One elementary fault of a sensor: `series` is what it adds to that sensor for gain 1, per recording."""

    kind: str
    sensor: int
    what: str
    sign: int
    series: tuple[Array, ...] = field(repr=False)
    shape: float = 0.0
    companion: bool = False

    def of(self, y: Array, recording: int) -> Array:
        """What it adds for gain 1 to a simulated signal [..., n]; a fault of scale must not be told by what was measured."""
        match self.what:
            case "scale_side":
                return np.abs(y)
            case "scale_bend":
                return y * y * y / max(self.shape, 1e-300) ** 2
            case "scale_drift":
                return y * (np.arange(y.shape[-1]) / max(map(len, self.series)) - 0.5)
            case "clip":
                return -np.sign(self.shape) * np.maximum(np.sign(self.shape) * y - abs(self.shape), 0.0)
        return self.series[recording]


@dataclass(frozen=True, eq=False)
class Motion:
    """Deflection, rate [n] of a place in one recording, and the time [s] since its start."""

    s: Array
    v: Array
    t: Array


def size(motions: Sequence[Motion]) -> tuple[float, float]:
    """What deflection and rate reach, but for a thousandth of the time."""
    pairs = [(np.quantile(np.abs(m.s), 0.999), np.quantile(np.abs(m.v), 0.999)) for m in motions]
    return tuple(float(max(p[k] for p in pairs)) for k in (0, 1))


MEMORY = """
[model]
name = "memory"
sample_time = "1 s"
substeps = 4
[parameters]
one = { value = 1, unit = "N" }
width = { value = 1, unit = "m" }
drag = { value = 1, unit = "N*s/m" }
gap = { value = 1, unit = "m" }
bend = { value = 0.7, unit = "1" }
share = { value = 0.65, unit = "1" }
lag = { value = 1, unit = "s" }
[inputs]
x = { unit = "m" }
[elements]
wen = { between = ["x", "ground"], law = "bouc_wen", force = "one", presliding = "width" }
dahl = { between = ["x", "ground"], law = "dahl_friction", force = "one", presliding = "width" }
loop = { between = ["x", "ground"], law = "bouc_wen_loop", force = "one", presliding = "width", bend = "bend", share = "share" }
loose = { between = ["x", "ground"], law = "loose_damper", damping = "drag", gap = "gap", relaxation = "lag" }
[outputs]
loose = { value = "F_loose", unit = "N" }
wen = { value = "wen_slip", unit = "1" }
dahl = { value = "dahl_slip", unit = "1" }
loop = { value = "loop_slip", unit = "1" }
"""


@cache
def _memory() -> Batch:
    """Laws with memory under prescribed motion; one sample is one second."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "memory.toml"
        path.write_text(MEMORY)
        return Batch(penode_gen.load(path), exact=False)


def slips(s: Array, widths: Sequence[float]) -> Array:
    """Slip [3 widths, n] of the laws bouc_wen, dahl_friction and, about between them, bouc_wen_loop, starting without force."""
    z = _memory().run((s - s[0])[:, None], parameters={"width": np.asarray(widths)}, outputs=("wen", "dahl", "loop")).y
    return np.clip(np.concatenate([z[:, :, k] for k in range(3)]), -1.0, 1.0)


def losses(s: Array, step: float, gaps: Sequence[float], taus: Sequence[float]) -> Array:
    """Force [pairs, n] of the law loose_damper with damping 1 N*s/m, for pairs of gap and relaxation time."""
    parameters = {"gap": np.asarray(gaps), "lag": np.asarray(taus) / step}
    return _memory().run((s - s[0])[:, None], parameters=parameters, outputs=("loose",)).y[:, :, 0] / step


def lag(x: Array, tau: float, step: float) -> Array:
    """First-order lag of x."""
    a = np.exp(-step / tau)
    return solve_banded((1, 0), np.stack([np.ones_like(x), np.full_like(x, -a)]), (1.0 - a) * x, check_finite=False)


def warm(v: Array, t: Array, work: float, cooling: float) -> Array:
    """State of the law heating_damper along rates v at times t, from cold."""
    heated = v * v * (t[1] - t[0]) / work
    grown = np.cumsum(heated) + t / cooling
    return np.exp(-grown) * np.cumsum(np.exp(grown) * heated)


STRIBECK = "force*tanh(v/knee)*(1 + rise*exp(-(v/width)^2))"  # the textbook's, with a knee
BENDS = {x: f"k*(knee*(softplus(2*{x}/knee) - 0.6931471805599453) - {x})" for x in "sv"}  # slope -k here, k there, and tanh between
KNEE = "-k*round*(softplus((v - knee)/round) - softplus((-v - knee)/round))"  # of a damper, rounded


def bent(x: Array, knee: float) -> Array:
    """The law BENDS for k = 1."""
    return knee * (np.logaddexp(0.0, 2.0 * x / knee) - np.log(2.0)) - x


HALVES = ("k*(max(s - gap, 0) - max(s, 0))", "k*(min(s + gap, 0) - min(s, 0))")  # of a play: what it takes of a spring to either side

GAPS = (0.003, 0.01, 0.03, 0.06, 0.12, 0.25, 0.5)
GRID = (0.03, 0.06, 0.12, 0.25, 0.5)


def force_laws(
    place: int, p: Place, motions: Sequence[Motion], step: float, prescribed: bool, kinds: Collection[str] = ()
) -> Iterator[Basis]:
    """All elementary laws that may act at a place, or those of some kinds."""
    return filter(None, _force_laws(place, p, motions, step, prescribed, lambda *any_of: not kinds or not kinds.isdisjoint(any_of)))


def _force_laws(
    place: int, p: Place, motions: Sequence[Motion], step: float, prescribed: bool, wanted: Callable[..., bool]
) -> Iterator[Basis | None]:
    """The same, None for what is not wanted."""
    reach, speed = size(motions)
    if (p.role == "body" or GROUND in p.ends) and wanted("constant_force"):
        yield from _constant(place, motions)
    if p.role == "body":
        return
    if reach <= 0.0 or speed <= 0.0:
        return

    forces: dict[object, tuple[Array, ...]] = {}  # of a law with its shapes, whatever its kind and sign

    def law(kind, name, gain, shapes, sign, function, companion=False, fixed={}) -> Basis | None:
        if not wanted(kind):
            return None
        key = name, *shapes.items(), *fixed.items()
        if key not in forces:
            forces[key] = tuple(function(m.s, m.v, m.t) for m in motions)
        return Basis(kind, place, name, gain, shapes, sign, forces[key], companion, False, fixed)

    k, d, n = ("stiffness", "N/m"), ("damping", "N*s/m"), ("force", "N")
    if p.role == "tyre":
        yield law("tyre_damping", "linear_damper", d, {}, 1, lambda s, v, t: v)
        for tau in (0.0007, 0.002, 0.006, 0.02, 0.06):
            yield law("tyre_damping", "maxwell_bushing", k, {"relaxation": (tau, "s")}, 1, lambda s, v, t: s - lag(s, tau, step))
        yield law("tyre_damping", "quadratic_damper", ("coefficient", "N*s^2/m^2"), {}, 0, lambda s, v, t: v * np.abs(v), True)
        for w in (0.05, 0.2, 0.8):
            a = w * speed
            yield law(
                "tyre_damping", "degressive_damper", d, {"knee": (a, "m/s")}, 0, lambda s, v, t: -v * np.abs(v) / (a + np.abs(v)), True
            )
        top = max(float(np.quantile(m.s, 0.9995)) for m in motions)
        for share in (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9):
            g = share * top
            yield law("tyre_liftoff", "liftoff", k, {"static": (g, "m")}, 1, lambda s, v, t: -np.maximum(s - g, 0.0))
        for sign in (1, -1):
            yield law("tyre_nonlinear", "quadratic_spring", ("quadratic", "N/m^2"), {}, sign, lambda s, v, t: s * s)
            yield law("tyre_nonlinear", "cubic_spring", ("cubic", "N/m^3"), {}, sign, lambda s, v, t: s**3)
            yield law("tyre_nonlinear", "k*s*abs(s)", ("k", "N/m^2"), {}, sign, lambda s, v, t: s * np.abs(s))
            yield law("tyre_nonlinear", "linear_spring", k, {}, sign, lambda s, v, t: s, True)
        return

    # a network beyond the range that it was trained on
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
                    "network_extrapolation", f"k*{over}", ("k", unit), {} if stated else known, sign,
                    lambda s, v, t: side * np.maximum(side * (s if what == "s" else v) - gap, 0.0), fixed=known if stated else {},
                )  # fmt: skip
                yield law(
                    "network_extrapolation", f"k*{over}^2", ("k", "N/m^2" if what == "s" else "N*s^2/m^2"), {} if stated else known, sign,
                    lambda s, v, t: np.maximum(side * (s if what == "s" else v) - gap, 0.0) ** 2, fixed=known if stated else {},
                )  # fmt: skip
    # friction: odd, constant in rate, little or no deflection before it slides
    slide = [0.003, 0.01, 0.03, 0.06]
    for w in slide:
        a = w * speed
        yield law("coulomb_friction", "coulomb_friction", n, {"transition": (a, "m/s")}, 1, lambda s, v, t: np.tanh(v / a))
        yield law("stribeck_friction", "coulomb_friction", n, {"transition": (a, "m/s")}, 1, lambda s, v, t: np.tanh(v / a), True)
    # hysteresis: odd, memory of the way since the last reversal; with little of it, friction
    widths = [w * reach for w in (0.003, 0.01, 0.03, 0.06, 0.12, 0.25, 0.5, 1.0)]
    if not wanted("bouc_wen", "coulomb_friction", "backlash"):
        widths = []
    widths = [w for w in widths if w > 0.3 * speed * step]  # a sample must not jump over it
    slipped = [slips(m.s, widths) if widths else np.empty((0, len(m.s))) for m in motions]
    for row, (name, a) in enumerate(product(("bouc_wen", "dahl_friction", "bouc_wen_loop"), widths)):
        kind = "coulomb_friction" if a < 0.05 * reach else "bouc_wen"
        shapes = {"presliding": (a, "m")} | ({"bend": (0.7, "1"), "share": (0.65, "1")} if name == "bouc_wen_loop" else {})
        yield Basis(kind, place, name, n, shapes, 1, tuple(each_slip[row] for each_slip in slipped))
        if name == "bouc_wen" and kind == name and prescribed:  # a play shows in series with friction where no mass is in between
            flat = tuple(each_slip[row] ** 5 for each_slip in slipped)
            yield Basis("backlash", place, "slack_friction", n, {"presliding": (a, "m")}, 1, flat)
    for w in (0.01, 0.02, 0.04, 0.08, 0.16, 0.3):
        a = w * speed
        yield law(
            "stribeck_friction", "2.3316439815971242*k*exp(-(v/width)^2)*v/width", ("k", "N"), {"width": (a, "m/s")}, 1,
            lambda s, v, t: 2.3316439815971242 * np.exp(-((v / a) ** 2)) * v / a,
        )  # fmt: skip
    for w, fall, rise in product((0.005, 0.015), (0.03, 0.06, 0.12, 0.2), (0.4, 1.2)):
        a, b = w * speed, fall * speed
        yield law(
            "stribeck_friction", STRIBECK, n, {"knee": (a, "m/s"), "width": (b, "m/s"), "rise": (rise, "1")}, 1,
            lambda s, v, t: np.tanh(v / a) * (1.0 + rise * np.exp(-((v / b) ** 2))),
        )  # fmt: skip
    for w in (0.003, 0.01, 0.03):
        for fall in (0.02, 0.06, 0.2):
            a, b = w * reach, fall * speed
            if a > 0.3 * speed * step and wanted("stribeck_friction"):
                slipped = [slips(m.s, [a])[1] for m in motions]
                rows = tuple(z / (1.0 + (m.v / b) ** 2) for z, m in zip(slipped, motions))
                shapes = {"presliding": (a, "m"), "stribeck": (b, "m/s")}
                yield Basis("stribeck_friction", place, "falling_friction", n, shapes, 1, rows)
    # relaxation: linear, memory in time; in series with a spring or damper it takes some of that away
    yield law("maxwell_bushing", "linear_damper", d, {}, -1, lambda s, v, t: v, True)
    yield law("maxwell_bushing", "linear_spring", k, {}, -1, lambda s, v, t: s, True)
    for tau in (0.0006, 0.0015, 0.004, 0.01, 0.025, 0.06, 0.15, 0.4, 1.0):
        yield law("maxwell_bushing", "maxwell_bushing", k, {"relaxation": (tau, "s")}, 1, lambda s, v, t: s - lag(s, tau, step))
    for tau in (0.01, 0.06, 0.4):
        yield law(
            "maxwell_bushing", "hardening_bushing", ("cubic", "N/m^3"), {"relaxation": (tau, "s")}, 0, lambda s, v, t: (s - lag(s, tau, step)) ** 3, True
        )
    # a damper behind a spring, or a play, in series
    ways = [(0.0, tau) for tau in (0.0007, 0.0015, 0.004, 0.012) if tau > 0.3 * step]
    if not prescribed:
        ways += [(w * reach, max(0.001, step)) for w in GAPS]
    if not wanted("backlash", "maxwell_bushing"):
        ways = []
    lost = [losses(m.s, step, *zip(*ways)) if ways else np.empty((0, len(m.s))) for m in motions]
    for row, (gap, tau) in enumerate(ways):
        kind, known = ("backlash", {}) if gap else ("maxwell_bushing", {"gap": (gap, "m")})
        shapes = {"relaxation": (tau, "s")} | ({} if known else {"gap": (gap, "m")})
        yield Basis(kind, place, "loose_damper", d, shapes, 1, tuple(each_lost[row] for each_lost in lost), fixed=known, least={"relaxation": 0.2 * step})
    # dampers: odd and slower than linear, odd and faster, even, fading
    for w in (0.06, 0.15, 0.4, 1.0, 2.5):
        a = w * speed
        yield law(
            "degressive_damper", "degressive_damper", d, {"knee": (a, "m/s")}, 1, lambda s, v, t: -v * np.abs(v) / (a + np.abs(v))
        )
    for w in GRID:
        a = w * speed
        yield law(
            "degressive_damper", "-k*(max(v - knee, 0) + min(v + knee, 0))", ("k", "N*s/m"), {"knee": (a, "m/s")}, 1,
            lambda s, v, t: np.clip(v, -a, a) - v,
        )  # fmt: skip
        if w > 0.1:
            b = 0.1 * a
            yield law(
                "degressive_damper", KNEE, ("k", "N*s/m"), {"knee": (a, "m/s"), "round": (b, "m/s")}, 1,
                lambda s, v, t: -b * (np.logaddexp(0.0, (v - a) / b) - np.logaddexp(0.0, (-v - a) / b)),
            )  # fmt: skip
            yield law(
                "quadratic_damper", "k*(max(v - knee, 0) + min(v + knee, 0))", ("k", "N*s/m"), {"knee": (a, "m/s")}, 1,
                lambda s, v, t: v - np.clip(v, -a, a),
            )  # fmt: skip
    yield law("degressive_damper", "linear_damper", d, {}, 0, lambda s, v, t: v, True)
    yield law("quadratic_damper", "quadratic_damper", ("coefficient", "N*s^2/m^2"), {}, 1, lambda s, v, t: v * np.abs(v))
    yield law("quadratic_damper", "k*v^3", ("k", "N*s^3/m^3"), {}, 1, lambda s, v, t: v**3)
    yield law("quadratic_damper", "linear_damper", d, {}, 0, lambda s, v, t: v, True)
    for sign in (1, -1):
        yield law("asymmetric_damper", "k*abs(v)", ("k", "N*s/m"), {}, sign, lambda s, v, t: np.abs(v))
        a = 0.01 * speed
        yield law("asymmetric_damper", BENDS["v"], ("k", "N*s/m"), {"knee": (a, "m/s")}, sign, lambda s, v, t: bent(v, a))
        yield law("asymmetric_damper", "k*v^2", ("k", "N*s^2/m^2"), {}, sign, lambda s, v, t: v * v)
        yield law("asymmetric_damper", "k*max(v, 0)^2", ("k", "N*s^2/m^2"), {}, sign, lambda s, v, t: np.maximum(v, 0.0) ** 2)
        yield law("asymmetric_damper", "k*min(v, 0)^2", ("k", "N*s^2/m^2"), {}, sign, lambda s, v, t: np.minimum(v, 0.0) ** 2)
        for w in (0.1, 0.3):
            a = w * speed
            yield law(
                "asymmetric_damper", "k*(max(v - knee, 0) - min(v + knee, 0))", ("k", "N*s/m"), {"knee": (a, "m/s")}, sign,
                lambda s, v, t: np.maximum(np.abs(v) - a, 0.0),
            )  # fmt: skip
    yield law("asymmetric_damper", "linear_damper", d, {}, 0, lambda s, v, t: v, True)
    last = max(float(m.t[-1]) for m in motions)
    for sign in (1, -1):
        for w in (0.1, 0.3, 1.0, 10.0):
            a = w * last
            yield law(
                "damper_fading", "fading_damper", d, {"time": (a, "s")}, sign, lambda s, v, t: v * (1.0 - np.exp(-t / a))
            )
        work = max(float(np.trapezoid(m.v**2, m.t)) for m in motions)
        for w, cool in ((0.3, 10.0), (1.0, 10.0), (10.0, 10.0), (10.0, 1.0)):
            a, b = w * work, cool * last
            shapes = {"work": (a, "m^2/s"), "cooling": (b, "s")}
            yield law("damper_fading", "heating_damper", d, shapes, sign, lambda s, v, t: v * warm(v, t, a, b))
    # springs: odd and faster or slower than linear, even, beyond a gap, missing within a gap
    for sign in (1, -1):
        yield law("cubic_spring", "cubic_spring", ("cubic", "N/m^3"), {}, sign, lambda s, v, t: s**3)
        yield law("cubic_spring", "k*s*abs(s)", ("k", "N/m^2"), {}, sign, lambda s, v, t: s * np.abs(s))
        yield law("cubic_spring", "k*s^5", ("k", "N/m^5"), {}, sign, lambda s, v, t: s**5)
        yield law("asymmetric_spring", "k*abs(s)", ("k", "N/m"), {}, sign, lambda s, v, t: np.abs(s))
        a = 0.01 * reach
        yield law("asymmetric_spring", BENDS["s"], ("k", "N/m"), {"knee": (a, "m")}, sign, lambda s, v, t: bent(s, a))
        yield law("asymmetric_spring", "k*max(s, 0)^2", ("k", "N/m^2"), {}, sign, lambda s, v, t: np.maximum(s, 0.0) ** 2)
        yield law("asymmetric_spring", "k*min(s, 0)^2", ("k", "N/m^2"), {}, sign, lambda s, v, t: np.minimum(s, 0.0) ** 2)
        yield law("asymmetric_spring", "k*max(s, 0)^3", ("k", "N/m^3"), {}, sign, lambda s, v, t: np.maximum(s, 0.0) ** 3)
        yield law("asymmetric_spring", "k*min(s, 0)^3", ("k", "N/m^3"), {}, sign, lambda s, v, t: np.minimum(s, 0.0) ** 3)
        yield law("asymmetric_spring", "quadratic_spring", ("quadratic", "N/m^2"), {}, sign, lambda s, v, t: s * s)
    yield law("cubic_spring", "linear_spring", k, {}, 0, lambda s, v, t: s, True)
    yield law("asymmetric_spring", "linear_spring", k, {}, 0, lambda s, v, t: s, True)
    for side, name in ((1, "bump_stop"), (-1, "rebound_stop")):
        far = max(float(np.quantile(side * m.s, 0.9995)) for m in motions)
        for w in (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9):
            g = w * far
            if g <= 0.0:
                continue
            yield law("bump_stop", name, k, {"gap": (g, "m")}, 1, lambda s, v, t: side * np.maximum(side * s - g, 0.0))
            text = "k*max(s - gap, 0)^2" if side > 0 else "-k*min(s + gap, 0)^2"
            yield law("bump_stop", text, ("k", "N/m^2"), {"gap": (g, "m")}, 1, lambda s, v, t: side * np.maximum(side * s - g, 0.0) ** 2)
    for w in GAPS:
        g = w * reach
        yield law("backlash", "backlash", k, {"gap": (g, "m")}, 1, lambda s, v, t: -np.clip(s, -g, g))
        for side, text in zip((1, -1), HALVES):
            yield law("backlash", text, ("k", "N/m"), {"gap": (g, "m")}, 1, lambda s, v, t: -side * np.clip(side * s, 0.0, g), True)


def _constant(place: int, motions: Sequence[Motion]) -> Iterator[Basis]:
    ones = tuple(np.ones_like(m.t) for m in motions)
    for settled in (False, True):
        yield Basis("constant_force", place, "constant_force", ("force", "N"), {}, 0, ones, False, settled)
    for begin in (0.1, 0.2, 0.4, 0.6, 0.9):
        for share in (0.3, 0.6):
            grown = tuple(0.5 * (1.0 + np.tanh((m.t - begin) / (share * begin))) for m in motions)
            shapes = {"begin": (begin, "s"), "time": (share * begin, "s")}
            yield Basis("constant_force", place, "growing_force", ("force", "N"), shapes, 0, grown)


def sensor_faults(
    sensor: int, signals: Sequence[Array], times: Sequence[Array], step: float, kinds: Collection[str] = ()
) -> Iterator[Fault]:
    """All elementary faults of a sensor that should measure `signals`, or those of some kinds."""
    return filter(None, _sensor_faults(sensor, signals, times, step, kinds))


def _sensor_faults(
    sensor: int, signals: Sequence[Array], times: Sequence[Array], step: float, kinds: Collection[str]
) -> Iterator[Fault | None]:
    """The same, None for what is not wanted."""

    series: dict[tuple[str, float], tuple[Array, ...]] = {}  # of a fault with its shape, whatever its kind and sign

    def fault(kind, what, sign, function, shape=0.0, companion=False) -> Fault | None:
        if kinds and kind not in kinds:
            return None
        if (what, shape) not in series:
            series[what, shape] = tuple(function(y, t) for y, t in zip(signals, times))
        return Fault(kind, sensor, what, sign, series[what, shape], shape, companion)

    yield fault("sensor_bias", "bias", 0, lambda y, t: np.ones_like(y))
    yield fault("sensor_scale", "scale", 0, lambda y, t: y)
    yield fault("sensor_delay", "delay", 1, lambda y, t: -np.gradient(y, step))
    yield fault("sensor_delay", "roll_off", 1, lambda y, t: rolled_off(y, ROLLED, step), 0.0, True)
    top = max(float(np.max(np.abs(y))) for y in signals)
    for side in (1, -1):
        for w in (0.3, 0.5, 0.7, 0.85):
            edge = w * top
            yield fault("sensor_clipping", "clip", 1, lambda y, t: -side * np.maximum(side * y - edge, 0.0), side * edge)
    yield fault("sensor_clipping", "scale_bend", -1, lambda y, t: y**3 / max(top, 1e-300) ** 2, top, True)
    # slow or bent forms of the same
    last = max(float(t[-1]) for t in times)
    for w in (0.1, 0.3):
        yield fault("sensor_bias", "warming", 0, lambda y, t: 1.0 - np.exp(-t / (w * last)), 1.0 / w, True)
    for m in (1, 2, 3, 4):
        yield fault("sensor_bias", "drift", 0, lambda y, t: Legendre.basis(m, (0.0, last))(t), float(m), True)
    yield fault("sensor_scale", "scale_drift", 0, lambda y, t: y * (t / last - 0.5), 0.0, True)
    yield fault("sensor_scale", "scale_side", 0, lambda y, t: np.abs(y), 0.0, True)
    yield fault("sensor_scale", "scale_bend", 0, lambda y, t: y**3 / max(top, 1e-300) ** 2, top, True)


def rolled_off(y: Array, lag: float, step: float) -> Array:
    """The second derivative of a signal [n], as a filter takes it from one: of what is fast, no more than there is."""
    both = np.concatenate([y, y[::-1]])  # ends where it began
    s = 2j * np.pi * fft.rfftfreq(len(both), step)
    return fft.irfft(fft.rfft(both) * s * s / (1.0 - (s * lag) ** 2), len(both))[: len(y)]


def clock(signals: Sequence[Array], times: Sequence[Array], step: float) -> Fault:
    """A clock of all sensors [n, n_z] that runs faster than that of the inputs, from the start of each recording on."""
    series = tuple(t[:, None] * np.gradient(y, step, axis=0) for y, t in zip(signals, times))
    return Fault(CLOCK, 0, "clock", 0, series)
