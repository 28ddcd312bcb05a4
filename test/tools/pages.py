# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Check what the pages (*.md) refer to: links, headings, files, modules, C names, make targets, penode commands.

Exit code 1, and a line for each reference that leads nowhere: PAGE:LINE: what, remedy. CHANGELOG.md is history: only
its links are checked. In backquotes count:
    gen/README.md, sets/packing.py, pen_set.c   a tracked file, or the end of its path
    penode_sil.mil                              a module
    pen_status_t, PEN_OK                        a name in inc/, src/ or port/
    make test                                   a target of the Makefile
    penode stage                                a command
Not checked: paths with a part in capitals (NAME.h, DIR/report.html stand for others), with wildcards, and in build/.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HISTORY = {"CHANGELOG.md"}
ELSEWHERE = {"main.c", "penode.c", "penode.h"}  # of the user; made by `make dist`
LINK = re.compile(r"(?<!\\)!?\[[^\]]*\]\(([^)\s]+)\)")
CODE = re.compile(r"(?<!`)`([^`\n]+)`(?!`)")
FILE = re.compile(r"[\w./-]+\.(?:py|c|h|mk|sh|pml|j2|md)")
FOLDER = re.compile(r"(?:gen|inc|src|port|sil|test)(?:/[\w.-]+)*/?")
MODULE = re.compile(r"penode_(?:gen|sil)(?:\.[a-z_0-9]+)+")
C_NAME = re.compile(r"(?:pen|PEN)_\w+")
MAKE = re.compile(r"make ([a-z][a-z-]*)")
COMMAND = re.compile(r"penode ([a-z][a-z0-9-]*)")


@dataclass(frozen=True)
class Project:
    """What there is to refer to."""

    root: Path
    files: frozenset[str]
    c_text: str
    targets: frozenset[str]
    commands: frozenset[str]

    def has_file(self, name: str) -> bool:
        """Is it a tracked file or folder, or the end of a path of one?"""
        name = name.removeprefix("./").rstrip("/")
        return any(f == name or f.endswith("/" + name) or f.startswith(name + "/") or f"/{name}/" in f for f in self.files)

    def has_module(self, name: str) -> bool:
        """Is it a module, or a name in one?"""
        paths = [name.replace(".", "/"), name.rpartition(".")[0].replace(".", "/")]
        return any(self.has_file(f"{p}.py") or self.has_file(f"{p}/__init__.py") for p in paths)


def tracked(root: Path) -> frozenset[str]:
    """All files of the project: those of git, or without git all that are there but for build/."""
    done = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=root, capture_output=True, text=True)
    if done.returncode == 0:
        return frozenset(done.stdout.splitlines())
    found = (p.relative_to(root) for p in root.rglob("*") if p.is_file())
    return frozenset(p.as_posix() for p in found if p.parts[0] not in ("build", ".git"))


def targets(text: str) -> frozenset[str]:
    """Names before a colon, those after .PHONY, and patterns spelled out in the makefiles."""
    names = re.findall(r"^([\w. -]+?):(?!=)", text, re.MULTILINE)
    phony = re.findall(r"^\.PHONY:(.*)$", text, re.MULTILINE)
    lists = re.findall(r"^(?:SUITES|PROVE_\w+|CAMPAIGN_\w+)\s*:=((?:.*\\\n)*.*)$", text, re.MULTILINE)
    return frozenset(word for line in (*names, *phony, *lists) for word in line.replace("\\", " ").split())


def project(root: Path, commands: frozenset[str]) -> Project:
    files = tracked(root)
    read = {f: (root / f).read_text(encoding="utf-8") for f in files if f.endswith((".c", ".h", ".mk", ".j2")) or f == "Makefile"}
    c_text = "\n".join(text for f, text in read.items() if f.endswith((".c", ".h", ".j2")))
    return Project(root, files, c_text, targets("\n".join(t for f, t in read.items() if f.endswith(".mk") or f == "Makefile")), commands)


def anchors(text: str) -> set[str]:
    """Anchors of the headings of a page, as Git hosts make them."""
    found = set()
    for heading in re.findall(r"^#{1,6} (.+?)\s*$", re.sub(r"```.*?```", "", text, flags=re.DOTALL), re.MULTILINE):
        found.add(re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-"))
    return found


def wrong_link(of: Project, page: str, target: str) -> str:
    """What is wrong with a link, empty if nothing is."""
    if re.match(r"[a-z]+:", target):
        return ""
    path, _, anchor = target.partition("#")
    file = (of.root / page).parent / path if path else of.root / page
    if not file.exists():
        return f"the link leads to {target}, which is not there; correct it"
    if anchor and file.suffix == ".md" and anchor not in anchors(file.read_text(encoding="utf-8")):
        return f"{path or page} has no heading #{anchor}; name one that it has"
    return ""


def wrong_code(of: Project, text: str) -> str:
    """What is wrong with a reference in backquotes, empty if nothing is."""
    if text in ELSEWHERE or re.search(r"build/|\*|<|\{|\.\.|(?:^|/)(?!README)[A-Z]{2,}[_/.]", text):
        return ""
    if MODULE.fullmatch(text):
        return "" if of.has_module(text) else f"there is no module {text}; name one that there is"
    if FILE.fullmatch(text) or ("/" in text and FOLDER.fullmatch(text)):
        return "" if of.has_file(text) else f"there is no file {text}; name one that there is"
    if C_NAME.fullmatch(text):
        return "" if re.search(rf"\b{text}", of.c_text) else f"no C here has {text}; name what it is now"
    if (m := MAKE.match(text)) and m[1] not in of.targets:
        return f"make has no target {m[1]}; see make help"
    if (m := COMMAND.match(text)) and m[1] not in of.commands:
        return f"penode has no command {m[1]}; see penode --help"
    return ""


def look(of: Project, page: str) -> Iterator[str]:
    """A line for each reference of a page that leads nowhere."""
    fenced = False
    for number, line in enumerate((of.root / page).read_text(encoding="utf-8").splitlines(), 1):
        fenced ^= line.lstrip().startswith("```")
        if fenced:
            continue
        wrong = [wrong_link(of, page, m[1]) for m in LINK.finditer(CODE.sub("", line))]
        wrong += [wrong_code(of, m[1]) for m in CODE.finditer(line)] if page not in HISTORY else []
        yield from (f"{page}:{number}: {text}" for text in wrong if text)


def main(root: Path = ROOT) -> int:
    from penode_sil.cli import COMMANDS

    of = project(root, frozenset(COMMANDS))
    lines = [line for page in sorted(of.files) if page.endswith(".md") for line in look(of, page)]
    print("\n".join(lines), file=sys.stderr)
    return int(bool(lines))


if __name__ == "__main__":
    sys.exit(main())
