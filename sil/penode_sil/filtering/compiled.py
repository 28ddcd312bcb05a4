# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A generated filter, NAME_ekf.h, in the shared library of its model."""

from __future__ import annotations

import ctypes
import itertools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from penode_gen.algebra import placeholder
from penode_gen.model import Model

from ..building import build_library
from ..instance import Set
from .estimates import VERDICTS, Estimates, joined, of, signals

Array = NDArray[Any]


class Compiled:
    """The library; filter() gives as many independent filters as wanted."""

    def __init__(self, model: Model, dtype: type = np.float32, compiler: Sequence[str] = ("gcc", "-O2"), source: Path | None = None):
        self.model, self.given, self.dtype = model, of(model), dtype
        self.library = ctypes.CDLL(str(build_library(model, dtype, compiler, source)))
        size, real, states, measured, estimate = list((ctypes.c_uint32 * 5).in_dll(self.library, "sil_ekf_sizes"))
        self.size, self.n, self.n_z, self.n_estimate = size, states // real, measured // real, estimate // real
        self.test = np.dtype([(name, dtype) for name in ("innovation", "variance", "ratio")] + [("verdict", np.uint32)], align=True)

    def filter(self, set_name: str = "default") -> CompiledFilter:
        """A filter at its start."""
        return CompiledFilter(self, set_name)


class CompiledFilter:
    """One filter in memory of its own."""

    def __init__(self, owner: Compiled, set_name: str):
        self.owner = owner
        self._memory = np.zeros(owner.size // 8 + 1)
        self._kept: list[Set] = []
        status = self._function(f"{owner.model.name}_ekf_init")(self.address, ctypes.byref(self._set(set_name)), None)
        if status:
            raise AssertionError(f"init refused its own set: {status:#x}")

    @property
    def address(self) -> ctypes.c_void_p:
        """Address of the NAME_ekf_t."""
        return ctypes.c_void_p(self._memory.ctypes.data)

    def _function(self, name: str) -> Callable[..., int]:
        found = getattr(self.owner.library, name)
        found.restype = ctypes.c_uint32
        function: Callable[..., int] = found
        return function

    def _set(self, name: str) -> Set:
        self._kept.append(Set.in_dll(self.owner.library, f"{self.owner.model.owner}_set_{name}"))
        return self._kept[-1]

    def select(self, name: str) -> int:
        """Let the next step adopt a set of the model file; a status."""
        select = self._function(f"{self.owner.model.stepped}_tune_select")
        return select(self.address, ctypes.byref(self._set(name)))  # `model` is the first member

    def run(
        self,
        u: ArrayLike,
        z: ArrayLike,
        mask: ArrayLike | None = None,
        *,
        estimates: bool = True,
        covariance: bool = False,
        progress: Callable[[int], None] = lambda n: None,
        stretch: int = 10_000,
    ) -> tuple[Estimates, Array, Array]:
        """
        Step through inputs u [n, n_u] and measurements z [n, n_z], NaN where missing; mask [n]: bit k: measurement k is offered.

        Estimates (without values and deviations unless `estimates`), states of the filter [n, N] and, if `covariance`, the factors of
        their covariance [n, N, N] (else of no rows). `progress` is called every `stretch` samples.
        """
        owner, dtype = self.owner, self.owner.dtype
        z = np.ascontiguousarray(z, dtype).reshape(-1, owner.n_z)
        n = len(z)
        u = np.ascontiguousarray(placeholder.columns(owner.model, np.asarray(u, float).reshape(n, -1)), dtype)
        offered = np.full(n, 2**owner.n_z - 1, np.uint32) if mask is None else np.ascontiguousarray(mask, np.uint32)
        x, f = np.zeros((n, owner.n), dtype), np.zeros((n if covariance else 0, owner.n, owner.n), dtype)
        found = np.zeros((n if estimates else 0, owner.n_estimate), dtype)
        test, status = np.zeros((n, owner.n_z), owner.test), np.zeros(n, np.uint32)
        for begin in range(0, n, stretch):
            some = slice(begin, begin + stretch)
            at = [part[some].ctypes.data if part.size else None for part in (u, z, offered, x, f, found, test, status)]
            self._steps(begin, len(z[some]), at)
            progress(min(begin + stretch, n))
        counts = np.zeros((owner.n_z, len(VERDICTS)), np.uint32)
        owner.library.sil_ekf_counts(self.address, ctypes.c_void_p(counts.ctypes.data))
        values, deviations = self._columns(found)
        tests = (test["innovation"], test["variance"], test["ratio"], test["verdict"])
        return Estimates(values, deviations, *tests, status, counts), x, f

    def _steps(self, begin: int, n: int, at: list[int | None]) -> None:
        """n samples from `begin` on; `at`: where they are, and where what they give goes."""
        self.owner.library.sil_ekf_run(self.address, ctypes.c_uint32(n), *map(ctypes.c_void_p, at))

    def _columns(self, found: Array) -> tuple[Array, Array]:
        """Values and deviations, without the input that a model without inputs has in its C."""
        model = self.owner.model
        sizes = [len(model.states), max(len(model.inputs), 1), len(model.outputs), len(model.sensors), len(self.owner.given.parameters)]
        edges = np.cumsum([0, *(s for size in sizes for s in (size, size))])
        parts = [found[:, a:b] for a, b in itertools.pairwise(edges)]
        if not model.inputs:
            parts[2] = parts[3] = found[:, :0]
        values, deviations = np.concatenate(parts[::2], axis=1), np.concatenate(parts[1::2], axis=1)
        assert values.shape[1] == len(list(signals(model)))
        return values, deviations


def run(model: Model, set_name: str, u: Any, z: Any, mask: Any, exchanges: dict[int, str], progress: Callable[[int], None]) -> Estimates:
    """A whole run; `exchanges`: the sample from which on another set is in force."""
    found, own, edges = [], Compiled(model).filter(set_name), [0, *sorted(exchanges), len(z)]
    for begin, end in itertools.pairwise(edges):
        if begin in exchanges:
            own.select(exchanges[begin])
        part = slice(begin, end)
        found.append(own.run(u[part], z[part], None if mask is None else mask[part])[0])
        progress(end)
    return joined(found)
