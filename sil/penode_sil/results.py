# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a simulation gave: tables, pictures, a summary for machines and one for people."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Model

from . import scenario as scenarios, status
from .output import Column
from .recordings import units
from .replay import Replay
from .targets import Run


@dataclass(frozen=True, eq=False)
class Result:
    """What one instance did on any target. `status` is None on MiL; `adopted` are samples."""

    instance: scenarios.Instance
    x: NDArray[Any]
    y: NDArray[Any]
    z: NDArray[Any]
    status: NDArray[np.uint32] | None
    adopted: tuple[int, ...]
    run: Run | None = None


def _signals(model: Model, result: Result) -> Iterator[tuple[str, str, NDArray[Any]]]:
    """Name, unit as written in the model file, and SI values: outputs, sensors, then the states that are neither."""
    seen = set()
    state_units = scenarios.state_units(model)
    for name, unit, values in (
        *((s.name, s.unit, v) for s, v in zip(model.outputs, result.y.T, strict=True)),
        *((s.name, s.unit, v) for s, v in zip(model.sensors, result.z.T, strict=True)),
        *((name, state_units[name], v) for name, v in zip(model.states, result.x.T, strict=True)),
    ):
        if name not in seen:
            seen.add(name)
            yield name, unit, values


def table(
    model: Model, times: NDArray[np.float64], u: NDArray[np.float64], results: list[Result], *, prefix: bool, full: bool
) -> list[Column]:
    """Time, inputs, and per instance its signals; `full` adds states and status."""
    columns = [Column("time", "s", times, "%.12g")]
    columns += [Column(s.name, s.unit, v / units.factor(s.unit), "%.12g") for s, v in zip(model.inputs, u.T, strict=True)]
    measured = {s.name for s in (*model.outputs, *model.sensors)}
    for result in results:
        head = f"{result.instance.name}." if prefix else ""
        digits = "%.9g" if result.x.dtype == np.float32 else "%.17g"
        columns += [
            Column(head + name, unit, values.astype(float) / units.factor(unit), digits)
            for name, unit, values in _signals(model, result)
            if full or name in measured
        ]
        if full and result.status is not None:
            columns.append(Column(f"{head}status", "1", result.status, "%d"))
    return columns


def plot(
    model: Model, plan: scenarios.Scenario, times: NDArray[np.float64], results: list[Result], signal: str, path: Path, target: str
) -> None:
    from . import plots  # matplotlib is slow to load

    lines, unit = [], ""
    for result in results:
        unit, values = next((unit, values) for name, unit, values in _signals(model, result) if name == signal)
        changes = tuple((e.time, f"{e.set or 'rollback'} from {e.time:g} s") for e in result.instance.exchanges)
        lines.append(plots.Line(result.instance.name, values.astype(float) / units.factor(unit), changes))
    how = {"mil": "exact solution", "sil": "generated C on the host"}.get(target, f"generated C on {target}")
    plots.draw(path, plan.title, f"{model.name}, {how}, {model.sample_time * 1e3:g} ms", times, signal, unit, lines)


def rmse(model: Model, replay: Replay, result: Result) -> dict[str, dict[str, Any]]:
    """Root mean square of prediction - measurement at the sensors' own rows, by sensor, in the unit of the model file."""
    raster, found = replay.offset + replay.times, {}
    for name, unit, values in _signals(model, result):
        sensed = replay.sensed.get(name)
        if sensed is None:
            continue
        inside = (sensed.time >= raster[0]) & (sensed.time <= raster[-1])
        if inside.any():
            error = np.interp(sensed.time[inside], raster, values.astype(float)) - sensed.values[inside]
            found[name] = {"value": float(np.sqrt(np.mean(error**2)) / units.factor(unit)), "unit": unit, "samples": int(inside.sum())}
    return found


def summary(
    model: Model, plan: scenarios.Scenario, times: NDArray[np.float64], results: list[Result], target: str, output: Path
) -> dict[str, Any]:
    """The summary for programs."""
    instances = []
    for result in results:
        entry: dict[str, Any] = {"name": result.instance.name, "set": result.instance.set, "adopted_at_sample": list(result.adopted)}
        if result.status is not None:
            entry["flags"] = status.counts(result.status)
        if result.run is not None:
            entry["digest"] = result.run.digest
            if result.run.cost:
                entry["instructions_per_step"] = {
                    kind: {"steps": c.steps, "min": c.least, "max": c.most} for kind, c in result.run.cost.items()
                }
                entry["stack_bytes"] = result.run.stack
        instances.append(entry)
    return {
        "model": model.name,
        "scenario": plan.title,
        "target": target,
        "samples": int(times.size),
        "sample_time_s": model.sample_time,
        "output": str(output),
        "instances": instances,
    }


def sentences(summary: dict[str, Any]) -> str:
    """The summary in lines."""
    lines = [
        f"{summary['model']} on {summary['target']}: {summary['scenario']}, {summary['samples']} samples "
        f"of {summary['sample_time_s'] * 1e3:g} ms -> {summary['output']}"
    ]
    lines += [f"  {summary['start']}"] if summary.get("start") else []
    for entry in summary["instances"]:
        parts = [f"set {entry['set']}"]
        parts += [f"new set in force at sample {sample}" for sample in entry["adopted_at_sample"]]
        others = {k: n for k, n in entry.get("flags", {}).items() if k != "adopted"}
        parts += [f"{name} in {n} samples" for name, n in others.items()]
        parts += [
            f"{kind} step {c['min']}..{c['max']} instructions" if c["min"] != c["max"] else f"{kind} step {c['min']} instructions"
            for kind, c in entry.get("instructions_per_step", {}).items()
        ]
        parts += [f"stack {entry['stack_bytes']} B"] if "stack_bytes" in entry else []
        lines.append(f"  {entry['name']}: " + ", ".join(parts))
        lines += [f"  RMSE {name}: {r['value']:.6g} {r['unit']} over {r['samples']} samples" for name, r in entry.get("rmse", {}).items()]
    return "\n".join(lines)
