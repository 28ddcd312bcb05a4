# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""report.html: one page that needs nothing else and tells what is wrong, why, how sure that is, and what knowing it
gains.

From the top: the answer in a sentence; per sensor and recording the residual over time, its spectrum above the noise
floor, its coherence with the input and a test for whiteness; the causes with parameters, intervals, confidence and
rivals; the restoring force of each element over deflection and rate, measured, nominal and extended; the gain on
held-out data with the generated C, samples outside of the trained range marked; the change of the model file and what
it costs on a Cortex-M4F; findings in the data; the error of the deployed step; the terms. Figures zoom, move and read
out where scripts run; all of the page can be read without, on paper, on a phone, in light and in dark. Figures are data
(report_figure.py), the page is templates/report.html.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from numpy.typing import NDArray

import penode_gen
from penode_gen.emit_c import compiled_templates
from penode_gen.model import Model

from ..output import whole
from . import catalogue
from . import report_figure as fig
from .report_figure import Axis, Figure, pretty, readable
from .report_price import difference, price
from .residual import LEAST, Channel, Residual, Shown, Surface, averages, cells, rms
from .result import VERDICTS, Cause, Diagnosis, place, plain

Array = NDArray[np.float64]
SAMPLES = 800  # that a picture of forces shows one by one
FINE = 40  # bins of a section through forces
LIKE_NOISE = 1.1  # times the noise power
BUDGET = 60_000  # points of all lines over time together, so that the page stays small


def write(path: Path, model: Model, d: Diagnosis, extended: Path) -> None:
    """The page for a diagnosis whose `shown` is there; `extended`: model_extended.toml."""
    text = render(model, d, extended)
    with whole(path) as part:
        part.write_text(text, encoding="utf-8")


def render(model: Model, d: Diagnosis, extended: Path) -> str:
    """The same as text."""
    folder = jinja2.FileSystemLoader(Path(__file__).parent / "templates")
    environment = jinja2.Environment(
        loader=folder, bytecode_cache=compiled_templates(), autoescape=True, trim_blocks=True, lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )  # fmt: skip
    environment.filters |= {"plain": plain, "pretty": pretty, "percent": percent, "value": value, "sure": sure}
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
        train=[panel(c, points) for c in train],
        held=[panel(c, points) for c in held],
        meaning=catalogue.MEANING,
        place=place,
        relative=relative,
        surfaces=[surface(s) for s in shown.surfaces],
        gains=gains(d),
        diff=difference(model.path, extended),
        price=price(model, extended),
        legend=fig.legend,
        WIDE=fig.WIDE,
        HIGH=fig.HIGH,
    )


# -- words ------------------------------------------------------------------------------------------------------------


def percent(x: float) -> str:
    """Two digits, no false precision near 0 and 100 %."""
    if x != 0.0 and abs(x) < 0.001:
        return "< 0.1 %"
    return f"{100.0 * x:.1f} %" if abs(x) < 0.0995 or 0.995 <= abs(x) < 0.9995 else f"{100.0 * x:.0f} %"


def value(x: float, unit: str = "") -> str:
    """Four digits in a unit that reads well."""
    factor, unit = readable(abs(x), unit) if unit else (1.0, "")
    text = f"{x * factor:.4g}" if 1e-4 <= abs(x * factor) < 1e6 or x == 0.0 else fig.number(float(f"{x * factor:.4g}"))
    return f"{text.replace('-', '−')} {pretty(unit)}".removesuffix(" 1").strip()


def sure(confidence: float) -> str:
    """A confidence; nothing is certain."""
    return "> 99 %" if confidence > 0.99 else percent(confidence)


def relative(c: Cause, name: str) -> str:
    """Half of a 95 % interval as a share of the value."""
    v = c.parameters[name]
    half = 0.5 * (v.ci95[1] - v.ci95[0])
    return "± " + (percent(half / abs(v.value)) if 10.0 * abs(v.value) > half else value(half, v.unit))


def joined(parts: Sequence[str]) -> str:
    return parts[0] if len(parts) == 1 else ", ".join(parts[:-1]) + " and " + parts[-1]


def headline(d: Diagnosis) -> str:
    """The answer in one sentence."""
    named = [c for c in d.causes if c.kind != "outside_taxonomy"]
    match d.verdict:
        case "no_discrepancy":
            return "The model agrees with the recordings."
        case "explained" | "partly_explained" if named:
            verb = "explain" if len(named) > 1 else "explains"
            what = "what the model gets wrong" if d.verdict == "explained" else "a part of what the model gets wrong"
            text = joined([place(c.kind, c.where) for c in named])
            return f"{text[0].upper()}{text[1:]} {verb} {what}."
        case "not_identifiable":
            return "These recordings cannot tell what is wrong."
    return "The model is wrong in a way that has no name on the list."


def lead(d: Diagnosis, train: Sequence[Channel]) -> list[str]:
    """A few sentences with the numbers that matter most; `train` has the most wrong first."""
    if not train:
        return []
    seconds = {c.recording: c.time[-1] for c in train}
    counts = ((len(seconds), "recording"), (len({c.sensor for c in train}), "sensor"))
    recordings, sensors = (f"{n} {word}{'s' * (n > 1)}" for n, word in counts)
    worst = train[0]
    times, share = worst.level(worst.before) / worst.noise, percent(worst.share)
    found = [f"Learnt from {recordings} of {sum(seconds.values()):.0f} s with {sensors}."]
    if d.verdict == "no_discrepancy":
        return [*found, f"The largest residual, of {worst.sensor}, is {times:.2f} × its noise, {share} of the signal."]
    found.append(f"It errs most at {worst.sensor}: {times:.1f} × the noise, {share} of the signal, {where(worst)}.")
    if worst.after is not None:
        now = worst.level(worst.after) / worst.noise
        found.append(f"With the cause{'s' * (len(d.causes) > 1)} in the model that falls to {now:.2f} × the noise.")
    return found


def where(c: Channel) -> str:
    """Where the residual beyond the noise is, in frequency and time."""
    if c.before.white.level < LIKE_NOISE:
        return "no more than noise"
    excess = np.maximum(c.before.density - c.floor, 0.0)
    total = np.cumsum(excess)
    if total[-1] <= 0.0:
        return "no more than noise"
    low, high = (float(c.f[int(np.searchsorted(total, q * total[-1]))]) for q in (0.25, 0.75))
    text = f"half of it between {low:.2g} and {high:.2g} Hz" if high > 1.05 * low else f"half of it near {low:.2g} Hz"
    blocks = np.array_split(np.where(c.good, c.before.values, 0.0) ** 2, 20)
    powers = np.sort([float(np.sum(b)) for b in blocks])
    burst = powers[-2:].sum() / max(powers.sum(), 1e-300)
    return text + (f", {percent(burst)} in a tenth of the time" if burst > 0.3 else "")


def key_figures(d: Diagnosis) -> list[tuple[str, str, str]]:
    """What, how much, and a remark: the tiles at the top."""
    evidence = f"{d.evidence:.0f} σ" if d.evidence > 3.0 else "none"
    found = [("Evidence of an error", evidence, "residual beyond noise and tolerances")]
    if d.causes:
        found.append(("Explained", percent(d.explained), "of the avoidable residual, in training"))
        found.append(("Confidence", sure(min(c.confidence for c in d.causes)), "against the next best answer"))
    shares = [(g.share_of_achievable, name) for name, g in d.gain.items() if g.share_of_achievable is not None]
    if shares and d.causes:
        best = max(shares)
        found.append(("Gained on hold-out", percent(best[0]), f"of what is achievable at {best[1]}"))
    return found


def gains(d: Diagnosis) -> list[dict[str, Any]]:
    """Rows of the table of gains; positions in percent of the largest error for its bars."""
    rows = []
    for name, g in d.gain.items():
        top = 1.05 * max(g.before_rmse, g.after_rmse, g.noise_floor, 1e-300)
        at = {key: round(100.0 * getattr(g, key) / top, 1) for key in ("before_rmse", "after_rmse", "noise_floor")}
        rows.append({"name": name, "g": g, "at": at})
    return rows


# -- figures ----------------------------------------------------------------------------------------------------------


def ordered(channels: Sequence[Channel]) -> list[Channel]:
    """The most wrong first."""
    return sorted(channels, key=lambda c: -c.level(c.before) / max(c.noise, 1e-300))


@dataclass(frozen=True, eq=False)
class Panel:
    """One sensor in one recording: what is said of it, and its figures."""

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
    said = [f"{name}: distance {r.white.distance:.3f}, {_chance(r.white.p_value)}" for name, r in _both(c)]
    says = f"{'; '.join(said)}; limit {c.before.white.limit:.3f}."
    return Figure("Whiteness (running periodogram)", x, y, tuple(marks), says)


def _chance(p: float) -> str:
    return "p < 10⁻⁶" if p < 1e-6 else f"p = {p:.2g}"


@dataclass(frozen=True, eq=False)
class Forces:
    """The restoring force of a place: what is said of it, and its figures."""

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
