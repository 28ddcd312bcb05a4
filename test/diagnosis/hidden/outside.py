# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a vehicle may do that is on no list."""

import numpy as np
from scipy import signal as dsp

from .effects import OUTSIDE, Build, Change, Place, Rng, forms, pulling, rise, times, way
from .solver import AUXILIARY, GROUND, Curve, Kind, Law


def driven(at: Place, of_time: Curve) -> Build:
    """An unmeasured force on a body."""
    return lambda size: Change({"amplitude": size * at.force}, pulling(at, size * at.force), auxiliary=lambda t, u: of_time(t))


def engine(r: Rng, at: Place) -> Build:
    f, swing, slow = r.uniform(11, 40), r.uniform(0, 0.15), r.uniform(0.02, 0.1)

    def phase(t):
        return 2 * np.pi * f * t - f * swing / slow * np.cos(2 * np.pi * slow * t)

    return driven(at, lambda t: np.sin(phase(t)) + 0.3 * np.sin(2 * phase(t)))


def random_in(band: tuple[float, float], seed: int, t: np.ndarray) -> np.ndarray:
    """Band-limited noise of RMS 1, another one for each length of recording."""
    sos = dsp.butter(2, band, "bandpass", fs=1 / (t[1] - t[0]), output="sos")
    w = dsp.sosfilt(sos, np.random.default_rng([seed, len(t)]).standard_normal(len(t) + 20000))[20000:]
    return w / w.std()


def gusts(r: Rng, at: Place) -> Build:
    band, seed = (0.1, r.uniform(0.8, 4)), int(r.integers(2**31))
    return driven(at, lambda t: 0.5 * random_in(band, seed, t))


def uneven_tyre(r: Rng, at: Place) -> Build:
    f, phase = r.uniform(3, 14), r.uniform(0, 2 * np.pi, 3)

    def turn(t, u):
        return sum(np.sin(2 * np.pi * f * k * t + phase[k - 1]) / k**2 for k in (1, 2, 3))

    return lambda size: Change({"amplitude": size * at.force}, {"hidden": Law(Kind.TRACK, 1, GROUND, (size * at.force,))}, auxiliary=turn)


def rocking_tyre(r: Rng, at: Place) -> Build:
    """The track under the tyre is not quite the one that was measured."""
    seed, band = int(r.integers(2**31)), (0.3, r.uniform(3, 12))
    return lambda size: Change({"share": size}, felt=lambda t, u: u + size * u.std() * random_in(band, seed, t) * np.clip(t, 0, 1))


def pitch(r: Rng, at: Place) -> Build:
    """The rear axle meets the same road later and moves the front through the body's inertia in pitch."""
    p, later, rear = at.plant.true, r.uniform(0.1, 0.4), r.uniform(0.8, 1.3)

    def build(size: float) -> Change:
        mass = np.diag([p["m_b"], p["m_w"], rear * p["m_b"], p["m_w"]])
        mass[0, 2] = mass[2, 0] = 0.35 * size * p["m_b"]  # dynamic index other than 1
        laws = {
            "rear": Law(Kind.LINEAR, 2, 3, (rear * p["c"], rear * p["d"])),
            "rear tyre": Law(Kind.LINEAR, 3, AUXILIARY, (p["c_t"], 0.0)),
        }

        def delayed(t, u):
            return np.interp(t - later, t, u)

        return Change({"coupling": 0.35 * size}, laws, (rear * p["m_b"], p["m_w"]), auxiliary=delayed, inverse=np.linalg.inv(mass))

    return build


def switching_damper(r: Rng, at: Place) -> Build:
    """Skyhook: more damping while the body moves as the damper does. Beside ground it always does: a bent curve, which is on the list."""
    d = at.damping
    return lambda size: Change({"on": d * (1 + size), "off": d * (1 - size)}, {"damper": at.law(Kind.SKYHOOK, d, size * d)})


def levelling_spring(r: Rng, at: Place) -> Build:
    start, seconds, up = r.uniform(0.3, 0.7) * at.duration, r.uniform(0.1, 1.0), way(r)
    return lambda size: Change(
        {"step": up * size * at.stiffness},
        {"hidden": at.law(Kind.TRACK_SPRING, up * size * at.stiffness)},
        auxiliary=lambda t, u: rise(t, start, seconds),
    )


def mains_hum(r: Rng, at: Place) -> Build:
    f, phase = r.choice([50.0, 60.0]) + r.uniform(-0.2, 0.2), r.uniform(0, 2 * np.pi)

    def hum(x, rate):
        return np.sin(2 * np.pi * f * times(x, rate) + phase)

    return lambda size: Change({"amplitude": size * at.peak}, sensor={at.where: lambda x, _, rate: x + size * at.peak * hum(x, rate)})


def clock_drift(r: Rng, at: Place) -> Build:
    up = way(r)

    def seen(x, rate, drift):
        return np.interp(times(x, rate) * (1 + drift), times(x, rate), x)

    return lambda size: Change({"drift": up * size * 4e-3}, sensor={"*": lambda x, _, rate: seen(x, rate, up * size * 4e-3)})


forms(OUTSIDE, "body mass motion", (0.01, 0.6), "", engine=engine)
forms(OUTSIDE, "body mass", (0.01, 0.6), "", gusts=gusts)
forms(OUTSIDE, "tyre", (0.01, 0.5), "", uneven_tyre=uneven_tyre, rocking_tyre=rocking_tyre)
forms(OUTSIDE, "body", (0.05, 1.0), "", pitch=pitch)
forms(OUTSIDE, "strut", (0.02, 0.8), "", switching_damper=switching_damper)
forms(OUTSIDE, "spring", (0.02, 0.4), "", levelling_spring=levelling_spring)
forms(OUTSIDE, "sensor", (0.003, 0.2), "", mains_hum=mains_hum)
forms(OUTSIDE, "clock", (0.01, 1.0), "", clock_drift=clock_drift)
