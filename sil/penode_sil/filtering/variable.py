# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A generated filter in double whose noises can be set between two runs: its C with tables that are not constant."""

from __future__ import annotations

import ctypes
import re
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Filter, Model

from ..building import build_directory, generated
from .compiled import Compiled
from .estimates import Estimates, of

Array = NDArray[np.float64]
Key = tuple[str, str]  # table of [filter] and name in it


def variances(given: Filter, factors: Mapping[Key, float]) -> dict[str, list[float]]:
    """The tables `start`, `noise` and `variance` of pen_ekf_model_t with each noise times its factor (1 if not in `factors`)."""
    states = [(s.start, s.noise * factors.get(("states", s.name), 1.0)) for s in given.states]
    inputs = []
    for i in given.inputs:
        factor = factors.get(("inputs", i.name), 1.0)
        walks = i.decay == 1.0  # then its start is no noise
        inputs.append((i.noise if walks else i.noise * factor, i.step * factor))
    inputs += [(p.start, p.step * factors.get(("parameters", p.name), 1.0)) for p in given.parameters]
    found = {
        "start": [start for start, _ in (*states, *inputs)],
        "noise": [noise for _, noise in states if noise > 0.0] + [step for _, step in inputs],
        "variance": [s.noise * factors.get(("sensors", s.name), 1.0) for s in given.sensors],
    }
    return {name: [value**2 for value in values] for name, values in found.items()}


class Variable:
    """The filter of a model file in double; run() takes factors of its noises."""

    def __init__(self, model: Model, set_name: str):
        self.given, self.set_name = of(model), set_name
        source = generated(model)
        with tempfile.TemporaryDirectory(dir=build_directory()) as scratch:  # the library is kept by its contents, not by this place
            for path in source.iterdir():
                text = path.read_text(encoding="utf-8")
                if path.name == f"{model.name}_ekf.c":
                    text = re.sub(r"static const (pen_real_t \w+_ekf_(?:start|noise|variance)\[)", r"\1", text)
                (Path(scratch) / path.name).write_text(text, encoding="utf-8")
            self.compiled = Compiled(model, np.float64, source=Path(scratch))
        self.tables = {}
        for name, values in variances(self.given, {}).items():
            if values:
                self.tables[name] = (ctypes.c_double * len(values)).in_dll(self.compiled.library, f"{model.name}_ekf_{name}")

    def run(self, factors: Mapping[Key, float], recordings: Iterable[tuple[Array, Array, NDArray[np.uint32]]]) -> list[Estimates]:
        """The filter from its start over each recording: u, z and mask, as CompiledFilter.run takes them; without estimates."""
        for name, values in variances(self.given, factors).items():
            if values:
                np.ctypeslib.as_array(self.tables[name])[:] = values
        return [self.compiled.filter(self.set_name).run(u, z, mask, estimates=False)[0] for u, z, mask in recordings]
