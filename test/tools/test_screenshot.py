# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The picture of the report in README.md: what it shows, and what happens without a browser."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "bench"))

import screenshot  # needs the path above

COLOURS = {
    "title": (255, 0, 0),
    "contents": (0, 255, 0),
    "first": (0, 0, 255),
    "third": (255, 255, 0),
    "fourth": (0, 255, 255),
    "later": (255, 0, 255),
}


def block(tag: str, name: str) -> str:
    red, green, blue = COLOURS[name]
    return f'<{tag}><div style="height: 100px; background: rgb({red}, {green}, {blue})"></div></{tag}>'


PAGE = f"""<!doctype html><html><head></head><body style="background: white">
<header>{block("h1", "title")}{block("nav", "contents")}</header>
<main><section id="wrong">{block("p", "contents")}</section><section id="forces">{block("h2", "later")}
<div class="figures">{"".join(block("figure", name) for name in ("first", "first", "third", "fourth", "later"))}</div>
<div class="figures">{block("figure", "later")}</div></section></main></body></html>"""


@pytest.mark.skipif(screenshot.browser() is None, reason=f"none of {', '.join(screenshot.BROWSERS)} is installed")
def test_picture_has_the_title_and_the_missing_force_and_ends_below_them(tmp_path):
    (tmp_path / "page.html").write_text(PAGE)
    assert "made from page.html" in screenshot.screenshot(tmp_path / "page.html", tmp_path / "page.png")
    pixels = np.asarray(Image.open(tmp_path / "page.png"))
    shown = {name for name, colour in COLOURS.items() if (pixels == colour).all(axis=2).any()}
    assert shown == {"title", "third", "fourth"}
    assert pixels.shape[1] == screenshot.SCALE * screenshot.WIDTH
    assert (pixels[-screenshot.MARGIN - 1] != 255).any() and (pixels[-screenshot.MARGIN :] == 255).all()


def test_without_a_browser_the_picture_is_kept_and_the_line_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr(screenshot, "BROWSERS", ("no-such-browser",))
    (tmp_path / "page.png").write_bytes(b"old")
    line = screenshot.screenshot(tmp_path / "page.html", tmp_path / "page.png")
    assert line == "page.png is kept as it is: none of no-such-browser is installed"
    assert (tmp_path / "page.png").read_bytes() == b"old"
