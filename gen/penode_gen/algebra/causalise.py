"""
From a model to an ordered list of assignments: what the step computes, and in which order.

All equations of a model (kinematics, force laws, Newton's law, plain equations) are one system. Each equation is matched
with one unknown, strongly connected blocks are found (block lower triangular form) and each block, linear in its
unknowns, is solved symbolically. What is left is straight-line code without any solver call.
"""

from __future__ import annotations

from collections.abc import Iterable, Set
from dataclasses import dataclass, replace
from functools import cached_property

import sympy as sp
from sympy.core.function import Application, AppliedUndef
from sympy.core.relational import Relational

from .. import units
from ..model import Model
from . import expressions as ex
from .mechanics import Relation, aliases, balances, forces, kinematics, meanings

Problem = tuple[tuple[str, ...], str, str]  # where (path of keys), what, remedy


class CausaliseError(Exception):
    """Equations that cannot be ordered or solved; `problems` lists all."""

    def __init__(self, problems: list[Problem]):
        self.problems = problems
        super().__init__("; ".join(what for _, what, _ in problems))


@dataclass(frozen=True)
class Step:
    """`target := value`, or, with a network, `target := network(*arguments)`."""

    target: sp.Symbol
    value: sp.Expr | None
    network: str = ""
    arguments: tuple[sp.Expr, ...] = ()
    comment: str = ""
    where: tuple[str, ...] = ("model",)

    @property
    def parts(self) -> tuple[sp.Expr, ...]:
        """The expressions on the right-hand side."""
        return self.arguments if self.network else (self.value,)

    @property
    def reads(self) -> set[sp.Symbol]:
        """Symbols on the right-hand side."""
        return set().union(*(p.free_symbols for p in self.parts))


@dataclass(frozen=True)
class Causal:
    """A model as straight-line code. Rates, outputs and sensors are expressions over states, inputs and step targets."""

    model: Model
    states: tuple[sp.Symbol, ...]
    inputs: tuple[sp.Symbol, ...]
    steps: tuple[Step, ...]
    rates: tuple[sp.Expr, ...]
    outputs: tuple[sp.Expr, ...]
    sensors: tuple[sp.Expr, ...]

    @property
    def input_rates(self) -> tuple[sp.Symbol, ...]:
        """Symbols of the inputs' time derivatives."""
        return tuple(ex.derivative(u.name) for u in self.inputs)

    @property
    def n_mechanical(self) -> int:
        """Number of positions; the velocities follow them in `states`."""
        return len(self.model.bodies)

    def needed(self, results: Iterable[sp.Expr]) -> tuple[Step, ...]:
        """The steps that `results` depend on, in order."""
        wanted = set().union(*(r.free_symbols for r in results)) if results else set()
        chosen = []
        for step in reversed(self.steps):
            if step.target in wanted:
                chosen.append(step)
                wanted |= step.reads
        return tuple(reversed(chosen))

    def uses(self, results: Iterable[sp.Expr], symbols: Iterable[sp.Symbol]) -> bool:
        """Do `results`, through all steps, depend on any of `symbols`?"""
        seen = set().union(*(r.free_symbols for r in results), *(s.reads for s in self.needed(results)))
        return bool(seen & set(symbols))

    @cached_property
    def kinematics(self) -> dict[sp.Symbol, sp.Symbol]:
        """Position -> velocity."""
        return {ex.symbol(b.position): ex.symbol(b.velocity) for b in self.model.bodies}


def causalise(model: Model) -> Causal:
    """Order and solve the equations of a model. Raises CausaliseError."""
    problems: list[Problem] = []
    ports = {name: len(port.input_units) for name, port in model.networks.items()}
    kinematic, unit_of = kinematics(model)
    names = set(unit_of)
    moving = {*model.states, *(i.name for i in model.drives), *(p.name for p in model.points)}

    def parse(where: tuple[str, ...], text: str, extra: Set[str] = frozenset()) -> sp.Expr:
        try:
            return ex.parse(text, names | extra, ports, moving)
        except ex.ExpressionError as error:
            problems.append((where, str(error), "correct the expression"))
            return sp.Integer(0)

    equations = [*kinematic, *forces(model, parse, names, lambda *problem: problems.append(problem)), *balances(model)]
    for q in model.equations:
        left, right = (parse(("equations", q.name), side) for side in ex.sides(q.text))
        equations.append(Relation(("equations", q.name), left, right, q.name))
    signals = {section: [parse((section, s.name), s.expression) for s in getattr(model, section)] for section in ("outputs", "sensors")}
    rename, meant = aliases(model), meanings(model)
    equations = [q for q in equations if q.left not in rename]
    equations = [replace(q, left=q.left.xreplace(meant), right=q.right.xreplace(meant)) for q in equations]
    signals = {section: [s.xreplace(meant) for s in found] for section, found in signals.items()}

    problems += _check_units(model, equations, signals, unit_of)
    if problems:
        raise CausaliseError(problems)

    unknowns = [q.left for q in kinematic if q.left not in rename]
    unknowns += [ex.symbol(f"F_{e.name}") for e in model.elements] + [ex.derivative(b.velocity) for b in model.bodies]
    unknowns += [ex.derivative(s.name) for s in model.extra_states] + [ex.symbol(v.name) for v in model.variables]
    steps = _solve(equations, unknowns)
    states = tuple(ex.symbol(n) for n in model.states)
    velocities = {b.position: ex.symbol(b.velocity) for b in model.bodies}
    causal = Causal(
        model,
        states,
        tuple(ex.symbol(i.name) for i in model.drives),
        tuple(_hoist(steps, names)),
        tuple(velocities.get(n, ex.derivative(n)) for n in model.states),
        tuple(signals["outputs"]),
        tuple(signals["sensors"]),
    )
    _check_result(causal)
    return causal


def check(model: Model) -> list[Problem]:
    """All problems of a model's equations, [] if there are none."""
    try:
        causalise(model)
        return []
    except CausaliseError as error:
        return error.problems


# -- checks -----------------------------------------------------------------------------------------------------------


def _check_units(model: Model, equations: list[Relation], signals: dict[str, list[sp.Expr]], unit_of: dict[str, str]) -> Iterable[Problem]:
    per_second = units.dimension("1/s")

    def of(leaf: sp.Basic) -> units.Dimension:
        if isinstance(leaf, AppliedUndef):
            port = model.networks[leaf.func.__name__]
            for argument, unit in zip(leaf.args, port.input_units, strict=True):
                given = units.dimension_of(argument, of)
                if given is not None and given != units.dimension(unit):
                    raise units.UnitError(f"network '{port.name}' takes {unit}, given is {units.describe(given)}")
            return units.dimension(port.output_unit)
        name = leaf.name
        if name.startswith("der("):
            rate: units.Dimension = units.dimension(unit_of[name[4:-1]]) * per_second
            return rate
        return units.dimension(unit_of[name])

    def compare(where: tuple[str, ...], left: sp.Expr | units.Dimension, right: sp.Expr) -> Iterable[Problem]:
        try:
            a = left if isinstance(left, units.Dimension) else units.dimension_of(left, of)
            b = units.dimension_of(right, of)
        except units.UnitError as error:
            yield where, str(error), "correct the units"
            return
        if a is not None and b is not None and a != b:
            yield where, f"the two sides have different units, {units.describe(a)} and {units.describe(b)}", "correct the units"

    for q in equations:
        yield from compare(q.where, q.left, q.right)
    for section, found in signals.items():
        for signal, value in zip(getattr(model, section), found, strict=True):
            yield from compare((section, signal.name), units.dimension(signal.unit), value)


def _check_result(causal: Causal) -> None:
    """What the C cannot do is refused here."""
    model = causal.model
    problems: list[Problem] = []
    everything = [*causal.rates, *causal.outputs, *causal.sensors]
    if model.interpolation == "held" and causal.uses(everything, causal.input_rates):
        problems.append(
            (("model", "input"), "the model uses the rate of an input, which is not defined for a held input", 'write input = "linear"')
        )
    steps = [s.name for s in model.sampled if s.law == "held"]
    for name in (n for n in steps if model.interpolation != "held" and causal.uses(everything, [ex.derivative(n)])):
        problems.append(
            (("actuators", name), f"the model uses the rate of '{name}', which moves in steps", "put a lag behind it, and use that")
        )
    constants = {ex.symbol(p.name): sp.Float(p.value, 17) for p in model.parameters.values() if not p.tunable}
    parts = [(step.where, part) for step in causal.steps for part in step.parts]
    for section, found in (("outputs", causal.outputs), ("sensors", causal.sensors)):
        parts += [((section, signal.name), value) for signal, value in zip(getattr(model, section), found, strict=True)]
    for where, part in parts:
        for base in sorted({p.base for p in part.atoms(sp.Pow) if p.exp.is_negative}, key=str):
            if base.xreplace(constants).is_zero:
                problems.append((where, f"divides by '{base}', which is zero", "change the parameters or the equation"))
        if part.has(sp.zoo, sp.nan) or not all(ex.in_range(n) for n in part.atoms(sp.Number)):
            problems.append((where, "its solution holds a number that a float cannot hold", "scale the equation"))
    locals_ = {f"{s.target.name}{end}" for s in causal.steps if s.network for end in ("_in", "_slope", "_bend")}
    for name in sorted(locals_ & {*model.states, *model.parameters, *(i.name for i in model.drives), *(v.name for v in model.variables)}):
        problems.append((("model",), f"the code needs the name '{name}' for a network call", f"rename '{name}'"))
    known = {*causal.states, *causal.inputs, *causal.input_rates, *(s.target for s in causal.steps)}
    known |= {ex.symbol(p) for p in model.parameters}
    for section, found in (("outputs", causal.outputs), ("sensors", causal.sensors)):
        for signal, value in zip(getattr(model, section), found, strict=True):
            value = value.xreplace({ex.derivative(q.name): v for q, v in causal.kinematics.items()})
            for missing in sorted(s.name for s in value.free_symbols - known):
                problems.append(((section, signal.name), f"'{missing}' is not computed by the model", "add an equation for it"))
            if value.atoms(AppliedUndef):
                problems.append(((section, signal.name), "calls a network", "name its output as a variable with an equation of its own"))
    if problems:
        raise CausaliseError(problems)


# -- order and solution -----------------------------------------------------------------------------------------------


def _solve(equations: list[Relation], unknowns: list[sp.Symbol]) -> list[Step]:
    """Block lower triangular form, each block solved for its unknowns."""
    where = {u: i for i, u in enumerate(unknowns)}
    reads = [{where[s] for s in q.residual.free_symbols if s in where} for q in equations]
    match = _match(equations, unknowns, reads)
    maker = {u: q for q, u in match.items()}  # unknown -> equation
    steps: list[Step] = []
    problems: list[Problem] = []
    for block in _blocks({q: sorted(maker[u] for u in reads[q] if maker[u] != q) for q in range(len(equations))}):
        targets = [unknowns[match[q]] for q in block]
        first = equations[block[0]]
        if len(block) == 1 and first.left == targets[0] and targets[0] not in first.right.free_symbols:
            steps.append(Step(targets[0], first.right, comment=first.comment, where=first.where))
            continue
        names = ", ".join(f"'{equations[q].where[-1]}'" for q in block)
        unknown = ", ".join(t.name for t in targets)
        system = _linear([equations[q].residual for q in block], targets)
        if system is None:
            problems.append(
                (
                    first.where,
                    f"equations {names} form an algebraic loop that is not linear in {unknown}",
                    "break it with a state, or write it solved",
                )
            )
            continue
        try:
            solution = system[0].LUsolve(system[1], iszerofunc=lambda e: _tidy(e).is_zero)
        except ValueError:  # a pivot is zero
            problems.append((first.where, f"equations {names} have no unique solution for {unknown}", "check for an equation given twice"))
            continue
        steps += [
            Step(t, _tidy(e), comment=equations[q].comment, where=equations[q].where)
            for t, e, q in zip(targets, solution, block, strict=True)
        ]
    if problems:
        raise CausaliseError(problems)
    return steps


def _linear(residuals: list[sp.Expr], targets: list[sp.Symbol]) -> tuple[sp.Matrix, sp.Matrix] | None:
    """(A, b) with residuals = A targets - b; None if they are not linear."""
    unknown = set(targets)
    curved = [f for r in residuals for f in r.atoms(Application, Relational) if not isinstance(f, sp.Piecewise)]
    if any(f.free_symbols & unknown for f in curved):
        return None
    a = sp.Matrix([[r.diff(t) for t in targets] for r in residuals])
    b = sp.Matrix([-r.xreplace(dict.fromkeys(targets, sp.Integer(0))) for r in residuals])
    return None if a.free_symbols & unknown else (a, b)


def _tidy(expr: sp.Expr) -> sp.Expr:
    """A quotient in lowest terms; what is not made of + - * / stays as it is."""
    whole = {f: sp.Dummy(f"f{i}") for i, f in enumerate(sorted(_functions(expr), key=sp.default_sort_key))}
    back = {d: f for f, d in whole.items()}
    return sp.cancel(expr.xreplace(whole)).xreplace(back)


def _functions(expr: sp.Expr) -> set[sp.Expr]:
    """The outermost parts of an expression that are neither symbols nor numbers nor made of + - * / and whole powers."""
    if isinstance(expr, (sp.Add, sp.Mul)) or (expr.is_Pow and expr.exp.is_Integer):
        return set().union(*(_functions(a) for a in expr.args))
    return set() if expr.is_Symbol or expr.is_Number else {expr}


def _match(equations: list[Relation], unknowns: list[sp.Symbol], reads: list[set[int]]) -> dict[int, int]:
    """One unknown for each equation (augmenting paths, an equation's own left side first)."""
    owner: dict[int, int] = {}

    def place(q: int, tried: set[int]) -> bool:
        left = equations[q].left
        for u in sorted(reads[q], key=lambda u: (unknowns[u] != left, u)):
            if u not in tried:
                tried.add(u)
                if u not in owner or place(owner[u], tried):
                    owner[u] = q
                    return True
        return False

    problems: list[Problem] = []
    for q, equation in enumerate(equations):
        if not place(q, set()):
            problems.append((equation.where, "nothing is left that this equation could determine", "remove it, or add a variable"))
    for u, unknown in enumerate(unknowns):
        if u not in owner:
            name = unknown.name[4:-1] if unknown.name.startswith("der(") else unknown.name
            section = "states" if unknown.name.startswith("der(") else "variables"
            problems.append(((section, name), f"no equation determines {unknown.name}", "add one to [equations]"))
    if problems:
        raise CausaliseError(problems)
    return {q: u for u, q in owner.items()}


def _blocks(needs: dict[int, list[int]]) -> list[list[int]]:
    """Strongly connected components in the order of evaluation (Tarjan)."""
    index: dict[int, int] = {}
    low: dict[int, int] = {}
    stack: list[int] = []
    blocks: list[list[int]] = []

    def visit(q: int) -> None:
        index[q] = low[q] = len(index)
        stack.append(q)
        for other in needs[q]:
            if other not in index:
                visit(other)
                low[q] = min(low[q], low[other])
            elif other in stack:
                low[q] = min(low[q], index[other])
        if low[q] == index[q]:
            block: list[int] = []
            while not block or block[-1] != q:
                block.append(stack.pop())
            blocks.append(sorted(block))

    for q in needs:
        if q not in index:
            visit(q)
    return blocks


def _hoist(steps: list[Step], names: set[str]) -> Iterable[Step]:
    """Give each network call a step of its own; no step takes one of `names`."""
    count = 0
    for step in steps:
        own = isinstance(step.value, AppliedUndef)  # the call is the step
        value: sp.Expr = step.value
        while calls := sorted(value.atoms(AppliedUndef) - ({value} if own else set()), key=lambda c: (len(c.atoms(AppliedUndef)), str(c))):
            inner = calls[0]  # has no call within
            count += 1
            while f"{inner.func.__name__}_{count}" in names:
                count += 1
            target = ex.symbol(f"{inner.func.__name__}_{count}")
            yield Step(target, None, inner.func.__name__, inner.args, f"network {inner.func.__name__}", step.where)
            value = value.xreplace({inner: target})
        if own:
            yield Step(step.target, None, value.func.__name__, value.args, step.comment, step.where)
        else:
            yield replace(step, value=value)
