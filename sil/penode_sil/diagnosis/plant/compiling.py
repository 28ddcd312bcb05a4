# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Models as batch libraries, kept for all that differ in values of parameters only, and the steps that their laws allow."""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np

import penode_gen
from penode_gen.algebra.causalise import Causal, causalise
from penode_gen.model import Model
from penode_gen.sets import fold
from penode_gen.twins.numeric import Numeric

from ...batch import Batch

LONGEST = {"loose_damper": 2.5e-4, "presliding": 2.5e-4, "friction": 5e-4}  # [s] step of laws that follow short ways


def longest(model: Model) -> float:
    """The longest step [s] that its laws allow."""
    return min([np.inf, *(LONGEST[k] for k in LONGEST for e in model.elements if k in e.law or k in e.arguments)])


def folded(model: Model) -> Model:
    """The model with its networks as straight pieces where all of them are: the same forces, far sooner.
    Layer by layer where the float weights have more of them: neurons may switch between two neighbouring numbers."""
    networks = [n for s in model.sets.values() for n in s.networks.values()]
    if not networks or model.pieces or model.outside == "fade" or not all(map(fold.foldable, networks)):
        return model
    return replace(model, pieces=fold.room(max(fold.pieces(n, model.outside == "clamp") for n in networks)), more_pieces="layers")


_BATCHES: dict[tuple[object, ...], Batch] = {}
_ORDERED: dict[tuple[object, ...], tuple[Causal, bool]] = {}
_FUNCTIONS: dict[tuple[object, ...], Numeric] = {}


def _structure(model: Model) -> tuple[object, ...]:
    """What models share that differ in values of parameters only."""
    shapes = {name: n.architecture for s in list(model.sets.values())[:1] for name, n in s.networks.items()}
    return repr(replace(model, parameters={}, sets={})), tuple(model.parameters), repr(shapes)


def moving(model: Model) -> bool:
    """Does anything in it depend on the rate of an input?"""
    return ordered(model)[1]


def ordered(model: Model) -> tuple[Causal, bool]:
    """The equations of a model in order, which no method of integration changes, and whether anything depends on the rate of an input."""
    key = _structure(model)
    if key not in _ORDERED:
        causal = causalise(replace(model, interpolation="cubic"))
        _ORDERED[key] = causal, causal.uses([*causal.rates, *causal.outputs, *causal.sensors], causal.input_rates)
    return _ORDERED[key]


def compiled(model: Model, causal: Causal) -> Batch:
    """The batch library of a model with the equations `causal`."""
    key = _structure(model)
    if key not in _BATCHES:
        _BATCHES[key] = Batch(model, exact=False, causal=replace(causal, model=model))
    found = copy(_BATCHES[key])
    found.model = model
    return found


def functions(model: Model) -> Numeric:
    """A model, with its default set, as functions."""
    if model.networks:
        return penode_gen.numeric(model)
    key, chosen = _structure(model), model.sets.get("default")
    if key not in _FUNCTIONS:
        _FUNCTIONS[key] = penode_gen.numeric(model)
    own = {p.name: p.value for p in model.parameters.values()}
    return _FUNCTIONS[key].with_parameters({**own, **(chosen.parameters if chosen else {})})
