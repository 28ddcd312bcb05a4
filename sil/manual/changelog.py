# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
The changelog from fragments: one file for each change, `changes/NAME.KIND.txt`, so that two branches never edit the same lines.

changelog.py                     checks all fragments and prints the section that they make
changelog.py --release 0.2.0     writes that section into CHANGELOG.md, dated today, and deletes the fragments

A fragment is what a user notices: one paragraph of Markdown that ends with a full stop, in lines of at most 150 characters, without a
heading or a bullet. KIND is one of the six of Keep a Changelog. Exit code 1 and a line for each fragment that is not so.
"""

from __future__ import annotations

import argparse
import datetime
import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FRAGMENTS = ROOT / "sil/manual/changes"
KINDS = ("added", "changed", "deprecated", "removed", "fixed", "security")
NAME = re.compile(rf"[a-z0-9-]+\.({'|'.join(KINDS)})\.txt")
WIDTH = 150
NEWEST = re.compile(r"^## ", re.MULTILINE)  # the section of the newest version begins here


def faults(fragment: Path) -> Iterator[str]:
    """What is wrong with a fragment, and the remedy."""
    if not NAME.fullmatch(fragment.name):
        yield f"{fragment.name}: not NAME.KIND.txt; KIND is one of {', '.join(KINDS)}, NAME has small letters, digits and hyphens"
    text = fragment.read_text(encoding="utf-8")
    if not text.strip() or not text.endswith(".\n"):
        yield f"{fragment.name}: does not end with a full stop and a newline; write one whole sentence at least"
    if "\n\n" in text or re.search(r"^(#|[-*] )", text, re.MULTILINE):
        yield f"{fragment.name}: more than a paragraph; no blank line, heading or bullet, a second change is a second fragment"
    if any(len(line) > WIDTH for line in text.splitlines()):
        yield f"{fragment.name}: a line of more than {WIDTH} characters; break it"


def bullets(fragments: list[Path], kind: str) -> str:
    """Those of a kind as a list, nothing if there are none."""
    texts = [f.read_text(encoding="utf-8").strip() for f in fragments if f.name.endswith(f".{kind}.txt")]
    return "".join(f"- {text.replace(chr(10), chr(10) + '  ')}\n" for text in texts)


def section(fragments: list[Path], version: str, date: str) -> str:
    """The section of a version: a heading for each kind that has fragments, a bullet for each fragment."""
    lists = {kind: bullets(fragments, kind) for kind in KINDS}
    return "\n".join([f"## {version} - {date}\n", *(f"### {kind.capitalize()}\n\n{text}" for kind, text in lists.items() if text)])


def released(changelog: str, fragments: list[Path], version: str, date: str) -> str:
    """A changelog with the section of a version: a new one above all others, or the one marked as unreleased, with the fragments."""
    begun = f"## {version} - unreleased\n"
    if begun not in changelog:
        newest = NEWEST.search(changelog)
        at = newest.start() if newest else len(changelog)
        return f"{changelog[:at]}{section(fragments, version, date)}\n{changelog[at:]}"
    before, _, rest = changelog.partition(begun)
    following = NEWEST.search(rest)
    own, older = (rest[: following.start()], rest[following.start() :]) if following else (rest, "")
    for kind in KINDS:
        text, heading = bullets(fragments, kind), f"### {kind.capitalize()}\n\n"
        if text and heading in own:
            own = own.replace(heading, heading + text, 1)
        elif text:
            own = f"{own.rstrip()}\n\n{heading}{text}" + "\n" * bool(older)
    return f"{before}## {version} - {date}\n{own}{older}"


def main() -> None:
    parser = argparse.ArgumentParser(description="The changelog from fragments.")
    parser.add_argument("--release", metavar="VERSION", help="write CHANGELOG.md and delete the fragments")
    version = parser.parse_args().release
    fragments = sorted(FRAGMENTS.glob("*.txt"))
    wrong = [fault for fragment in sorted(FRAGMENTS.glob("*")) for fault in faults(fragment)]
    if wrong:
        sys.exit("\n".join(wrong))
    today = datetime.datetime.now(datetime.UTC).date().isoformat()
    if not version:
        print(section(fragments, "Unreleased", today))
        return
    page = ROOT / "CHANGELOG.md"
    page.write_text(released(page.read_text(encoding="utf-8"), fragments, version, today), encoding="utf-8")
    for fragment in fragments:
        fragment.unlink()


if __name__ == "__main__":
    main()
