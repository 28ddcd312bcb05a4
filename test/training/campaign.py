# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""`make campaign-train`: networks trained on recordings of plants that are known, judged by what the plants are.

Force errors are RMS over 2 sigma of the visited range, in % of the force's span there. Processor time is that from the read recording to
the networks, and its ratio to a fixed loop of a million steps of plain Python, timed before and after it (clock.py). Ratios are the largest
of the parameters' errors against each other; hold-out is the larger of both sensors' errors over their noise, inside the trained range. The
band covers: share of places where truth is within 2 sigma.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import clock
import generator
import numpy as np

import penode_gen
import penode_sil.training
from penode_gen.model import Model
from penode_gen.reading.untrained import untrained
from penode_sil.errors import UserError
from penode_sil.recordings.measured import load
from penode_sil.training import threads
from penode_sil.training.result import Force, Trained
from penode_sil.training.story import Options, train

HERE = Path(__file__).parent
OFF = {"m_b": 1.0, "m_w": 0.9, "c_t": 1.1, "d_t": 0.9}  # what a file says over the truth; m_b is weighed
LINEAR = {"spring_net": 1e4, "damper_net": 800.0}


@dataclass(frozen=True)
class Case:
    """A row of the table: a plant, noise, and what the model is; `weighed`: m_b is known."""

    name: str
    truth: generator.Truth
    noise: float
    layers: tuple[int, ...]
    activation: str = "relu"
    two: bool = False
    off: dict[str, float] | None = None
    weighed: bool = False
    exact: bool = False


CASES = (
    Case("x1, 1-16-16-1", generator.Truth(), 1.0, (16, 16), exact=True),
    Case("x1, 1-16-16-16-1", generator.Truth(), 1.0, (16, 16, 16), exact=True),
    Case("x5, parameters off, m_b weighed", generator.Truth(), 5.0, (16, 16, 16), off=OFF, weighed=True),
    Case("x5, parameters off, nothing weighed", generator.Truth(), 5.0, (16, 16, 16), off=OFF | {"m_b": 1.1}),
    Case("x1, stops and degressive damper", generator.STOPS, 1.0, (16, 16, 16), exact=True),
    Case("x1, tanh 2-16-16-1", generator.TWO_INPUTS, 1.0, (16, 16), "tanh", two=True, weighed=True),
    Case("x5, tanh 2-16-16-1", generator.TWO_INPUTS, 5.0, (16, 16), "tanh", two=True, weighed=True),
)


def model_of(case: Case) -> Model:
    """The model of a case: its networks' shapes, and parameters as the file has them."""
    model = penode_gen.load(HERE / ("quarter_two.toml" if case.two else "quarter.toml"))
    shape = {"layers": list(case.layers), "activation": case.activation}
    networks = {n: untrained(shape, len(p.input_units), n) for n, p in model.networks.items()}
    parameters = {
        n: replace(p, value=p.value * (case.off or {}).get(n, 1.0), tolerance=0.0 if case.exact else p.tolerance)
        for n, p in model.parameters.items()
    }
    return replace(model, parameters=parameters, sets={"default": replace(model.sets["default"], networks=networks)})


def judged(case: Case, made: generator.Made, t: Trained) -> Iterator[tuple[str, float, float]]:
    """Name, error [%] and share covered [%] of each network, after the common scale unless a mass is weighed."""
    ratios = [v / generator.PLAIN[n] for n, (v, *_) in t.parameters.items()]
    scale = 1.0 if case.weighed or not ratios else float(np.mean(ratios))
    for force in t.forces:
        if case.two:
            random = np.random.default_rng(0).choice(len(made.time), 2000)
            s, v = made.deflection[random], made.speed[random]
            inside = (np.abs(s) < 2.0 * made.deflection.std()) & (np.abs(v) < 2.0 * made.speed.std())
            truth = case.truth.force(2, s[inside], v[inside])
            found = force.network.evaluate(np.stack([s[inside], v[inside]], axis=1))[:, 0]
            yield force.name, 100.0 * float(np.sqrt(np.mean((found - truth) ** 2)) / np.ptp(truth)), float("nan")
            continue
        which = 0 if force.name == "spring_net" else 1
        at = np.linspace(-2.0, 2.0, 401) * (made.deflection, made.speed)[which].std()
        truth, linear = case.truth.force(which, at, at), LINEAR[force.name] * at
        found = (force.network.evaluate(at[:, None])[:, 0] + linear) / scale - linear
        yield force.name, 100.0 * float(np.sqrt(np.mean((found - truth) ** 2)) / np.ptp(truth)), covered(case, force, which)


def covered(case: Case, force: Force, which: int) -> float:
    """Share [%] of the visited places, as often as visited, where the truth is within 2 sigma of the trained curve."""
    x, y, s = force.x[0], force.y[0], force.sigma[0]
    truth = case.truth.force(which, x, x)
    weight = np.interp(x, 0.5 * (force.edges[0][:-1] + force.edges[0][1:]), force.counts[0])
    away = x != 0.0
    return 100.0 * float(np.sum(weight[away] * (np.abs(y - truth)[away] < 2.0 * s[away])) / np.sum(weight[away]))


def run(case: Case, seed: int, folder: Path) -> dict[str, object]:
    """One training."""
    made = generator.make(case.truth, seed, case.noise)
    held = generator.make(case.truth, seed + 100, case.noise)
    model = model_of(case)
    noisy = replace(model, sensors=tuple(replace(s, noise=s.noise * case.noise) for s in model.sensors))
    data, holdout = (load([m.write(folder / f"{n}.csv")], noisy) for n, m in (("data", made), ("holdout", held)))
    try:
        loop = clock.loop()
        with threads.one():
            _, t = train(noisy, data, holdout, Options((("m_b", None),) if case.weighed else (), seed), lambda share, doing: None)
    except UserError as exc:
        return {"case": case.name, "seed": seed, "code": code(), "failed": exc.problems[0]}
    found = list(judged(case, made, t))
    ratios = [v / generator.PLAIN[n] for n, (v, *_) in t.parameters.items()] or [1.0]
    return {
        "case": case.name,
        "seed": seed,
        "code": code(),
        "seconds": t.seconds,
        "loop": 0.5 * (loop + clock.loop()),
        "forces": {n: e for n, e, _ in found},
        "covered": [c for *_, c in found if np.isfinite(c)],
        "ratios": 100.0 * (max(ratios) / min(ratios) - 1.0),
        "absolute": 100.0 * max(abs(r - 1.0) for r in ratios),
        "holdout": 100.0 * (max(e.inside / e.noise for e in t.holdout) - 1.0),
        "masked": 100.0 * t.masked,
        "outside": 100.0 * t.outside,
        "converged": bool(t.converged),
        "scale": any(u.kind == "scale" for u in t.unknown),
        "turns": any("bends sharply" in n for n in t.notes),
        "chi2": t.chi2,
    }


def line(rows: list[dict[str, object]]) -> str:
    """A row of the page."""
    good = [r for r in rows if "failed" not in r]

    def span(values: list[float], form: str = ".2f") -> str:
        return f"{min(values):{form}} .. {max(values):{form}}" if values else ""

    forces = "; ".join(f"{n} {span([r['forces'][n] for r in good])}" for n in (good[0]["forces"] if good else ()))
    cover = [c for r in good for c in r["covered"]]
    cells = [
        str(rows[0]["case"]),
        f"{sum(bool(r['converged']) for r in good)} of {len(rows)}",
        span([r["seconds"] for r in good], ".1f"),
        span([r["seconds"] / r["loop"] for r in good], ".0f"),
        forces,
        span([r["ratios"] for r in good]),
        span([r["absolute"] for r in good]),
        span([r["holdout"] for r in good]),
        span([r["masked"] for r in good], ".1f"),
        f"{np.mean(cover):.0f}" if cover else "",
        f"{sum(bool(r['scale']) for r in good)} of {len(good)}",
    ]
    return "| " + " | ".join(cells) + " |"


HEAD = (
    "| case | converged | processor s | over the fixed loop | force error, % of span | ratios off, % | parameters off, % "
    "| hold-out over noise, % | masked, % | covered by 2 sigma, % | scale reported |\n"
    "|---|---|---|---|---|---|---|---|---|---|---|"
)


def code() -> str:
    """Which trainer it is: a digest of its sources, for a page whose rows are of several days."""
    sources = sorted(Path(penode_sil.training.__file__).parent.rglob("*.[pch]*"))
    return hashlib.sha256(b"".join(p.read_bytes() for p in sources if p.suffix in (".py", ".c", ".h"))).hexdigest()[:8]


def read(path: Path) -> list[dict[str, object]]:
    """Trainings of a campaign so far; none where there is no such file."""
    return [json.loads(text) for text in path.read_text(encoding="utf-8").splitlines()] if path.exists() else []


def main() -> None:
    """All cases, or those whose names hold a word; a training that is among the rows already is not run again."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--rows", type=Path, default=Path("build/campaign-train/rows.jsonl"), help="what was found, a training a line")
    given = parser.parse_args()
    given.rows.parent.mkdir(parents=True, exist_ok=True)
    print(HEAD, flush=True)
    with tempfile.TemporaryDirectory() as folder:
        for case in (c for c in CASES if given.only in c.name):
            rows = [r for r in read(given.rows) if r["case"] == case.name]
            for seed in (k for k in range(1, given.seeds + 1) if k not in {r["seed"] for r in rows}):
                rows.append(run(case, seed, Path(folder)))
                with given.rows.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(rows[-1]) + "\n")
            print(line(rows), flush=True)
            for r in (r for r in rows if "failed" in r):
                print(f"  seed {r['seed']}: {r['failed']}", flush=True)


if __name__ == "__main__":
    main()
