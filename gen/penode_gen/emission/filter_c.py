# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The C of a filter, NAME_ekf.h and NAME_ekf.c: what the templates see besides the context of the model."""

from __future__ import annotations

from typing import Any

from ..algebra.placeholder import UNUSED
from ..model import Filter, FilterInput, FilterLimit, Model
from .c_text import real

FILES = {"filter/ekf.h.j2": "{name}_ekf.h", "filter/ekf.c.j2": "{name}_ekf.c"}
_TINY = {"float": 2.0**-102, "double": 2.0**-998}  # 2^24 times the smallest normal number
_EPSILON = {"float": 2.0**-23, "double": 2.0**-52}


def context(model: Model, given: Filter) -> dict[str, Any]:
    """Sizes, names and tables."""
    sensors = [s.name for s in model.sensors]
    inputs = [i.name for i in model.inputs] + [p.name for p in given.parameters]  # of the model that the filter steps
    start = [s.start for s in given.states] + [i.noise for i in given.inputs] + [p.start for p in given.parameters]
    noisy = [s for s in given.states if s.noise > 0.0]
    n, n_x = len(start), len(given.states)
    n_w = len(noisy) + n - n_x
    walks = [FilterInput(p.name, p.start, p.step, 1.0, False) for p in given.parameters]
    driven, started = [given_input(given, name) for name in inputs], model.sets["default"].parameters
    return {
        "filter": {
            "names": given.names,
            "n": n,
            "n_w": n_w,
            "n_z": len(given.sensors),
            "n_limits": len(given.limits),
            "work": (n + 2) * (n + n_w),
            "sensors": [{"name": s.name, "at": sensors.index(s.name), "bit": f"0x{1 << k:x}U"} for k, s in enumerate(given.sensors)],
            "all": f"0x{(1 << len(given.sensors)) - 1:x}U",
            "inputs": [
                {
                    "name": i.name,
                    "at": n_x + k,
                    "source": len(noisy) + k,
                    "column": inputs.index(i.name),
                    "decay": real(i.decay),
                    "measured": i.measured,
                    "decays": i.decay != 1.0,
                }
                for k, i in enumerate((*given.inputs, *walks))
            ],
            "parameters": [
                {"name": p.name, "at": given.names.index(p.name), "unit": model.parameters[p.name].unit} for p in given.parameters
            ],
            "core": model.stepped,
            "n_u": len(inputs) or 1,
            "given": driven[: len(model.inputs)] or [{"name": UNUSED.name, "text": f"u->{UNUSED.name}", "at": None}],
            "driven": driven,
            "reads_u": any("u->" in i["text"] for i in driven),
            "noisy": [{"name": s.name, "at": model.states.index(s.name)} for s in noisy],
            "own": [f"{model.states.index(s.name)}U" for s in noisy] + [f"{k}U" for k in range(n_x, n)],
            "start": [real(s * s) for s in start],
            "floor": {kind: [real(max((s * _EPSILON[kind]) ** 2, tiny)) for s in start] for kind, tiny in _TINY.items()},
            "noise": [real(s.noise**2) for s in noisy] + [real(i.step**2) for i in (*given.inputs, *walks)],
            "variance": [real(s.noise**2) for s in given.sensors],
            "gate": ["PEN_REAL_MAX" if s.gate is None else real(s.gate**2) for s in given.sensors],
            "limits": [_limit(given, limit) for limit in given.limits],
            "inside": [real(x) for x in (*model.start, *(0.0 for _ in given.inputs), *(started[p.name] for p in given.parameters))],
        }
    }


def given_input(given: Filter, name: str) -> dict[str, Any]:
    """An input as the model gets it in a step: C of u and of the state x of the filter, and the number of its state."""
    names = given.names[len(given.states) :]
    if name not in names:
        return {"name": name, "text": f"u->{name}", "at": None}
    at, measured = len(given.states) + names.index(name), {i.name for i in given.inputs if i.measured}
    return {"name": name, "text": f"u->{name} + x[{at}]" if name in measured else f"x[{at}]", "at": at}


def _limit(given: Filter, limit: FilterLimit) -> dict[str, Any]:
    return {
        "name": limit.name,
        "row": [real(limit.coefficients.get(name, 0.0)) for name in given.names],
        "least": "-PEN_REAL_MAX" if limit.least is None else real(limit.least),
        "most": "PEN_REAL_MAX" if limit.most is None else real(limit.most),
    }
