# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a model file promises of a network: read with its units, shown for the sets of the file, and written as C."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from .. import units
from ..algebra import expressions as ex
from ..emission.c_text import literal
from ..model import NetworkPort, ParameterSet, Promises
from ..networks import Affine, Network
from .exact import Piece, pieces
from .fold import foldable

# keys of an entry of [networks], and what they may be
KEYS: dict[str, type | tuple[type, ...]] = {
    "monotone": (bool, str),
    "dissipative": (bool, str),
    "max_slope": str,
    "max_force": str,
    "zero_at_zero": bool,
}
LOOKS = (64, 16)  # evaluations that a check on the target may take: some, and some for each neuron
FORCE = 16  # margins of a force that the target asks for
Problem = Callable[[Sequence[str], str, str], None]


def read(where: tuple[str, ...], entry: dict[str, Any], inputs: list[str], output: str, problem: Problem) -> Promises:
    """The promises in an entry of [networks]."""
    rising = entry.get("monotone", False)
    if rising not in (True, False, "increasing", "decreasing"):
        problem((*where, "monotone"), f"'{rising}' is not a direction", 'write true, "increasing" or "decreasing"')
    band = entry.get("dissipative", False)
    slope, force, small = (
        _quantity((*where, key), entry.get(key), of, problem)
        for key, of in (("max_slope", [output, *inputs[:1]]), ("max_force", [output]), ("dissipative", [output]))
    )
    return Promises(
        increasing=rising in (True, "increasing"),
        decreasing=rising == "decreasing",
        dissipative=small if isinstance(band, str) else 0.0 if band else None,
        max_slope=slope,
        max_force=force,
        zero_at_zero=entry.get("zero_at_zero", False),
    )


def _quantity(where: tuple[str, ...], text: Any, of: list[str], problem: Problem) -> float | None:
    """A quantity in the unit of a force, or of a force by an input; None if there is none, or after reporting a problem."""
    if not isinstance(text, str):
        return None
    try:
        value, unit = units.quantity(text)
        needed = units.dimension(of[0]) / units.dimension(of[1]) if len(of) > 1 else units.dimension(of[0])
    except (units.UnitError, IndexError) as error:
        problem(where, str(error), getattr(error, "instead", "") or "give a number with a unit")
        return None
    if units.dimension(unit) != needed:
        problem(where, f"'{text}' is not measured in {units.describe(needed)}", f"give a quantity in {' / '.join(of)}")
        return None
    if not value >= 0.0 or not ex.in_range(value):
        problem(where, f"'{text}' is not a limit", "give 0, or a number from 1.2e-38 to 3.4e38 in SI units")
        return None
    return value


def check(networks: dict[str, NetworkPort], sets: dict[str, ParameterSet], outside: str, problem: Problem) -> None:
    """Report promises that cannot be proven, and sets that break one."""
    for name, port in networks.items():
        if not port.promises:
            continue
        shapes = [chosen.networks[name] for chosen in sets.values() if name in chosen.networks]
        if not all(foldable(net) for net in shapes):
            problem(
                ("networks", name),
                "promises are proven for networks of one input with ReLU activations only",
                "remove them, or train such a network",
            )
        elif outside == "fade":
            problem(
                ("networks", name),
                "a network that fades is not piecewise linear: its promises cannot be proven",
                "choose outside = 'extrapolate' or 'clamp', or remove them",
            )
        else:
            done: set[int] = set()  # sets that leave a network out share that of the set 'default'
            for chosen in (c for c in sets.values() if name in c.networks and id(c.networks[name]) not in done):
                done.add(id(chosen.networks[name]))
                for what in broken(port.promises, chosen.networks[name], outside == "clamp"):
                    problem(("sets", chosen.name, name), what, "train the network to keep its promises, or relax them in [networks]")


def broken(promises: Promises, network: Network, clamp: bool) -> list[str]:
    """What a network does not keep, in words, with the place; what it keeps by less than the margin on the target, too."""
    found = []
    if promises.zero_at_zero and _at_zero(network, clamp) != 0.0:
        found.append(f"breaks its promise zero_at_zero: {_at_zero(network, clamp):.3g} is computed at 0")
    line = _seen(network, clamp)
    for key, test in (("monotone", _slopes), ("max_slope", _steep), ("max_force", _forces), ("dissipative", _driving)):
        hard, close = next(test(promises, line, 0), None), next(test(promises, line, 1), None)
        if hard is not None:
            found.append(f"breaks its promise {key} at {float(hard):.6g}")
        elif close is not None:
            found.append(f"keeps its promise {key} at {float(close):.6g} by less than the margin of pen_promise.h")
    return found


def _seen(network: Network, clamp: bool) -> list[Piece]:
    """The pieces; with `clamp` those inside of the trust envelope, cut at its edges."""
    line = list(pieces(network))
    if not clamp or network.input_min is None or network.input_max is None:
        return line
    low, high = (Fraction(float(np.float32(v[0]))) for v in (network.input_min, network.input_max))
    found = []
    for p in line:
        if (p.end is None or p.end > low) and (p.start is None or p.start < high):
            start, end = low if p.start is None else max(low, p.start), high if p.end is None else min(high, p.end)
            most = max(p.start_margin, p.end_margin)
            found.append(Piece(start, end, p.slope, p.offset, p.slope_margin, most, most))
    return found


def _place(p: Piece) -> Fraction:
    """Where a piece is: its middle, or one end."""
    if p.start is not None and p.end is not None:
        return (p.start + p.end) / 2
    return p.end if p.start is None and p.end is not None else p.start or Fraction(0)


def _slopes(promises: Promises, line: list[Piece], margin: int) -> Iterator[Fraction]:
    for p in line:
        by = margin * Fraction(p.slope_margin)
        if (promises.increasing and p.slope < by) or (promises.decreasing and -p.slope < by):
            yield _place(p)


def _steep(promises: Promises, line: list[Piece], margin: int) -> Iterator[Fraction]:
    for p in line:
        if promises.max_slope is not None and abs(p.slope) + margin * Fraction(p.slope_margin) > _stored(promises.max_slope):
            yield _place(p)


def _ends(line: list[Piece], margin: int) -> Iterator[tuple[Fraction, Fraction, Fraction, Piece]]:
    """Place, value and margin at both ends of each piece, and at 0."""
    for p in line:
        inside = (p.start is None or p.start < 0) and (p.end is None or p.end > 0)
        for x, by in (
            (p.start, p.start_margin),
            (p.end, p.end_margin),
            (Fraction(0) if inside else None, min(p.start_margin, p.end_margin)),
        ):
            if x is not None:
                yield x, p.at(x), margin * FORCE * Fraction(by), p


def _forces(promises: Promises, line: list[Piece], margin: int) -> Iterator[Fraction]:
    if promises.max_force is None:
        return
    limit = _stored(promises.max_force)
    yield from (_place(p) for p in line if (p.start is None or p.end is None) and p.slope != 0)
    yield from (x for x, value, by, _ in _ends(line, margin) if abs(value) + by > limit)


def _driving(promises: Promises, line: list[Piece], margin: int) -> Iterator[Fraction]:
    if promises.dissipative is None:
        return
    limit, ends = _stored(promises.dissipative), list(_ends(line, margin))
    near = min((x for x, *_ in ends), key=abs, default=Fraction(0))  # where the network is at 0
    yield from (_place(p) for p in line if (p.start is None or p.end is None) and p.slope < margin * Fraction(p.slope_margin))
    for x, value, by, p in ends:
        away = min(by, abs(x) * margin * Fraction(p.slope_margin)) if limit == 0 else by
        if (
            (x == near and abs(value) + (by if limit else 0) > limit)
            or (x > near and value - away < -limit)
            or (x < near and value + away > limit)
        ):
            yield x


def _stored(limit: float) -> Fraction:
    """A limit as float, not above what was promised."""
    stored = np.float32(limit)
    return Fraction(float(stored if float(stored) <= limit else np.nextafter(stored, np.float32(0))))


def _at_zero(network: Network, clamp: bool) -> float:
    """What the layers give at 0 in float, in the order of the C."""
    h = np.zeros(1, np.float32)
    if clamp and network.input_min is not None and network.input_max is not None:
        h = np.clip(h, network.input_min.astype(np.float32), network.input_max.astype(np.float32))
    for layer in network.layers:
        if isinstance(layer, Affine):
            shift, factor = layer.shift.astype(np.float32), layer.factor.astype(np.float32)
            h = (h - shift) * factor if layer.form == "centre" else h * factor + shift
            continue
        y = layer.bias.astype(np.float32)
        for column, value in zip(layer.weights.astype(np.float32).T, h, strict=True):
            y = y + column * value
        h = np.maximum(y, np.float32(0)) if layer.activation == "relu" else y
    return float(h[0])


def initialiser(port: NetworkPort, neurons: int) -> str:
    """The port's promises as initialiser of a pen_promise_t; `neurons` of all its ReLU layers."""
    given = port.promises
    kinds = {
        "INCREASING": given.increasing,
        "DECREASING": given.decreasing,
        "DISSIPATIVE": given.dissipative is not None,
        "MAX_SLOPE": given.max_slope is not None,
        "MAX_FORCE": given.max_force is not None,
        "ZERO_AT_ZERO": given.zero_at_zero,
    }
    named = " | ".join(f"PEN_PROMISE_{kind}" for kind, made in kinds.items() if made) or "0U"
    numbers = ", ".join(literal(float(_stored(v or 0.0))) for v in (given.dissipative, given.max_slope, given.max_force))
    return f"{{ {named}, {LOOKS[0] + LOOKS[1] * neurons}U, {numbers} }}"
