# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Forces of elements with memory: hysteresis and relaxation; and those of a tyre."""

from collections.abc import Callable
from functools import partial

import numpy as np

from .effects import Build, Change, Place, Rng, forms, logarithmic, of_deflection, one_of, soft
from .forces import bristle, progressive, sliders, symmetric
from .solver import Kind

# -- memory: hysteresis of the amplitude, relaxation of the rate -----------------------------------------------------------------


def loop(r: Rng, at: Place, yields: float, exponent: float, share: float) -> Build:
    return bristle(at, yields * at.s, exponent, share, yield_deflection=yields * at.s)


def relaxation(r: Rng, at: Place) -> float:
    """A time constant [s] that the excitation can show."""
    return 1 / (2 * np.pi * at.centre * logarithmic(r, 0.4, 4.0))


def branches(at: Place, seconds: np.ndarray, share: np.ndarray, bend: float = 0.0) -> Build:
    """Springs in series with dampers, side by side; `bend`: what the springs stiffen at the peak deflection."""

    def build(size: float) -> Change:
        truth = {"stiffness": size * at.stiffness, **({"relaxation_time": float(seconds[0])} if len(seconds) == 1 else {})}

        def curve(s, k):
            return k * s * (1 + bend * np.minimum((s / at.s) ** 2, 10))

        k = size * at.stiffness * share
        return Change(truth, {f"hidden {i}": at.law(Kind.SERIES, k[i] * t, curve=partial(curve, k=k[i])) for i, t in enumerate(seconds)})

    return build


def several(r: Rng, at: Place) -> Build:
    n = int(r.integers(2, 4))
    return branches(at, relaxation(r, at) * np.geomspace(0.3, 3, n), r.dirichlet(np.full(n, 4.0)))


def fractional_like(r: Rng, at: Place) -> Build:
    seconds = np.geomspace(0.03, 3, 7) / (2 * np.pi * at.centre)
    share = seconds ** -r.uniform(0.2, 0.5)
    return branches(at, seconds, share / share.sum())


def top_mount(r: Rng, at: Place) -> Build:
    """The mount in series with the damper yields; size: by how much, over the damper."""

    def build(size: float) -> Change:
        seconds = size / (2 * np.pi * at.centre)
        mount = at.law(Kind.SERIES, at.damping, curve=lambda s: at.damping / seconds * s)
        return Change({"stiffness": at.damping / seconds, "relaxation_time": seconds}, {"damper": mount})

    return build


forms(
    "bouc_wen",
    "spring",
    (0.004, 0.4),
    "bouc_wen",
    bouc_wen=lambda r, at: loop(r, at, r.uniform(0.06, 0.35), r.uniform(1, 2.5), r.uniform(0.5, 0.8)),
    wide_dahl=lambda r, at: loop(r, at, r.uniform(0.1, 0.4), r.uniform(0.6, 1.8), 1.0),
    one_slider=lambda r, at: sliders(at, at.s * r.uniform(0.08, 0.4, 1), np.ones(1)),
    many_sliders=lambda r, at: sliders(at, at.s * np.geomspace(0.05, r.uniform(0.4, 0.9), 6), r.dirichlet(np.full(6, 4.0))),
)
forms(
    "maxwell_bushing",
    "spring",
    (0.01, 0.8),
    "one_branch",
    one_branch=lambda r, at: branches(at, np.array([relaxation(r, at)]), np.ones(1)),
    several_branches=several,
    fractional_like=fractional_like,
    top_mount=top_mount,
    stiffening_rubber=lambda r, at: branches(at, np.array([relaxation(r, at)]), np.ones(1), bend=r.uniform(0.3, 1.5)),
)


# -- tyre --------------------------------------------------------------------------------------------------------------------------


def lift(at: Place, lost: Callable[[np.ndarray, float], np.ndarray]) -> Build:
    """The contact pulls no more than the static load (less at the inner wheel of a curve); `lost`(what is too much, load)."""

    def build(size: float) -> Change:
        load = at.high * at.stiffness * (1 - size)
        return Change({"preload": load}, {"hidden": at.law(Kind.DEFLECTION_CURVE, curve=lambda s: -lost(s * at.stiffness - load, load))})

    return build


def power_lost(over: np.ndarray, load: float, p: float) -> np.ndarray:
    """Contact load (1 - u)^p of the deflection u over the static one, instead of a linear one that pulls."""
    x = 1 + over / load
    return load * (x - 1 + np.maximum(1 - x / p, 0) ** p)


def power_contact(r: Rng, at: Place) -> Build:
    def build(size: float) -> Change:
        p, depth = 1 + size, max(1.6 * at.s, 1.1 * at.high) * (1 + size)  # m, at which the contact would be lost; the motion stays below

        def total(s):
            return at.stiffness * depth / p * (1 - np.maximum(1 - s / depth, 0) ** p)

        return Change({"exponent": p}, {"hidden": at.law(Kind.DEFLECTION_CURVE, curve=lambda s: total(s) - at.stiffness * s)})

    return build


def tyre_loss(at: Place, seconds: float = 0.0) -> Build:
    """Viscous, or with a lag."""

    def build(size: float) -> Change:
        d = size * at.force / at.v
        law = at.law(Kind.SERIES, d, curve=lambda s: d / seconds * s) if seconds else at.law(Kind.LINEAR, 0.0, d)
        return Change({"damping": d}, {"hidden": law})

    return build


forms(
    "tyre_liftoff",
    "tyre",
    (0.02, 0.6),
    "contact_lost",
    contact_lost=lambda r, at: lift(at, lambda over, load: np.maximum(over, 0)),
    rounded_contact=lambda r, at: lift(
        at, partial(lambda over, load, w: soft(over, w * load) - soft(-load, w * load), w=r.uniform(0.05, 0.2))
    ),
    tread_that_follows=lambda r, at: lift(
        at, partial(lambda over, load, kept: (1 - kept) * np.maximum(over, 0), kept=r.uniform(0.02, 0.12))
    ),
    power_contact_lost=lambda r, at: lift(at, partial(lambda over, load, p: power_lost(over, load, p), p=r.uniform(1.01, 1.04))),
)
forms(
    "tyre_damping",
    "tyre",
    (0.001, 0.15),
    "viscous",
    viscous=lambda r, at: tyre_loss(at),
    carcass_with_lag=lambda r, at: tyre_loss(at, r.uniform(3e-4, 1.5e-3)),
    power_of_rate=lambda r, at: progressive(at, partial(lambda x, p: x**p, p=one_of(r, (0.65, 0.85), (1.15, 1.4)))),
    falling_with_rate=lambda r, at: progressive(at, partial(lambda x, knee: x / (1 + x / knee) * (1 + 1 / knee), knee=r.uniform(0.3, 1.0))),
)
forms(
    "tyre_nonlinear",
    "tyre",
    (0.01, 0.5),
    "stiffer_when_pressed",
    stiffer_when_pressed=lambda r, at: (
        lambda size: of_deflection(at, -size, lambda x: np.clip(x, -3, 3) ** 2, quadratic=size * at.force / at.s**2)
    ),
    cubic_tyre=lambda r, at: symmetric(at, lambda x: x**3),
    power_contact=power_contact,
    rim_gets_near=lambda r, at: partial(
        lambda size, knee, w: of_deflection(at, -size, lambda x: soft(-x - knee, w) - soft(-knee, w), force_at_peak=size * at.force),
        knee=r.uniform(0.1, 0.4),
        w=r.uniform(0.05, 0.2),
    ),
)
