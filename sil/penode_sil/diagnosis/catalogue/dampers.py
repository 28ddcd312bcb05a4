# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Dampers that are no straight lines: other to one side, bent, weaker with time."""

from collections.abc import Callable, Iterable

import numpy as np

from penode_gen.model import GROUND, Model

from ..hypotheses import warm
from ..plant import Place
from . import friction
from .form import Array, Form, Motion, Moved, Part, Sizes

KINDS = ("asymmetric_damper", "degressive_damper", "quadratic_damper", "damper_fading")
MEANING = {
    "asymmetric_damper": "A damper with different damping in rebound and in compression.",
    "degressive_damper": "A damper whose damping falls at higher rates.",
    "quadratic_damper": "A damper whose damping grows with the rate.",
    "damper_fading": "A damper that loses damping in the course of the recording, with time or with the heat of its own work.",
}
PARAMETERS = {  # what each number of a report means
    "asymmetric_damper": {"rebound": "slope of the whole damper in rebound", "compression": "slope of the whole damper in compression"},
    "degressive_damper": {
        "knee": "rate of the bend",
        "low_rate_damping": "slope of the whole damper below the knee",
        "high_rate_damping": "slope of the whole damper above the knee",
    },
    "quadratic_damper": {"coefficient": "extra force coefficient v abs(v)"},
    "damper_fading": {"loss": "share of the damping that is lost at the end of the first training recording"},
}
RIVALS = {
    ("degressive_damper", "quadratic_damper"): "rates over more than a decade",
    (
        "degressive_damper",
        "wrong_parameter",
    ): "one excitation at two amplitudes: with other damping the force scales with the amplitude, with a bent curve it does not",
    (
        "quadratic_damper",
        "wrong_parameter",
    ): "one excitation at two amplitudes: with other damping the force scales with the amplitude, with a bent curve it does not",
    ("damper_fading", "wrong_parameter"): "the same excitation at the start and at the end of one long recording",
    ("damper_fading", "degressive_damper"): "the same excitation at the start and at the end of one recording, at two amplitudes",
}
STRAIGHT = ("asymmetric_damper", "degressive_damper")
KNEES = (0.3, 1.0)  # of the rms rate; fitted down to friction.WIDEST, where the transition of a friction ends


def forms(model: Model, index: int, place: Place, motion: Motion) -> Iterable[Form]:
    """See Kind."""
    if place.role == "body" and GROUND in place.ends:
        yield Form(KINDS[2], place.name, "force", index, (Part("quadratic_damper", ("coefficient", "N*s^2/m^2"), {}, 1),))
        return
    if place.role != "force":
        return
    yield Form(KINDS[0], place.name, "force", index, (Part("rebound_damper", ("damping", "N*s/m")),))
    for share in KNEES:
        bent = Part("degressive_damper", ("damping", "N*s/m"), {"knee": (share * motion.v_rms, "m/s")}, 1, span=share / friction.WIDEST)
        yield Form(KINDS[1], place.name, "force", index, (bent,))
    yield Form(KINDS[2], place.name, "force", index, (Part("quadratic_damper", ("coefficient", "N*s^2/m^2")),))
    for part in _fading(motion):
        yield Form(KINDS[3], place.name, "force", index, (part,))


def _fading(motion: Motion) -> Iterable[Part]:
    """With time, and by its heat, which the rms rate builds up in a quarter of a recording. Cooling starts at a tenth of a recording and at
    all of it, and fits meet halfway: where it takes no longer than a stroke, the curve is that of a degressive damper."""
    gain = ("damping", "N*s/m")
    yield Part("fading_damper", gain, {"time": (0.5 * motion.longest, "s")}, -1, (), _along(_faded))
    work = (0.25 * motion.v_rms**2 * motion.longest, "m^2/s")
    for share in (0.1, 1.0):
        shapes = {"work": work, "cooling": (share * motion.longest, "s")}
        yield Part("heating_damper", gain, shapes, -1, ("work",), _along(_warmed), span=10.0**0.5)


def _faded(m: Moved, time: float) -> Array:
    return 1.0 - np.exp(-m.t / time)


def _warmed(m: Moved, work: float, cooling: float) -> Array:
    return warm(m.v, m.t, work, cooling)


LOST = {"fading_damper": _faded, "heating_damper": _warmed}  # by law: share of its gain that acts by now


def _along(lost: Callable[..., Array]) -> Callable[..., Array]:
    """Force along a motion for gain 1, of a damper that has lost such a share of it by now."""
    return lambda m, **shapes: m.v * lost(m, **shapes)


def sizes(form: Form, v: Sizes) -> dict[str, tuple[str, float]]:
    """See Kind."""
    own = v.nominal("linear_damper", "damping")
    match form.kind:
        case "asymmetric_damper":
            return {"rebound": ("N*s/m", own + v(0, "damping")), "compression": ("N*s/m", own)}
        case "degressive_damper":
            slopes = {"low_rate_damping": ("N*s/m", own), "high_rate_damping": ("N*s/m", own - v(0, "damping"))}
            return {"knee": ("m/s", v(0, "knee")), **slopes}
        case "quadratic_damper":
            return {"coefficient": ("N*s^2/m^2", v(0, "coefficient"))}
    (part,) = form.parts
    end = LOST[part.law](v.first, **{name: v(0, name) for name in part.shapes})[-1] if v.first else 1.0
    return {"loss": ("1", -v(0, "damping") * float(end) / own if own else 1.0)}
