# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""independent.c, compiled: plant.py's vehicle and filter for hours of samples, and how far a generated filter is from it."""

from __future__ import annotations

import ctypes
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import plant
from numpy.typing import NDArray

from penode_gen.model import Model
from penode_sil.filtering.compiled import Compiled

HERE = Path(__file__).parent
FLOAT = 1e-2  # of a standard deviation: what a filter in float may be off
PIECE = 60_000  # samples at once
ROUNDING = 16.0  # what three layers of sums of sixteen products may be off by, in units of the last place
MEMORY = 100  # samples in which what was different once is forgotten
Array = NDArray[np.float64]


class _Nets(ctypes.Structure):
    _fields_ = [("spring", ctypes.c_void_p), ("damper", ctypes.c_void_p)]


class _Filter(ctypes.Structure):
    _fields_ = [
        ("nets", _Nets),
        ("decay", ctypes.c_double),
        ("q", ctypes.c_double * 5),
        ("r", ctypes.c_double * 2),
        ("x", ctypes.c_double * 5),
        ("p", ctypes.c_double * 25),
        ("running", ctypes.c_double),
    ]


def numbers(network: Any) -> Array:
    """A network as independent.c takes it."""
    first, *dense, last = network.layers
    parts = [np.ravel(first.shift), np.ravel(first.factor), [len(dense)]]
    for layer in dense:
        w = np.asarray(layer.weights, float)
        parts += [[w.shape[1], w.shape[0], float(layer.activation == "relu")], w.ravel(), np.asarray(layer.bias, float)]
    return np.concatenate([*parts, np.ravel(last.factor), np.ravel(last.shift)]).astype(float)


@dataclass(frozen=True)
class Road:
    """A road of first order: standard deviation at the start [m], decay from one sample to the next, and what each sample adds [m]."""

    noise: float
    step: float
    decay: float


class Reference:
    """A vehicle that drives on, and the filter on what it measures. Of penode: weights, and noises of the model file. `road`: if the filter
    does not estimate it; then the filter here is another one. `rest`: the vehicle begins as the filter takes it."""

    def __init__(self, model: Model, place: Path, seed: int | list[int], road: Road | None = None, rest: bool = False):
        given, self.rng, self.begun = model.filter, np.random.default_rng(seed), False
        library = place / "reference.so"
        if not library.exists():
            words = ["gcc", "-O2", "-std=c99", "-ffp-contract=off", "-shared", "-fPIC", "-o", library, HERE / "independent.c", "-lm"]
            subprocess.run(words, check=True)
        self.library = ctypes.CDLL(str(library))
        nets = model.sets["default"].networks
        self._kept = [numbers(nets[name]) for name in ("spring_net", "damper_net")]
        road = road or given.inputs[0]
        start = np.array([*(s.start for s in given.states), road.noise])
        self.noise = np.array([*(s.noise for s in given.states), road.step])
        self.sensors = np.array([s.noise for s in given.sensors])
        self.x = np.array([*model.start, 0.0]) + start * self.rng.standard_normal(5) * (0.0 if rest else 1.0)
        self.own = _Filter(_Nets(*(kept.ctypes.data for kept in self._kept)), road.decay)
        self.own.q[:], self.own.r[:] = self.noise**2, self.sensors**2
        self.own.x[:], self.own.p[:] = [*model.start, 0.0], np.diag(start**2).ravel()

    def drive(self, n: int, mass: Array | None = None) -> tuple[Array, Array]:
        """Truth [n, 5] and measurements [n, 2] of the next samples; body mass [n] [kg], that of the model if None."""
        drawn, noise = self.noise * self.rng.standard_normal((n, 5)), self.sensors * self.rng.standard_normal((n, 2))
        truth, z, mass = np.zeros((n, 5)), np.zeros((n, 2)), np.full(n, plant.M_B) if mass is None else np.ascontiguousarray(mass)
        at = [ctypes.c_void_p(part.ctypes.data) for part in (self.x, drawn, noise, mass, truth, z)]
        head = ctypes.byref(self.own.nets), ctypes.c_double(self.own.decay), ctypes.c_int(self.begun), ctypes.c_size_t(n)
        self.library.reference_drive(*head, *at)
        self.begun = True
        return truth, z

    def run(self, z: Array) -> tuple[Array, Array]:
        """States [n, 5] and covariances [n, 5, 5] after the next samples z [n, 2], NaN where missing."""
        z, x, p = np.ascontiguousarray(z), np.zeros((len(z), 5)), np.zeros((len(z), 5, 5))
        at = [ctypes.c_void_p(part.ctypes.data) for part in (z, x, p)]
        self.library.reference_run(ctypes.byref(self.own), ctypes.c_size_t(len(z)), *at)
        return x, p

    def kinks(self, a: Array, b: Array, rounding: float = 0.0) -> NDArray[np.uint8]:
        """1 where the derivatives of the next step differ between states a and b [n, 5], or may do so after this relative rounding."""
        found = np.zeros(len(a), np.uint8)
        states = [np.ascontiguousarray(x, float) for x in (a, b)]
        at = [ctypes.c_void_p(part.ctypes.data) for part in (*states, found)]
        head = ctypes.byref(self.own.nets), ctypes.c_double(self.own.decay), ctypes.c_double(rounding), ctypes.c_size_t(len(a))
        self.library.reference_kinks(*head, *at)
        return found


@dataclass
class Difference:
    """
    Of a generated filter: the largest of state [standard deviations] and of covariance [of their products]. In the memory of the filter
    after a step in which a kink of a network lies between the states of both, or within the rounding of either, where no derivative is
    the right one: `at_kinks`, the largest of the state, and `share` of all samples. `beyond`: share of the samples in which the state is
    more than FLOAT off.
    """

    state: float = 0.0
    covariance: float = 0.0
    at_kinks: float = 0.0
    share: float = 0.0
    beyond: float = 0.0


def difference(model: Model, dtype: type, samples: int, place: Path, seed: int = 3) -> Difference:
    """A generated filter against the reference, in float with the same measurements rounded."""
    reference, own, found = Reference(model, place, seed), Compiled(model, dtype).filter(), Difference()
    for begin in range(0, samples, PIECE):
        _, z = reference.drive(min(PIECE, samples - begin))
        _, x, f = own.run(np.zeros((len(z), 1)), z, estimates=False, covariance=True)
        wanted, p = reference.run(np.asarray(z, dtype).astype(float))
        deviation = np.sqrt(np.diagonal(p, axis1=1, axis2=2))
        state = np.max(np.abs(x - wanted) / deviation, axis=1)
        covariance = np.max(np.abs(plant.covariance(f) - p) / (deviation[:, :, None] * deviation[:, None, :]), axis=(1, 2))
        kinks = (
            np.convolve(reference.kinks(x, wanted, ROUNDING * np.finfo(dtype).eps), np.ones(MEMORY))[: len(z)] > 0.0
        )  # those of the last ones of a piece are lost
        found.state, found.covariance = max(found.state, state[~kinks].max()), max(found.covariance, covariance[~kinks].max())
        found.at_kinks = max(found.at_kinks, state[kinks].max(initial=0.0))
        found.share += float(kinks.sum()) / samples
        found.beyond += float((state > FLOAT).sum()) / samples
    return found
