# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A tyre that damps, that leaves the road, that is no straight line."""

from collections.abc import Iterable

import numpy as np

from penode_gen.model import Model

from ..plant.plant import Place
from .form import Form, Motion, Part, Sizes

KINDS = ("tyre_damping", "tyre_liftoff", "tyre_nonlinear")
MEANING = {
    "tyre_damping": "The tyre also damps.",
    "tyre_liftoff": "The tyre leaves the road: it cannot pull.",
    "tyre_nonlinear": "The tyre's stiffness changes with its load.",
}
PARAMETERS = {  # what each number of a report means
    "tyre_damping": {
        "damping": "of the tyre, at low rates",
        "knee": "rate at which it is half of that",
        "relaxation_time": "of its rubber",
    },
    "tyre_liftoff": {
        "preload": "load of the tyre at zero deflection, the most that it can lose",
        "stretch": "where it has lost half of its stiffness, if that goes gradually",
    },
    "tyre_nonlinear": {"quadratic": "extra load quadratic s^2 when pressed in by s"},
}
RIVALS = {
    ("tyre_nonlinear", "wrong_parameter"): "two amplitudes of a rough road, up to large tyre loads; no chirp",
    ("tyre_nonlinear", "tyre_liftoff"): "a rough road that unloads the tyre for moments, and a smooth one that does not",
}
STRAIGHT = ("tyre_nonlinear",)
ROUNDED = "-stiffness*(max(s - static, 0) + rounding*log(1 + exp(-abs(s - static)/rounding)))"
PRESSED = "quadratic*min(s, 0)^2"  # stretched, it has its own stiffness
SHARES = (0.3, 0.6)  # of the greatest stretch: where a tyre leaves the road


def forms(model: Model, index: int, place: Place, motion: Motion) -> Iterable[Form]:
    """See Kind."""
    if place.role != "tyre":
        return
    yield Form(KINDS[0], place.name, "force", index, (Part("linear_damper", ("damping", "N*s/m"), {}, 1),))
    falls = {"knee": (motion.v_rms, "m/s")}  # the loss of rubber grows less than with the rate
    yield Form(KINDS[0], place.name, "force", index, (Part("damping*v/(1 + abs(v)/knee)", ("damping", "N*s/m"), falls, 1),), "falling")
    behind = {"relaxation": (2.0 * motion.parts[0].step, "s")}
    yield Form(KINDS[0], place.name, "force", index, (Part("maxwell_bushing", ("stiffness", "N/m"), behind, 1),), "elastic")
    top = max(float(np.quantile(p.s, 0.9995)) for p in motion.parts)
    for share in SHARES if top > 0.0 else ():
        yield Form(
            KINDS[1], place.name, "force", index, (Part("liftoff", ("stiffness", "N/m"), {"static": (share * top, "m")}, 1, span=2.0),)
        )
        left = {"static": (share * top, "m"), "rounding": (0.1 * top, "m")}  # the contact patch gets smaller first
        yield Form(KINDS[1], place.name, "force", index, (Part(ROUNDED, ("stiffness", "N/m"), left, 1, span=2.0),), "rounded")
    for law, note in (("quadratic_spring", ""), (PRESSED, "where it is pressed in")):
        yield Form(KINDS[2], place.name, "force", index, (Part(law, ("quadratic", "N/m^2")),), note)


def sizes(form: Form, v: Sizes) -> dict[str, tuple[str, float]]:
    """See Kind. A tyre leaves the road where its own spring has lost its load, however much of that it is seen to lose."""
    if form.note == "rounded":
        return {"stretch": ("m", v(0, "static"))}
    if form.kind == KINDS[1]:
        return {"preload": ("N", (v.nominal("linear_spring", "stiffness") or v(0, "stiffness")) * v(0, "static"))}
    match form.note:
        case "falling":
            return {"damping": ("N*s/m", v(0, "damping")), "knee": ("m/s", v(0, "knee"))}
        case "elastic":
            return {"damping": ("N*s/m", v(0, "stiffness") * v(0, "relaxation")), "relaxation_time": ("s", v(0, "relaxation"))}
    return {"damping": ("N*s/m", v(0, "damping"))} if form.kind == KINDS[0] else {"quadratic": ("N/m^2", -v(0, "quadratic"))}
