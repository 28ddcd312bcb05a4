# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Play in series with a spring, a damper, or friction."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from penode_gen.model import Model

from ..plant.plant import Place
from . import friction
from .form import Form, Motion, Part, Sizes

KINDS = ("backlash",)
MEANING = {"backlash": "Play: within a gap the element transmits no force."}
PARAMETERS = {  # what each number of a report means
    "backlash": {"gap": "the whole play, from contact to contact: twice the `gap` of the laws `backlash` and `loose_damper`"}
}
STRAIGHT = REVERSING = KINDS
HALVES = ("stiffness*(max(s - gap, 0) - max(s, 0))", "stiffness*(min(s + gap, 0) - min(s, 0))")
ASIDE = "off the middle"
GAPS = (0.015, 0.06, 0.25)  # of the rms deflection


def forms(model: Model, index: int, place: Place, motion: Motion) -> Iterable[Form]:
    """See Kind."""
    if place.role != "force":
        return
    for share in GAPS:
        gap = share * motion.s_rms
        yield Form(
            KINDS[0], place.name, "force", index, (Part("backlash", ("stiffness", "N/m"), {"gap": (gap, "m")}, 1, takes="linear_spring"),)
        )
        shapes = {"gap": (gap, "m"), "relaxation": (max(2e-3, 2.0 * motion.parts[0].step), "s")}
        loose = Part("loose_damper", ("damping", "N*s/m"), shapes, 1, takes="linear_damper")
        yield Form(KINDS[0], place.name, "force", index, (loose,), "of a damper")
    rubs = any({*e.ends} == {*place.ends} and ("friction" in e.law or e.law == "bouc_wen") for e in model.elements)
    if rubs and not model.bodies:  # a play shows in series with friction where no mass is in between
        for share in GAPS:
            way = share * motion.s_rms
            slack = Part("slack_friction", ("force", "N"), {"presliding": (way, "m")}, 1)
            yield Form(KINDS[0], place.name, "force", index, (slack,), "of a friction")


def aside(form: Form) -> Form | None:
    """A play of all of a spring that is not in the middle: what it takes to either side."""
    (part,) = form.parts if len(form.parts) == 1 else (None,)
    if part is None or part.own is None or form.note:
        return None
    return replace(form, parts=tuple(replace(part, law=law) for law in HALVES), note=ASIDE)


def fitted(form: Form, laws: Sequence[tuple[float, Part]], motion: Motion) -> str:
    """See Kind. A damper with hardly a play, beside the rms deflection of its contact, has an elastic mount (bushings) and no play."""
    shapes = laws[0][1].shapes
    contact = motion.v_rms * shapes["relaxation"][0] if "relaxation" in shapes else 0.0
    return "" if contact and shapes["gap"][0] < friction.LEAST * contact else form.kind


def sizes(form: Form, v: Sizes) -> dict[str, tuple[str, float]]:
    """See Kind. A hysteresis behind a play has no force for about 1.4 times its presliding after a reversal."""
    if form.note == ASIDE:
        return {"gap": ("m", v(0, "gap") + v(1, "gap"))}
    return {"gap": ("m", 1.4 * v(0, "presliding") if form.note == "of a friction" else 2.0 * v(0, "gap"))}
