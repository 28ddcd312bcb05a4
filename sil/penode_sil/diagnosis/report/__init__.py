# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""report.html: one page that needs nothing else and tells what is wrong, why, how sure that is, and what knowing it
gains.

From the top: the answer in a sentence, how sure it is, what it costs, what to do next; per sensor and recording the residual over time, its
spectrum above the noise floor, its coherence with the input and a test for whiteness; the causes with parameters, intervals, confidence and
rivals; the restoring force of each element over deflection and rate, measured, nominal and extended; the gain on held-out data with the
generated C, samples outside of the trained range marked; the change of the model file and what it costs on a Cortex-M4F; findings in the
data; the error of the deployed step; the terms. Figures zoom, move and read out where scripts run; all of the page can be read without, on
paper, on a phone, in light and in dark. Figures are data (figure.py), the page is templates/report.html.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import jinja2
import numpy as np
from numpy.typing import NDArray

import penode_gen
from penode_gen.emission.model_c import compiled_templates
from penode_gen.model import Model
from penode_gen.resources import resource

from ...output import whole
from .. import catalogue
from . import figure as fig
from ..advice import doubts
from ..reliability import line
from .figure import Axis, Figure, pretty, readable
from .changes import difference, price
from .words import LIKE_NOISE, command, gains, headline, key_figures, lead, percent, relative, sentence, sure, value, where
from ..residual import Channel, Residual, Shown
from ..restoring import LEAST, Surface, averages, cells, rms
from ..result import VERDICTS, Diagnosis, place, plain

Array = NDArray[np.float64]
SAMPLES = 800  # that a picture of forces shows one by one
FINE = 40  # bins of a section through forces
BUDGET = 60_000  # points of all lines over time together, so that the page stays small


def write(path: Path, model: Model, d: Diagnosis, extended: Path) -> None:
    """The page for a diagnosis whose `shown` is there; `extended`: the model file with what was learnt."""
    text = render(model, d, extended)
    with whole(path) as part:
        part.write_text(text, encoding="utf-8")


def render(model: Model, d: Diagnosis, extended: Path) -> str:
    """The same as text."""
    folder = jinja2.FileSystemLoader(resource("penode_sil.diagnosis", "templates"))
    environment = jinja2.Environment(
        loader=folder,
        bytecode_cache=compiled_templates(),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters |= {"plain": plain, "pretty": pretty, "percent": percent, "value": value, "sure": sure, "sentence": sentence}
    shown: Shown = d.shown
    train, held = (ordered(channels) for channels in (shown.train, shown.holdout))
    points = max(BUDGET // (2 * max(len(train) + len(held), 1)), 400)
    return environment.get_template("report.html").render(
        model=model,
        d=d,
        version=penode_gen.VERSION,
        headline=headline(d),
        verdict=VERDICTS[d.verdict],
        lead=lead(d, train),
        tiles=key_figures(d),
        doubts=doubts(d),
        line=line,
        train=[panel(c, points) for c in train],
        held=[panel(c, points) for c in held],
        meaning=catalogue.MEANING,
        place=place,
        relative=relative,
        surfaces=[surface(s) for s in shown.surfaces],
        gains=gains(d),
        command=command(d),
        diff=difference(model.path, extended),
        price=price(model, extended),
        legend=fig.legend,
        WIDE=fig.WIDE,
        HIGH=fig.HIGH,
    )


# -- figures ----------------------------------------------------------------------------------------------------------


def ordered(channels: Sequence[Channel]) -> list[Channel]:
    """The most wrong first."""
    return sorted(channels, key=lambda c: -c.level(c.before) / max(c.noise, 1e-300))


@dataclass(frozen=True, eq=False)
class Panel:
    """One sensor in one recording: its summary and figures."""

    c: Channel
    summary: str
    numbers: dict[str, str]
    figures: tuple[Figure, ...]


def panel(c: Channel, points: int) -> Panel:
    """Everything about a sensor in a recording; lines over time of at most so many points."""
    levels = {name: c.level(r) for name, r in _both(c)}
    numbers = {
        "signal": value(c.strength, c.unit),
        "noise": value(c.noise, c.unit),
        "share": percent(c.share),
        "where": where(c),
        "white": ", ".join("yes" if r.white.distance < r.white.limit else "no" for _, r in _both(c)),
        **{name: value(level, c.unit) for name, level in levels.items()},
    }
    summary = " → ".join(f"{level / c.noise:.2f}" for level in levels.values()) + " × noise"
    return Panel(c, summary, numbers, (over_time(c, points), spectrum(c), linear(c), running(c)))


def _both(c: Channel) -> list[tuple[str, Residual]]:
    """Residuals by what they are called, which is also how they look."""
    return [("before", c.before), *([("after", c.after)] if c.after else [])]


def over_time(c: Channel, points: int) -> Figure:
    """Residual [n] against the noise; samples outside of the trained range marked."""
    factor, unit = readable(float(np.max(np.abs(c.before.values[c.good]))), c.unit)
    values = {name: np.where(c.good, factor * r.values, np.nan) for name, r in _both(c)}
    x = Axis("time", "s", 0.0, float(c.time[-1]))
    y = Axis("residual", pretty(unit), *fig.around(list(values.values())))
    marks = [fig.band("noise", -1.96 * factor * c.noise, 1.96 * factor * c.noise, y, "noise, 95 %")]
    if c.beyond is not None and c.beyond.any():
        marks.insert(0, fig.spans("beyond", c.time, c.beyond, x, "outside of the trained range"))
    marks += [fig.line(name, c.time, v, x, y, name, points) for name, v in values.items()]
    says = f"{c.sensor} over {c.time[-1]:.0f} s; before: {c.level(c.before) / c.noise:.2f} × the noise."
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
    per_root = f"({pretty(unit)})/√Hz" if "/" in unit else f"{unit}/√Hz"
    y = Axis("spectrum", per_root, factor * low, factor * high, True)
    names = {"signal": "measured signal", "noise": "noise floor"}
    marks = [fig.line(name, c.f, factor * root, x, y, names.get(name, name)) for name, root in roots.items()]
    says = f"Of what lies above the noise floor: {where(c)}." if c.before.white.level >= LIKE_NOISE else ""
    return Figure("Spectrum of the residual", x, y, tuple(marks), says, f"frequency {c.sensor} {c.recording}")


def _frequency(c: Channel) -> Axis:
    return Axis("frequency", "Hz", float(c.f[0]), float(c.f[-1]), True)


def linear(c: Channel) -> Figure:
    """Coherence of the residual with the inputs."""
    x, y = _frequency(c), Axis("coherence", "1", 0.0, 1.0)
    marks = [fig.band("noise", 0.0, c.limit, y, "chance, 95 %")]
    marks += [fig.line(name, c.f, r.coherence, x, y, name) for name, r in _both(c)]
    says = "High where a linear part of the model is wrong; low where a non-linear one is, or nothing."
    return Figure("Coherence with the input", x, y, tuple(marks), says, f"frequency {c.sensor} {c.recording}")


def running(c: Channel) -> Figure:
    """The test for whiteness."""
    x, y = Axis("frequency", "Hz", 0.0, float(c.bins[-1])), Axis("share of residual over noise", "1", 0.0, 1.0)
    half = round(fig.HIGH * c.before.white.limit)
    path = f"M0 {fig.HIGH - half}L{fig.WIDE} {-half}V{half}L0 {fig.HIGH + half}z"
    marks = [fig.Mark("area", "noise", path, "white, 95 %")]
    marks += [fig.line(name, c.bins, r.running, x, y, name, 400) for name, r in _both(c)]
    distances = [f"{name}: distance {r.white.distance:.3f}, {_chance(r.white.p_value)}" for name, r in _both(c)]
    says = f"{'; '.join(distances)}; limit {c.before.white.limit:.3f}."
    return Figure("Whiteness (running periodogram)", x, y, tuple(marks), says)


def _chance(p: float) -> str:
    return "p < 10⁻⁶" if p < 1e-6 else f"p = {p:.2g}"


@dataclass(frozen=True, eq=False)
class Forces:
    """The restoring force of a place: its summary and figures."""

    s: Surface
    summary: str
    figures: tuple[Figure, ...]


def surface(s: Surface) -> Forces:
    """Everything about a place with elements."""
    missing, left = s.measured - s.nominal, None if s.extended is None else s.measured - s.extended
    share = rms(missing) / max(rms(s.nominal - np.mean(s.nominal)), 1e-300)
    text = f"missing {value(rms(missing), s.unit('N'))} RMS, {percent(share)} of the force"
    figures = [draw(s, which) for draw in (whole_force, missing_force) for which in (0, 1)]
    figures.append(heat(s, missing, "nominal"))
    if left is not None:
        text += f"; {value(rms(left), s.unit('N'))} with the extension"
        figures.append(heat(s, left, "extended"))
    return Forces(s, text, tuple(figures))


def _along(s: Surface, which: int) -> tuple[Array, Array, Axis]:
    """Deflections (0) or rates (1) in the unit of their axis, and SAMPLES of those inside of it, by number."""
    values, ends = (s.s, s.v)[which], s.edges[which]
    factor, unit = readable(float(ends[-1]), s.unit(("m", "m/s")[which]))
    inside = np.flatnonzero(np.abs(values) <= ends[-1])
    pick = inside[np.linspace(0, len(inside) - 1, min(SAMPLES, len(inside))).astype(int)]
    return factor * values, pick, Axis(("deflection", "rate")[which], pretty(unit), factor * ends[0], factor * ends[-1])


def whole_force(s: Surface, which: int) -> Figure:
    """The force itself over deflection (0) or rate (1), samples as measured and as the models have it."""
    values, pick, x = _along(s, which)
    forces = {"measured": s.measured, "nominal": s.nominal} | ({} if s.extended is None else {"extended": s.extended})
    factor, unit = readable(max(float(np.max(np.abs(f[pick]))) for f in forces.values()), s.unit("N"))
    y = Axis("force", unit, *fig.around([factor * f[pick] for f in forces.values()]))
    marks = [fig.dots(f"fine {name}", values[pick], factor * f[pick], x, y, name) for name, f in forces.items()]
    return Figure(f"Force over {x.name}", x, y, tuple(marks), "A sample each; positive pulls the ends together.")


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
    y = Axis("missing force", unit, *fig.around([factor * v for v in (np.array([low, high]), *means.values())]))
    marks = [fig.dots("cloud", values[pick], factor * forces["measured"][pick], x, y, "samples")]
    marks.append(fig.line("nominal", np.array([x.low, x.high]), np.zeros(2), x, y, "nominal"))
    if "extended" in means:
        marks.append(fig.line("extended", middle, factor * means["extended"], x, y, "extended − nominal"))
    marks.append(fig.dots("measured", middle, factor * means["measured"], x, y, "measured − nominal"))
    return Figure(f"Missing force over {x.name}", x, y, tuple(marks), f"Means in each of {FINE} bins of {x.name}.")


def heat(s: Surface, values: Array, model: str) -> Figure:
    """Force that a model lacks over deflection and rate; colours mean the same force for both models."""
    (fx, ux), (fy, uy) = readable(float(s.edges[0][-1]), s.unit("m")), readable(float(s.edges[1][-1]), s.unit("m/s"))
    before = s.grid(s.measured - s.nominal)
    full = float(np.nanmax(np.abs(before))) if np.isfinite(before).any() else 0.0
    factor, unit = readable(full, s.unit("N"))
    x = Axis("deflection", pretty(ux), fx * s.edges[0][0], fx * s.edges[0][-1])
    y = Axis("rate", pretty(uy), fy * s.edges[1][0], fy * s.edges[1][-1])
    says = f"{{x}} {x.unit}, {{y}} {y.unit}: {{v}} {unit}"
    marks = fig.tiles(factor * s.grid(values), fx * s.edges[0], fy * s.edges[1], x, y, factor * full, says)
    marks.append(fig.Mark("key", "plus", "", "the elements give too little force"))
    marks.append(fig.Mark("key", "minus", "", "too much"))
    says = f"Full colour: {value(full, s.unit('N'))}. No tile: fewer than {LEAST} samples."
    return Figure(f"Measured − {model} force", x, y, tuple(marks), says)


# -- what it costs ----------------------------------------------------------------------------------------------------
