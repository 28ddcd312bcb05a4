# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Figures of the force at each place with elements over deflection and rate: measured, nominal and extended."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..study.restoring import LEAST, Surface, averages, cells, rms
from . import figure as fig
from .figure import Axis, Figure, pretty, readable
from .words import percent, value

Array = NDArray[np.float64]
SAMPLES = 800  # that a picture of forces shows one by one
FINE = 40  # bins of a section through forces
UNKNOWN = "Drawn over the rate only: the sensors show how fast the {deflection} changes, not its value"


@dataclass(frozen=True, eq=False)
class Forces:
    """The restoring force of a place: its summary and figures; `note`: why some are not there."""

    s: Surface
    summary: str
    figures: tuple[Figure, ...]
    note: str


@dataclass(frozen=True)
class Words:
    """What force, deflection and rate are called: of parts that turn, or of others."""

    force: str
    axes: tuple[str, str]


TURNING, STRAIGHT = Words("torque", ("angle", "angular rate")), Words("force", ("deflection", "rate"))


def words(s: Surface) -> Words:
    """Those of a place."""
    return TURNING if s.turns else STRAIGHT


def surface(s: Surface) -> Forces:
    """Everything about a place with elements."""
    missing, left = s.measured - s.nominal, None if s.extended is None else s.measured - s.extended
    share = rms(missing) / max(rms(s.nominal - np.mean(s.nominal)), 1e-300)
    text = f"missing {value(rms(missing), s.unit('N'))} RMS, {percent(share)} of the {words(s).force}"
    axes = (0, 1) if s.located else (1,)
    figures = [draw(s, which) for draw in (whole_force, missing_force) for which in axes]
    if left is not None:
        text += f"; {value(rms(left), s.unit('N'))} with the extension"
    if s.located:
        figures.append(heat(s, missing, "nominal"))
        figures += [] if left is None else [heat(s, left, "extended")]
    return Forces(s, text, tuple(figures), "" if s.located else UNKNOWN.format(deflection=words(s).axes[0]))


def _along(s: Surface, which: int) -> tuple[Array, Array, Axis]:
    """Deflections (0) or rates (1) in the unit of their axis, and SAMPLES of those inside of it, by number."""
    values, ends = (s.s, s.v)[which], s.edges[which]
    factor, unit = readable(float(np.max(np.abs(ends))), s.unit(("m", "m/s")[which]))
    inside = np.flatnonzero((values >= ends[0]) & (values <= ends[-1]))
    pick = inside[np.linspace(0, len(inside) - 1, min(SAMPLES, len(inside))).astype(int)]
    return factor * values, pick, Axis(words(s).axes[which], pretty(unit), factor * ends[0], factor * ends[-1])


def whole_force(s: Surface, which: int) -> Figure:
    """The force itself over deflection (0) or rate (1), samples as measured and as the models have it."""
    values, pick, x = _along(s, which)
    forces = {"measured": s.measured, "nominal": s.nominal} | ({} if s.extended is None else {"extended": s.extended})
    factor, unit = readable(max(float(np.max(np.abs(f[pick]))) for f in forces.values()), s.unit("N"))
    y = Axis(words(s).force, pretty(unit), *fig.within([factor * f[pick] for f in forces.values()]))
    marks = [fig.dots(f"fine {name}", values[pick], factor * f[pick], x, y, name) for name, f in forces.items()]
    says = f"One point is one sample; a positive {words(s).force} acts against a growing {words(s).axes[0]}. "
    says += "The model is wrong where measured and nominal points differ."
    return Figure(f"{words(s).force.title()} over {x.name}", x, y, tuple(marks), says)


def missing_force(s: Surface, which: int) -> Figure:
    """Force beyond the nominal one over deflection (0) or rate (1): samples, and means as measured and as extended."""
    values, pick, x = _along(s, which)
    edges = np.linspace(x.low, x.high, FINE + 1)
    rows, middle = cells(values, edges), 0.5 * (edges[1:] + edges[:-1])
    forces = {"measured": s.measured - s.nominal} | ({} if s.extended is None else {"extended": s.extended - s.nominal})
    means = {name: averages(f, rows, np.zeros_like(rows), (FINE, 1))[:, 0] for name, f in forces.items()}
    low, high = np.quantile(forces["measured"][pick], (0.005, 0.995))
    pick = pick[(forces["measured"][pick] >= low) & (forces["measured"][pick] <= high)]
    factor, unit = readable(max(-low, high), s.unit("N"))
    y = Axis(f"missing {words(s).force}", pretty(unit), *fig.around([factor * v for v in (np.array([low, high]), *means.values())]))
    marks = [fig.dots("cloud", values[pick], factor * forces["measured"][pick], x, y, "samples")]
    marks.append(fig.line("nominal", np.array([x.low, x.high]), np.zeros(2), x, y, "nominal"))
    if "extended" in means:
        marks.append(fig.line("extended", middle, factor * means["extended"], x, y, "extended − nominal"))
    marks.append(fig.dots("measured", middle, factor * means["measured"], x, y, "measured − nominal"))
    says = f"Large points are means in {FINE} bins; on the zero line the nominal model is right{_worst(means['measured'], middle, x, s)}."
    return Figure(f"Missing {words(s).force} over {x.name}", x, y, tuple(marks), says)


def _worst(means: Array, middle: Array, x: Axis, s: Surface) -> str:
    """Where the largest mean is, and how large."""
    if not np.isfinite(means).any():
        return ""
    k = int(np.nanargmax(np.abs(means)))
    return f", the largest gap is {value(means[k], s.unit('N'))} at {float(f'{middle[k]:.2g}'):g} {x.unit}"


def heat(s: Surface, values: Array, model: str) -> Figure:
    """Force that a model lacks over deflection and rate; colours mean the same force for both models."""
    (fx, ux), (fy, uy) = (readable(float(np.max(np.abs(e))), s.unit(u)) for e, u in zip(s.edges, ("m", "m/s"), strict=True))
    before = s.grid(s.measured - s.nominal)
    full = float(np.nanmax(np.abs(before))) if np.isfinite(before).any() else 0.0
    factor, unit = readable(full, s.unit("N"))
    x, y = (Axis(name, pretty(u), f * e[0], f * e[-1]) for name, u, f, e in zip(words(s).axes, (ux, uy), (fx, fy), s.edges, strict=True))
    says = f"{{x}} {x.unit}, {{y}} {y.unit}: {{v}} {pretty(unit)}"
    marks = fig.tiles(factor * s.grid(values), fx * s.edges[0], fy * s.edges[1], x, y, factor * full, says)
    marks.append(fig.Mark("key", "plus", "", f"the elements give too little {words(s).force}"))
    marks.append(fig.Mark("key", "minus", "", "too much"))
    says = f"Without colour the {model} model is right. Full colour: {value(full, s.unit('N'))}. No tile: fewer than {LEAST} samples."
    return Figure(f"Measured − {model} {words(s).force}", x, y, tuple(marks), says)
