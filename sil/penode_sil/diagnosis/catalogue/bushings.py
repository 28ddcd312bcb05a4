# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Rubber: a spring in series with a damper, parallel to the elements of the model."""

from collections.abc import Iterable

from penode_gen.model import Model

from ..plant.plant import Place
from .form import Form, Motion, Part, Sizes

KINDS = ("maxwell_bushing",)
MEANING = {"maxwell_bushing": "Relaxation: a spring and a damper in series, whose force decays when the motion stops."}
PARAMETERS = {  # what each number of a report means
    "maxwell_bushing": {"stiffness": "of the spring in series", "relaxation_time": "damping over stiffness of the series"}
}
RIVALS = {("bouc_wen", "maxwell_bushing"): "several amplitudes at one frequency: hysteresis changes with amplitude, relaxation does not"}
STRAIGHT = LIKE_MASSES = KINDS  # a spring and a damper in series: for motion that is slower, a damper and a mass
TIMES = (0.15, 0.6, 2.5)  # of s_rms/v_rms, which is the time of a radian


def forms(model: Model, index: int, place: Place, motion: Motion) -> Iterable[Form]:
    """See Kind."""
    if place.role != "force":
        return
    for share in TIMES:
        tau = share * motion.s_rms / motion.v_rms
        part = Part("maxwell_bushing", ("stiffness", "N/m"), {"relaxation": (tau, "s")}, 1)
        yield Form(KINDS[0], place.name, "force", index, (part,))
        mount = {"gap": (0.0, "m"), "relaxation": (tau, "s")}  # in series with a damper: a play without a gap
        part = Part("loose_damper", ("damping", "N*s/m"), mount, 1, ("gap",), 10.0, takes="linear_damper")
        yield Form(KINDS[0], place.name, "force", index, (part,), "of a damper")


def sizes(form: Form, v: Sizes) -> dict[str, tuple[str, float]]:
    """See Kind."""
    stiffness = v(0, "damping") / v(0, "relaxation") if form.note else v(0, "stiffness")
    return {"stiffness": ("N/m", stiffness), "relaxation_time": ("s", v(0, "relaxation"))}
