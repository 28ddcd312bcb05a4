# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a filter gave: tables, a summary for machines and one for people, a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Model

from ..output import Column, whole
from ..recordings import units
from ..replay import Replay
from .estimates import FLAGS, VERDICTS, Estimates, named, of

Array = NDArray[Any]


def columns(model: Model, found: Estimates, suffix: str = "") -> list[Column]:
    """Estimates with their standard deviations (.sd), then test ratios of the measurements (.ratio), and the status."""
    table = []
    for at, name, unit in named(model):
        for end, values in ((suffix, found.values), (".sd", found.deviations)):
            table.append(Column(f"{name}{end}", unit, values[:, at].astype(float) / units.factor(unit)))
    for sensor, ratio in zip(of(model).sensors, found.ratio.T, strict=True):
        table.append(Column(f"{sensor.name}.ratio", "1", ratio.astype(float)))
    return [*table, Column("filter.status", "1", found.status, "%d")]


def summary(model: Model, found: Estimates) -> dict[str, Any]:
    """Counts of measurements, means of test ratios (1 where noises are right), parameters at the end, counts of flags."""
    measured = {}
    for k, sensor in enumerate(of(model).sensors):
        used = found.verdict[:, k] == VERDICTS.index("used")
        ratios = found.ratio[used, k]
        counts = {name: int(n) for name, n in zip(VERDICTS, found.counts[k], strict=True)}
        measured[sensor.name] = counts | {"mean_ratio": float(ratios.mean()) if used.any() else None}
    parameters, own = {}, {p.name for p in of(model).parameters}
    for at, name, unit in (column for column in named(model) if column[1] in own):
        value, deviation = (float(part[-1, at]) / units.factor(unit) for part in (found.values, found.deviations))
        parameters[name] = {"value": value, "deviation": deviation, "unit": unit}
    return {
        "measurements": measured,
        "parameters": parameters,
        "flags": {name: n for name, bit in FLAGS.items() if (n := int((found.status & bit > 0).sum()))},
    }


def checked(model: Model, found: Estimates, read: Replay) -> dict[str, dict[str, Any]]:
    """Estimates beside what a recording holds and the filter did not use: RMSE, and how often within 3 standard deviations."""
    used, raster, result = {s.name for s in of(model).sensors}, read.offset + read.times, {}
    for at, name, unit in named(model):
        sensed = read.sensed.get(name)
        if sensed is None or name in used:
            continue
        inside = (sensed.time >= raster[0]) & (sensed.time <= raster[-1])
        if not inside.any():
            continue
        error, deviation = (
            np.interp(sensed.time[inside], raster, part[:, at].astype(float)) - shift
            for part, shift in ((found.values, sensed.values[inside]), (found.deviations, 0.0))
        )
        own = next((s.noise for s in model.sensors if s.name == name), 0.0)
        bound = 3.0 * np.hypot(deviation, own)
        within = np.abs(error) <= bound
        rmse = float(np.sqrt(np.mean(error**2)) / units.factor(unit))
        result[name] = {"rmse": rmse, "unit": unit, "samples": int(inside.sum()), "within_3_sd": float(within.mean())}
    return result


def sentences(entry: dict[str, Any]) -> list[str]:
    """A summary in lines."""
    lines = []
    for name, m in entry["measurements"].items():
        ratio = "" if m["mean_ratio"] is None else f", mean test ratio {m['mean_ratio']:.3f}"
        lines.append(f"  {name}: used in {m['used']} samples, missing in {m['missing']}, refused in {m['refused']}{ratio}")
    for name, p in entry["parameters"].items():
        lines.append(f"  {name}: {p['value']:.6g} {p['unit']} at the end, standard deviation {p['deviation']:.2g} {p['unit']}")
    lines += [f"  {name} in {n} samples" for name, n in entry["flags"].items() if name not in ("missing", "refused")]
    for name, c in entry.get("checked", {}).items():
        lines.append(
            f"  {name}: RMSE {c['rmse']:.6g} {c['unit']}, {c['within_3_sd']:.1%} of {c['samples']} samples within 3 standard deviations"
        )
    return lines


def plot(model: Model, found: Estimates, times: Array, name: str, truth: tuple[Array, Array] | None, title: str, path: Path) -> None:
    """An estimate with 3 standard deviations; `truth`: times and values, SI."""
    from ..plots import COLOURS, STYLE, plt  # matplotlib is slow to load

    at, unit = next((at, unit) for at, other, unit in named(model) if other == name)
    scale = 1.0 / units.factor(unit)
    value, spread = (scale * part[:, at].astype(float) for part in (found.values, 3.0 * found.deviations))
    with plt.rc_context(STYLE):
        figure, panel = plt.subplots(figsize=(8.0, 3.6), layout="constrained")
        panel.fill_between(times, value - spread, value + spread, color=COLOURS[5], alpha=0.4, linewidth=0.0, label="3 standard deviations")
        panel.plot(times, value, color=COLOURS[0], label="estimate")
        if truth is not None:
            panel.plot(truth[0], scale * truth[1], color=COLOURS[1], linewidth=0.9, label="truth")
        edges = np.concatenate([value - spread, value + spread])
        low, high = np.percentile(edges, [1, 99])  # a start that is not known would flatten all the rest
        panel.set_ylim(min(low, value.min()) - 0.05 * (high - low), max(high, value.max()) + 0.05 * (high - low))
        panel.set_xlabel("time in s")
        panel.set_ylabel(f"{name} in {unit}")
        panel.set_title(f"{model.name}, filter of {', '.join(s.name for s in of(model).sensors)}", fontsize=9, color="#444444")
        panel.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.2)
        figure.suptitle(title, x=0.01, ha="left", fontsize=12, fontweight="bold")
        try:
            with whole(path) as part:
                figure.savefig(part, metadata={"Software": None} if path.suffix == ".png" else None)
        finally:
            plt.close(figure)
