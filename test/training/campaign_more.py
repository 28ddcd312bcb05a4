# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""More of `make campaign-train`: a damping beside a network."""

from __future__ import annotations

import argparse
import json
import tempfile
from dataclasses import replace
from pathlib import Path

import generator
import numpy as np
from kept import kept

import penode_gen
from penode_sil.recordings.measured import load
from penode_sil.training import threads
from penode_sil.training.story import Options, train

HERE = Path(__file__).parent


def damping(made: generator.Made, noise: float, folder: Path) -> tuple[float, float, float]:
    """Value and standard deviation of the damping of damping.toml after training, and the least-squares one of the plant's whole force."""
    model = penode_gen.load(HERE / "damping.toml")
    model = replace(model, sensors=tuple(replace(s, noise=s.noise * noise) for s in model.sensors))
    data = load([made.write(folder / "damping.csv")], model)
    with threads.one():
        _, t = train(model, data, [], Options((("m_b", None),)), lambda share, doing: None)
    v = made.speed
    value, sigma, *_ = t.parameters["d"]
    return value, sigma, generator.PLAIN["d"] + float(generator.Truth().force(1, v, v) @ v / (v @ v))


def main() -> None:
    """Rows for the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--out", type=Path, default=Path("build/campaign-train/damping.json"))
    given = parser.parse_args()
    found: list[tuple[str, str, bool]] = []
    with tempfile.TemporaryDirectory() as folder:
        for noise in (1.0, 5.0):
            rows = [
                kept(
                    given.out.with_suffix(".jsonl"),
                    [noise, seed],
                    lambda n=noise, k=seed: damping(generator.make(generator.Truth(), k, n), n, Path(folder)),
                )
                for seed in range(1, given.seeds + 1)
            ]
            held = sum(abs(v - t) < 2.0 * s for v, s, t in rows)
            text = f"{held} of {len(rows)}, sigma {np.mean([s for _, s, _ in rows]):.2f} of {rows[0][2]:.0f} N s/m"
            found.append((f"x{noise:g}, 2 sigma hold the truth in 9 of 10", text, held >= 0.9 * len(rows)))
            print(*found[-1], flush=True)
    given.out.parent.mkdir(parents=True, exist_ok=True)
    given.out.write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    main()
