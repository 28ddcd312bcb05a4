# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The pages for users of other tools: each command and each line of Python on them is run; what is not tried says so."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from case_study import ROOT

import penode_gen

PAGES = sorted((ROOT / "gen" / "howto").glob("*.md"))
TOOLS = {"DYMOLA": "Dymola", "SIMULINK_CARMAKER": "Simulink", "OPENMODELICA": "OpenModelica"}  # installed nowhere here


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", page.read_text(), re.S)


def run(page: Path, folder: Path) -> None:
    """The commands of a page, in a folder with the checkout's gen/ and test/."""
    for name in ("gen", "test"):
        (folder / name).symlink_to(ROOT / name)
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    commands = blocks(page, "sh")
    assert commands, page
    for block in commands:
        done = subprocess.run(["bash", "-euc", block], cwd=folder, env=os.environ | {"PATH": path}, capture_output=True, text=True)
        assert done.returncode == 0, f"{page.name}: {block}\n{done.stdout}{done.stderr}"


@pytest.mark.skipif(importlib.util.find_spec("fmpy") is None, reason="FMPy is not installed: pip install penode[fmi]")
def test_the_page_for_fmpy(nqvm: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    page = ROOT / "gen" / "howto" / "FMPY.md"
    run(page, tmp_path)
    monkeypatch.chdir(tmp_path)
    space: dict[str, Any] = {}
    for block in blocks(page, "python"):
        exec(block, space)
    assert space["result"]["set_id"][-1] == penode_gen.set_head(nqvm, "altered_friction")[2] and "body height" in capsys.readouterr().out
    assert space["result"]["z_b"][0] == np.float32(0.02) and len(space["result"]) > 100
    assert space["set_id"] == 1000 and 0.001 < space["z_b"] < 0.03  # a road of 0.01 m


@pytest.mark.long
@pytest.mark.skipif(importlib.util.find_spec("rumoca") is None, reason="rumoca is not installed: pip install penode[modelica]")
@pytest.mark.parametrize("page", [p for p in PAGES if p.stem in TOOLS], ids=lambda p: p.stem)
def test_the_commands_of_the_other_pages(page: Path, tmp_path: Path) -> None:
    run(page, tmp_path)


def test_what_is_not_tried_says_so() -> None:
    """A point about a tool that does not run here is marked, unless it is about penode's own part."""
    assert {p.stem for p in PAGES} == {*TOOLS, "FMPY"}
    for page in PAGES:
        text = page.read_text()
        assert (text.count("(not tried") >= 2) == (page.stem in TOOLS), page.name
        assert f"howto/{page.name}" in (ROOT / "gen" / "EXPORTS.md").read_text()
