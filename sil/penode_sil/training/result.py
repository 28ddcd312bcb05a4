# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a training found, as plain data: the JSON, the report and the tests read nothing else."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from penode_gen.networks import Network

from ..compared import REJECTED
from .final import Figure
from .tries import Try
from .unknown import Unknown

Array = NDArray[np.float64]
TRAINED = "model_trained.toml"


@dataclass(frozen=True, eq=False)
class Force:
    """A trained network: curve or network values y at x with the standard deviation `sigma` of each, [n]; a histogram of where it was
    visited; for several inputs x is along each in turn, the others at 0, one array an input."""

    name: str
    way: str  # curve, network
    units: tuple[str, ...]
    output: str
    low: tuple[float, ...]
    high: tuple[float, ...]
    x: tuple[Array, ...]
    y: tuple[Array, ...]
    sigma: tuple[Array, ...]
    edges: tuple[Array, ...]
    counts: tuple[Array, ...]
    broken: tuple[str, ...]  # promises that it does not keep
    pieces: int
    network: Network


@dataclass(frozen=True)
class Error:
    """RMS errors of a signal on recordings: by the model as it was, as trained, by the generated C with the trained set; and the noise."""

    signal: str
    unit: str
    before: float
    after: float
    deployed: float
    noise: float
    inside: float  # as trained, without samples outside of the trained range and the second after them
    stated: bool  # does the model file state the noise?

    @property
    def ratio(self) -> float | None:
        """As trained, over the stated noise; None where none is stated."""
        return self.after / self.noise if self.stated else None


@dataclass(frozen=True, eq=False)
class Trained:
    """All of it."""

    model: str
    forces: tuple[Force, ...]
    parameters: dict[str, tuple[float, float, float, str]]  # value, standard deviation, value before, unit
    known: tuple[str, ...]
    unknown: tuple[Unknown, ...]
    training: tuple[Error, ...]
    holdout: tuple[Error, ...]
    outside: float  # share of the hold-out's samples outside of the trained range
    masked: float  # and of those left out beside them
    converged: bool
    tried: tuple[Try, ...]  # the start that was taken, then the others
    notes: tuple[str, ...]
    chi2: float | None  # a sample, by the stated noise; None where no recorded sensor states any
    seconds: float  # processor time from the read recordings to the networks
    seed: int
    digests: dict[str, str]
    versions: dict[str, str]
    model_file: str = TRAINED
    figures: tuple[Figure, ...] = ()  # of the written model, see final.py
    simulated: str = ""  # options of `penode simulate` that give these figures

    @property
    def rejected(self) -> bool:
        """Does the written model predict worse than the nominal one?"""
        return self.model_file == REJECTED

    @property
    def command(self) -> str:
        """What gives the figures of the written model."""
        return f"penode simulate {self.model_file} --input RECORDING {self.simulated}".rstrip()

    def as_json(self) -> dict[str, object]:
        """For programs; arrays as lists, networks left out."""
        found = {
            k: getattr(self, k)
            for k in (
                "model",
                "known",
                "outside",
                "masked",
                "converged",
                "notes",
                "chi2",
                "seconds",
                "seed",
                "digests",
                "versions",
                "model_file",
                "simulated",
            )
        }
        found["parameters"] = {n: {"value": v, "sigma": s, "before": b, "unit": u} for n, (v, s, b, u) in self.parameters.items()}
        found["tried"] = [{k: v if isinstance(v, str) or np.isfinite(v) else None for k, v in asdict(t).items()} for t in self.tried]
        found["not_identifiable"] = [asdict(u) for u in self.unknown]
        found["training"], found["holdout"] = ([asdict(e) for e in errors] for errors in (self.training, self.holdout))
        found["figures"] = [asdict(f) for f in self.figures]
        found["networks"] = {f.name: _force(f) for f in self.forces}
        return found


def _force(f: Force) -> dict[str, object]:
    return {
        "way": f.way,
        "file": f"{f.name}.onnx",
        "low": f.low,
        "high": f.high,
        "promises_broken": f.broken,
        "pieces": f.pieces,
        "band": [{"x": x.tolist(), "y": y.tolist(), "sigma": s.tolist()} for x, y, s in zip(f.x, f.y, f.sigma, strict=True)],
        "visited": [{"edges": e.tolist(), "counts": c.tolist()} for e, c in zip(f.edges, f.counts, strict=True)],
    }


def beside_noise(t: Trained) -> str:
    """What is left beside the noise that the model file states."""
    stated = [f"{e.signal} {e.ratio:.3f}" for e in t.training if e.ratio is not None]
    return (
        f"residuals over the stated noise: {', '.join(stated)}"
        if stated
        else "no sensor states its noise, so the residuals cannot be judged"
    )


def sentences(t: Trained, folder: object) -> str:
    """What the terminal shows."""
    verdict = "keep the nominal model" if t.rejected else "trained" if t.converged else "NOT CONVERGED"
    lines = [f"{t.model}: {verdict}, {t.seconds:.1f} s of processor time; {beside_noise(t)}"]
    for f in t.forces:
        ranges = ", ".join(f"{a:.3g} to {b:.3g} {u}" for a, b, u in zip(f.low, f.high, f.units, strict=True))
        lines.append(f"  {f.name}: {f.way}, trained over {ranges}, {2 * float(np.median(f.sigma[0])):.2g} {f.output} at 2 sigma")
        lines += [f"    {b}" for b in f.broken]
    for name, (value, sigma, before, unit) in t.parameters.items():
        lines.append(f"  {name:<12} {value:>12.6g} {unit} (+-{sigma:.2g}), {before:.6g} before")
    for u in t.unknown:
        lines.append(f"  not identifiable: {u.text}")
    for title, errors in (("training", t.training), ("held-out data", t.holdout)):
        if errors:
            lines.append(
                f"  {'RMS error on ' + title:<26}{'before':>10}{'after':>10}{'in the C':>10}{'noise':>10}{'ratio':>10}{'inside':>10}"
            )
            lines += [
                f"    {e.signal:<24}{e.before:>10.4g}{e.after:>10.4g}{e.deployed:>10.4g}{e.noise:>10.4g}"
                f"{'' if e.ratio is None else f'{e.ratio:.3f}':>10}{e.inside:>10.4g}  {e.unit}"
                for e in errors
            ]
    if t.holdout:
        lines.append(
            f"  {100 * t.outside:.2f} % of the hold-out lies outside of the trained range, {100 * t.masked:.1f} % is left out for 'inside'"
        )
    lines += [f"  note: {n}" for n in t.notes]
    return "\n".join([*lines, f"  -> {folder}/report.html"])
