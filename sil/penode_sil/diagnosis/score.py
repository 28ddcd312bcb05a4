# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""All hypotheses at once, without a simulation each.

First the motion is estimated as it was, whatever the cause: unknown forces at all places with elements, with spectra that
the data choose (expectation and maximisation), explain the residual; what they do to deflections and rates is known from the
linearised plant. Along that motion each elementary law is a known force, and its effect on the sensors one multiplication per
frequency. So all of them are columns of one linear regression, in the metric of the noise, nuisances projected out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import fft, optimize

from penode_gen.model import Model

from .fit import Fit
from .hypotheses import Basis, Fault, Motion
from .noise import Experiment, Metric
from .plant import Linear, Place

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Complex = NDArray[np.complex128] | NDArray[np.complex64]
RESONANCES = np.geomspace(0.25, 40.0, 40)  # [Hz] of hidden masses that are tried
DAMPINGS = (0.03, 0.1, 0.3)  # and their damping ratios
BLOCK = 1024  # rows of which products are added up in single
ROUND = 3e-6  # of the square of a column: less is rounding, or not as linear


@dataclass(frozen=True, eq=False)
class Seen:
    """One recording after the smoother: motion of every place, sensors without noise, and the response of the sensors to a
    force at each place [f, sensors, places]."""

    motions: tuple[Motion, ...]
    sensors: Array
    response: Complex
    forces: dict[int, Array]  # that explain the residual, at places with elements [n]
    states: Complex | None  # of the states [f, x, places], and of the sensors to a start state [f, sensors, x]:
    free: Complex | None  # None if start states are free anyway

    def answer(self, force: Complex, place: int, settled: Sequence[bool] = (), out: Array | None = None) -> Complex:
        """Spectra [k, f, sensors] of the sensors under forces [k, f] at a place, from rest unless settled; in memory, which
        may be the rows `out`, [k, sensors, f]."""
        shape, dtype = (len(force), self.response.shape[1], force.shape[1]), self.response.dtype
        spectra = np.empty(shape, dtype=dtype) if out is None else out.view(dtype).reshape(shape, copy=False)
        np.multiply(force[:, None, :], self._responses[place], out=spectra)
        if self.states is not None and self.free is not None:
            # what is periodic is not at rest at the start: take that start away
            start = force @ self.states[:, :, place] * 2.0 - force[:, :1] * self.states[0, :, place]
            if settled:
                start[np.array(settled)] = 0.0
            spectra -= (start.real / self.n @ self._frees).view(dtype).reshape(shape)
        spectra[:, :, 0].imag = 0.0  # of a mean
        return spectra.swapaxes(1, 2)

    def single(self) -> Seen:
        """The same with responses in single precision: in half of the time, and fine enough for a column of a regression."""
        states, free = (None if x is None else x.astype(np.complex64) for x in (self.states, self.free))
        return replace(self, response=self.response.astype(np.complex64), states=states, free=free)

    def white(self, m: Metric) -> Seen:
        """The same with sensors whose noise is white: what answers then are rows of a regression."""
        rows = m.triangle.transpose(2, 0, 1)
        return replace(self, response=rows @ self.response, free=None if self.free is None else rows @ self.free)

    @cached_property
    def _responses(self) -> Complex:
        """Responses to forces at each place, [places, sensors, f]."""
        return np.ascontiguousarray(self.response.T)

    @cached_property
    def _frees(self) -> Array:
        """Free motions from each state, [x, numbers]."""
        return np.ascontiguousarray(self.free.T).reshape(self.free.shape[2], -1).view(self.free.real.dtype)

    @property
    def n(self) -> int:
        return len(self.sensors)


def smooth(
    e: Experiment, m: Metric, levels: Array, linear: Linear, found: Sequence[Place], simulated: Array, paths: Array, moving: bool
) -> Seen:
    """Motion and sensors as they most likely were, from a simulation: its sensors [n, n_z] and paths [n, 2 places]."""
    n, band = len(e.time), e.band
    h = linear.transfer(e.frequencies[:band])
    n_z, n_u = linear.n_sensors, linear.n_inputs
    acting = [k for k, p in enumerate(found) if p.role != "body"]
    columns = [n_u + k for k in acting] + list(range(n_u))
    g = h[:, :n_z, columns]
    r = m.spectrum(np.where(e.good, e.y - simulated, 0.0)) / np.sqrt(n)
    w = np.einsum("fqz,fz->fq", likely(e, levels, g, len(acting), r), r)
    moved = np.einsum("fyq,fq->fy", h[:, :, columns], w) * np.sqrt(n)
    whole = np.zeros((len(e.frequencies), moved.shape[1]), dtype=complex)
    whole[:band] = moved
    change = fft.irfft(whole, n, axis=0)
    paths = paths + change[:, n_z:]
    t = e.time - e.time[0]
    motions = tuple(Motion(paths[:, 2 * k], paths[:, 2 * k + 1], t) for k in range(len(found)))
    f = e.frequencies[:band]
    states, free = (None, None) if moving or not len(linear.a) else (linear.states(f), linear.free(f, 1.0 / e.step)[:, :n_z])
    acts = np.zeros((len(e.frequencies), len(acting)), dtype=complex)
    acts[:band] = w[:, : len(acting)] * np.sqrt(n)
    forces = dict(zip(acting, fft.irfft(acts, n, axis=0).T, strict=True))
    return Seen(motions, simulated + change[:, :n_z], h[:, :n_z, n_u:], forces, states, free)


def likely(e: Experiment, levels: Array, g: Complex, acting: int, r: Complex) -> Complex:
    """Gain [f, q, n_z] from spectra of a residual to those of the part that reaches the sensors through g [f, n_z, q]: `acting` forces
    first, then errors of the inputs. These are their most likely values; the spectra of the forces are those that spectra r [f, n_z] of
    a residual suggest, smooth over half a hertz."""
    band = len(g)
    weighted = np.conj(np.swapaxes(g, 1, 2)) / levels[:, None, :]
    curvature, slope = weighted @ g, (weighted @ r[:, :, None])[:, :, 0]
    prior = np.empty((band, g.shape[2]))
    prior[:, :acting] = 1.0 / np.median(np.einsum("fqq->fq", curvature).real[:, :acting], axis=0)
    prior[:, acting:] = np.maximum(e.unsure[:band], 1e-15) ** 2
    kernel = np.hanning(2 * max(int(0.5 / e.frequencies[1]), 3) + 1)
    weight = np.convolve(np.ones(band), kernel, "same")
    for again in range(8):
        root = np.sqrt(prior)  # the inverse is that of q x q numbers, of which none is below 1
        inner = np.linalg.inv(np.eye(len(root.T)) + root[:, :, None] * curvature * root[:, None, :])
        if again < 7:
            left = prior * np.einsum("fqq->fq", inner).real
            power = np.abs(root * (inner @ (root * slope)[:, :, None])[:, :, 0]) ** 2 + np.maximum(left, 0.0)
            for q in range(acting):
                prior[:, q] = np.maximum(np.convolve(power[:, q], kernel, "same") / weight, 1e-30)
    return root[:, :, None] * inner * root[:, None, :] @ weighted


@dataclass(frozen=True, eq=False)
class Candidate:
    """One column of the regression and its hypothesis."""

    kind: str
    where: str
    sign: int
    companion: bool
    what: Basis | Fault | str | tuple[str, int, float, float]


class Regression:
    """Whitened effects [candidates, rows] of all candidates against the whitened residual of a fit, its free values projected out.

    Effects are single; what free values do of them is taken away before they are multiplied with each other, so that nothing
    cancels that is more than rounding. Rows of the priors, in which effects have no part at first, come behind the others.
    """

    def __init__(self, fit: Fit, candidates: Sequence[Candidate], effects: Single, parameters: Sequence[str]):
        """`effects` [candidates and parameters, rows] is used up; of the parameters the rows are still empty."""
        self.candidates = (*candidates, *(Candidate("wrong_parameter", p, 0, False, p) for p in parameters))
        self.free = [f for f in fit.free if f.low < f.value < f.high]  # the others stand at their bounds
        index = {f.target: i for i, f in enumerate(fit.free)}
        derivatives = fit.jacobian[:, [index[f.target] for f in self.free]]
        self.spread = np.concatenate([derivatives, np.diag([f.unit / f.sigma for f in self.free])])
        self.basis = np.linalg.qr(self.spread)[0]
        top, low = np.split(self.basis, [len(fit.residual)])
        law, own = effects[: len(candidates)], fit.jacobian[:, [index[p] for p in parameters]].T
        quick = top.astype(np.float32)
        largest = np.maximum(np.max(law, axis=1, initial=0.0), -np.min(law, axis=1, initial=0.0))
        self.unit = np.concatenate([np.where(largest > 0.0, largest, 1.0), np.ones(len(own))])  # squares of small ones would be 0
        law /= self.unit[: len(law), None].astype(np.float32)
        self.along = np.concatenate([law @ quick, own @ top])
        self.sizes = np.concatenate([np.einsum("ij,ij->i", law, law), np.sum(own**2, axis=1)])
        for k in range(0, len(law), BLOCK // 16):
            law[k : k + BLOCK // 16] -= self.along[k : k + BLOCK // 16][: len(law) - k].astype(np.float32) @ quick.T
        effects[len(law) :] = own - self.along[len(law) :] @ top.T
        self.left, self.beyond = effects, -self.along @ low.T
        self.product = self.beyond @ self.beyond.T
        for k in range(0, effects.shape[1], BLOCK):
            self.product += effects[:, k : k + BLOCK] @ effects[:, k : k + BLOCK].T
        self._against(fit, self.product, self.along[:, :0], self.basis[:, :0])

    def _against(self, fit: Fit, product: Array, more: Array, span: Array) -> None:
        """Gram matrix, slope and chi2 from the residual of a fit; `more` [candidates, k]: what effects have in `span`
        [rows, k], which is not free there."""
        offset = {f.target: f.offset for f in fit.free}
        r = np.concatenate([fit.residual, [-offset.get(f.target, 0.0) for f in self.free]])
        rest = r - self.basis @ (self.basis.T @ r)
        top, low = np.split(rest, [len(fit.residual)])
        along = span.T @ r
        self.slope = self.left @ top.astype(np.float32) + self.beyond @ low + more @ along
        self.scale = np.sqrt(np.maximum(np.diag(product), 1e-300))
        self.alive = np.diag(product) > 1e-9 * self.sizes  # what nuisances do not imitate altogether
        self.gram = product / np.outer(self.scale, self.scale)
        self.slope /= self.scale
        self.scale = self.scale * self.unit
        self.chi2 = float(rest @ rest + along @ along)

    def gain(self, chosen: Sequence[int]) -> tuple[float, Array]:
        """How much chi2 falls with these columns, signs as their kinds demand, and their gains in SI."""
        if not len(chosen):
            return 0.0, np.zeros(0)
        index, flip = [], []
        for c in chosen:
            sign = self.candidates[c].sign
            for s in (1, -1) if sign == 0 else (sign,):
                index.append(c)
                flip.append(float(s))
        flips = np.array(flip)
        gram = self.gram[np.ix_(index, index)] * np.outer(flips, flips)
        slope = self.slope[index] * flips
        values, vectors = np.linalg.eigh(gram)
        root = np.sqrt(np.maximum(values, ROUND))
        x, _ = optimize.nnls(root[:, None] * vectors.T, vectors.T @ slope / root)
        found = np.zeros(len(chosen))
        order = {c: k for k, c in enumerate(chosen)}
        for c, f, value in zip(index, flips, x, strict=True):
            found[order[c]] += f * value / self.scale[c]
        return float(2.0 * x @ slope - x @ gram @ x), found

    def without(self, fit: Fit) -> Regression:
        """The same effects against another residual, with fewer of the values free."""
        kept = {f.target for f in fit.free}
        gone = np.array([f.target not in kept for f in self.free], dtype=bool)
        fewer = np.linalg.qr(self.spread[:, ~gone])[0]
        lost = self.spread[:, gone]
        span = np.linalg.qr(lost - fewer @ (fewer.T @ lost))[0]
        more = self.along @ (self.basis.T @ span)
        other = copy(self)
        other._against(fit, self.product + more @ more.T, more, span)
        return other

    def unsigned(self) -> Regression:
        """The same effects, each law with either sign."""
        other = copy(self)
        laws = (replace(c, sign=0, what=replace(c.what, sign=0)) if isinstance(c.what, Basis) else c for c in self.candidates)
        other.candidates = tuple(laws)
        return other

    def beside(self, taken: Sequence[int]) -> Regression:
        """The regression with these columns free in size and sign, so that only what none of them can do is left."""
        c = [k for k in taken if self.alive[k]]
        values, vectors = np.linalg.eigh(self.gram[np.ix_(c, c)])
        kept = values > 1e-6 * np.max(values, initial=0.0)
        span = vectors[:, kept] / np.sqrt(values[kept])
        cross = span.T @ self.gram[c]
        along = span.T @ self.slope[c]
        rest = copy(self)
        rest.gram = self.gram - cross.T @ cross
        rest.slope = self.slope - cross.T @ along
        rest.chi2 = self.chi2 - float(along @ along)
        left = np.diag(rest.gram)
        rest.alive = self.alive & (left > 1e-4)
        left = np.where(rest.alive, left, 1.0)
        rest.alive[list(taken)] = False
        rest.gram = rest.gram / np.sqrt(np.outer(left, left))
        rest.slope = rest.slope / np.sqrt(left)
        rest.scale = self.scale * np.sqrt(left)
        return rest

    def best_single(self, chosen: Sequence[int], pool: Sequence[int], costs: Mapping[int, float]) -> tuple[float, int]:
        """The column of `pool` that, beside `chosen`, takes most from chi2 beyond its cost (signs of `chosen` free); -1 if none."""
        if not pool:
            return 0.0, -1
        c, p = list(chosen), np.array(pool)
        slope, curve = self.slope[p].copy(), np.ones(len(p))
        if c:
            inverse = np.linalg.pinv(self.gram[np.ix_(c, c)], rcond=ROUND)
            cross = self.gram[np.ix_(c, p)]
            slope -= cross.T @ (inverse @ self.slope[c])
            curve -= np.einsum("ij,ij->j", cross, inverse @ cross)
        signs = np.array([self.candidates[i].sign for i in pool])
        usable = (curve > 1e-4) & ((signs == 0) | (slope * signs > 0.0)) & self.alive[p]
        gains = np.where(usable, slope**2 / np.maximum(curve, 1e-12), 0.0)
        left = gains - np.array([costs[i] for i in pool])
        best = int(np.argmax(left))
        return float(gains[best]), int(p[best]) if left[best] > 0.0 else -1


def where(kind: str, place: Place, model: Model) -> str:
    """What a report says of the place: a spring or damper by its law, a load by its body."""
    if kind in ("constant_force", "hidden_resonance"):
        return next((end for end in place.ends if end in {b.name for b in model.bodies}), place.name)
    if kind == "network_extrapolation":
        return place.trained[0][0]
    damper = any(word in kind for word in ("friction", "damper"))
    laws = {e.name: e.law for e in model.elements}
    fitting = [name for name, _ in place.elements if ("damper" in laws[name] or "friction" in laws[name]) == damper]
    return fitting[0] if fitting else place.name
