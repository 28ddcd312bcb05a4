"""C of the networks: one function for all of the same architecture, with slopes and second derivatives where they are needed."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from ..model import Model
from ..networks import Affine, Dense, Layer, Network
from ..sets import packing
from ..sets.fold import foldable
from .c_text import real

_AFFINE = {"centre": "pen_centre", "rescale": "pen_rescale"}


@dataclass(frozen=True)
class NetworkCode:
    """One function for all networks of the same architecture."""

    name: str
    shape: str
    users: tuple[str, ...]
    network: Network
    folded: bool

    @property
    def n(self) -> int:
        """Number of inputs."""
        return self.network.n_inputs

    @property
    def width(self) -> int:
        """Values of the widest layer."""
        return max(self.n, *(layer.n_out for layer in self.network.layers))

    def chain(self) -> list[str]:
        """The layers in the form that pen_fold() takes."""
        kinds = {"identity": "DENSE", "relu": "RELU"}
        return [
            f"{{ PEN_LAYER_{layer.form.upper() if isinstance(layer, Affine) else kinds[layer.activation]}, {layer.n_in}U, {layer.n_out}U }}"
            for layer in self.network.layers
        ]

    @property
    def neurons(self) -> int:
        """Number of neurons in all ReLU layers."""
        return sum(layer.n_out for layer in self.network.layers if _relu(layer))

    def layers(self) -> list[tuple[Layer, str]]:
        """Each layer with the C text of where its values begin."""
        return [
            (la, f"&p[{piece.offset}]") for la, piece in zip(self.network.layers, packing.network_pieces(self.network)[1:], strict=True)
        ]


def network_code(model: Model) -> list[NetworkCode]:
    first = model.sets.get("default")
    groups: dict[object, list[tuple[str, Network]]] = {}
    for name, network in (first.networks if first else {}).items():
        groups.setdefault(network.architecture, []).append((name, network))
    found = []
    for i, users in enumerate(groups.values()):
        name = f"{model.name}_network_{chr(ord('a') + i)}" if len(groups) > 1 else f"{model.name}_network"
        sizes = [users[0][1].n_inputs] + [la.n_out for la in users[0][1].layers if isinstance(la, Dense)]
        found.append(
            NetworkCode(
                name, " -> ".join(map(str, sizes)), tuple(n for n, _ in users), users[0][1], model.pieces > 0 and foldable(users[0][1])
            )
        )
    return found


def network_lines(model: Model, code: NetworkCode) -> dict[str, Any]:
    """Statements that take a network from `in` to its output, and the buffers they need."""
    lines, here, relu = [], "in", ""  # relu: the activation of the layer before is still to be applied
    if model.outside == "clamp":
        lines.append(f"pen_clamp({code.n}U, &p[0], in, h);")
        here = "h"
    layers = code.layers()
    while layers:
        (layer, at), *layers = layers
        fresh = "h" if here == "in" else here  # where a layer that reads all before it writes may put its result
        hidden = 0 if relu else hidden16([layer, *(la for la, _ in layers)])
        if hidden:
            lines.append(f"{fresh}[0] = pen_net16({hidden}U, {at}, {here}[0]);")
            layer, layers = layers[hidden][0], layers[hidden + 1 :]
        elif isinstance(layer, Affine):
            lines += [f"pen_act_relu({layer.n_out}U, {here});"] if relu else []
            lines.append(_affine(layer, at, here, fresh))
        elif layer.n_out == 1:
            lines.append(f"{fresh}[0] = pen_dense1{relu}({layer.n_in}U, {at}, {here});")
        else:
            fresh = "g" if here == "h" else "h"
            lines.append(f"pen_dense{relu}({layer.n_out}U, {layer.n_in}U, {at}, {here}, {fresh});")
        lines += _activation(layer, fresh)
        here, relu = fresh, _relu(layer)
    lines += [f"pen_act_relu(1U, {here});"] if relu else []
    if model.outside == "fade":
        lines.append(f"return {here}[0] * pen_fade({code.n}U, &p[0], {real(model.fade_width)}, in);")
    else:
        lines.append(f"return {here}[0];")
    lines = by_value(code, lines)
    return {"lines": lines, "buffers": [b for b in "hg" if any(f"{b}[" in t or f" {b})" in t or f" {b}," in t for t in lines)]}


def slope_lines(model: Model, code: NetworkCode) -> list[str]:
    """Statements for value and derivatives: h is the value, t[i] the change of h with input i; g and s the next ones."""
    n, fade = code.n, real(model.fade_width)
    lines: list[str] = []

    def each(statement: str) -> None:
        lines.extend(_loops(statement, n))

    if model.outside == "clamp":
        lines.append(f"pen_clamp({n}U, &p[0], in, h);")
        start = f"pen_clamp_slope({n}U, &p[0], in, @U)"
    else:
        each("h[@] = in[@];")
        start = "(pen_real_t)1"
    each(f"t[@][%] = {start};" if n == 1 else f"t[@][%] = (@ == %) ? {start} : (pen_real_t)0;")
    h, g, t, s, relu = "h", "g", "t", "s", ""
    layers = code.layers()
    while layers:
        (layer, at), *layers = layers
        hidden = 0 if relu else hidden16([layer, *(la for la, _ in layers)])
        if hidden:
            layer, layers = layers[hidden][0], layers[hidden + 1 :]
            lines += [f"{g}[0] = pen_net16_slope({hidden}U, {at}, {h}[0], {s}[0]);", f"{s}[0][0] *= {t}[0][0];"]
            lines += _activation(layer, g)
            if isinstance(layer, Dense) and layer.activation != "identity":
                lines.append(f"pen_slope_{layer.activation}(1U, {g}, {s}[0]);")
            h, g, t, s, relu = g, h, s, t, _relu(layer)
            continue
        if isinstance(layer, Affine):
            lines += [f"pen_act_relu({layer.n_out}U, {h});"] if relu else []
            lines.append(_affine(layer, at, h, h))
            each(f"{_AFFINE[layer.form]}_tangent({layer.n_out}U, {at}, {t}[@]);")
            relu = ""
            continue
        lines.append(f"pen_dense{relu}({layer.n_out}U, {layer.n_in}U, {at}, {h}, {g});")
        lines += _activation(layer, g)
        each(f"pen_dense_tangent({layer.n_out}U, {layer.n_in}U, {at}, {t}[@], {s}[@]);")
        if layer.activation != "identity":
            each(f"pen_slope_{layer.activation}({layer.n_out}U, {g}, {s}[@]);")
        h, g, t, s, relu = g, h, s, t, _relu(layer)
    lines += [f"pen_act_relu(1U, {h});"] if relu else []
    each(f"slope[@] = {t}[@][0];")
    if model.outside == "fade":
        lines.append(f"const pen_real_t trust = pen_fade({n}U, &p[0], {fade}, in);")
        each(f"slope[@] = (trust * slope[@]) + ({h}[0] * pen_fade_slope({n}U, &p[0], {fade}, in, @U));")
        lines.append(f"return {h}[0] * trust;")
    else:
        lines.append(f"return {h}[0];")
    return lines


def second_lines(model: Model, code: NetworkCode) -> list[str]:
    """Statements for second derivatives: t[i] as above, c[i][j] the change of t[i] with input j."""
    n, fade = code.n, real(model.fade_width)
    lines: list[str] = []

    def each(statement: str) -> None:
        lines.extend(_loops(statement, n))

    clamp = model.outside == "clamp"
    if clamp:
        lines.append(f"pen_clamp({n}U, &p[0], in, h);")
    else:
        each("h[@] = in[@];")
    start = f"pen_clamp_slope({n}U, &p[0], in, @U)" if clamp else "(pen_real_t)1"
    each(f"t[@][%] = {start};" if n == 1 else f"t[@][%] = (@ == %) ? {start} : (pen_real_t)0;")
    each("c[@][%][#] = (pen_real_t)0;")
    h, g, t, s, c, d, relu = "h", "g", "t", "s", "c", "d", ""
    for layer, at in code.layers():
        if isinstance(layer, Affine):
            lines += [f"pen_act_relu({layer.n_out}U, {h});"] if relu else []
            lines.append(_affine(layer, at, h, h))
            each(f"{_AFFINE[layer.form]}_tangent({layer.n_out}U, {at}, {t}[@]);")
            each(f"{_AFFINE[layer.form]}_tangent({layer.n_out}U, {at}, {c}[@][%]);")
            relu = ""
            continue
        lines.append(f"pen_dense{relu}({layer.n_out}U, {layer.n_in}U, {at}, {h}, {g});")
        lines += _activation(layer, g)
        each(f"pen_dense_tangent({layer.n_out}U, {layer.n_in}U, {at}, {t}[@], {s}[@]);")
        each(f"pen_dense_tangent({layer.n_out}U, {layer.n_in}U, {at}, {c}[@][%], {d}[@][%]);")
        if layer.activation in ("relu", "step"):
            each(f"pen_slope_{layer.activation}({layer.n_out}U, {g}, {d}[@][%]);")
        elif layer.activation != "identity":
            each(f"pen_second_{layer.activation}({layer.n_out}U, {g}, {s}[@], {s}[%], {d}[@][%]);")
        if layer.activation != "identity":
            each(f"pen_slope_{layer.activation}({layer.n_out}U, {g}, {s}[@]);")
        h, g, t, s, c, d, relu = g, h, s, t, d, c, _relu(layer)
    each(f"second[@][%] = {c}[@][%][0];")
    if model.outside == "fade":
        lines.append(f"const pen_real_t trust = pen_fade({n}U, &p[0], {fade}, in);")
        slope = f"pen_fade_slope({n}U, &p[0], {fade}, in, ?U)"
        each(f"second[@][%] = (trust * second[@][%]) + ({t}[@][0] * {slope.replace('?', '%')}) + ({t}[%][0] * {slope.replace('?', '@')});")
    return lines


def by_value(code: NetworkCode, lines: list[str]) -> list[str]:
    """A single input is a number, not a row of one."""
    if code.n > 1:
        return lines
    return [re.sub(r"\bin\[0\]", "in", re.sub(r"\bin([,)])", r"&in\1", line)) for line in lines]


def _loops(statement: str, n: int) -> list[str]:
    """The statement for every input @, every pair of inputs @, % or every triple @, %, #."""
    if n == 1:
        return [statement.replace("@U", "0U").replace("%U", "0U").replace("@", "0").replace("%", "0").replace("#", "0")]
    marks = [(mark, name) for mark, name in zip("@%#", "ijk", strict=True) if mark in statement]
    for mark, name in marks:
        statement = statement.replace(f"{mark}U", name).replace(mark, name)
    lines = [statement]
    for _, name in reversed(marks):
        lines = [f"for (size_t {name} = 0U; {name} < {n}U; {name}++) {{", *(f"    {line}" for line in lines), "}"]
    return lines


def _affine(layer: Affine, at: str, here: str, there: str) -> str:
    """A single value is scaled in place of a call."""
    if layer.n_out > 1:
        return f"{_AFFINE[layer.form]}({layer.n_out}U, {at}, {here}, {there});"
    first = int(at[3:-1])
    if layer.form == "centre":
        return f"{there}[0] = ({here}[0] - p[{first}]) * p[{first + 1}];"
    return f"{there}[0] = ({here}[0] * p[{first}]) + p[{first + 1}];"


def _shape(layer: Layer) -> tuple[int, ...]:
    """(inputs, outputs) of a dense layer."""
    return (layer.n_in, layer.n_out) if isinstance(layer, Dense) else ()


def hidden16(layers: list[Layer]) -> int:
    """How many layers 16 -> 16 a network 1-16-...-16-1 that begins here has; 0 if it is none with at least one."""
    n = 0
    while len(layers) > n + 1 and _shape(layers[n + 1]) == (16, 16) and _relu(layers[n + 1]):
        n += 1
    begins = _shape(layers[0]) == (1, 16) and bool(_relu(layers[0]))
    return n if begins and len(layers) > n + 1 and _shape(layers[n + 1]) == (16, 1) else 0


def _relu(layer: Layer) -> str:
    """Suffix of the kernel that reads this layer's values: it applies the ReLU."""
    return "_relu" if isinstance(layer, Dense) and layer.activation == "relu" else ""


def _activation(layer: Layer, buffer: str) -> list[str]:
    if isinstance(layer, Affine) or layer.activation in ("relu", "identity"):
        return []
    return [f"pen_act_{layer.activation}({layer.n_out}U, {buffer});"]
