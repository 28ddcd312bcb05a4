# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Dry friction: of Coulomb, with a constant force beside it or a peak at low rates, and with memory of the way."""

from collections.abc import Iterable
from dataclasses import replace

from penode_gen.model import GROUND, Model

from ..hypotheses import slips
from ..plant import Place
from . import loads
from .form import Form, Motion, Moved, Part, Sizes

KINDS = ("coulomb_friction", "stribeck_friction", "bouc_wen")
REVERSING = KINDS[2:]
MEANING = {
    "coulomb_friction": "Friction: a force against the motion that hardly depends on how fast it is.",
    "stribeck_friction": "Friction that is larger at the lowest rates than at higher ones; it makes the element stick.",
    "bouc_wen": "Hysteresis: the force depends on the way since the last reversal, elastic at first, then yielding.",
}
RIVALS = {
    ("coulomb_friction", "stribeck_friction"): "slow motion with many reversals, and fast motion too: the lowest rates tell",
    (
        "coulomb_friction",
        "bouc_wen",
    ): "small strokes as well as large ones: before it slides, a Bouc-Wen element acts as a spring, Coulomb friction does not",
}
ONE = True  # friction at a place is one curve, with a peak or with memory
EDGES, SPAN = (
    (0.04, 0.12),
    2.0,
)  # of the rms rate: transitions of a friction, within that factor; smooth enough for Gauss-Newton, steep enough for any motion
WIDEST = EDGES[-1] * SPAN  # what bends slower is a damper
PEAKS = (0.1, 0.4)  # of the rms rate: where a friction has fallen from its breakaway
WAYS = (0.06, 0.25, 0.8)  # of the rms deflection: how far a hysteresis is bent before it slides


def coulomb(motion: Motion, edge: float) -> Part:
    return Part("coulomb_friction", ("force", "N"), {"transition": (edge * motion.v_rms, "m/s")}, 1, span=SPAN, edge="transition")


def forms(model: Model, index: int, place: Place, motion: Motion) -> Iterable[Form]:
    """See Kind."""
    if place.role == "tyre":
        return
    grounded = place.role == "body" or GROUND in place.ends
    for edge in EDGES:
        slides = coulomb(motion, edge)
        yield Form(KINDS[0], place.name, "force", index, (slides,))
        if grounded:
            yield Form(KINDS[0], place.name, "force", index, (slides, replace(loads.constant(), kind=loads.KINDS[0])), "with a constant")
        for share in PEAKS if place.role != "body" else ():
            peak = Part("2.3316439815971242*rise*exp(-(v/width)^2)*v/width", ("rise", "N"), {"width": (share * motion.v_rms, "m/s")}, 1)
            yield Form(KINDS[1], place.name, "force", index, (slides, peak))
    if place.role == "body":
        return
    for share in WAYS:
        way = share * motion.s_rms
        yield Form(KINDS[2], place.name, "force", index, (Part("bouc_wen", ("force", "N"), {"presliding": (way, "m")}, 1, (), _slip),))


def _slip(m: Moved, presliding: float):
    return slips(m.s, [presliding])[0]


def sizes(form: Form, v: Sizes) -> dict[str, tuple[str, float]]:
    """See Kind."""
    if form.kind == KINDS[1]:
        return {"breakaway": ("N", v(0, "force") + v(1, "rise")), "coulomb": ("N", v(0, "force")), "stribeck_rate": ("m/s", v(1, "width"))}
    if form.kind == KINDS[2]:
        return {"force": ("N", v(0, "force")), "yield_deflection": ("m", v(0, "presliding"))}
    return {"force": ("N", v(0, "force"))}
