# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A network outside of the range that it was trained on, where it goes on as it happens to."""

from collections.abc import Iterable

import numpy as np

from penode_gen.model import Model

from ..plant.plant import Place
from .form import Form, Motion, Part, Sizes

KINDS = ("network_extrapolation",)
MEANING = {"network_extrapolation": "A network is used outside of the range that it was trained on."}
PARAMETERS = {  # what each number of a report means
    "network_extrapolation": {
        "force_at_peak": "extra force where the motion goes farthest beyond the range",
        "edge": "end of the range, as its magnitude",
    }
}
STRAIGHT = KINDS
STEMS = {"network_extrapolation": "beyond_range"}  # names that begin with network_ are the generator's own
MOST = 0.995  # of the samples: what a motion reaches
SPAN = 3.0  # of an edge that the network does not state
POWERS = {"a line": "", "a square": "^2"}  # of what is beyond an edge


def forms(model: Model, index: int, place: Place, motion: Motion) -> Iterable[Form]:
    """See Kind. Extra force beyond either end of the range, or both."""
    for element, quantity, low, high, stated in place.trained:
        if next((sense for name, sense in place.elements if name == element), 1) < 0:
            low, high = -high, -low
        values = np.concatenate([getattr(p, quantity) for p in motion.parts])
        for note in POWERS:
            sides = (_beyond(note, quantity, values, high, 1, stated), _beyond(note, quantity, values, low, -1, stated))
            found = [part for part in sides if part]
            if len(found) > 1:
                yield Form(KINDS[0], element, "force", index, tuple(found), f"{note} at both ends of {quantity}")
            for part in found:
                end = "high" if part is sides[0] else "low"
                yield Form(KINDS[0], element, "force", index, (part,), f"{note} at the {end} end of {quantity}")


def _beyond(note: str, quantity: str, values: np.ndarray, edge: float, side: int, stated: bool) -> Part | None:
    """Extra force beyond one end of the range, its gain that at the peak of the motion; None where no motion is."""
    most = float(np.quantile(side * values, MOST))
    if most <= side * edge:
        return None
    unit = "m" if quantity == "s" else "m/s"
    over = f"max({quantity} - edge, 0)" if side > 0 else f"min({quantity} + edge, 0)"
    shapes = {"edge": (side * edge, unit), "way": (float(np.max(side * values)) - side * edge, unit)}
    fixed = ("way",) if not stated and side * edge > 0.0 else ("edge", "way")
    return Part(f"force*({over}/way){POWERS[note]}", ("force", "N"), shapes, 0, fixed, span=SPAN)


def sizes(form: Form, v: Sizes) -> dict[str, tuple[str, float]]:
    """See Kind."""
    sides = range(len(form.parts))
    unit = form.parts[0].shapes["edge"][1]
    return {"force_at_peak": ("N", max(abs(v(k, "force")) for k in sides)), "edge": (unit, max(abs(v(k, "edge")) for k in sides))}
