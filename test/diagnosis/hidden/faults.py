# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Wrong parameters, hidden masses, loads, and sensors that do not say what is."""

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy import signal as dsp

from .effects import Build, Change, Place, Rng, forms, logarithmic, pulling, rise, times, way
from .solver import RATE, Curve, Kind, Law

# -- parameters, absorbers, loads --------------------------------------------------------------------------------------------------


def another_value(r: Rng, at: Place) -> Build:
    name, up = at.where, way(r)

    def build(size: float) -> Change:
        factor = (1 + 2.5 * at.plant.tolerance[name] + size) ** up
        return Change({name: at.plant.true[name] * factor}, factor={name: factor})

    return build


def absorber(r: Rng, at: Place, laws: Callable[[float, float, float], dict[str, tuple]]) -> Build:
    """A small mass on the body; `laws`(mass, angular frequency, damping ratio) gives kind, parameters, curve of each law."""
    host = {"body": "m_b", "wheel": "m_w", "mass": "m"}[at.where]
    f, zeta = at.centre * logarithmic(r, 0.6, 4.0), r.uniform(0.02, 0.15)

    def build(size: float) -> Change:
        mass, new = size * at.plant.true[host], 2 if at.plant.kind == "quarter" else 1
        made = {
            f"hidden {i}": Law(kind, at.plant.body(at.where), new, p, *curve)
            for i, (kind, p, *curve) in enumerate(laws(mass, 2 * np.pi * f, zeta))
        }
        return Change({"frequency": f, "mass": mass, "damping_ratio": zeta}, made, (mass,))

    return build


def load(r: Rng, at: Place, of_time: Curve, settled: bool = False) -> Build:
    up = way(r)

    def build(size: float) -> Change:
        force = up * size * at.force
        return Change({"force": force}, pulling(at, force), auxiliary=lambda t, u: of_time(t), settled=force * settled)

    return build


def courses(r: Rng, at: Place) -> list[Build]:
    """Loads that have settled, that are put on at once, and within 0.1 s to 1 s."""
    smooth = [load(r, at, lambda t, seconds=seconds: rise(t, 0.2, seconds)) for seconds in np.arange(0.1, 1.01, 0.05)]
    return [load(r, at, np.ones_like, settled=True), load(r, at, lambda t: (t > 0).astype(float)), *smooth]


def going(r: Rng, at: Place, course: Curve) -> Build:
    """A load that has settled and changes from then on as the course does."""
    return load(r, at, lambda t: course(t) / course(t)[0], settled=True)


forms("wrong_parameter", "parameter", (0.01, 0.5), "another_value", another_value=another_value)
forms(
    "hidden_resonance",
    "body wheel mass",
    (0.005, 0.3),
    "absorber",
    absorber=lambda r, at: absorber(r, at, lambda m, w, zeta: [(Kind.LINEAR, (m * w**2, 2 * zeta * m * w))]),
    hardening_absorber=lambda r, at: absorber(
        r,
        at,
        partial(
            lambda m, w, zeta, bend: [
                (Kind.LINEAR, (0.0, 2 * zeta * m * w)),
                (Kind.DEFLECTION_CURVE, (), lambda s: m * w**2 * s * (1 + bend * np.minimum((s / at.s) ** 2, 10))),
            ],
            bend=r.uniform(0.1, 0.4),
        ),
    ),
    rubbing_absorber=lambda r, at: absorber(
        r,
        at,
        partial(
            lambda m, w, zeta, part, q: [(Kind.LINEAR, (m * w**2 * (1 - part), 2 * zeta * m * w)), (Kind.SLIDER, (m * w**2 * part, q))],
            part=r.uniform(0.1, 0.3),
            q=at.s * r.uniform(0.1, 0.5),
        ),
    ),
    absorber_of_rubber=lambda r, at: absorber(
        r,
        at,
        partial(
            lambda m, w, zeta, part: [
                (Kind.LINEAR, (m * w**2, zeta * m * w)),
                (Kind.SERIES, (m * w * part,), lambda s: m * w**2 * part * s),
            ],
            part=r.uniform(0.3, 0.8),
        ),
    ),
)
forms(
    "constant_force",
    "body mass motion",
    (0.004, 0.6),
    "settled_load",
    settled_load=lambda r, at: load(r, at, np.ones_like, settled=True),
    put_on_at_once=lambda r, at: load(r, at, lambda t: (t > 0).astype(float)),
    put_on_at_the_start=lambda r, at: load(r, at, partial(lambda t, seconds: rise(t, 0.2, seconds), seconds=r.uniform(0.1, 0.8))),
)


# -- sensors -----------------------------------------------------------------------------------------------------------------------

LONGEST = 0.012  # s, delay of size 1


def shifted(x: np.ndarray, rate: float, seconds: float | np.ndarray) -> np.ndarray:
    """x(t - seconds) by cubic interpolation; before the start the first value."""
    at = np.clip(np.arange(len(x)) - seconds * rate, 0, len(x) - 1.001)
    i = np.clip(at.astype(int), 1, len(x) - 3)
    u = at - i
    a, b, c, d = x[i - 1], x[i], x[i + 1], x[i + 2]
    return b + u * ((c - a) / 2 + u * (a - 2.5 * b + 2 * c - d / 2 + u * ((d - a) / 2 + 1.5 * (b - c))))


def bias(r: Rng, at: Place, shape: Curve) -> Build:
    """`shape` of time over duration."""
    up = way(r)

    def build(size: float) -> Change:
        level = up * size * at.peak
        return Change({"bias": level}, sensor={at.where: lambda x, _, rate: x + level * shape(times(x, rate) / at.duration)})

    return build


def scale(r: Rng, at: Place, shape: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Build:
    """`shape`(signal over peak, time over duration) times the size is what the gain is wrong by."""
    up = way(r)

    def build(size: float) -> Change:
        def seen(x, _, rate):
            return x * (1 + up * size * shape(x / at.peak, times(x, rate) / at.duration))

        return Change({"scale": 1 + up * size}, sensor={at.where: seen})

    return build


def delay(at: Place, late: Callable[[np.ndarray, Rng, float], np.ndarray]) -> Build:
    """`late`(signal, rng, seconds) at RATE."""
    return lambda size: Change({"delay": size * LONGEST}, sensor={at.where: lambda x, rng, _: late(x, rng, size * LONGEST)})


def lag(x: np.ndarray, _: Rng, seconds: float) -> np.ndarray:
    """First order, settled on the first value."""
    keep = np.exp(-1 / (RATE * seconds))
    half = 0.5 * (1 - keep)
    return dsp.lfilter([half, half], [1, -keep], x, zi=[x[0] * (keep + half)])[0]


def bessel(x: np.ndarray, _: Rng, seconds: float) -> np.ndarray:
    sos = dsp.bessel(2, 1 / (2 * np.pi * seconds), norm="delay", fs=RATE, output="sos")
    return dsp.sosfilt(sos, x, zi=dsp.sosfilt_zi(sos) * x[0])[0]


def jitter(x: np.ndarray, rng: Rng, seconds: float, share: float) -> np.ndarray:
    """A bus that is late by another time every 10 ms."""
    held = np.repeat(rng.uniform(1 - share, 1 + share, len(x) // 40 + 1), 40)[: len(x)]
    return shifted(x, RATE, seconds * held)


def clipped(at: Place, law: Callable[[np.ndarray, float], np.ndarray]) -> Build:
    return lambda size: Change({"limit": at.peak * (1 - size)}, late={at.where: lambda x, _, rate: law(x, at.peak * (1 - size))})


def dropouts(r: Rng, at: Place, fill: Callable[[np.ndarray, int, int, Rng], np.ndarray | float]) -> Build:
    """Bursts of 5 to 150 ms; fill(signal, first, last, rng) replaces the samples from first up to last."""
    mean = logarithmic(r, 0.01, 0.08)

    def build(size: float) -> Change:
        def holes(x: np.ndarray, rng: Rng, rate: float) -> np.ndarray:
            out = x.copy()
            for _ in range(max(1, round(size * len(x) / rate / mean))):
                n = int(np.clip(rng.exponential(mean), 0.005, 0.15) * rate)
                first = int(rng.integers(int(0.1 * len(x)), len(x) - n - 1))
                out[first : first + n] = fill(x, first, first + n, rng)
            return out

        return Change({"share": size}, late={at.where: holes})

    return build


forms(
    "sensor_bias",
    "sensor",
    (0.003, 0.5),
    "offset",
    offset=lambda r, at: bias(r, at, np.ones_like),
    warming_up=lambda r, at: bias(
        r, at, partial(lambda t, part, tau: 1 - part * np.exp(-t / tau), part=r.uniform(0.1, 0.4), tau=r.uniform(0.2, 1.0))
    ),
    wandering_zero=lambda r, at: bias(
        r, at, partial(lambda t, f, phi: 1 + 0.2 * np.sin(2 * np.pi * f * t + phi), f=r.uniform(0.3, 0.9), phi=r.uniform(0, 6.3))
    ),
)
forms(
    "sensor_scale",
    "sensor",
    (0.01, 0.4),
    "gain",
    gain=lambda r, at: scale(r, at, lambda x, t: np.ones_like(x)),
    gain_that_bends=lambda r, at: scale(r, at, partial(lambda x, t, bend: 1 + bend * np.minimum(np.abs(x), 2), bend=r.uniform(-0.3, 0.3))),
    gain_that_drifts=lambda r, at: scale(r, at, partial(lambda x, t, drift: 1 + drift * (t - 0.5), drift=r.uniform(-0.3, 0.3))),
    gain_of_each_side=lambda r, at: scale(r, at, partial(lambda x, t, other: np.where(x > 0, 1.0, other), other=r.uniform(0.5, 0.8))),
)
forms(
    "sensor_delay",
    "sensor",
    (0.01, 1.0),
    "pure_delay",
    pure_delay=lambda r, at: delay(at, lambda x, _, seconds: shifted(x, RATE, seconds)),
    first_order_lag=lambda r, at: delay(at, lag),
    bessel_filter=lambda r, at: delay(at, bessel),
    bus_with_jitter=lambda r, at: delay(at, partial(jitter, share=r.uniform(0.05, 0.2))),
)
forms(
    "sensor_clipping",
    "sensor",
    (0.05, 0.8),
    "both_rails",
    both_rails=lambda r, at: clipped(at, lambda x, top: np.clip(x, -top, top)),
    soft_rails=lambda r, at: clipped(at, partial(lambda x, top, p: x / (1 + np.abs(x / top) ** p) ** (1 / p), p=r.uniform(4, 12))),
    one_rail=lambda r, at: clipped(at, partial(lambda x, top, up: np.minimum(up * x, top) * up, up=way(r))),
    unequal_rails=lambda r, at: clipped(at, partial(lambda x, top, other: np.clip(x, -top * other, top), other=r.uniform(0.6, 0.9))),
)
forms(
    "sensor_dropout",
    "sensor",
    (0.002, 0.1),
    "frozen zeros",
    frozen=lambda r, at: dropouts(r, at, lambda x, i, j, rng: x[i - 1]),
    zeros=lambda r, at: dropouts(r, at, lambda x, i, j, rng: 0.0),
    noise_bursts=lambda r, at: dropouts(r, at, lambda x, i, j, rng: rng.uniform(-1, 1, j - i) * at.peak),
    rail=lambda r, at: dropouts(r, at, partial(lambda x, i, j, rng, level: level * at.peak, level=way(r) * r.uniform(1.2, 2.5))),
    fading_to_zero=lambda r, at: dropouts(
        r, at, partial(lambda x, i, j, rng, k: x[i - 1] * np.exp(-np.arange(j - i) / k), k=r.uniform(5, 30))
    ),
)
