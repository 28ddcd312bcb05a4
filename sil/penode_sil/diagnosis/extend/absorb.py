# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A fitted law taught to a network that sees the same motion: a parameter set for the ECU that runs already.

The network keeps its shape, so the set has the layout of the running code and can be staged as it is. Only weights of dense
layers move (Levenberg-Marquardt, exact derivatives), from where they are, over the motion that was seen and trained.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import penode_gen
from penode_gen import units
from penode_gen.laws import LAWS
from penode_gen.model import Element, Model
from penode_gen.networks import Affine, Dense, Network, layer_slope, layer_value
from penode_gen.sets import fold

from ..catalogue.form import Moved, Part
from ..checks.case import Case
from ..search.terms import Term
from ..study.smoother import size
from ..study.study import Study
from . import measuring

Array = NDArray[np.float64]
POINTS = 600  # half of them evenly over the range, half where the motion was
ITERATIONS = 80
LEARNT = 0.1  # of the law, RMS over these points: with more than that missing the network cannot be it
FILE = "model_absorbed.toml"
SET = "absorbed"


@dataclass(frozen=True, eq=False)
class Taught:
    """A network with a law in it; `missing`: RMS of its difference from the law over that of the law."""

    port: str
    element: str
    network: Network
    missing: float


def absorbed(case: Case, study: Study, terms: Sequence[Term], values: Mapping[str, float]) -> tuple[dict[str, object], list[str]]:
    """The effect of fitted terms as a parameter set, written into the case's folder: what goes into diagnosis.json, and a note; nothing
    where no network can take them up."""
    learnt = taught(study, terms, values)
    if not learnt:
        return {}, []
    beside = Path(os.path.relpath(case.nominal.path.resolve(), case.output.resolve()))
    model = penode_gen.load(write(study, values, learnt, beside, case.output))
    gain = measuring.measure(study, model, case.unused, SET)[0] if case.unused else {}
    names = ", ".join(t.element for t in learnt)
    entry: dict[str, object] = {"file": FILE, "set": SET, "networks": {t.port: {"missing": t.missing} for t in learnt}, "gain": gain}
    after = ", ".join(f"{k} {g.after_rmse:.3g} {g.unit}" for k, g in gain.items())
    note = f"{names} can learn it: {FILE} has a set for the code that runs already"
    return entry, [note + f"; hold-out after: {after}" * bool(after)]


def taught(study: Study, terms: Sequence[Term], values: Mapping[str, float]) -> list[Taught]:
    """All networks of one input that can take up laws of `terms` beside them, as fitted; none if a law has memory, if no network sees it,
    or if the code that runs would refuse what was learnt."""
    chosen = study.model.sets[study.set_name].networks if study.model.sets else {}
    found = []
    for element in study.model.elements:
        if element.law != "network" or len(element.network_inputs) != 1 or element.network not in chosen:
            continue
        port, network = study.model.networks[element.network], chosen[element.network]
        plain = all(units.factor(u) == 1.0 for u in (*port.input_units, port.output_unit))
        k = next(k for k, p in enumerate(study.places) if any(name == element.name for name, _ in p.elements))
        beside = [t for t in terms if t.form.how == "force" and t.form.index == k]
        own = [(gain, part) for t in beside for gain, part in t.laws(values) if _fits(part, element)]
        if own and plain and _movable(network):
            x, law = _lesson(study, element, network, own, k)
            learnt, left = learn(network, x[:, None], network.evaluate(x[:, None])[:, 0] + law)
            if network.input_min is not None:
                learnt = replace(learnt, input_min=np.array([np.min(x)]), input_max=np.array([np.max(x)]))
            missing = left / float(np.sqrt(np.mean(law**2)))
            if missing < LEARNT and roomy(study.model, learnt):
                found.append(Taught(element.network, element.name, learnt, missing))
    return found


def _fits(part: Part, element: Element) -> bool:
    """Is a law one of the same input as a network, without memory?"""
    known = LAWS.get(part.law)
    if part.load or (known and known.states):
        return False
    text = known.force if known else part.law
    return {{"s": "deflection", "v": "rate"}[w] for w in re.findall(r"\b[sv]\b", text)} == {element.network_inputs[0]}


def _lesson(study: Study, element: Element, network: Network, laws: Sequence[tuple[float, Part]], place: int) -> tuple[Array, Array]:
    """Inputs of the network, and the force that the laws add there [points]."""
    sense = next(sense for name, sense in study.places[place].elements if name == element.name)
    by_rate = element.network_inputs[0] == "rate"
    moved = np.concatenate([sense * (m.v if by_rate else m.s) for m in (s.motions[place] for s in study.seen)])
    reach = size([s.motions[place] for s in study.seen])[int(by_rate)]
    low, high = -reach, reach
    if network.input_min is not None and network.input_max is not None:
        low, high = min(low, float(network.input_min[0])), max(high, float(network.input_max[0]))
    x = np.concatenate([np.linspace(low, high, POINTS // 2), np.quantile(moved, np.linspace(0.0, 1.0, POINTS // 2))])
    zero = np.zeros_like(x)
    along = Moved(zero, sense * x, zero) if by_rate else Moved(sense * x, zero, zero)
    return x, sense * np.sum([gain * part.along(along) for gain, part in laws], axis=0)


def _movable(network: Network) -> bool:
    """Can the network be written as it is, with other weights?"""
    first, last = network.layers[0], network.layers[-1]
    ends = (not isinstance(first, Affine) or (first.form == "centre" and np.all(first.factor > 0.0))) and (
        not isinstance(last, Affine) or (last.form == "rescale" and np.all(last.factor > 0.0))
    )
    inner = network.layers[1:-1]
    return network.n_outputs == 1 and bool(ends) and all(isinstance(x, Dense) and x.activation != "step" for x in inner)


def roomy(model: Model, network: Network) -> bool:
    """Has code that folds its networks room for the pieces of this one?"""
    if model.pieces == 0 or model.more_pieces == "layers" or not fold.foldable(network):
        return True
    return fold.pieces(network, model.outside == "clamp") <= model.pieces


def learn(network: Network, x: Array, wanted: Array) -> tuple[Network, float]:
    """The network with weights such that it gives `wanted` [n] at inputs x [n, inputs]; and the RMS that is left."""
    damping = 1.0  # short steps first: long ones throw neurons out of the motion that was seen
    off = wanted - network.evaluate(x)[:, 0]
    for _ in range(ITERATIONS):
        slopes = derivatives(network, x)
        square, down = slopes.T @ slopes, slopes.T @ off
        scale = np.diag(square) + 1e-9 * np.max(np.diag(square))
        while damping < 1e8:
            trial = moved(network, np.asarray(np.linalg.solve(square + damping * np.diag(scale), down), float))
            left = wanted - trial.evaluate(x)[:, 0]
            if left @ left < off @ off:
                break
            damping *= 10.0
        else:
            break
        done = left @ left > (1.0 - 1e-4) * (off @ off)
        network, off, damping = trial, left, damping / 3.0
        if done:
            break
    return network, float(np.sqrt(np.mean(off**2)))


def derivatives(network: Network, x: Array) -> Array:
    """Derivatives of the output with respect to all weights and biases of dense layers, in their order: [n, weights]."""
    inputs = [x]
    for layer in network.layers:
        inputs.append(layer_value(layer, inputs[-1]))
    back, columns = np.ones((len(x), 1)), []
    for layer, h in zip(network.layers[::-1], inputs[-2::-1], strict=True):
        if isinstance(layer, Affine):
            back = back * layer.factor
        else:
            back = back * layer_slope(layer, h)
            columns += [back, (back[:, :, None] * h[:, None, :]).reshape(len(x), -1)]
            back = back @ layer.weights
    return np.concatenate(columns[::-1], axis=1)


def moved(network: Network, change: Array) -> Network:
    """The network with all weights and biases of dense layers changed."""
    layers, at = [], 0
    for layer in network.layers:
        if isinstance(layer, Dense):
            w, b = layer.weights.size, layer.bias.size
            weights = layer.weights + change[at : at + w].reshape(layer.weights.shape)
            layer = Dense(weights, layer.bias + change[at + w : at + w + b], layer.activation)
            at += w + b
        layers.append(layer)
    return replace(network, layers=tuple(layers))


def as_json(network: Network) -> str:
    """The network in the JSON form that a model file reads."""
    first, last = network.layers[0], network.layers[-1]
    top: dict[str, object] = {}
    if isinstance(first, Affine):
        top["normalise"] = {"kind": "min-max", "min": first.shift.tolist(), "max": (first.shift + 1.0 / first.factor).tolist()}
    top["layers"] = [
        {"activation": x.activation, "weights": x.weights.tolist(), "bias": x.bias.tolist()} for x in network.layers if isinstance(x, Dense)
    ]
    if isinstance(last, Affine):
        top["denormalise"] = {"kind": "min-max", "min": last.shift.tolist(), "max": (last.shift + last.factor).tolist()}
    if network.input_min is not None and network.input_max is not None:
        top["trained_range"] = {"min": network.input_min.tolist(), "max": network.input_max.tolist()}
    return json.dumps(top, indent=1)


def write(study: Study, values: Mapping[str, float], learnt: list[Taught], beside: Path, output: Path) -> Path:
    """model_absorbed.toml and its networks into `output`; `beside` is the path from there to the nominal file."""
    lines = [
        f"# The nominal model with one more set, in which {', '.join(t.element for t in learnt)} includes what the recordings show.",
        "# It has the layout of the nominal code: it can be staged into a running controller.",
        "",
        "[model]",
        f'extends = "{beside.as_posix()}"',
        "",
        f"[sets.{SET}]",
    ]
    networks = dict(study.model.sets[study.set_name].networks) if study.set_name != "default" else {}
    for name, network in (networks | {t.port: t.network for t in learnt}).items():
        (output / f"{name}_{SET}.json").write_text(as_json(network))
        lines.append(f'{name} = "{name}_{SET}.json"')
    for p in study.model.parameters.values():
        if p.tunable:
            lines.append(f'{p.name} = "{values.get(p.name, p.value) / units.factor(p.unit):.7g} {p.unit}"')
    path = output / FILE
    path.write_text("\n".join(lines) + "\n")
    return path
