# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Names of columns by the user: texts of --channel like `x=pos_mm`, `x=Weg 1 [mm]`, `a=a_body@10ms`, `z=z#2`, `time=@1ms`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from ..errors import RecordingError, WrongUse, hint

PAIR = re.compile(r"^\s*(\w+)\s*=\s*(.*\S)\s*$", re.DOTALL)
UNIT = re.compile(r"^(.*?)\s*\[([^\[\]]*)\]$", re.DOTALL)
RASTER = re.compile(r"^(.*?)\s*@\s*(\d+(?:\.\d+)?)\s*(s|ms|us)$", re.DOTALL)
COUNT = re.compile(r"^(.*)#(\d+)$", re.DOTALL)
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
Units = Mapping[str, str | None]
Texts = Mapping[str, tuple[str, str]]


class Columned(Protocol):
    """A table by what its header says of its columns."""

    @property
    def units(self) -> Units: ...

    @property
    def texts(self) -> Texts: ...


@dataclass(frozen=True)
class Called:
    """A column as a user names it, with what he adds to it."""

    name: str
    unit: str | None = None
    raster: float | None = None  # [s] between rows
    count: int | None = None  # which of several of this name


def aliases(texts: Iterable[str], known: Iterable[str]) -> dict[str, str]:
    """Texts of --channel: for the model's names, which must be known (or time), what the file calls them."""
    pairs: dict[str, str] = {}
    known = list(known)
    for text in texts:
        match = PAIR.match(text)
        if match is None:
            raise WrongUse(f"channel \"{text}\" is not understood; write the model's name = the file's name [unit]")
        if match[1] not in (*known, "time"):
            what = f'channel {match[1]}: the model has no input or sensor "{match[1]}"'
            raise WrongUse(f"{what}; {hint(match[1], known)}")
        pairs[match[1]] = match[2]
    return pairs


def option(name: str, called: str) -> str:
    """The option to paste into a shell."""
    text = f"{name}={called}"
    return f'--channel "{text}"' if not re.search(r'["$`\\!]', text) else "--channel '" + text.replace("'", "'\\''") + "'"


def readings(text: str) -> list[Called]:
    """What an alias may mean, the most literal first: a name may have brackets, @ or # itself."""
    found = [Called(text)]
    for one in list(found):
        if match := UNIT.match(one.name):
            found.append(Called(match[1], match[2]))
    for one in list(found):
        if match := RASTER.match(one.name):
            found.append(Called(match[1], one.unit, float(match[2]) * SECONDS[match[3]]))
        if match := COUNT.match(one.name):
            found.append(Called(match[1], one.unit, None, int(match[2])))
    for one in list(found):  # a=a_body [m/s^2]@10ms
        if (match := UNIT.match(one.name)) and one.unit is None and (one.raster or one.count):
            found.append(Called(match[1], match[2], one.raster, one.count))
    return found


def meant(text: str, units: Units, texts: Texts) -> tuple[Called, list[str]]:
    """The reading of an alias that a table has columns for, and these; the plainest one and none if it has none."""
    every = readings(text)
    for one in every:
        found = [key for key in units if one.name == key]
        found = found or [key for key in units if one.name in texts.get(key, ())]
        if found:
            return one, found
    return every[1] if len(every) > 1 else every[0], []


def columns(text: str, units: Units, texts: Texts) -> list[str]:
    """The columns of a table that an alias names."""
    return meant(text, units, texts)[1]


def unit(text: str, units: Units, texts: Texts) -> str | None:
    """The unit that an alias gives; None if it leaves that to the file."""
    return meant(text, units, texts)[0].unit


def unit_of(key: str, aliases: Mapping[str, str], units: Units, texts: Texts) -> str | None:
    """The unit that any alias gives a column; None if none does."""
    given = [meant(text, units, texts) for text in aliases.values()]
    return next((one.unit for one, found in given if key in found and one.unit is not None), None)


def with_unit(text: str, given: str, units: Units, texts: Texts) -> str:
    """An alias with this unit in place of the one that it has."""
    one, _ = meant(text, units, texts)
    name = f"{one.name}#{one.count}" if one.count else one.name
    raster = f"@{one.raster * 1e3:g}ms" if one.raster else ""
    return f"{name}{raster} [{given or '1'}]"


def plain(name: str) -> str:
    """A name as it is compared where nothing fits exactly: lower case, underscores for blanks and dots, without a device `\\XCP:1`."""
    return re.sub(r"[\s_.]+|(?<=\w)-(?=\w)", "_", name.partition("\\")[0].strip().casefold())


def clock(text: str) -> float | None:
    """The time [s] between rows that `time=@1ms` gives, None if it names a column."""
    match = RASTER.match(text)
    return float(match[2]) * SECONDS[match[3]] if match and not match[1] else None


def check(pairs: Mapping[str, str], tables: Sequence[Columned], path: Path, names: Iterable[str] | None, known: Iterable[str]) -> None:
    """UserError if the file has no column that an alias names; `known` are the file's columns."""
    every = list(known)
    problems = []
    for name, text in pairs.items():
        if (names is None or name in names) and not any(columns(text, t.units, t.texts) for t in tables):
            wanted = next((one.name for one in readings(text)[1:2]), text)
            problems.append(f'{path}: there is no column "{wanted}" for {option(name, text)}; {hint(wanted, every)}')
    if problems:
        raise RecordingError(*problems)
