# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The page of the C interface, from the comments of the headers: what a model generates, then the runtime, header by header."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MODEL = "gen/nqvm/c/nqvm.h"
FIRST = ("pen_status.h", "pen_serial.h", "pen_selftest.h", "pen_real.h", "pen_port.h", "pen_xcp.h", "pen_xcp_daq.h", "pen_xcp_static.h")
INTRODUCTION = (
    "From the comments of the headers. A program includes the header of its model and calls the functions of that model, here",
    "those of the quarter vehicle, `nqvm_`; for another model `nqvm` is its name. Of the runtime, programs use status, serial form,",
    "self-test and XCP; the other headers are for generated code. Types, constants and macros stand in the headers themselves.",
)
COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)


@dataclass(frozen=True)
class Function:
    """A function of a header: its declaration without a body, and what the comment before it says."""

    name: str
    declaration: str
    comment: str


def headers() -> list[str]:
    """Paths of all headers of the page, those that programs include first."""
    own = sorted((ROOT / "inc/penode").glob("*.h"), key=lambda p: (FIRST.index(p.name) if p.name in FIRST else len(FIRST), p.name))
    return [MODEL, *(p.relative_to(ROOT).as_posix() for p in own)]


def plain(comment: str) -> str:
    """The text of a comment without its stars; what is indented stays so."""
    body = comment.removeprefix("/*").removeprefix("*").removesuffix("*/").strip()
    return "\n".join(re.sub(r"^\s*\*? ?|^   ", "", line, count=1) for line in body.splitlines()).rstrip()


def pieces(text: str) -> Iterator[tuple[str, str]]:
    """Parts of a header: statements ("code": up to a semicolon, or a whole body), comments before one ("before"), and comments that
    follow one in its line ("behind")."""
    text = re.sub(r"^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", "", text, flags=re.MULTILINE)
    text = re.sub(r'^extern "C" \{$', "", text, flags=re.MULTILINE)
    code, depth, at = "", 0, 0
    while at < len(text):
        if m := COMMENT.match(text, at):
            if not code.strip():
                yield "before" if "\n" in code or not at else "behind", m[0]
                code = ""
            at = m.end()
            continue
        char = text[at]
        depth += (char == "{") - (char == "}")
        code += char
        at += 1
        if depth <= 0 and (char == ";" or (char == "}" and ")" in code.split("{")[0])):
            yield "code", code.strip()
            code, depth = "", 0


def functions(text: str) -> list[Function]:
    """All functions that a header declares or defines."""
    found: list[Function] = []
    comment, last = "", False
    for kind, piece in pieces(text):
        if kind == "before":
            comment, last = plain(piece), False
        elif kind == "behind" and last:
            found[-1] = replace(found[-1], comment="\n\n".join(part for part in (found[-1].comment, plain(piece)) if part))
        elif kind == "code":
            head = re.sub(r"\s+", " ", piece.split("{")[0]).strip().removesuffix(";").strip()
            m = re.match(r"[^()=]*?(\w+) ?\(", head)
            last = bool(m) and not head.startswith("typedef")
            if m and last:
                found.append(Function(m[1], f"{head};", comment))
            comment = ""
    return found


def paragraphs(comment: str) -> list[str]:
    """A comment as Markdown: its tags are a list, what is indented stays as it is."""
    lines: list[str] = []
    for block in re.split(r"\n\s*\n", re.sub(r"(?<=\S)\s*(@return)", r"\n\1", comment)):
        text, *tags = re.split(r"^(?=@)", block, flags=re.MULTILINE)
        for indented, group in itertools.groupby(text.rstrip().splitlines(), lambda line: line.startswith(" ")):
            part = "\n".join(group)
            lines += ["```text", part, "```", ""] if indented else [_escaped(part), ""]
        lines += [_tag(tag) for tag in tags] + [""] * bool(tags)
    return lines


def _tag(tag: str) -> str:
    """`@param x  text` and `@return text` as an item of a list; what follows at the margin is a paragraph of its own."""
    body, *rest = re.split(r"\n(?! )", tag.rstrip())
    body = " ".join(body.split())
    if m := re.match(r"@param ((?:\w+, )*\w+) (.*)", body):
        item = f"- `{m[1]}`: {_escaped(m[2])}"
    else:
        item = f"- returns {_escaped(body.removeprefix('@return').strip())}"
    return "\n".join([item, *(["", _escaped(" ".join(rest))] if rest else [])])


def _escaped(text: str) -> str:
    return re.sub(r"([*_<>\[\]|])", r"\\\1", text)


def _header(path: str) -> list[str]:
    text = (ROOT / path).read_text(encoding="utf-8")
    title = path.removeprefix("inc/")
    own = COMMENT.findall(text.split("#ifndef")[0])
    lines = [f"## {title}", "", *paragraphs(plain(own[-1]))]
    for f in functions(text):
        lines += [f"### {f.name}", "", "```c", f.declaration, "```", "", *paragraphs(f.comment)]
    return lines


def page() -> str:
    lines = ["# C interface", "", *INTRODUCTION, ""]
    for path in headers():
        lines += _header(path)
    return "\n".join(lines) + "\n"
