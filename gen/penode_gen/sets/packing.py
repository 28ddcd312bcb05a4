"""Parameter sets as the C holds them: one row of numbers, in the order in which the kernels stream them."""

from __future__ import annotations

import hashlib
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import units
from ..model import Model, ParameterSet
from ..networks import Dense, Network

RealType = type[np.floating[Any]]  # np.float32 or np.float64

ABI = 2
_FLOAT_MAX = float(np.finfo(np.float32).max)


@dataclass(frozen=True)
class Piece:
    """A stretch of values that belong together, `offset` from the start of its network or of the set."""

    offset: int
    values: NDArray[Any]
    comment: str
    columns: int = 8  # values a line when printed

    @property
    def length(self) -> int:
        return len(self.values)


def dense_rows(n_out: int) -> list[tuple[int, int]]:
    """(first row, number of rows) of the blocks a dense layer is cut into: by 16, then by 4, then by 1."""
    blocks, row = [], 0
    for size in (16, 4, 1):
        while n_out - row >= size:
            blocks.append((row, size))
            row += size
    return blocks


def stream(layer: Dense) -> NDArray[Any]:
    """Biases and weights of a dense layer in the order of penode/pen_net.h."""
    parts = []
    for row, size in dense_rows(len(layer.bias)):
        rows = slice(row, row + size)
        parts += [layer.bias[rows], layer.weights[rows].T.reshape(-1)]
    return np.concatenate(parts)


def network_pieces(network: Network) -> list[Piece]:
    """Trust envelope, then layer by layer."""
    n = network.n_inputs
    low = np.full(n, -_FLOAT_MAX) if network.input_min is None else np.asarray(network.input_min, float)
    high = np.full(n, _FLOAT_MAX) if network.input_max is None else np.asarray(network.input_max, float)
    pieces = [Piece(0, np.concatenate([low, high]), "trust envelope: lowest, highest input")]
    for layer in network.layers:
        at = pieces[-1].offset + pieces[-1].length
        if isinstance(layer, Dense):
            n_out, n_in = layer.weights.shape
            comment = f"{n_in} -> {n_out}, {layer.activation}: biases, then the weights of each input"
            pieces.append(Piece(at, stream(layer), comment, columns=min(n_out, 8)))
        elif layer.form == "centre":
            pieces.append(Piece(at, np.concatenate([layer.shift, layer.factor]), "(x - shift) * factor: shift, factor"))
        else:
            pieces.append(Piece(at, np.concatenate([layer.factor, layer.shift]), "x * factor + shift: factor, shift"))
    return pieces


def network_length(network: Network) -> int:
    """Number of values a network takes in a set."""
    last = network_pieces(network)[-1]
    return last.offset + last.length


def offsets(model: Model) -> dict[str, int]:
    """Where each tunable parameter and each network begins in a set."""
    at, found = 0, {}
    for parameter in model.tunable:
        found[parameter.name] = at
        at += 1
    for name, network in (model.sets["default"].networks if model.sets else {}).items():
        found[name] = at
        at += network_length(network)
    return found


def pieces(model: Model, chosen: ParameterSet) -> list[Piece]:
    """All values of a set with comments, in order."""
    at = offsets(model)
    found = [
        Piece(
            at[p.name],
            np.array([chosen.parameters[p.name]]),
            f"{p.name} [{units.si(p.unit)}]{': ' + p.description if p.description else ''}",
        )
        for p in model.tunable
    ]
    for name, network in chosen.networks.items():
        for piece in network_pieces(network):
            found.append(Piece(at[name] + piece.offset, piece.values, f"{name}: {piece.comment}", piece.columns))
    return found


def set_values(model: Model, set_name: str, dtype: RealType = np.float32) -> NDArray[Any]:
    """All values of a set [NAME_SET_LENGTH] as pen_real_t. Raises KeyError for an unknown set."""
    chosen = model.sets[set_name]
    parts = [p.values for p in pieces(model, chosen)] or [np.zeros(1)]
    return np.concatenate(parts).astype(dtype)


def layout(model: Model, dtype: RealType = np.float32) -> int:
    """Fingerprint of the meaning of the values: model name, tunable parameters, architectures, ABI and real type."""
    nets = model.sets["default"].networks if model.sets else {}
    names = tuple(p.name for p in model.tunable) + tuple((n, net.architecture) for n, net in nets.items())
    text = repr((ABI, model.owner, names, np.dtype(dtype).name))
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:4], "big")


def digest(model: Model) -> str:
    """Identifies the sets of a model: what they mean and all that they hold."""
    sha = hashlib.sha256(repr((layout(model), layout(model, np.float64), {n: s.id for n, s in model.sets.items()})).encode())
    for name in model.sets or ("default",):
        sha.update(set_values(model, name, np.float64).tobytes() if model.sets else b"")
    return sha.hexdigest()


def set_head(model: Model, set_name: str, dtype: RealType = np.float32) -> tuple[int, int, int, int]:
    """(layout, length, id, checksum) of a set, as pen_set_head_t."""
    values = set_values(model, set_name, dtype)
    checksum = zlib.crc32(values.astype(np.dtype(dtype).newbyteorder("<")).tobytes())
    return layout(model, dtype), len(values), model.sets[set_name].id, checksum
