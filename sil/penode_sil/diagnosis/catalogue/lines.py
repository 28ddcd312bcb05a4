# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A spring or a damper, each a straight line, where the model has none."""

from collections.abc import Iterable

from penode_gen.model import Model

from ..plant.plant import Place
from .form import Form, Motion, Part, Sizes

KINDS = ("missing_damper", "missing_spring")
MEANING = {
    "missing_damper": "Damping in proportion to the rate, where the model has no damper.",
    "missing_spring": "A stiffness, where the model has no spring: a cable, a hose, a magnet.",
}
PARAMETERS = {  # what each number of a report means
    "missing_damper": {"damping": "of the missing damper"},
    "missing_spring": {"stiffness": "of the missing spring; below zero where a force drives away from the middle"},
}
RIVALS = {
    ("missing_damper", "coulomb_friction"): "let it swing or coast from a high rate to rest: friction ends the motion, damping does not",
    ("missing_damper", "quadratic_damper"): "one excitation at two amplitudes: linear damping scales with the amplitude",
    ("missing_spring", "constant_force"): "hold it at two positions: the force of a spring is another one",
}
LINES = {  # of a kind: its law, and the gain of that with its unit and sign
    "missing_damper": ("linear_damper", ("damping", "N*s/m"), 1),
    "missing_spring": ("linear_spring", ("stiffness", "N/m"), 0),
}


def forms(model: Model, index: int, place: Place, motion: Motion) -> Iterable[Form]:
    """See Kind."""
    for kind, (law, gain, sign) in LINES.items():
        if law in place.lacks:
            yield Form(kind, place.name, "force", index, (Part(law, gain, {}, sign),))


def sizes(form: Form, v: Sizes) -> dict[str, tuple[str, float]]:
    """See Kind."""
    _, (name, unit), _ = LINES[form.kind]
    return {name: (unit, v(0, name))}
