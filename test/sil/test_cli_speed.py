# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Help comes at once: it is not what penode computes with that it loads."""

from __future__ import annotations

import json
import os
import resource
import statistics
import subprocess
import sys
from collections.abc import Callable, Sequence

import pytest
from places import ROOT

from penode_sil.cli import COMMANDS, cli

HEAVY = ["asammdf", "jinja2", "matplotlib", "numpy", "onnx", "pandas", "pint", "rich", "scipy", "sympy"]
ENVIRONMENT = os.environ | {"PYTHONPATH": f"{ROOT / 'gen'}:{ROOT / 'sil'}"}


def seconds(words: Sequence[str], count: int) -> float:
    """Processor time of a process, the median of several."""

    def used() -> float:
        children = resource.getrusage(resource.RUSAGE_CHILDREN)
        return children.ru_utime + children.ru_stime

    spent = []
    for _ in range(count):
        before = used()
        subprocess.run([sys.executable, *words], env=ENVIRONMENT, stdout=subprocess.DEVNULL, check=True)
        spent.append(used() - before)
    return statistics.median(spent)


def test_help_takes_no_longer_than_four_imports_of_click(show: Callable[[str], None]) -> None:
    click = seconds(["-c", "import click"], 5)
    calls = [["--help"], ["--version"], *([name, "--help"] for name in COMMANDS)]
    spent = {" ".join(words): seconds(["-m", "penode_sil", *words], 3) for words in calls}
    worst = max(spent, key=lambda call: spent[call])
    show(f"penode {worst}: {spent[worst]:.3f} s, import click: {click:.3f} s")
    assert spent[worst] <= 4.0 * click, spent


LOADED = """
import json, sys
from penode_sil.cli import cli
for words in sys.argv[1:]:
    cli.main(words.split(), standalone_mode=False)
print(json.dumps(sorted(sys.modules)))
"""


def loaded(*calls: str) -> set[str]:
    """The modules that calls of the command have imported at their end."""
    done = subprocess.run([sys.executable, "-c", LOADED, *calls], env=ENVIRONMENT, capture_output=True, text=True, check=True)
    return set(json.loads(done.stdout.splitlines()[-1]))


def test_help_loads_nothing_heavy() -> None:
    assert not any("commands" in module for module in loaded("--help", "--version"))
    modules = loaded(*(f"{name} --help" for name in COMMANDS))
    assert not modules & set(HEAVY) and {f"penode_sil.commands.{of.partition(':')[0]}" for of, _ in COMMANDS.values()} <= modules


@pytest.mark.parametrize("name", COMMANDS)
def test_the_list_has_a_whole_line_for_each_command(name: str) -> None:
    command = cli.get_command(cli.make_context("penode", [name]), name)
    assert command is not None and command.name == name and command.help is not None
    assert len(COMMANDS[name][1]) <= 60 and COMMANDS[name][1].endswith(".")


def test_penode_gen_has_all_it_lists() -> None:
    code = "import sys, penode_gen; assert 'numpy' not in sys.modules; print(all(getattr(penode_gen, n) for n in penode_gen.__all__))"
    done = subprocess.run([sys.executable, "-c", code], env=ENVIRONMENT, capture_output=True, text=True, check=True)
    assert done.stdout == "True\n"
