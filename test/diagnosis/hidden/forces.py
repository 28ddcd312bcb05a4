# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Forces of elements that follow from deflection and rate: friction, springs, dampers."""

from collections.abc import Callable
from functools import partial

import numpy as np

from .effects import Build, Change, Place, Rng, forms, logarithmic, odd, of_deflection, of_rate, one_of, soft, way
from .solver import Curve, Kind

# -- friction: a force against the rate whose level does not grow with it --------------------------------------------------


def friction(at: Place, curve: Curve) -> Build:
    return lambda size: of_rate(at, size, curve, force=size * at.force)


def transition(r: Rng, at: Place) -> float:
    """Width of the step at zero, over the peak rate: 0.5 to 5 mm/s, less where all is slow."""
    return logarithmic(r, 5e-4, 5e-3) / max(at.v, 0.2)


def slip(r: Rng, at: Place) -> float:
    """Deflection [m] before dry friction slides: 20 to 150 um, more where 20 kHz could not follow the bristles."""
    return max(min(logarithmic(r, 2e-5, 1.5e-4), 0.01 * at.s), at.v / 8000)


def bristle(at: Place, yields: float, exponent: float, share: float, **truth: float) -> Build:
    """Loops of Dahl (share 1) or Bouc and Wen."""

    def build(size: float) -> Change:
        level = size * at.force
        return Change({"force": level, **truth}, {"hidden": at.law(Kind.BRISTLE, level / yields, yields, exponent, share)})

    return build


def sliders(at: Place, yields: np.ndarray, share: np.ndarray) -> Build:
    """Springs in series with dry friction, side by side."""

    def build(size: float) -> Change:
        level = size * at.force
        laws = {f"hidden {i}": at.law(Kind.SLIDER, level * f / q, q) for i, (q, f) in enumerate(zip(yields, share, strict=True))}
        return Change({"force": level, "yield_deflection": 1 / float(np.sum(share / yields))}, laws)

    return build


def lugre(at: Place, yields: float, fall: Curve, **more: float) -> Build:
    """Bristles whose level over the peak rate is `fall`; `more`: truths relative to the level."""

    def build(size: float) -> Change:
        level = size * at.force
        law = at.law(Kind.LUGRE, level / yields, level / yields * 3e-4, curve=lambda v: level * fall(np.abs(v) / at.v))
        return Change({k: x * level for k, x in more.items()}, {"hidden": law})

    return build


def stribeck(r: Rng, at: Place, fall: Callable[[np.ndarray], np.ndarray], bristles: bool = False) -> Build:
    ratio, knee = r.uniform(1.5, 2.6), logarithmic(r, 0.04, 0.2)
    level, width = (lambda x: 1 + (ratio - 1) * fall(x / knee)), knee / r.uniform(12, 30)
    if bristles:
        return lugre(at, slip(r, at), level, breakaway=ratio, coulomb=1.0)
    return lambda size: of_rate(
        at,
        size,
        lambda x: level(np.abs(x)) * np.tanh(x / width),
        breakaway=ratio * size * at.force,
        coulomb=size * at.force,
        stribeck_rate=knee * at.v,
    )


forms(
    "coulomb_friction",
    "damper",
    (0.004, 0.6),
    "smooth_sign",
    smooth_sign=lambda r, at: friction(at, partial(lambda x, w: np.tanh(x / w), w=transition(r, at))),
    arctangent=lambda r, at: friction(at, partial(lambda x, w: 2 / np.pi * np.arctan(x / w), w=transition(r, at))),
    growing_with_rate=lambda r, at: friction(
        at,
        partial(
            lambda x, w, g, v: np.tanh(x / w) * (1 + g * np.log1p(np.abs(x) / v) / np.log1p(1 / v)) / (1 + g),
            w=transition(r, at),
            g=r.uniform(0.1, 0.3),
            v=r.uniform(0.05, 0.2),
        ),
    ),
    dahl=lambda r, at: bristle(at, slip(r, at), r.uniform(0.5, 2), 1.0),
    lugre=lambda r, at: lugre(at, slip(r, at), np.ones_like, force=1.0),
    presliding=lambda r, at: sliders(at, slip(r, at) * np.array([0.4, 0.8, 1.6]), r.dirichlet([3, 3, 3])),
)
forms(
    "stribeck_friction",
    "damper",
    (0.006, 0.4),
    "gaussian_fall",
    gaussian_fall=lambda r, at: stribeck(r, at, lambda u: np.exp(-(u**2))),
    exponential_fall=lambda r, at: stribeck(r, at, partial(lambda u, p: np.exp(-(u**p)), p=r.uniform(0.6, 1.2))),
    rational_fall=lambda r, at: stribeck(r, at, lambda u: 1 / (1 + u**2)),
    lugre_fall=lambda r, at: stribeck(r, at, lambda u: np.exp(-(u**2)), bristles=True),
)


# -- springs: a force of the deflection alone --------------------------------------------------------------------------------


def symmetric(at: Place, curve: Curve, most: float = 1.0) -> Build:
    """`curve` of positive x, 1 at the peak."""
    return lambda size: of_deflection(at, min(size, most), odd(curve), force_at_peak=min(size, most) * at.force)


def cube(r: Rng, at: Place) -> Build:
    up = way(r, 0.75)
    return lambda size: of_deflection(at, max(up * size, -0.25), lambda x: x**3, cubic=max(up * size, -0.25) * at.force / at.s**3)


def two_stiffnesses(r: Rng, at: Place) -> Build:
    stiffer, w = way(r, 0.75), logarithmic(r, 1e-3, 0.03)  # 1: in compression
    return lambda size: of_deflection(at, stiffer * size, lambda x: -soft(-stiffer * x, w), difference=stiffer * size * at.stiffness)


def one_sided(r: Rng, at: Place, curve: Curve) -> Build:
    """A force that does not change its sign; stiffer in compression or in rebound."""
    side = way(r, 0.75)
    return lambda size: of_deflection(at, -side * size, lambda x: curve(side * x), force_at_peak=-side * size * at.force)


def stop(r: Rng, at: Place, curve: Curve, both: bool = False, loss: float = 0.0) -> Build:
    """A stop beyond a gap; `curve` of the depth over what is left of the travel, with slope 1 or so."""
    side = way(r, 0.3)  # -1: in compression
    reach, back = (at.high, -at.low) if side > 0 else (-at.low, at.high)
    gap, other = reach * r.uniform(0.4, 0.8), back * r.uniform(0.4, 0.8)
    rest = reach - gap

    def build(size: float) -> Change:
        stiffness = size * at.stiffness

        def force(s: np.ndarray) -> np.ndarray:
            push = curve(np.maximum(side * s - gap, 0) / rest) - both * curve(np.maximum(-side * s - other, 0) / rest)
            return side * stiffness * rest * push

        law = at.law(Kind.CONTACT, side * loss, curve=force) if loss else at.law(Kind.DEFLECTION_CURVE, curve=force)
        return Change({"gap": gap, "stiffness": stiffness}, {"hidden": law})

    return build


def play(at: Place, lost: Curve, kept: float = 0.0, offset: float = 0.0) -> Build:
    """A spring that does not act inside its play; `lost`: what of the deflection gets lost, in half plays."""

    def build(size: float) -> Change:
        law = at.law(
            Kind.DEFLECTION_CURVE,
            curve=lambda s: -(1 - kept) * at.stiffness * size * at.s * (lost(s / (size * at.s) - offset) - lost(np.array(-offset))),
        )
        return Change({"gap": 2 * size * at.s}, {"hidden": law})

    return build


def loose_damper_eye(r: Rng, at: Place) -> Build:
    stiff = at.damping / logarithmic(r, 5e-4, 2e-3)

    def build(size: float) -> Change:
        eye = at.law(Kind.SERIES, at.damping, curve=lambda s: stiff * odd(lambda x: np.maximum(x - size * at.s, 0))(s))
        return Change({"gap": 2 * size * at.s}, {"damper": eye})

    return build


forms(
    "cubic_spring",
    "spring",
    (0.005, 0.8),
    "cube",
    cube=cube,
    other_power=lambda r, at: symmetric(at, partial(lambda x, p: x**p, p=one_of(r, (2.0, 2.6), (3.5, 5.0)))),
    hyperbolic=lambda r, at: symmetric(
        at, partial(lambda x, a: (np.sinh(np.minimum(a * x, 12)) - a * x) / (np.sinh(a) - a), a=r.uniform(1.5, 3.0))
    ),
    softening=lambda r, at: symmetric(at, partial(lambda x, a: (np.tanh(a * x) - a * x) / a, a=r.uniform(1.0, 2.5)), most=0.6),
    hardening_that_ends=lambda r, at: symmetric(at, partial(lambda x, a: x**3 * (1 + a**2) / (1 + (a * x) ** 2), a=r.uniform(0.5, 1.2))),
)
forms(
    "asymmetric_spring",
    "spring",
    (0.008, 0.5),
    "two_stiffnesses",
    two_stiffnesses=two_stiffnesses,
    square=lambda r, at: one_sided(r, at, lambda x: np.clip(x, -3, 3) ** 2),
    exponential_side=lambda r, at: one_sided(
        r, at, partial(lambda x, a: (np.exp(np.clip(-a * x, -20, 6)) - 1 + a * x) / (np.exp(a) - 1 - a), a=r.uniform(0.8, 2.0))
    ),
    wide_transition=lambda r, at: one_sided(
        r, at, partial(lambda x, a: np.log(np.cosh(np.clip(a * x, -300, 300))) / np.log(np.cosh(a)), a=r.uniform(2, 6))
    ),
)
forms(
    "bump_stop",
    "spring",
    (0.1, 20.0),
    "linear_stop",
    linear_stop=lambda r, at: stop(r, at, lambda u: u),
    power_stop=lambda r, at: stop(r, at, partial(lambda u, p: u**p, p=r.uniform(1.3, 2.5))),
    hertz_stop=lambda r, at: stop(r, at, lambda u: u**1.5, loss=r.uniform(0.1, 0.6)),
    progressive_rubber=lambda r, at: stop(r, at, partial(lambda u, a: np.expm1(np.minimum(a * u, 8)) / a, a=r.uniform(1.0, 2.5))),
    two_sided_stop=lambda r, at: stop(r, at, lambda u: u, both=True),
)
forms(
    "backlash",
    "spring",
    (0.004, 0.4),
    "dead_band",
    dead_band=lambda r, at: play(at, lambda u: np.clip(u, -1, 1)),
    soft_edges=lambda r, at: play(at, partial(lambda u, p: u / (1 + np.abs(u) ** p) ** (1 / p), p=r.uniform(2, 6))),
    off_centre=lambda r, at: play(at, lambda u: np.clip(u, -1, 1), offset=r.uniform(-0.4, 0.4)),
    some_stiffness_kept=lambda r, at: play(at, lambda u: np.clip(u, -1, 1), kept=r.uniform(0.05, 0.25)),
    loose_damper_eye=loose_damper_eye,
)


# -- dampers: a force of the rate alone ----------------------------------------------------------------------------------------


def two_dampings(r: Rng, at: Place) -> Build:
    d, side = at.damping, way(r, 0.85)  # 1: more in rebound
    return lambda size: of_rate(at, side * size, np.abs, rebound=d * (1 + side * size), compression=d * (1 - side * size))


def even(r: Rng, at: Place, curve: Curve) -> Build:
    side = way(r, 0.85)
    return lambda size: of_rate(at, side * size, lambda x: curve(np.abs(x)), difference_at_peak=2 * side * size * at.force)


def degressive(r: Rng, at: Place, knee: float, curve: Callable[[np.ndarray, float], np.ndarray], last: float = 0.0) -> Build:
    """`curve`(x, knee) has slope 1 at 0 and `last` at the end; the size blends it with the linear damper."""
    lift, d = r.uniform(0, 0.4), at.damping
    return lambda size: of_rate(
        at,
        size,
        odd(lambda x: curve(x, knee) - (1 - lift) * x),
        knee=knee * at.v,
        low_rate_damping=d * (1 + size * lift),
        high_rate_damping=d * (1 + size * (lift + last - 1)),
    )


def bench_record(r: Rng, at: Place) -> Build:
    knees = np.array([r.uniform(0.06, 0.15), r.uniform(0.25, 0.4), r.uniform(0.5, 0.7)])
    bends = np.diff([1.0, r.uniform(0.45, 0.7), r.uniform(0.2, 0.35), r.uniform(0.05, 0.15)])
    return degressive(r, at, float(knees[1]), lambda x, k: x + (bends * np.maximum(x[..., None] - knees, 0)).sum(axis=-1), 1 + bends.sum())


def progressive(at: Place, curve: Curve) -> Build:
    return lambda size: of_rate(at, size, odd(curve), force_at_peak=size * at.force)


def fading(r: Rng, at: Place, kept: Callable[[np.ndarray, float], np.ndarray]) -> Build:
    """Damping times kept(heat, size), the heat in units of that of the linear damper in a recording."""
    cooling = logarithmic(r, 0.5, 5) * at.duration

    def build(size: float) -> Change:
        def ratio(heat):
            return np.maximum(kept(np.maximum(heat, 0) / at.heat, size), 0.05)

        law = at.law(Kind.HEATED, at.damping, cooling, curve=ratio, scale=at.heat * 0.1, reach=at.heat * 20)
        return Change({}, {"damper": law}, memory=lambda q: {"loss": float(1 - ratio(np.array(q["damper"])))})

    return build


forms(
    "asymmetric_damper",
    "damper",
    (0.008, 0.6),
    "two_dampings",
    two_dampings=two_dampings,
    other_power_each_side=lambda r, at: even(r, at, partial(lambda x, p: x**p, p=one_of(r, (0.7, 0.9), (1.15, 1.6)))),
    rounded_at_zero=lambda r, at: even(r, at, partial(lambda x, w: np.sqrt(x**2 + w**2) - w, w=r.uniform(0.05, 0.3))),
    valves_with_knees=lambda r, at: even(
        r, at, partial(lambda x, knee, last: x - (1 - last) * np.maximum(x - knee, 0), knee=r.uniform(0.2, 0.5), last=r.uniform(0.4, 0.7))
    ),
)
forms(
    "degressive_damper",
    "damper",
    (0.02, 0.9),
    "one_knee",
    one_knee=lambda r, at: degressive(
        r, at, r.uniform(0.12, 0.4), partial(lambda x, k, w: x - soft(x - k, w * k) + soft(-k, w * k), w=r.uniform(0.005, 0.1))
    ),
    bench_record=bench_record,
    logarithmic=lambda r, at: degressive(r, at, r.uniform(0.05, 0.3), lambda x, k: k * np.log1p(x / k)),
    blow_off=lambda r, at: degressive(
        r, at, r.uniform(0.15, 0.4), partial(lambda x, k, p: x / (1 + (x / k) ** p) ** (1 / p), p=r.uniform(2, 8))
    ),
    root_like=lambda r, at: degressive(
        r, at, r.uniform(0.03, 0.15), partial(lambda x, k, p: k / p * ((1 + x / k) ** p - 1), p=r.uniform(0.5, 0.75))
    ),
)
forms(
    "quadratic_damper",
    "damper",
    (0.01, 0.9),
    "rate_squared",
    rate_squared=lambda r, at: lambda size: of_rate(at, size, odd(np.square), coefficient=size * at.force / at.v**2),
    other_power=lambda r, at: progressive(at, partial(lambda x, p: x**p, p=one_of(r, (1.5, 1.85), (2.2, 3.0)))),
    late_turbulence=lambda r, at: progressive(at, partial(lambda x, knee: x**3 / (knee + x) * (1 + knee), knee=r.uniform(0.1, 0.4))),
    hyperbolic=lambda r, at: progressive(
        at, partial(lambda x, a: (np.sinh(np.minimum(a * x, 10)) - a * x) / (np.sinh(a) - a), a=r.uniform(1.5, 2.5))
    ),
)
forms(
    "damper_fading",
    "damper",
    (0.02, 0.7),
    "in_proportion_to_heat",
    in_proportion_to_heat=lambda r, at: fading(r, at, lambda u, size: 1 - size * u),
    exponential_in_heat=lambda r, at: fading(r, at, lambda u, size: np.exp(-1.5 * size * u)),
    thin_oil=lambda r, at: fading(r, at, lambda u, size: 1 / (1 + 2 * size * u)),
    foaming=lambda r, at: fading(
        r,
        at,
        partial(
            lambda u, size, mid, w: 1 - size / (1 + np.exp(-np.clip((u - mid) / w, -30, 30))),
            mid=r.uniform(0.25, 0.5),
            w=r.uniform(0.05, 0.15),
        ),
    ),
)
