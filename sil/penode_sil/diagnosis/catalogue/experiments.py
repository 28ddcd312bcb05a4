# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The next experiment: the excitation that shows a kind of cause, for plants that are moved, driven or left alone."""

import re
from collections.abc import Iterable

from penode_gen.model import GROUND, Model

SHOWN = {  # by which excitation a kind shows; a kind that is not here shows under a broad one
    "slow": ("coulomb_friction", "stribeck_friction", "bouc_wen", "load_dependent_friction", "position_dependent_friction"),
    "rates": (
        "asymmetric_damper",
        "degressive_damper",
        "quadratic_damper",
        "damper_fading",
        "tyre_damping",
        "aerated_damper",
        "missing_damper",
    ),
    "travel": ("cubic_spring", "asymmetric_spring", "bump_stop", "backlash", "tyre_nonlinear", "tyre_liftoff", "missing_spring"),
    "steps": ("maxwell_bushing", "hidden_resonance"),
    "command": (
        *("input_gain", "input_offset", "input_delay", "input_drift", "input_lag", "input_hold", "input_sign"),
        *("input_dead_zone", "input_saturation", "input_slew_limit"),
    ),
    "rest": ("sensor_bias", "sensor_scale", "sensor_delay", "sensor_sign", "sensor_clipping", "sensor_dropout", "constant_force"),
}
BROAD = "broad"
HOLDING = ("linear_spring", "cubic_spring", "asymmetric_spring", "bump_stop", "backlash")  # laws of the deflection
BY_KIND = {kind: how for how, kinds in SHOWN.items() for kind in kinds}
FREE = {  # nothing drives it
    "slow": "release it from a small and from a large start and record until it stands still",
    "rates": "release it from two starts of different size: compare how much each swing loses",
    "travel": "release it from a small and from a large start: compare the periods",
    "rest": "record it at rest, in two positions that you know",
    BROAD: "release it from at least two starts of different size and record until it stands still",
}
MOVED = {  # an input is the motion of an end: a road, a shaker
    "slow": "move {input} as a slow triangle over the whole travel, then ten times as fast",
    "rates": "move {input} with one amplitude at three frequencies, from slow to ten times as fast",
    "travel": "ramp {input} slowly up and down over the whole travel",
    "steps": "step {input} and hold it until nothing moves, then a sine at two other frequencies",
    "command": "measure {input} with a second sensor, under steps of several sizes",
    "rest": "hold {input} still for a minute before and after the motion, once with a known load",
    BROAD: "move {input} with broadband noise at two amplitudes, then ramp it slowly over its range; no chirp of one amplitude",
}
TIED = {  # driven by a force, and held by springs or gravity
    "slow": "raise {input} slowly from zero until it moves and lower it again, in both directions",
    "rates": "drive {input} with sines of one amplitude at three frequencies, one of them the natural frequency",
    "travel": "ramp {input} slowly up and down over the whole travel",
    "steps": "step {input} and hold it until nothing moves, then a sine at two other frequencies",
    "command": "step {input} through zero in several sizes, each held until the response settles; measure what the actuator gives",
    "rest": "switch {input} off and record it at rest for a minute before and after the motion",
    BROAD: "drive {input} with broadband noise at two amplitudes, then ramp it slowly; no chirp of one amplitude",
}
ROLLING = TIED | {  # driven by a force, and free to go anywhere: a car, a spindle
    "slow": "raise {input} slowly from zero until it moves; then bring it to speed, switch {input} off and let it coast to rest",
    "rates": "bring it to its highest speed, switch {input} off and let it coast to rest",
    "travel": "reverse {input} at several places of the travel",
    BROAD: "step {input} to several levels in both directions until the speed settles; then switch it off and let it coast to rest",
}
SETTLING = {  # without bodies: a tank, a circuit
    "rest": "hold {input} constant until {sensor} settles, and compare that with a second instrument",
    BROAD: "step {input} to two levels, each held until {sensor} settles, then switch it off and record until {sensor} is back",
}


def proposed(model: Model, kinds: Iterable[str] = ()) -> str:
    """The experiment that shows these kinds in a plant, each once; of none in particular, one that shows much."""
    ways, known = _ways(model)
    wanted = dict.fromkeys(BY_KIND.get(kind, BROAD) for kind in kinds) or {BROAD: None}
    special = dict.fromkeys(ways[how] for how in wanted if how in ways and how != BROAD)
    return "; ".join(text.format(**known) for text in special or [ways[BROAD]])


def _ways(model: Model) -> tuple[dict[str, str], dict[str, str]]:
    """The experiments that fit a plant, and the names in them."""
    inputs = {i.name for i in model.inputs}
    ends = [end for e in model.elements for end in e.ends]
    moved = next((end for end in ends if end in inputs), "")
    known = {"input": moved or (model.inputs[0].name if model.inputs else ""), "sensor": model.sensors[0].name if model.sensors else ""}
    if not model.inputs:
        return FREE, known
    if not model.bodies:
        return SETTLING, known
    if moved:
        return MOVED, known
    return (TIED if _tied(model) else ROLLING), known


def _tied(model: Model) -> bool:
    """Does anything that acts between a body and the ground depend on where the body is?"""
    positions = {b.name: b.position for b in model.bodies}
    for e in model.elements:
        own = [positions[end] for end in e.ends if end in positions]
        if GROUND in e.ends and (e.law in HOLDING or any(_mentions(e.expression, name) for name in (*own, "s", f"s_{e.name}"))):
            return True
    return False


def _mentions(expression: str, name: str) -> bool:
    return re.search(rf"\b{re.escape(name)}\b", expression or "") is not None
