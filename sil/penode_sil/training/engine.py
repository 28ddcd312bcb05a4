# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A model that trains: its simulation with exact sensitivities as a compiled library, called recording by recording."""

from __future__ import annotations

import ctypes
import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Model
from penode_gen.resources import resource

from ..building import build_directory, build_once, compiler_version
from ..output import whole
from .curve import Curve
from .dense import Dense
from .drive import NODES, SHARES, Drive
from .equations import equations
from .settings import SETTINGS

Array = NDArray[np.float64]
Shape = Curve | Dense
OPTIONS = (
    "-std=c99",
    "-O3",
    "-march=native",
    "-ffp-contract=fast",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fassociative-math",
    "-fno-signed-zeros",
)


class _Net(ctypes.Structure):
    """net_t"""

    _fields_ = [(n, ctypes.c_int) for n in ("kind", "count", "zero", "layers")]
    _fields_ += [(n, ctypes.c_void_p) for n in ("knots", "values", "width", "activation", "weights", "factor")]
    _fields_ += [(n, ctypes.c_int) for n in ("first", "columns", "widest", "inputs")]


class _Job(ctypes.Structure):
    """job_t"""

    _fields_ = [(n, ctypes.c_int) for n in ("samples", "substeps", "stages", "columns")]
    _fields_ += [(n, ctypes.c_void_p) for n in ("nodes", "shares")] + [("step", ctypes.c_double)]
    _fields_ += [(n, ctypes.c_void_p) for n in ("p", "drive", "u")] + [("nets", ctypes.c_int)]
    _fields_ += [(n, ctypes.c_void_p) for n in ("net", "net_of", "x", "S", "z", "J", "inputs_seen", "scratch")]
    _fields_ += [("inputs_total", ctypes.c_int)]


@dataclass(frozen=True, eq=False)
class Block:
    """Samples from `first` on: signals z [n, n_z] and their derivatives [n, n_z, columns]; columns: free parameters, start states,
    then each network's."""

    first: int
    z: Array
    jacobian: Array


class Engine:
    """The compiled model. `free` names the parameters that sensitivities are taken by; signals are the sensors, then the outputs."""

    def __init__(self, model: Model, free: Sequence[str]):
        self.model, self.free = model, tuple(free)
        found = equations(model, self.free)
        self.calls = found.calls
        self.networks = tuple(dict.fromkeys(name for name, _ in found.calls))
        self.signals = tuple(s.name for s in (*model.sensors, *model.outputs))
        source = "".join(
            resource("penode_sil.training", "templates", f"{part}.c").read_text(encoding="utf-8") for part in ("networks", "engine")
        )
        head = (
            "#include <math.h>\n#include <stddef.h>\nstatic inline double t_sigmoid(double x);\n"
            "static inline double t_softplus(double x);\n"
            "static inline double t_sign(double x) { return (double)((x > 0.0) - (x < 0.0)); }\n"
            "static inline double t_step(double x) { return (x > 0.0) ? 1.0 : 0.0; }\n"
        )
        self._library = ctypes.CDLL(str(_compiled(head + found.text + source)))
        self._library.train_run.restype = ctypes.c_bool
        self._library.train_scratch.restype = ctypes.c_long

    def simulate(self, drive: Drive, parameters: Array, shapes: Sequence[Shape], start: Array) -> tuple[Array, Array, bool]:
        """Signals [n, n_z], inputs of the network calls side by side [n, .], and whether all stayed finite. Parameters in the
        model's order, a shape for each of `networks`."""
        job, kept = self._job(drive, parameters, shapes, start, 0)
        n = len(drive.u)
        z, seen = np.full((n, len(self.signals)), np.nan), np.zeros((n, job.inputs_total))
        job.z, job.inputs_seen = z.ctypes.data, seen.ctypes.data
        good = bool(self._library.train_run(ctypes.byref(job), 0, n))
        del kept
        return z, seen, good and bool(np.isfinite(z).all())

    def blocks(self, drive: Drive, parameters: Array, shapes: Sequence[Shape], start: Array, columns: int) -> Iterator[Block]:
        """Signals and derivatives, as many samples at a time as there is room for. Arrays are used again by the next block."""
        job, kept = self._job(drive, parameters, shapes, start, columns)
        n, n_z = len(drive.u), len(self.signals)
        size = max(16, min(n, SETTINGS.engine_room // max(1, n_z * columns)))
        z, jacobian = np.empty((n, n_z)), np.empty((size, n_z, columns))
        job.z = z.ctypes.data
        for first in range(0, n, size):
            last = min(n, first + size)
            job.J = jacobian.ctypes.data - 8 * first * n_z * columns
            if not self._library.train_run(ctypes.byref(job), first, last):
                raise FloatingPointError("the simulation left all bounds")
            yield Block(first, z[first:last], jacobian[: last - first])
        del kept

    def _job(self, drive: Drive, parameters: Array, shapes: Sequence[Shape], start: Array, columns: int) -> tuple[_Job, list[Any]]:
        """The job, and all that must live as long."""
        nodes, shares = np.array(NODES[drive.method]), np.array(SHARES[drive.method])
        nets = (_Net * max(1, len(shapes)))()
        at, kept = len(self.free) + len(start), []
        for net, shape in zip(nets, shapes, strict=False):  # without networks the C still needs one
            kept += shape.fill(net)
            net.first = at
            at += shape.columns
        which = np.array([self.networks.index(name) for name, _ in self.calls] or [0], dtype=np.int32)
        p, x = np.ascontiguousarray(parameters, dtype=float), np.array(start, dtype=float)
        sensitivity = np.zeros((len(x), columns))
        if columns:
            sensitivity[np.arange(len(x)), len(self.free) + np.arange(len(x))] = 1.0
        job = _Job(samples=len(drive.u), substeps=drive.substeps, stages=len(nodes), columns=columns, step=drive.step, nets=len(shapes))
        job.inputs_total = sum(n for _, n in self.calls)
        job.nodes, job.shares, job.p, job.drive, job.u = (a.ctypes.data for a in (nodes, shares, p, drive.between, drive.u))
        job.net, job.net_of = ctypes.addressof(nets), which.ctypes.data
        job.x, job.S = x.ctypes.data, sensitivity.ctypes.data
        scratch = np.zeros(self._library.train_scratch(ctypes.byref(job)) + 64)
        job.scratch = scratch.ctypes.data
        return job, [*kept, nets, which, p, x, sensitivity, nodes, shares, scratch]


def compiler() -> bytes:
    """The version of the compiler that makes the library."""
    return compiler_version("gcc")


def _compiled(text: str) -> Path:
    """The library of a source text, compiled once."""
    folder = build_directory()
    folder.mkdir(parents=True, exist_ok=True)
    name = hashlib.sha256(text.encode()).hexdigest()[:16]
    source = folder / f"train-{name}.c"
    if not source.exists():
        with whole(source) as part:
            part.write_text(text, encoding="utf-8")
    return build_once("train", ".so", ["gcc", *OPTIONS, "-fPIC", "-shared", str(source)], [compiler(), text])
