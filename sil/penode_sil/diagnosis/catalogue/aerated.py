# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A damper that has lost oil: its piston meets gas after each reversal, and pulls only once that is pressed together."""

from collections.abc import Iterable

from penode_gen.model import Model

from ..plant.plant import Place
from .form import Form, Motion, Part, Sizes

KINDS = ("aerated_damper",)
MEANING = {"aerated_damper": "After each reversal no damping force acts over a part of the travel, as in a damper with gas in its oil."}
PARAMETERS = {  # what each number of a report means
    "aerated_damper": {"pocket": "travel from one end of the gas to the other, at the RMS rate"}
}
RIVALS = {
    (
        "aerated_damper",
        "backlash",
    ): "small strokes at low and at high frequency: gas loses more of the force at high frequency, a play does not",
    (
        "aerated_damper",
        "maxwell_bushing",
    ): "several amplitudes at one frequency: gas loses a smaller share of the force at large amplitudes, rubber the same share",
}
STRAIGHT = REVERSING = KINDS
POCKETS = (0.1, 0.3, 0.8)  # of the rms deflection


def forms(model: Model, index: int, place: Place, motion: Motion) -> Iterable[Form]:
    """See Kind. The gas is known by one number: `pocket` is how far the rms rate presses it."""
    if place.role != "force":
        return
    for share in POCKETS:
        shapes = {"pocket": (share * motion.s_rms, "m"), "rate": (motion.v_rms, "m/s")}
        yield Form(KINDS[0], place.loss, "force", index, (Part("aerated_damper", ("damping", "N*s/m"), shapes, 1, ("rate",)),))


def sizes(form: Form, v: Sizes) -> dict[str, tuple[str, float]]:
    """See Kind. From one end of the gas to the other."""
    return {"pocket": ("m", 2.0 * v(0, "pocket"))}
