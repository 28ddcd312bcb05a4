# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What all measurements share: the inputs that a step must not notice, accuracy, and the blocks of README.md."""

from __future__ import annotations

import dataclasses
import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

import penode_gen
from penode_sil import mil
from penode_sil.scenario import Instance
from penode_sil.schedule import Call
from penode_sil.signals import VelocityChirp
from penode_sil.targets import Sil

ROOT = Path(__file__).resolve().parents[2]
README = ROOT / "README.md"
CORES = {"m3": "Cortex-M3 (no FPU)", "m4f": "Cortex-M4F", "m7": "Cortex-M7", "m33": "Cortex-M33", "m55": "Cortex-M55"}


@dataclasses.dataclass(frozen=True)
class Ours:
    """A row of ours: a model file of gen/nqvm, and what is changed of it for this row."""

    file: str
    changed: dict[str, Any] = dataclasses.field(default_factory=dict)

    @property
    def title(self) -> str:
        """The one model file that a figure is about, as tables show it."""
        return ", ".join([f"`{self.file}`", *(f"{key} = {value}" for key, value in self.changed.items())])

    @property
    def source(self) -> Path | None:
        """The folder of its committed C; None where something is changed: then its C is generated."""
        return None if self.changed else ROOT / "gen" / "nqvm" / "c"

    def model(self) -> penode_gen.Model:
        base = penode_gen.load(ROOT / "gen" / "nqvm" / self.file)
        name = "_".join(["bench", base.name, *map(str, self.changed.values())])
        return dataclasses.replace(base, name=name, **self.changed) if self.changed else base


# Rows of ours by method and evaluator. Another model file of gen/nqvm or another method is another entry here.
OURS = {
    ("RK4", "layered"): Ours("nqvm.toml"),
    ("Heun", "layered"): Ours("nqvm.toml", {"method": "heun"}),
    ("explicit Euler", "layered"): Ours("nqvm_euler.toml"),
    ("Rosenbrock 1", "layered"): Ours("nqvm.toml", {"method": "ros1"}),
    ("Rosenbrock 2", "layered"): Ours("nqvm.toml", {"method": "ros2"}),
    ("RK4", "folded"): Ours("nqvm_folded.toml"),
    ("Heun", "folded"): Ours("nqvm_folded.toml", {"method": "heun"}),
    ("explicit Euler", "folded"): Ours("nqvm_euler.toml", {"pieces": 96}),
    ("Rosenbrock 1", "folded"): Ours("nqvm_folded.toml", {"method": "ros1"}),
    ("Rosenbrock 2", "folded"): Ours("nqvm_folded.toml", {"method": "ros2"}),
}
# Columns of the price table: each is one model whose C is in the repository, in every row of it.
PRICES = {"RK4": ("RK4", "layered"), "RK4, folded": ("RK4", "folded"), "explicit Euler": ("explicit Euler", "layered")}


def hostile_inputs() -> np.ndarray:
    """Road heights that a constant-time step must not notice: a chirp, noise of all sizes, subnormals, zeros, NaN, Inf."""
    draw = np.random.default_rng(1)
    chirp = 0.02 * np.sin(np.arange(300) ** 2 * 1e-3)
    noise = draw.standard_normal(600) * 10.0 ** draw.uniform(-45, 3, 600)
    special = draw.choice([0.0, -0.0, np.nan, -np.nan, np.inf, -np.inf, 1e-45, -1e-39, 3e38, -3e38], 300)
    mixed = np.concatenate([chirp, noise, special])
    return np.concatenate([chirp, draw.permutation(mixed)]).astype(np.float32)[:, None]


def exchange(model: penode_gen.Model, at: int) -> list[Call]:
    """Select another set for sample `at`, hold a few samples, go on."""
    other = next(name for name in model.sets if name != "default")
    return [Call(at, "select", set=other), Call(at + 20, "hold", on=True), Call(at + 30, "hold", on=False)]


def accuracy() -> list[dict[str, str | int]]:
    """Distance of the float C from the exact solution [nm] over 10 s of the published chirp: largest and RMS of z_b, z_w."""
    chirp, times = VelocityChirp(0.15, 1.0, 0.25, np.pi / 2), np.arange(10_001) * 1e-3
    first = OURS[PRICES["RK4"]].model()
    exact = mil.solve(first, Instance("", "default"), {"z_road": chirp}, times[-1], times, len(penode_gen.set_values(first, "default"))).y
    rows = []
    for title, ours in ((title, OURS[key]) for title, key in PRICES.items()):
        error = Sil(ours.model(), source=ours.source).run(chirp.value(times)[:, None]).y - exact
        largest, rms = np.abs(error).max(), np.sqrt((error**2).mean(axis=0)).max()
        rows.append({"model": title, "file": ours.title, "largest": round(1e9 * float(largest)), "RMS": round(1e9 * float(rms))})
    return rows


def run_text() -> str:
    """What `make run` prints."""
    done = subprocess.run(["make", "run"], cwd=ROOT, check=True, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    return f"```\n{done.stdout.strip()}\n```"


NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[+-]\d+)?")
DIAGNOSIS = re.compile(r"^quarter: .*?^```$", re.S | re.M)


def same(text: str, kept: str) -> bool:
    """Is one README.md the other, but for numbers of the diagnosis within the 2 % of every figure, and for its seconds?

    Last digits of a fit differ from one processor to the next, its words do not.
    """
    if DIAGNOSIS.sub("", text) != DIAGNOSIS.sub("", kept):
        return False
    blocks = [re.sub(r", [\d.]+ s$", "", found[0], flags=re.M) for found in map(DIAGNOSIS.search, (text, kept)) if found]
    if len({" ".join(NUMBER.sub("0", b).split()) for b in blocks}) > 1:
        return False
    numbers = [list(map(float, NUMBER.findall(b))) for b in blocks]
    return all(abs(a - b) <= 0.02 * max(a, b) for a, b in zip(*numbers, strict=True)) if len(blocks) == 2 else True


def with_block(text: str, name: str, content: str) -> str:
    """README with the text between <!-- name --> and <!-- end of name --> replaced."""
    block = re.compile(rf"(<!-- {name} -->\n).*?(<!-- end of {name} -->)", re.S)
    return block.sub(lambda m: f"{m[1]}{content}\n{m[2]}", text)
