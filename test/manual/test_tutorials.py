# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The tutorials and the how-to pages with commands, one by one: each prints what the page says, each file begins as the page says."""

from __future__ import annotations

import json
import re
from pathlib import Path

import jsonschema
import pytest
import schemas
from replay import COMMAND, ROOT, STEP, Step, replay

PAGES = {
    p.stem: p.read_text(encoding="utf-8")
    for folder in ("tutorials", "howto")
    for p in sorted((ROOT / "sil/manual" / folder).glob("*.md"))
    if folder == "tutorials" or "\nSave as `" in p.read_text(encoding="utf-8")
}
DIAGNOSING = [name for name, text in PAGES.items() if "\n    penode diagnose " in text]
MOST_COMMANDS = 8  # from a folder with a recording to a named cause


@pytest.fixture(scope="module", params=PAGES)
def done(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Step]]:
    """A page that was followed: its folder, and its steps."""
    folder = tmp_path_factory.mktemp(request.param)
    return folder, list(replay(PAGES[request.param], folder))


def test_everything_is_as_stated_on_the_page(done: tuple[Path, list[Step]]) -> None:
    assert len(done[1]) >= 4
    for step in done[1]:
        assert step.same, f"{step.what}: the page has\n{step.expected}\nbut there is\n{step.found}\nreplay.py --take-over rewrites the page"


@pytest.mark.parametrize("done", DIAGNOSING, indirect=True)
def test_what_was_written_fits_the_schema(done: tuple[Path, list[Step]]) -> None:
    file = done[0] / "answer/diagnosis.json"
    jsonschema.validate(json.loads(file.read_text(encoding="utf-8")), schemas.schema("diagnosis"))


@pytest.mark.parametrize("page", PAGES)
def test_nothing_is_left_out(page: str) -> None:
    """Each command and each fence of a page is a step, and the way to the cause is short."""
    text = PAGES[page]
    steps = list(STEP.finditer(text))
    assert sum(bool(m["command"]) for m in steps) == len(re.findall(f"^    {COMMAND}", text, re.MULTILINE))
    assert sum(bool(m["name"] or m["printed"] or m["holds"]) for m in steps) == text.count("\n```\n") == text.count("```") / 2
    before = text.split("The cause is named")[0]
    assert len(re.findall(r"^    (?:penode|python3|pip) ", before, re.MULTILINE)) <= MOST_COMMANDS


def test_a_changed_output_is_noticed() -> None:
    step = Step("penode x", (0, 0), "good, N s\nforce 9.01 N\n", "good, 3.2 s\nforce 9.01 N\n")
    assert step.same
    assert not Step("penode x", (0, 0), step.expected, step.found.replace("9.01", "9.02")).same
    assert not Step("penode x", (0, 0), step.expected, step.found + "more\n").same
    assert Step("a.toml ...", (0, 0), "[model]\n", "[model]\nname\n").same
