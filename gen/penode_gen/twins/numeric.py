"""A model as float64 functions: what the reference simulation integrates. Shares no arithmetic with the C."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from functools import lru_cache, reduce

import numpy as np
import sympy as sp

from ..algebra import expressions as ex
from ..algebra.causalise import Causal, causalise
from ..model import Model
from ..networks import Vector

_NUMPY = [
    {
        "Root": np.sqrt,
        "Logarithm": np.log,
        "Softplus": lambda x: np.logaddexp(0.0, x),
        "Sigmoid": lambda x: 1.0 / (1.0 + np.exp(-x)),
        "Sign": np.sign,
        "Absolute": np.abs,
    },
    "numpy",
]


@lru_cache(maxsize=256)
def along(expression: str, names: tuple[str, ...]) -> Callable[..., Vector]:
    """An expression of the model language as a function of arrays of one shape, or numbers, in the order of `names`."""
    parsed = ex.parse(expression, names, {})
    parsed = parsed.replace(sp.Max, sp.Function("larger")).replace(
        sp.Min, sp.Function("smaller")
    )  # NumPy's own take arrays of one shape only
    modules = [{"larger": lambda *x: reduce(np.maximum, x), "smaller": lambda *x: reduce(np.minimum, x)}, *_NUMPY]
    function: Callable[..., Vector] = sp.lambdify([ex.symbol(n) for n in names], parsed, modules=modules)
    return function


class Numeric:
    """Right-hand side, outputs and sensors of a model with one parameter set; x [n_x], u [n_u], udot = du/dt [n_u]. Behind the inputs u may
    have the signals of actuators that delay or hold samples; without them, these are what they are of inputs that move slowly."""

    def __init__(self, model: Model, set_name: str = "default"):
        self.model = model
        self._causal = causalise(model)
        chosen = model.sets.get(set_name)
        if chosen is None and set_name != "default":
            raise KeyError(f"{model.path.name} has no set '{set_name}'; it has {', '.join(model.sets)}")
        self._networks = chosen.networks if chosen else {}
        self._values = {p.name: p.value for p in model.parameters.values()} | (chosen.parameters if chosen else {})
        self._rates, self._outputs, self._sensors = map(self._function, (self._causal.rates, self._causal.outputs, self._causal.sensors))

    def with_parameters(self, values: Mapping[str, float]) -> Numeric:
        """The same equations with other values of these parameters, at no cost: nothing is ordered or compiled again. KeyError for
        a parameter that the model does not have."""
        if unknown := values.keys() - self._values.keys():
            raise KeyError(f"{self.model.path.name} has no parameter {', '.join(sorted(unknown))}")
        other = copy(self)
        other._values = {**self._values, **values}
        return other

    def initial_state(self) -> Vector:
        """Start values of all states, SI."""
        return np.array(self.model.start, dtype=float)

    def rates(self, x: Vector, u: Vector, udot: Vector) -> Vector:
        """dx/dt [n_x]."""
        return self._rates(x, u, udot, self._values)

    def outputs(self, x: Vector, u: Vector, udot: Vector) -> Vector:
        """Outputs [n_y]."""
        return self._outputs(x, u, udot, self._values)

    def sensors(self, x: Vector, u: Vector, udot: Vector) -> Vector:
        """Sensors [n_z], without noise."""
        return self._sensors(x, u, udot, self._values)

    def _function(self, results: tuple[sp.Expr, ...]) -> Callable[..., Vector]:
        causal: Causal = self._causal
        given = [*causal.states, *causal.inputs, *causal.input_rates, *map(ex.symbol, self._values)]
        kinematics = {ex.derivative(q.name): v for q, v in causal.kinematics.items()}
        results = tuple(r.subs(kinematics) for r in results)
        known = list(given)
        plan: list[tuple[Callable[..., list[float]], str]] = []
        for step in causal.needed(results):
            plan.append((self._lambdify(known, [p.subs(kinematics) for p in step.parts]), step.network))
            known.append(step.target)
        last = self._lambdify(known, results)
        networks = {n: net.evaluate for n, net in self._networks.items()}
        whole = self._whole

        def function(x: Vector, u: Vector, udot: Vector, parameters: Mapping[str, float]) -> Vector:
            values = [*x, *whole(u), *whole(udot), *parameters.values()]
            for expression, network in plan:
                found = expression(*values)
                values.append(float(networks[network](np.array(found, dtype=float))[0]) if network else found[0])
            return np.array(last(*values), dtype=float)

        return function

    def _whole(self, u: Vector) -> Sequence[float] | Vector:
        """Inputs or their rates, and what actuators make of them."""
        names = [i.name for i in self.model.inputs]
        if len(u) > len(names) or not self.model.sampled:
            return u
        of = dict(zip(names, u, strict=True))
        for s in self.model.sampled:
            of[s.name] = of[s.source]
        return list(of.values())

    def _lambdify(self, known: list[sp.Symbol], parts: list[sp.Expr] | tuple[sp.Expr, ...]) -> Callable[..., list[float]]:
        names = [sp.Symbol(f"a{i}", real=True) for i in range(len(known))]
        swap = dict(zip(known, names, strict=True))
        function: Callable[..., list[float]] = sp.lambdify(names, [p.xreplace(swap) for p in parts], modules=_NUMPY, cse=True)
        return function


def numeric(model: Model, set_name: str = "default") -> Numeric:
    """The float64 functions of a model with one of its sets. Raises KeyError for an unknown set."""
    return Numeric(model, set_name)
