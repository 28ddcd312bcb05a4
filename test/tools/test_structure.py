# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The counts of structure.py may only fall; and what it counts is counted."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))

import structure  # needs the path above

LONG_C = "int f(void)\n{\n" + "    g(); /* } */ h('}', \"}\");\n" * 59 + "    return 0;\n}\n"


def test_project_has_not_become_harder_to_change() -> None:
    kept = json.loads((structure.ROOT / "test" / "tools" / "structure.json").read_text())
    counts, found = structure.look(structure.ROOT)
    assert not structure.compare(kept, counts, found), "\n".join(structure.compare(kept, counts, found))


def test_a_folder_of_many_files_is_counted_once(tree: Path) -> None:
    for k in range(structure.FOLDER_FILES):
        (tree / "src" / f"data{k}.csv").write_text("")
    assert structure.crowded(tree) == []
    for k in range(structure.FOLDER_FILES):
        (tree / "src" / f"more{k}.c").write_text("")
    assert structure.crowded(tree) == [f"src: {structure.FOLDER_FILES + 3} files"]


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A small project whose counts are kept: one long file, nothing else."""
    for name, text in {
        "src/a.c": "int f(void)\n{\n    return 0;\n}\n",
        "src/long.c": "\n" * 401,
        "src/pen_xcp_a.c": "\n" * 5,
        "inc/penode/a.h": '#include "penode/b.h"\nextern "C" {\nint f(void);\n}\n',
        "inc/penode/b.h": "int g(void);\n",
        "gen/model/c/generated.c": "\n" * 500,
        "gen/penode_gen/__init__.py": "from penode_gen import one\n",
        "gen/penode_gen/one.py": "import penode_gen.two\n",
        "gen/penode_gen/two.py": "",
        "sil/penode_sil/one.py": "LIMIT = 3.0\nNAME = 'play'\n",
        "sil/penode_sil/diagnosis/catalogue/plays.py": "MEANING = {'play': 'x'}\nKINDS = ('play',)\n",
        "test/tools/structure.json": "{}",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    (tmp_path / "test/tools/structure.json").write_text(json.dumps(structure.look(tmp_path)[0]))
    return tmp_path


def test_counts_of_a_small_tree(tree: Path) -> None:
    counts = {
        "long files": 1,
        "long functions": 0,
        "circular imports": 0,
        "silenced lines": 0,
        "crowded folders": 0,
        "named thresholds": 1,
        "tabled numbers": 0,
        "compared numbers": 0,
        "named causes": 1,
        "settings of training": 0,
        "runtime lines": 410,
        "elementary lines": 0,
        "wire protocol lines": 5,
        "filter lines": 0,
        "monitor lines": 0,
    }
    assert structure.look(tree)[0] == counts
    assert structure.main(["--root", str(tree)]) == 0


# Each a fault: a file, what is put at its end, and the count that must be named.
@pytest.mark.parametrize(
    ("name", "text", "kind"),
    [
        ("sil/firmware/more.h", "\n" * 401, "long files"),
        ("gen/penode_gen/emission/templates/more.c.j2", "\n" * 401, "long files"),
        ("test/more.mk", "\n" * 401, "long files"),
        ("sil/firmware/more.c", LONG_C, "long functions"),
        ("sil/firmware/more.h", f'extern "C" {{\n{LONG_C}}}\n', "long functions"),
        ("gen/penode_gen/one.py", "class A:\n    def f(self):\n" + "        pass\n" * 60, "long functions"),
        ("gen/penode_gen/two.py", "def f():\n    from .one import g\n", "circular imports"),
        ("gen/penode_gen/two.py", "from penode_gen import one\n", "circular imports"),
        ("inc/penode/b.h", '#include "penode/a.h"\n', "circular imports"),
        ("sil/penode_sil/one.py", "MORE: float = -2 / 3\n", "named thresholds"),
        ("sil/penode_sil/rules.py", "class Rules:\n    more: float = 0.5  # of an interval\n", "named thresholds"),
        ("gen/penode_gen/two.py", "import os  # noqa: F401\n", "silenced lines"),
        ("sil/penode_sil/one.py", "SIZES = (3, {'a': 0.5})\n", "tabled numbers"),
        ("sil/penode_sil/one.py", "def f(x):\n    return 0 < x < 0.3 * f(x)\n", "compared numbers"),
        ("sil/penode_sil/two.py", "def f(kind):\n    return kind == 'play'\n", "named causes"),
        ("sil/penode_sil/training/settings.py", "class Settings:\n    more: float = 0.5\n", "settings of training"),
        ("src/a.c", "\n", "runtime lines"),
        ("src/pen_log.c", "\n", "elementary lines"),
        ("src/pen_xcp_a.c", "\n", "wire protocol lines"),
        ("src/pen_ekf.c", "\n", "filter lines"),
    ],
)
def test_one_more_is_refused(tree: Path, name: str, text: str, kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    (tree / name).parent.mkdir(parents=True, exist_ok=True)
    with open(tree / name, "a") as file:
        file.write(text)
    for arguments in ([], ["--take-over"], []):  # what has risen is not taken over
        assert structure.main(["--root", str(tree), *arguments]) == 1
        assert f"{kind}: " in capsys.readouterr().err


def test_one_less_is_taken_over_and_stays(tree: Path, capsys: pytest.CaptureFixture[str]) -> None:
    long = (tree / "src/long.c").read_text()
    (tree / "src/long.c").write_text("")
    assert structure.main(["--root", str(tree)]) == 1
    assert "make structure" in capsys.readouterr().err
    assert structure.main(["--root", str(tree), "--take-over"]) == 0
    (tree / "src/long.c").write_text(long)
    assert structure.main(["--root", str(tree)]) == 1


def test_budget_may_be_left_unused(tree: Path) -> None:
    (tree / "src/a.c").write_text("\n")
    assert structure.main(["--root", str(tree)]) == 0


def test_what_is_linked_counts_once(tree: Path) -> None:
    counts = structure.look(tree)[0]
    (tree / "gen/penode_gen/native").mkdir()
    (tree / "gen/penode_gen/native/src").symlink_to(tree / "src")
    (tree / "gen/penode_gen/native/long.c").symlink_to(tree / "src/long.c")
    assert structure.look(tree)[0] == counts


@pytest.mark.parametrize(
    ("text", "lengths"),
    [
        ("static int a[] = { 1, 2 };\nint f(void)\n{\n    if (a) {\n    }\n}\nint g(void) { return 1; }\n", [4, 1]),
        ("#define A { \\\n    {\nint f(void) /* { */\n{\n}\n", [2]),
        ("struct a {\n    int b;\n};\n", []),
        (LONG_C, [62]),
    ],
)
def test_functions_of_c(text: str, lengths: list[int]) -> None:
    assert [n for _, n in structure.c_functions(text)] == lengths


def test_each_folder_of_modules_is_a_package() -> None:
    """setuptools finds packages by their __init__.py; a folder without one works from a checkout alone."""
    for package in ("gen/penode_gen", "sil/penode_sil"):
        folders = {path.parent for path in (structure.ROOT / package).rglob("*.py")}
        assert [f for f in folders if not (f / "__init__.py").exists()] == []
