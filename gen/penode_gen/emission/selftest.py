# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Known answers for the self-tests of the C: of a model (NAME_selftest.c) and of the runtime (src/pen_selftest.c)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..sets.packing import RealType
from ..twins.evaluate import Evaluator
from ..twins.kernels import Kernels
from .c_text import literal

# An input stands for HOLD samples on each of LEVELS random levels. With every other level the state begins anew: where it is
# small, the last bits of its rates are not lost in it.
LEVELS, HOLD = 25, 8
_LEVEL_BITS = 8  # of a level
_UNBOUNDED = 64.0  # half the range of an input that declares none, in SI units, before it is narrowed
_QUARTERINGS = 7
_OUTSIDE = 0.25  # share of network evaluations that may lie outside of the trust envelope
_SEED = 0x811C9DC5


def hash_bits(state: int, values: NDArray[Any]) -> int:
    """pen_selftest_hash()"""
    for byte in values.astype(values.dtype.newbyteorder("<")).tobytes():
        state = ((state ^ byte) * 0x01000193) & 0xFFFFFFFF
    return state


def next_number(number: int) -> int:
    """pen_selftest_next()"""
    return (number * 1664525 + 1013904223) & 0xFFFFFFFF


@dataclass(frozen=True)
class Levels:
    """The 256 values that an input takes: low + step * level. Every one is a float, so no compiler has to round."""

    low: float
    step: float

    @staticmethod
    def within(low: float, high: float, share: float) -> Levels:
        """The middle `share` of a range, a little less: a power of two as step, its multiples as levels."""
        middle, span = low / 2.0 + high / 2.0, (high - low) * share
        if not 1e-30 < span < math.inf:  # steps that no float holds
            return Levels(float(np.float32(middle)), 0.0)
        step = 2.0 ** math.floor(math.log2(span / (2**_LEVEL_BITS + 1)))
        first = math.ceil(middle / step - 2 ** (_LEVEL_BITS - 1))
        if abs(first) + 2**_LEVEL_BITS >= 2**24:  # a range too far from zero for its width: floats are coarser
            return Levels(float(np.float32(middle)), 0.0)
        return Levels(first * step, step)


def answered(context: dict[str, Any], wanted: bool) -> dict[str, Any]:
    """The emitter's context with what templates/selftest.c.j2 needs, if that is wanted: it takes some 0.5 s."""
    return context | model_context(context) if wanted else context


def model_context(context: dict[str, Any]) -> dict[str, Any]:
    """What templates/selftest.c.j2 needs besides the emitter's context."""
    ranges = [
        (i.minimum, i.maximum)
        if i.minimum is not None and i.maximum is not None
        else (i.minimum, i.minimum + 2.0 * _UNBOUNDED)
        if i.minimum is not None
        else (i.maximum - 2.0 * _UNBOUNDED, i.maximum)
        if i.maximum is not None
        else (-_UNBOUNDED, _UNBOUNDED)
        for i in context["given"]
    ]
    double, levels = None, []
    for quarterings in range(_QUARTERINGS):
        levels = [Levels.within(low, high, 0.25**quarterings) for low, high in ranges]
        double = _run(context, levels, np.float64, strict=quarterings < _QUARTERINGS - 1)
        if double is not None:
            break
    return {
        "levels": [{"name": i.name, "low": literal(v.low), "step": literal(v.step)} for i, v in zip(context["given"], levels, strict=True)],
        "n_levels": LEVELS,
        "hold": HOLD,
        "level_shift": 32 - _LEVEL_BITS,
        "answer_float": _run(context, levels, np.float32, strict=False),
        "answer_double": double,
    }


def _run(context: dict[str, Any], levels: list[Levels], real: RealType, strict: bool) -> int | None:
    """The hash over state and outputs; None if `strict` and the run leaves the trust envelope too often, or a step does not go well."""
    machine, number, state = Evaluator(context, real), 1, _SEED
    start = machine.x
    for level in range(LEVELS):
        if level % 2 == 0:
            machine.x = start
        u = np.zeros(len(levels), real)
        for i, v in enumerate(levels):
            number = next_number(number)
            u[i] = real(v.low) + real(number >> (32 - _LEVEL_BITS)) * real(v.step)
        for _ in range(HOLD):
            good = machine.step(u)
            state = hash_bits(state, np.concatenate([machine.x, machine.y]))
            if strict and not good:
                return None
        if strict and machine.outside > _OUTSIDE * machine.calls * LEVELS / (level + 1):  # of all that there will be
            return None
    return state


# Of src/pen_selftest.c, in 1/256.
_ARGUMENTS = {
    "pen_exp": (-4865, -2019, 1831, 4169, -4528, -1319, 1377, 4362),
    "pen_tanh": (-141, 126, -300, 700, -132, 115, -180, 1000),
    "pen_sigmoid": (-3264, -1324, 101, 591, -2774, -1359, 252, 4000),
    "pen_softplus": (-2379, -395, 395, 411, -2571, -565, 257, 443),
}


def runtime_answer(real: RealType) -> int:
    """The hash that src/pen_selftest.c compares with."""
    k, number, state = Kernels(real), 1, _SEED

    def fill(n: int) -> NDArray[Any]:
        nonlocal number
        values = np.zeros(n, real)
        for i in range(n):
            number = next_number(number)
            values[i] = (real(number >> 8) * real(2.0**-24)) - real(0.5)
        return values

    with np.errstate(all="ignore"):
        for arguments in zip(*_ARGUMENTS.values(), strict=True):
            found = [getattr(k, name)(real(a) * real(2.0**-8)) for name, a in zip(_ARGUMENTS, arguments, strict=True)]
            state = hash_bits(state, np.array(found, real))
        x, w, y = fill(2), fill(63), np.zeros(21, real)
        k.pen_dense(21, 2, w, x, y)
        state = hash_bits(state, y)
        third = np.zeros(5, real)
        k.pen_dense_relu(2, 21, w, y, third)
        k.pen_dense(3, 20, w, y, third[2:])
        state = hash_bits(state, third)
        good = k.pen_solve(3, fill(9), y)
    return hash_bits(state if good else state ^ 8, y[:3])
