# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Forces of elements: friction, springs, dampers, hysteresis and relaxation, tyre."""

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
        laws = {f"hidden {i}": at.law(Kind.SLIDER, level * f / q, q) for i, (q, f) in enumerate(zip(yields, share))}
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
    smooth_sign=lambda r, at: friction(at, lambda x, w=transition(r, at): np.tanh(x / w)),
    arctangent=lambda r, at: friction(at, lambda x, w=transition(r, at): 2 / np.pi * np.arctan(x / w)),
    growing_with_rate=lambda r, at: friction(
        at,
        lambda x, w=transition(r, at), g=r.uniform(0.1, 0.3), v=r.uniform(0.05, 0.2): (
            np.tanh(x / w) * (1 + g * np.log1p(np.abs(x) / v) / np.log1p(1 / v)) / (1 + g)
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
    exponential_fall=lambda r, at: stribeck(r, at, lambda u, p=r.uniform(0.6, 1.2): np.exp(-(u**p))),
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
    other_power=lambda r, at: symmetric(at, lambda x, p=one_of(r, (2.0, 2.6), (3.5, 5.0)): x**p),
    hyperbolic=lambda r, at: symmetric(at, lambda x, a=r.uniform(1.5, 3.0): (np.sinh(np.minimum(a * x, 12)) - a * x) / (np.sinh(a) - a)),
    softening=lambda r, at: symmetric(at, lambda x, a=r.uniform(1.0, 2.5): (np.tanh(a * x) - a * x) / a, most=0.6),
    hardening_that_ends=lambda r, at: symmetric(at, lambda x, a=r.uniform(0.5, 1.2): x**3 * (1 + a**2) / (1 + (a * x) ** 2)),
)
forms(
    "asymmetric_spring",
    "spring",
    (0.008, 0.5),
    "two_stiffnesses",
    two_stiffnesses=two_stiffnesses,
    square=lambda r, at: one_sided(r, at, lambda x: np.clip(x, -3, 3) ** 2),
    exponential_side=lambda r, at: one_sided(
        r, at, lambda x, a=r.uniform(0.8, 2.0): (np.exp(np.clip(-a * x, -20, 6)) - 1 + a * x) / (np.exp(a) - 1 - a)
    ),
    wide_transition=lambda r, at: one_sided(
        r, at, lambda x, a=r.uniform(2, 6): np.log(np.cosh(np.clip(a * x, -300, 300))) / np.log(np.cosh(a))
    ),
)
forms(
    "bump_stop",
    "spring",
    (0.1, 20.0),
    "linear_stop",
    linear_stop=lambda r, at: stop(r, at, lambda u: u),
    power_stop=lambda r, at: stop(r, at, lambda u, p=r.uniform(1.3, 2.5): u**p),
    hertz_stop=lambda r, at: stop(r, at, lambda u: u**1.5, loss=r.uniform(0.1, 0.6)),
    progressive_rubber=lambda r, at: stop(r, at, lambda u, a=r.uniform(1.0, 2.5): np.expm1(np.minimum(a * u, 8)) / a),
    two_sided_stop=lambda r, at: stop(r, at, lambda u: u, both=True),
)
forms(
    "backlash",
    "spring",
    (0.004, 0.4),
    "dead_band",
    dead_band=lambda r, at: play(at, lambda u: np.clip(u, -1, 1)),
    soft_edges=lambda r, at: play(at, lambda u, p=r.uniform(2, 6): u / (1 + np.abs(u) ** p) ** (1 / p)),
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
    """Damping times kept(heat, size), the heat in units of what the linear damper makes in a recording."""
    cooling = logarithmic(r, 0.5, 5) * at.duration

    def build(size: float) -> Change:
        ratio = lambda heat: np.maximum(kept(np.maximum(heat, 0) / at.heat, size), 0.05)
        law = at.law(Kind.HEATED, at.damping, cooling, curve=ratio, scale=at.heat * 0.1, reach=at.heat * 20)
        return Change({}, {"damper": law}, memory=lambda q: {"loss": float(1 - ratio(np.array(q["damper"])))})

    return build


forms(
    "asymmetric_damper",
    "damper",
    (0.008, 0.6),
    "two_dampings",
    two_dampings=two_dampings,
    other_power_each_side=lambda r, at: even(r, at, lambda x, p=one_of(r, (0.7, 0.9), (1.15, 1.6)): x**p),
    rounded_at_zero=lambda r, at: even(r, at, lambda x, w=r.uniform(0.05, 0.3): np.sqrt(x**2 + w**2) - w),
    valves_with_knees=lambda r, at: even(
        r, at, lambda x, knee=r.uniform(0.2, 0.5), last=r.uniform(0.4, 0.7): x - (1 - last) * np.maximum(x - knee, 0)
    ),
)
forms(
    "degressive_damper",
    "damper",
    (0.02, 0.9),
    "one_knee",
    one_knee=lambda r, at: degressive(
        r, at, r.uniform(0.12, 0.4), lambda x, k, w=r.uniform(0.005, 0.1): x - soft(x - k, w * k) + soft(-k, w * k)
    ),
    bench_record=bench_record,
    logarithmic=lambda r, at: degressive(r, at, r.uniform(0.05, 0.3), lambda x, k: k * np.log1p(x / k)),
    blow_off=lambda r, at: degressive(r, at, r.uniform(0.15, 0.4), lambda x, k, p=r.uniform(2, 8): x / (1 + (x / k) ** p) ** (1 / p)),
    root_like=lambda r, at: degressive(r, at, r.uniform(0.03, 0.15), lambda x, k, p=r.uniform(0.5, 0.75): k / p * ((1 + x / k) ** p - 1)),
)
forms(
    "quadratic_damper",
    "damper",
    (0.01, 0.9),
    "rate_squared",
    rate_squared=lambda r, at: lambda size: of_rate(at, size, odd(np.square), coefficient=size * at.force / at.v**2),
    other_power=lambda r, at: progressive(at, lambda x, p=one_of(r, (1.5, 1.85), (2.2, 3.0)): x**p),
    late_turbulence=lambda r, at: progressive(at, lambda x, knee=r.uniform(0.1, 0.4): x**3 / (knee + x) * (1 + knee)),
    hyperbolic=lambda r, at: progressive(at, lambda x, a=r.uniform(1.5, 2.5): (np.sinh(np.minimum(a * x, 10)) - a * x) / (np.sinh(a) - a)),
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
        r, at, lambda u, size, mid=r.uniform(0.25, 0.5), w=r.uniform(0.05, 0.15): 1 - size / (1 + np.exp(-np.clip((u - mid) / w, -30, 30)))
    ),
)


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
        curve = lambda s, k: k * s * (1 + bend * np.minimum((s / at.s) ** 2, 10))
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
        total = lambda s: at.stiffness * depth / p * (1 - np.maximum(1 - s / depth, 0) ** p)
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
    rounded_contact=lambda r, at: lift(at, lambda over, load, w=r.uniform(0.05, 0.2): soft(over, w * load) - soft(-load, w * load)),
    tread_that_follows=lambda r, at: lift(at, lambda over, load, kept=r.uniform(0.02, 0.12): (1 - kept) * np.maximum(over, 0)),
    power_contact_lost=lambda r, at: lift(at, lambda over, load, p=r.uniform(1.01, 1.04): power_lost(over, load, p)),
)
forms(
    "tyre_damping",
    "tyre",
    (0.001, 0.15),
    "viscous",
    viscous=lambda r, at: tyre_loss(at),
    carcass_with_lag=lambda r, at: tyre_loss(at, r.uniform(3e-4, 1.5e-3)),
    power_of_rate=lambda r, at: progressive(at, lambda x, p=one_of(r, (0.65, 0.85), (1.15, 1.4)): x**p),
    falling_with_rate=lambda r, at: progressive(at, lambda x, knee=r.uniform(0.3, 1.0): x / (1 + x / knee) * (1 + 1 / knee)),
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
    rim_gets_near=lambda r, at: (
        lambda size, knee=r.uniform(0.1, 0.4), w=r.uniform(0.05, 0.2): of_deflection(
            at, -size, lambda x: soft(-x - knee, w) - soft(-knee, w), force_at_peak=size * at.force
        )
    ),
)
