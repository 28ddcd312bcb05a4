# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: a filter over many steps, with measurements that are missing, wild or not offered, and sets exchanged while it runs.

The covariance is positive and finite after every step, each measurement is judged as it should be, and counters are right. One of the
models is badly scaled (condition above 1e12).
"""

from __future__ import annotations

import argparse
import sys

import gate
import numpy as np

import penode_gen
from penode_sil.filtering.compiled import Compiled, CompiledFilter
from penode_sil.filtering.estimates import FLAGS, VERDICTS

MODELS = ("sil/filter/quarter.toml", "test/filter/models/scaled.toml")
STRETCH = 100_000  # steps between two exchanges
MISSING = VERDICTS.index("missing")


def stretch(own: CompiledFilter, rng: np.random.Generator, size: np.ndarray, steps: int) -> tuple[list[str], np.ndarray]:
    """Steps with drop-outs, outliers and measurements that are not offered: what is wrong, and verdicts [measurements, VERDICTS]."""
    n_z = size.size
    z = rng.standard_normal((steps, n_z)) * size
    z[rng.random(z.shape) < 0.01] *= 1e4
    z[rng.random(z.shape) < 0.01] = np.nan
    begin = int(rng.integers(steps))
    z[begin : begin + 1000, rng.integers(n_z)] = np.nan
    mask = np.where(rng.random(steps) < 0.01, rng.integers(0, 2**n_z, steps), 2**n_z - 1).astype(np.uint32)
    found, x, f = own.run(np.zeros((steps, 1)), z, mask, estimates=False, covariance=True)
    positive = (np.diagonal(f, axis1=1, axis2=2) > 0.0).all() and np.isfinite(f).all() and np.isfinite(x).all()
    offered = mask[:, None] >> np.arange(n_z) & 1 > 0
    wanted = np.where(offered, np.where(np.isnan(z), MISSING, -1), VERDICTS.index("not_offered"))
    judged = ((found.verdict == wanted) | ((wanted < 0) & (found.verdict % 2 == 1))).all()  # used and refused are odd
    flagged = all(
        np.array_equal(found.status & FLAGS[name] > 0, (found.verdict == VERDICTS.index(name)).any(axis=1))
        for name in ("missing", "refused")
    )
    wrong = [] if positive else ["a covariance is not positive or not finite"]
    wrong += (
        [] if judged and flagged and not (found.status & FLAGS["nonfinite"]).any() else ["a measurement or a flag is not as it should be"]
    )
    return wrong, np.array([np.bincount(v, minlength=len(VERDICTS)) for v in found.verdict.T], np.uint64)


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--steps", type=int, default=1_000_000, help="of each model")
    parser.add_argument("--as", dest="name", default="ekf-long")
    options = parser.parse_args()
    good, total = True, 0
    for path in MODELS:
        model, rng, wrong = penode_gen.load(gate.ROOT / path), np.random.default_rng(1), []
        own = Compiled(model).filter(next(iter(model.sets), "default"))
        counts = np.zeros((own.owner.n_z, len(VERDICTS)), np.uint64)
        size = np.array([10.0 * s.noise for s in model.filter.sensors])
        for k in range(max(1, options.steps // STRETCH)):
            wrong += [f"exchange {k} was refused"] if own.select(list(model.sets)[k % len(model.sets)]) else []
            told, verdicts = stretch(own, rng, size, STRETCH)
            wrong, counts, total = wrong + told, counts + verdicts, total + STRETCH
        last = own.run(np.zeros((1, 1)), np.zeros((1, counts.shape[0])), np.zeros(1))[0].counts
        counts[:, VERDICTS.index("not_offered")] += np.uint64(1)
        wrong += [] if np.array_equal(last, counts.astype(np.uint32)) else ["counters are not what happened"]
        good &= gate.report(f"{options.name}: {model.name}: positive, judged and counted in {options.steps} steps", sorted(set(wrong)))
    gate.keep(options.name, {"steps": total, "failures": int(not good)})
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
