# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Dry friction: of Coulomb, with a constant force beside it or a peak at low rates, with memory of the travel, by position or by load."""

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import GROUND, Model

from ..plant.plant import Place
from . import loads
from .form import Form, Motion, Part, Sizes

Array = NDArray[np.float64]
KINDS = ("coulomb_friction", "stribeck_friction", "bouc_wen", "position_dependent_friction", "load_dependent_friction")
REVERSING = KINDS[2:3]
MEANING = {
    "coulomb_friction": "Friction: a force against the motion that hardly depends on the rate.",
    "stribeck_friction": "Friction that is larger at the lowest rates than at higher ones; it makes the element stick.",
    "bouc_wen": "Hysteresis: the force depends on the travel since the last reversal, elastic at first, then yielding.",
    "position_dependent_friction": "Friction that depends on the position: larger at one end of the travel, or at both ends.",
    "load_dependent_friction": "Friction that grows with the force that a bearing, a guide or a gear transmits.",
}
PARAMETERS = {  # what each number of a report means
    "coulomb_friction": {"force": "level at high rate"},
    "stribeck_friction": {
        "breakaway": "level as the rate goes to 0",
        "coulomb": "level at high rate",
        "stribeck_rate": "rate at which the difference has fallen to 1/e",
    },
    "bouc_wen": {"force": "largest hysteretic force", "yield_deflection": "force over the stiffness of small loops"},
    "position_dependent_friction": {
        "force": "level at deflection 0",
        "slope": "growth of the level with deflection, or with its magnitude",
    },
    "load_dependent_friction": {"force": "level without load", "share": "growth of the level with the magnitude of the load"},
}
RIVALS = {
    ("position_dependent_friction", "coulomb_friction"): "the same stroke about two places of the travel",
    ("load_dependent_friction", "coulomb_friction"): "the same motion under two loads",
    ("load_dependent_friction", "position_dependent_friction"): "the same place under two loads: another weight, another preload",
    ("coulomb_friction", "stribeck_friction"): "slow motion with many reversals, and fast motion too: the lowest rates tell",
    (
        "coulomb_friction",
        "bouc_wen",
    ): "small strokes as well as large ones: before it slides, a Bouc-Wen element acts as a spring, Coulomb friction does not",
}
ONE = True  # friction at a place is one curve, with a peak or with memory
# of the rms rate: transitions of a friction, smooth enough for Gauss-Newton, steep enough for any motion; and where it has fallen
EDGES, PEAKS = (0.04, 0.12), (0.1, 0.4)
WIDEST = EDGES[-1] * Part.rounds  # what bends slower is a damper
DAHL, LUGRE = "dahl_friction", "with bristles that slip sooner at speed"
WAYS = (0.06, 0.25, 0.8)  # of the rms deflection: how far a hysteresis is bent before it slides
# of the rms deflection: a hysteresis that is bent less is a friction; of a friction: a lower peak is how its edge bends; of a contact:
LEAST = EDGES[0]  # a smaller play does not show


def turns(rates: Array) -> bool:
    """Do rates [n] change sign? One that goes back slower than a friction's sharpest transition shows nothing of reversals."""
    low, high = np.quantile(rates, (0.005, 0.995))
    return bool(min(-low, high) > EDGES[0] * np.sqrt(np.mean(np.square(rates))))


def coulomb(motion: Motion, edge: float) -> Part:
    return Part("coulomb_friction", ("force", "N"), {"transition": (edge * motion.v_rms, "m/s")}, 1, edge="transition")


SLOWLY = "that falls slowly from its breakaway"
FALLS = {"that falls from its breakaway": "*exp(-(v/stribeck)^2)", SLOWLY: "/(1 + (v/stribeck)^2)"}  # of what it has more at rest


def peak(motion: Motion, share: float) -> Part:
    """What a friction has more at the lowest rates, of 1 at its largest; `share` of the rms rate, where it has fallen. One that is narrower
    than the transition only makes up for that."""
    law = "2.3316439815971242*rise*exp(-(v/width)^2)*v/width"
    return Part(law, ("rise", "N"), {"width": (share * motion.v_rms, "m/s")}, 1, span=share / EDGES[0])


def falling(motion: Motion, edge: float, share: float, falls: str) -> Part:
    """A friction that falls from its breakaway, `share` of the rms rate away from it (Armstrong-Helouvry, Dupont and Canudas de Wit,
    Automatica 30, 1994, eq. 4): the level and what it has `rise` times more at rest."""
    shapes = {"transition": (edge * motion.v_rms, "m/s"), "rise": (1.0, "1"), "stribeck": (share * motion.v_rms, "m/s")}
    law = f"force*(1 + rise{falls})*tanh(v/transition)"
    return Part(law, ("force", "N"), shapes, 1, span=share / EDGES[0], edge="transition", includes="coulomb_friction")


def forms(model: Model, index: int, place: Place, motion: Motion) -> Iterable[Form]:
    """See Kind."""
    if place.role == "tyre":
        return
    grounded = place.role == "body" or GROUND in place.ends
    for edge in EDGES:
        slides = coulomb(motion, edge)
        yield Form(KINDS[0], place.loss, "force", index, (slides,))
        if grounded:
            yield Form(KINDS[0], place.loss, "force", index, (slides, replace(loads.constant(), kind=loads.KINDS[0])), "with a constant")
        for share, (note, falls) in itertools.product(PEAKS, FALLS.items()) if place.role != "body" else ():
            yield Form(KINDS[1], place.loss, "force", index, (falling(motion, edge, share, falls),), note)
        if place.role != "body":
            for grows, kind, note in _growing(motion, edge):
                yield Form(kind, place.loss, "force", index, (slides, grows), note)
                if grows.load:
                    yield Form(kind, place.loss, "force", index, (grows,), f"{note} alone")
    if place.role == "body":
        return
    for share in WAYS:
        bends = Part("bouc_wen", ("force", "N"), {"presliding": (share * motion.s_rms, "m")}, 1)
        yield Form(KINDS[2], place.loss, "force", index, (bends,))
        yield Form(KINDS[2], place.loss, "force", index, (replace(bends, law=DAHL),), "of Dahl")
        shapes = {**bends.shapes, "bend": (0.5, "1"), "share": (0.7, "1")}  # its exponent is fitted, about 1.2 to 2.5
        loop = Part("bouc_wen_loop", bends.gain, shapes, 1, span=3.0, includes=bends.law, later={"share": 1.0 / 0.7})
        yield Form(KINDS[2], place.loss, "force", index, (loop,), "of any exponent")
        for width in PEAKS if share < WAYS[-1] else ():
            yield Form(KINDS[1], place.loss, "force", index, (replace(bends, includes=DAHL), peak(motion, width)), "with bristles")
            shapes = {**bends.shapes, "rise": (1.0, "1"), "stribeck": (width * motion.v_rms, "m/s")}
            yield Form(KINDS[1], place.loss, "force", index, (Part("lugre_friction", ("force", "N"), shapes, 1, includes=DAHL),), LUGRE)


def _growing(motion: Motion, edge: float) -> Iterable[tuple[Part, str, str]]:
    """What a friction has more at another deflection or load, its kind, and a note on the form."""
    shapes = {"width": (edge * motion.v_rms, "m/s")}
    for where, note in (("s", "along the travel"), ("abs(s)", "to both ends")):
        yield Part(f"slope*{where}*tanh(v/width)", ("slope", "N/m"), shapes, fixed=("width",)), KINDS[3], note
    for load in motion.parts[0].loads:
        yield Part("share*load*tanh(v/width)", ("share", "1"), shapes, 1, ("width",), load=load), KINDS[4], f"of {load}"


def fitted(form: Form, laws: Sequence[tuple[float, Part]], motion: Motion) -> str:
    """See Kind. A friction of Stribeck with hardly a peak is a hysteresis, and a hysteresis that is short is a friction of Coulomb. A peak
    that is narrower than the transition only makes up for that, and is none."""
    coulomb, stribeck, hysteresis, *_ = KINDS
    force, first = laws[0]
    if "transition" in first.shapes and "stribeck" in first.shapes and first.shapes["stribeck"][0] < first.shapes["transition"][0]:
        return ""
    if form.kind == stribeck:
        rise = force * first.shapes["rise"][0] if "rise" in first.shapes else laws[1][0]
        if rise > LEAST * force:
            return stribeck
    elif form.kind != hysteresis:
        return form.kind
    way = first.shapes.get("presliding", (0.0, "m"))[0]
    return hysteresis if way > LEAST * motion.s_rms else coulomb


def sizes(form: Form, v: Sizes) -> dict[str, tuple[str, float]]:
    """See Kind."""
    if form.parts and form.parts[0].load:
        return {"share": ("1", v(0, "share"))}
    force = ("N", v(0, "force"))
    match form.kind:
        case "stribeck_friction" if "rise" in form.parts[0].shapes:
            left = math.sqrt(math.e - 1.0) if form.note == SLOWLY else 1.0  # 1/e
            rates = {"stribeck_rate": ("m/s", left * v(0, "stribeck"))}
            return {"breakaway": ("N", v(0, "force") * (1.0 + v(0, "rise"))), "coulomb": force, **rates}
        case "stribeck_friction":
            return {"breakaway": ("N", v(0, "force") + v(1, "rise")), "coulomb": force, "stribeck_rate": ("m/s", v(1, "width"))}
        case "bouc_wen":
            return {"force": force, "yield_deflection": ("m", v(0, "presliding"))}
        case "position_dependent_friction":
            return {"force": force, "slope": ("N/m", v(1, "slope"))}
        case "load_dependent_friction":
            return {"force": force, "share": ("1", v(1, "share"))}
    return {"force": force}
