# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""gen/README.md is the reference of the model file: it must name all that there is."""

from pathlib import Path

import pytest

from penode_gen import model
from penode_gen.algebra import expressions
from penode_gen.laws import LAWS
from penode_gen.reading import model_file, tables

TEXT = (Path(__file__).resolve().parents[2] / "gen" / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("law", LAWS)
def test_every_law_with_its_arguments(law):
    row = next(line for line in TEXT.splitlines() if line.startswith("|") and f"`{law}`" in line)
    for argument in LAWS[law].arguments:
        assert argument in row


@pytest.mark.parametrize("word", [*model.METHODS, *model.INTERPOLATIONS, *model.OUTSIDE, *model_file.MODEL])
def test_every_choice_and_key_of_the_model(word):
    assert f"`{word}`" in TEXT or f"`{word} = " in TEXT


@pytest.mark.parametrize("section", tables.SECTIONS)
def test_every_section(section):
    assert f"`[{section}]`" in TEXT


def test_every_function():
    assert f"`+ - * / ^`, `der(x)`, `where(a < b, x, y)`, `{' '.join(expressions.FUNCTIONS)}`" in TEXT
