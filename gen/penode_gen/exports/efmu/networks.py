# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Networks in GALEC: a function for each architecture, a matrix expression and a loop for each layer."""

from __future__ import annotations

from dataclasses import dataclass, field

from ...model import Model
from ...networks import Affine, Dense, Network
from . import galec_text as text

# Activations of the sum p[i] of a neuron. ReLU is as in the C: max(p, 0.0) may turn NaN into 0. Adding 0 p keeps NaN and turns Inf into it.
_ACTIVATIONS = {
    "relu": "0.5 * ({0} + absolute({0}))",
    "tanh": "tanh({0})",
    "sigmoid": text.SIGMOID,
    "softplus": text.SOFTPLUS,
    "step": "(if {0} < 0.0 then 0.0 else 1.0) + (0.0 * {0})",
}


@dataclass
class Function:
    """The text of a function: `parts` are its array inputs, by the names that the layout has behind the network's own."""

    name: str
    users: list[str]
    n_inputs: int
    signals: tuple[str, ...]
    parts: list[tuple[str, str]] = field(default_factory=list)  # name, dimensions
    protected: list[str] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)


def functions(model: Model, free: list[str]) -> list[Function]:
    """One for all networks of the same architecture; names are taken from `free` ones that start with network."""
    groups: dict[object, list[str]] = {}
    networks = model.sets["default"].networks if model.sets else {}
    for name, network in networks.items():
        groups.setdefault(network.architecture, []).append(name)
    found = []
    for number, users in enumerate(groups.values(), 1):
        label = "network" if len(groups) == 1 else f"network_{number}"
        while label in free:
            label += "_"
        found.append(_Writer(model, networks[users[0]], label, users).function)
    return found


class _Writer:
    def __init__(self, model: Model, network: Network, label: str, users: list[str]):
        step = any(isinstance(layer, Dense) and layer.activation == "step" for layer in network.layers)
        self.function = Function(label, users, network.n_inputs, ("NAN",) if step else ())
        self.width, self.here, self.counted = network.n_inputs, "u", {"dense": 0, "affine": 0}
        if model.outside in ("clamp", "fade"):
            self.function.parts += [(edge, f"[{network.n_inputs}]") for edge in ("input_min", "input_max")]
        if model.outside == "clamp":
            self._each("h0", "min(max({u}, input_min[{i}]), input_max[{i}])")
        for k, layer in enumerate(network.layers, 1):
            self._affine(layer, k) if isinstance(layer, Affine) else self._dense(layer, k)
        if model.outside == "fade":
            self._fade(model.fade_width)
        self.function.lines.append(f"y := {self.here};")

    def _declare(self, label: str, width: int) -> None:
        self.function.protected.append(f"Real {label}{f'[{width}]' if width > 1 else ''};")

    def _each(self, label: str, form: str, here: str = "") -> None:
        """label := form of each element {u} of what is here, or of its only one; {i}: its number."""
        here = here or self.here
        self._declare(label, self.width)
        if self.width == 1:
            self.function.lines.append(f"{label} := {form.format(u=here, i=1)};")
        else:
            line = f"{label}[i] := {form.format(u=f'{here}[i]', i='i')};"
            self.function.lines += [f"for i in 1:{self.width} loop", f"  {line}", "end for;"]
        self.here = label

    def _affine(self, layer: Affine, k: int) -> None:
        self.counted["affine"] += 1
        shift, factor = (f"{part}_{self.counted['affine']}" for part in ("shift", "factor"))
        self.function.parts += [(shift, f"[{layer.n_out}]"), (factor, f"[{layer.n_out}]")]
        centre = f"({{u}} - {shift}[{{i}}]) * {factor}[{{i}}]"
        self._each(f"h{k}", centre if layer.form == "centre" else f"({{u}} * {factor}[{{i}}]) + {shift}[{{i}}]")

    def _dense(self, layer: Dense, k: int) -> None:
        """Matrix times vector; of one input, vector times number."""
        self.counted["dense"] += 1
        weights, bias = (f"{part}_{self.counted['dense']}" for part in ("weights", "bias"))
        n_out, n_in = layer.weights.shape
        self.function.parts += [(bias, f"[{n_out}]"), (weights, f"[{n_out}]" if n_in == 1 else f"[{n_out}, {n_in}]")]
        sums = f"p{k}"
        self.function.protected.append(f"Real {sums}[{n_out}];")
        self.function.lines.append(f"{sums} := ({weights} * {self.here}) + {bias};")
        self.width, self.here = n_out, sums if n_out > 1 else f"{sums}[1]"
        if layer.activation != "identity":
            self._each(f"h{k}", _ACTIVATIONS[layer.activation].replace("{0}", "{u}"), self.here)

    def _fade(self, width: float) -> None:
        """1 inside of the trained range, 0 from a share `width` of it outside on."""
        n = self.function.n_inputs
        self.function.protected.append("Real trust;")
        u = "u" if n == 1 else "u[i]"
        i = "1" if n == 1 else "i"
        nearest = f"min({u} - input_min[{i}], input_max[{i}] - {u})"
        line = f"trust := min(trust, 1.0 + ({nearest} / ({text.real(width)} * (input_max[{i}] - input_min[{i}]))));"
        self.function.lines += ["trust := 1.0;"] + ([line] if n == 1 else [f"for i in 1:{n} loop", f"  {line}", "end for;"])
        self.here = f"{self.here} * max(trust, 0.0)"
