# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Numbers of each sensor in each recording, and figures of its residual over time, over frequency, and against inputs and noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..study.residual import Channel, Residual, linear_share
from . import figure as fig
from .figure import Axis, Figure, pretty, readable, time_unit
from .words import bursts, common, half_between, percent, value, where


@dataclass(frozen=True, eq=False)
class Panel:
    """One sensor in one recording: its summary and figures."""

    c: Channel
    summary: str
    numbers: dict[str, str]
    figures: tuple[Figure, ...]


def panel(c: Channel, points: int) -> Panel:
    """Everything about a sensor in a recording; lines over time of at most so many points. Without an input nothing is coherent with it."""
    levels = {name: c.level(r) for name, r in _both(c)}
    sizes = common([c.strength, c.noise, *levels.values()], c.unit)
    numbers = {
        "share": percent(c.share),
        "where": where(c),
        "white": ", ".join("yes" if _white(r) else "no" for _, r in _both(c)),
        **dict(zip(("signal", "noise", *levels), sizes, strict=True)),
    }
    summary = " → ".join(f"{level / c.noise:.2f}" for level in levels.values()) + " × noise"
    driven = (linear(c),) if c.limit > 0.0 else ()
    return Panel(c, summary, numbers, (over_time(c, points), spectrum(c), *driven, running(c)))


def _both(c: Channel) -> list[tuple[str, Residual]]:
    """Residuals by what they are called, which is also how they look."""
    return [("before", c.before), *([("after", c.after)] if c.after else [])]


def _white(r: Residual) -> bool:
    return bool(r.white.distance < r.white.limit)


def over_time(c: Channel, points: int) -> Figure:
    """Residual [n] against the noise; samples outside of the trained range marked."""
    factor, unit = readable(float(np.max(np.abs(c.before.values[c.good]))), c.unit)
    values = {name: np.where(c.good, factor * r.values, np.nan) for name, r in _both(c)}
    per, unit_of_time = time_unit(float(c.time[-1]))
    time = per * c.time
    x = Axis("time", unit_of_time, 0.0, float(time[-1]))
    y = Axis("residual", pretty(unit), *fig.around(list(values.values())))
    marks = [fig.band("noise", -1.96 * factor * c.noise, 1.96 * factor * c.noise, y, "noise, 95 %")]
    if c.beyond is not None and c.beyond.any():
        marks.insert(0, fig.spans("beyond", time, c.beyond, x, "outside of the trained range"))
    marks += [fig.line(name, time, v, x, y, name, points) for name, v in values.items()]
    before, *after = (value(float(f"{c.level(r) / c.noise:.3g}")) for _, r in _both(c))
    says = f"The residual of a correct model stays within the grey band. Here it is {before} × the noise{bursts(c)}"
    says += f"; with the extension {after[0]} × the noise." if after else "."
    return Figure("Residual over time", x, y, tuple(marks), says, f"time {c.recording}", "wide")


def spectrum(c: Channel) -> Figure:
    """Roots of the densities of residual, noise and signal."""
    roots = {"signal": c.signal, "noise": c.floor} | {name: r.density for name, r in _both(c)}
    roots = {name: np.sqrt(density) for name, density in roots.items()}
    peak = float(np.max(roots["before"]))
    factor, unit = readable(peak, c.unit)
    high = 2.0 * max(peak, float(np.max(roots["signal"])))
    low = max(0.5 * min(float(np.min(roots["noise"])), float(np.quantile(roots["before"], 0.02))), 1e-6 * high)
    x = _frequency(c)
    per_root = f"({pretty(unit)})/√Hz" if "/" in unit else f"{pretty(unit)}/√Hz"
    y = Axis("spectrum", per_root, factor * low, factor * high, True)
    names = {"signal": "measured signal", "noise": "noise floor"}
    marks = [fig.line(name, c.f, factor * root, x, y, names.get(name, name)) for name, root in roots.items()]
    found = half_between(c)
    says = f"The dashed line is the noise. {found}." if found else "The residual is no larger than the noise (dashed)."
    return Figure("Spectrum of the residual", x, y, tuple(marks), says, f"frequency {c.sensor} {c.recording}")


def _frequency(c: Channel) -> Axis:
    return Axis("frequency", "Hz", float(c.f[0]), float(c.f[-1]), True)


def linear(c: Channel) -> Figure:
    """Coherence of the residual with the inputs."""
    x, y = _frequency(c), Axis("coherence", "1", 0.0, 1.0)
    marks = [fig.band("noise", 0.0, c.limit, y, "chance, 95 %")]
    marks += [fig.line(name, c.f, r.coherence, x, y, name) for name, r in _both(c)]
    share = linear_share(c, c.before)
    hints = ("typical of friction, play or a curved law, or of a cause outside the inputs", "typical of a parameter, a gain or a delay")
    says = f"{percent(share)} of the power of the residual before is a linear function of the inputs, {hints[round(share)]}."
    return Figure("Coherence with the input", x, y, tuple(marks), says, f"frequency {c.sensor} {c.recording}")


def running(c: Channel) -> Figure:
    """The test for whiteness."""
    x, y = Axis("frequency", "Hz", 0.0, float(c.bins[-1])), Axis("share of residual over noise", "1", 0.0, 1.0)
    half = round(fig.HIGH * c.before.white.limit)
    path = f"M0 {fig.HIGH - half}L{fig.WIDE} {-half}V{half}L0 {fig.HIGH + half}z"
    marks = [fig.Mark("area", "noise", path, "white, 95 %")]
    marks += [fig.line(name, c.bins, r.running, x, y, name, 400) for name, r in _both(c)]
    stays = ("outside, not only noise", "inside, like noise")
    found = [f"{name}: {stays[_white(r)]} (distance {r.white.distance:.3f}, {_chance(r.white.p_value)})" for name, r in _both(c)]
    says = f"The curve of noise alone stays inside the grey band. {'; '.join(found).capitalize()}; limit {c.before.white.limit:.3f}."
    return Figure("Whiteness (running periodogram)", x, y, tuple(marks), says)


def _chance(p: float) -> str:
    return "p < 10⁻⁶" if p < 1e-6 else f"p = {p:.2g}"
