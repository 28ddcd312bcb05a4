# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""How a table writes its numbers: what parts fractions, and what parts thousands.

1.001 is a thousand and one, or a little more than one. All cells of a file tell: 0.5, 12.34 and 1234.5 have a decimal point, 1.234.567 and
1.176,03 have points between thousands. Where there are whole numbers below 1000 beside many like 1.001, and none like 1.5, points part
thousands too: a fraction of three digits ends in 0 once in ten times, and is then written so everywhere, or nowhere.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from ..quality import CHANCE

OTHER = {".": ",", ",": "."}
# [1] what parts thousands, in which of several groups, [2] the sign of a fraction
GROUPED = re.compile(r"[-+\u2212]?(?!0)\d{1,3}([.,])\d{3}(\1\d{3})*(?:(?!\1)([.,])\d*)?")
FRACTION = re.compile(r"[-+\u2212]?\d*([.,])\d*(?:[eEdD][-+]?\d+)?")
WHOLE = re.compile(r"[-+\u2212]?(?:(\d{1,3})|\d+)")  # [1] if it is short enough to need no sign


class Doubt(ValueError):
    """(index, text): a number that may be two."""


@dataclass(frozen=True)
class Signs:
    """What parts fractions, and what parts thousands: "." or ",", or "" for nothing."""

    decimal: str
    thousands: str = ""

    def plain(self, text: str) -> str:
        """A number as Python reads it; ValueError if it has a sign where this notation has none."""
        if self.thousands and self.thousands in text:
            match = GROUPED.fullmatch(text)
            if match is None or match[1] != self.thousands:
                raise ValueError(text)
            text = text.replace(self.thousands, "")
        if self.decimal == "," and "," in text:
            if "." in text:
                raise ValueError(text)
            text = text.replace(",", ".")
        return text


@dataclass(frozen=True)
class Seen:
    """What the different cells of a column show: signs that part fractions, and thousands, beyond doubt; how many are like 1.001 by
    their sign; are there whole numbers without a separator, of up to three digits, and longer ones?"""

    fractions: frozenset[str]
    thousands: frozenset[str]
    unclear: Mapping[str, int]
    short: bool
    long: bool

    def mixed(self, sign: str) -> bool:
        """Are there cells like 1.001 beside whole numbers below 1000, but none that a sign parts elsewhere?"""
        return self.unclear.get(sign, 0) > 0 and self.short and not self.long and sign not in self.fractions

    def surely(self, sign: str) -> bool:
        """Does a sign part thousands here, whatever other columns show?"""
        luck = 0.9 ** self.unclear.get(sign, 0)  # that none ends in 0
        return sign in self.thousands or (self.mixed(sign) and (luck < CHANCE or OTHER[sign] in self.fractions))


def seen(texts: Iterable[str | None]) -> Seen:
    """What the cells of a column show."""
    fractions, thousands, unclear = set(), set(), {".": 0, ",": 0}
    short = long = False
    for text in {text.strip() for text in texts if text}:
        if whole := WHOLE.fullmatch(text):
            short, long = short or bool(whole[1]), long or not whole[1]
        elif match := GROUPED.fullmatch(text):
            if match[2] or match[3]:
                thousands.add(match[1])
                fractions |= {match[3]} if match[3] else set()
            else:
                unclear[match[1]] += 1
        elif match := FRACTION.fullmatch(text):
            fractions.add(match[1])
    return Seen(frozenset(fractions), frozenset(thousands), unclear, short, long)


class File:
    """The columns of a file, of which all say how one is written."""

    def __init__(self, texts: Mapping[str, Sequence[str | None]], decimal: str):
        self._texts, self._decimal = texts, decimal
        self._seen: dict[str, Seen] = {}

    def _of(self, key: str) -> Seen:
        if key not in self._seen:
            self._seen[key] = seen(self._texts[key])
        return self._seen[key]

    @cached_property
    def _fractions(self) -> frozenset[str]:
        """Signs that part fractions somewhere."""
        return frozenset[str]().union(*(self._of(key).fractions for key in self._texts))

    def signs(self, key: str) -> Signs:
        """How a column is written; Doubt if nothing tells."""
        own = self._of(key)
        for sign in OTHER:
            if not own.unclear[sign] and sign not in own.thousands:
                continue
            if sign in own.fractions:
                if sign in own.thousands:
                    self._doubt(key, sign)
                continue
            if self._parts_thousands(key, own, sign):
                return Signs(OTHER[sign], sign)
        return Signs(self._decimal)

    def _parts_thousands(self, key: str, own: Seen, sign: str) -> bool:
        """Does a sign with three digits behind it part thousands in a column? Doubt if nothing tells."""
        elsewhere = sign in self._fractions
        if own.surely(sign):
            if elsewhere and sign not in own.thousands:
                self._doubt(key, sign)
            return True
        if elsewhere:
            return False
        if any(self._of(other).surely(sign) for other in self._texts):
            return True
        if own.mixed(sign) and OTHER[sign] not in self._fractions:
            self._doubt(key, sign)
        return own.mixed(sign)

    def _doubt(self, key: str, sign: str) -> None:
        for row, text in enumerate(self._texts[key]):
            if text and sign in text and GROUPED.fullmatch(text.strip()):
                raise Doubt(row, text)
        raise AssertionError("a column in doubt has such a cell")
