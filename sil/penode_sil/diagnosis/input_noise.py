# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Noise of inputs, where the model file states none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from penode_gen import units
from penode_gen.model import Model

from ..recordings.measured import Measured
from .driven import experiment
from .study import begin, loss
from .worth import SYSTEMATIC


def with_noise_of_inputs(model: Model, train: Sequence[Measured], set_name: str) -> tuple[Model, list[str]]:
    """Returns the model with the white noise that recorded inputs show and the file does not state, and a note on it; the model as it is if
    the sensors show that this noise drove the plant. A shaker's noise is a signal, that of a road sensor is not, and unless it is known, a
    lag of the input is named, which smooths it. Noise below SYSTEMATIC of an input is ignored: any model gets more wrong."""
    shown = {i.name: noise for k, i in enumerate(model.inputs) if not i.noise and (noise := _shown(train, i.name, k))}
    if not shown:
        return model, []
    noisy = replace(model, inputs=tuple(replace(i, noise=shown.get(i.name, i.noise)) for i in model.inputs))
    studies = [begin(m, [experiment(r, m, smooth=True) for r in train], set_name)[0] for m in (model, noisy)]
    drove, measured = (loss(s, s.null) for s in studies)
    if measured >= drove:
        return model, []
    found = ", ".join(f"{i.name} {shown[i.name]:.3g} {units.si(i.unit)}" for i in model.inputs if i.name in shown)
    return noisy, [
        f"white noise in recorded inputs, of which the model file states none: {found}; it did not drive the plant, by "
        f"{drove - measured:.3g} of -2 ln(likelihood) of the sensors. State it: noise = ..."
    ]


def _shown(train: Sequence[Measured], name: str, k: int) -> float:
    """Standard deviation of the white noise of an input [SI]; 0 if the noise is small or not white, or if the input is held."""
    channels = [m.quality.channels.get(name) for m in train]
    if any(c is None or c.how == "held" or c.noise is None or c.noise.pole for c in channels):
        return 0.0
    noise = float(np.sqrt(np.mean([c.noise.std**2 for c in channels if c and c.noise])))
    return noise if noise > SYSTEMATIC * float(np.std(np.concatenate([m.u[:, k] for m in train]))) else 0.0
