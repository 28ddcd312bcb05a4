# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Springs that are no straight lines: bent, other to one side, with stops."""

from collections.abc import Iterable

from penode_gen.model import Model

from ..plant.plant import Place
from . import powers
from .form import Form, Motion, Part, Sizes

KINDS = ("cubic_spring", "asymmetric_spring", "bump_stop")
MEANING = {
    "cubic_spring": "A spring whose stiffness changes with deflection, alike on both sides.",
    "asymmetric_spring": "A spring that is stiffer on one side than on the other.",
    "bump_stop": "A stop: beyond a gap an extra spring comes into contact.",
}
PARAMETERS = {  # what each number of a report means
    "cubic_spring": {
        "cubic": "extra force cubic s^3",
        "bend": "extra force bend s abs(s)",
        "force_at_reach": "extra force at the greatest deflection",
    },
    "asymmetric_spring": {"difference": "stiffness in compression less that in rebound", "quadratic": "extra force quadratic s^2"},
    "bump_stop": {"gap": "travel to the contact, positive on either side", "stiffness": "in contact, in addition to the spring"},
}
RIVALS = {
    ("cubic_spring", "bump_stop"): "broadband excitation, which has small and large amplitudes, instead of a chirp of constant amplitude"
}
STRAIGHT = ("asymmetric_spring",)
GAPS = (0.5, 0.75)  # of the largest deflection
SPAN = 3.3  # a gap starts at 0.5 of the reach and is fitted down to 0.15: below that it is a spring with play


def forms(model: Model, index: int, place: Place, motion: Motion) -> Iterable[Form]:
    """See Kind."""
    if place.role != "force":
        return
    yield Form(KINDS[0], place.name, "force", index, (Part("cubic_spring", ("cubic", "N/m^3")),))
    yield Form(KINDS[0], place.name, "force", index, (Part("bend*s*abs(s)", ("bend", "N/m^2")),), "odd square")
    yield Form(KINDS[0], place.name, "force", index, (powers.odd("s", (motion.s_reach, "m"), 3.0),), powers.NOTE)
    yield Form(KINDS[1], place.name, "force", index, (Part("asymmetric_spring", ("stiffness", "N/m")),))
    yield Form(KINDS[1], place.name, "force", index, (Part("quadratic*s^2", ("quadratic", "N/m^2")),), "bent")
    for share in GAPS:
        gap = {"gap": (share * motion.s_reach, "m")}
        yield Form(
            KINDS[2],
            place.name,
            "force",
            index,
            (Part("stiffness*(max(s - gap, 0) + min(s + gap, 0))", ("stiffness", "N/m"), gap, 1, span=SPAN),),
        )
        yield Form(KINDS[2], place.name, "force", index, (Part("bump_stop", ("stiffness", "N/m"), gap, 1, span=SPAN),), "one side")
        yield Form(KINDS[2], place.name, "force", index, (Part("rebound_stop", ("stiffness", "N/m"), gap, 1, span=SPAN),), "the other side")


def sizes(form: Form, v: Sizes) -> dict[str, tuple[str, float]]:
    """See Kind."""
    if form.note == powers.NOTE:
        return {"force_at_reach": ("N", v(0, "force"))}
    if form.kind == KINDS[0]:
        return {"bend": ("N/m^2", v(0, "bend"))} if form.note else {"cubic": ("N/m^3", v(0, "cubic"))}
    if form.kind == KINDS[1]:
        return {"quadratic": ("N/m^2", v(0, "quadratic"))} if form.note else {"difference": ("N/m", -v(0, "stiffness"))}
    return {"gap": ("m", v(0, "gap")), "stiffness": ("N/m", v(0, "stiffness"))}
