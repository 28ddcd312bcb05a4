# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The site: every page is reachable, no link is broken, nothing is loaded from elsewhere, the search has its index."""

from __future__ import annotations

import re
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import assemble
import pytest

ROOT = Path(__file__).resolve().parents[2]
SPHINX = ROOT / "build/docs/bin/python"


def test_every_page_is_in_the_table_of_contents() -> None:
    index = (ROOT / "sil/manual/index.md").read_text(encoding="utf-8")
    entries = re.findall(r"^(?:.*<(/[^>]+)>|([a-z]+/\w+))$", index, re.MULTILINE)
    listed = {f"{path.removeprefix('/')}.md" if path else f"sil/manual/{own}.md" for path, own in entries}
    made = {f"sil/manual/reference/{name}.md" for name in assemble.GENERATED}
    assert listed == (set(assemble.tracked(".md")) | made) - {"sil/manual/index.md"}


def test_paths_of_pages_become_links() -> None:
    pages = ["README.md", "sil/README.md", "sil/ERRORS.md", "gen/README.md"]
    text = "See `ERRORS.md`, `gen/README.md`, `README.md`, `none.md` and [`ERRORS.md`](ERRORS.md).\n\n```\n`ERRORS.md`\n```\n"
    first = assemble.linked(text, "sil/README.md", pages).splitlines()[0]
    assert first == (
        "See [`ERRORS.md`](../sil/ERRORS.md), [`gen/README.md`](../gen/README.md), `README.md`, `none.md` and [`ERRORS.md`](ERRORS.md)."
    )
    assert "\n`ERRORS.md`\n" in assemble.linked(text, "sil/README.md", pages)


class Page(HTMLParser):
    """Links, what is loaded, and places of a page."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.ids: set[str] = set()
        self.feed(file.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.ids |= {given[name] for name in ("id", "name") if name in given}
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        elif tag == "link" and given.get("rel") == "stylesheet":
            self.loaded.append(given["href"])
        elif "src" in given:
            self.loaded.append(given["src"])


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> dict[Path, Page]:
    """All pages, built as `make site` builds them."""
    assert SPHINX.exists(), "Sphinx is not installed: make build/setup/docs"
    source, target = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("site")
    assemble.assemble(source)
    subprocess.run([SPHINX, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html", source, target], check=True)
    return {file: Page(file) for file in target.rglob("*.html")}


def test_no_link_is_broken(site: dict[Path, Page]) -> None:
    broken = []
    for file, page in site.items():
        for link in (*page.links, *page.loaded):
            parts = urlsplit(link)
            if parts.scheme:
                continue
            to = (file.parent / unquote(parts.path)).resolve() if parts.path else file
            there = to.exists() and (not parts.fragment or to.suffix != ".html" or unquote(parts.fragment) in site[to].ids)
            broken += [] if there else [f"{file.name}: {link}"]
    assert len(site) > 40 and not broken


def test_nothing_comes_from_elsewhere(site: dict[Path, Page]) -> None:
    assert [link for page in site.values() for link in page.loaded if urlsplit(link).scheme not in ("", "data")] == []


def test_search_finds_a_cause(site: dict[Path, Page]) -> None:
    top = min(site, key=lambda file: len(file.parts)).parent
    index = (top / "searchindex.js").read_text(encoding="utf-8")
    assert "coulomb_friction" in index and "pen_status_read" in index
