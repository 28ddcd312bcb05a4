# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The exact solution by compiled code: equations that SymPy prints in C, and an integrator of order 8 with error control."""

from __future__ import annotations

import ctypes
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Model
from penode_gen.resources import native
from penode_gen.twins.exact_c import render_exact, weights_of, widest

from ..building import FLAGS, build_directory, build_once, compiler_version, digest_of
from ..output import whole
from ..signals import Signal
from .accuracy import ATOL, RTOL, Unsolved
from .series import TERMS, fitted

Array = NDArray[np.float64]
COMPILER = "gcc"
OPTIONS = (*FLAGS, "-O3", "-fPIC", "-shared")
MANY = (
    TERMS**3
)  # 4096: steps between two calls of `progress`, pieces whose inputs are in memory at a time, time constants a sample of a stiff model
PAUSED, STUCK = 1, 2  # what exact_run returns


class _Job(ctypes.Structure):
    """exact_job_t"""

    _fields_ = [(name, ctypes.c_void_p) for name in ("a", "b", "c", "e3", "e5")]
    _fields_ += [("rtol", ctypes.c_double), ("atol", ctypes.c_double)]
    _fields_ += [(name, ctypes.c_size_t) for name in ("n_x", "n_u", "terms")]
    _fields_ += [(name, ctypes.c_void_p) for name in ("bounds", "value", "slope")]
    _fields_ += [("pieces", ctypes.c_size_t), ("first", ctypes.c_void_p), ("rows", ctypes.c_size_t)]
    _fields_ += [(name, ctypes.c_void_p) for name in ("times", "kept", "work")]


class _Set(ctypes.Structure):
    """exact_set_t"""

    _fields_ = [("parameters", ctypes.c_void_p), ("networks", ctypes.c_void_p)]


class _Place(ctypes.Structure):
    """exact_place_t"""

    _fields_ = [("t", ctypes.c_double), ("h", ctypes.c_double)] + [(name, ctypes.c_size_t) for name in ("piece", "row", "segment")]


def available() -> bool:
    """Is there a compiler?"""
    return shutil.which(COMPILER) is not None


def _pair() -> list[Array]:
    """The coefficients of the pair: a, b, c, e3, e5 of exact_job_t, as SciPy has them."""
    from scipy.integrate import DOP853  # slow to load

    return [np.ascontiguousarray(part) for part in (DOP853.A, DOP853.B, DOP853.C, DOP853.E3, DOP853.E5)]


class Compiled:
    """The equations of a model, with one of its sets at a time."""

    def __init__(self, model: Model):
        self.model = model
        self._code = render_exact(model)
        self._library = ctypes.CDLL(str(_build(model, self._code.text)))
        self._library.exact_run.restype = ctypes.c_int
        self._library.exact_run.argtypes = [ctypes.c_void_p] * 4 + [ctypes.c_size_t]
        self._library.exact_look.restype = None
        self._library.exact_look.argtypes = [ctypes.c_void_p, ctypes.c_size_t, *[ctypes.c_void_p] * 6]
        self._pair = _pair()
        self._kept: dict[str, tuple[_Set, object]] = {}

    def rates(self, set_name: str, x: Array, u: Array, v: Array) -> Array:
        """dx/dt [n_x] at x [n_x], u and v = du/dt [n_u]."""
        found = np.empty_like(x)
        self._library.exact_rates(
            *(ctypes.c_void_p(p) for p in (self._set(set_name), x.ctypes.data, u.ctypes.data, v.ctypes.data, found.ctypes.data))
        )
        return found

    def run(
        self, set_name: str, signals: Sequence[Signal], edges: Array, x: Array, times: Array, progress: Callable[[float], None]
    ) -> tuple[Array, Array]:
        """From x [n_x] at edges[0] to edges[-1], the signals being smooth between `edges` [s]: the states at `times` [n] within, [n, n_x],
        and the last state. Raises Unsolved."""
        kept, x, times = np.empty((times.size, x.size)), np.array(x, dtype=float), np.ascontiguousarray(times, dtype=float)
        work = np.empty(15 * x.size + 2 * len(signals))
        place = _Place(t=edges[0], h=1e-2 * (edges[1] - edges[0]))
        for begin in range(0, edges.size - 1, MANY):
            own = edges[begin : begin + MANY + 1]
            series = fitted(signals, own, self.model.sample_time)
            job = _Job(rtol=RTOL, atol=ATOL, n_x=x.size, n_u=len(signals), terms=series.value.shape[-1])
            job.a, job.b, job.c, job.e3, job.e5 = (part.ctypes.data for part in self._pair)
            job.pieces, job.rows = own.size - 1, times.size
            arrays = (series.bounds, series.value, series.slope, series.first, times, kept, work)
            job.bounds, job.value, job.slope, job.first, job.times, job.kept, job.work = (a.ctypes.data for a in arrays)
            place.piece = place.segment = 0
            arguments = ctypes.byref(job), self._set(set_name), ctypes.byref(place), x.ctypes.data
            while (ended := self._library.exact_run(*arguments, MANY)) == PAUSED:
                progress(place.t)
            if ended == STUCK:
                raise Unsolved(place.t)
            progress(place.t)
        return kept, x

    def look(self, set_name: str, x: Array, u: Array, v: Array) -> tuple[Array, Array]:
        """Outputs [n, n_y] and sensors [n, n_z] at x [n, n_x], u and v = du/dt [n, n_u]."""
        sizes = np.array([x.shape[1], u.shape[1], len(self.model.outputs), len(self.model.sensors)], dtype=np.uintp)
        x, u, v = (np.ascontiguousarray(a, dtype=float) for a in (x, u, v))
        y, z = np.empty((len(x), int(sizes[2]))), np.empty((len(x), int(sizes[3])))
        self._library.exact_look(self._set(set_name), len(x), *(a.ctypes.data for a in (sizes, x, u, v, y, z)))
        return y, z

    def _set(self, name: str) -> int:
        """The address of a set's numbers."""
        if name not in self._kept:
            chosen = self.model.sets.get(name)
            own = {p.name: p.value for p in self.model.parameters.values()} | (chosen.parameters if chosen else {})
            values = np.array([own[p] for p in self._code.parameters], dtype=float)
            weights = [weights_of(chosen.networks[n]) for n in self._code.networks] if chosen else []
            pointers = (ctypes.c_void_p * max(len(weights), 1))(*(w.ctypes.data for w in weights))
            found = _Set(values.ctypes.data, ctypes.addressof(pointers))
            self._kept[name] = found, (values, weights, pointers)  # and what it points to
        return ctypes.addressof(self._kept[name][0])


def _build(model: Model, text: str) -> Path:
    """The shared library of a model's equations, compiled once."""
    solver, header = native("sil", "firmware", "exact.c"), native("sil", "firmware", "exact.h")
    width = widest([n for s in model.sets.values() for n in s.networks.values()])
    source = build_directory() / f"{model.name}-exact-{digest_of([text])}.c"
    if not source.exists():
        source.parent.mkdir(parents=True, exist_ok=True)
        with whole(source) as part:
            part.write_text(text)
    command = [COMPILER, *OPTIONS, f"-DEXACT_WIDTH={width}U", f"-I{header.parent}", str(source), str(solver)]
    return build_once(f"{model.name}-exact", ".so", [*command, "-lm"], [compiler_version(COMPILER), header, solver, text])
