# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
The manual as Sphinx reads it: `assemble.py DIR` lays out all pages of the repository below DIR, each at its own path, with the generated
pages of the reference; `make site` builds the HTML from them.

Paths of pages in backquotes become links. A link to a file that is no page is copied along.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

import c_api
import causes
import schemas
import targets

ROOT = Path(__file__).resolve().parents[2]
HERE = "sil/manual"
GENERATED: dict[str, Callable[[], str]] = {"causes": causes.page, "c_api": c_api.page, "json": schemas.page, "make_targets": targets.page}
CODE = re.compile(r"(?<![`\[])`([\w./-]+\.md)`(?!`|\])")
LINK = re.compile(r"\]\(([^)\s#:]+)\)")


def tracked(suffix: str) -> list[str]:
    """Paths of the repository's files that end so, new ones included."""
    done = subprocess.run(["git", "ls-files", "-co", "--exclude-standard", f"*{suffix}"], cwd=ROOT, capture_output=True, text=True)
    if done.returncode == 0:
        return sorted(set(done.stdout.split()))
    return sorted(p.relative_to(ROOT).as_posix() for p in ROOT.rglob(f"*{suffix}") if "build" not in p.relative_to(ROOT).parts)


def meant(name: str, page: str, pages: Iterable[str]) -> str:
    """The page that a path in backquotes of `page` means: beside that page, from the root, or the only one that ends so; empty if none."""
    beside = (ROOT / page).parent.joinpath(name).resolve()
    near = [p for p in pages if (ROOT / p) == beside]
    ends = [p for p in pages if p == name or p.endswith(f"/{name}")]
    return (near or [p for p in ends if p == name] or (ends if len(ends) == 1 else [""]))[0]


def linked(text: str, page: str, pages: list[str]) -> str:
    """A page with links for the paths of pages in backquotes, outside of fenced code."""

    def link(m: re.Match[str]) -> str:
        found = meant(m[1], page, pages)
        up = "../" * page.count("/")
        return f"[`{m[1]}`]({up}{found})" if found and found != page else m[0]

    parts = re.split(r"(^```.*?^```$)", text, flags=re.MULTILINE | re.DOTALL)
    return "".join(part if part.startswith("```") else CODE.sub(link, part) for part in parts)


def assemble(target: Path) -> None:
    """Write all pages below `target`, which is emptied."""
    shutil.rmtree(target, ignore_errors=True)
    pages = tracked(".md")
    for page in pages:
        text = (ROOT / page).read_text(encoding="utf-8")
        at = target / page
        at.parent.mkdir(parents=True, exist_ok=True)
        at.write_text(linked(text, page, pages), encoding="utf-8")
        for name in LINK.findall(text):
            file = (ROOT / page).parent / name
            if file.is_file() and file.suffix != ".md":
                (at.parent / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(file, at.parent / name)
    for name, make in GENERATED.items():
        (target / HERE / "reference" / f"{name}.md").write_text(linked(make(), f"{HERE}/reference/{name}.md", pages), encoding="utf-8")
    (target / "_extra/schemas").mkdir(parents=True)
    for name in schemas.NAMES:
        (target / "_extra/schemas" / schemas.file(name)).write_text(json.dumps(schemas.schema(name), indent=2) + "\n", encoding="utf-8")
    shutil.copy(ROOT / HERE / "conf.py", target)
    shutil.copytree(ROOT / HERE / "static", target / "_static")


if __name__ == "__main__":
    assemble(Path(sys.argv[1]))
