# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""pages.py finds each kind of reference that leads nowhere, and takes those that lead somewhere."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))

import pages  # needs the path above

GOOD = """# A page

## Where things are

[here](#where-things-are), [there](sub/other.md#its-heading), [elsewhere](https://example.org/x), `[this](is code)`
`src/pen_set.c`, `pen_set.c`, `sub/`, `penode_gen.sets.packing`, `penode_gen.sets.packing.set_values`, `pen_set_t`
`make test`, `make prove-eva`, `penode stage MODEL`, `NAME_sets.h`, `DIR/report.html`, `build/run/x.c`, `gen/*.c`
```
`make nonsense` in a block of output
```
"""


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    for name, text in {
        "page.md": GOOD,
        "sub/other.md": "# Its heading\n",
        "src/pen_set.c": "typedef int pen_set_t;\n",
        "gen/penode_gen/sets/packing.py": "",
        "Makefile": "test: setup ## all\n\ttrue\n.PHONY: prove-eva\n",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def found(tree: Path) -> list[str]:
    return list(pages.look(pages.project(tree, frozenset({"stage"})), "page.md"))


def test_what_leads_somewhere_is_taken(tree: Path) -> None:
    assert found(tree) == []


@pytest.mark.parametrize(
    "wrong",
    [
        "[x](gone.md)",
        "[x](#no-such-heading)",
        "[x](sub/other.md#no-such-heading)",
        "`src/pen_gone.c`",
        "`gone.py`",
        "`src/gone/`",
        "`penode_gen.sets.gone.away`",
        "`pen_gone_t`",
        "`make gone`",
        "`penode gone MODEL`",
    ],
)
def test_what_leads_nowhere_is_named_with_its_line(tree: Path, wrong: str) -> None:
    (tree / "page.md").write_text(GOOD + wrong + "\n")
    lines = found(tree)
    assert len(lines) == 1 and lines[0].startswith(f"page.md:{len(GOOD.splitlines()) + 1}: "), lines


def test_history_may_name_what_has_gone_but_its_links_hold(tree: Path) -> None:
    (tree / "CHANGELOG.md").write_text("`gone.py` [x](gone.md)\n")
    lines = list(pages.look(pages.project(tree, frozenset()), "CHANGELOG.md"))
    assert len(lines) == 1 and "gone.md" in lines[0]
