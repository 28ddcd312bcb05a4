# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Play in series with a spring, a damper, or friction."""

from collections.abc import Iterable

from penode_gen.model import Model

from ..hypotheses import losses, slips
from ..plant import Place
from .form import Form, Motion, Moved, Part, Sizes

KINDS = ("backlash",)
MEANING = {"backlash": "Play: within a gap the element transmits no force."}
PARAMETERS = {  # what each number of a report means
    "backlash": {"gap": "the whole play, from contact to contact: twice the `gap` of the laws `backlash` and `loose_damper`"}
}
STRAIGHT = REVERSING = KINDS
GAPS = (0.05, 0.2, 0.6)  # of the rms deflection


def forms(model: Model, index: int, place: Place, motion: Motion) -> Iterable[Form]:
    """See Kind."""
    if place.role != "force":
        return
    for share in GAPS:
        gap = share * motion.s_rms
        yield Form(KINDS[0], place.name, "force", index, (Part("backlash", ("stiffness", "N/m"), {"gap": (gap, "m")}, 1),))
        shapes = {"gap": (gap, "m"), "relaxation": (max(2e-3, 2.0 * motion.parts[0].step), "s")}
        loose = Part("loose_damper", ("damping", "N*s/m"), shapes, 1, ("relaxation",), _loose)
        yield Form(KINDS[0], place.name, "force", index, (loose,), "of a damper")
    if not model.bodies:  # a play shows in series with friction where no mass is in between
        for share in GAPS:
            way = share * motion.s_rms
            slack = Part("slack_friction", ("force", "N"), {"presliding": (way, "m")}, 1, (), _slack)
            yield Form(KINDS[0], place.name, "force", index, (slack,), "of a friction")


def _loose(m: Moved, gap: float, relaxation: float):
    return losses(m.s, m.step, [gap], [relaxation])[0]


def _slack(m: Moved, presliding: float):
    return slips(m.s, [presliding])[0] ** 5


def sizes(form: Form, v: Sizes) -> dict[str, tuple[str, float]]:
    """See Kind. A hysteresis behind a play has no force for about 1.4 times its presliding after a reversal."""
    return {"gap": ("m", 1.4 * v(0, "presliding") if form.note == "of a friction" else 2.0 * v(0, "gap"))}
