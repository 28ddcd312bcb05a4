# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Dampers that are no straight lines: other to one side, bent, weaker with time."""

from collections.abc import Iterable
from dataclasses import replace
from itertools import product

import numpy as np

from penode_gen.model import GROUND, Model

from ..plant.plant import Place
from . import friction, powers
from .form import Form, Motion, Part, Sizes

KINDS = ("asymmetric_damper", "degressive_damper", "quadratic_damper", "damper_fading")
MEANING = {
    "asymmetric_damper": "A damper with different damping in rebound and in compression.",
    "degressive_damper": "A damper whose damping falls at higher rates.",
    "quadratic_damper": "A damper whose damping grows with the rate.",
    "damper_fading": "A damper that loses damping in the course of the recording, with time or with the heat of its own work.",
}
PARAMETERS = {  # what each number of a report means
    "asymmetric_damper": {
        "rebound": "slope of the whole damper in rebound",
        "compression": "slope of the whole damper in compression",
        "quadratic": "extra force quadratic v^2",
    },
    "degressive_damper": {
        "knee": "rate of the bend",
        "low_rate_damping": "slope of the whole damper below the knee",
        "high_rate_damping": "slope of the whole damper above the knee",
        "coefficient": "extra force coefficient v abs(v)",
        "force_at_reach": "extra force at the greatest rate",
    },
    "quadratic_damper": {"coefficient": "extra force coefficient v abs(v)", "force_at_reach": "extra force at the greatest rate"},
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
FALLING = "with the square of the rate"
CORNER = "-damping*(max(v - knee, 0) + min(v + knee, 0))"  # two slopes, as of a valve that opens at the knee
WORKS = (0.25, 25.0)  # of the work of the rms rate in a recording: heat that warms a damper as far as it gets
COOLINGS, QUICKEST = (0.2, 1.0), 0.03  # of a recording: times in which a damper cools
LAST, AT_REST = 100, 1e-3  # the part of a recording that is its end; of the rms rate: what is slower does not show a damping
KNEES = (0.3, 1.0)  # of the rms rate; fitted down to friction.WIDEST, where the transition of a friction ends


def forms(model: Model, index: int, place: Place, motion: Motion) -> Iterable[Form]:
    """See Kind."""
    if place.role == "body" and GROUND in place.ends:
        yield Form(KINDS[2], place.loss, "force", index, (Part("quadratic_damper", ("coefficient", "N*s^2/m^2"), {}, 1),))
        return
    if place.role != "force":
        return
    yield Form(KINDS[0], place.loss, "force", index, (Part("rebound_damper", ("damping", "N*s/m")),))
    yield Form(KINDS[0], place.loss, "force", index, (Part("quadratic*v^2", ("quadratic", "N*s^2/m^2")),), "bent")
    for share in KNEES:
        bent = Part("degressive_damper", ("damping", "N*s/m"), {"knee": (share * motion.v_rms, "m/s")}, 1, span=share / friction.WIDEST)
        yield Form(KINDS[1], place.loss, "force", index, (bent,))
        yield Form(KINDS[1], place.loss, "force", index, (replace(bent, law=CORNER),), "with a corner")
    for kind, sign, note in ((KINDS[2], 1, ""), (KINDS[1], -1, FALLING)):
        yield Form(kind, place.loss, "force", index, (Part("quadratic_damper", ("coefficient", "N*s^2/m^2"), {}, sign),), note)
        yield Form(kind, place.loss, "force", index, (powers.odd("v", (motion.v_reach, "m/s"), 2.5, sign),), powers.NOTE)
    for part in _fading(motion):
        yield Form(KINDS[3], place.loss, "force", index, (part,))


def _fading(motion: Motion) -> Iterable[Part]:
    """With time, and by its heat, which ends at what the rms rate builds up in a quarter of a recording, or does not end. Cooling starts
    at some COOLINGS of a recording, and takes QUICKEST at least: where it takes no longer than a stroke, the curve is that of a degressive
    damper."""
    gain = ("damping", "N*s/m")
    yield Part("fading_damper", gain, {"time": (0.5 * motion.longest, "s")}, -1)
    for works, share in product(WORKS, COOLINGS):
        work = (works * motion.v_rms**2 * motion.longest, "m^2/s")
        shapes = {"work": work, "cooling": (share * motion.longest, "s")}
        yield Part("heating_damper", gain, shapes, -1, span=share / QUICKEST, later={"work": 100.0})


def sizes(form: Form, v: Sizes) -> dict[str, tuple[str, float]]:
    """See Kind."""
    own = v.nominal("linear_damper", "damping")
    if form.note == powers.NOTE:
        return {"force_at_reach": ("N", v(0, "force"))}
    if form.note == FALLING:
        return {"coefficient": ("N*s^2/m^2", v(0, "coefficient"))}
    match form.kind:
        case "asymmetric_damper" if form.note:
            return {"quadratic": ("N*s^2/m^2", v(0, "quadratic"))}
        case "asymmetric_damper":
            return {"rebound": ("N*s/m", own + v(0, "damping")), "compression": ("N*s/m", own)}
        case "degressive_damper":
            slopes = {"low_rate_damping": ("N*s/m", own), "high_rate_damping": ("N*s/m", own - v(0, "damping"))}
            return {"knee": ("m/s", v(0, "knee")), **slopes}
        case "quadratic_damper":
            return {"coefficient": ("N*s^2/m^2", v(0, "coefficient"))}
    return {"loss": ("1", -v(0, "damping") * _lost(form.parts[0], v) / own if own else 1.0)}


def _lost(part: Part, v: Sizes) -> float:
    """Share of the gain of a law that acts at the end of the first recording: of a motion that has come to rest, before that."""
    if v.first is None:
        return 1.0
    fitted = replace(part, shapes={name: (v(0, name), unit) for name, (_, unit) in part.shapes.items()})
    moved = v.first.whole()
    end = 1 + int(np.flatnonzero(np.abs(moved.v) >= AT_REST * np.std(moved.v))[-1])
    last = slice(max(0, end - max(len(moved.v) // LAST, 1)), end)
    rate, force = moved.v[last], fitted.along(moved)[last]
    return float(rate @ force / (rate @ rate))
