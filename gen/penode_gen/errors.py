# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
What can go wrong, by what the caller can do about it. Each class has a `code`, which stays, and the exit code of the command.

    PenodeError              anything below
      UserError              exit 2: the caller can correct it
        ModelError           "model-file": correct the model file, or what it names
          ExportError        the same, or "usage" where options of the export are all that is wrong (penode_gen.exports)
          ImportProblem      the file that is to become a model or network file (penode_gen.imports)
        NetworkError         "network": export the network again, or name another file
        RecordingError       "recording": correct the recording, or say by --channel what it means
        ScenarioError        "scenario": correct the scenario file
        NotConverged         exit 4, "not-converged": no start of a training stayed within bounds; see what it says was tried
        ToolMissing          "tool-missing": install the compiler, the emulator, or the Python package
        TargetError          "target": look after the board, the emulator, the compiler, the controller, or the line to it
        WrongUse             "usage": call the command otherwise: its options, its paths, its environment
      InternalError          exit 3, "internal": a bug in penode; report it with the traceback

The classes from RecordingError on are in penode_sil.errors.
"""

from __future__ import annotations

import re
from typing import Any

_PLACE = re.compile(r"(?!channel )(--|[^ ]+$|.*/|.*\.\w+$|.*:\d+$)")
_ADDRESS = re.compile(r"--|(tcp|udp|serial|pil):")  # what ends in a number that is none of a line
_KEY = re.compile(r"\w+(\[\d+\])?(\.\w+(\[\d+\])?)*")


class Problem(str):
    """
    One thing that is wrong: the line that is printed, `PLACE:LINE: KEY: MESSAGE; REMEDY`, with its parts. As a string it is that line.

    `place` is a file, an option such as --set, or an address; `line` counts from 1; `key` is a key of that file; `channel` is the one of a
    recording that `message` is about. What is not known is empty, or None.
    """

    message: str
    place: str
    line: int | None
    key: str
    remedy: str
    channel: str

    def __new__(cls, message: str, place: str = "", line: int | None = None, key: str = "", remedy: str = "") -> Problem:
        at = place if line is None else f"{place}:{line}"
        what = ": ".join(part for part in (at, key, message) if part)
        return cls.shown(f"{what}; {remedy}" if remedy else what, message, place, line, key, remedy)

    @classmethod
    def read(cls, text: str, line: int | None = None, channel: str = "") -> Problem:
        """
        The parts of a line that was written as one text, with a `line` and a `channel` that it does not show in this form.

        The remedy is what follows the last "; ". The place is what stands before the first ": ", if it is an option, ends in a line number,
        has a / or a suffix, or is one word. A word that follows, such as instance[2].set, is the key.
        """
        if isinstance(text, cls):
            return text
        what, separator, remedy = text.rpartition("; ")
        what, remedy = (what, remedy) if separator else (text, "")
        place, separator, message = what.partition(": ")
        if not separator or not _PLACE.match(place):
            place, message = "", what
        path, _, number = place.rpartition(":")
        if path and number.isdecimal() and not _ADDRESS.match(place):
            place, line = path, int(number)
        key, separator, rest = message.partition(": ")
        if not place or not rest or not _KEY.fullmatch(key):
            key, rest = "", message
        return cls.shown(text, rest, place, line, key, remedy, channel)

    @classmethod
    def shown(
        cls, text: str, message: str, place: str = "", line: int | None = None, key: str = "", remedy: str = "", channel: str = ""
    ) -> Problem:
        """A problem that is printed as `text`, whatever its parts."""
        found = super().__new__(cls, text)
        found.message, found.place, found.line, found.key, found.remedy, found.channel = message, place, line, key, remedy, channel
        return found

    def as_json(self) -> dict[str, Any]:
        """The parts, None for one that is not known."""
        return {name: None if vars(self)[name] == "" else vars(self)[name] for name in Problem.__annotations__}


class PenodeError(Exception):
    """
    Something that keeps penode from what it was asked to do; `problems` has one line for each thing that is wrong. `printed`: the command
    has printed it as part of its result.
    """

    code: str
    exit: int
    printed = False

    def __init__(self, *problems: str, line: int | None = None, channel: str = ""):
        self.problems = [Problem.read(problem, line, channel) for problem in problems]
        super().__init__(*problems)

    def __str__(self) -> str:
        return "\n".join(self.problems)

    def as_json(self) -> dict[str, Any]:
        """What `--json` prints in place of a result."""
        parts = [problem.as_json() for problem in self.problems]
        return {"error": {"code": self.code, "exit": self.exit, "problems": parts}}


class UserError(PenodeError):
    """Something the caller can correct: raised as one of the classes below."""

    code = "usage"
    exit = 2


class NetworkError(UserError):
    """A network that cannot be used. The message is one line: file, node or layer, what is wrong, remedy."""

    code = "network"


class ModelError(UserError):
    """A model that cannot be used; `problems` lists all of them, one line each, with place and remedy."""

    code = "model-file"

    def __init__(self, problems: list[str]):
        super().__init__(*problems)


class InternalError(PenodeError):
    """A bug in penode; `traceback` is the file that has the traceback, None if none could be written."""

    code = "internal"
    exit = 3

    def __init__(self, problem: str, traceback: str | None = None):
        super().__init__(problem)
        self.traceback = traceback

    def as_json(self) -> dict[str, Any]:
        found = super().as_json()
        found["error"]["traceback"] = self.traceback
        return found
