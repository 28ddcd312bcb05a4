# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Restoring forces of places over deflection and rate: as measured, as the model has them, and as an extension has them. All is SI."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, rfft

from penode_gen.algebra.causalise import CausaliseError
from penode_gen.laws import for_angles
from penode_gen.model import GROUND, Input, Model, Signal

from ...errors import UserError
from ..plant.plant import Linear, Place, external
from .fit import Fit, Free, Problem
from .noise import Experiment
from .smoother import likely
from .study import Study, watch

Array = NDArray[np.float64]
BINS = 15  # of deflection and of rate
LEAST = 5  # samples of a bin that counts


@dataclass(frozen=True, eq=False)
class Surface:
    """Restoring force of a place along the smoothed motion: s, v, and forces [n] as measured and as the elements give
    them there; means on a grid of BINS deflections by BINS rates (NaN where fewer than LEAST samples are). `located`: do the sensors show
    the deflection, and not only how much it changes? `largest`: magnitude of the measured force in whole recordings; at their ends, which
    the rest is without, it is that of the fit."""

    place: str
    elements: tuple[str, ...]
    s: Array
    v: Array
    measured: Array
    nominal: Array
    extended: Array | None
    edges: tuple[Array, Array]
    turns: bool = False
    located: bool = True
    largest: float = np.inf

    def unit(self, of_length: str) -> str:
        """A unit of the force there: `of_length`, or the rotational one where the ends turn."""
        return for_angles(of_length) if self.turns else of_length

    def grid(self, values: Array) -> Array:
        """Mean of values [n] on the grid [deflections, rates]."""
        return averages(values, *self._cells(), (BINS, BINS))

    def count(self) -> NDArray[np.int64]:
        return np.bincount(np.ravel_multi_index(self._cells(), (BINS, BINS)), minlength=BINS * BINS).reshape(BINS, BINS)

    def _cells(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        return cells(self.s, self.edges[0]), cells(self.v, self.edges[1])


def rig(model: Model, places: Sequence[Place], driving: Set[str] = frozenset()) -> Model:
    """The elements of places alone, each place under prescribed deflection `s_place0`...; sensors are their forces
    [N]. Elements that are `driving`, which put a measured force on a body, are none of them."""
    elements, signals = [], []
    for k, place in enumerate(places):
        names = []
        for x in model.elements:
            if x.ends in (place.ends, place.ends[::-1]) and x.name not in driving:
                ahead = x.ends == place.ends
                elements.append(replace(x, ends=(f"s_place{k}", GROUND) if ahead else (GROUND, f"s_place{k}")))
                names.append(f"{'+' if ahead else '-'} F_{x.name}")
        signals.append(Signal(f"force_place{k}", " ".join(names).removeprefix("+ "), place.unit("N")))
    memory = tuple(s for s in model.extra_states if any(s.name.startswith(f"{x.name}_") for x in elements))
    inputs = (*(Input(f"s_place{k}", p.unit("m")) for k, p in enumerate(places)), *model.inputs)
    return replace(
        model,
        bodies=(),
        points=(),
        inputs=inputs,
        elements=tuple(elements),
        extra_states=memory,
        variables=(),
        equations=(),
        outputs=(signals[0],),
        sensors=tuple(signals),
    )


def surfaces(study: Study, extended: Model | None, fit: Fit | None) -> list[Surface]:
    """Restoring forces of all places with elements, over all recordings but their ends; none if their laws need more than motion.

    The motion and the measured force are those of the best fit there is (`fit`, or the null fit), and what the
    smoother makes of its residual; its gain is that for the residual of the null fit. `extended` may know more than that fit.
    """
    acting = [p for p, place in enumerate(study.places) if place.elements]
    places = [study.places[p] for p in acting]
    if not places:
        return []
    motions, beside, rigs, kept = [], [], [], []
    for k, (e, simulated) in enumerate(zip(study.experiments, watch(study, fit or study.null), strict=True)):
        s, v, more = _smoothed(study, k, simulated, acting)
        motions.append((s, v))
        beside.append(more)
        kept.append(_weights(len(s)) == 1.0)
        none = np.zeros((len(s), len(acting)))
        rigs.append(replace(e.driven_at(s, v), y=none, good=none > 0.0))
    driving = {x.name for x in study.model.elements if external(study.model, x)}
    best = fit or study.null
    models = [(study.model, _known(study.null)), (best.model, _known(best)), *([(extended, ())] if extended else [])]
    try:
        laws = [(Problem(rig(m, places, driving), rigs, (), study.set_name), free) for m, free in models]
    except (CausaliseError, UserError):
        return []
    both = [[np.array(p.simulate(k, free, np.zeros((1, len(free))))[0][0]) for k in range(len(rigs))] for p, free in laws]
    inner = np.concatenate(kept)
    located = _located(study.linear, acting)
    found = []
    for i, place in enumerate(places):
        s, v = (np.concatenate([m[q][:, i] for m in motions])[inner] for q in (0, 1))
        whole = [np.concatenate([z[:, i] for z in each]) for each in both]
        forces = [z[inner] for z in whole]
        edges = np.linspace(*_ends(s), BINS + 1), np.linspace(*_ends(v), BINS + 1)
        measured = whole[1] + np.concatenate([w[:, i] for w in beside])
        largest = float(np.max(np.abs(measured)))
        names = tuple(name for name, _ in place.elements)
        new = forces[2] if extended else None
        found.append(Surface(place.name, names, s, v, measured[inner], forces[0], new, edges, place.turns, located[i], largest))
    return found


def _known(fit: Fit) -> tuple[Free, ...]:
    """Its parameters: what a simulation of elements alone can take."""
    return tuple(f for f in fit.free if isinstance(f.target, str))


def _smoothed(study: Study, k: int, simulated: Array, acting: Sequence[int]) -> tuple[Array, Array, Array]:
    """Deflections and rates [n, acting] of the places with elements in recording k as they most likely were, and the force at each that its
    elements do not give, from what was simulated: sensors, then paths [n, n_z + 2 places]."""
    e, n_z, n_u = study.experiments[k], len(study.model.sensors), len(study.model.inputs)
    nominal, rest = (rfft(_residual(e, z[:, :n_z]), axis=0)[: e.band] for z in (study.null.simulated[k], simulated))
    h = study.linear.transfer(e.frequencies[: e.band])[:, :, [n_u + p for p in acting] + list(range(n_u))]
    gain = likely(e, study.levels[k], h[:, :n_z], len(acting), nominal / np.sqrt(len(e.time)))
    w = np.einsum("fqz,fz->fq", gain, rest)
    moved = np.einsum("fyq,fq->fy", h[:, n_z:], w)
    whole = np.zeros((len(e.frequencies), moved.shape[1] + len(acting)), dtype=complex)
    whole[: e.band] = np.concatenate([moved, w[:, : len(acting)]], axis=1)
    change = irfft(whole, len(e.time), axis=0)
    paths = simulated[:, n_z:] + change[:, : moved.shape[1]]
    s, v = (paths[:, [2 * p + q for p in acting]] for q in (0, 1))
    return s, v, change[:, moved.shape[1] :]


def _residual(e: Experiment, simulated: Array) -> Array:
    """What a simulation [n, n_z] leaves of the sensors, for a Fourier transform: interpolated over samples that do not count, where a
    zero would be a jump that needs a huge force; faded at both ends, because the transform is periodic."""
    rest, at = e.y - simulated, np.arange(len(e.time))
    for j, good in enumerate(e.good.T):
        rest[:, j] = np.interp(at, at[good], rest[good, j]) if good.any() else 0.0
    return rest * _weights(len(rest))[:, None]


def _weights(n: int, parts: int = 20) -> Array:
    """Weights [n]: 1 but for the first and the last of so many parts of a recording, where they fall to 0."""
    ramp = n // parts
    rise = 0.5 - 0.5 * np.cos(np.pi * (np.arange(ramp) + 0.5) / max(ramp, 1))
    return np.concatenate([rise, np.ones(n - 2 * ramp), rise[::-1]])


def _ends(q: Array) -> tuple[float, float]:
    """Between which nearly all values are; apart."""
    low, high = (float(x) for x in np.quantile(q, (0.001, 0.999)))
    return low, max(high, low + max(1e-12, 1e-9 * abs(low)))


def _located(linear: Linear, acting: Sequence[int], rounding: float = 1e-6) -> list[bool]:
    """Do the sensors determine the deflection at each place? Not if bodies can be moved without a change of rates and sensors, as a car on
    a floor of which the speed is measured."""
    seen = np.vstack([linear.a, linear.c[: linear.n_sensors]])
    if not seen.size:
        return [True] * len(acting)
    seen = seen / np.maximum(np.max(np.abs(seen), axis=1, keepdims=True), 1e-300)
    directions = np.linalg.svd(seen)[2][np.linalg.matrix_rank(seen, tol=rounding) :]
    moved = linear.c[linear.n_sensors :: 2] @ directions.T  # deflections of the places
    return [np.allclose(moved[p], 0.0, atol=rounding) for p in acting]


def surface_numbers(s: Surface) -> dict[str, Any]:
    """Forces over deflection and rate, where they are most wrong, and by how much."""
    gap = s.grid(s.measured - s.nominal)
    found: dict[str, Any] = {
        "place": s.place,
        "elements": list(s.elements),
        "unit": s.unit("N"),
        "force_rms": short(rms(s.nominal - np.mean(s.nominal))),
        "before_rms": short(rms(s.measured - s.nominal)),
    }
    if s.extended is not None:
        found["after_rms"] = short(rms(s.measured - s.extended))
    if np.isfinite(gap).any():
        i, j = np.unravel_index(np.nanargmax(s.count() * gap**2), gap.shape)
        middle = [0.5 * (e[k] + e[k + 1]) for e, k in zip(s.edges, (i, j), strict=True)]
        found["worst"] = {"deflection": short(middle[0]), "rate": short(middle[1]), "missing": short(gap[i, j])}
    forces = {"measured": s.measured, "nominal": s.nominal} | ({} if s.extended is None else {"extended": s.extended})
    grids = {name: short(s.grid(values)) for name, values in forces.items()}
    found["grid"] = {"deflection": short(s.edges[0]), "rate": short(s.edges[1]), "samples": s.count().tolist(), **grids}
    return found


def cells(x: Array, edges: Array) -> NDArray[np.int64]:
    """Number of the bin of each value; those outside count to the last one."""
    return np.clip(np.searchsorted(edges, x, "right") - 1, 0, len(edges) - 2)


def averages(values: Array, rows: NDArray[np.int64], columns: NDArray[np.int64], shape: tuple[int, int]) -> Array:
    """Means of values [n] by row and column; NaN where fewer than LEAST are."""
    flat, n = np.ravel_multi_index((rows, columns), shape), shape[0] * shape[1]
    count = np.bincount(flat, minlength=n)
    total = np.bincount(flat, values, minlength=n)
    return np.where(count >= LEAST, total / np.maximum(count, 1), np.nan).reshape(shape)


def rms(values: Array) -> float:
    """Root mean square; 0 of nothing."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def short(value: Any) -> Any:
    """Numbers of five digits, for a file; None for NaN."""
    if isinstance(value, np.ndarray):
        return [short(x) for x in value]
    return float(f"{value:.5g}") if np.isfinite(value) else None
