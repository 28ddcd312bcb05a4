# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Many runs of a model at once on the host: the generated step in the lanes of vector registers, one run a lane.

Without variations each run has the bits of NAME_step, unless speed is asked for. For identification, sweeps and large SiL campaigns.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import penode_gen
from penode_gen.algebra.causalise import Causal
from penode_gen.algebra.placeholder import columns
from penode_gen.algebra.sampled import beside
from penode_gen.emission.batch_c import BatchCode, render_batch
from penode_gen.resources import native

from .building import FLAGS, build_directory, build_once, compile_program, digest_of, include, missing_tool, sources_in
from .errors import WrongUse
from .output import whole

Array = NDArray[Any]
OPTIMISE = ("-O3", "-march=native")
SIMPLE = ("-Og", "-march=native", "-DLANES_SIMPLE")  # with gcc: 0.1 s to compile instead of 0.3 s, and code that takes up to twice as long
SHORT = 5_000_000  # steps of all runs and calls, up to which code is by SIMPLE: what OPTIMISE gains in them is what it costs to compile
# Not -ffast-math, which takes nothing for NaN. But gcc drops 0*x, by which lanes_max and its like pass NaN on: states, inputs and outputs
# that are not finite are detected by their bits all the same.
QUICK = (
    "-ffp-contract=fast",
    "-fno-trapping-math",
    "-fno-signed-zeros",
    "-fassociative-math",
    "-DLANES_FLUSH",
    # the library refuses these options and prevents contraction; here its bits are not asked for
    "-DPEN_EXACT_H",
    "-U__ASSOCIATIVE_MATH__",
    "-U__NO_SIGNED_ZEROS__",
)


@dataclass(frozen=True, eq=False)
class Observer:
    """A run that follows a measurement: after every `update` of the samples that are kept its states move by gain [n_x, n_z] or
    [runs, n_x, n_z] times the mean of measured [kept, n_z] or [runs, kept, n_z] less simulated since the update before. NaN: nothing was
    measured. What is kept of a sample is as it was before its update."""

    update: int
    measured: Array
    gain: Array


@dataclass(frozen=True, eq=False)
class BatchRun:
    """What all runs did: states x, outputs y, sensors z [runs, n, .], those asked for in the order asked for; and the innovations of
    the observer, nu [runs, updates, n_z], the means of measured less simulated, of all sensors in their units, by which each update moved
    the states: NaN where nothing was measured since the one before, and no updates without an observer.

    The arrays are views: in memory run follows run, so z.transpose(1, 2, 0) costs nothing, and z.reshape a copy.
    `first_bad` [runs] is the first sample that the step held (NaN, Inf, a singular solve: do not use what follows) or
    whose sensors are not finite, `first_outside` the first in which a network left its trust envelope; -1 for none.
    """

    x: Array
    y: Array
    z: Array
    nu: Array
    first_bad: NDArray[np.int64]
    first_outside: NDArray[np.int64]


class _Job(ctypes.Structure):
    """batch_t"""

    _fields_ = [(name, ctypes.c_size_t) for name in ("samples", "every", "runs", "input_runs")]
    _fields_ += [(name, ctypes.c_void_p) for name in ("u", "p", "w")]
    _fields_ += [
        ("set_length", ctypes.c_size_t),
        ("start", ctypes.c_void_p),
        ("update", ctypes.c_size_t),
        ("measured_runs", ctypes.c_size_t),
    ]
    _fields_ += [(name, ctypes.c_void_p) for name in ("measured", "gain", "innovation")]
    _fields_ += [("count", ctypes.c_size_t * 3)]
    _fields_ += [("which", ctypes.c_void_p * 3), ("kept", ctypes.c_void_p * 3)]
    _fields_ += [(name, ctypes.c_void_p) for name in ("first_bad", "first_outside")]


class Batch:
    """A model's batch library, compiled for this processor; `lanes` runs go at once. Without `exact` sums and products
    may be fused and put in another order, and subnormal numbers are 0: in about half of the time, but other bits than
    NAME_step has, and other ones from machine to machine. For fits. `causal`: see render_batch.

    The first SHORT steps run code that is compiled sooner, all later calls code that runs faster: of many models of a diagnosis only a few
    are ever run for long. With `exact` both have the same bits; without it, the same calls in the same order have."""

    def __init__(self, model: penode_gen.Model, dtype: type = np.float64, exact: bool = True, causal: Causal | None = None):
        self.model, self.dtype, self.exact = model, dtype, exact
        self._code = render_batch(model, causal)
        self._libraries: dict[tuple[bool, bool], ctypes.CDLL] = {}
        self._steps = 0
        self.lanes = ctypes.c_size_t.in_dll(self._library(False, True), "batch_lanes").value

    def run(
        self,
        u: ArrayLike,
        *,
        x0: ArrayLike | None = None,
        parameters: Mapping[str, ArrayLike] | None = None,
        set_name: str = "default",
        sets: ArrayLike | None = None,
        sensors: Sequence[str] | None = None,
        outputs: Sequence[str] = (),
        states: Sequence[str] = (),
        every: int = 1,
        threads: int = 1,
        observer: Observer | None = None,
    ) -> BatchRun:
        """Step through the inputs from x0 (sample 0), all quantities in SI.

        u [n, n_u], or [runs, n, n_u]; x0 [n_x] or [runs, n_x], the model's start if not given; a parameter's value, one
        or [runs], replaces that of the model file or set; `sets` [set length] or [runs, set length] replaces the values
        of the named set (see penode_gen.set_values). Kept are the named sensors (all if none are named), outputs and states, of
        one in `every` samples from the first on; sensors of the others are not computed.
        Raises UserError for unknown names, ValueError for shapes and a start that is not finite.
        """
        model, dtype = self.model, self.dtype
        if set_name not in model.sets:
            raise WrongUse(f"{model.path}: no set '{set_name}'; it has {', '.join(model.sets)}")
        default = penode_gen.set_values(model, set_name, dtype)
        values: Array = np.ascontiguousarray(default if sets is None else sets, dtype=dtype)
        given = {name: np.atleast_1d(np.asarray(value, dtype=float)) for name, value in (parameters or {}).items()}
        start: Array = np.asarray(model.start if x0 is None else x0, dtype=dtype)
        u = np.ascontiguousarray(u, dtype=dtype)
        runs = self._runs(u, start, given, values, default.size)
        u = np.ascontiguousarray(beside(model, columns(model, u)), dtype=dtype)
        vectors = -(-runs // self.lanes)
        padded, n = vectors * self.lanes, u.shape[-2]

        p = self._parameters(given, values, padded)
        start = self._spread(start.T if start.ndim == 2 else start[:, None], padded)
        if u.ndim == 3:
            u = self._spread(np.moveaxis(u, 0, -1), padded)
        per_run = values.ndim == 2 and len(values) > 1
        if per_run:
            values = self._spread(values.T, padded).reshape(-1, vectors, self.lanes).swapaxes(0, 1).copy()
        signals = ([s.name for s in model.outputs], [s.name for s in model.sensors])
        named = zip(("state", "output", "sensor"), (states, outputs, sensors), (model.states, *signals), strict=True)
        wanted = tuple(self._columns(*each) for each in named)
        kept = [np.empty((-(-n // every), len(columns), padded), dtype=dtype) for columns in wanted]
        first = np.empty((2, padded), dtype=np.int64 if dtype == np.float64 else np.int32)
        job = _Job(samples=n, every=every, runs=padded, input_runs=padded if u.ndim == 3 else 1, set_length=default.size)
        job.u, job.p, job.w, job.start = (a.ctypes.data for a in (u, p, values, start))
        job.first_bad, job.first_outside = (a.ctypes.data for a in first)
        job.count = tuple(map(len, wanted))
        job.which, job.kept = (tuple(a.ctypes.data for a in arrays) for arrays in (wanted, kept))
        kept += self._observed(observer, job, -(-n // every), padded)  # innovations, and what else the job points to
        self._steps += n * runs * model.substeps
        if not self._step(self._library(per_run, self._steps <= SHORT), job, vectors, threads):
            raise WrongUse(f"{model.path}: a set has more straight pieces than there is room for; give more `pieces`")
        x, y, z, nu = (k[:, :, :runs].transpose(2, 0, 1) for k in kept[:4])
        return BatchRun(x, y, z, nu, *first[:, :runs].astype(np.int64))

    def _observed(self, observer: Observer | None, job: _Job, n: int, padded: int) -> tuple[Array, ...]:
        """Sets the observer of a job that keeps n samples: innovations [updates, n_z, padded], and inputs of it. Raises ValueError for
        shapes."""
        n_x, n_z = len(self.model.states), len(self.model.sensors)
        if observer is None or not n_z:
            return (np.empty((0, n_z, padded), dtype=self.dtype),)
        measured: Array = np.asarray(observer.measured, dtype=self.dtype)
        gain: Array = np.asarray(observer.gain, dtype=self.dtype)
        if measured.shape[-2:] != (n, n_z) or gain.shape[-2:] != (n_x, n_z):
            raise ValueError(f"measured {measured.shape} must be [kept, n_z] = [{n}, {n_z}], gain {gain.shape} [n_x, n_z] = [{n_x}, {n_z}]")
        if measured.ndim == 3:
            measured = self._spread(np.moveaxis(measured, 0, -1), padded)
        gain = self._spread(np.moveaxis(gain, 0, -1) if gain.ndim == 3 else gain[:, :, None], padded)
        measured = np.ascontiguousarray(measured)
        job.update, job.measured_runs = observer.update, padded if measured.ndim == 3 else 1
        nu: Array = np.empty((n // observer.update, n_z, padded), dtype=self.dtype)
        job.measured, job.gain, job.innovation = (a.ctypes.data for a in (measured, gain, nu))
        return nu, measured, gain

    def _runs(self, u: Array, start: Array, given: Mapping[str, Array], values: Array, length: int) -> int:
        """How many runs the arguments describe. Raises for what does not fit."""
        n_u, n_x = len(self.model.inputs), len(self.model.states)
        for name, value in given.items():
            if name not in self.model.parameters:
                known = ", ".join(self.model.parameters)
                raise WrongUse(f"{self.model.path}: no parameter '{name}'; it has {known}")
            if value.ndim != 1:
                raise ValueError(f"parameter {name} has the shape {value.shape}; it must be one value or [runs]")
        if u.ndim not in (2, 3) or u.shape[-1] != n_u:
            raise ValueError(f"u has the shape {u.shape}; it must be [n, {n_u}] or [runs, n, {n_u}]")
        if start.ndim not in (1, 2) or start.shape[-1] != n_x or not np.isfinite(start).all():
            raise ValueError(f"x0 has the shape {start.shape}; it must be {n_x} finite states, or [runs, .] of them")
        if values.ndim not in (1, 2) or values.shape[-1] != length or not np.isfinite(values).all():
            raise ValueError(f"sets has the shape {values.shape}; it must be {length} finite values, or [runs, .]")
        found = {len(value) for value in given.values()}
        found |= {len(a) for a, n in ((u, 3), (start, 2), (values, 2)) if a.ndim == n}
        runs = max(found, default=1)
        if runs < 1 or not found <= {1, runs}:
            raise ValueError(f"numbers of runs that do not agree: {', '.join(map(str, sorted(found)))}")
        return runs

    @staticmethod
    def _step(library: ctypes.CDLL, job: _Job, vectors: int, threads: int) -> bool:
        """All vectors of runs, shared among threads (ctypes releases the interpreter lock). False: set refused."""
        edges = [vectors * i // threads for i in range(threads + 1)]
        if threads == 1:
            return bool(library.batch_run(ctypes.byref(job), 0, vectors))
        with ThreadPoolExecutor(threads) as pool:
            return all(pool.map(lambda i: library.batch_run(ctypes.byref(job), edges[i], edges[i + 1]), range(threads)))

    def _spread(self, values: Array, padded: int) -> Array:
        """[..., 1 or runs] repeated to [..., padded], the last run in the lanes that are left over."""
        wide = np.empty((*values.shape[:-1], padded), dtype=self.dtype)
        wide[..., : values.shape[-1]] = values
        wide[..., values.shape[-1] :] = values[..., -1:]
        return wide

    def _parameters(self, given: Mapping[str, Array], values: Array, padded: int) -> Array:
        """[n_p, padded]: value or reciprocal of each parameter the code takes; reciprocals of doubles, as in the C."""
        taken = self._code.parameters
        own = {p.name: np.atleast_1d(values[..., i]) for i, p in enumerate(self.model.tunable)} | dict(given)
        found: Array = np.empty((len(taken), padded))
        found.T[:] = [self.model.parameters[name].value for name, _ in taken]
        for row, (name, _) in zip(found, taken, strict=True):
            if name in own:
                row[: len(own[name])], row[len(own[name]) :] = own[name], own[name][-1]
        inverse = [i for i, (_, inverse) in enumerate(taken) if inverse]
        with np.errstate(divide="ignore", over="ignore"):
            found[inverse] = 1.0 / found[inverse]
            return found.astype(self.dtype, copy=False)

    def _columns(self, kind: str, wanted: Sequence[str] | None, known: Sequence[str]) -> Array:
        for name in wanted or ():
            if name not in known:
                raise WrongUse(f"{self.model.path}: no {kind} '{name}'; it has {', '.join(known) or 'none'}")
        return np.array([known.index(name) for name in (known if wanted is None else wanted)], dtype=np.uintp)

    def _library(self, per_run: bool, short: bool) -> ctypes.CDLL:
        key = per_run, short
        if key not in self._libraries:
            library = ctypes.CDLL(str(_build(self.model, self._code, self.dtype, per_run, self.exact, short)))
            library.batch_run.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_size_t)
            library.batch_run.restype = ctypes.c_bool
            self._libraries[key] = library
        return self._libraries[key]


@cache
def _processor(compiler: str) -> bytes:
    """What a compiler makes of -march=native here, and its version."""
    try:
        return subprocess.run([compiler, *OPTIMISE, "-dM", "-E", "-x", "c", "/dev/null"], capture_output=True).stdout
    except FileNotFoundError as exc:
        raise missing_tool(compiler) from exc


def _compiler(model: penode_gen.Model) -> str:
    """That of long calls: clang where it is installed, for a model without networks: it takes two thirds of gcc's time, and its code six
    sevenths. That of layers takes a tenth more, and gcc alone picks among the pieces of folded networks in registers."""
    return next(filter(shutil.which, () if model.networks else ("clang-19", "clang")), "gcc")


def _build(model: penode_gen.Model, code: BatchCode, dtype: type, per_run: bool, exact: bool, short: bool) -> Path:
    """The shared library of a batch code, compiled once; keyed by sources, compiler and processor."""
    compiler = "gcc" if short else _compiler(model)
    command = [
        compiler,
        *(SIMPLE if short else OPTIMISE),
        *FLAGS,
        *(() if exact else QUICK),
        "-fPIC",
        *(["-DPEN_REAL_DOUBLE"] if dtype == np.float64 else []),
        *(["-DWEIGHTS_PER_RUN"] if per_run else []),
        *include("sil/firmware", "src", "inc", "port/gnu"),
    ]
    functions = (("src", f"pen_{name}.c") for name in ("math", "trig", "atan", "log", "root"))
    parts = sources_in(("inc", "*.h"), ("port/gnu", "*.h"), ("sil/firmware", "pen_lanes*.h"), *functions)
    folding = []
    if "LANES_PIECES" in code.text:
        own = [native("src", name) for name in ("pen_fold.c", "pen_net.c", "pen_math.c")]
        folding = [
            build_once("folding", ".o", [*command, "-r", "-nostdlib", *map(str, own)], [_processor(compiler), *parts, *own])
        ]  # for every model
    stem = build_directory() / f"{model.name}-batch-{digest_of([*command, _processor(compiler), code.text, *folding, *parts])}"
    library = stem.with_suffix(".so")
    if not library.exists():
        stem.parent.mkdir(parents=True, exist_ok=True)
        source = stem.with_suffix(".c")
        with whole(source) as part:  # other processes may be about to compile the same
            part.write_text(code.text)
        compile_program([*command, "-shared", str(source), *map(str, folding)], library)
    return library
