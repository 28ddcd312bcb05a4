# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A constant force on a body."""

from collections.abc import Iterable, Sequence

from penode_gen.model import GROUND, Model

from ..plant.plant import Place
from ..result import Cause, Named, Value
from .form import Form, Motion, Part, Sizes

KINDS = ("constant_force",)
MEANING = {"constant_force": "A constant force that the model does not have."}
PARAMETERS = {  # what each number of a report means
    "constant_force": {
        "force": "on the body, in the direction of its position; under prescribed motion: what is added to the measured force",
        "begin": "when half of it is there, of a load that is put on during each recording",
    }
}
RIVALS = {
    ("constant_force", "sensor_bias"): "put the load on or take it off during the recording: only that transient tells them apart",
    ("constant_force", "input_offset"): "switch the actuator off: a load remains, an offset of the input does not",
}


def constant() -> Part:
    return Part("constant_force", ("force", "N"))


def put_on(motion: Motion, share: float) -> Part:
    """A load that is put on at a `share` of the longest recording, and within about as long."""
    begin = share * motion.longest
    return Part("growing_force", ("force", "N"), {"begin": (begin, "s"), "time": (0.5 * begin, "s")})


def forms(model: Model, index: int, place: Place, motion: Motion) -> Iterable[Form]:
    """See Kind."""
    if place.role == "body" or GROUND in place.ends:
        yield Form(KINDS[0], place.name, "force", index, (constant(),))
        for share in (0.05, 0.4):  # of the longest recording, see `put_on`
            yield Form(KINDS[0], place.name, "force", index, (put_on(motion, share),), "put on")


def sizes(form: Form, v: Sizes) -> dict[str, tuple[str, float]]:
    """See Kind. What pulls a body to ground is a force downwards; under prescribed motion, what a force adds."""
    force = {"force": ("N", -v(0, "force") if v.moving else v(0, "force"))}
    return force | ({"begin": ("s", v(0, "begin"))} if form.note else {})


def cause(where: str, force: Value, confidence: float, alternatives: Sequence[Named]) -> Cause:
    """A load as a cause, with what has the same effect."""
    return Cause(KINDS[0], where, {"force": force}, confidence, tuple(alternatives))
