# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A whole model in Modelica: its own equations, unsorted, and networks as matrix equations. Nothing but the language is needed."""

from __future__ import annotations

from collections.abc import Set

import sympy as sp
from sympy.core.function import AppliedUndef

from ...algebra import expressions as ex
from ...algebra.mechanics import Relation, aliases, balances, forces, kinematics, meanings, state_unit
from ...model import Model
from ...networks import Affine, Layer, Network, Vector
from ...version import VERSION
from ..interface import ExportError
from ..templating import render
from .text import array, expression, identifier, quoted, real, unit


def text(model: Model, chosen: str) -> str:
    """The .mo file with the parameter set `chosen`. Raises ExportError for what continuous Modelica has no form for."""
    return _Writer(model, chosen).text()


class _Writer:
    def __init__(self, model: Model, chosen: str):
        self.model, self.set = model, model.sets[chosen] if model.sets else None
        self.declared: list[str] = []
        self.equations: list[str] = []
        self.calls: dict[sp.Expr, str] = {}
        self.rates: dict[sp.Expr, sp.Expr] = {}
        self.taken = {identifier(n) for n in (*model.states, *model.parameters, *(i.name for i in model.inputs))}
        self.relations, self.signals, self.unit_of = self._parsed()

    def _parsed(self) -> tuple[list[Relation], list[tuple[str, str, str, sp.Expr]], dict[str, str]]:
        """Equations and signals of the model file, with deflections shared and points resolved."""
        model = self.model
        kinematic, unit_of = kinematics(model)
        names = set(unit_of)
        ports = {name: len(port.input_units) for name, port in model.networks.items()}
        moving = {*model.states, *(i.name for i in model.drives), *(p.name for p in model.points)}

        def parse(where: tuple[str, ...], source: str, extra: Set[str] = frozenset()) -> sp.Expr:
            return ex.parse(source, names | extra, ports, moving)

        found = [*kinematic, *forces(model, parse, names, lambda *problem: None), *balances(model)]
        for q in model.equations:
            left, right = (parse(("equations", q.name), side) for side in ex.sides(q.text))
            found.append(Relation(("equations", q.name), left, right, q.name))
        rename, meant = aliases(model), meanings(model)
        found = [Relation(q.where, q.left.xreplace(meant), q.right.xreplace(meant), q.comment) for q in found if q.left not in rename]
        signals = [
            (s.name, s.unit, s.description, parse(("outputs", s.name), s.expression).xreplace(meant))
            for s in (*model.outputs, *model.sensors)
        ]
        return _used(found, signals), signals, unit_of

    def text(self) -> str:
        model = self.model
        problems = [
            f"'{s.name}': an actuator that works on samples has no form in continuous Modelica; leave it out or use a lag"
            for s in model.sampled
        ]
        problems += ['outside = "fade": it has no form here; use "extrapolate" or "clamp"'] if model.outside == "fade" else []
        if problems:
            raise ExportError(*(f"{model.path.name}: {p}" for p in problems))
        self._parameters()
        self._signals()
        for b in model.bodies:
            self.equations.append(f"der({b.position}) = {b.velocity};")
        for q in self.relations:
            self._declare(q)
            comment = f" {quoted(q.comment)}" if q.comment else ""
            self.equations.append(f"{self._print(q.left)} = {self._print(q.right)}{comment};")
        for name, about, meaning in self.outputs:
            self.equations.append(f"{name} = {self._print(meaning)}{about};")
        for call, name in list(self.calls.items()):
            self._network(call, name)
        return render(
            "modelica/model.mo.j2",
            model=model,
            name=identifier(model.name),
            version=VERSION,
            declared=self.declared,
            equations=self.equations,
            description=quoted(model.description or model.name),
        )

    def _print(self, e: sp.Expr) -> str:
        for call in sorted(e.atoms(AppliedUndef), key=str):
            self.calls.setdefault(call, self._free(f"{call.func.__name__}_{1 + sum(c.func == call.func for c in self.calls)}"))
        return expression(e.xreplace({call: ex.symbol(f"{name}_y") for call, name in self.calls.items()} | self.rates))

    def _free(self, name: str) -> str:
        while name in self.taken:
            name += "_"
        self.taken.add(name)
        return name

    def _parameters(self) -> None:
        for p in self.model.parameters.values():
            value = self.set.parameters.get(p.name, p.value) if self.set and p.tunable else p.value
            self._line("parameter Real", p.name, p.unit, real(value), p.description)
        for name, network in (self.set.networks if self.set else {}).items():
            for part, values in arrays(network):
                shape = ", ".join(str(n) for n in values.shape)
                self.declared.append(f"parameter Real {self._free(f'{name}_{part}')}[{shape}] = {array(values, '    ')};")

    def _line(self, kind: str, name: str, si: str, value: str = "", description: str = "", more: str = "") -> None:
        self.declared.append(
            f'{kind} {name}(unit="{unit(si)}"{more}){f" = {value}" if value else ""}{f" {quoted(description)}" if description else ""};'
        )

    def _signals(self) -> None:
        """Inputs, outputs and states; an output that shows a state of its own name is that state."""
        model = self.model
        differentiated = set().union(
            *(q.right.free_symbols | q.left.free_symbols for q in self.relations), *(e.free_symbols for *_, e in self.signals)
        )
        for i in model.inputs:
            self._line("input Real", i.name, i.unit, description=i.description)
            if ex.derivative(i.name) in differentiated:  # an input of a top model has no derivative: it is another input
                rate = self._free(f"der_{i.name}")
                self.rates[ex.derivative(i.name)] = ex.symbol(rate)
                self._line("input Real", rate, f"{i.unit or '1'}/s", description=f"rate of {i.name}: give its derivative")
        shown = {name for name, _, _, e in self.signals if e == ex.symbol(name) and name in model.states}
        for name, start in zip(model.states, model.start, strict=True):
            self._line("output Real" if name in shown else "Real", name, state_unit(model, name), more=f", start={real(start)}, fixed=true")
        for v in model.variables:
            self.taken.add(identifier(v.name))
            self._line("Real", v.name, v.unit)
        self.outputs: list[tuple[str, str, sp.Expr]] = []
        for name, si, description, e in self.signals:
            if name not in shown:
                free = self._free(identifier(name))
                self._line("output Real", free, si, description=description)
                self.outputs.append((free, "", e))

    def _declare(self, q: Relation) -> None:
        """Deflections, rates and forces of elements are variables of their own."""
        if q.left.is_Symbol and q.left.name in self.unit_of and q.left.name not in self.taken:
            self.taken.add(identifier(q.left.name))
            self._line("Real", q.left.name, self.unit_of[q.left.name], description=q.comment)

    def _network(self, call: sp.Expr, name: str) -> None:
        """A network at one place: a vector for each layer."""
        owner = call.func.__name__
        network = self.set.networks[owner] if self.set else None
        if network is None:
            raise ExportError(f"{self.model.path.name}: the network '{owner}' has no weights; add a set")
        given = "{" + ", ".join(self._print(a) for a in call.args) + "}"
        self.declared += [f"Real {name}_h0[{network.n_inputs}];", f"Real {name}_y;"]
        clamp = self.model.outside == "clamp" and network.input_min is not None
        self.equations.append(f"{name}_h0 = {self._clamped(owner, call, network) if clamp else given};")
        counted = {"dense": 0, "scale": 0}
        for k, layer in enumerate(network.layers, 1):
            kind = "scale" if isinstance(layer, Affine) else "dense"
            counted[kind] += 1
            self._layer(layer, f"{owner}_{'layer' if kind == 'dense' else 'scale'}_{counted[kind]}", name, k)
        self.equations.append(f"{name}_y = {name}_h{len(network.layers)}[1];")

    def _clamped(self, owner: str, call: sp.Expr, network: Network) -> str:
        parts = [f"min(max({self._print(a)}, {owner}_input_min[{i}]), {owner}_input_max[{i}])" for i, a in enumerate(call.args, 1)]
        return "{" + ", ".join(parts) + "}"

    def _layer(self, layer: Layer, part: str, name: str, k: int) -> None:
        before, after = f"{name}_h{k - 1}", f"{name}_h{k}"
        if isinstance(layer, Affine):
            self.declared.append(f"Real {after}[{layer.n_out}];")
            form = "({0}[i] - {1}_shift[i])*{1}_factor[i]" if layer.form == "centre" else "{0}[i]*{1}_factor[i] + {1}_shift[i]"
            self.equations.append(f"for i in 1:{layer.n_out} loop {after}[i] = {form.format(before, part)}; end for;")
            return
        sums = f"{name}_p{k}"
        self.declared += [f"Real {sums}[{layer.n_out}];", f"Real {after}[{layer.n_out}];"]
        self.equations.append(f"{sums} = {part}_weights*{before} + {part}_bias;")
        form = ACTIVATIONS[layer.activation].format(f"{sums}[i]")
        self.equations.append(f"for i in 1:{layer.n_out} loop {after}[i] = {form}; end for;")


def _used(found: list[Relation], signals: list[tuple[str, str, str, sp.Expr]]) -> list[Relation]:
    """Without deflections and rates that nothing reads: the rate of an input would have to be differentiated."""
    while True:
        read = set().union(*(q.right.free_symbols for q in found), *(e.free_symbols for *_, e in signals))
        kept = [
            q
            for q in found
            if q.left in read or not q.left.is_Symbol or not q.left.name.startswith(("s_", "v_")) or q.where[0] != "elements"
        ]
        if len(kept) == len(found):
            return found
        found = kept


ACTIVATIONS = {
    "relu": "max({0}, 0.0)",
    "identity": "{0}",
    "tanh": "tanh({0})",
    "sigmoid": "1.0/(1.0 + exp(-{0}))",
    "softplus": "max({0}, 0.0) + log(1.0 + exp(-noEvent(abs({0}))))",
    "step": "noEvent(if {0} >= 0.0 then 1.0 else 0.0)",
}


def arrays(network: Network) -> list[tuple[str, Vector]]:
    """The numbers of a network with the names of the paper's listing 4: layer_1_weights, layer_1_bias, and of scalings."""
    found: list[tuple[str, Vector]] = []
    if network.input_min is not None and network.input_max is not None:
        found += [("input_min", network.input_min), ("input_max", network.input_max)]
    dense = scale = 0
    for layer in network.layers:
        if isinstance(layer, Affine):
            scale += 1
            found += [(f"scale_{scale}_shift", layer.shift), (f"scale_{scale}_factor", layer.factor)]
        else:
            dense += 1
            found += [(f"layer_{dense}_weights", layer.weights), (f"layer_{dense}_bias", layer.bias)]
    return found
