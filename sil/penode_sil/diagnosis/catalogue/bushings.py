# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Rubber: a spring in series with a damper, parallel to the elements of the model."""

from collections.abc import Iterable

from penode_gen.model import Model

from ..hypotheses import lag
from ..plant import Place
from .form import Form, Motion, Moved, Part, Sizes

KINDS = ("maxwell_bushing",)
MEANING = {"maxwell_bushing": "Relaxation: a spring and a damper in series, whose force decays when the motion stops."}
PARAMETERS = {  # what each number of a report means
    "maxwell_bushing": {"stiffness": "of the spring in series", "relaxation_time": "damping over stiffness of the series"}
}
RIVALS = {("bouc_wen", "maxwell_bushing"): "several amplitudes at one frequency: hysteresis changes with amplitude, relaxation does not"}
STRAIGHT = KINDS
TIMES = (0.15, 0.6, 2.5)  # of s_rms/v_rms, which is the time of a radian


def forms(model: Model, index: int, place: Place, motion: Motion) -> Iterable[Form]:
    """See Kind."""
    if place.role != "force":
        return
    for share in TIMES:
        tau = share * motion.s_rms / motion.v_rms
        part = Part("maxwell_bushing", ("stiffness", "N/m"), {"relaxation": (tau, "s")}, 1, (), _pull)
        yield Form(KINDS[0], place.name, "force", index, (part,))


def _pull(m: Moved, relaxation: float):
    return m.s - lag(m.s, relaxation, m.step)


def sizes(form: Form, v: Sizes) -> dict[str, tuple[str, float]]:
    """See Kind."""
    return {"stiffness": ("N/m", v(0, "stiffness")), "relaxation_time": ("s", v(0, "relaxation"))}
