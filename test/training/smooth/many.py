# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Forty trainings on plants with smooth forces: force errors over 2 sigma of the visited range in % of the span there, and the shares of
it that 95 % bands hold."""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

import numpy as np
import plants

from penode_sil.errors import UserError
from penode_sil.training.files import Job, run
from penode_sil.training.result import Force, Trained

COUNTS = {"alone": 14, "beside": 10, "two": 8, "tank": 8}
BAND = 1.96  # standard deviations that hold 95 %


def judged(plant: plants.Plant, force: Force) -> tuple[float, float]:
    """Error [%], and share [%] of the range that the band holds, as often as visited; NaN for a network of several inputs."""
    truth_of, visited = plant.forces[force.name]
    if visited.ndim == 2:
        at = visited[np.random.default_rng(0).choice(len(visited), 2000)]
        at = at[np.all(np.abs(at) < 2.0 * visited.std(axis=0), axis=1)]
        truth = truth_of(at)
        return 100.0 * float(np.sqrt(np.mean((force.network.evaluate(at)[:, 0] - truth) ** 2)) / np.ptp(truth)), float("nan")
    at = visited.mean() + np.linspace(-2.0, 2.0, 401) * visited.std()
    at = at[(at >= visited.min()) & (at <= visited.max())]
    truth = truth_of(at)
    error = float(np.sqrt(np.mean((force.network.evaluate(at[:, None])[:, 0] - truth) ** 2)) / np.ptp(truth))
    x, y, s = force.x[0], force.y[0], force.sigma[0]
    weight = np.interp(x, 0.5 * (force.edges[0][:-1] + force.edges[0][1:]), force.counts[0]) * (x != 0.0)
    return 100.0 * error, 100.0 * float(np.sum(weight * (np.abs(y - truth_of(x)) < BAND * s)) / np.sum(weight))


def train(kind: str, number: int, folder: Path, seconds: float = plants.SECONDS) -> dict[str, object]:
    """One training as a row."""
    plant = plants.draw(kind, number, seconds)
    model, table = plant.write(folder)
    row: dict[str, object] = {"kind": kind, "number": number}
    try:
        found: Trained = run(Job(model, (table,), (), folder / f"{kind}{number}"))
    except UserError as exc:
        return row | {"refused": exc.problems[0]}
    both = {f.name: judged(plant, f) for f in found.forces}
    return row | {
        "converged": found.converged,
        "seconds": round(found.seconds, 1),
        "errors": {n: round(e, 3) for n, (e, _) in both.items()},
        "covered": {n: round(c, 1) for n, (_, c) in both.items() if np.isfinite(c)},
        "loud": {e.signal: round(e.after / e.noise, 4) for e in found.training},
        "deployed": {e.signal: round(e.deployed / e.after, 4) for e in found.training},
        "notes": list(found.notes),
    }


def main() -> None:
    """All forty, or those of one kind; a training a line, then what was asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", help="a kind")
    parser.add_argument("--numbers", default="", help="first-last")
    parser.add_argument("--rows", type=Path, default=Path("build/smooth.jsonl"))
    given = parser.parse_args()
    given.rows.parent.mkdir(parents=True, exist_ok=True)
    rows = []
    with tempfile.TemporaryDirectory() as folder, given.rows.open("w", encoding="utf-8") as file:
        for kind in (k for k in plants.KINDS if given.only in k):
            first, last = (int(v) for v in (given.numbers or f"1-{COUNTS[kind]}").split("-"))
            for number in range(first, last + 1):
                rows.append(train(kind, number, Path(folder)))
                print(rows[-1], flush=True)
                print(json.dumps(rows[-1]), file=file, flush=True)
    print(summary(rows))


def summary(rows: list[dict[str, object]]) -> str:
    """What was asked of all of them."""
    good = [r for r in rows if r.get("converged")]
    wrong = sum(max(r["errors"].values()) > 2.0 for r in good)
    covered = {n: [r["covered"][n] for r in good if n in r["covered"]] for n in ("spring_net", "damper_net", "loss")}
    return f"{len(good)} of {len(rows)} trained, {wrong} of them with a force error above 2 %; " + ", ".join(
        f"{n}: bands hold {np.mean(c):.1f} %" for n, c in covered.items() if c
    )


if __name__ == "__main__":
    main()
