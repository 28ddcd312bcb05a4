# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The picture of a diagnosis in README.md: the top of its report and the missing force at the first place, by headless Chromium."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

BROWSERS = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
WIDTH, HEIGHT = 1120, 1600  # CSS pixels of the window; the empty rest below the figures is cut off
SCALE = 1.5  # pixels of the picture per CSS pixel
MARGIN = 24  # pixels left below the last figure
SHOWN = """<style>
header nav, header h3, header ol, header ul, main > section:not(#forces), footer { display: none }
#forces > *, #forces figure:not(:nth-child(3)):not(:nth-child(4)) { display: none }
#forces > .figures:first-of-type { display: grid }
body { padding-bottom: 0 }
</style>
"""


def browser() -> str | None:
    """The first of BROWSERS that is installed."""
    return next(filter(shutil.which, BROWSERS), None)


def screenshot(page: Path, picture: Path) -> str:
    """Write `picture` from the report `page`; leave it alone where no browser is installed. Return a line that says which."""
    program = browser()
    if program is None:
        return f"{picture.name} is kept as it is: none of {', '.join(BROWSERS)} is installed"
    with tempfile.TemporaryDirectory() as folder:
        html, png = Path(folder) / "page.html", Path(folder) / "page.png"
        html.write_text(page.read_text(encoding="utf-8").replace("</head>", SHOWN + "</head>", 1), encoding="utf-8")
        options = ["--no-sandbox", "--hide-scrollbars", f"--force-device-scale-factor={SCALE}", f"--window-size={WIDTH},{HEIGHT}"]
        subprocess.run([program, "--headless", *options, f"--screenshot={png}", html.as_uri()], check=True, capture_output=True, timeout=60)
        pixels = np.asarray(Image.open(png).convert("RGB"))
    drawn = np.flatnonzero((pixels != pixels[-1, -1]).any(axis=(1, 2)))
    Image.fromarray(pixels[: drawn[-1] + 1 + MARGIN]).save(picture, optimize=True)
    return f"{picture.name}: made from {page.name} by {program}"
