# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A model as an eFMI block in GALEC: the method of integration in loops, networks as matrix expressions, nothing scalarised."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import sympy as sp

from ...algebra import expressions as ex
from ...algebra.causalise import Causal, Step, causalise
from ...model import Model
from ...version import VERSION
from ..interface import ExportError
from ..templating import render
from . import galec_text as text, variables as ev
from .networks import Function, functions

# Nodes, weights and the divisor of the weights of methods in which every stage builds on the one before.
METHODS = {"euler": ((0.0,), (1.0,), 1.0), "heun": ((0.0, 1.0), (1.0, 1.0), 2.0), "rk4": ((0.0, 0.5, 0.5, 1.0), (1.0, 2.0, 2.0, 1.0), 6.0)}
_LOCALS = ("refused", "bad", "x0", "x", "xs", "k", "total", "share", "node", "weight", "y", "i", "s")


@dataclass(frozen=True)
class Block:
    """The Algorithm Code of a model and its variables, in the order of their declarations."""

    text: str
    variables: list[ev.Variable]
    signals: dict[str, tuple[str, ...]]  # of each method

    def of(self, causality: str) -> list[ev.Variable]:
        """The variables of one causality."""
        return [v for v in self.variables if v.causality == causality]


def block(model: Model) -> Block:
    """The block of a model. Raises ExportError, with a line for each thing that has no form in it."""
    causal = causalise(model)
    _check(model, causal)
    return _Writer(model, causal).block()


def _check(model: Model, causal: Causal) -> None:
    problems = []
    if model.method not in METHODS:
        problems.append(f'method = "{model.method}": it has no form in Algorithm Code here; use one of {", ".join(METHODS)}')
    if model.interpolation not in ("held", "linear"):
        problems.append(f'input = "{model.interpolation}": it has no form in Algorithm Code here; use held or linear')
    if model.guard.out_of_range != "report":
        problems.append(f'out_of_range = "{model.guard.out_of_range}": it has no form in Algorithm Code here; use report')
    problems += [
        f"'{s.name}': an actuator that works on samples has no form in Algorithm Code here; leave it out or use a lag"
        for s in model.sampled
    ]
    if model.interpolation == "held" and causal.uses([*causal.rates, *causal.outputs], causal.input_rates):
        problems.append('input = "held": the model reads the rate of an input, which then has no form in Algorithm Code here; use linear')
    if problems:
        raise ExportError(*(f"{model.path.name}: {p}" for p in problems))


class _Writer:
    def __init__(self, model: Model, causal: Causal):
        self.model, self.causal = model, causal
        kinematics = {ex.derivative(q.name): v for q, v in causal.kinematics.items()}
        self.rates, self.outputs = (tuple(r.subs(kinematics) for r in results) for results in (causal.rates, causal.outputs))
        self.targets = {s.target.name for s in causal.steps}
        self.names = {*model.states, *model.parameters, *model.networks, *(i.name for i in model.inputs), *self.targets}
        self.locals = {label: self._free(label) for label in _LOCALS}
        self.functions = functions(model, [*self.names, *_LOCALS])
        self.function_of = {user: f for f in self.functions for user in f.users}
        self.declared: dict[str, None] = {}
        used = {s.name for s in self._symbols()}
        self.variables = ev.collect(model, causal, used)
        self.shown = {v.label: v for v in self.variables}
        self.taken = {v.label for v in self.variables if v.causality not in ("constant", "state")}

    def _free(self, label: str) -> str:
        while label in self.names:
            label += "_"
        return label

    def _symbols(self) -> set[sp.Symbol]:
        results = [*self.rates, *self.outputs]
        steps = self.causal.needed(results)
        return set().union(*(r.free_symbols for r in results), *(s.reads for s in steps))

    def block(self) -> Block:
        """The text, with what the template needs for it."""
        model, tunable = self.model, any(v.causality == "tunableParameter" for v in self.variables)
        integrate, outputs = self._body(self.rates, "k") if model.states else [], self._body(self.outputs, "y")
        signals: dict[str, tuple[str, ...]] = {"Startup": (), "Recalibrate": ("NAN",) if tunable else (), "DoStep": ("NAN",)}
        context = (
            self._method()
            | self._inputs()
            | {
                "model": model,
                "version": VERSION,
                "name": text.name(model.name),
                "functions": self.functions,
                "signals": signals,
                "at": self.locals,
                "declared": list(self.declared),
                "integrate": integrate,
                "outputs": outputs,
                "n_x": len(model.states),
                "n_y": len(model.outputs),
                "array": text.array,
                "real": text.real,
                "of": lambda causality: [v for v in self.variables if v.causality == causality],
                "started": f"self.{text.name(ev.STARTED)}",
                "own": lambda label: self.shown[label].own,
                "shown": [(text.name(s.name), n) for n, s in enumerate(self.causal.states, 1) if self._is_read(s)],
            }
        )
        return Block(render("efmu/galec.alg.j2", **context), self.variables, signals)

    def _method(self) -> dict[str, Any]:
        nodes, weights, divisor = METHODS[self.model.method]
        step = f"self.{text.name(ev.STEP_SIZE)}"
        substeps = text.real(float(self.model.substeps))
        return {
            "nodes": ", ".join(map(text.real, nodes)),
            "weights": ", ".join(map(text.real, weights)),
            "stages": len(nodes),
            "divisor": text.real(divisor),
            "step": step,
            "substeps": substeps,
            "h": step if self.model.substeps == 1 else f"({step} / {substeps})",
        }

    def _inputs(self) -> dict[str, Any]:
        """Inputs at a share of the sample, as the stages see them; their rates; and inputs at the sample, as outputs see them."""
        drive, read = [], self._symbols()
        for i in self.model.inputs:
            now, before = (f"self.{text.name(label)}" for label in (i.name, f"previous({i.name})"))
            if ex.symbol(i.name) in read and self.model.states:
                moving = f"{before} + ({self.locals['share']} * ({now} - {before}))"
                drive.append(f"{text.name(i.name)} := {moving if self.model.interpolation == 'linear' else before};")
        inputs = [i.name for i in self.model.inputs if ex.symbol(i.name) in read]
        rates = [i.name for i in self.model.inputs if ex.derivative(i.name) in read]
        return {"drive": drive, "sampled": [text.name(i) for i in inputs], "rates": [(text.name(f"derivative({i})"), i) for i in rates]}

    def _is_read(self, s: sp.Symbol) -> bool:
        return s in self._symbols()

    # -- expressions ----------------------------------------------------------------------------------------------

    def _body(self, results: tuple[sp.Expr, ...], target: str) -> list[str]:
        """Statements that compute `results` into the local array `target`, from locals named as states and inputs."""
        lines = []
        for step in self.causal.needed(results):
            lines += self._step(step)
        values = ", ".join(self._print(r) for r in results)
        read = set().union(*(r.free_symbols for r in results), *(s.reads for s in self.causal.needed(results))) if results else set()
        for s in (*self.causal.states, *self.causal.inputs, *self.causal.input_rates):
            if s in read:
                self._declare(s)
        return [*lines, f"{self.locals[target]} := {{{values}}};"]

    def _declare(self, s: sp.Symbol) -> str:
        label = s.name.replace("der(", "derivative(")
        self.declared.setdefault(f"Real {text.name(label)};")
        return text.name(label)

    def _step(self, step: Step) -> list[str]:
        name = self._declare(step.target)
        remark = [f"/* {step.comment} */"] if step.comment else []
        if not step.network:
            return [*remark, f"{name} := {self._print(step.value)};"]
        function: Function = self.function_of[step.network]
        given = [f"self.{text.name(f'{step.network}.{part}')}" for part, _ in function.parts]
        arguments = [self._print(a) for a in step.arguments]
        given.append(arguments[0] if len(arguments) == 1 else "{" + ", ".join(arguments) + "}")
        return [*remark, f"{name} := {function.name}({', '.join(given)});"]

    def _print(self, e: sp.Expr | None) -> str:
        return text.Printer(self._symbol)(e)

    def _symbol(self, s: sp.Symbol) -> str:
        parameter = self.model.parameters.get(s.name)
        if parameter is None:
            return text.name(s.name.replace("der(", "derivative("))
        label = s.name if parameter.tunable else ev.constant(s.name, self.taken)
        return f"self.{text.name(label)}"
