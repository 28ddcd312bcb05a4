# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Tables of a model file, checked key by key: names, units, numbers. Problems are collected, each with its place and a remedy."""

from __future__ import annotations

import difflib
import hashlib
import math
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from .. import model as m, units
from ..algebra import expressions as ex
from ..errors import Problem
from ..sets import promises
from .places import Lines, merge, one_line, parse, show

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}")
C_WORDS = set(
    "auto break case char const continue default do double else enum extern float for goto if inline int long register "
    "restrict return short signed sizeof static struct switch typedef union unsigned void volatile while bool true false "
    "self NULL linux unix size_t ptrdiff_t wchar_t "
    "H GH SUBSTEPS N_X N_U N_Y N_Q N_W N_DRIVE N_KEPT N_COLUMNS AT_CHANGE AT_BEND AT_TWIST N_SENSORS".split()
)
CPP_WORDS = set(  # of C++20: headers name states and signals, and C++ programs include them
    "alignas alignof and and_eq asm bitand bitor catch char8_t char16_t char32_t class co_await co_return co_yield compl concept "
    "consteval constexpr constinit const_cast decltype delete dynamic_cast explicit export friend mutable namespace new noexcept not "
    "not_eq nullptr operator or or_eq private protected public reinterpret_cast requires static_assert static_cast template this "
    "thread_local throw try typeid typename using virtual xor xor_eq".split()
)
C_PATTERN = re.compile(r"u?int\w*_t|U?INT\w*_(MAX|MIN|C)|(SIZE|PTRDIFF|WCHAR|SIG_ATOMIC|WINT)_(MAX|MIN)")
RESERVED = {*ex.FUNCTIONS, "der", "where", m.GROUND}
PREFIXES = (
    "pen_",
    "PEN_",
    "slope_",
    "second_",
    "inputs_of_",
    "slopes_of_",
    "seconds_of_",
    "piece_of_",
    "der_",
    "network_",
)  # of names that the generated code makes
MACROS = (  # that each generated model defines, behind its name
    "N_X N_U N_IN N_Y N_SENSORS N_LAST N_DRIVE N_COLUMNS N_KEPT N_Q N_W SAMPLE_TIME SUBSTEPS STEP IMPLICIT_STEP AT_FIRST AT_SECOND "
    "AT_THIRD LAYOUT SET_LENGTH SCRUB VERIFY SAVED SAVED_MAIN PIECES TRIAL TRIAL_ROOM H SETS_H".split()
)
_COMMENT = re.compile(r"(?:(?!\*/|/\*)[^\x00-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff\\]){0,200}")

SECTIONS: dict[str, dict[str, type | tuple[type, ...]]] = {
    "parameters": {"value": (int, float), "unit": str, "tolerance": (int, float, str), "exact": bool, "tunable": bool, "description": str},
    "inputs": {"unit": str, "min": (int, float), "max": (int, float), "noise": (int, float), "description": str},
    "bodies": {"mass": str, "inertia": str, "position": str, "velocity": str, "start_position": str, "start_velocity": str},
    "actuators": {**dict.fromkeys(("input", "law", "gain", "time", "width", "limit", "rate", "start", "description"), str), "samples": int},
    "states": {"unit": str, "start": (int, float), "description": str},
    "variables": {"unit": str},
    "networks": {"inputs": list, "output": str, "description": str} | promises.KEYS,
    "outputs": {"value": str, "unit": str, "trial_bound": (int, float), "description": str},
    "sensors": {"value": str, "unit": str, "noise": (int, float), "description": str},
}
REQUIRED = {
    "parameters": ("value", "unit"),
    "inputs": ("unit",),
    "bodies": (),
    "actuators": ("input", "law"),
    "states": ("unit",),
    "variables": ("unit",),
    "networks": ("inputs", "output"),
    "outputs": ("value", "unit"),
    "sensors": ("value", "unit"),
}


def _base(tables: dict[str, Any]) -> str:
    """The file that a file extends; empty if none."""
    head = tables.get("model")
    found = head.get("extends") if isinstance(head, dict) else None
    return found if isinstance(found, str) else ""


class Tables:
    """A model file, with the one that it extends, and what is wrong with them."""

    def __init__(self, path: Path):
        self.path = path
        self.problems: list[str] = []
        self.data, raw, lines = parse(path)
        self.digest = hashlib.sha256(raw)
        self.places = [(path, lines)]
        self.set_owner = ""  # the model that this one shares its sets with
        own, shares = self.data, True
        while base := _base(own):
            before = self.places[-1][0]
            place = f"{before}:{lines.of(('model', 'extends'))}: model.extends"
            if len(self.places) > 3:
                raise m.ModelError(
                    [one_line(f"{place}: this would be the fourth file that extends another; extend {base} by at most three in a row")]
                )
            base_path = before.parent / base
            shares = shares and not {"parameters", "networks", "sets"} & set(own)
            own, raw, lines = parse(base_path, place)
            if shares and isinstance(own.get("model"), dict):
                self.set_owner = str(own["model"].get("name", self.set_owner))
            self.data = merge(own, self.data)
            self.digest.update(raw)
            self.places.append((base_path, lines))

    def place(self, where: tuple[str, ...]) -> tuple[Path, Lines]:
        """The file that has this key."""
        return next(((p, la) for p, la in self.places if la.knows(where)), self.places[0])

    def extended(self, where: tuple[str, ...], base: tuple[str, ...]) -> bool:
        """Is a key in a file that extends the one with the key `base`?"""
        files = [path for path, _ in self.places]
        return files.index(self.place(where)[0]) < files.index(self.place(base)[0])

    def problem(self, where: Iterable[str], what: str, remedy: str) -> None:
        where = tuple(where)
        path, lines = self.place(where)
        self.problems.append(Problem(one_line(what), one_line(str(path)), lines.of(where), one_line(".".join(where)), one_line(remedy)))

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
            elif not isinstance(value, allowed[key]) or (isinstance(value, bool) and allowed[key] not in (bool, (bool, str))):
                self.problem((*where, key), f"{show(value)} has the wrong type", f"give {_type_name(allowed[key])}")
            else:
                good[key] = value
                if key == "description" and not _COMMENT.fullmatch(value):
                    self.problem(
                        (*where, key), "cannot be a comment in C", "use one line of up to 200 characters, without backslash, /* and */"
                    )
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
            self.name((name, key), key, PREFIXES[:-1] if name == "networks" else PREFIXES)
            found[key] = self.table((name, key), SECTIONS[name], value, REQUIRED[name])
        return found

    def name(self, where: tuple[str, ...], name: str, prefixes: tuple[str, ...] = PREFIXES) -> None:
        """Report what cannot stand for a value in the generated C."""
        if not NAME.fullmatch(name) or name.endswith("_"):
            self.problem(
                where, f"{show(name)} cannot be a name", "use up to 40 letters, digits and _, with a letter in front and no _ at the end"
            )
        elif name in C_WORDS or name in RESERVED or C_PATTERN.fullmatch(name) or name.startswith(prefixes) or self._is_macro(name):
            self.problem(where, f"'{name}' has a meaning of its own in C or in model files", "choose another name")
        elif name in CPP_WORDS:
            self.problem(where, f"'{name}' has a meaning of its own in C++, whose programs include the header", "choose another name")

    def _is_macro(self, name: str) -> bool:
        """
        Whether the generated C may define this name.

        Its macros are the model's name, or that of the owner of its sets, in capitals, then _ and capitals.
        """
        head = self.data.get("model")
        own = head.get("name") if isinstance(head, dict) else None
        return name.isupper() and any(isinstance(o, str) and o and name.startswith(f"{o.upper()}_") for o in (own, self.set_owner))

    def label(self, where: tuple[str, ...], name: str) -> None:
        """Report what cannot be a part of a name."""
        if not NAME.fullmatch(name):
            self.problem(where, f"{show(name)} cannot be a name", "use up to 40 letters, digits and _, with a letter in front")

    def unit(self, where: tuple[str, ...], text: Any) -> float:
        """Factor to SI; 1 after reporting a problem, or where a unit is missing."""
        if not isinstance(text, str):
            return 1.0
        try:
            return units.factor(text)
        except units.UnitError as error:
            self.problem(where, str(error), error.instead or "write it like 'N*s/m' or 'mm'")
            return 1.0

    def number(self, where: tuple[str, ...], value: int | float, scale: float = 1.0) -> float:
        """A number in SI that a float can hold; NaN after reporting a problem."""
        try:
            found = float(value) * scale
        except OverflowError:
            found = math.inf
        if not ex.in_range(found):
            self.problem(where, f"{show(value)} is not a number that a float can hold", "give 0, or a size from 1.2e-38 to 3.4e38 in SI")
            return math.nan
        return found

    def quantity(self, where: tuple[str, ...], text: str, unit: str) -> float:
        """A text such as '1 ms' in SI, checked against the dimension of `unit`; NaN after reporting a problem."""
        try:
            value, given = units.quantity(text)
        except units.UnitError as error:
            self.problem(where, str(error), error.instead or f"give a number with a unit, in {unit}")
            return math.nan
        if not same(given, unit):
            self.problem(where, f"{show(text)} is not measured in {unit}", f"give a quantity in {unit}")
        elif not ex.in_range(value):
            self.problem(where, f"{show(text)} is not a number that a float can hold", "give 0, or a size from 1.2e-38 to 3.4e38 in SI")
        else:
            return value
        return math.nan

    def stated(self, section: str, name: str) -> dict[str, Any]:
        """The entry as it stands in the file, known or not."""
        entry = self.data[section][name]
        return entry if isinstance(entry, dict) else {}

    def entries(self, section: str) -> dict[str, Any]:
        """What stands in a section whose entries have no common form."""
        found = self.data.get(section, {})
        if isinstance(found, dict):
            return found
        self.problem((section,), "is not a table", f"write [{section}]")
        return {}


def same(a: str, b: str) -> bool:
    """Do two units measure the same kind of thing? True if one of them is unknown."""
    try:
        return units.same_dimension(a, b)
    except units.UnitError:
        return True  # reported where it stands


def _type_name(kind: Any) -> str:
    names = {str: "a text", bool: "true or false", list: "a list", dict: "a table", int: "a whole number"}
    if kind in ((int, float), (bool, str)):
        return "a number" if kind == (int, float) else "true, false or a text"
    if kind == (int, float, str):
        return 'a number or "unknown"'
    return names.get(kind, "a text or a table")
