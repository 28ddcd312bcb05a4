# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a diagnosis says, and how it is written as diagnosis.json."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Value:
    """A parameter in `unit`, with its 95 % interval."""

    value: float
    unit: str
    ci95: tuple[float, float]


@dataclass(frozen=True)
class Named:
    """A kind and the element, body or sensor where it is."""

    kind: str
    where: str


@dataclass(frozen=True)
class Cause:
    """A named cause. `confidence` 0..1 against the next best explanation; `alternatives` explain the data about as well,
    and `separate` says what excitation would tell them apart."""

    kind: str
    where: str
    parameters: dict[str, Value]
    confidence: float
    alternatives: tuple[Named, ...] = ()
    separate: str = ""


@dataclass(frozen=True)
class Gain:
    """RMS errors of one signal on data that were not used, with the generated C; `share` of what could be gained.
    `outside`: share of the samples at which an element moves farther or faster than in training."""

    before_rmse: float
    after_rmse: float
    noise_floor: float
    share_of_achievable: float | None
    unit: str
    outside: float


@dataclass(frozen=True)
class Diagnosis:
    """See `penode diagnose`. `explained`: share of the avoidable residual that the causes take away in training."""

    verdict: str
    causes: tuple[Cause, ...]
    gain: dict[str, Gain]
    numerics: dict[str, Any]
    explained: float
    evidence: float  # chi2 that the null fit leaves beyond the noise, in its standard deviations
    notes: tuple[str, ...] = ()
    seconds: float = field(default=0.0, compare=False)

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def sentences(model: Any, d: Diagnosis, output: Path) -> str:
    """One screen for people."""
    lines = [f"{model.name}: {d.verdict.replace('_', ' ')}, {d.explained:.1%} of the avoidable residual explained ({d.seconds:.1f} s)"]
    for c in d.causes:
        lines.append(f"  {c.kind}{f' at {c.where}' if c.where else ''}, confidence {c.confidence:.2f}")
        for name, v in c.parameters.items():
            lines.append(f"    {name} = {v.value:.5g} {v.unit}  [{v.ci95[0]:.5g}, {v.ci95[1]:.5g}]")
        if c.alternatives:
            lines.append("    or " + ", ".join(f"{a.kind} at {a.where}" for a in c.alternatives))
    if d.gain:
        lines.append("  on held-out data, RMSE before -> after (noise floor):")
        lines += [f"    {k}: {g.before_rmse:.4g} -> {g.after_rmse:.4g} ({g.noise_floor:.4g}) {g.unit}" for k, g in d.gain.items()]
    lines += [f"  note: {n}" for n in d.notes]
    lines.append(f"  -> {output / 'diagnosis.json'}, {output / 'model_extended.toml'}")
    return "\n".join(lines)
