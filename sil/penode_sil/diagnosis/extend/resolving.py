# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Interpolation and substeps of an extended model, as fine as its effects require."""

from __future__ import annotations

import re
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import penode_gen
from penode_gen.model import INTERPOLATIONS, Model

from ..plant.compiling import longest
from ..study.restoring import rms
from ..study.study import Study
from .measuring import deployed, started

Array = NDArray[np.float64]
# of a sensor's noise: accepted error of the interpolation, for a hold-out may move several times as fast; and of the residual, that of a
# step
ROUGH = 0.02


def resolved(study: Study, text: str) -> tuple[str, Model]:
    """The model of a text; its inputs follow a curve through more samples if the way between them is too rough for the first recording,
    and it takes more steps a sample if they are too long, where the C then meets it better. The more samples, the finer, but the louder
    the noise of the inputs."""
    model, e = _load(text), study.experiments[0]
    start, exact = started(model, e, study)
    scale = np.sqrt(np.mean(study.levels[0], axis=0))

    def left(z: Array) -> float:
        missed = rms(((z - e.y) * e.good / scale).ravel())
        return missed if np.isfinite(missed) else np.inf

    stepped = deployed(model, e, start, study.set_name)
    ways = INTERPOLATIONS[INTERPOLATIONS.index(model.interpolation) + 1 :] if model.interpolation != "held" else ()
    for way in ways:
        if np.max(np.sqrt(np.mean(((stepped - exact) / scale) ** 2, axis=0))) < ROUGH:
            break
        better = _with(text, "input", f'"{way}"')
        finer = deployed(_load(better), e, start, study.set_name)
        if left(finer) >= left(stepped):
            break
        text, stepped = better, finer
    substeps = 2 * model.substeps
    while substeps <= 1000 and left(stepped) > (1.0 + ROUGH) * left(exact):  # what a model file may have
        better = _with(text, "substeps", str(substeps))
        finer = deployed(_load(better), e, start, study.set_name)
        if left(finer) < left(stepped):
            text, stepped = better, finer
        elif substeps * longest(model) >= model.sample_time:  # else a law that follows short ways may still diverge
            break
        substeps *= 2
    return text, _load(text)


def _with(text: str, key: str, value: str) -> str:
    """A text with another option of its step."""
    plain = re.sub(rf'^{key} = ("(linear|parabola|cubic)"|\d+)\n', "", text, flags=re.MULTILINE)
    return plain.replace("sample_time =", f"{key} = {value}\nsample_time =", 1)


def _load(text: str) -> Model:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model_extended.toml"
        path.write_text(text)
        return penode_gen.load(path)
