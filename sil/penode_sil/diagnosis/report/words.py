# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Words and numbers of the report: the answer in a sentence, the key figures, the cost."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .. import catalogue
from ..advice import doubts
from ..result import OUTSIDE, Cause, Diagnosis, place, plain, sigmas
from ..study.residual import Channel
from . import figure as fig
from .figure import pretty, readable, time_unit

LIKE_NOISE = 1.1  # times the noise power


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


def common(values: Sequence[float], unit: str) -> list[str]:
    """Values that are compared, in one unit: that in which the largest reads well."""
    factor, shown = readable(max(map(abs, values), default=0.0), unit)
    return [f"{value(x * factor)} {pretty(shown)}".removesuffix(" 1") for x in values]


def between(low: float, high: float, unit: str) -> str:
    """An interval with its unit once."""
    factor, shown = readable(max(abs(low), abs(high)), unit)
    return f"{value(low * factor)} … {value(high * factor)} {pretty(shown)}".removesuffix(" 1")


def relative(c: Cause, name: str) -> str:
    """Half of a 95 % interval as a share of the value."""
    v = c.parameters[name]
    half = 0.5 * (v.ci95[1] - v.ci95[0])
    return "± " + (percent(half / abs(v.value)) if 10.0 * abs(v.value) > half else value(half, v.unit))


def duration(seconds: float) -> str:
    """A time in the unit that people would take."""
    factor, unit = time_unit(seconds)
    return f"{seconds * factor:.3g} {unit}"


def joined(parts: Sequence[str]) -> str:
    return parts[0] if len(parts) == 1 else ", ".join(parts[:-1]) + " and " + parts[-1]


def sentence(text: str) -> str:
    """Words that begin with no name, as a sentence."""
    return text[:1].upper() + text[1:] + "."


def known(d: Diagnosis) -> list[Cause]:
    """Causes that have a name."""
    return [c for c in d.causes if c.kind != OUTSIDE]


def headline(d: Diagnosis) -> str:
    """The answer in one sentence; before it, whether to keep the nominal model."""
    return f"{'Keep the nominal model: the extended one predicts worse. ' * d.rejected}{_named(d)}"


def _named(d: Diagnosis) -> str:
    named = known(d)
    match d.verdict:
        case "no_discrepancy":
            return "The model agrees with the recordings."
        case "explained" | "partly_explained" if named:
            verb = "explain" if len(named) > 1 else "explains"
            what = "what the model gets wrong" if d.verdict == "explained" else "a part of what the model gets wrong"
            text = joined([place(c.kind, c.where) for c in named])
            doubt = "; the recordings do not rule out others" if doubts(d) else ""
            return f"{text[0].upper()}{text[1:]} {verb} {what}{doubt}."
        case "not_identifiable":
            return "These recordings cannot tell what is wrong."
    return "The model is wrong, and no known cause explains it."


def lead(d: Diagnosis, train: Sequence[Channel]) -> list[str]:
    """A few sentences with the numbers that matter most; `train` has the most wrong first."""
    if not train:
        return []
    seconds = {c.recording: c.time[-1] for c in train}
    counts = ((len(seconds), "recording"), (len({c.sensor for c in train}), "sensor"))
    recordings, sensors = (f"{n} {word}{'s' * (n > 1)}" for n, word in counts)
    worst = train[0]
    times, share = worst.level(worst.before) / worst.noise, percent(worst.share)
    found = [f"Fitted to {recordings} of {duration(sum(seconds.values()))} with {sensors}."]
    if d.verdict == "no_discrepancy":
        return [*found, f"The largest residual, of {worst.sensor}, is {times:.2f} × its noise, {share} of the signal."]
    found.append(f"The error is largest at {worst.sensor}: {times:.1f} × the noise, {share} of the signal, {where(worst)}.")
    if worst.after is not None:
        found.append(f"With the extended model it is {worst.level(worst.after) / worst.noise:.2f} × the noise.")
    return [*found, *(because(c) for c in known(d))]


def because(c: Cause) -> str:
    """A cause with what it means and its sizes."""
    sizes = ", ".join(f"{plain(k)} {value(v.value, v.unit)} (95 % interval {between(*v.ci95, v.unit)})" for k, v in c.parameters.items())
    name = place(c.kind, c.where)
    return f"{name[0].upper()}{name[1:]}{': ' * bool(sizes)}{sizes}. {catalogue.MEANING.get(c.kind, '')}".strip()


def where(c: Channel) -> str:
    """Where the residual beyond the noise is, in frequency and time."""
    band = _band(c)
    return f"half of it {band}{bursts(c)}" if band else "no more than noise"


def half_between(c: Channel) -> str:
    """The same of frequency, as a sentence; empty where there is no more than noise."""
    band = _band(c)
    return f"Half of the power above it lies {band}" if band else ""


def _band(c: Channel) -> str:
    """Frequencies that hold the middle half of the power beyond the noise; empty where there is none."""
    total = np.cumsum(np.maximum(c.before.density - c.floor, 0.0))
    if c.before.white.level < LIKE_NOISE or total[-1] <= 0.0:
        return ""
    low, high = (float(c.f[int(np.searchsorted(total, q * total[-1]))]) for q in (0.25, 0.75))
    return f"between {low:.2g} and {high:.2g} Hz" if high > 1.05 * low else f"near {low:.2g} Hz"


def bursts(c: Channel) -> str:
    """What share of the residual's power is in the worst tenth of the time, if that is much more than a tenth."""
    blocks = np.array_split(np.where(c.good, c.before.values, 0.0) ** 2, 20)
    powers = np.sort([float(np.sum(b)) for b in blocks])
    burst = powers[-2:].sum() / max(powers.sum(), 1e-300)
    return f", {percent(burst)} of its power in a tenth of the time" if burst > 0.3 else ""


def key_figures(d: Diagnosis) -> list[tuple[str, str, str]]:
    """What, how much, and a remark: the tiles at the top."""
    found = [("Evidence of an error", f"{sigmas(d.evidence)} σ" if d.evidence > 3.0 else "none", "residual beyond noise and tolerances")]
    if named := known(d):
        found.append(("Explained", percent(d.explained), "of the avoidable residual, in training"))
        least = min(c.confidence for c in named)
        found.append(("Confidence", percent(least), "against the next best answer"))
    return [*found, cost(d)]


def cost(d: Diagnosis) -> tuple[str, str, str]:
    """The tile of the error on the hold-out: of the signal that gains most, or else errs most."""
    what = "Error on the hold-out"
    if not d.gain:
        return what, "not measured", "no recording was held out"
    shares = {name: g.share_of_achievable for name, g in d.gain.items() if g.share_of_achievable is not None}
    name = (
        max(shares, key=lambda n: shares[n])
        if shares
        else max(d.gain, key=lambda n: d.gain[n].before_rmse / max(d.gain[n].noise_floor, 1e-300))
    )
    g = d.gain[name]
    (before, after), noise = common((g.before_rmse, g.after_rmse), g.unit), value(g.noise_floor, g.unit)
    gained = f", {percent(min(shares[name], 1.0))} of what can be gained" if name in shares and before != after else ""
    change = f"{before.partition(' ')[0]} → {after}" if " " in before else f"{before} → {after}"
    return what, before if before == after else change, f"RMS of {name}; noise {noise}{gained}"


def command(d: Diagnosis) -> str:
    """What gives the figures of the written model."""
    return f"penode simulate {d.model_file} --input RECORDING {d.simulated}".rstrip()


def gains(d: Diagnosis) -> list[dict[str, Any]]:
    """Rows of the table of gains; positions in percent of the largest error for its bars."""
    rows = []
    for name, g in d.gain.items():
        top = 1.05 * max(g.before_rmse, g.after_rmse, g.noise_floor, 1e-300)
        at = {key: round(100.0 * getattr(g, key) / top, 1) for key in ("before_rmse", "after_rmse", "noise_floor")}
        sizes = common((g.before_rmse, g.after_rmse, g.noise_floor), g.unit)
        rows.append({"name": name, "g": g, "at": at, "sizes": sizes})
    return rows
