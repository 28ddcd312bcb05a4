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

import numpy as np

from . import expressions as ex
from . import model as m
from . import units
from .causalise import check
from .laws import LAWS
from .networks import Network, NetworkError, read_network
from .fold import foldable, pieces, room
from .sets import network_pieces

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}")
_MODEL_NAME = re.compile(r"[a-z][a-z0-9_]{0,39}")
_C_WORDS = set(
    "auto break case char const continue default do double else enum extern float for goto if inline int long register "
    "restrict return short signed sizeof static struct switch typedef union unsigned void volatile while bool true false "
    "self NULL linux unix size_t ptrdiff_t wchar_t "
    "H GH SUBSTEPS N_X N_U N_Y N_Q N_W N_DRIVE N_KEPT N_COLUMNS AT_CHANGE AT_BEND AT_TWIST N_SENSORS".split()
)
_C_PATTERN = re.compile(r"u?int\w*_t|U?INT\w*_(MAX|MIN|C)|(SIZE|PTRDIFF|WCHAR|SIG_ATOMIC|WINT)_(MAX|MIN)")
_RESERVED = {*ex.FUNCTIONS, "der", "where", m.GROUND}
_PREFIXES = ("pen_", "PEN_", "slope_", "second_", "inputs_of_", "slopes_of_", "seconds_of_", "piece_of_", "der_", "network_")  # of names that the generated code makes
# A model of that name would have a header or a type that others have already.
_MODEL_WORDS = set(
    "assert complex ctype errno fenv float inttypes iso646 limits locale math setjmp signal stdarg stdbool stddef stdint "
    "stdio stdlib string tgmath time wchar wctype size ptrdiff sample pen".split()
)
_COMMENT = re.compile(r"(?:(?!\*/|/\*)[^\x00-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff\\]){0,200}")
_UNKNOWN = "?"  # stands for a unit that was missing: no second complaint where it is used

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
_MACROS = (  # that each generated model defines, behind its name
    "N_X N_U N_Y N_SENSORS N_LAST N_DRIVE N_COLUMNS N_KEPT N_Q N_W SAMPLE_TIME SUBSTEPS STEP IMPLICIT_STEP AT_FIRST AT_SECOND AT_THIRD "
    "LAYOUT SET_LENGTH SCRUB VERIFY SAVED PIECES H SETS_H".split()
)
ROOM = 4096  # pieces of a folded network, at most
_MODEL = {
    "extends": str, "name": str, "description": str, "sample_time": str, "method": str, "substeps": int, "input": str, "outside": str,
    "fade_width": (int, float), "pieces": int, "more_pieces": str, "out_of_range": str, "on_damage": str, "trial": int,
}  # fmt: skip


_TOKEN = re.compile(r'"""(?:\\.|[^\\])*?"""|\'\'\'.*?\'\'\'|"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\'|#[^\n]*|[\[\]{}\n]', re.DOTALL)
_QUOTED = r'"[^"\n]*"|\'[^\'\n]*\''
_HEADER = re.compile(rf"[ \t]*\[\[?((?:{_QUOTED}|[^\]\"'\n])+)\]")
_KEY = re.compile(rf"[ \t]*((?:{_QUOTED}|[A-Za-z0-9_. \t-])+)=")
_KEY_PART = re.compile(rf"{_QUOTED}|[A-Za-z0-9_-]+")


class _Lines:
    """Where in the file a key stands."""

    def __init__(self, text: str):
        self._at: dict[tuple[str, ...], int] = {}
        table: tuple[str, ...] = ()
        number, depth, starts = 1, 0, [(0, 1)]  # where statements may start: not within brackets or strings
        for token in _TOKEN.finditer(text):
            depth += (token[0] in "[{") - (token[0] in "]}")
            number += token[0].count("\n")
            if token[0] == "\n" and depth == 0:
                starts.append((token.end(), number))
        for at, line in starts:
            if header := _HEADER.match(text, at):
                table = self._parts(header[1])
                self._at.setdefault(table, line)
            elif key := _KEY.match(text, at):
                path = table + self._parts(key[1])
                for depth in range(len(table) + 1, len(path) + 1):
                    self._at.setdefault(path[:depth], line)

    @staticmethod
    def _parts(key: str) -> tuple[str, ...]:
        return tuple(part.strip("\"'") for part in _KEY_PART.findall(key))

    def knows(self, path: tuple[str, ...]) -> bool:
        """Does the file say anything under this path?"""
        return path[:2] in self._at

    def of(self, path: tuple[str, ...]) -> int:
        """Line of the key or of the closest table around it."""
        while path and path not in self._at:
            path = path[:-1]
        return self._at.get(path, 1)


def _line(text: str) -> str:
    """The text on one line, without anything that a terminal would act on."""
    return "".join(c if c.isprintable() else " " for c in text)


def _show(value: object) -> str:
    """A value of the file, in messages."""
    try:
        text = repr(value)
    except ValueError:  # an integer of thousands of digits
        return "a huge number"
    return text if len(text) <= 60 else f"{text[:57]}..."


def _parse(path: Path, called: str = "") -> tuple[dict[str, Any], bytes, _Lines]:
    """A model file as tables, bytes and places; `called` names who asked for it. Raises ModelError."""
    try:
        raw = path.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise m.ModelError([_line(f"{called or path}{f': {path}' * bool(called)}: cannot be read ({reason}); give the path of a model file")]) from error
    try:
        text = raw.decode("utf-8").replace("\r\n", "\n")
        return tomllib.loads(text), raw, _Lines(text)
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise m.ModelError([_line(f"{path}:{line}: is not UTF-8 text; save it as UTF-8, or give a TOML model file")]) from error
    except (ValueError, RecursionError) as error:  # TOMLDecodeError is a ValueError; so is an integer of thousands of digits
        found = re.search(r" \(at line (\d+), column \d+\)", str(error))
        toml = isinstance(error, tomllib.TOMLDecodeError)
        what = str(error).replace(found[0], "") if found else str(error) if toml else "a number or a nesting beyond all measure"
        line = found[1] if found else raw.count(b"\n") + (not raw.endswith(b"\n"))
        raise m.ModelError([_line(f"{path}:{line}: is not valid TOML ({what}); mend the syntax there")]) from error


def _merge(base: dict[str, Any], own: dict[str, Any]) -> dict[str, Any]:
    """`own` over `base`, section by section."""
    return base | {k: base[k] | v if isinstance(v, dict) and isinstance(base.get(k), dict) else v for k, v in own.items()}


class _All(frozenset):
    """Contains everything."""

    def __contains__(self, item: object) -> bool:
        return True


class _Reader:
    def __init__(self, path: Path):
        self.path = path
        self.problems: list[str] = []
        self.files: dict[Path, Network | None] = {}
        self.data, raw, lines = _parse(path)
        self.digest = hashlib.sha256(raw)
        self.places = [(path, lines)]
        self.set_owner = ""  # the model that this one shares its sets with
        self.unsure: set[str] = set()  # networks whose declaration is at fault
        self.made: dict[str, tuple[str, ...]] = {}  # parameters made from quantities, and where
        head = self.data.get("model")
        if isinstance(head, dict) and isinstance(head.get("extends"), str):
            base = path.parent / head["extends"]
            place = f"{path}:{lines.of(('model', 'extends'))}: model.extends"
            tables, raw, lines = _parse(base, place)
            if isinstance(tables.get("model"), dict) and "extends" in tables["model"]:
                raise m.ModelError([_line(f"{place}: {base} itself extends a file; extend that one")])
            if not {"parameters", "networks", "sets"} & set(self.data) and isinstance(tables.get("model"), dict):
                self.set_owner = str(tables["model"].get("name", ""))
            self.data = _merge(tables, self.data)
            self.digest.update(raw)
            self.places.append((base, lines))

    def place(self, where: tuple[str, ...]) -> tuple[Path, _Lines]:
        """The file that says something about this key."""
        return next(((p, la) for p, la in self.places if la.knows(where)), self.places[0])

    def problem(self, where: Iterable[str], what: str, remedy: str) -> None:
        where = tuple(where)
        path, lines = self.place(where)
        self.problems.append(_line(f"{path}:{lines.of(where)}: {'.'.join(where)}{': ' * bool(where)}{what}; {remedy}"))

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
                self.problem((*where, key), f"{_show(value)} has the wrong type", f"give {_type_name(allowed[key])}")
            else:
                good[key] = value
                if key == "description" and not _COMMENT.fullmatch(value):
                    self.problem((*where, key), "cannot be a comment in C", "use one line of up to 200 characters, without backslash, /* and */")
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
            self.name((name, key), key, _PREFIXES[:-1] if name == "networks" else _PREFIXES)
            found[key] = self.table((name, key), _SECTIONS[name], value, _REQUIRED[name])
        return found

    def name(self, where: tuple[str, ...], name: str, prefixes: tuple[str, ...] = _PREFIXES) -> None:
        """Report what cannot stand for a value in the generated C."""
        if not _NAME.fullmatch(name) or name.endswith("_"):
            self.problem(where, f"{_show(name)} cannot be a name", "use up to 40 letters, digits and _, with a letter in front and no _ at the end")
        elif name in _C_WORDS or name in _RESERVED or _C_PATTERN.fullmatch(name) or name.startswith(prefixes):
            self.problem(where, f"'{name}' has a meaning of its own in C or in model files", "choose another name")

    def label(self, where: tuple[str, ...], name: str) -> None:
        """Report what cannot be a part of a name."""
        if not _NAME.fullmatch(name):
            self.problem(where, f"{_show(name)} cannot be a name", "use up to 40 letters, digits and _, with a letter in front")

    def unit(self, where: tuple[str, ...], text: Any) -> float:
        """Factor to SI; 1 after reporting a problem, or where a unit is missing."""
        if not isinstance(text, str):
            return 1.0
        try:
            return units.factor(text)
        except units.UnitError as error:
            self.problem(where, str(error), "write it like 'N*s/m' or 'mm'")
            return 1.0

    def number(self, where: tuple[str, ...], value: int | float, scale: float = 1.0) -> float:
        """A number in SI that a float can hold; NaN after reporting a problem."""
        try:
            found = float(value) * scale
        except OverflowError:
            found = math.inf
        if not ex.in_range(found):
            self.problem(where, f"{_show(value)} is no number that a float can hold", "give 0, or a size from 1.2e-38 to 3.4e38 in SI")
            return math.nan
        return found

    def quantity(self, where: tuple[str, ...], text: str, unit: str) -> float:
        """A text such as '1 ms' in SI, checked against the dimension of `unit`; NaN after reporting a problem."""
        try:
            value, given = units.quantity(text)
        except units.UnitError as error:
            self.problem(where, str(error), f"give a number with a unit, in {unit}")
            return math.nan
        if not _same(given, unit):
            self.problem(where, f"{_show(text)} is not measured in {unit}", f"give a quantity in {unit}")
        elif not ex.in_range(value):
            self.problem(where, f"{_show(text)} is no number that a float can hold", "give 0, or a size from 1.2e-38 to 3.4e38 in SI")
        else:
            return value
        return math.nan

    # -- the parts of a model -------------------------------------------------------------------------------------

    def read(self) -> m.Model:
        if not self.data:
            raise m.ModelError([_line(f"{self.path}:1: says nothing; write a model with [model], [inputs] and [outputs]")])
        if not self.path.name.isprintable():
            self.problem((), "the file has a name that cannot stand in a comment", "rename it")
        for key in self.data:
            if key not in (*_SECTIONS, "model", "elements", "equations", "sets"):
                near = difflib.get_close_matches(key, [*_SECTIONS, "model", "elements", "equations", "sets"], 1)
                self.problem((key,), "unknown section", f"did you mean [{near[0]}]?" if near else "remove it")
        head = self.table(("model",), _MODEL, self.data.get("model", {}), ("name", "sample_time"))
        name = head.get("name", "model")
        if not _MODEL_NAME.fullmatch(name) or name.endswith("_"):
            self.problem(("model", "name"), f"{_show(name)} cannot prefix C names", "use up to 40 lower-case letters, digits and _")
        elif name in _MODEL_WORDS or name.startswith("pen_") or _C_PATTERN.fullmatch(f"{name}_t"):
            self.problem(("model", "name"), f"'{name}' has a meaning of its own in C", "choose another name")
        sample_time = self.quantity(("model", "sample_time"), head.get("sample_time", "1 s"), "s")
        if sample_time < 1e-9 or sample_time > 86400.0:
            self.problem(("model", "sample_time"), f"{head['sample_time']} is out of range", "give a time from 1 ns to 1 day, such as '1 ms'")
        for key, default, choices in (
            ("method", "rk4", m.METHODS), ("input", "linear", m.INTERPOLATIONS),
            ("outside", "extrapolate", m.OUTSIDE), ("more_pieces", "refuse", m.MORE_PIECES),
            ("out_of_range", "report", m.OUT_OF_RANGE), ("on_damage", "report", m.ON_DAMAGE),
        ):  # fmt: skip
            if head.setdefault(key, default) not in choices:
                self.problem(("model", key), f"'{head[key]}' is unknown", f"choose one of {', '.join(choices)}")
        if not 1 <= head.setdefault("substeps", 1) <= 1000:
            self.problem(("model", "substeps"), f"{head['substeps']} is out of range", "give 1 to 1000")
        if not 1e-6 <= head.setdefault("fade_width", 0.1) <= 100.0:
            self.problem(("model", "fade_width"), "is out of range", "give the fading distance in widths of the envelope, 1e-6 to 100")
        if head.setdefault("pieces", 0) != 0 and not 4 <= head["pieces"] <= ROOM:
            self.problem(("model", "pieces"), f"{head['pieces']} is out of range", f"give room for 4 to {ROOM} pieces, or 0 to evaluate layer by layer")

        if not 0 <= head.setdefault("trial", 0) <= 10000:
            self.problem(("model", "trial"), f"{head['trial']} is out of range", "give the samples that a new set is tried on, up to 10000, or 0 for none")

        parameters = self.parameters()
        inputs = tuple(self.inputs())
        bodies = tuple(self.bodies(parameters))
        networks = dict(self.networks())
        elements = tuple(self.elements(parameters, inputs, bodies, networks))
        states = (*self.states(), *_law_states(elements))
        variables = tuple(self.variables())
        equations = tuple(self.equations())
        outputs = tuple(self.signals("outputs"))
        sensors = tuple(self.signals("sensors"))
        sets = self.sets(parameters, networks, {b.mass for b in bodies})
        self.folds(head, sets)
        self.unique(parameters, inputs, bodies, elements, states, variables, networks)
        moving = {*(s.name for s in states), *(b.position for b in bodies), *(b.velocity for b in bodies)}
        self.shown((*outputs, *sensors), {i.name for i in inputs}, moving, len(outputs))
        self.macros(parameters, networks, name)
        for section, entries in (("inputs", inputs), ("outputs", outputs)):
            if not entries and not self.data.get(section):
                self.problem((section,), f"the model has no {section}", f"add [{section}]: the C needs at least one")
        if self.problems:
            self.expressions(elements, equations, (*outputs, *sensors), networks, len(outputs))
            raise m.ModelError(self.problems)
        return m.Model(
            name=head["name"], description=head.get("description", ""), sample_time=sample_time, method=head["method"],
            substeps=head["substeps"], interpolation=head["input"], outside=head["outside"], fade_width=float(head["fade_width"]),
            pieces=room(head["pieces"]), more_pieces=head["more_pieces"], parameters=parameters, inputs=inputs, bodies=bodies, elements=elements, extra_states=states, variables=variables,
            equations=equations, networks=networks, outputs=outputs, sensors=sensors, sets=sets, path=self.path,
            digest=self.digest.hexdigest(), guard=m.Guard(head["out_of_range"], head["on_damage"], head["trial"]), set_owner=self.set_owner,
        )  # fmt: skip

    def parameters(self) -> dict[str, m.Parameter]:
        found = {}
        for name, entry in self.section("parameters").items():
            where = ("parameters", name)
            value = self.number((*where, "value"), entry["value"], self.unit(where, entry.get("unit"))) if "value" in entry else math.nan
            tolerance = self.number((*where, "tolerance"), entry.get("tolerance", 0.0))
            if tolerance < 0.0 or tolerance >= 1.0:
                self.problem(where, f"tolerance {tolerance} is not a share", "give 0 to 1, such as 0.05 for 5 %")
            tunable = entry.get("tunable", "tunable" in self.stated("parameters", name))  # of a wrong type: meant to be
            found[name] = m.Parameter(name, value, entry.get("unit", _UNKNOWN), tolerance, tunable, entry.get("description", ""))
        return found

    def stated(self, section: str, name: str) -> dict[str, Any]:
        """The entry as it stands in the file, known or not."""
        entry = self.data[section][name]
        return entry if isinstance(entry, dict) else {}

    def inputs(self) -> Iterable[m.Input]:
        for name, entry in self.section("inputs").items():
            where = ("inputs", name)
            scale = self.unit(where, entry.get("unit"))
            low, high = (None if entry.get(k) is None else self.number((*where, k), entry[k], scale) for k in ("min", "max"))
            if low is not None and high is not None and low >= high:
                self.problem(where, "min is not below max", "exchange them")
            yield m.Input(name, entry.get("unit", _UNKNOWN), low, high, self.noise(where, entry, scale), entry.get("description", ""))

    def noise(self, where: tuple[str, ...], entry: dict[str, Any], scale: float) -> float:
        """The standard deviation of a measured signal, SI."""
        noise = self.number((*where, "noise"), entry.get("noise", 0.0), scale)
        if noise < 0.0:
            self.problem((*where, "noise"), f"{entry['noise']} is below zero", "give a standard deviation")
        return noise

    def bodies(self, parameters: dict[str, m.Parameter]) -> Iterable[m.Body]:
        for name, entry in self.section("bodies").items():
            where = ("bodies", name)
            mass = self.argument(where, "mass", entry["mass"], "kg", f"m_{name}", parameters) if "mass" in entry else ""
            if mass in parameters and parameters[mass].value <= 0.0:
                self.problem(where, f"mass '{entry['mass']}' is not above zero", "give a positive mass; write a massless point as plain equations")
            for key in ("position", "velocity"):
                if key in entry:
                    self.name((*where, key), entry[key])
            start = tuple(
                self.quantity((*where, key), entry[key], unit) if key in entry else 0.0
                for key, unit in (("start_position", "m"), ("start_velocity", "m/s"))
            )
            yield m.Body(name, mass, entry.get("position", ""), entry.get("velocity", ""), start)

    def states(self) -> Iterable[m.State]:
        for name, entry in self.section("states").items():
            scale = self.unit(("states", name), entry.get("unit"))
            start = self.number(("states", name, "start"), entry.get("start", 0.0), scale)
            yield m.State(name, entry.get("unit", _UNKNOWN), start, entry.get("description", ""))

    def variables(self) -> Iterable[m.Variable]:
        for name, entry in self.section("variables").items():
            self.unit(("variables", name), entry.get("unit"))
            yield m.Variable(name, entry.get("unit", _UNKNOWN))

    def argument(self, where: tuple[str, ...], key: str, text: str, unit: str, new: str, parameters: dict[str, m.Parameter]) -> str:
        """Name of the parameter that `text` names, or of a new one made from a quantity such as '35 N'."""
        where = (*where, key)
        if _NAME.fullmatch(text):
            if text not in parameters:
                near = difflib.get_close_matches(text, parameters, 1)
                self.problem(where, f"'{text}' is no parameter", f"did you mean '{near[0]}'?" if near else f"add it to [parameters] or write a quantity in {unit}")
            elif not _same(parameters[text].unit, unit):
                self.problem(where, f"'{text}' is in {parameters[text].unit}, needed is {unit}", "use a parameter of that unit")
            return text
        value = self.quantity(where, text, unit)
        if new in parameters:
            self.problem(where, f"this quantity would become the parameter '{new}', which there is already", f"name that one, or rename it")
        else:
            parameters[new] = m.Parameter(new, value, unit, description=f"{key} of {where[1]}")
            self.made[new] = where
        return new

    def networks(self) -> Iterable[tuple[str, m.NetworkPort]]:
        for name, entry in self.section("networks").items():
            where = ("networks", name)
            inputs = entry.get("inputs", [])
            if not inputs or not all(isinstance(u, str) for u in inputs):
                if "inputs" in entry:
                    self.problem((*where, "inputs"), "must list the unit of each input", 'write inputs = ["m"]')
                self.unsure.add(name)
                inputs = []
            for unit in (*inputs, entry.get("output")):
                if self.unit(where, unit) != 1.0:
                    self.problem(where, f"a network in {unit}: networks take and give SI values", f"declare {units.si(unit)}, and scale in the network")
            yield name, m.NetworkPort(name, tuple(inputs), entry.get("output", _UNKNOWN), entry.get("description", ""))

    def entries(self, section: str) -> dict[str, Any]:
        """What stands in a section whose entries have no common form."""
        found = self.data.get(section, {})
        if isinstance(found, dict):
            return found
        self.problem((section,), "is not a table", f"write [{section}]")
        return {}

    def elements(
        self, parameters: dict[str, m.Parameter], inputs: tuple[m.Input, ...], bodies: tuple[m.Body, ...], networks: dict[str, m.NetworkPort]
    ) -> Iterable[m.Element]:
        ends_known = [b.name for b in bodies] + [i.name for i in inputs] + [m.GROUND]
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
            ends = self.ends((*where, "between"), entry["between"], ends_known, inputs) if "between" in entry else (m.GROUND, m.GROUND)
            if law == "network":
                yield self.network_element(name, ends, entry, networks)
            elif law == "expression":
                yield m.Element(name, ends, law, expression=entry.get("force", "0"))
            else:
                arguments = {
                    key: self.argument(where, key, entry[key], unit, f"{name}_{key}", parameters)
                    for key, unit in LAWS[law].arguments.items()
                    if key in entry
                }
                yield m.Element(name, ends, law, arguments)

    def ends(self, where: tuple[str, ...], ends: list[Any], known: list[str], inputs: tuple[m.Input, ...]) -> tuple[str, str]:
        """The two ends of an element."""
        if len(ends) != 2 or not all(isinstance(e, str) for e in ends) or ends[0] == ends[1]:
            self.problem(where, f"{_show(ends)} does not name two different ends", 'write between = ["body", "wheel"]')
            return m.GROUND, m.GROUND
        for end in ends:
            if end not in known:
                near = difflib.get_close_matches(end, known, 1)
                self.problem(where, f"end {_show(end)} is no body, input or ground", f"did you mean '{near[0]}'?" if near else f"known are {', '.join(known)}")
        for i in inputs:
            if i.name in ends and not _same(i.unit, "m"):
                self.problem(where, f"input '{i.name}' is in {i.unit}, an end needs a position", "use an input in m")
        return ends[0], ends[1]

    def network_element(self, name: str, ends: tuple[str, str], entry: dict[str, Any], networks: dict[str, m.NetworkPort]) -> m.Element:
        where = ("elements", name)
        network = entry.get("network", "")
        if network not in networks:
            if "network" in entry:
                near = difflib.get_close_matches(network, networks, 1)
                self.problem((*where, "network"), f"network {_show(network)} is not declared", f"did you mean '{near[0]}'?" if near else "add it to [networks]")
            return m.Element(name, ends, "network")
        port = networks[network]
        kinds = {"deflection": "m", "rate": "m/s"}
        takes = () if network in self.unsure else port.input_units
        inputs = entry.get("inputs")
        if inputs is None:  # the units say which is meant
            inputs = [next((k for k, u in kinds.items() if _same(u, unit)), "") for unit in takes]
            for unit in (unit for unit, kind in zip(takes, inputs) if not kind):
                self.problem(where, f"network '{network}' takes {unit}, an element has a deflection in m and a rate in m/s", "mend the unit in [networks]")
        else:
            for kind, unit in zip(inputs, takes):
                if kind not in list(kinds):
                    self.problem((*where, "inputs"), f"{_show(kind)} is neither deflection nor rate", 'write inputs = ["deflection"]')
                elif not _same(kinds[kind], unit):
                    self.problem((*where, "inputs"), f"the network takes {unit}, but {kind} is in {kinds[kind]}", "mend the unit in [networks]")
            if takes and len(inputs) != len(takes):
                self.problem((*where, "inputs"), f"{len(inputs)} inputs for a network of {len(takes)}", "give one for each")
        if not _same(port.output_unit, "N"):
            self.problem(where, f"network '{network}' gives {port.output_unit}, an element needs a force", "declare its output in N")
        return m.Element(name, ends, "network", network=network, network_inputs=tuple(inputs))

    def equations(self) -> Iterable[m.Equation]:
        for name, text in self.entries("equations").items():
            self.label(("equations", name), name)
            if not isinstance(text, str) or len(ex.sides(text)) != 2:
                self.problem(("equations", name), "is not one equation", "write it as \"der(T) = (T0 - T)/tau\"")
                continue
            yield m.Equation(name, text)

    def signals(self, section: str) -> Iterable[m.Signal]:
        for name, entry in self.section(section).items():
            scale = self.unit((section, name), entry.get("unit"))
            noise = self.noise((section, name), entry, scale)
            yield m.Signal(name, entry.get("value", ""), entry.get("unit", _UNKNOWN), noise, entry.get("description", ""))

    def folds(self, head: dict[str, Any], sets: dict[str, m.ParameterSet]) -> None:
        """Check that there is something to fold, and room for it."""
        where, given = ("model", "pieces"), room(min(head["pieces"], ROOM))
        if given == 0 or not sets:
            return
        if head["outside"] == "fade":
            self.problem(where, "a network that fades is not made of straight pieces", "choose outside = 'extrapolate' or 'clamp', or leave pieces out")
        elif not any(foldable(net) for net in sets["default"].networks.values()) and len(sets["default"].networks) == len(self.data.get("networks", {})):
            self.problem(where, "no network has one input and only ReLU activations", "leave pieces out")
        elif head["more_pieces"] == "refuse":
            for chosen in sets.values():
                for name, net in chosen.networks.items():
                    need = pieces(net, head["outside"] == "clamp") if foldable(net) else 0
                    if need > given:
                        remedy = f"give room for {need} or more, or choose more_pieces = 'layers'"
                        self.problem(where, f"{name} of set '{chosen.name}' has {need} straight pieces", remedy)

    def sets(self, parameters: dict[str, m.Parameter], networks: dict[str, m.NetworkPort], masses: set[str]) -> dict[str, m.ParameterSet]:
        tunable = {p.name: p for p in parameters.values() if p.tunable}
        entries = self.entries("sets")
        required = networks if "default" in entries else ()
        if networks and "default" not in entries and isinstance(self.data.get("sets", {}), dict):
            self.problem(("sets",), "there is no set 'default'", "add [sets.default] with a file for each network")
        allowed = {n: (str, dict) for n in networks} | dict.fromkeys(tunable, str)
        sets: dict[str, m.ParameterSet] = {}
        files: dict[str, Network | None] = dict.fromkeys(networks)  # of the set 'default', which the others build on
        values = {p.name: p.value for p in tunable.values()}
        upper: dict[str, str] = {}
        for number, (name, entry) in enumerate(({"default": {}} | entries).items(), 1):
            where = ("sets", name)
            self.label(where, name)
            if upper.setdefault(name.upper(), name) != name:
                self.problem(where, f"differs from the set '{upper[name.upper()]}' by case only", "rename one")
            own = self.table(where, allowed, entry, required if name == "default" else ())
            own_files = {n: self.network(where, n, own[n], networks[n]) for n in networks if n in own}
            own_values = {n: self.quantity((*where, n), own[n], p.unit) for n, p in tunable.items() if n in own}
            for n in masses & set(own_values):
                if own_values[n] <= 0.0:
                    self.problem((*where, n), f"mass {_show(own[n])} is not above zero", "give a positive mass")
            if name == "default":
                files, values = files | own_files, values | own_values
            sets[name] = m.ParameterSet(name, number, {n: net for n, net in (files | own_files).items() if net is not None}, values | own_values)
            for n, net in own_files.items():
                first = files[n]
                if net is not None and first is not None and net.architecture != first.architecture:
                    self.problem((*where, n), "has another architecture than in the set 'default'", "train the same layers: sets share one code")
        return sets

    def network(self, where: tuple[str, ...], name: str, entry: str | dict[str, Any], port: m.NetworkPort) -> Network | None:
        """The network file of one port, with its trust envelope; None after reporting a problem."""
        where = (*where, name)
        if isinstance(entry, str):
            entry = {"file": entry}
        entry = self.table(where, {"file": str, "min": list, "max": list}, entry, ("file",))
        if "file" not in entry:
            return None
        path = self.place(where)[0].parent / entry["file"]
        if path not in self.files:
            try:
                self.files[path] = read_network(path)
                self.digest.update(path.read_bytes())
            except NetworkError as error:
                self.problem(where, str(error), "see [sets]")
                self.files[path] = None
            except (OSError, ValueError) as error:
                self.problem(where, f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})", "mend the path")
                self.files[path] = None
            for layer in self.files[path].layers if self.files[path] else ():  # weights may lie in files of their own
                for numbers in (v for v in vars(layer).values() if isinstance(v, np.ndarray)):
                    self.digest.update(numbers.tobytes())
        network = self.files[path]
        if network is None or port.name in self.unsure:
            return None
        if network.n_inputs != len(port.input_units) or network.n_outputs != 1:
            self.problem(where, f"{path.name} has {network.n_inputs} input(s) and {network.n_outputs} output(s), declared are {len(port.input_units)} and 1", "mend [networks] or the file")
            return None
        remedy = "give min and max, one number for each input, or write them into the file"
        for key in ("min", "max"):
            if not all(isinstance(v, (int, float)) and not isinstance(v, bool) and ex.in_range(v) for v in entry.get(key, [])):
                self.problem((*where, key), "is not a list of numbers that a float can hold", remedy)
                return None
        try:
            network = replace(network, input_min=entry.get("min", network.input_min), input_max=entry.get("max", network.input_max))
        except NetworkError as error:
            self.problem(where, str(error), remedy)
            return None
        with np.errstate(over="ignore"):
            envelope, *layers = [p.values.astype(np.float32) for p in network_pieces(network)]
        if not all(np.isfinite(values).all() for values in (envelope, *layers)):
            self.problem(where, f"{path.name} has a number that a float cannot hold", "train or export the network again")
            return None
        if not (envelope[: network.n_inputs] < envelope[network.n_inputs :]).all():
            self.problem(where, "the trained range is narrower than a float can tell", remedy)
            return None
        return network

    def unique(self, parameters, inputs, bodies, elements, states, variables, networks) -> None:
        """No name may mean two things."""
        named = [("parameter", n, self.made.get(n, ("parameters", n))) for n in parameters]
        named += [("input", i.name, ("inputs", i.name)) for i in inputs]
        for key in ("position", "velocity"):
            named += [(key, getattr(b, key), ("bodies", b.name, key)) for b in bodies]
        of_laws = {s.name: ("elements", e.name) for e in elements for s in _law_states([e])}
        named += [("state", s.name, of_laws.get(s.name, ("states", s.name))) for s in states] + [("variable", v.name, ("variables", v.name)) for v in variables]
        named += [("network", n, ("networks", n)) for n in networks]
        for e in elements:
            where = ("elements", e.name)
            named += [("deflection", f"s_{e.name}", where), ("rate", f"v_{e.name}", where), ("force", f"F_{e.name}", where)]
        seen: dict[str, str] = {"": ""}  # a missing name has been reported
        for kind, name, where in named:
            if seen.get(name):
                self.problem(where, f"'{name}' is taken by the {seen[name]} of that name", "rename one")
            seen.setdefault(name, kind)
        for i in inputs:
            if i.name in {b.name for b in bodies}:
                self.problem(("inputs", i.name), f"'{i.name}' is taken by the body of that name", "rename one: an element could mean either")

    def shown(self, signals: tuple[m.Signal, ...], inputs: set[str], states: set[str], n_outputs: int) -> None:
        """In tables of results, a name stands for one quantity; that of a state also for what measures it, however well."""
        first: dict[str, str] = {name: name for name in inputs}
        for n, s in enumerate(signals):
            other = s.name in states and not re.search(rf"\b{s.name}\b", s.expression)
            if s.expression and (other or first.setdefault(s.name, s.expression.strip()) != s.expression.strip()):
                self.problem(("outputs" if n < n_outputs else "sensors", s.name), f"'{s.name}' is already the name of another quantity", "rename one")

    def expressions(self, elements, equations, signals, networks: dict[str, m.NetworkPort], n_outputs: int) -> None:
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
                self.problem(where, str(error), "mend the expression")

    def macros(self, parameters: dict[str, m.Parameter], networks: dict[str, m.NetworkPort], model: str) -> None:
        """Constants of the generated C are in capitals: names that differ in case only would meet."""
        seen = {n: "" for n in _MACROS}
        for n in (*parameters, *networks):
            changes = n in networks or parameters[n].tunable
            for name in (f"AT_{n}",) if changes else (n, f"{n}_INVERSE"):
                if seen.setdefault(name.upper(), n) != n:
                    where = self.made.get(n, ("parameters" if n in parameters else "networks", n))
                    self.problem(where, f"its C constant {model.upper()}_{name.upper()} is already taken", "rename it")
                    break


def _law_states(elements: Iterable[m.Element]) -> Iterable[m.State]:
    """The states that the laws of elements bring along."""
    for e in elements:
        for name, state in LAWS[e.law].states.items() if e.law in LAWS else ():
            yield m.State(e.state(name), state.unit, description=f"{name} of {e.name}")


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
    try:
        problems = check(model)
    except RecursionError as error:
        raise m.ModelError([_line(f"{path}: has equations that depend on each other in too long a chain; write a smaller model")]) from error
    for where, what, remedy in problems:
        reader.problem(where, what, remedy)
    if reader.problems:
        raise m.ModelError(reader.problems)
    return model
