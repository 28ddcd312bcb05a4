# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""From a model to C: what is printed is decided here, how it looks stands in templates/. Same model, same bytes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from .. import units
from ..algebra import sampled
from ..algebra.augmented import augmented
from ..algebra.functions import CALLS
from ..algebra.mechanics import state_unit
from ..model import Filter, Model
from ..networks import Dense
from ..resources import resource
from ..sets import layout, packing, promises
from ..version import VERSION
from . import filter_c, monitor_c, selftest
from .c_text import fold, literal, literals, real
from .equations_c import RUNGE_KUTTA, Body, Equations
from .files import write_all
from .networks_c import NetworkCode, by_value, hidden16, network_lines, second_lines, slope_lines


def compiled_templates() -> jinja2.BytecodeCache | None:
    """What Jinja has made of the templates, in a folder of the user's own among the temporary files.

    None where there is none that is safe.
    """
    try:
        return jinja2.FileSystemBytecodeCache(pattern=f"penode-{VERSION}-%s")
    except (OSError, RuntimeError):
        return None


TEMPLATES = jinja2.Environment(
    loader=jinja2.FileSystemLoader(resource("penode_gen.emission", "templates")),
    bytecode_cache=compiled_templates(),
    undefined=jinja2.StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
    autoescape=False,
)

_METHOD_NAMES = {
    "euler": "explicit Euler",
    "heun": "Heun (order 2)",
    "rk4": "Runge-Kutta of order 4",
    "ros1": "Rosenbrock of order 1 (linearly implicit Euler)",
    "ros2": "Rosenbrock of order 2 (ROS2, L-stable)",
}


# Template -> file. Sets are named after the model that owns them, so several methods of one model write the same.
_FILES = {"model.h.j2": "{name}.h", "model.c.j2": "{name}.c", "sets.h.j2": "{owner}_sets.h", "params.c.j2": "{owner}_params.c"}


def render(model: Model, self_test: bool = True) -> dict[str, str]:
    """File name -> text of the C of a model, with or without its self-test. Pure: no clock, no path beyond the model file's name."""
    context = selftest.answered(Emitter(model).context(), self_test)
    texts: dict[str, str] = {}
    files = _FILES | ({"selftest.c.j2": "{name}_selftest.c"} if self_test else {})
    if model.filter:
        context |= filter_c.context(model, model.filter)
        files |= filter_c.FILES
        texts |= _stepped(model, model.filter)
        if model.monitor:
            context |= monitor_c.context(model, model.filter, model.monitor)
            files |= monitor_c.FILES
    for template, name in files.items():
        texts[name.format(name=model.name, owner=model.owner)] = fold(TEMPLATES.get_template(template).render(context))
    return texts | {f"{model.owner}_layout.json": layout.to_json(model)}


def _stepped(model: Model, given: Filter) -> dict[str, str]:
    """The C of the model that a filter steps, if that is one of its own: without sets, which are those of the model, and self-test."""
    if not given.parameters:
        return {}
    whole, causal = augmented(model, given)
    context = Emitter(whole, causal).context() | {"plain": model.name}
    files = {"model.h.j2": f"{whole.name}.h", "model.c.j2": f"{whole.name}.c"}
    return {name: fold(TEMPLATES.get_template(template).render(context)) for template, name in files.items()}


def generate(model: Model, directory: str | Path, self_test: bool = True) -> list[Path]:
    """Write the C of a model into `directory`: all files, or none. Raises OSError."""
    return write_all(render(model, self_test), directory)


class Emitter(Equations):
    """The context of the templates."""

    def context(self) -> dict[str, Any]:
        """The context of the templates."""
        functions = self._functions()
        bodies = [body for body in functions.values() if body]
        return self._head() | self._equations(functions) | self._network_texts(functions, bodies) | self._set_texts(bodies)

    def _functions(self) -> dict[str, Body | None]:
        """The functions by name; None: this model has none of that name."""
        causal, rosenbrock = self.causal, self.model.method.startswith("ros")
        return {
            "rates": self._function(causal.rates, "dx") if self.model.method != "ros1" else None,
            "rates_jacobian": self._function(causal.rates, "dx", ("fx", "fu")),
            "outputs": self._function(causal.outputs, "y"),
            "outputs_jacobian": self._function(causal.outputs, "y", ("yx", "yu"), values=False),
            "sensors": self._function(causal.sensors, "z"),
            "curvature": self._curvature() if rosenbrock else None,
            "sensors_jacobian": self._function(causal.sensors, "z", ("zx", "zu"), values=False),
        }

    def _head(self) -> dict[str, Any]:
        """Names, versions, and the two functions that templates call."""
        model = self.model
        return {
            **sampled.context(self.given),
            "given": self.given.inputs or model.inputs,
            "model": model,
            "name": model.name,
            "prefix": self.prefix,
            "version": VERSION,
            "abi": packing.ABI,
            "source": model.path.name,
            "digest": model.digest[:16],
            "method_name": _METHOD_NAMES[model.method],
            "owner": model.owner,
            "plain": "",
            "varied": [{"name": i.name, "at": at} for at, i in enumerate(model.inputs) if i.name in model.parameters],
            "sets_digest": packing.digest(model)[:16],
            "real": real,
            "si": units.si,
        }

    def _equations(self, functions: dict[str, Body | None]) -> dict[str, Any]:
        """Sizes, functions and the method."""
        model, causal = self.model, self.causal
        nodes, weights, divisor = RUNGE_KUTTA.get(model.method, ((), (), 1.0))
        return {
            "states": [
                {"name": s, "unit": state_unit(model, s), "start": literal(x)} for s, x in zip(model.states, model.start, strict=True)
            ],
            "n_x": len(model.states),
            "n_q": causal.n_mechanical,
            "n_u": len(model.inputs),
            "n_drive": len(self.drive),
            "n_y": len(model.outputs),
            "n_z": len(model.sensors),
            "uses_input_rate": self.uses_input_rate,
            "curved": self.curved,
            "cubic": self.cubic,
            "kept": self.kept,
            "columns": len(model.states) + (2 + self.curved + self.cubic) * len(model.inputs),
            "functions": functions,
            "constants": self._constants(),
            "nodes": [real(n) for n in nodes],
            "weights": [real(w) for w in weights],
            "divisor": divisor,
            "rosenbrock": model.method.startswith("ros"),
            "sample_time": real(model.sample_time),
            "ranges": self._ranges(),
            "trial_room": 1 << (model.guard.trial + 2).bit_length(),
            "bounds": [real(0.0 if o.trial_bound is None else o.trial_bound) for o in model.outputs],
        }

    def _network_texts(self, functions: dict[str, Body | None], bodies: list[Body]) -> dict[str, Any]:
        """The networks, and which of their functions, and of the elementary ones, are called."""
        model = self.model
        return {
            "networks": self.networks,
            "network_lines": {c.name: network_lines(model, c) for c in self.networks},
            "slope_lines": {c.name: by_value(c, slope_lines(model, c)) for c in self.networks},
            "second_lines": {
                c.name: by_value(c, second_lines(model, c)) for c in self.networks if _needs_second(c, functions["curvature"])
            },
            "elementary": _mentions(bodies, tuple(f"{call}(" for call in CALLS.values())),
            "called": {
                f"{c.name}{part}"
                for c in self.networks
                for part in ("", "_slope", "_or_pieces", "_or_pieces_slope")
                if _mentions(bodies, (f" {c.name}{part}(", f"){c.name}{part}("))
            },
            "uses_net16": any(hidden16(list(c.network.layers[i:])) for c in self.networks for i in range(len(c.network.layers))),
            "folded": self._folded(),
            "prepared": self._prepared(),
            "promised": any(port.promises for port in model.networks.values()),
        }

    def _set_texts(self, bodies: list[Body]) -> dict[str, Any]:
        """Layout and values of the sets, and what of them the functions read."""
        model = self.model
        uses_p, uses_f = any(body["uses_p"] for body in bodies), any(body["uses_f"] for body in bodies)
        reads_set = uses_p or not uses_f  # else its pieces are all that it has
        set_length = len(packing.set_values(model, "default"))
        return {
            "uses_p": uses_p,
            "uses_f": uses_f,
            "reads_set": reads_set,
            "layout_float": packing.layout(model),
            "layout_double": packing.layout(model, np.float64),
            "set_length": set_length,
            "scrub": max(set_length if reads_set else 0, model.pieces if uses_f else 0),
            "verify": set_length + (model.pieces * len(self._folded()) if uses_f else 0),
            "saved": self._saved(set_length),
            "offsets": self._offset_lines(),
            "map_lines": layout.map_lines(model),
            "set_summary": self._set_summary(),
            "sets": [self._set(name) for name in model.sets],
        }

    def _folded(self) -> list[tuple[str, NetworkCode]]:
        """The networks that are looked up in pieces, with their code."""
        return [(name, code) for code in self.networks if code.folded for name in code.users]

    # -- guard ----------------------------------------------------------------------------------------------------

    def _prepared(self) -> list[dict[str, Any]]:
        """The networks that are folded, or have promises, as initialisers of pen_network_t."""
        found = []
        for code in self.networks:
            for name in code.users:
                port = self.model.networks[name]
                promise = promises.initialiser(port, code.neurons) if port.promises else ""
                if code.folded or promise:
                    found.append(
                        {
                            "name": name,
                            "code": code.name,
                            "layers": len(code.chain()),
                            "width": code.width,
                            "neurons": code.neurons,
                            "promise": promise,
                        }
                    )
        return found

    def _ranges(self) -> list[dict[str, Any]]:
        """The inputs that have a declared range, and its edges."""
        limit = "PEN_REAL_MAX"
        return [
            {
                "at": n,
                "least": f"-{limit}" if i.minimum is None else real(i.minimum),
                "most": limit if i.maximum is None else real(i.maximum),
            }
            for n, i in enumerate(self.model.inputs)
            if i.minimum is not None or i.maximum is not None
        ]

    def _saved(self, set_length: int) -> int:
        """Values of an instance and its banks."""
        return 3 * (len(self.model.states) + len(self.model.outputs)) + 2 * self.kept + 2 * set_length

    # -- sets -----------------------------------------------------------------------------------------------------

    def _constants(self) -> list[dict[str, str]]:
        """Macros of the constant parameters that the code uses, in the order of the model file."""
        found = []
        for p in self.model.parameters.values():
            remark = f"{p.unit}{', ' + p.description if p.description else ''}"
            if not units.same_dimension(p.unit, "1") and units.factor(p.unit) != 1.0:
                remark = f"SI value of a quantity in {remark}"
            if p.name in self.constants:
                found.append({"name": f"{self.prefix}_{p.name.upper()}", "text": f"({real(p.value)})", "remark": remark})
            if f"1/{p.name}" in self.constants:
                value = real(p.value).removeprefix("(pen_real_t)")
                found.append(
                    {"name": f"{self.prefix}_{p.name.upper()}_INVERSE", "text": f"((pen_real_t)(1.0 / {value}))", "remark": f"1 / {p.name}"}
                )
        return found

    def _offset_lines(self) -> list[dict[str, str]]:
        tunable = {p.name: p for p in self.model.tunable}
        found = []
        for name, at in self.at.items():
            if name in tunable:
                remark = units.si(tunable[name].unit) + (f": {tunable[name].description}" if tunable[name].description else "")
            else:
                remark = f"network {name}"
            found.append({"name": name, "at": f"{at}U", "remark": remark})
        return found

    def _set_summary(self) -> list[str]:
        first = self.model.sets.get("default")
        found = []
        for name, network in (first.networks if first else {}).items():
            port = self.model.networks[name]
            sizes = [network.n_inputs] + [la.n_out for la in network.layers if isinstance(la, Dense)]
            given, layers = ", ".join(port.input_units), "-".join(map(str, sizes))
            found.append(f"{name} [{given}] -> [{port.output_unit}]: {layers}, {network.n_parameters} parameters")
        return found

    def _set(self, name: str) -> dict[str, Any]:
        chosen = self.model.sets[name]
        pieces = [
            {"comment": p.comment, "rows": [", ".join(texts[i : i + p.columns]) for i in range(0, p.length, p.columns)]}
            for p, texts in ((p, literals(p.values)) for p in packing.pieces(self.model, chosen))
        ] or [{"comment": "this model has nothing to tune", "rows": ["0.0F"]}]
        return {
            "name": name,
            "id": chosen.id,
            "pieces": pieces,
            "checksum_float": packing.set_head(self.model, name)[3],
            "checksum_double": packing.set_head(self.model, name, np.float64)[3],
        }


def _needs_second(code: NetworkCode, curvature: Body | None) -> bool:
    """Does the curvature of the model need this network's second derivatives?"""
    return curvature is not None and any(line.startswith(f"{code.name}_second(") for line in curvature["lines"])


def _mentions(bodies: list[Body], names: tuple[str, ...]) -> bool:
    """Does any function's text call one of `names`?"""
    return any(name in line for body in bodies for line in body["lines"] for name in names)
