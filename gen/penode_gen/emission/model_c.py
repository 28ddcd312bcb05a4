"""From a model to C: what is printed is decided here, how it looks stands in templates/. Same model, same bytes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jinja2
import sympy as sp

from .. import units
from ..algebra import expressions as ex, sampled
from ..algebra.causalise import Causal, Step, causalise
from ..algebra.functions import CALLS
from ..algebra.jacobian import Derivatives
from ..algebra.mechanics import state_unit
from ..algebra.placeholder import with_input
from ..model import Model
from ..networks import Dense
from ..sets import layout, packing, promises
from . import selftest
from .c_text import Printer, fold, literal, literals, real
from .files import write_all
from .networks_c import NetworkCode, by_value, hidden16, network_code, network_lines, second_lines, slope_lines

VERSION = "0.1.0"


def compiled_templates() -> jinja2.BytecodeCache | None:
    """What Jinja has made of the templates, in a folder of the user's own among the temporary files; None where there is none that is
    safe."""
    try:
        return jinja2.FileSystemBytecodeCache(pattern=f"penode-{VERSION}-%s")
    except (OSError, RuntimeError):
        return None


_TEMPLATES = jinja2.Environment(
    loader=jinja2.FileSystemLoader(Path(__file__).parent / "templates"),
    bytecode_cache=compiled_templates(),
    undefined=jinja2.StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
    autoescape=False,
)

# Runge-Kutta methods in which every stage builds on the one before: nodes, weights and the divisor of the weights.
_RUNGE_KUTTA = {"heun": ((0.0, 1.0), (1.0, 1.0), 2.0), "rk4": ((0.0, 0.5, 0.5, 1.0), (1.0, 2.0, 2.0, 1.0), 6.0)}
# Names of the templates inside functions that also hold names of the model; the model's get a _ there.
_TAKEN = frozenset(
    "p x u y z dx fx fu yx yu zx zu kx ku cx cu status rates rates_jacobian outputs outputs_jacobian sensors curvature network "
    "inner along drive layer_by_layer before advance fold f x0 copy begin finish usable unit solve integrate node".split()
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
    context, texts = selftest.answered(_Emitter(model).context(), self_test), {}
    for template, name in (_FILES | ({"selftest.c.j2": "{name}_selftest.c"} if self_test else {})).items():
        texts[name.format(name=model.name, owner=model.owner)] = fold(_TEMPLATES.get_template(template).render(context))
    return texts | {f"{model.owner}_layout.json": layout.to_json(model)}


def generate(model: Model, directory: str | Path, self_test: bool = True) -> list[Path]:
    """Write the C of a model into `directory`: all files, or none. Raises OSError."""
    return write_all(render(model, self_test), directory)


class _Emitter:
    def __init__(self, model: Model, causal: Causal | None = None):
        self.given = model
        self.model, self.causal = model, causal = with_input(model, causal or causalise(model))
        first = model.sets.get("default")
        straight = [n for n, net in (first.networks if first else {}).items() if net.is_piecewise_linear and model.outside != "fade"]
        self.derivatives = Derivatives(self.causal, frozenset(straight))
        self.prefix = model.name.upper()
        self.at = packing.offsets(model)
        everything = [*self.causal.rates, *self.causal.outputs, *self.causal.sensors]
        self.uses_input_rate = self.causal.uses(everything, self.causal.input_rates)
        self.curved = model.interpolation in ("parabola", "cubic") and bool(model.states or self.uses_input_rate)
        self.cubic = self.curved and model.interpolation == "cubic"
        self.drive = self.causal.inputs + (self.causal.input_rates if self.uses_input_rate else ())
        self.kept = len(self.drive) + (2 * self.curved + self.cubic) * len(model.inputs)  # and differences of the inputs
        self.networks = network_code(model)
        self.code_of = {user: code for code in self.networks for user in code.users}
        self.constants: dict[str, sp.Symbol] = {}

    # -- what the templates see -----------------------------------------------------------------------------------

    def context(self) -> dict[str, Any]:
        model, causal = self.model, self.causal
        rosenbrock = model.method.startswith("ros")
        set_length = len(packing.set_values(model, "default"))
        folded = [(name, code) for code in self.networks if code.folded for name in code.users]
        nodes, weights, divisor = _RUNGE_KUTTA.get(model.method, ((), (), 1.0))
        functions = {
            "rates": self._function(causal.rates, "dx") if model.method != "ros1" else None,
            "rates_jacobian": self._function(causal.rates, "dx", ("fx", "fu")),
            "outputs": self._function(causal.outputs, "y"),
            "outputs_jacobian": self._function(causal.outputs, "y", ("yx", "yu"), values=False),
            "sensors": self._function(causal.sensors, "z"),
            "curvature": self._curvature() if rosenbrock else None,
            "sensors_jacobian": self._function(causal.sensors, "z", ("zx", "zu"), values=False),
        }
        uses_p, uses_f = (any(f[uses] for f in functions.values() if f) for uses in ("uses_p", "uses_f"))
        reads_set = uses_p or not uses_f  # else its pieces are all that it has
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
            "states": [{"name": s, "unit": state_unit(model, s), "start": literal(x)} for s, x in zip(model.states, model.start)],
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
            "functions": functions,
            "constants": self._constants(),
            "networks": self.networks,
            "network_lines": {c.name: network_lines(model, c) for c in self.networks},
            "second_lines": {c.name: by_value(c, second_lines(model, c)) for c in self.networks if self._needs_second(c, functions)},
            "elementary": self._mentions(functions, tuple(f"{call}(" for call in CALLS.values())),
            "called": {
                f"{c.name}{part}"
                for c in self.networks
                for part in ("", "_slope", "_or_pieces", "_or_pieces_slope")
                if self._mentions(functions, (f" {c.name}{part}(", f"){c.name}{part}("))
            },
            "slope_lines": {c.name: by_value(c, slope_lines(model, c)) for c in self.networks},
            "layout_float": packing.layout(model),
            "layout_double": packing.layout(model, float),
            "set_length": set_length,
            "scrub": max(set_length if reads_set else 0, model.pieces if uses_f else 0),
            "offsets": self._offset_lines(),
            "verify": set_length + (model.pieces * len(folded) if uses_f else 0),
            "saved": self._saved(set_length),
            "ranges": self._ranges(),
            "trial_room": 1 << (model.guard.trial + 2).bit_length(),
            "bounds": [real(0.0 if o.trial_bound is None else o.trial_bound) for o in model.outputs],
            "owner": model.owner,
            "sets_digest": packing.digest(model)[:16],
            "map_lines": layout.map_lines(model),
            "set_summary": self._set_summary(),
            "sets": [self._set(name) for name in model.sets],
            "nodes": [real(n) for n in nodes],
            "weights": [real(w) for w in weights],
            "divisor": divisor,
            "rosenbrock": rosenbrock,
            "uses_net16": any(hidden16(list(c.network.layers[i:])) for c in self.networks for i in range(len(c.network.layers))),
            "folded": folded,
            "prepared": self._prepared(),
            "promised": any(port.promises for port in model.networks.values()),
            "uses_p": uses_p,
            "uses_f": uses_f,
            "reads_set": reads_set,
            "sample_time": real(model.sample_time),
            "real": real,
            "si": units.si,
            "columns": len(model.states) + (2 + self.curved + self.cubic) * len(model.inputs),
        }

    @staticmethod
    def _needs_second(code: NetworkCode, functions: dict[str, dict[str, Any] | None]) -> bool:
        """Does the curvature of the model need this network's second derivatives?"""
        curvature = functions["curvature"]
        return bool(curvature) and any(line.startswith(f"{code.name}_second(") for line in curvature["lines"])

    @staticmethod
    def _mentions(functions: dict[str, dict[str, Any] | None], names: tuple[str, ...]) -> bool:
        """Does any function's text call one of `names`?"""
        return any(name in line for f in functions.values() if f for line in f["lines"] for name in names)

    # -- expressions and functions --------------------------------------------------------------------------------

    def _c_name(self, s: sp.Symbol) -> str:
        parameter = self.model.parameters.get(s.name)
        if parameter and not parameter.tunable:
            self.constants[s.name] = s
            return f"{self.prefix}_{s.name.upper()}"
        if s.name.startswith("1/"):
            self.constants[s.name] = s
            return f"{self.prefix}_{s.name[2:].upper()}_INVERSE"
        name = s.name.replace("der(", "der_").replace(")", "")
        return f"{name}_" if name in _TAKEN else name

    def _inverses(self, expr: sp.Expr) -> sp.Expr:
        """Divisions by constants become multiplications with constants of their own."""
        constants = {ex.symbol(p.name) for p in self.model.parameters.values() if not p.tunable}
        return expr.replace(
            lambda e: e.is_Pow and e.base in constants and e.exp.is_Integer and e.exp < 0, lambda e: ex.symbol(f"1/{e.base.name}") ** -e.exp
        )

    def _print(self, expr: sp.Expr) -> str:
        return Printer(self._c_name)(self._inverses(expr))

    def _function(
        self, results: tuple[sp.Expr, ...], target: str, jacobian: tuple[str, str] | None = None, values: bool = True
    ) -> dict[str, Any]:
        """Body of a function that computes `results`, and with `jacobian` their derivatives, as lines of C."""
        kinematics = {ex.derivative(q.name): v for q, v in self.causal.kinematics.items()}
        results = tuple(r.subs(kinematics) for r in results)
        wanted: list[tuple[str, sp.Expr]] = [(f"{target}[{i}]", r) for i, r in enumerate(results)] if values else []
        if jacobian:
            for name, variables in zip(jacobian, (self.causal.states, self.drive)):
                for i, row in enumerate(self.derivatives.of(results, variables)):
                    wanted += [(f"{name}[{i}][{j}]", entry) for j, entry in enumerate(row)]
        return self._body(wanted)

    def _curvature(self) -> dict[str, Any] | None:
        """Derivatives of fx * kx + fu * ku along states and drive; None where they vanish (and no code is needed)."""
        entries = self.derivatives.curvature(self.causal.rates, self.causal.states, self.drive)
        if all(e == 0 for rows in entries for row in rows for e in row):
            return None
        wanted = [
            (f"{name}[{i}][{j}]", entry)
            for name, rows in zip(("cx", "cu"), entries)
            for i, row in enumerate(rows)
            for j, entry in enumerate(row)
        ]
        body = self._body(wanted)
        return body | {k: any(f"{k}[" in line for line in body["lines"]) for k in ("kx", "ku")}

    def _body(self, wanted: list[tuple[str, sp.Expr]]) -> dict[str, Any]:
        model, causal = self.model, self.causal
        # common parts of derivatives get names of their own; values stay as they are, so that they keep their rounding
        plain = [(name, e) for name, e in wanted if "][" not in name]
        derived = [(name, e) for name, e in wanted if "][" in name]
        derived = [(name, self._inverses(e)) for name, e in derived]
        known = {s.name for s in (*causal.states, *self.drive, *(step.target for step in causal.steps))} | set(model.parameters)
        numbered = (ex.symbol(f"t{i}") for i in range(1, 10000) if f"t{i}" not in known)
        temporaries, reduced = sp.cse([e for _, e in derived], symbols=numbered, order="canonical") if derived else ([], [])
        wanted = plain + [(name, e) for (name, _), e in zip(derived, reduced)]
        used = set().union(*(e.free_symbols for _, e in wanted), *(e.free_symbols for _, e in temporaries))
        needs_slope = {t for t, group in self.derivatives.slopes.items() if used & set(group)}
        needs_second = {t for t, rows in self.derivatives.seconds.items() if used & set().union(*rows)}
        steps = causal.needed([*(e for _, e in wanted), *(e for _, e in temporaries), *needs_slope, *needs_second])
        used |= set().union(*(s.reads for s in steps)) if steps else set()
        lines: list[str] = []
        for i, s in enumerate(causal.states):
            if s in used:
                lines.append(f"const pen_real_t {self._c_name(s)} = x[{i}];")
        for i, s in enumerate(self.drive):
            if s in used:
                lines.append(f"const pen_real_t {self._c_name(s)} = u[{i}];")
        for p in model.tunable:
            if ex.symbol(p.name) in used:
                lines.append(f"const pen_real_t {self._c_name(ex.symbol(p.name))} = p[{self.at[p.name]}]; /* {units.si(p.unit)} */")
        if lines and steps:
            lines.append("")
        calls = uses_p = uses_f = False
        for step in steps:
            if step.network:
                second = step.target in needs_second
                slope = step.target in needs_slope
                value = slope or step.target in used or not second
                lines += self._call(step, value, slope, second, used)
                calls = calls or value
                folded = self.code_of[step.network].folded
                uses_f |= folded
                uses_p |= not folded or model.more_pieces == "layers"
            else:
                lines += _remarked(f"const pen_real_t {self._c_name(step.target)} = {self._print(step.value)};", step)
        lines += [f"const {'bool' if e.is_Relational else 'pen_real_t'} {t.name} = {self._print(e)};" for t, e in temporaries]
        if lines and wanted:
            lines.append("")
        lines += [f"{name} = {self._print(e)};" for name, e in wanted]
        return {
            "lines": lines,
            "calls": calls,
            "uses_p": uses_p or any(ex.symbol(p.name) in used for p in model.tunable),
            "uses_f": uses_f,
            "uses_x": any(s in used for s in causal.states),
            "uses_u": any(s in used for s in self.drive),
        }

    def _call(self, step: Step, value: bool, slope: bool, second: bool, used: set[sp.Symbol]) -> list[str]:
        name = self._c_name(step.target)
        code = self.code_of[step.network]
        function, values = code.name, f"&p[{self.prefix}_AT_{step.network.upper()}]"
        lines = []
        if len(step.arguments) == 1:
            argument = self._print(step.arguments[0])
        else:
            argument = f"inputs_of_{name}"
            parts = ", ".join(self._print(a) for a in step.arguments)
            lines.append(f"const pen_real_t {argument}[{len(step.arguments)}] = {{ {parts} }};")
        if code.folded and self.model.more_pieces == "layers":
            function, values = f"{code.name}_or_pieces", f"{values}, &f[{self._folded_at(step.network)}]"
        elif code.folded:
            return [*lines, *self._lookup(step, name, argument, slope, used)]
        if slope:
            lines.append(f"pen_real_t slopes_of_{name}[{len(step.arguments)}];")
            result = f"const pen_real_t {name} =" if step.target in used else "(void)"
            lines += _remarked(
                f"{result} {function}_slope({values}, {argument}, slopes_of_{name}, &status);".replace("(void) ", "(void)"), step
            )
            for i, s in enumerate(self.derivatives.slopes[step.target]):
                lines += [f"const pen_real_t {s.name} = slopes_of_{name}[{i}];"] if s in used else []
        elif value:
            lines += _remarked(f"const pen_real_t {name} = {function}({values}, {argument}, &status);", step)
        if second:
            n = len(step.arguments)
            lines.append(f"pen_real_t seconds_of_{name}[{n}][{n}];")
            lines.append(f"{function}_second({values}, {argument}, seconds_of_{name});")
            for i, row in enumerate(self.derivatives.seconds[step.target]):
                lines += [f"const pen_real_t {s.name} = seconds_of_{name}[{i}][{j}];" for j, s in enumerate(row) if j >= i and s in used]
        return lines

    def _folded_at(self, network: str) -> str:
        """Where the pieces of a folded network begin among those of a slot."""
        at = [name for code in self.networks if code.folded for name in code.users].index(network)
        return f"{at}U * {self.prefix}_PIECES" if at else "0U"

    def _lookup(self, step: Step, name: str, argument: str, slope: bool, used: set[sp.Symbol]) -> list[str]:
        """A folded network: find the piece, then a line."""
        pieces, lines = f"&f[{self._folded_at(step.network)}]", []
        if not argument.isidentifier():
            lines.append(f"const pen_real_t inputs_of_{name} = {argument};")
            argument = f"inputs_of_{name}"
        lines.append(f"const pen_piece_t *const piece_of_{name} = pen_fold_find({self.prefix}_PIECES, {pieces}, {argument});")
        if step.target in used:
            lines += _remarked(f"const pen_real_t {name} = pen_fold_value({pieces}, piece_of_{name}, {argument}, &status);", step)
        else:
            lines.append(f"status |= piece_of_{name}->status;")
        if slope and self.derivatives.slopes[step.target][0] in used:
            lines.append(f"const pen_real_t {self.derivatives.slopes[step.target][0].name} = piece_of_{name}->slope;")
        return lines

    # -- guard ----------------------------------------------------------------------------------------------------

    def _prepared(self) -> list[dict[str, Any]]:
        """The networks that are folded, or of which something is promised, as initialisers of a pen_network_t want them."""
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
            found.append(
                f"{name} [{', '.join(port.input_units)}] -> [{port.output_unit}]: {'-'.join(map(str, sizes))}, {network.n_parameters} parameters"
            )
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
            "checksum_double": packing.set_head(self.model, name, float)[3],
        }


def _remarked(line: str, step: Step) -> list[str]:
    """The line with its comment behind it, or above it where it is long."""
    comment = f"/* {step.comment} */"
    if not step.comment:
        return [line]
    return [f"{line} {comment}"] if len(line) + len(comment) < 112 else [comment, line]
