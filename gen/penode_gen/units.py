"""Units: everything that enters becomes SI, and expressions are checked for dimensions that do not fit."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from pickle import PickleError
from typing import Any

import pint
import sympy as sp

from .algebra import expressions as ex, functions


def _known() -> pint.UnitRegistry[Any]:
    """All units, as pint keeps them beside its own bytecode (the user's cache would name the files of one installation for all); read
    anew where it cannot, or another process is about to write there."""
    try:
        return pint.UnitRegistry(autoconvert_offset_to_baseunit=False, cache_folder=Path(pint.__file__).with_name("__pycache__"))
    except (OSError, EOFError, PickleError):
        return pint.UnitRegistry(autoconvert_offset_to_baseunit=False)


_registry = _known()
Dimension = pint.util.UnitsContainer
NONE: Dimension = _registry.dimensionless.dimensionality

# names with powers, joined by * and /, in parentheses where need be; nothing that a unit registry would have to compute
_POWER = r"(?:\s*(?:\^|\*\*)\s*-?\d(?:\.\d{1,2})?|[\u00b2\u00b3])?"
_NAMED = rf"(?:[^\W\d][^\W\d]*|[%°]){_POWER}"
_GROUP = rf"(?:{_NAMED}|\(\s*{_NAMED}(?:\s*[*/·]\s*{_NAMED})*\s*\){_POWER})"
_UNIT = re.compile(rf"\s*(?:1|1\s*/\s*{_GROUP}|{_GROUP})?(?:(?:\s*[*/·]\s*|\s+){_GROUP})*\s*")
_WORD = re.compile(r"°?[^\W\d]+")
# names in common use that are no units here; pint takes Nm for a measure of yarn
_OTHERWISE = {"Nm": "N*m", "kNm": "kN*m", "rev": "turn", "khz": "kHz", **dict.fromkeys(("°C", "°F", "Celsius", "Fahrenheit"), "K")}
_LONGEST = 60
_QUANTITY = re.compile(r"^\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*$")


class UnitError(ValueError):
    """A unit that is unknown or does not fit; the message says which and what would, or `instead` does."""

    def __init__(self, message: str, unknown: str = "") -> None:
        super().__init__(message)
        self.unknown = unknown

    @property
    def instead(self) -> str:
        """Asks for an unknown unit as it has to be written: Ohm as ohm, Nm as N*m; empty if that makes no unit either."""
        return _instead(self.unknown) if len(self.unknown) <= _LONGEST else ""


@cache
def _unit(text: str) -> pint.Unit:
    try:
        unit = _parsed(text)
    except Exception as error:  # pint raises a dozen kinds
        raise UnitError(f"unknown unit '{text}'", text) from error
    if not _registry.Quantity(1, unit)._is_multiplicative:
        raise UnitError(f"unit '{text}' has an offset; use kelvin or another unit that starts at zero")
    return unit


def _parsed(text: str) -> pint.Unit:
    """The unit as pint reads it, which raises a dozen kinds of error."""
    plain = text.replace("·", "*").replace("²", "^2").replace("³", "^3").strip() or "dimensionless"
    if len(text) > _LONGEST or not _UNIT.fullmatch(text) or any(word in _OTHERWISE for word in _WORD.findall(text)):
        raise UnitError(f"unknown unit '{text}'")
    return _registry.parse_units(re.sub(r"^1", "dimensionless", plain))


def _instead(text: str) -> str:
    """See UnitError."""

    def known(word: str) -> bool:
        with suppress(Exception):
            return _parsed(word) is not None
        return False

    def other(found: re.Match[str]) -> str:
        word = found[0]
        name = _OTHERWISE.get(word) or next((w for w in (word, word.lower(), word.capitalize()) if known(w)), word)
        return f"({name})" if "*" in name and (found.string[: found.start()].rstrip().endswith("/") or "^" in found.string) else name

    written = _WORD.sub(other, text)
    return f"write '{written}'" if written != text and known(written) else ""


def factor(text: str) -> float:
    """How many SI units one `text` is."""
    return float(_registry.Quantity(1.0, _unit(text)).to_base_units().magnitude)


def si(text: str) -> str:
    """The SI unit for the quantity of `text`: `text` itself if it is one, 'm' for 'mm'."""
    return text.strip() or "1" if factor(text) == 1.0 else describe(dimension(text)).replace("no unit", "1")


def dimension(text: str) -> Dimension:
    """The physical dimension of a unit."""
    return _unit(text).dimensionality


def same_dimension(a: str, b: str) -> bool:
    """Do two units measure the same kind of thing?"""
    return dimension(a) == dimension(b)


def is_angle(text: str) -> bool:
    """Is it a radian, a degree, a turn or a multiple of these?"""
    return dict(_registry.Quantity(1.0, _unit(text)).to_base_units().unit_items()) == {"radian": 1}


def quantity(text: str) -> tuple[float, str]:
    """'10 kN/m' -> (10000.0, 'kN/m'): the value in SI and the unit as written."""
    match = _QUANTITY.match(text)
    if not match:
        raise UnitError(f"'{text}' is not a number with a unit, such as '10 kN/m'")
    return float(match[1]) * factor(match[2]), match[2] or "1"


def exponents(dim: Dimension) -> dict[str, float]:
    """Base dimension, such as "[length]" -> its power, without those of power 0."""
    return {k: float(v) for k, v in dim.items() if v and not isinstance(v, complex)}  # which none is, but by pint's type


def describe(dim: Dimension) -> str:
    """A dimension in base units, for messages."""
    if not dim:
        return "no unit"
    names = {"[mass]": "kg", "[length]": "m", "[time]": "s", "[temperature]": "K", "[current]": "A", "[substance]": "mol"}
    names |= {"[luminosity]": "cd"}
    parts = [names.get(k, k) + ("" if v == 1 else f"^{v:g}") for k, v in sorted(dim.items()) if v]
    return "*".join(parts)


def dimension_of(expr: sp.Expr, of: Callable[[sp.Basic], Dimension]) -> Dimension | None:
    """
    Dimension of an expression; `of` gives that of its symbols and network calls.

    None stands for a bare zero, which fits anything. Raises UnitError where terms do not fit.
    """
    if expr.is_Symbol or isinstance(expr, sp.core.function.AppliedUndef):
        return of(expr)
    if expr.is_number:
        return None if expr == 0 else NONE
    if isinstance(expr, sp.Piecewise):
        for _, condition in expr.args:
            if isinstance(condition, sp.core.relational.Relational):
                _equal(condition, [dimension_of(a, of) for a in condition.args])
        return _equal(expr, [dimension_of(value, of) for value, _ in expr.args])
    parts = [dimension_of(a, of) for a in expr.args]
    if expr.is_Add or isinstance(expr, (sp.Max, sp.Min)):
        return _equal(expr, parts)
    if expr.is_Mul:
        total = NONE
        for part in parts:
            total = total * (part if part is not None else NONE)
        return total
    if expr.is_Pow:
        _base, exponent = expr.args
        if not exponent.is_number:
            if parts[0] or parts[1]:
                raise UnitError(f"'{expr}': a power with a variable exponent needs numbers without unit")
            return NONE
        power: Dimension = (parts[0] or NONE) ** float(exponent)
        return power
    if isinstance(expr, ex.Absolute):
        return parts[0]
    if isinstance(expr, functions.Root):
        root: Dimension = (parts[0] or NONE) ** 0.5
        return root
    if isinstance(expr, ex.Sign):
        return NONE
    for part in parts:  # exp, tanh, ...
        if part:
            raise UnitError(f"'{expr}': the argument has the unit {describe(part)}; divide it by a parameter of that unit")
    return NONE


def _equal(expr: sp.Basic, parts: list[Dimension | None]) -> Dimension | None:
    known = [p for p in parts if p is not None]
    for part in known[1:]:
        if part != known[0]:
            raise UnitError(f"'{expr}' combines {describe(known[0])} with {describe(part)}")
    return known[0] if known else None
