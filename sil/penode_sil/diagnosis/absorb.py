# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A fitted law taught to a network that sees the same motion: a parameter set for the ECU that runs already.

The network keeps its shape, so the set has the layout of the running code and can be staged as it is. Only weights of dense
layers move (Levenberg-Marquardt, exact derivatives), from where they are, over the motion that was seen and trained.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from penode_gen import units
from penode_gen.laws import LAWS
from penode_gen.model import Element, Model
from penode_gen.networks import Affine, Dense, Network, layer_slope, layer_value
from penode_gen.sets import fold

from .explanation import Explanation
from .hypotheses import Basis, size
from .naming import Curve
from .study import Study

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


def taught(study: Study, e: Explanation) -> list[Taught]:
    """All networks of one input that can take up a cause beside them; none if a cause has memory, if no network sees it, or
    if the code that runs would refuse what was learnt."""
    chosen = study.model.sets[study.set_name].networks if study.model.sets else {}
    values = {f.target: f.value for f in e.fit.free}
    found = []
    for element in study.model.elements:
        if element.law != "network" or len(element.network_inputs) != 1 or element.network not in chosen:
            continue
        port, network = study.model.networks[element.network], chosen[element.network]
        plain = all(units.factor(u) == 1.0 for u in (*port.input_units, port.output_unit))
        own = [(t, n) for t, n in zip(e.terms, e.built.names, strict=True) if _fits(study, t.candidate.what, element)]
        if own and plain and _movable(network):
            x, law = _lesson(study, element, network, Curve(*zip(*own, strict=True)), values, own[0][0].candidate.what.place)
            learnt, left = learn(network, x[:, None], network.evaluate(x[:, None])[:, 0] + law)
            if network.input_min is not None:
                learnt = replace(learnt, input_min=np.array([np.min(x)]), input_max=np.array([np.max(x)]))
            missing = left / float(np.sqrt(np.mean(law**2)))
            if missing < LEARNT and roomy(study.model, learnt):
                found.append(Taught(element.network, element.name, learnt, missing))
    return found


def _fits(study: Study, what: object, element: Element) -> bool:
    """Does an elementary law act where a network does, on the same input, without memory?"""
    if not isinstance(what, Basis) or all(name != element.name for name, _ in study.places[what.place].elements):
        return False
    if what.law in LAWS and LAWS[what.law].states:
        return False
    text = LAWS[what.law].force if what.law in LAWS else what.law
    return {{"s": "deflection", "v": "rate"}[w] for w in re.findall(r"\b[sv]\b", text)} == {element.network_inputs[0]}


def _lesson(
    study: Study, element: Element, network: Network, curve: Curve, values: Mapping[object, float], place: int
) -> tuple[Array, Array]:
    """Inputs of the network, and the force that the law adds there [points]."""
    sense = next(sense for name, sense in study.places[place].elements if name == element.name)
    by_rate = element.network_inputs[0] == "rate"
    moved = np.concatenate([sense * (m.v if by_rate else m.s) for m in (s.motions[place] for s in study.seen)])
    reach = size([s.motions[place] for s in study.seen])[int(by_rate)]
    low, high = -reach, reach
    if network.input_min is not None and network.input_max is not None:
        low, high = min(low, float(network.input_min[0])), max(high, float(network.input_max[0]))
    x = np.concatenate([np.linspace(low, high, POINTS // 2), np.quantile(moved, np.linspace(0.0, 1.0, POINTS // 2))])
    zero = np.zeros_like(x)
    force = curve(zero, sense * x, values) if by_rate else curve(sense * x, zero, values)
    return x, sense * force


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
            trial = moved(network, np.linalg.solve(square + damping * np.diag(scale), down))
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


def write(study: Study, e: Explanation, learnt: list[Taught], beside: Path, output: Path) -> Path:
    """model_absorbed.toml and its networks into `output`; `beside` is the path from there to the nominal file."""
    values = {f.target: f.value for f in e.fit.free}
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
