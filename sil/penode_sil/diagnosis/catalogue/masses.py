# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A mass that hangs on a body by rubber and is not in the model."""

from collections.abc import Iterable

import numpy as np

from penode_gen.model import GROUND, Model

from ..plant.plant import Place
from .form import Form, Motion, Part, Sizes

KINDS = ("hidden_resonance",)
MEANING = {"hidden_resonance": "A mass on a spring, attached to a body, that the model does not have."}
PARAMETERS = {  # what each number of a report means
    "hidden_resonance": {
        "mass": "of the hidden body",
        "frequency": "of the hidden body while its support is held still",
        "damping_ratio": "of the hidden body",
    }
}
RATIOS = (0.3, 0.45, 0.6, 0.8, 1.0, 1.25, 1.6, 2.2, 3.2, 5.0, 8.0, 13.0)  # of v_rms/s_rms, to which its frequency is tried
LOSS = 0.1  # damping ratio at first
SPAN = 0.5**0.5 / LOSS  # up to the ratio from which on there is no resonance


def forms(model: Model, index: int, place: Place, motion: Motion) -> Iterable[Form]:
    """See Kind."""
    bodies = [b.name for b in model.bodies if b.name in place.ends]
    if place.role != "body" and not (GROUND in place.ends and bodies):
        return
    for ratio in RATIOS:
        omega = ratio * motion.v_rms / motion.s_rms
        turn = omega * motion.parts[0].step / 0.21  # of a sample: a fit may make it 7 times as fast, and steps have to follow
        if turn > 1.0:
            break
        part = Part("tuned_mass", ("mass", "kg"), {"omega": (omega, "1/s"), "loss": (LOSS, "1")}, 1, span=SPAN)
        yield Form(KINDS[0], bodies[0] if bodies else place.name, "force", index, (part,))


def sizes(form: Form, v: Sizes) -> dict[str, tuple[str, float]]:
    """See Kind."""
    return {"mass": ("kg", v(0, "mass")), "frequency": ("Hz", v(0, "omega") / (2.0 * np.pi)), "damping_ratio": ("1", v(0, "loss"))}
