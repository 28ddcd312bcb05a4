"""Read and check a model file. Every problem is reported at once, with its line and a remedy."""

from __future__ import annotations

import difflib
import hashlib
import math
import re
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any, Iterable

from . import model as m
from . import units
from .causalise import check
from .laws import LAWS
from .networks import Network, NetworkError, read_network

_NAME = re.compile(r"^[A-Za-z][A-Za-z0-9_]*$")
_RESERVED = {"exp", "tanh", "sigmoid", "softplus", "abs", "sign", "min", "max", "der", "where", m.GROUND}
_C_WORDS = set(
    "auto break case char const continue default do double else enum extern float for goto if inline int long register "
    "restrict return short signed sizeof static struct switch typedef union unsigned void volatile while bool true false "
    "self NULL".split()
)
_PREFIXES = ("pen_", "slope_", "bend_", "der_")  # of names that the generated code makes

_SECTIONS: dict[str, dict[str, type | tuple[type, ...]]] = {
    "parameters": {"value": (int, float), "unit": str, "tolerance": (int, float), "tunable": bool, "description": str},
    "inputs": {"unit": str, "min": (int, float), "max": (int, float), "noise": (int, float), "description": str},
    "bodies": {"mass": str, "position": str, "velocity": str, "start_position": str, "start_velocity": str},
    "states": {"unit": str, "start": (int, float), "description": str},
    "variables": {"unit": str},
    "networks": {"inputs": list, "output": str, "description": str},
    "outputs": {"value": str, "unit": str, "description": str},
    "sensors": {"value": str, "unit": str, "noise": (int, float), "description": str},
}
_REQUIRED = {
    "parameters": ("value", "unit"),
    "inputs": ("unit",),
    "bodies": ("mass", "position", "velocity"),
    "states": ("unit",),
    "variables": ("unit",),
    "networks": ("inputs", "output"),
    "outputs": ("value", "unit"),
    "sensors": ("value", "unit"),
}
_MODEL = {
    "extends": str, "name": str, "description": str, "sample_time": str, "method": str, "substeps": int, "input": str, "outside": str,
    "fade_width": (int, float),
}  # fmt: skip


class _Lines:
    """Where in the file a key stands."""

    def __init__(self, text: str):
        self._at: dict[tuple[str, ...], int] = {}
        table: tuple[str, ...] = ()
        for number, line in enumerate(text.splitlines(), 1):
            if header := re.match(r"^\s*\[+\s*([^\]]+?)\s*\]+", line):
                table = tuple(part.strip().strip("\"'") for part in header[1].split("."))
                self._at.setdefault(table, number)
            elif key := re.match(r"^\s*([A-Za-z0-9_.\"'-]+)\s*=", line):
                path = table + tuple(part.strip("\"'") for part in key[1].split("."))
                for depth in range(len(table) + 1, len(path) + 1):
                    self._at.setdefault(path[:depth], number)

    def knows(self, path: tuple[str, ...]) -> bool:
        """Does the file say anything under this path?"""
        return path[:2] in self._at

    def of(self, path: tuple[str, ...]) -> int:
        """Line of the key or of the closest table around it."""
        while path and path not in self._at:
            path = path[:-1]
        return self._at.get(path, 1)


def _parse(path: Path) -> tuple[dict[str, Any], bytes, _Lines]:
    """A model file as tables, bytes and places. Raises ModelError."""
    try:
        raw = path.read_bytes()
        text = raw.decode("utf-8")
        return tomllib.loads(text), raw, _Lines(text)
    except OSError as error:
        raise m.ModelError([f"{path}: cannot be read ({error.strerror}); give the path of a model file"]) from error
    except UnicodeDecodeError as error:
        raise m.ModelError([f"{path}: is not UTF-8 text (byte {error.start}); give a TOML model file"]) from error
    except tomllib.TOMLDecodeError as error:
        raise m.ModelError([f"{path}: is not valid TOML: {error}; mend the syntax there"]) from error


def _merge(base: dict[str, Any], own: dict[str, Any]) -> dict[str, Any]:
    """`own` over `base`, section by section."""
    return base | {k: base[k] | v if isinstance(v, dict) and isinstance(base.get(k), dict) else v for k, v in own.items()}


class _Reader:
    def __init__(self, path: Path):
        self.path = path
        self.problems: list[str] = []
        self.files: dict[Path, Network | None] = {}
        self.data, raw, lines = _parse(path)
        self.digest = hashlib.sha256(raw)
        self.places = [(path, lines)]
        head = self.data.get("model")
        if isinstance(head, dict) and isinstance(head.get("extends"), str):
            base = path.parent / head["extends"]
            tables, raw, lines = _parse(base)
            if isinstance(tables.get("model"), dict) and "extends" in tables["model"]:
                raise m.ModelError([f"{path}: extends {base}, which itself extends a file; extend the first one"])
            self.data = _merge(tables, self.data)
            self.digest.update(raw)
            self.places.append((base, lines))

    def problem(self, where: Iterable[str], what: str, remedy: str) -> None:
        where = tuple(where)
        path, lines = next(((p, la) for p, la in self.places if la.knows(where)), self.places[0])
        self.problems.append(f"{path}:{lines.of(where)}: {'.'.join(where)}: {what}; {remedy}")

    # -- tables ---------------------------------------------------------------------------------------------------

    def table(self, where: tuple[str, ...], allowed: dict[str, Any], data: Any, required: Iterable[str] = ()) -> dict[str, Any]:
        """The keys of a table that are known and of the right type; everything else is a problem."""
        if not isinstance(data, dict):
            self.problem(where, "is not a table", "write it as { key = value, ... }")
            return {}
        good = {}
        for key, value in data.items():
            if key not in allowed:
                near = difflib.get_close_matches(key, allowed, 1)
                self.problem((*where, key), "unknown key", f"did you mean '{near[0]}'?" if near else f"known are {', '.join(allowed)}")
            elif not isinstance(value, allowed[key]) or (isinstance(value, bool) and allowed[key] is not bool):
                self.problem((*where, key), f"{value!r} has the wrong type", f"give {_type_name(allowed[key])}")
            else:
                good[key] = value
        for key in required:
            if key not in data:
                self.problem(where, f"'{key}' is missing", f"add {key} = ...")
        return good

    def section(self, name: str) -> dict[str, dict[str, Any]]:
        """All entries of a section such as [parameters]."""
        entries = self.data.get(name, {})
        if not isinstance(entries, dict):
            self.problem((name,), "is not a table", f"write [{name}]")
            return {}
        found = {}
        for key, value in entries.items():
            if not _NAME.match(key) or key in _C_WORDS or key in _RESERVED or key.startswith(_PREFIXES):
                self.problem((name, key), "cannot be a name in C", f"use letters, digits and _, no word of C, no function, and no {', '.join(_PREFIXES)} in front")
                continue
            found[key] = self.table((name, key), _SECTIONS[name], value, _REQUIRED[name])
        return found

    def unit(self, where: tuple[str, ...], text: Any) -> float:
        """Factor to SI; 1 after reporting a problem."""
        if not isinstance(text, str):
            return 1.0
        try:
            return units.factor(text)
        except units.UnitError as error:
            self.problem(where, str(error), "write it like 'N*s/m' or 'mm'")
            return 1.0

    def quantity(self, where: tuple[str, ...], text: str, unit: str) -> float:
        """A text such as '1 ms' in SI, checked against the dimension of `unit`."""
        try:
            value, given = units.quantity(text)
            if not units.same_dimension(given, unit):
                self.problem(where, f"'{text}' is not measured in {unit}", f"give a quantity in {unit}")
            return value
        except units.UnitError as error:
            self.problem(where, str(error), f"give a number with a unit, in {unit}")
            return math.nan

    # -- the parts of a model -------------------------------------------------------------------------------------

    def read(self) -> m.Model:
        for key in self.data:
            if key not in (*_SECTIONS, "model", "elements", "equations", "sets"):
                near = difflib.get_close_matches(key, [*_SECTIONS, "model", "elements", "equations", "sets"], 1)
                self.problem((key,), "unknown section", f"did you mean [{near[0]}]?" if near else "remove it")
        head = self.table(("model",), _MODEL, self.data.get("model", {}), ("name", "sample_time"))
        if "name" in head and not re.match(r"^[a-z][a-z0-9_]*$", head["name"]):
            self.problem(("model", "name"), f"'{head['name']}' cannot prefix C names", "use lower-case letters, digits and _")
        sample_time = self.quantity(("model", "sample_time"), head.get("sample_time", "1 s"), "s")
        if not sample_time > 0.0:
            self.problem(("model", "sample_time"), "is not above zero", "give a time such as '1 ms'")
        for key, default, choices in (("method", "rk4", m.METHODS), ("input", "linear", m.INTERPOLATIONS), ("outside", "extrapolate", m.OUTSIDE)):
            if head.setdefault(key, default) not in choices:
                self.problem(("model", key), f"'{head[key]}' is unknown", f"choose one of {', '.join(choices)}")
        if not 1 <= head.setdefault("substeps", 1) <= 1000:
            self.problem(("model", "substeps"), f"{head['substeps']} is out of range", "give 1 to 1000")
        if not 0.0 < head.setdefault("fade_width", 0.1) <= 100.0:
            self.problem(("model", "fade_width"), "is out of range", "give the fading distance in widths of the envelope, 0 to 100")

        parameters = self.parameters()
        inputs = tuple(self.inputs())
        bodies = tuple(self.bodies(parameters))
        networks = dict(self.networks())
        elements = tuple(self.elements(parameters, inputs, bodies, networks))
        states = tuple(
            m.State(k, v.get("unit", "1"), v.get("start", 0.0) * self.unit(("states", k), v.get("unit", "1")), v.get("description", ""))
            for k, v in self.section("states").items()
        )
        variables = tuple(m.Variable(k, v.get("unit", "1")) for k, v in self.section("variables").items())
        for v in variables:
            self.unit(("variables", v.name), v.unit)
        equations = tuple(self.equations())
        outputs = tuple(self.signals("outputs"))
        sensors = tuple(self.signals("sensors"))
        sets = self.sets(parameters, networks)
        self.unique(parameters, inputs, bodies, elements, states, variables, networks)
        if not (bodies or states or outputs):
            self.problem((), "has neither bodies, states nor outputs", "describe something to simulate")
        if self.problems:
            raise m.ModelError(self.problems)
        return m.Model(
            name=head["name"], description=head.get("description", ""), sample_time=sample_time, method=head["method"],
            substeps=head["substeps"], interpolation=head["input"], outside=head["outside"], fade_width=float(head["fade_width"]),
            parameters=parameters, inputs=inputs, bodies=bodies, elements=elements, extra_states=states, variables=variables,
            equations=equations, networks=networks, outputs=outputs, sensors=sensors, sets=sets, path=self.path,
            digest=self.digest.hexdigest(),
        )  # fmt: skip

    def parameters(self) -> dict[str, m.Parameter]:
        found = {}
        for name, entry in self.section("parameters").items():
            value = float(entry.get("value", 0.0)) * self.unit(("parameters", name), entry.get("unit"))
            tolerance = float(entry.get("tolerance", 0.0))
            if not math.isfinite(value):
                self.problem(("parameters", name), f"value {value} is not finite", "give a number")
            if not 0.0 <= tolerance < 1.0:
                self.problem(("parameters", name), f"tolerance {tolerance} is not a share", "give 0 to 1, such as 0.05 for 5 %")
            found[name] = m.Parameter(
                name, value, entry.get("unit", "1"), tolerance, entry.get("tunable", False), entry.get("description", "")
            )
        return found

    def inputs(self) -> Iterable[m.Input]:
        for name, entry in self.section("inputs").items():
            scale = self.unit(("inputs", name), entry.get("unit"))
            low, high = (None if entry.get(k) is None else entry[k] * scale for k in ("min", "max"))
            if low is not None and high is not None and not low < high:
                self.problem(("inputs", name), "min is not below max", "exchange them")
            yield m.Input(name, entry.get("unit", "1"), low, high, entry.get("noise", 0.0) * scale, entry.get("description", ""))

    def bodies(self, parameters: dict[str, m.Parameter]) -> Iterable[m.Body]:
        for name, entry in self.section("bodies").items():
            where = ("bodies", name)
            mass = self.argument(where, "mass", entry.get("mass", "1 kg"), "kg", f"m_{name}", parameters)
            if mass in parameters and not parameters[mass].value > 0.0:
                self.problem(where, f"mass '{mass}' is not above zero", "give a positive mass; write a massless point as plain equations")
            start = tuple(
                self.quantity(where, entry[key], unit) if key in entry else 0.0
                for key, unit in (("start_position", "m"), ("start_velocity", "m/s"))
            )
            yield m.Body(name, mass, entry.get("position", ""), entry.get("velocity", ""), start)

    def argument(self, where: tuple[str, ...], key: str, text: str, unit: str, new: str, parameters: dict[str, m.Parameter]) -> str:
        """Name of the parameter that `text` names, or of a new one made from a quantity such as '35 N'."""
        if _NAME.match(text):
            if text not in parameters:
                near = difflib.get_close_matches(text, parameters, 1)
                self.problem(where, f"{key} = '{text}' is no parameter", f"did you mean '{near[0]}'?" if near else f"add it to [parameters] or write a quantity in {unit}")
                return text
            given = parameters[text].unit
            try:
                if not units.same_dimension(given, unit):
                    self.problem(where, f"{key} = '{text}' is in {given}, needed is {unit}", "use a parameter of that unit")
            except units.UnitError:
                pass  # reported where the parameter is defined
            return text
        value = self.quantity(where, text, unit)
        parameters[new] = m.Parameter(new, value, unit, description=f"{key} of {where[-1]}")
        return new

    def networks(self) -> Iterable[tuple[str, m.NetworkPort]]:
        for name, entry in self.section("networks").items():
            where = ("networks", name)
            inputs = entry.get("inputs", [])
            if not inputs or not all(isinstance(u, str) for u in inputs):
                self.problem(where, "'inputs' must list the unit of each input", 'write inputs = ["m"]')
                inputs = ["1"]
            for unit in (*inputs, entry.get("output", "1")):
                self.unit(where, unit)
            yield name, m.NetworkPort(name, tuple(inputs), entry.get("output", "1"), entry.get("description", ""))

    def elements(
        self, parameters: dict[str, m.Parameter], inputs: tuple[m.Input, ...], bodies: tuple[m.Body, ...], networks: dict[str, m.NetworkPort]
    ) -> Iterable[m.Element]:
        ends_known = [b.name for b in bodies] + [i.name for i in inputs] + [m.GROUND]
        entries = self.data.get("elements", {})
        for name, entry in entries.items() if isinstance(entries, dict) else ():
            where = ("elements", name)
            if not _NAME.match(name):
                self.problem(where, "cannot be a name in C", "use letters, digits and _")
                continue
            law = entry.get("law") if isinstance(entry, dict) else None
            common = {"between": list, "law": str, "description": str}
            if law == "network":
                entry = self.table(where, common | {"network": str, "inputs": list}, entry, ("between", "network"))
            elif law == "expression":
                entry = self.table(where, common | {"force": str}, entry, ("between", "force"))
            elif law in LAWS:
                arguments = LAWS[law].arguments
                entry = self.table(where, common | dict.fromkeys(arguments, str), entry, ("between", *arguments))
            else:
                near = difflib.get_close_matches(str(law), [*LAWS, "network", "expression"], 1)
                known = f"did you mean '{near[0]}'?" if near else f"known are network, expression, {', '.join(LAWS)}"
                self.problem(where, f"law '{law}' is unknown", known)
                continue
            ends = entry.get("between", [])
            if len(ends) != 2 or not all(isinstance(e, str) for e in ends) or ends[0] == ends[1]:
                self.problem(where, f"between = {ends} does not name two different ends", 'write between = ["body", "wheel"]')
                continue
            for end in ends:
                if end not in ends_known:
                    near = difflib.get_close_matches(end, ends_known, 1)
                    self.problem(where, f"end '{end}' is no body, input or ground", f"did you mean '{near[0]}'?" if near else f"known are {', '.join(ends_known)}")
            for i in inputs:
                if i.name in ends and not _same(i.unit, "m"):
                    self.problem(where, f"input '{i.name}' is in {i.unit}, an end needs a position", "use an input in m")
            if law == "network":
                yield self.network_element(name, ends, entry, networks)
            elif law == "expression":
                yield m.Element(name, tuple(ends), law, expression=entry.get("force", "0"))
            else:
                arguments = {
                    key: self.argument(where, key, entry[key], unit, f"{name}_{key}", parameters)
                    for key, unit in LAWS[law].arguments.items()
                    if key in entry
                }
                yield m.Element(name, tuple(ends), law, arguments)

    def network_element(self, name: str, ends: list[str], entry: dict[str, Any], networks: dict[str, m.NetworkPort]) -> m.Element:
        where = ("elements", name)
        network = entry.get("network", "")
        inputs = entry.get("inputs")
        if network not in networks:
            near = difflib.get_close_matches(network, networks, 1)
            self.problem(where, f"network '{network}' is not declared", f"did you mean '{near[0]}'?" if near else "add it to [networks]")
            return m.Element(name, (ends[0], ends[1]), "network")
        port = networks[network]
        kinds = {"deflection": "m", "rate": "m/s"}
        if inputs is None:  # the units say which is meant
            inputs = [next((k for k, u in kinds.items() if _same(u, unit)), "") for unit in port.input_units]
        for kind, unit in zip(inputs, port.input_units):
            if kind not in kinds:
                self.problem(where, f"input '{kind}' of the network is neither deflection nor rate", 'write inputs = ["deflection"]')
            elif not _same(kinds[kind], unit):
                self.problem(where, f"the network takes {unit}, but {kind} is in {kinds[kind]}", "mend the unit in [networks]")
        if len(inputs) != len(port.input_units):
            self.problem(where, f"{len(inputs)} inputs for a network of {len(port.input_units)}", "give one for each")
        if not _same(port.output_unit, "N"):
            self.problem(where, f"network '{network}' gives {port.output_unit}, an element needs a force", "declare its output in N")
        return m.Element(name, (ends[0], ends[1]), "network", network=network, network_inputs=tuple(inputs))

    def equations(self) -> Iterable[m.Equation]:
        entries = self.data.get("equations", {})
        for name, text in entries.items() if isinstance(entries, dict) else ():
            if not isinstance(text, str) or text.count("=") != 1:
                self.problem(("equations", name), "is not one equation", "write it as \"der(T) = (T0 - T)/tau\"")
                continue
            yield m.Equation(name, text)

    def signals(self, section: str) -> Iterable[m.Signal]:
        for name, entry in self.section(section).items():
            scale = self.unit((section, name), entry.get("unit"))
            yield m.Signal(name, entry.get("value", "0"), entry.get("unit", "1"), entry.get("noise", 0.0) * scale, entry.get("description", ""))

    def sets(self, parameters: dict[str, m.Parameter], networks: dict[str, m.NetworkPort]) -> dict[str, m.ParameterSet]:
        tunable = [p for p in parameters.values() if p.tunable]
        entries = self.data.get("sets", {})
        if not isinstance(entries, dict) or (networks and "default" not in entries):
            self.problem(("sets",), "there is no set 'default'", "add [sets.default] with a file for each network")
            return {}
        allowed = {n: (str, dict) for n in networks} | {p.name: str for p in tunable}
        sets: dict[str, m.ParameterSet] = {}
        base: dict[str, Any] = {}
        for number, (name, entry) in enumerate(({"default": {}} | entries).items(), 1):
            where = ("sets", name)
            if not _NAME.match(name):
                self.problem(where, "cannot be a name in C", "use letters, digits and _")
                continue
            entry = self.table(where, allowed, entry, networks if name == "default" else ())
            base = base or entry
            chosen = {n: self.network(where, n, (base | entry)[n], networks[n]) for n in networks if n in base | entry}
            values = {
                p.name: self.quantity((*where, p.name), (base | entry)[p.name], p.unit) if p.name in base | entry else p.value
                for p in tunable
            }
            sets[name] = m.ParameterSet(name, number, {n: net for n, net in chosen.items() if net is not None}, values)
        first = sets.get("default")
        for s in sets.values():
            for n, net in s.networks.items():
                if first and n in first.networks and net.architecture != first.networks[n].architecture:
                    self.problem(("sets", s.name, n), "has another architecture than in the set 'default'", "train the same layers: sets share one code")
        return sets

    def network(self, where: tuple[str, ...], name: str, entry: str | dict[str, Any], port: m.NetworkPort) -> Network | None:
        """The network file of one port, with its trust envelope."""
        where = (*where, name)
        if isinstance(entry, str):
            entry = {"file": entry}
        entry = self.table(where, {"file": str, "min": list, "max": list}, entry, ("file",))
        if "file" not in entry:
            return None
        path = self.path.parent / entry["file"]
        if path not in self.files:
            try:
                self.files[path] = read_network(path)
                self.digest.update(path.read_bytes())
            except NetworkError as error:
                self.problem(where, str(error).replace("\n", " "), "see [sets]")
                self.files[path] = None
        network = self.files[path]
        if network is None:
            return None
        if network.n_inputs != len(port.input_units) or network.n_outputs != 1:
            self.problem(where, f"{path.name} has {network.n_inputs} input(s) and {network.n_outputs} output(s), declared are {len(port.input_units)} and 1", "mend [networks] or the file")
            return None
        try:
            return replace(network, input_min=entry.get("min", network.input_min), input_max=entry.get("max", network.input_max))
        except NetworkError as error:
            self.problem(where, str(error), "give min and max, one number for each input, or write them into the file")
            return None

    def unique(self, parameters, inputs, bodies, elements, states, variables, networks) -> None:
        """No name may mean two things."""
        seen: dict[str, str] = {}
        named = [("parameter", n) for n in parameters] + [("input", i.name) for i in inputs]
        named += [("position", b.position) for b in bodies] + [("velocity", b.velocity) for b in bodies]
        named += [("state", s.name) for s in states] + [("variable", v.name) for v in variables] + [("network", n) for n in networks]
        for e in elements:
            named += [("deflection", f"s_{e.name}"), ("rate", f"v_{e.name}"), ("force", f"F_{e.name}")]
        for kind, name in named:
            if name in seen:
                self.problem((f"{kind}s" if f"{kind}s" in self.data else "model", name), f"'{name}' is already the name of a {seen[name]}", "rename one")
            if not _NAME.match(name) or name in _C_WORDS:
                self.problem(("bodies",), f"'{name}' cannot be a name in C", "rename it")
            seen[name] = kind


def _same(a: str, b: str) -> bool:
    try:
        return units.same_dimension(a, b)
    except units.UnitError:
        return True  # reported where it stands


def _type_name(kind: Any) -> str:
    names = {str: "a text", bool: "true or false", list: "a list", dict: "a table", int: "a whole number"}
    if kind == (int, float):
        return "a number"
    return names.get(kind, "a text or a table")


def load(path: str | Path) -> m.Model:
    """Read and check a model file with all network files it names. Raises ModelError with every problem found."""
    reader = _Reader(Path(path))
    model = reader.read()
    for where, what, remedy in check(model):
        reader.problem(where, what, remedy)
    if reader.problems:
        raise m.ModelError(reader.problems)
    return model
