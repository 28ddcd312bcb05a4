# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Figures of a report as plain data: axes with ticks, and marks as SVG paths in a box of WIDE by HIGH units.

The box is stretched to any width, text stays outside of it and keeps its size: the page reads well on paper and on a
phone. A script may read all values back from paths and axes, so no number is written twice.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
WIDE, HIGH = 10000, 3000
POINTS = 4000  # of a line at most; longer ones keep the extremes of each stretch


@dataclass(frozen=True)
class Axis:
    """From low to high in `unit`; a log axis has positive ends."""

    name: str
    unit: str
    low: float
    high: float
    log: bool = False

    @property
    def title(self) -> str:
        return f"{self.name} in {self.unit}" if self.unit not in ("", "1") else self.name

    def share(self, values: Array | float) -> Array:
        """Where values lie, 0 at the low end and 1 at the high one."""
        ends = np.array([self.low, self.high])
        if self.log:
            values, ends = np.log(np.maximum(values, 1e-300)), np.log(ends)
        found: Array = (np.asarray(values) - ends[0]) / (ends[1] - ends[0])
        return found

    def ticks(self) -> list[tuple[float, str]]:
        """Share of the way and text: multiples of 1, 2 or 5, or whole decades with 2 and 5 in between where there is
        room."""
        if self.log:
            decades = np.log10(self.high / self.low)
            factors = (1, 2, 5) if decades < 1.7 else (1,)
            step = max(int(np.ceil(decades / 6.0)), 1)
            powers = range(int(np.floor(np.log10(self.low))), int(np.ceil(np.log10(self.high))) + 1)
            values = [m * 10.0**p for p in powers if p % step == 0 for m in factors]
        else:
            rough = (self.high - self.low) / 5.0
            power = 10.0 ** np.floor(np.log10(rough))
            step = next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= rough * 0.999)
            values = [k * step for k in range(int(np.ceil(self.low / step - 1e-9)), int(np.floor(self.high / step + 1e-9)) + 1)]
        inside = [v for v in values if -1e-9 <= float(self.share(v)) <= 1.0 + 1e-9]
        return [(float(self.share(v)), number(v)) for v in inside]


def number(v: float) -> str:
    """The text of a tick: no exponent where six characters are enough."""
    if v == 0.0:
        return "0"
    text = f"{v:.10g}"
    if len(text.lstrip("-")) <= 6 and "e" not in text:
        return text.replace("-", "−")
    mantissa, exponent = f"{v:.3e}".split("e")
    mantissa = mantissa.rstrip("0").rstrip(".")
    power = "10" + str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return (power if mantissa == "1" else "−" + power if mantissa == "-1" else f"{mantissa}·{power}").replace("-", "−")


@dataclass(frozen=True)
class Mark:
    """Something drawn. `kind`: line, dots, area or tile; `look`: the class that colours it; `name`: what a legend calls
    it, and what a script reads its values by; `more`: what a tile says; `opacity` of a tile."""

    kind: str
    look: str
    path: str
    name: str = ""
    more: str = ""
    opacity: float = 1.0


@dataclass(frozen=True)
class Figure:
    """`link`: figures with the same one zoom together; `size`: wide or not; `zoom`: no use in it if False."""

    title: str
    x: Axis
    y: Axis
    marks: tuple[Mark, ...]
    says: str = ""
    link: str = ""
    size: str = ""


def line(look: str, x: Array, y: Array, ax: Axis, ay: Axis, name: str = "", points: int = POINTS) -> Mark:
    """A line through samples; NaN parts it."""
    x, y = thinned(x, y, points)
    return Mark("line", look, " ".join(_runs(x, y, ax, ay)), name)


def thinned(x: Array, y: Array, points: int) -> tuple[Array, Array]:
    """At most `points` samples: the first and the last extreme of each stretch, in their order."""
    if len(x) <= points:
        return x, y
    edges = np.linspace(0, len(x), points // 2 + 1).astype(int)
    filled = np.where(np.isfinite(y), y, 0.0)
    stretch = np.repeat(np.arange(len(edges) - 1), np.diff(edges))
    kept = np.zeros(len(x), dtype=bool)
    for extreme in (np.minimum, np.maximum):
        at = np.flatnonzero(filled == extreme.reduceat(filled, edges[:-1])[stretch])
        kept[at[np.unique(stretch[at], return_index=True)[1]]] = True  # the first one of each
    return x[kept], y[kept]


def _grid(x: Array, y: Array, ax: Axis, ay: Axis) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    across = np.round(WIDE * ax.share(x)).astype(np.int64)
    down = np.round(HIGH * np.clip(1.0 - ay.share(y), -1.0, 2.0)).astype(np.int64)
    return across, down


def _runs(x: Array, y: Array, ax: Axis, ay: Axis) -> Iterator[str]:
    sound = np.isfinite(y)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], sound.astype(np.int8), [0]])))
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        px, py = _grid(x[a:b], y[a:b], ax, ay)
        steps = "".join(f"{dx}{dy if dy < 0 else f' {dy}'} " for dx, dy in zip(np.diff(px).tolist(), np.diff(py).tolist(), strict=True))
        yield f"M{px[0]} {py[0]}" + (f"l{steps.rstrip()}" if b - a > 1 else "h0")


def dots(look: str, x: Array, y: Array, ax: Axis, ay: Axis, name: str = "") -> Mark:
    """Round points: lines of no length with round ends."""
    sound = np.isfinite(y)
    px, py = _grid(x[sound], y[sound], ax, ay)
    return Mark("dots", look, "".join(f"M{a} {b}h0" for a, b in zip(px.tolist(), py.tolist(), strict=True)), name)


def band(look: str, low: float, high: float, ay: Axis, name: str = "") -> Mark:
    """All of the plot between two values."""
    top, bottom = (int(np.round(HIGH * (1.0 - float(ay.share(v))))) for v in (high, low))
    return Mark("area", look, f"M0 {top}h{WIDE}V{bottom}H0z", name)


def spans(look: str, x: Array, inside: NDArray[np.bool_], ax: Axis, name: str = "") -> Mark:
    """All of the plot where samples are inside."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(np.int8), [0]])))
    ends = [(ax.share(x[a]), ax.share(x[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    path = "".join(f"M{WIDE * a:.0f} 0H{max(WIDE * b, WIDE * a + 10):.0f}V{HIGH}H{WIDE * a:.0f}z" for a, b in ends)
    return Mark("area", look, path, name)


def tiles(values: Array, x: Array, y: Array, ax: Axis, ay: Axis, full: float, says: str) -> list[Mark]:
    """A map of values [x bins, y bins] between edges: look `plus` or `minus`, opacity in proportion up to `full`.
    `says` is a format with the places x, y and v."""
    found = []
    px, py = _grid(x, np.full(len(x), ay.low), ax, ay)[0], _grid(np.full(len(y), ax.low), y, ax, ay)[1]
    for i, j in zip(*np.nonzero(np.isfinite(values)), strict=True):
        v = float(values[i, j])
        path = f"M{px[i]} {py[j + 1]}H{px[i + 1]}V{py[j]}H{px[i]}z"
        more = says.format(
            x=number(float(f"{(x[i] + x[i + 1]) / 2:.3g}")), y=number(float(f"{(y[j] + y[j + 1]) / 2:.3g}")), v=number(float(f"{v:.3g}"))
        )
        found.append(Mark("tile", "plus" if v > 0.0 else "minus", path, "", more, round(min(abs(v) / full, 1.0), 3) if full > 0.0 else 0.0))
    return found


def legend(f: Figure) -> list[tuple[str, str, str]]:
    """Kind, look and name of all marks that have one, each once."""
    return list(dict.fromkeys((m.kind, m.look, m.name) for m in f.marks if m.name))


def readable(peak: float, unit: str) -> tuple[float, str]:
    """Factor and unit in which numbers up to a peak are neither tiny nor huge."""
    if unit == "m":
        return next(((k, u) for limit, k, u in ((2e-4, 1e6, "µm"), (0.2, 1e3, "mm")) if peak < limit), (1.0, "m"))
    if unit == "N" and peak >= 1e4:
        return 1e-3, "kN"
    if unit == "m/s" and peak < 0.05:
        return 1e3, "mm/s"
    return 1.0, unit


def time_unit(seconds: float) -> tuple[float, str]:
    """Factor and unit in which a stretch of time is neither tiny nor huge."""
    return next(((k, u) for limit, k, u in ((600.0, 1.0, "s"), (10_800.0, 1.0 / 60.0, "min")) if seconds < limit), (1.0 / 3600.0, "h"))


def pretty(unit: str) -> str:
    """m/s^2 as m/s², and N*s/m as N·s/m."""
    for plain, small in (("^2", "²"), ("^3", "³"), ("*", "·")):
        unit = unit.replace(plain, small)
    return unit


def within(values: Sequence[Array], share: float = 0.05) -> tuple[float, float]:
    """Ends of an axis that shows all values, 0 only if it is among them."""
    low, high = (float(pick([pick(v) for v in values])) for pick in (np.min, np.max))
    room = share * (high - low) or share * abs(high) or 1.0
    return low - room, high + room


def around(values: Sequence[Array], share: float = 0.05) -> tuple[float, float]:
    """Ends of an axis that shows all values, and 0."""
    low = min((float(np.nanmin(v)) for v in values if np.isfinite(v).any()), default=0.0)
    high = max((float(np.nanmax(v)) for v in values if np.isfinite(v).any()), default=0.0)
    low, high = min(low, 0.0), max(high, 0.0)
    room = share * (high - low) or 1.0
    return low - room * (low < 0.0), high + room * (high > 0.0) or 1.0
