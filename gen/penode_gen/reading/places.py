# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The text of a model file: its tables, and where in the file each key stands."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from .. import model as m

_TOKEN = re.compile(r'"""(?:\\.|[^\\])*?"""|\'\'\'.*?\'\'\'|"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\'|#[^\n]*|[\[\]{}\n]', re.DOTALL)
_QUOTED = r'"[^"\n]*"|\'[^\'\n]*\''
_HEADER = re.compile(rf"[ \t]*\[\[?((?:{_QUOTED}|[^\]\"'\n])+)\]")
_KEY = re.compile(rf"[ \t]*((?:{_QUOTED}|[A-Za-z0-9_. \t-])+)=")
_KEY_PART = re.compile(rf"{_QUOTED}|[A-Za-z0-9_-]+")


class Lines:
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
        """Does the file have an entry under this path?"""
        return path[:2] in self._at

    def of(self, path: tuple[str, ...]) -> int:
        """Line of the key or of the closest table around it."""
        while path and path not in self._at:
            path = path[:-1]
        return self._at.get(path, 1)


def one_line(text: str) -> str:
    """The text on one line, without anything that a terminal would act on."""
    return "".join(c if c.isprintable() else " " for c in text)


def show(value: object) -> str:
    """A value of the file, in messages."""
    try:
        text = repr(value)
    except ValueError:  # an integer of thousands of digits
        return "a huge number"
    return text if len(text) <= 300 else f"a text of {len(text)} characters"


def parse(path: Path, called: str = "") -> tuple[dict[str, Any], bytes, Lines]:
    """A model file as tables, bytes and places; `called` names who asked for it. Raises ModelError."""
    try:
        raw = path.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise m.ModelError(
            [one_line(f"{called or path}{f': {path}' * bool(called)}: cannot be read ({reason}); give the path of a model file")]
        ) from error
    try:
        text = raw.decode("utf-8").replace("\r\n", "\n")
        return tomllib.loads(text), raw, Lines(text)
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise m.ModelError([one_line(f"{path}:{line}: is not UTF-8 text; save it as UTF-8, or give a TOML model file")]) from error
    except (ValueError, RecursionError) as error:  # TOMLDecodeError is a ValueError; so is an integer of thousands of digits
        found = re.search(r" \(at line (\d+), column \d+\)", str(error))
        toml = isinstance(error, tomllib.TOMLDecodeError)
        what = str(error).replace(found[0], "") if found else str(error) if toml else "a number or a nesting beyond all measure"
        place = found[1] if found else raw.count(b"\n") + (not raw.endswith(b"\n"))
        raise m.ModelError([one_line(f"{path}:{place}: is not valid TOML ({what}); correct the syntax there")]) from error


def merge(base: dict[str, Any], own: dict[str, Any]) -> dict[str, Any]:
    """`own` over `base`, section by section; of bodies and states key by key, so that a start state can be given alone."""
    merged = base | {k: base[k] | v if isinstance(v, dict) and isinstance(base.get(k), dict) else v for k, v in own.items()}
    for section in ("bodies", "states"):
        theirs, ours = base.get(section), own.get(section)
        if isinstance(theirs, dict) and isinstance(ours, dict):
            changed = {k: theirs[k] | v for k, v in ours.items() if isinstance(v, dict) and isinstance(theirs.get(k), dict)}
            merged[section] = merged[section] | changed
    return merged
