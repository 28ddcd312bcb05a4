# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Read and check a model file. Every problem is reported at once, with its line and a remedy."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any

from .. import model as m
from ..algebra import expressions as ex, limits, monitored
from ..algebra.causalise import check
from ..laws import LAWS
from ..sets import promises
from ..sets.fold import room
from .followers import measures
from .monitor_table import MonitorTables
from .network_tables import ROOM, UNKNOWN
from .places import one_line, show
from .tables import C_PATTERN, MACROS, SECTIONS

_MODEL_NAME = re.compile(r"[a-z][a-z0-9_]{0,39}")
# A model of that name would have a header or a type that others have already.
_MODEL_WORDS = set(
    "assert complex ctype errno fenv float inttypes iso646 limits locale math setjmp signal stdarg stdbool stddef stdint "
    "stdio stdlib string tgmath time wchar wctype size ptrdiff sample pen".split()
)
MODEL = {
    "extends": str,
    "name": str,
    "description": str,
    "sample_time": str,
    "method": str,
    "substeps": int,
    "input": str,
    "outside": str,
    "fade_width": (int, float),
    "pieces": int,
    "more_pieces": str,
    "out_of_range": str,
    "on_damage": str,
    "trial": int,
}


class _All(frozenset[str]):
    """Contains everything."""

    def __contains__(self, item: object) -> bool:
        return True


class _Reader(MonitorTables):
    """Reads the whole model."""

    def __init__(self, path: Path):
        super().__init__(path)
        self.made, self.kinds = {}, {}

    def read(self) -> m.Model:
        if not self.data:
            raise m.ModelError([one_line(f"{self.path}:1: is empty; write a model with [model], [inputs] and [outputs]")])
        self.sections()
        head, sample_time = self.head()
        name, parameters = head.get("name", "model"), self.parameters()
        inputs = tuple(self.inputs())
        bodies = tuple(self.bodies(parameters))
        networks = dict(self.networks())
        acts = self.actuators(inputs, parameters, sample_time)
        points = (*acts.points, *self.points(bodies, inputs, (*acts.states, *acts.sampled), acts.points, parameters))
        elements = tuple(self.elements(parameters, inputs, networks))
        states = (*self.states(), *acts.states, *self.law_states(elements))
        variables, equations = (*self.variables(), *acts.variables), (*self.equations(), *acts.equations)
        outputs, sensors = (tuple(self.signals(section)) for section in ("outputs", "sensors"))
        own_filter = self.filter(sensors, self.units_of_states(bodies, states), inputs, parameters, sample_time)
        own_monitor = self.monitor(parameters, own_filter is not None, sample_time)
        sets = self.sets(parameters, networks, {b.mass for b in bodies})
        self.folds(head, sets)
        promises.check(networks, sets, head["outside"], self.problem)
        self.unique(parameters, inputs, bodies, points, elements, (*states, *acts.sampled), variables, networks)
        moving = {*(s.name for s in states), *(s.name for s in acts.sampled), *(b.position for b in bodies), *(b.velocity for b in bodies)}
        self.shown((*outputs, *sensors), {i.name for i in inputs}, moving, len(outputs), equations)
        self.macros(parameters, networks, name)
        if not outputs and not self.data.get("outputs"):
            self.problem(("outputs",), "the model has no outputs", 'add [outputs], for example position = { value = "x", unit = "m" }')
        if self.problems:
            self.expressions(elements, equations, (*outputs, *sensors), networks, len(outputs))
            raise m.ModelError(self.problems)
        return m.Model(
            name=head["name"],
            description=head.get("description", ""),
            sample_time=sample_time,
            method=head["method"],
            substeps=head["substeps"],
            interpolation=head["input"],
            outside=head["outside"],
            fade_width=float(head["fade_width"]),
            pieces=room(head["pieces"]),
            more_pieces=head["more_pieces"],
            parameters=parameters,
            inputs=inputs,
            bodies=bodies,
            elements=elements,
            extra_states=states,
            variables=variables,
            equations=equations,
            networks=networks,
            outputs=outputs,
            sensors=sensors,
            sets=sets,
            path=self.path,
            digest=self.digest.hexdigest(),
            guard=m.Guard(head["out_of_range"], head["on_damage"], head["trial"]),
            set_owner=self.set_owner,
            points=points,
            sampled=tuple(acts.sampled),
            filter=own_filter,
            monitor=own_monitor,
        )

    def sections(self) -> None:
        """The name of the file, and the names of its sections."""
        if not self.path.name.isprintable():
            self.problem((), "the file has a name that cannot stand in a comment", "rename it")
        known = [*SECTIONS, "model", "points", "elements", "equations", "sets", "filter", "monitor"]
        for key in self.data:
            if key not in known:
                near = difflib.get_close_matches(key, known, 1)
                self.problem((key,), "unknown section", f"did you mean [{near[0]}]?" if near else "remove it")

    def head(self) -> tuple[dict[str, Any], float]:
        """The table [model] with its defaults, and the sample time [s]."""
        head = self.table(("model",), MODEL, self.data.get("model", {}), ("name", "sample_time"))
        name = head.get("name", "model")
        if not _MODEL_NAME.fullmatch(name) or name.endswith("_"):
            self.problem(("model", "name"), f"{show(name)} cannot prefix C names", "use up to 40 lower-case letters, digits and _")
        elif name in _MODEL_WORDS or name.startswith("pen_") or C_PATTERN.fullmatch(f"{name}_t"):
            self.problem(("model", "name"), f"'{name}' has a meaning of its own in C", "choose another name")
        sample_time = self.quantity(("model", "sample_time"), head.get("sample_time", "1 s"), "s")
        if sample_time < 1e-9 or sample_time > 86400.0:
            self.problem(
                ("model", "sample_time"), f"{head['sample_time']} is out of range", "give a time from 1 ns to 1 day, such as '1 ms'"
            )
        for key, default, choices in (
            ("method", "rk4", m.METHODS),
            ("input", "linear", m.INTERPOLATIONS),
            ("outside", "extrapolate", m.OUTSIDE),
            ("more_pieces", "refuse", m.MORE_PIECES),
            ("out_of_range", "report", m.OUT_OF_RANGE),
            ("on_damage", "report", m.ON_DAMAGE),
        ):
            if head.setdefault(key, default) not in choices:
                self.problem(("model", key), f"'{head[key]}' is unknown", f"choose one of {', '.join(choices)}")
        if not 1 <= head.setdefault("substeps", 1) <= 1000:
            self.problem(("model", "substeps"), f"{head['substeps']} is out of range", "give 1 to 1000")
        if not 1e-6 <= head.setdefault("fade_width", 0.1) <= 100.0:
            self.problem(("model", "fade_width"), "is out of range", "give the fading distance in widths of the envelope, 1e-6 to 100")
        if head.setdefault("pieces", 0) != 0 and not 4 <= head["pieces"] <= ROOM:
            self.problem(
                ("model", "pieces"),
                f"{head['pieces']} is out of range",
                f"give room for 4 to {ROOM} pieces, or 0 to evaluate layer by layer",
            )
        if not 0 <= head.setdefault("trial", 0) <= 10000:
            self.problem(
                ("model", "trial"),
                f"{head['trial']} is out of range",
                "give the number of last samples that a new set is tried on, up to 10000, or 0 for no trial",
            )
        return head, sample_time

    def parameters(self) -> dict[str, m.Parameter]:
        found = {}
        for name, entry in self.section("parameters").items():
            where = ("parameters", name)
            value = self.number((*where, "value"), entry["value"], self.unit(where, entry.get("unit"))) if "value" in entry else math.nan
            tolerance = self.tolerance(where, entry)
            tunable = entry.get("tunable", "tunable" in self.stated("parameters", name))  # of a wrong type: meant to be
            found[name] = m.Parameter(
                name, value, entry.get("unit", UNKNOWN), tolerance, tunable, entry.get("description", ""), entry.get("exact") is True
            )
        return found

    def tolerance(self, where: tuple[str, ...], entry: dict[str, Any]) -> float:
        """How well a parameter is known: a share of it, infinite if it is unknown."""
        given = entry.get("tolerance", 0.0)
        if given == "unknown":
            found = math.inf
        elif isinstance(given, str):
            self.problem((*where, "tolerance"), f"{show(given)} is not a tolerance", 'give a share, such as 0.05 for 5 %, or "unknown"')
            return 0.0
        else:
            found = self.number((*where, "tolerance"), given)
        if found < 0.0:
            self.problem((*where, "tolerance"), f"tolerance {found:g} is below zero", 'give a share, such as 0.05 for 5 %, or "unknown"')
        if entry.get("exact") and found != 0.0:
            self.problem(where, f"is exact and has a tolerance of {show(given)}", "remove one of them")
        return found

    def inputs(self) -> Iterable[m.Input]:
        for name, entry in self.section("inputs").items():
            where = ("inputs", name)
            scale = self.unit(where, entry.get("unit"))
            low, high = (None if entry.get(k) is None else self.number((*where, k), entry[k], scale) for k in ("min", "max"))
            if low is not None and high is not None and low >= high:
                self.problem(where, "min is not below max", "exchange them")
            yield m.Input(name, entry.get("unit", UNKNOWN), low, high, self.noise(where, entry, scale), entry.get("description", ""))

    def noise(self, where: tuple[str, ...], entry: dict[str, Any], scale: float) -> float:
        """The standard deviation of a measured signal, SI."""
        noise = self.number((*where, "noise"), entry.get("noise", 0.0), scale)
        if noise < 0.0:
            self.problem((*where, "noise"), f"{entry['noise']} is below zero", "give a standard deviation")
        return noise

    def states(self) -> Iterable[m.State]:
        for name, entry in self.section("states").items():
            scale = self.unit(("states", name), entry.get("unit"))
            start = self.number(("states", name, "start"), entry.get("start", 0.0), scale)
            yield m.State(name, entry.get("unit", UNKNOWN), start, entry.get("description", ""))

    def variables(self) -> Iterable[m.Variable]:
        for name, entry in self.section("variables").items():
            self.unit(("variables", name), entry.get("unit"))
            yield m.Variable(name, entry.get("unit", UNKNOWN))

    def elements(
        self, parameters: dict[str, m.Parameter], inputs: tuple[m.Input, ...], networks: dict[str, m.NetworkPort]
    ) -> Iterable[m.Element]:
        for name, entry in self.entries("elements").items():
            where = ("elements", name)
            self.label(where, name)
            common = {"between": list, "law": str, "description": str}
            if not isinstance(entry, dict) or not isinstance(entry.get("law"), str):
                anything = dict.fromkeys(entry, object) if isinstance(entry, dict) else {}
                self.table(where, anything | common, entry, ("law",))
                continue
            law = entry["law"]
            if law == "network":
                entry = self.table(where, common | {"network": str, "inputs": list}, entry, ("between", "network"))
            elif law == "expression":
                entry = self.table(where, common | {"force": str}, entry, ("between", "force"))
            elif law in LAWS:
                arguments = LAWS[law].arguments
                entry = self.table(where, common | dict.fromkeys(arguments, str), entry, ("between", *arguments))
            else:
                near = difflib.get_close_matches(law, [*LAWS, "network", "expression"], 1)
                known = f"did you mean '{near[0]}'?" if near else f"known are network, expression, {', '.join(LAWS)}"
                self.problem((*where, "law"), f"law '{law}' is unknown", known)
                continue
            ends = self.ends((*where, "between"), entry["between"], inputs) if "between" in entry else (m.GROUND, m.GROUND)
            if law == "network":
                yield self.network_element(name, ends, entry, networks)
            elif law == "expression":
                yield m.Element(name, ends, law, expression=entry.get("force", "0"))
            else:
                yield self.law_element(where, ends, law, entry, parameters)

    def equations(self) -> Iterable[m.Equation]:
        for name, text in self.entries("equations").items():
            self.label(("equations", name), name)
            if not isinstance(text, str) or len(ex.sides(text)) != 2:
                self.problem(("equations", name), "is not one equation", 'write it as "der(T) = (T0 - T)/tau"')
                continue
            yield m.Equation(name, text)

    def signals(self, section: str) -> Iterable[m.Signal]:
        for name, entry in self.section(section).items():
            scale = self.unit((section, name), entry.get("unit"))
            noise = self.noise((section, name), entry, scale)
            bound = self.number((section, name, "trial_bound"), entry["trial_bound"], scale) if "trial_bound" in entry else None
            if bound is not None and not bound > 0.0:
                self.problem(
                    (section, name, "trial_bound"),
                    f"{bound} is not a bound",
                    "give how far outputs with a new set may be from those with the running one, above 0",
                )
            yield m.Signal(name, entry.get("value", ""), entry.get("unit", UNKNOWN), noise, entry.get("description", ""), bound)

    def unique(
        self,
        parameters: Collection[str],
        inputs: Collection[m.Input],
        bodies: Collection[m.Body],
        points: Collection[m.Point],
        elements: Collection[m.Element],
        states: Collection[m.State | m.Sampled],
        variables: Collection[m.Variable],
        networks: Collection[str],
    ) -> None:
        """No name may mean two things."""
        named = [("parameter", n, self.made.get(n, ("parameters", n))) for n in parameters]
        named += [("input", i.name, ("inputs", i.name)) for i in inputs]
        for key in ("position", "velocity"):
            named += [(key, getattr(b, key), ("bodies", b.name, key)) for b in bodies]
        actuators = self.entries("actuators")
        named += [("point", p.name, ("actuators" if p.name in actuators else "points", p.name)) for p in points]
        of_laws = {s.name: ("elements", e.name) for e in elements for s in self.law_states([e])} | {n: ("actuators", n) for n in actuators}
        named += [("state", s.name, of_laws.get(s.name, ("states", s.name))) for s in states] + [
            ("variable", v.name, ("actuators" if v.name in actuators else "variables", v.name)) for v in variables
        ]
        named += [("network", n, ("networks", n)) for n in networks]
        for e in elements:
            of = ("elements", e.name)
            named += [("deflection", f"s_{e.name}", of), ("rate", f"v_{e.name}", of), ("force", f"F_{e.name}", of)]
        seen: dict[str, str] = {"": ""}  # a missing name has been reported
        for kind, name, where in named:
            if seen.get(name):
                self.problem(where, f"'{name}' is taken by the {seen[name]} of that name", "rename one")
            seen.setdefault(name, kind)
        ends = [("inputs", i.name) for i in inputs] + [("points", p.name) for p in points] + [("actuators", n) for n in actuators]
        for section, name in dict.fromkeys(ends):
            if name in {b.name for b in bodies}:
                self.problem((section, name), f"'{name}' is taken by the body of that name", "rename one: an element could mean either")

    def shown(
        self, signals: tuple[m.Signal, ...], inputs: set[str], states: set[str], n_outputs: int, equations: tuple[m.Equation, ...]
    ) -> None:
        """In tables of results, a name stands for one quantity; that of a state also for what measures it, however well."""
        first: dict[str, str] = {name: name for name in inputs}
        for n, s in enumerate(signals):
            other = s.name in states and not measures(s.name, s.expression, equations)
            if s.expression and (other or first.setdefault(s.name, s.expression.strip()) != s.expression.strip()):
                self.problem(
                    ("outputs" if n < n_outputs else "sensors", s.name), f"'{s.name}' is already the name of another quantity", "rename one"
                )

    def expressions(
        self,
        elements: Iterable[m.Element],
        equations: Iterable[m.Equation],
        signals: Iterable[m.Signal],
        networks: dict[str, m.NetworkPort],
        n_outputs: int,
    ) -> None:
        """What is wrong with expressions whatever the names in them mean: for a file with other problems."""
        texts = [(("elements", e.name), e.expression) for e in elements if e.expression]
        texts += [(("equations", q.name), side) for q in equations for side in ex.sides(q.text)]
        texts += [(("outputs" if n < n_outputs else "sensors", s.name), s.expression) for n, s in enumerate(signals) if s.expression]
        for where, text in texts:
            try:
                ex.parse(text, _All(), {n: len(p.input_units) for n, p in networks.items() if n not in self.unsure}, _All())
            except ex.UnknownFunction:
                pass  # perhaps a network
            except ex.ExpressionError as error:
                self.problem(where, str(error), "correct the expression")

    def macros(self, parameters: dict[str, m.Parameter], networks: dict[str, m.NetworkPort], model: str) -> None:
        """Constants of the generated C are in capitals: names that differ in case only would meet."""
        seen = dict.fromkeys(MACROS, "")
        for n in (*parameters, *networks):
            changes = n in networks or parameters[n].tunable
            for name in (f"AT_{n}",) if changes else (n, f"{n}_INVERSE"):
                if (other := seen.setdefault(name.upper(), n)) != n:
                    where = self.made.get(n, ("parameters" if n in parameters else "networks", n))
                    by = f" by that of '{other}'" if other else ""
                    self.problem(where, f"its C constant {model.upper()}_{name.upper()} is already taken{by}", "rename it")
                    break


def load(path: str | Path) -> m.Model:
    """Read and check a model file with all network files it names. Raises ModelError with every problem found."""
    reader = _Reader(Path(path))
    model = reader.read()
    try:
        problems = check(model)
        model, more = (model, []) if problems else limits.complete(model)
        more += [] if problems or more else monitored.problems(model)
    except RecursionError as error:
        raise m.ModelError(
            [one_line(f"{path}: has equations that depend on each other in too long a chain; write a smaller model")]
        ) from error
    for where, what, remedy in (*problems, *more):
        reader.problem(where, what, remedy)
    if reader.problems:
        raise m.ModelError(reader.problems)
    return model
