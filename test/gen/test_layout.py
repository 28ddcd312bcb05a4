# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The table of where each array lies: against the files of the networks, the header, the committed JSON, and the C."""

from __future__ import annotations

import json
import re
import zlib
from pathlib import Path

import models
import numpy as np
import pytest

import penode_gen
from penode_gen.sets import layout, packing
from penode_sil.targets import Sil

ROOT = Path(__file__).resolve().parents[2]

# Sizes of a network, with or without scaling of inputs and output. Layers of 10 and 20 are cut into 4, 4, 1, 1 and 16, 4 rows; one of 256
# into 16 blocks of 16; one of 23 into all three kinds.
NETWORKS = [
    ([2, 10, 20, 1], True),
    ([1, 256, 1], True),
    ([3, 5, 1], True),
    ([3, 5, 1], False),
    ([2, 23, 1], False),
    ([1, 16, 16, 16, 1], True),
]

TUNABLE = """
[model]
name = "tuned"
sample_time = "1 ms"
input = "held"
[parameters]
lift = {{ value = 3, unit = "mm", tunable = true }}
fixed = {{ value = 2000, unit = "1/m" }}
shift = {{ value = 0.25, unit = "N", tunable = true, description = "an offset" }}
[inputs]
{inputs}
[networks]
net = {{ inputs = {units}, output = "N" }}
[variables]
y = {{ unit = "N" }}
[equations]
only = "y = net({names}) + shift + fixed * lift * shift"
[outputs]
y = {{ value = "y", unit = "N" }}
[sets.default]
net = "net.json"
[sets.other]
shift = "0.5 N"
net = "other.json"
"""


def load(folder: Path, sizes: list[int], scaled: bool, unit: str = "m/s") -> tuple[penode_gen.Model, dict[str, dict]]:
    """A model with a network of these sizes, two tunable parameters, and two sets; and what the network files hold, by set."""
    activations = ["relu"] * (len(sizes) - 2) + ["identity"]
    data = {
        "default": models.network_file(folder / "net.json", sizes, activations, 3, -1.0, 2.0),
        "other": models.network_file(folder / "other.json", sizes, activations, 4, -0.5, 1.0),
    }
    if not scaled:
        for name, of_set in (("net.json", "default"), ("other.json", "other")):
            data[of_set] = {k: v for k, v in data[of_set].items() if "normalise" not in k}
            (folder / name).write_text(json.dumps(data[of_set]))
    names = [f"u{i}" for i in range(sizes[0])]
    inputs = "\n".join(f'{n} = {{ unit = "{unit}" }}' for n in names)
    path = folder / "tuned.toml"
    path.write_text(TUNABLE.format(inputs=inputs, units=json.dumps([unit] * sizes[0]), names=", ".join(names)))
    return penode_gen.load(path), data


def expected(data: dict, shift: float) -> dict[str, np.ndarray]:
    """All arrays of a set, from the network file alone."""
    found = {"lift": np.array(0.003), "shift": np.array(shift)}
    found |= {f"net.input_{edge}": np.array(data["trained_range"][edge]) for edge in ("min", "max")}
    for i, layer in enumerate(data["layers"], 1):
        found |= {f"net.bias_{i}": np.array(layer["bias"]), f"net.weights_{i}": np.array(layer["weights"])}
    if "normalise" in data:
        low, high = (np.array(data["normalise"][k]) for k in ("min", "max"))
        found |= {"net.shift_1": low, "net.factor_1": 1.0 / (high - low)}
        low, high = (np.array(data["denormalise"][k]) for k in ("min", "max"))
        found |= {"net.factor_2": high - low, "net.shift_2": low}
    return found


@pytest.fixture(params=NETWORKS, ids=lambda p: "-".join(map(str, p[0])) + ("" if p[1] else " unscaled"))
def case(request, tmp_path):
    sizes, scaled = request.param
    return sizes, *load(tmp_path, sizes, scaled)


def test_gather_gives_back_what_the_files_hold(case):
    """The arrays come from the network's own file: nothing here knows how sets are streamed."""
    _sizes, model, data = case
    for name, shift in (("default", 0.25), ("other", 0.5)):
        values = penode_gen.set_values(model, name, np.float64)
        want = expected(data[name], shift)
        found = {a.name: layout.gather(a, values) for a in layout.arrays(model)}
        assert found.keys() == want.keys()
        for key, array in found.items():
            assert array.shape == want[key].shape
            assert np.array_equal(array, want[key]), key


def test_scatter_is_the_inverse(case):
    """The arrays of one set put into the values of another, in any order, make that set."""
    _, model, _ = case
    values, wanted = (penode_gen.set_values(model, name, np.float64) for name in ("default", "other"))
    for array in reversed(layout.arrays(model)):
        layout.scatter(array, layout.gather(array, wanted), values)
    assert np.array_equal(values, wanted)


def test_each_value_belongs_to_one_array(case):
    _, model, _ = case
    found = np.concatenate([a.indices().reshape(-1) for a in layout.arrays(model)])
    assert np.array_equal(np.sort(found), np.arange(layout.length(model))) and layout.length(model) == len(
        penode_gen.set_values(model, "default")
    )
    blocks = sorted((b.at, b.rows * (a.shape[1] if len(a.shape) > 1 else 1)) for a in layout.arrays(model) for b in a.blocks)
    assert [at for at, _ in blocks] == [0, *np.cumsum([n for _, n in blocks])[:-1]]


def test_blocks_by_hand():
    """Of a layer of n rows, as penode/pen_net.h states them."""
    assert [packing.dense_rows(n) for n in (1, 5, 10, 20, 23)] == [
        [(0, 1)],
        [(0, 4), (4, 1)],
        [(0, 4), (4, 4), (8, 1), (9, 1)],
        [(0, 16), (16, 4)],
        [(0, 16), (16, 4), (20, 1), (21, 1), (22, 1)],
    ]
    assert packing.dense_rows(256) == [(16 * i, 16) for i in range(16)]


def test_units_and_places_of_a_small_one(tmp_path):
    """3-5-1 counted by hand: two parameters, envelope 3 + 3, shift and factor of 3, blocks of 4 and 1 rows, one row, factor and shift."""
    model, _ = load(tmp_path, [3, 5, 1], True)
    table = json.loads(layout.to_json(model))
    assert (table["model"], table["length"], table["sets"]) == ("tuned", 42, {n: s.id for n, s in model.sets.items()})
    assert table["layout"] == {"float": packing.layout(model), "double": packing.layout(model, float)}
    rows = {a["name"]: (a["shape"], a["unit"], [(b["first_row"], b["rows"], b["at"]) for b in a["blocks"]]) for a in table["arrays"]}
    assert rows == {
        "lift": ([], "m", [(0, 1, 0)]),
        "shift": ([], "N", [(0, 1, 1)]),
        "net.input_min": ([3], "m/s", [(0, 3, 2)]),
        "net.input_max": ([3], "m/s", [(0, 3, 5)]),
        "net.shift_1": ([3], "", [(0, 3, 8)]),
        "net.factor_1": ([3], "", [(0, 3, 11)]),
        "net.bias_1": ([5], "", [(0, 4, 14), (4, 1, 30)]),
        "net.weights_1": ([5, 3], "", [(0, 4, 18), (4, 1, 31)]),
        "net.bias_2": ([1], "", [(0, 1, 34)]),
        "net.weights_2": ([1, 5], "", [(0, 1, 35)]),
        "net.factor_2": ([1], "", [(0, 1, 40)]),
        "net.shift_2": ([1], "", [(0, 1, 41)]),
    }


def test_map_in_the_header_names_each_block(case):
    _, model, _ = case
    header = penode_gen.render(model, self_test=False)["tuned_sets.h"]
    lines = re.findall(r"^ \* +(\d+) \.\. (\d+) +(\S+?)((?:\[\d+\])*)(?:, rows (\d+) \.\. (\d+))?(?: \[([^\]]+)\])?$", header, re.MULTILINE)
    told = [(int(first), int(last), name + shape, rows, to) for first, last, name, shape, rows, to, _ in lines]
    want = []
    for a in layout.arrays(model):
        columns = a.shape[1] if len(a.shape) > 1 else 1
        for b in a.blocks:
            rows = (str(b.first_row), str(b.first_row + b.rows - 1)) if len(a.blocks) > 1 else ("", "")
            want.append((b.at, b.at + b.rows * columns - 1, a.name + "".join(f"[{n}]" for n in a.shape), *rows))
    assert told == want
    assert {unit for *_, unit in lines} == {"", "m", "N", "m/s"}


def test_committed_table_is_the_generated_one():
    model = penode_gen.load(ROOT / "gen" / "nqvm" / "nqvm.toml")
    assert (ROOT / "gen" / "nqvm" / "c" / "nqvm_layout.json").read_text() == layout.to_json(model)


@pytest.mark.parametrize(
    "sizes, scaled, dtype",
    [
        ([2, 10, 20, 1], True, np.float32),
        ([2, 10, 20, 1], True, np.float64),
        ([1, 256, 1], True, np.float32),
        ([2, 23, 1], False, np.float32),
    ],
)
def test_the_c_goes_by_this_table(tmp_path, sizes, scaled, dtype):
    """A set made anew by scattering random arrays by the table of the JSON, staged into the C: its outputs are those of these matrices."""
    model, _ = load(tmp_path, sizes, scaled)
    draw, table = np.random.default_rng(9), json.loads(layout.to_json(model))
    values, arrays = np.full(table["length"], np.nan), {}
    for a in table["arrays"]:
        shape = tuple(a["shape"])
        fan_in = shape[1] if len(shape) > 1 else 1
        arrays[a["name"]] = draw.uniform(-1, 1, shape).astype(dtype).astype(float) / 2 ** np.ceil(np.log2(fan_in) / 2)
        for b in a["blocks"]:
            part = arrays[a["name"]].reshape(-1, fan_in)[b["first_row"] : b["first_row"] + b["rows"]]
            values[b["at"] : b["at"] + part.size] = part.T.reshape(-1)  # column by column
    values = values.astype(dtype)
    assert np.isfinite(values).all()
    instance = Sil(model, dtype).instance()
    real = "float" if dtype == np.float32 else "double"
    assert instance.begin((table["layout"][real], table["length"], 9, zlib.crc32(values.tobytes()))) == 0
    assert instance.write(0, values) == 0 and instance.commit() == 0
    dense = len(sizes) - 1
    for _ in range(20):
        u = draw.uniform(-1, 1, sizes[0]).astype(dtype)
        h = u.astype(float)
        h = (h - arrays["net.shift_1"]) * arrays["net.factor_1"] if scaled else h
        for i in range(1, dense + 1):
            h = arrays[f"net.weights_{i}"] @ h + arrays[f"net.bias_{i}"]
            h = np.maximum(h, 0.0) if i < dense else h
        h = h * arrays["net.factor_2"] + arrays["net.shift_2"] if scaled else h
        shift = arrays["shift"]
        y = float(h[0] + shift + 2000.0 * arrays["lift"] * shift)
        found = instance.step(u)[1][0]
        # every value is of size 1 and sums have up to 256 terms, three deep: 1000 roundings of 2^-24 or 2^-53, of partial sums up to 16,
        # beside one product of up to 2000
        assert found == pytest.approx(y, abs=(1000 * 16 + 2000 * 4) * float(np.finfo(dtype).eps) / 2)
