"""Where each array of a parameter set lies: the one table that headers, exports and tools go by."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import units
from ..model import Model
from ..networks import Dense, Network
from . import packing


@dataclass(frozen=True)
class Block:
    """Rows [first_row, first_row + rows) of an array: values from `at` on; of weights, column by column."""

    first_row: int
    rows: int
    at: int


@dataclass(frozen=True)
class Array:
    """A tunable array: `shape` as its maker knows it, () for a number; unit "" where it has none of its own."""

    name: str
    shape: tuple[int, ...]
    unit: str
    blocks: tuple[Block, ...]

    def indices(self) -> NDArray[Any]:
        """Where each element lies in a set, in the shape of the array."""
        columns = self.shape[1] if len(self.shape) > 1 else 1
        found = np.empty((sum(b.rows for b in self.blocks), columns), dtype=int)
        for b in self.blocks:
            found[b.first_row : b.first_row + b.rows] = b.at + np.arange(columns)[None, :] * b.rows + np.arange(b.rows)[:, None]
        return found.reshape(self.shape)

    @property
    def text(self) -> str:
        """Name and shape: damper_net.weights_1[16][1]."""
        return self.name + "".join(f"[{n}]" for n in self.shape)


def arrays(model: Model) -> tuple[Array, ...]:
    """All arrays of a model's sets, in the order of the values."""
    at = packing.offsets(model)
    found = [Array(p.name, (), units.si(p.unit), (Block(0, 1, at[p.name]),)) for p in model.tunable]
    for name, network in (model.sets["default"].networks if model.sets else {}).items():
        found += _of_network(model, name, network, at[name])
    return tuple(found)


def _of_network(model: Model, name: str, network: Network, at: int) -> list[Array]:
    n, pieces = network.n_inputs, packing.network_pieces(network)
    alike = set(model.networks[name].input_units)
    unit = alike.pop() if len(alike) == 1 else ""
    found = [Array(f"{name}.{edge}", (n,), unit, (Block(0, n, at + i * n),)) for i, edge in enumerate(("input_min", "input_max"))]
    dense = affine = 0
    for layer, piece in zip(network.layers, pieces[1:], strict=True):
        start = at + piece.offset
        if isinstance(layer, Dense):
            dense += 1
            n_out, n_in = layer.weights.shape
            biases, weights = [], []
            for row, rows in packing.dense_rows(n_out):
                biases.append(Block(row, rows, start))
                weights.append(Block(row, rows, start + rows))
                start += rows * (1 + n_in)
            found.append(Array(f"{name}.bias_{dense}", (n_out,), "", tuple(biases)))
            found.append(Array(f"{name}.weights_{dense}", (n_out, n_in), "", tuple(weights)))
        else:
            affine += 1
            parts = ("shift", "factor") if layer.form == "centre" else ("factor", "shift")
            found += [
                Array(f"{name}.{part}_{affine}", (layer.n_out,), "", (Block(0, layer.n_out, start + i * layer.n_out),))
                for i, part in enumerate(parts)
            ]
    return found


def length(model: Model) -> int:
    """Number of values of a set, at least 1."""
    return len(packing.set_values(model, "default"))


def map_lines(model: Model) -> list[str]:
    """The table for people: from, to, what, unit; a line for each block."""
    found = []
    for array in arrays(model):
        for b in array.blocks:
            columns = array.shape[1] if len(array.shape) > 1 else 1
            rows = f", rows {b.first_row} .. {b.first_row + b.rows - 1}" if len(array.blocks) > 1 else ""
            unit = f" [{units.si(array.unit)}]" if array.unit else ""
            found.append(f"{b.at:6d} .. {b.at + b.rows * columns - 1:<6d} {array.text}{rows}{unit}")
    return found


def to_json(model: Model) -> str:
    """The table for programs."""
    table = {
        "model": model.owner,
        "layout": {"float": packing.layout(model), "double": packing.layout(model, np.float64)},
        "length": length(model),
        "sets": {name: s.id for name, s in model.sets.items()},
        "arrays": [asdict(a) for a in arrays(model)],
    }
    return json.dumps(table, indent=1) + "\n"


def gather(array: Array, values: NDArray[Any]) -> NDArray[Any]:
    """The array out of the values of a set [length]."""
    elements: NDArray[Any] = values[array.indices()]
    return elements


def scatter(array: Array, elements: NDArray[Any], values: NDArray[Any]) -> None:
    """The array into the values of a set [length]."""
    values[array.indices()] = elements
