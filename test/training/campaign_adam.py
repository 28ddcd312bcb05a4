# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Part of `make campaign-train`: plain Adam on whole trajectories (rivals/adam.py) on the recording of seed 1, once to its end, beside
penode's own.

It is called again where it was stopped. Errors are those of campaign.py; both know the physical parameters and learn the start state.
"""

from __future__ import annotations

import argparse
import json
import subprocess
from pathlib import Path

import campaign
import clock
import generator
import numpy as np

from penode_gen.networks import Affine, Dense, Network

CASE = next(c for c in campaign.CASES if c.name == "x1, 1-16-16-16-1")
SCALE = {"spring": 0.03, "damper": 0.5}  # of inputs, and of forces below, as in rivals/adam.py
FORCE = 1000.0


def network(found: dict[str, np.ndarray], name: str) -> Network:
    """A network of the rival, with its scalings; what it gives at 0 is taken away."""
    dense = [
        Dense(found[f"{name}_w{n}"].astype(float), found[f"{name}_b{n}"].astype(float), "relu" if n < 3 else "identity") for n in range(4)
    ]
    layers = (Affine(np.zeros(1), np.array([1.0 / SCALE[name]]), "centre"), *dense, Affine(np.zeros(1), np.array([FORCE]), "centre"))
    return Network(layers, None, None, "adam")


def errors(made: generator.Made, found: dict[str, np.ndarray]) -> dict[str, float]:
    """RMS over 2 sigma of the visited range, in % of the force's span there."""
    off = {}
    for which, (name, x) in enumerate((("spring", made.deflection), ("damper", made.speed))):
        at = np.linspace(-2.0, 2.0, 401) * x.std()
        truth, net = CASE.truth.force(which, at, at), network(found, name)
        own = net.evaluate(at[:, None])[:, 0] - net.evaluate(np.zeros((1, 1)))[0, 0]
        off[name] = 100.0 * float(np.sqrt(np.mean((own - truth) ** 2)) / np.ptp(truth))
    return off


def main() -> None:
    """Rows for the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--python", default="build/rival-training/bin/python", help="one that has what rivals/requirements.txt names")
    parser.add_argument("--work", type=Path, default=Path("build/campaign-train/adam"))
    given = parser.parse_args()
    given.work.mkdir(parents=True, exist_ok=True)
    made, work, out = generator.make(CASE.truth, 1, CASE.noise), given.work / "recording.npz", given.work / "reached.npz"
    y, noise = np.stack([made.a_body, made.a_wheel], axis=1), CASE.noise * np.array(generator.SIGMA)
    np.savez(work, time=made.time, road=made.road, y=y, noise=noise, known=json.dumps(generator.PLAIN))
    loop = clock.loop()
    subprocess.run([given.python, str(Path(__file__).with_name("rivals") / "adam.py"), str(work), str(out)], check=True)
    loop = 0.5 * (loop + clock.loop())
    with np.load(out) as file:
        found = {n: file[n] for n in file.files}
    facts, off = json.loads(str(found["facts"])), errors(made, found)
    own = [r for r in campaign.read(given.work.parent / "rows.jsonl") if r["case"] == CASE.name and r["seed"] == 1]
    ours = f"; penode on the same recording {own[0]['seconds']:.1f} s" if own else ""
    figure = (
        f"{facts['seconds']:.0f} s of processor time ({facts['seconds'] / loop:.0f} fixed loops), chi2/N {min(facts['losses']):.2f}, "
        f"force error {off['spring']:.2f} % (spring), {off['damper']:.2f} % (damper){ours}"
    )
    label = (
        f"JAX, {facts['epoch']} epochs, rate {facts['rate']:g}; an epoch {facts['scan']['epoch']:.2f} s, "
        f"in diffrax {facts['diffrax']['epoch']:.2f} s"
    )
    given.work.with_suffix(".json").write_text(json.dumps([(label, figure, True)]), encoding="utf-8")
    print(label, figure, flush=True)


if __name__ == "__main__":
    main()
