# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
A tutorial, run: its files saved, its commands given, what they print compared.

A page has in order: "Save as `NAME`" before a fence, which is that file; lines indented by four blanks that begin with `penode `,
`python3 ` or, in the checkout, `make `, which are commands; a ```text fence right behind a command, which is what it prints; `NAME` in the
line before any other fence, which is the beginning of a file. In what is printed, ", N s" stands for any time.

replay.py --take-over PAGE [FILE...] rewrites what commands print and files hold to what they do now; FILEs are there already.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
COMMAND = r"(?:penode|python3|make) "
STEP = re.compile(
    r"^Save as `(?P<name>[\w./-]+)`[^\n]*\n\n```\w+\n(?P<text>.*?)^```$"
    rf"|^    (?P<command>{COMMAND}[^\n]*)\n(?:\n```text\n(?P<printed>.*?)^```$)?"
    r"|^[^\n]*`(?P<file>[\w./-]+\.\w+)`[^\n]*:?\n\n```\w+\n(?P<holds>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)


@dataclass
class Step:
    """A part of a page: its place, what is expected there, and what there is."""

    what: str
    span: tuple[int, int]
    expected: str
    found: str = ""

    @property
    def same(self) -> bool:
        """A time is any; a file may go on."""
        pattern = re.escape(self.expected).replace(r",\ N\ s", r",\ [\d.]+\ s")
        return bool(re.match(pattern if self.what.endswith("...") else pattern + r"\Z", self.found))


def run(command: str, folder: Path) -> str:
    """What a command prints to stdout in a folder; AssertionError with the whole output if it fails."""
    words = shlex.split(command)
    program = {"penode": [sys.executable, "-m", "penode_sil"], "python3": [sys.executable], "make": ["make", "-s"]}[words[0]]
    place = ROOT if words[0] == "make" else folder
    done = subprocess.run([*program, *words[1:]], cwd=place, capture_output=True, text=True, env=os.environ | {"COLUMNS": "100"})
    assert done.returncode == 0, (command, done.stdout, done.stderr)
    return done.stdout


def replay(page: str, folder: Path) -> Iterator[Step]:
    """Do what the page says in a folder; one Step for all that it shows of output and files."""
    for m in STEP.finditer(page):
        if m["name"]:
            (folder / m["name"]).write_text(m["text"], encoding="utf-8")
        elif m["command"]:
            printed = run(m["command"], folder)
            if m["printed"] is not None:
                yield Step(m["command"], m.span("printed"), m["printed"], printed)
        elif (folder / m["file"]).exists():
            yield Step(f"{m['file']} ...", m.span("holds"), m["holds"], (folder / m["file"]).read_text(encoding="utf-8"))


def taken_over(page: str, folder: Path) -> str:
    """The page with what there is now."""
    parts, at = [], 0
    for step in replay(page, folder):
        now = step.found if not step.what.endswith("...") else "".join(step.found.splitlines(True)[: step.expected.count("\n")])
        kept = now if step.what.endswith("...") else re.sub(r", [\d.]+ s( of|$)", r", N s\1", now, flags=re.MULTILINE)
        parts += [page[at : step.span[0]], step.expected if step.same else kept]
        at = step.span[1]
    return "".join([*parts, page[at:]])


def main() -> None:
    if sys.argv[1:2] != ["--take-over"]:
        sys.exit(__doc__)
    page, *files = map(Path, sys.argv[2:])
    with tempfile.TemporaryDirectory() as folder:
        for file in files:
            shutil.copy(file, folder)
        text = taken_over(page.read_text(encoding="utf-8"), Path(folder))
    page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
