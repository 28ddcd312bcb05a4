# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""PROMISES.md: each requirement and each promise of the headers, what shows it, and the figures of the last run."""

from __future__ import annotations

import json
import re
import sys
import tomllib
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
PAGE = HERE / "PROMISES.md"
HEADERS = [*sorted((ROOT / "inc" / "penode").glob("*.h")), ROOT / "port/template/pen_port_target.h", ROOT / "gen/nqvm/c/nqvm.h"]
FUNCTION = re.compile(r"^(?:PEN_PORT_INLINE |static inline )?(?:const )?\w+ \*?((?:pen|nqvm)_\w+)\(", re.M)
START = """\
# What is promised, and what shows it

Made by `make prove-promises` from `promises.toml` and the figures of the last runs (`figures.json` here,
`../bench/bench.json`); `make test` refuses a row that names a test that is not there, and a public function without a row.
A campaign that was not run yet has no figure. Rows without one: the tests named pass or fail, those in C on the host and on
five emulated cores.
"""


def figures() -> dict[str, Any]:
    """What the gates and the measurements kept."""
    kept, bench = HERE / "figures.json", ROOT / "test" / "bench" / "bench.json"
    return json.loads(kept.read_text()) | {"bench": json.loads(bench.read_text())}


def look(data: Any, path: list[str]) -> Any:
    """A figure: keys, indices, "key=value,..." for a row; "*" adds up all that have the rest; a list counts. KeyError."""
    if not path:
        return len(data) if isinstance(data, list) else data
    key, *rest = path
    if isinstance(data, list) and "=" in key:
        wanted = re.findall(r"(\w+)=(.*?)(?=,\w+=|$)", key)
        rows = [row for row in data if all(row.get(k) == v for k, v in wanted)]
        data = {key: rows[-1]} if rows else {}
    elif isinstance(data, list):
        return look(data[int(key)], rest)
    if not isinstance(data, dict):
        raise KeyError(key)
    if key != "*":
        return look(data[key], rest)
    if rest:
        some = [child for child in data.values() if isinstance(child, dict) and (rest[0] == "*" or rest[0] in child)]
    else:
        some = [child for child in data.values() if isinstance(child, int)]
    if not some:
        raise KeyError(key)
    return sum(look(child, rest) for child in some)


def cell(text: str, known: dict[str, Any]) -> str:
    """Figures put into their places, "?" for one that is missing; without campaigns that were not run yet."""

    def value(match: re.Match[str]) -> str:
        path = match[1].split("/")
        try:
            found = look(known, path)
        except (KeyError, IndexError):
            return "?"
        return f"{found:,}".replace(",", " ") if isinstance(found, int) else str(found)

    run = [part for part in text.split("; ") if not part.startswith("campaign:") or re.search(r"{([^}/]+)", part)[1] in known]
    return re.sub(r"{([^}]+)}", value, "; ".join(run))


def shown(text: str) -> str:
    """Targets as commands; tests after the file that has them."""
    parts = []
    for part in text.split("; "):
        file, _, tests = part.partition(": ")
        parts.append(f"`{file}`: {', '.join(f'`{test}`' for test in tests.split(', '))}" if tests else f"`make {file}`")
    return "<br>".join(parts)


def parts() -> list[dict[str, Any]]:
    """Title and rows of each part."""
    return tomllib.loads((HERE / "promises.toml").read_text())["part"]


def page() -> str:
    """PROMISES.md as it has to be."""
    known, lines = figures(), [START]
    for part in parts():
        lines += [f"## {part['title']}", "", "| promise | how | shown by | last run |", "|---|---|---|---|"]
        for promise, how, tests, figure in part["rows"]:
            lines.append(f"| {promise} | {how} | {shown(tests)} | {cell(figure, known)} |")
        lines.append("")
    return "\n".join(lines)


def problems() -> list[str]:
    """Tests and targets that do not exist, functions without a row, figures that are missing."""
    rows = [row for part in parts() for row in part["rows"]]
    files = {path.name: path.read_text() for path in (ROOT / "test").rglob("test_*") if path.suffix in (".c", ".py")}
    rules = (ROOT / "test" / "test.mk").read_text() + (HERE / "prove.mk").read_text()
    targets = set(" ".join(re.findall(r"^([\w -]+):", rules, re.M)).split())
    found = []
    for promise, _, tests, _ in rows:
        for part in tests.split("; "):
            file, _, names = part.partition(": ")
            if not names:
                found += [] if file in targets else [f"{promise}: no target {file}"]
            else:
                there = set(re.findall(r"\b(?:def|void) (\w+)\(", files.get(file, "")))
                found += [f"{promise}: no {name} in {file}" for name in names.split(", ") if name not in there]
    named = set(re.findall(r"\w+", " ".join(row[0] for row in rows)))
    for header in HEADERS:
        names = dict.fromkeys(FUNCTION.findall(header.read_text()))
        found += [f"{header.name}: no row for {name}" for name in names if name not in named]
    return found + [f"no figure: {line}" for line in page().splitlines() if "?" in line]


def main() -> int:
    PAGE.write_text(page())
    found = problems()
    print("\n    ".join([f"{'FAIL' if found else 'ok  '}  promises: every row has its test and its figures", *found]))
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
