# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Cells with dates and times of day, with or without an offset from UTC, as seconds."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from datetime import date

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
DAY = r"(?:(?P<y>\d{4})[-/.](?P<m>\d\d?)[-/.](?P<d>\d\d?)|(?P<a>\d\d?)[-/.](?P<b>\d\d?)[-/.](?P<c>\d{4}))"
CLOCK = r"(?P<h>\d{1,2}):(?P<min>\d\d)(?::(?P<s>\d\d))?(?:[.,:](?P<f>\d{1,9}))?\s*(?P<half>[AaPp][Mm])?"
ZONE = r"(?:(?P<utc>Z|z|UTC|GMT)?(?P<sign>[-+\u2212])(?P<zh>\d\d?)(?::?(?P<zm>\d\d))?|(?P<zulu>Z|z|UTC|GMT))"
DATE = re.compile(rf"\s*{DAY}\s*")
STAMP = re.compile(rf"\s*(?:{DAY}[T_ ,]+)?{CLOCK}\s*{ZONE}?\s*(?:\[[\w/+-]+\])?\s*")


class NoOffset(ValueError):
    """(index, text): a stamp without an offset from UTC among others that have one."""


def stamps(texts: Sequence[str | None]) -> Array:
    """Dates and times of day in s since the first day's midnight, where the first stamp was taken; NaN where a cell is empty.

    Offsets from UTC count: `02:59+02:00` is a minute before `02:00+01:00`. ValueError(index, text) at the first cell that is no time,
    (index, None) where a row has no such cell; NoOffset where only some have an offset.
    """
    found = [None if not text or not text.strip() else STAMP.fullmatch(text) for text in texts]
    for k, (match, text) in enumerate(zip(found, texts, strict=True)):
        if match is None and text and text.strip():
            raise ValueError(k, text)
    seconds = np.array([np.nan if match is None else _of_day(match) for match in found]) - _east(found, texts)
    spans = [days + seconds for days in _days(found)]
    best: Array = min(spans, key=lambda time: float(np.nanmax(time) - np.nanmin(time)) if np.isfinite(time).any() else 0.0)
    if not any(match is not None and (match["y"] or match["c"]) for match in found):  # past midnight
        known = np.flatnonzero(np.isfinite(best))
        best[known] += 86400.0 * np.cumsum(np.diff(best[known], prepend=best[known[:1]]) < -43200.0)
    return best


def _of_day(match: re.Match[str]) -> float:
    hour, minute, second, part = int(match["h"]), int(match["min"]), match["s"], match["f"]
    fraction = int(part) / 10.0 ** len(part) if part else 0.0
    if second is None and part:  # minutes and seconds, as Excel shows them
        return 60.0 * hour + minute + fraction
    if match["half"]:
        hour = hour % 12 + 12 * (match["half"].lower() == "pm")
    return 3600.0 * hour + 60.0 * minute + int(second or 0) + fraction


def _east(found: Sequence[re.Match[str] | None], texts: Sequence[str | None]) -> Array:
    """Offsets from UTC [n, s], less that of the first stamp; NaN where a cell is empty. 0 if no stamp has one."""
    offsets = [None if m is None else _offset(m) for m in found]
    without = next((k for k, m in enumerate(found) if m is not None and offsets[k] is None), None)
    first = next((offset for offset in offsets if offset is not None), 0.0)
    if without is not None and any(offset is not None for offset in offsets):
        raise NoOffset(without, texts[without])
    return np.array([0.0 if offset is None else offset - first for offset in offsets])


def _offset(match: re.Match[str]) -> float | None:
    """The offset from UTC [s] that a stamp has; None if it has none."""
    if match["zulu"]:
        return 0.0
    if not match["sign"]:
        return None
    return (1.0 if match["sign"] == "+" else -1.0) * (3600.0 * int(match["zh"]) + 60.0 * int(match["zm"] or 0))


def _days(found: Sequence[re.Match[str] | None]) -> Iterator[Array]:
    """Whole days [s] since the first one, in every order of day and month that has such days."""
    for first, second in (("b", "a"), ("a", "b")):
        try:
            days = [np.nan if m is None else _day(m, first, second) for m in found]
        except ValueError:
            continue
        known = [day for day in days if day == day]
        yield (np.array(days) - (known[0] if known else 0.0)) * 86400.0
        if not any(m is not None and m["c"] for m in found):
            return
    yield np.zeros(len(found))


def _day(match: re.Match[str], month: str, day: str) -> int:
    if match["y"]:
        return date(int(match["y"]), int(match["m"]), int(match["d"])).toordinal()
    return date(int(match["c"]), int(match[month]), int(match[day])).toordinal() if match["c"] else 0
