# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Networks from 4 to 256 neurons wide and 1 to 6 layers deep: what the step costs, how long the code is, how long it takes to make."""

from __future__ import annotations

import itertools
import json
import re
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from places import ROOT
from samples import sample

import penode_gen
from penode_sil.targets import Pil, Sil

MODEL = """
[model]
name = "wide"
sample_time = "1 ms"
input = "held"
[inputs]
{inputs}
[networks]
net = {{ inputs = {units}, output = "1" }}
[variables]
y = {{ unit = "1" }}
[equations]
only = "y = net({names})"
[outputs]
y = {{ value = "y", unit = "1" }}
[sets.default]
net = "net.json"
"""


def wide(folder: Path, sizes: list[int], activation: str = "relu", seed: int = 1) -> penode_gen.Model:
    """A model that is one network with random weights."""
    draw = np.random.default_rng(seed)
    layers = [
        {
            "activation": activation if n > 1 else "identity",
            "weights": (draw.standard_normal((n, m)) / m**0.5).tolist(),
            "bias": draw.standard_normal(n).tolist(),
        }
        for m, n in itertools.pairwise(sizes)
    ]
    folder.mkdir(exist_ok=True)
    (folder / "net.json").write_text(json.dumps({"layers": layers}))
    names = [f"u{i}" for i in range(sizes[0])]
    inputs = "\n".join(f'{name} = {{ unit = "1" }}' for name in names)
    (folder / "wide.toml").write_text(MODEL.format(inputs=inputs, units=json.dumps(["1"] * sizes[0]), names=", ".join(names)))
    return penode_gen.load(folder / "wide.toml")


def instructions(model: penode_gen.Model) -> int:
    """Instructions of one step on the Cortex-M4F: the same for every input."""
    cost = Pil(model, "m4f").run(np.random.default_rng(2).standard_normal((5, len(model.inputs)))).cost["normal"]
    assert cost.least == cost.most
    return cost.most


def text(model: penode_gen.Model, folder: Path) -> int:
    """Bytes of the model's own code on the Cortex-M4F."""
    penode_gen.generate(model, folder / "c")
    cc = [
        str(ROOT / "port" / "cortex-m" / "cc"),
        "mps2-an386",
        "-std=c99",
        "-O2",
        f"-I{folder}/c",
        "-c",
        f"{folder}/c/wide.c",
        "-o",
        f"{folder}/wide.o",
    ]
    subprocess.run(cc, check=True)
    found = subprocess.run(["arm-none-eabi-size", "-A", f"{folder}/wide.o"], check=True, capture_output=True, text=True).stdout
    return sum(int(n) for n in re.findall(r"^\.text\S*\s+(\d+)", found, re.M))


def work(sizes: list[int]) -> tuple[int, int]:
    """Multiply-adds and neurons."""
    return sum(m * n for m, n in itertools.pairwise(sizes)), sum(sizes[1:])


SIZES = [
    [1, 16, 16, 16, 1],
    [2, 64, 64, 1],
    [3, 128, 128, 1],
    [4, 256, 256, 1],
    [2, 32, 32, 32, 32, 32, 32, 1],
    [1, 4, 1],
    [6, 256, 1],
    [2, 20, 37, 1],
]


@pytest.mark.parametrize(
    "sizes", sample(SIZES, [1, 16, 16, 16, 1], [4, 256, 256, 1], [1, 4, 1], [2, 20, 37, 1]), ids=lambda sizes: "-".join(map(str, sizes))
)
def test_the_step_costs_its_multiply_adds_and_nothing_else(tmp_path, sizes, show):
    """A multiply-add is a multiplication and an addition, 2 instructions, and a load: an instruction of its own, or 1/8 of
    one in the port's kernel for layers of 16; with 1/16 to 1/4 of a loop's overhead of about 8. A neuron is stored, loaded
    and rectified once. No layer, however wide, costs more than that."""
    model = wide(tmp_path, sizes)
    products, neurons = work(sizes)
    found = instructions(model)
    show(f"{'-'.join(map(str, sizes))}: {products} multiply-adds, {found} instructions, {found / products:.2f} each")
    blocks = sum(-(-n // 16) for n in sizes[1:])
    assert 2 * products <= found <= 3.5 * products + 25 * neurons + 60 * blocks + 400


def test_code_does_not_grow_with_width(tmp_path):
    lengths = {w: text(wide(tmp_path / str(w), [2, w, w, 1]), tmp_path / str(w)) for w in (32, 64, 128, 256)}
    assert max(lengths.values()) - min(lengths.values()) <= 128  # places beyond 4 KB take an instruction more to reach


def test_a_hundred_thousand_parameters(tmp_path, show):
    """The limit that is promised: read, checked, generated and run; 105 217 parameters, 400 KB."""
    begun = time.perf_counter()
    model = wide(tmp_path / "big", [4, 256, 256, 148, 1])
    read = time.perf_counter()
    penode_gen.generate(model, tmp_path / "c")
    made = time.perf_counter()
    n = model.sets["default"].networks["net"].n_parameters
    assert n > 100_000
    u = np.random.default_rng(2).standard_normal((20, 4))
    run = Sil(model, np.float64).run(u)
    expected = model.sets["default"].networks["net"].evaluate(u)[:, 0]
    np.testing.assert_allclose(run.y[:, 0], expected, rtol=1e-11)  # sums of up to 256 terms of size 1, three times
    show(f"{n} parameters: read in {read - begun:.1f} s, C written in {made - read:.1f} s")


@pytest.mark.parametrize("count", [3])
def test_instances_do_not_share_anything(tmp_path, count):
    """Each instance of a model, stepped in turn, gives what it gives alone."""
    model = penode_gen.load(ROOT / "gen" / "nqvm" / "nqvm_folded.toml")
    sil, u = Sil(model), 0.01 * np.random.default_rng(3).standard_normal((200, count, 1))
    together = [sil.instance("default" if i % 2 == 0 else "altered_friction") for i in range(count)]
    found = np.array([[instance.step(u[k, i])[1] for i, instance in enumerate(together)] for k in range(len(u))])
    for i in range(count):
        alone = sil.run(u[:, i], set_name="default" if i % 2 == 0 else "altered_friction")
        assert np.array_equal(found[:, i], alone.y)
