# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
Filters against a plant and noises of their own (independent.c, double): consistency, outliers and drop-outs, a body mass as a state.

    filter_campaign.py --runs 100    writes FILTER.md; exit code 1 if what is asked is not met

The row of the long run is that of hour_check.py, which puts its figures into test/prove/figures.json.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import plant
from independent import FLOAT, Array, Reference, Road
from scipy.stats import chi2

import penode_gen
from penode_sil.filtering.compiled import Compiled
from penode_sil.filtering.estimates import FLAGS, VERDICTS
from penode_sil.filtering.innovations import HOLDING

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
RATE = round(1.0 / plant.H)  # samples a second
BAND = 0.95
INTERVAL = 1.96  # standard deviations
USED, MISSING, REFUSED = (VERDICTS.index(name) for name in ("used", "missing", "refused"))

# ISO 8608, class C: spectral density of the height at 0.1 cycles a metre [m^3]; no waves above 100 m are left
DENSITY, REFERENCE, LONGEST, SPEED = 256e-6, 0.1, 100.0, 20.0  # SPEED [m/s]


@dataclass(frozen=True)
class Share:
    """Of the samples in which the mean over the runs is inside of its band; and that mean over all samples."""

    inside: float
    mean: float


def road_c() -> Road:
    """A road of class C as white noise of its slope through a lag, which holds the longest waves back."""
    decay = float(np.exp(-2.0 * np.pi * SPEED / LONGEST * plant.H))
    return Road(0.0, float(np.sqrt(2.0 * np.pi**2 * DENSITY * REFERENCE**2 * SPEED * plant.H)), decay)


def share(values: Array, freedom: int) -> Share:
    """Of chi-square values [samples, runs]."""
    low, high = chi2.ppf([0.5 - BAND / 2.0, 0.5 + BAND / 2.0], freedom * values.shape[1]) / values.shape[1]
    means = values.mean(axis=1)
    return Share(float(np.mean((means > low) & (means < high))), float(means.mean()))


def consistency(name: str, runs: int, samples: int, place: Path) -> tuple[Share, Share]:
    """NEES and NIS of a model whose filter does not know the road."""
    model = penode_gen.load(HERE / "models" / f"{name}.toml")
    compiled, nees, nis = Compiled(model), np.zeros((samples, runs)), np.zeros((samples, runs))
    for run in range(runs):
        truth, z = Reference(model, place, seed=[*name.encode(), run]).drive(samples)
        found, x, f = compiled.filter().run(np.zeros((samples, 1)), z, estimates=False, covariance=True)
        assert not found.status.any()
        error = x - truth
        nees[:, run] = np.einsum("ki,kij,kj->k", error, np.linalg.inv(plant.covariance(f)), error)
        nis[:, run] = found.ratio.sum(axis=1)
    return share(nees, compiled.n), share(nis, compiled.n_z)


@dataclass
class Disturbed:
    """Of one sensor with outliers and drop-outs: of how many outliers how many were refused, and of the other measurements; whether all
    that is missing is flagged; and the largest ratio of a state's error, outside of the drop-outs, to that without any of it."""

    outliers: int = 0
    refused: int = 0
    sound: int = 0
    sound_refused: int = 0
    flagged: bool = True
    ratio: float = 0.0


def disturbed(sensor: int, runs: int, seconds: int, place: Path) -> Disturbed:
    """Outliers of 50 standard deviations of the innovation in 1 % of the samples, and a drop-out of 1 s in the middle of every 5 s."""
    model = penode_gen.load(ROOT / "sil" / "filter" / "quarter.toml")
    compiled, found, n = Compiled(model), Disturbed(), seconds * RATE
    squares = np.zeros((2, 5))
    gap = np.arange(n) // RATE % 5 == 2
    for run in range(runs):
        rng = np.random.default_rng([sensor, run])
        truth, z = Reference(model, place, seed=run, rest=True).drive(n)
        out = (rng.random(n) < 0.01) & ~gap & (np.arange(n) >= RATE)
        clean, x_clean, _ = compiled.filter().run(np.zeros((n, 1)), z, estimates=False)
        worse = z.copy()
        worse[out, sensor] += 50.0 * np.sqrt(clean.variance[out, sensor]) * rng.choice([-1.0, 1.0], out.sum())
        worse[gap, sensor] = np.nan
        told, x, _ = compiled.filter().run(np.zeros((n, 1)), worse, estimates=False)
        verdict, any_refused = told.verdict[:, sensor], (told.verdict == REFUSED).any(axis=1)
        found.outliers += int(out.sum())
        found.refused += int((verdict[out] == REFUSED).sum())
        found.sound += int((~out & ~gap).sum())
        found.sound_refused += int((verdict[~out & ~gap] == REFUSED).sum())
        found.flagged &= bool(np.array_equal(told.status & FLAGS["refused"] > 0, any_refused))
        found.flagged &= bool(np.array_equal(told.status & FLAGS["missing"] > 0, gap) and (verdict[gap] == MISSING).all())
        squares += [np.sum((part - truth)[~gap] ** 2, axis=0) for part in (x, x_clean)]
    found.ratio = float(np.sqrt((squares[0] / squares[1]).max()))
    return found


@dataclass(frozen=True)
class Masses:
    """Of each run: error of the mass at its end, over the mass itself; 1 if the interval covers it then; the share of the samples of the
    second half in which it does."""

    error: Array
    covered: Array
    share: Array


def masses(runs: int, seconds: int, place: Path, still: bool = False, seed: int = 0) -> Masses:
    """A vehicle on a measured road, its mass 20 % off at the start, which side is drawn; it walks as the filter takes it, or stands."""
    model = penode_gen.load(HERE / "models" / "mass.toml")
    compiled, rows, n = Compiled(model), [], seconds * RATE
    given, nominal = model.filter.parameters[0], model.parameters["m_b"].value
    for run in range(runs):
        rng = np.random.default_rng([seed, run])
        walk = np.cumsum(given.step * rng.standard_normal(n)) * (0.0 if still else 1.0)
        mass = nominal * (1.0 + 0.2 * rng.choice([-1.0, 1.0])) + walk
        truth, z = Reference(model, place, seed=[seed, run], road=road_c()).drive(n, mass)
        found, x, f = compiled.filter().run(truth[:, 4:], z, estimates=False, covariance=True)
        assert not (found.status & HOLDING).any()
        error = x[:, 4] - mass
        covered = np.abs(error) <= INTERVAL * np.sqrt(plant.covariance(f)[:, 4, 4])
        rows.append((error[-1] / mass[-1], covered[-1], covered[n // 2 :].mean()))
    return Masses(*(np.array(column, float) for column in zip(*rows, strict=True)))


def _hours() -> Iterator[tuple[str, str, bool]]:
    """What hour_check.py found last: what is asked, the figure, and whether it is met."""
    kept: dict[str, Any] = json.loads((ROOT / "test" / "prove" / "figures.json").read_text()).get("ekf hour campaign", {})
    for name in ("layered", "folded") if kept else ():
        for key, most in ((f"{name} float64", 1e-9), (f"{name} float32", FLOAT), (f"{name} at kinks", FLOAT)):
            value, text = float(kept[key]), f"{kept['seconds']} s, {key}: at most {most:g} of a standard deviation off the other filter"
            if key.endswith("kinks"):
                text += (
                    f" (0.1 s after a kink of a network between both, or within a float's rounding: {kept[f'{name} share']} of the samples)"
                )
            yield text, f"{value:.1e}", value <= most
        yield f"{name} in float: share of all samples in which it is further off", kept[f"{name} beyond"], True


def rows(runs: int, place: Path) -> Iterator[tuple[str, str, bool]]:
    """What is asked, what was found, and whether that is met."""
    for name, what in (("layered", "road unknown"), ("folded", "road unknown, folded networks")):
        for kind, found in zip(("NEES", "NIS"), consistency(name, runs, RATE, place), strict=True):
            text = f"{what}: {kind} over {runs} runs inside its {BAND:.0%} band in at least 90 % of the samples"
            yield text, f"{found.inside:.1%}, mean {found.mean:.2f}", found.inside >= 0.9
    for sensor, name in enumerate(("a_body", "a_wheel")):
        d = disturbed(sensor, max(runs // 10, 1), 60, place)
        text = f"{name}: outliers of 50 standard deviations in 1 % of the samples are refused, drop-outs of 1 s flagged"
        told = f"{d.refused} of {d.outliers}, and {d.sound_refused} of {d.sound} others; flags {'right' if d.flagged else 'wrong'}"
        yield text, told, d.refused == d.outliers and d.flagged
        yield f"{name}: error outside of the drop-outs at most twice that without them", f"{d.ratio:.2f} times", d.ratio <= 2.0
    walking, still = masses(runs, 60, place), masses(runs, 60, place, still=True)
    for m, what in ((walking, "body mass 20 % off, which walks as the filter takes it"), (still, "the same, which stands still")):
        worst = float(np.abs(m.error).max())
        yield f"{what}: within 2 % after 60 s on a road of class C, every one of {runs} runs", f"{worst:.3%}", worst <= 0.02
    good = 0.9 <= walking.covered.mean() <= 0.98
    told = f"{walking.covered.mean():.0%}; in the last 30 s {walking.share.mean():.1%}"
    yield "the mass that walks: its 95 % interval covers it in 90 to 98 % of the runs", told, bool(good)
    yield "the mass that stands still: the same interval, wider than it need be", f"{still.covered.mean():.0%}", True
    yield from _hours()


def page(found: list[tuple[str, str, bool]], runs: int) -> str:
    """The page: one row for each thing that is asked."""
    lines = [
        "# Filters against a plant of their own",
        "",
        f"Written by `make campaign-filter`: {runs} runs each, {max(runs // 10, 1)} of 60 s with outliers. Plant, noises and, over the"
        " long run, the other filter are those of `independent.c`, in double; the filters are generated C in float unless stated: of"
        " `models/` and `sil/filter/quarter.toml`. Road of class C: ISO 8608, 20 m/s. An outlier's standard deviation is that of its"
        " innovation.",
        "",
        "| asked | found | met |",
        "|---|---|---|",
    ]
    return "\n".join([*lines, *(f"| {asked} | {told} | {'yes' if met else 'no'} |" for asked, told, met in found), ""])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--page", type=Path, default=HERE / "FILTER.md")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        text = page(list(rows(asked.runs, Path(place))), asked.runs)
    asked.page.write_text(text, encoding="utf-8")
    print(text)
    return int("| no |" in text)


if __name__ == "__main__":
    sys.exit(main())
