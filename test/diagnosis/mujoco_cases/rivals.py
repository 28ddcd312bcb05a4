# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Other answers that are right: exactly, or because this generator, fitting them to its signals without noise, leaves next to nothing."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from . import effects
from .effects import Effect
from .engine import COARSE, Unstable
from .fitting import Fit

if TYPE_CHECKING:
    from .cases import Case

LEFT = 30.0  # sum of squares over the noise that may be left: hardly to be seen in thousands of values
HOPELESS = 0.1  # relative fall of chi-square in a round, below which a rival will not come to that
SIZE = {
    "coulomb_friction": "force",
    "bump_stop": "stiffness",
    "cubic_spring": "cubic",
    "quadratic_damper": "coefficient",
    "load_dependent_friction": "share",
    "position_dependent_friction": "force",
    "backlash": "gap",
    "tyre_damping": "damping",
    "input_gain": "gain",
    "input_lag": "time",
    "input_delay": "delay",
    "input_saturation": "limit",
    "input_dead_zone": "width",
    "input_slew_limit": "rate",
    "input_offset": "offset",
    "sensor_bias": "bias",
    "sensor_scale": "scale",
    "sensor_delay": "delay",
    "sensor_clipping": "limit",
    "wrong_parameter": "value",
}
NOTHING = {"gain": 1.0, "scale": 1.0}  # a size where nothing is wrong, 0 for others
GUESSED = {
    "force",
    "cubic",
    "coefficient",
    "share",
    "time",
    "delay",
    "width",
    "offset",
    "bias",
    "damping",
}  # a fit begins with them 10 % off
# kind -> those that look like it
PARTNERS: dict[str, tuple[str, ...]] = {
    "coulomb_friction": ("input_dead_zone", "load_dependent_friction"),
    "load_dependent_friction": ("coulomb_friction", "input_gain"),
    "position_dependent_friction": ("coulomb_friction",),
    "quadratic_damper": ("coulomb_friction",),
    "cubic_spring": ("bump_stop",),
    "bump_stop": ("cubic_spring",),
    "input_gain": ("sensor_scale", "wrong_parameter"),
    "input_lag": ("input_delay", "sensor_delay"),
    "input_delay": ("input_lag", "sensor_delay"),
    "input_slew_limit": ("input_lag", "input_delay", "input_saturation"),
    "input_saturation": ("input_slew_limit", "input_gain"),
    "input_dead_zone": ("coulomb_friction", "input_gain"),
    "input_offset": ("sensor_bias",),
    "sensor_bias": ("input_offset",),
    "sensor_delay": ("input_delay", "input_lag"),
    "sensor_scale": ("input_gain", "wrong_parameter"),
    "wrong_parameter": ("input_gain", "sensor_scale", "wrong_parameter"),
}


def equivalents(case: Case) -> list[dict[str, Any]]:
    """Answers other than the effect itself that are right as well, each with the reason."""
    e, plant = case.effect, case.plant
    assert e is not None
    found: list[dict[str, Any]] = []
    for kind in PARTNERS.get(e.kind, ()):
        for place in effects.places(kind, plant) if kind in effects.KINDS[plant.name] else ():
            if (kind, place) == (e.kind, e.place) or (kind == "wrong_parameter" and case.tolerance is None):
                continue  # without a tolerance every parameter is fitted beside the effect anyway
            left = _left(case, kind, place)
            if left < LEFT:
                rival = Effect(kind, place, {})
                found.append({"kind": kind, "where": effects.words(rival, plant), "why": f"its best fit leaves {left:.0f} of chi-square"})
                if kind == "wrong_parameter":
                    found[-1]["parameters"] = [place]
    kinds = {e.kind, *(x["kind"] for x in found)}
    body = list(next(iter(plant.sites.values())).words) if plant.name != "drive" else list(plant.sites["motor"].words)
    if "input_offset" in kinds:
        found.append(
            {"kind": "constant_force", "where": body, "why": "a constant on the input is a constant force on the body that it drives"}
        )
    if e.kind == "sensor_bias" and plant.road and e.place == plant.sensors[-1].name:
        sprung = plant.bodies[0].split()[0]
        found.append({"kind": "constant_force", "where": [sprung], "why": "at rest a constant force is a constant deflection"})
    return found


def _left(case: Case, kind: str, place: str) -> float:
    """Chi-square that the best fit of another kind leaves of the signals without noise."""
    plant = case.plant
    record = case.records["train_1"]
    hidden, case.effect = case.effect, None
    try:
        case._record("train_1", COARSE)  # the plant alone, for sizes
    finally:
        case.effect = hidden
    site = plant.sites.get(place)
    stiffness = plant.values[site.spring][0] if site and site.spring else 0.0
    at = effects.scale_of(kind, place, plant, case.last, record.clean, stiffness)
    file = plant.values[place][0] if kind == "wrong_parameter" else 0.0
    numbers = effects.numbers(kind, 0.7, 1.0, {"z": 0.5}, at, file)
    best = np.inf
    fixed = [hidden.place] if hidden and hidden.kind == "wrong_parameter" else []
    with suppress(Unstable, np.linalg.LinAlgError):
        best = Fit(plant, case.tolerance, case.trained, True, [Effect(kind, place, numbers)], fixed).solve(4, HOPELESS).energy
    return float(best)
