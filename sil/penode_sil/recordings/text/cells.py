# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Cells of a table as numbers: decimal points and commas, missing values."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ...errors import RecordingError
from .dates import DATE, STAMP, NoOffset, stamps
from .notation import GROUPED, OTHER, Doubt, File, Signs, seen

Array = NDArray[np.float64]
MISSING = frozenset(
    [
        "",
        "-",
        "--",
        "---",
        "?",
        "*",
        ".",
        "na",
        "n/a",
        "#n/a",
        "#na",
        "#nv",
        "nil",
        "null",
        "none",
        "nan",
        "<na>",
        "(null)",
        "-nan",
        "+nan",
        "1.#qnan",
        "-1.#ind",
        "1.#inf",
        "-1.#inf",
        "#div/0!",
        "#num!",
        "#value!",
        "nan(ind)",
        "-nan(ind)",
    ]
)
FORTRAN = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))[dD]([+-]?\d+)")
GROUPS = re.compile(r"[+-]?\d{1,3}(?:['\u2019\u00a0\u202f ]\d{3})+(?:[.,]\d+)?")
NUMBER = re.compile(r"\s*[+-]?(?:\d+([.,]?)\d*|([.,])\d+)(?:[eEdD][+-]?\d+)?\s*")


def number(text: str, signs: Signs) -> float:
    """One cell; NaN if it is empty or a sign for a missing value. ValueError if it is not a number in this notation."""
    if text.strip().casefold() in MISSING:
        return float("nan")
    text = signs.plain(text.strip())
    try:
        return float(text)
    except ValueError:
        pass
    text = text.replace("\u2212", "-")
    if GROUPS.fullmatch(text):
        text = re.sub(r"['\u2019\u00a0\u202f ]", "", text)
    return float(FORTRAN.sub(r"\1e\2", text))


def decimal_sign(some: Sequence[Sequence[str]]) -> str:
    """What parts whole numbers from fractions in rows of cells: a comma if there are some and no points, or points only where thousands are
    parted."""
    found = seen(cell for row in some for cell in row)
    signs = found.fractions or {OTHER[sign] for sign in found.thousands} or {sign for sign, count in found.unclear.items() if count}
    return "," if signs == {","} else "."


def is_number(text: str) -> bool:
    """May a cell be a value: a number, a stamp of time?"""
    return (
        any(kind.fullmatch(text) for kind in (NUMBER, STAMP, DATE, GROUPS))
        or bool(GROUPED.fullmatch(text.strip()))
        or text.strip().casefold() in ("nan", "inf", "-inf")
    )


def numbers(texts: Sequence[str | None], signs: Signs) -> Array:
    """A column; ValueError(index, text) at the first cell that is not a number, (index, None) where a row has no such cell."""
    some = [text for text in texts if text is not None]
    if signs == Signs(".") and len(some) == len(texts):
        try:
            return np.fromiter(map(float, some), np.float64, len(some))
        except ValueError:
            pass
    out = np.empty(len(texts))
    for k, text in enumerate(texts):
        if text is None:
            raise ValueError(k, text)
        try:
            out[k] = number(text, signs)
        except ValueError:
            raise ValueError(k, text) from None
    return out


class Columns(Mapping[str, Array]):
    """Columns of text cells that become numbers when they are asked for; a cell that nobody needs refuses nothing.

    A cell is None where its row is too short; `short` has the number of cells of such rows, `place` says where a row is.
    """

    def __init__(
        self,
        texts: Mapping[str, Sequence[str | None]],
        decimal: str,
        stamped: frozenset[str],
        place: Callable[[int], str],
        short: Mapping[int, int],
    ):
        self._texts, self._decimal, self._stamped, self._place, self._short = texts, decimal, stamped, place, short
        self._notation = File({key: column for key, column in texts.items() if key not in stamped}, decimal)
        self._ready: dict[str, Array] = {}

    def __getitem__(self, key: str) -> Array:
        if key not in self._ready:
            texts = self._texts[key]
            try:
                self._ready[key] = stamps(texts) if key in self._stamped else numbers(texts, self._notation.signs(key))
            except Doubt as exc:
                row, text = exc.args
                meant = f"{text.strip().replace(',', '').replace('.', '')} or {text.strip().replace(',', '.')}"
                what = f'channel {key}: "{text.strip()}" may be {meant}, and no other number tells'
                raise RecordingError(f"{self._place(row)}: {what}; write numbers without signs between thousands") from None
            except NoOffset as exc:
                row, text = exc.args
                what = f'channel {key}: "{text.strip()}" has no offset from UTC, other stamps of the channel have one'
                raise RecordingError(f"{self._place(row)}: {what}; write it behind all of them, or behind none") from None
            except ValueError as exc:
                row, text = exc.args
                raise RecordingError(f"{self._place(row)}: {self._what(key, row, text)}") from None
        return self._ready[key]

    def _what(self, key: str, row: int, text: str | None) -> str:
        if text is None:
            return f"{self._short[row]} values for {len(self)} channels, none for {key}; give one value a channel"
        shown = " ".join("".join(c if c.isprintable() else " " for c in text).split())
        if key in self._stamped:
            return f'channel {key}: "{shown}" is no time; correct the cell'
        other = "," if self._decimal == "." else "."
        if other in shown and NUMBER.fullmatch(shown):
            point = "points" if self._decimal == "." else "commas"
            return f'channel {key}: "{shown}" is not a number beside decimal {point}; write all numbers in one way'
        return f'channel {key}: "{shown}" is not a number; correct the cell'

    def __iter__(self) -> Iterator[str]:
        return iter(self._texts)

    def __len__(self) -> int:
        return len(self._texts)
