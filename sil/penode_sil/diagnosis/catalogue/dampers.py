# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Dampers that are no straight lines: other to one side, bent, weaker with time."""

from collections.abc import Iterable

import numpy as np

from penode_gen.model import GROUND, Model

from ..plant import Place
from . import friction
from .form import Form, Motion, Moved, Part, Sizes

KINDS = ("asymmetric_damper", "degressive_damper", "quadratic_damper", "damper_fading")
MEANING = {
    "asymmetric_damper": "A damper with different damping in rebound and in compression.",
    "degressive_damper": "A damper whose damping falls at higher rates.",
    "quadratic_damper": "A damper whose damping grows with the rate.",
    "damper_fading": "A damper that loses damping in the course of the recording, as it does when it heats up.",
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
    time = 0.5 * motion.longest
    faded = Part("fading_damper", ("damping", "N*s/m"), {"time": (time, "s")}, -1, (), _faded)
    yield Form(KINDS[3], place.name, "force", index, (faded,))


def _faded(m: Moved, time: float):
    return m.v * (1.0 - np.exp(-m.t / time))


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
    return {"loss": ("1", -v(0, "damping") * (1.0 - np.exp(-v.longest / v(0, "time"))) / own if own else 1.0)}
