# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
A Modelica model of masses, springs and dampers as a model file: connections and other names for the same thing are substituted away.

What remains are states with their derivatives, variables that no substitution removes, and equations in any form, which the model
language sorts and solves by itself.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pint
import sympy
from sympy.printing.str import StrPrinter

from ..units import UnitError, _unit
from .flat_modelica import Flat, Variable, derivative, differentiated, flat, number
from .interface import ImportProblem

_SECOND = _unit("s")
_MOST = 400  # equations of a flattened model
_TEXT = re.compile(r'"(?:[^"\\]|\\.)*"|//[^\n]*|/\*.*?\*/', re.S)


def model_file(text: str, path: Path, model: str | None = None) -> str:
    """
    The text of a model file for the model named, or the only one of the file; sample time 1 ms, which Modelica has not.

    Raises ImportProblem with one line: what is not read, and where it stands.
    """
    known = list(dict.fromkeys(re.findall(r"^\s*(?:partial\s+)?(?:model|class)\s+(\w+)", _TEXT.sub(" ", text), re.M)))
    if not known:
        raise ImportProblem(f"{path}: there is no model in it; name a file that has one")
    if model is None and len(known) > 1:
        top = re.findall(r"^(?:model|class)\s+(\w+)", text, re.M)
        if len(top) != 1:
            raise ImportProblem(
                f"{path}: it has {len(known)} models: {', '.join(known[:20])}; "
                f"choose one with --model, behind its packages: A.B.{known[-1]}"
            )
        known = top
    chosen = model or known[0]
    if not re.fullmatch(r"\w+(\.\w+)*", chosen):
        raise ImportProblem(f"--model: '{chosen[:60]}' is no name of a model; write it as in the file, with packages: A.B.Name")
    found, where = flat(path, text, chosen), f"{path}: {chosen}"
    if len(found.equations) > _MOST:
        raise ImportProblem(f"{where}: {len(found.equations)} equations, and {_MOST} at most are read; import a smaller model")
    try:
        units = _units(found, where)
        reduced = _Reduction(found, where)
        reduced.run()
        return _Page(found, reduced, units, where).text(chosen.rpartition(".")[2])
    except RecursionError:
        raise ImportProblem(f"{where}: its equations are nested too deep; simplify them") from None


class _Reduction:
    """Substitutions until none is left: name -> expression that it equals."""

    def __init__(self, found: Flat, where: str):
        self.found, self.where = found, where
        self.constant = frozenset(found.values)
        self.inputs = {n for n, v in found.variables.items() if v.role == "input"}
        self.free = [n for n, v in found.variables.items() if v.role in ("", "output")]
        still = {derivative(n): sympy.Integer(0) for n in self.constant}
        self.equations = [sympy.expand(e.subs(still)) for e in found.equations]
        self.solved: dict[str, sympy.Expr] = {}

    def moving(self) -> set[str]:
        """Names of which an equation has the derivative."""
        return {str(s)[4:-1] for e in self.equations for s in e.free_symbols if str(s).startswith("der(")} - self.inputs

    def run(self) -> None:
        while self.equations and (self.alias() or self.rate() or self.dummy()):
            pass
        left = [e for e in self.equations if e != 0]
        for e in left:
            if not {str(s) for s in e.free_symbols} - self.constant:
                raise ImportProblem(f"{self.where}: the equations contradict each other: {str(e)[:60]} = 0; correct the model")
        self.equations = left

    def candidates(self, e: sympy.Expr, names: set[str]) -> list[str]:
        """Those of the names in which the equation is linear with a number as factor."""
        found = []
        for name in names & {str(s) for s in e.free_symbols}:
            factor = e.coeff(self.symbol(name), 1)
            if factor.is_number and factor != 0 and not (e - factor * self.symbol(name)).has(self.symbol(name)):
                found.append(name)
        return sorted(found, key=self.free.index)

    def symbol(self, name: str) -> sympy.Symbol:
        return self.found.variables[name].symbol

    def alias(self) -> bool:
        """Remove one name without a derivative."""
        moving = self.moving()
        for i, e in enumerate(self.equations):
            names = self.candidates(e, set(self.free) - moving)
            if names:
                return self.substitute(i, min(names, key=lambda n: (self.found.variables[n].role == "output", -n.count("."))))
        return False

    def rate(self) -> bool:
        """Where v = der(s) is one equation, der(s) is v in all others."""
        moving = self.moving()
        for i, e in enumerate(self.equations):
            rates = [s for s in e.free_symbols if str(s).startswith("der(")]
            names = [n for n in self.candidates(e, moving) if len(e.free_symbols) == 2 and len(rates) == 1 and str(rates[0]) != f"der({n})"]
            if names and rates[0] != derivative(names[0]) and e.coeff(rates[0], 1).is_number:
                value = sympy.solve(e, rates[0])[0]
                others = [self.equations[k].subs(rates[0], value) if k != i else e for k in range(len(self.equations))]
                if others != self.equations:
                    self.equations = [sympy.expand(o) for o in others]
                    self.solved = {n: s.subs(rates[0], value) for n, s in self.solved.items()}
                    return True
        return False

    def dummy(self) -> bool:
        """Remove a name with a derivative that others determine: the length of a spring, the position of a second mass."""
        moving = self.moving()
        kept = {
            n
            for n in moving
            for e in self.equations
            if derivative(n) in e.free_symbols and {str(s) for s in e.free_symbols} & (moving - {n})
        }
        for i, e in enumerate(self.equations):
            if not any(str(s).startswith("der(") for s in e.free_symbols):
                names = self.candidates(e, moving)
                if names:
                    return self.substitute(
                        i, min(names, key=lambda n: (n in kept, self.found.variables[n].start != 0, -self.free.index(n)))
                    )
        return False

    def substitute(self, i: int, name: str) -> bool:
        """Remove a name by equation i."""
        e = self.equations.pop(i)
        factor = e.coeff(self.symbol(name), 1)
        value = sympy.expand(-(e - factor * self.symbol(name)) / factor)
        by = {self.symbol(name): value}
        if any(derivative(name) in other.free_symbols for other in [*self.equations, *self.solved.values()]):
            if any(str(s).startswith("der(") for s in value.free_symbols):
                raise ImportProblem(
                    f"{self.where}: the second derivative of the value of {name} is needed, which is not supported; declare it as a state"
                )
            by[derivative(name)] = differentiated(value, self.constant)
        self.equations = [sympy.expand(other.subs(by)) for other in self.equations]
        self.solved = {n: s.subs(by) for n, s in self.solved.items()} | {name: value}
        self.free.remove(name)
        return True


def _units(found: Flat, where: str) -> dict[str, str]:
    """The unit of each name; what the file does not say follows from sums, whose terms all have the same."""
    known: dict[str, pint.Unit] = {}
    for name, variable in found.variables.items():
        if variable.unit:
            try:
                known[name] = _unit(variable.unit)
            except UnitError:
                raise ImportProblem(
                    f"{where}: {name} has the unit '{variable.unit[:40]}', which is not known; write it in SI units"
                ) from None
    terms = [sympy.Add.make_args(sympy.expand(e)) for e in found.equations]
    before = -1
    while before != len(known):
        before = len(known)
        for sums in terms:
            parts = [_factors(term) for term in sums]
            whole = next((unit for unit in (_unit_of(part, known, "") for part in parts) if unit is not None), None)
            for part in parts if whole is not None else []:
                missing = [name for name, power in (part or {}).items() if _bare(name) not in known]
                if len(missing) == 1 and part and part[missing[0]] == 1 and (rest := _unit_of(part, known, missing[0])) is not None:
                    unit = whole / rest
                    known[_bare(missing[0])] = unit * _SECOND if missing[0].startswith("der(") else unit
    return {name: found.variables[name].unit or f"{unit:~C}".replace("**", "^") or "1" for name, unit in known.items()}


def _bare(name: str) -> str:
    return name[4:-1] if name.startswith("der(") else name


def _factors(term: sympy.Expr) -> dict[str, int] | None:
    """Names in a product, with their powers; None if there is more in it. A number alone has none, and so any unit: 0 stands for it."""
    found: dict[str, int] = {}
    for factor in sympy.Mul.make_args(term):
        base, power = factor.as_base_exp()
        if factor.is_number:
            continue
        if not base.is_Symbol or not power.is_Integer:
            return None
        found[str(base)] = int(power)
    return found or None


def _unit_of(part: dict[str, int] | None, known: dict[str, pint.Unit], without: str) -> pint.Unit | None:
    """Unit of a product without one of its names; None if it has another name whose unit is not known."""
    unit = _unit("1")
    for name, power in (part or {"": 1}).items():
        if name != without:
            if _bare(name) not in known:
                return None
            unit *= (known[_bare(name)] / _SECOND if name.startswith("der(") else known[_bare(name)]) ** power
    return unit


class _Printer(StrPrinter):
    """Numbers without rounding, powers as the model language has them."""

    def __init__(self, names: dict[str, str]):
        super().__init__({"full_prec": False})
        self.names = names

    def _print_Symbol(self, expr: sympy.Symbol) -> str:
        name = str(expr.name)
        return f"der({self.names[name[4:-1]]})" if name.startswith("der(") else self.names[name]

    def _print_Abs(self, expr: sympy.Expr) -> str:
        return f"abs({self._print(expr.args[0])})"

    def _print_Max(self, expr: sympy.Expr) -> str:
        return f"max({', '.join(self._print(a) for a in expr.args)})"

    def _print_Min(self, expr: sympy.Expr) -> str:
        return f"min({', '.join(self._print(a) for a in expr.args)})"

    def _print_Float(self, expr: sympy.Float) -> str:
        return repr(float(expr))

    def line(self, expr: sympy.Expr) -> str:
        return str(self.doprint(expr)).replace("**", "^")


class _Page:
    """The model file, section by section."""

    def __init__(self, found: Flat, reduced: _Reduction, units: dict[str, str], where: str):
        self.found, self.reduced, self.units, self.where = found, reduced, units, where
        self.names: dict[str, str] = {}
        for name in found.variables:
            base = re.sub(r"\W+", "_", name).strip("_") or "x"
            free = (f"{base}{k or ''}" for k in range(len(found.variables) + 2) if f"{base}{k or ''}" not in self.names.values())
            self.names[name] = next(free)
        self.print = _Printer(self.names).line

    def text(self, model: str) -> str:
        moving = [n for n in self.reduced.free if n in self.reduced.moving()]
        if not moving:
            raise ImportProblem(f"{self.where}: nothing in it changes with time by itself; a model file needs a state")
        variables, outputs = self.found.variables, self.outputs(moving)
        used = {str(s) for e in [*self.reduced.equations, *outputs.values()] for s in e.free_symbols}
        used |= {n[4:-1] for n in used if n.startswith("der(")}
        parameters = [n for n, v in variables.items() if v.role == "parameter" and n in used]
        inputs = [n for n in variables if n in self.reduced.inputs and n in used]
        rest = [n for n in self.reduced.free if n not in moving and n in used]
        lines = [
            "# from Modelica, by penode import; choose a sample time",
            "[model]",
            f'name = "{re.sub(r"^[^A-Za-z]+|[^A-Za-z0-9_]", "", model).lower() or "model"}"',
            'sample_time = "1 ms"',
        ]
        lines += self.section(
            "parameters", parameters, lambda n: f"value = {number(self.found.values[n], self.found, f'{self.where}: {n}')!r}, "
        )
        lines += self.section("inputs", inputs, lambda n: "")
        lines += self.section("states", moving, lambda n: f"start = {variables[n].start!r}, " if variables[n].start else "")
        lines += self.section("variables", rest, lambda n: "")
        lines += ["", "[equations]", *(f'e{k} = "{self.equation(e)}"' for k, e in enumerate(self.reduced.equations, 1))]
        lines += [
            "",
            "[outputs]",
            *(f'{self.label(n)} = {{ value = "{self.print(e)}", unit = "{self.unit(n)}" }}' for n, e in outputs.items()),
        ]
        return "\n".join(lines) + "\n"

    def outputs(self, moving: list[str]) -> dict[str, sympy.Expr]:
        """Those of the model, else all states."""
        declared = [n for n, v in self.found.variables.items() if v.role == "output" and "." not in n]
        return {n: self.reduced.solved.get(n, self.found.variables[n].symbol) for n in declared or moving}

    def label(self, name: str) -> str:
        """Label of an output: not the name of a state or variable."""
        return f"{self.names[name]}_out" if name in self.reduced.free else self.names[name]

    def equation(self, e: sympy.Expr) -> str:
        """What has a derivative on the left, the rest on the right."""
        terms = sympy.Add.make_args(e)
        left = sympy.Add(*(t for t in terms if any(str(s).startswith("der(") for s in t.free_symbols)))
        if left.could_extract_minus_sign():
            left, e = -left, -e
        return f"{self.print(left)} = {self.print(left - e)}"

    def section(self, title: str, names: list[str], more: Callable[[str], str]) -> list[str]:
        """An entry for each name."""
        lines = [f'{self.names[n]} = {{ {more(n)}unit = "{self.unit(n)}"{self.described(self.found.variables[n])} }}' for n in names]
        return ["", f"[{title}]", *lines] if lines else []

    def described(self, variable: Variable) -> str:
        text = re.sub(r"[^\w .,;:()/+*^-]", "", variable.description).strip()
        return f', description = "{text}"' if text else ""

    def unit(self, name: str) -> str:
        if name not in self.units:
            raise ImportProblem(
                f'{self.where}: {name} has no unit, and none follows from a sum; declare it, as {name.rpartition(".")[2]}(unit="N/m")'
            )
        return self.units[name]
