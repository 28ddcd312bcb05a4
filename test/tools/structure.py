# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Counts of properties that make the project hard to change, against structure.json: each may only fall.

structure.py             print the counts; exit code 1 if one is not the kept one
structure.py --take-over write counts that have fallen into structure.json; none that has risen (`make structure`)

What is counted, in files that are written by hand (generated models in gen/*/c are not):
long files         more than 400 lines: C, headers, Python, templates, make, Spin
long functions     more than 60 lines: C from brace to brace, Python from `def` to its last line
circular imports   modules of penode_gen and penode_sil, and C headers, that import themselves by way of others
silenced lines     those with fmt: skip, fmt: off, noqa, type: ignore, clang-format off, NOLINT
crowded folders    more than 25 files; generated models and files of data (.csv, .json, .png) do not count
named thresholds   module-level numbers with an UPPER_CASE name in penode_sil: NAME = number, or arithmetic of numbers; the same
                   in a class Rules
tabled numbers     numbers inside module-level tuples, tables and calls with an UPPER_CASE name in penode_sil: TABLE = (number, ...)
named causes       names of the diagnosis catalogue (a key of MEANING in diagnosis/catalogue) as strings elsewhere in penode_sil
compared numbers   numbers other than 0, 1 and -1 inside comparisons in penode_sil: x > 0.3
settings of training  numbers of the class Settings of penode_sil.training, its one table: a budget
runtime lines      lines of inc/penode and src together, without the next three; no ratchet but a budget: only more than kept fails
elementary lines   the same of the functions that only some models call (pen_elementary.h), which no other program links
wire protocol lines lines of pen_xcp* there: the XCP slave, which only firmware with a calibration tool links; a budget too
filter lines       lines of pen_ekf* there: the Kalman filter, which only firmware with virtual sensors links; a budget too
monitor lines      lines of pen_monitor* there: the fault monitor, which only firmware with one links; a budget too
"""

from __future__ import annotations

import argparse
import ast
import itertools
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("inc", "src", "gen", "sil", "port", "test")
DATA = {".csv", ".json", ".png"}
KINDS = {".c", ".h", ".py", ".j2", ".mk", ".pml"}
FILE_LINES = 400
FUNCTION_LINES = 60
FOLDER_FILES = 25
SILENCED = re.compile(r"(?:#|//|/\*) ?(?:fmt: (?:skip|off)|noqa|type: ignore|clang-format off|NOLINT)")
RATCHETS = (
    "long files",
    "long functions",
    "circular imports",
    "silenced lines",
    "crowded folders",
    "named thresholds",
    "tabled numbers",
    "compared numbers",
    "named causes",
)
BUDGETS = ("settings of training", "runtime lines", "elementary lines", "wire protocol lines", "filter lines", "monitor lines")
ELEMENTARY = {"pen_elementary.h", "pen_parts.h", "pen_trig.c", "pen_atan.c", "pen_log.c", "pen_root.c"}

TABLE = BUDGETS[0]

Found = dict[str, list[str]]


def sources(root: Path) -> list[Path]:
    """All files that count, in a fixed order."""
    generated = re.compile(r"gen/[^/]+/c/")
    files = [p for folder in FOLDERS for p in sorted((root / folder).rglob("*")) if p.suffix in KINDS and p.is_file()]
    files = [p for p in files if p.resolve() == root.resolve() / p.relative_to(root)]  # not by way of a link as well
    files += [p for p in (root / "Makefile",) if p.is_file()]
    return [p for p in files if not generated.match(p.relative_to(root).as_posix()) and "build" not in p.relative_to(root).parts]


def bare(text: str) -> str:
    """C without comments, strings, characters and lines of the preprocessor; the lines stay where they are."""
    kept = re.sub(
        r'/\*.*?\*/|//[^\n]*|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'|^[ \t]*#(?:[^\n]*\\\n)*[^\n]*',
        lambda m: "\n" * m[0].count("\n"),
        text,
        flags=re.S | re.M,
    )
    return re.sub(r"\bextern\s*\{", "extern;", kept)  # extern "C": its brace holds functions; the last one closes nothing


def c_functions(text: str) -> Iterator[tuple[int, int]]:
    """First line and number of lines of each function, from brace to brace."""
    depth, line, start, last = 0, 1, 0, ""
    for character in bare(text):
        if character == "{":
            if depth == 0:
                start = line if last == ")" else 0
            depth += 1
        elif character == "}" and depth > 0:
            depth -= 1
            if depth == 0 and start:
                yield start, line - start + 1
        line += character == "\n"
        last = last if character.isspace() else character


def python_functions(tree: ast.Module) -> Iterator[tuple[int, int]]:
    for node in statements(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield node.lineno, (node.end_lineno or node.lineno) - node.lineno + 1


def statements(node: ast.AST) -> Iterator[ast.stmt]:
    """All statements of a module, nested ones too, without a walk through their expressions."""
    blocks = (getattr(node, name, ()) for name in ("body", "orelse", "finalbody", "handlers", "cases"))
    for part in itertools.chain(*blocks):
        if isinstance(part, ast.stmt):
            yield part
        yield from statements(part)


def is_number(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and type(node.value) in (int, float)


def tabled(tree: ast.Module) -> Iterator[int]:
    """Lines of numbers inside module-level tuples, tables and calls with a name in capitals."""
    for node in tree.body:
        targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
        value = node.value if any(isinstance(t, ast.Name) and t.id.isupper() for t in targets) else None
        if isinstance(value, ast.Tuple | ast.List | ast.Set | ast.Dict | ast.Call):
            yield from (part.lineno for part in ast.walk(value) if is_number(part))


def compared(node: ast.AST, inside: bool = False) -> Iterator[int]:
    """Lines of numbers inside comparisons, but for 0 and 1."""
    if inside and is_number(node) and node.value not in (0, 1):
        yield node.lineno
    for part in ast.iter_child_nodes(node):
        yield from compared(part, inside or isinstance(node, ast.Compare))


def crowded(root: Path) -> list[str]:
    """Folders with more files than one can keep in mind."""
    count: dict[str, int] = {}
    for folder in FOLDERS:
        for path in sorted((root / folder).rglob("*")):
            parts = path.relative_to(root).parts
            counts = path.is_file() and path.suffix not in DATA and "__pycache__" not in parts and "build" not in parts
            if counts and not re.match(r"gen/[^/]+/c/", "/".join(parts)):
                count["/".join(parts[:-1])] = count.get("/".join(parts[:-1]), 0) + 1
    return [f"{name}: {n} files" for name, n in count.items() if n > FOLDER_FILES]


def thresholds(tree: ast.Module) -> Iterator[int]:
    """Lines of module-level numbers with a name in capitals, and of numbers in a class Rules or Settings."""
    numbers = ast.Constant | ast.UnaryOp | ast.BinOp | ast.operator | ast.unaryop
    ruled = [node for table in tree.body if isinstance(table, ast.ClassDef) and table.name in ("Rules", "Settings") for node in table.body]
    for node in [*tree.body, *ruled]:
        targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
        named = node in ruled or any(isinstance(t, ast.Name) and t.id.isupper() for t in targets)
        parts = list(ast.walk(node.value)) if named and node.value is not None else []
        values = [p.value for p in parts if isinstance(p, ast.Constant)]
        if parts and all(isinstance(p, numbers) for p in parts) and all(type(v) in (int, float) for v in values):
            yield node.lineno


def python_imports(trees: dict[Path, ast.Module], package: Path) -> dict[str, set[str]]:
    """Which modules of a package each of them imports, wherever the import stands."""
    modules = {
        ".".join(p.relative_to(package.parent).with_suffix("").parts).removesuffix(".__init__"): p
        for p in trees
        if p.is_relative_to(package)
    }
    edges: dict[str, set[str]] = {name: set() for name in modules}
    for name, path in modules.items():
        here = name if path.name == "__init__.py" else name.rpartition(".")[0]
        for node in statements(trees[path]):
            if isinstance(node, ast.Import):
                edges[name] |= {a.name for a in node.names} & modules.keys()
            elif isinstance(node, ast.ImportFrom):
                base = here.split(".")[: len(here.split(".")) - node.level + 1] if node.level else []
                source = ".".join([*base, *([node.module] if node.module else [])])
                for alias in node.names:
                    edges[name] |= {f"{source}.{alias.name}" if f"{source}.{alias.name}" in modules else source} & modules.keys()
    return edges


def header_includes(files: list[Path]) -> dict[str, set[str]]:
    """Which headers each header includes, by their file names."""
    headers = {p.name: p for p in files if p.suffix == ".h"}
    include = re.compile(r'^[ \t]*#[ \t]*include[ \t]*["<]([^">]+)[">]', re.M)
    return {n: {Path(i).name for i in include.findall(p.read_text())} & headers.keys() for n, p in headers.items()}


def circular(edges: dict[str, set[str]]) -> list[str]:
    """All that come back to themselves by way of at least one other."""
    found = []
    for start in edges:
        reached: set[str] = set()
        ahead = [n for n in edges[start] if n != start]
        while ahead:
            name = ahead.pop()
            if name not in reached:
                reached.add(name)
                ahead += edges[name]
        found += [start] if start in reached else []
    return found


def causes(trees: dict[Path, ast.Module], catalogue: Path) -> set[str]:
    """The kinds of causes that a catalogue has: keys of MEANING in its files."""
    found: set[str] = set()
    for path, tree in trees.items():
        for node in tree.body if path.parent == catalogue else ():
            if isinstance(node, ast.Assign) and isinstance(node.value, ast.Dict) and ast.unparse(node.targets[0]) == "MEANING":
                found |= {key.value for key in node.value.keys if isinstance(key, ast.Constant)}
    return found


def strings(tree: ast.Module, words: set[str]) -> Iterator[int]:
    """Lines of strings that are one of some words."""
    return (node.lineno for node in ast.walk(tree) if isinstance(node, ast.Constant) and node.value in words)


def budget(name: str) -> str:
    """Which budget a file of the runtime counts for."""
    if name in ELEMENTARY:
        return "elementary lines"
    kinds = {"pen_xcp": "wire protocol lines", "pen_ekf": "filter lines", "pen_monitor": "monitor lines"}
    return next((kind for start, kind in kinds.items() if name.startswith(start)), "runtime lines")


def look(root: Path) -> tuple[dict[str, int], Found]:
    """The counts, and what each of them is made of."""
    found: Found = {kind: [] for kind in (*RATCHETS, *BUDGETS)}
    found["crowded folders"] = crowded(root)
    files = sources(root)
    trees = {path: ast.parse(path.read_text()) for path in files if path.suffix == ".py"}
    runtime = dict.fromkeys(BUDGETS, 0)
    catalogue = root / "sil" / "penode_sil" / "diagnosis" / "catalogue"
    kinds = causes(trees, catalogue)
    for path in files:
        name, text = path.relative_to(root).as_posix(), path.read_text()
        lines = text.count("\n")
        if lines > FILE_LINES:
            found["long files"].append(f"{name}: {lines} lines")
        found["silenced lines"] += [f"{name}:{n}" for n, line in enumerate(text.splitlines(), 1) if SILENCED.search(line)]
        functions = c_functions(text) if path.suffix in {".c", ".h"} else python_functions(trees[path]) if path in trees else ()
        found["long functions"] += [f"{name}:{first}: {n} lines" for first, n in functions if n > FUNCTION_LINES]
        if name.startswith("sil/penode_sil/") and path.suffix == ".py":
            kind = TABLE if name.endswith("training/settings.py") else "named thresholds"
            found[kind] += [f"{name}:{line}" for line in thresholds(trees[path])]
            found["tabled numbers"] += [f"{name}:{line}" for line in tabled(trees[path])]
            found["compared numbers"] += [f"{name}:{line}" for line in compared(trees[path])]
            found["named causes"] += [f"{name}:{line}" for line in strings(trees[path], kinds) if path.parent != catalogue]
        if name.startswith(("inc/penode/", "src/")):
            runtime[budget(path.name)] += lines
    for package in ("gen/penode_gen", "sil/penode_sil"):
        if (root / package).is_dir():
            found["circular imports"] += circular(python_imports(trees, root / package))
    found["circular imports"] += circular(header_includes(files))
    counts = {kind: len(items) for kind, items in found.items()}
    return counts | {kind: n for kind, n in runtime.items() if kind != TABLE}, found


def compare(kept: dict[str, int], counts: dict[str, int], found: Found) -> list[str]:
    """What is wrong, with the remedy; empty if nothing is."""
    problems = [] if kept.keys() == counts.keys() else [f"structure.json must hold just {', '.join(counts)}"]
    for kind, count in counts.items():
        limit = kept.get(kind, count)
        if count > limit:
            problems.append("\n  ".join([f"{kind}: {count}, at most {limit}; split what is new:", *found[kind]]))
        elif count < limit and kind not in BUDGETS:
            problems.append(f"{kind}: {count}, kept {limit}; run `make structure` to take over what has been gained")
    return problems


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--take-over", action="store_true", help="write the counts that have fallen")
    parser.add_argument("--root", type=Path, default=ROOT, help="folder of the project")
    chosen = parser.parse_args(arguments)
    kept_at = chosen.root / "test" / "tools" / "structure.json"
    kept = json.loads(kept_at.read_text())
    counts, found = look(chosen.root)
    if chosen.take_over:
        kept = {kind: min(count, kept.get(kind, count)) for kind, count in counts.items()}
        kept_at.write_text(json.dumps(kept, indent=1) + "\n")
    for kind, count in counts.items():
        print(f"{kind:20}{count:6}")
    problems = compare(kept, counts, found)
    print("\n".join(problems), file=sys.stderr)
    return int(bool(problems))


if __name__ == "__main__":
    sys.exit(main())
