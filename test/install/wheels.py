# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Build wheels and sdists, and install a wheel into an environment in an empty folder."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]


def run(words: list[object], cwd: Path, env: dict[str, str] | None = None) -> str:
    """The stdout of a command that has to succeed."""
    done = subprocess.run([str(word) for word in words], cwd=cwd, env=env, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    assert done.returncode == 0, f"{words}\n{done.stdout[-3000:]}{done.stderr[-3000:]}"
    return done.stdout


def build(what: str, tree: Path, folder: Path) -> Path:
    """The "wheel" or the "sdist" of a source tree, by its build backend, as pip calls it."""
    code = f"import sys, setuptools.build_meta as backend; print(backend.build_{what}(sys.argv[1]))"
    return folder / run([sys.executable, "-c", code, folder], tree).split()[-1]


@dataclass
class Installed:
    """An environment, and a folder to work in that has models and recordings and is in no checkout."""

    python: Path
    place: Path
    home: Path

    @property
    def env(self) -> dict[str, str]:
        """Variables without those that lead to the checkout."""
        kept = {k: v for k, v in os.environ.items() if not k.startswith(("PENODE", "PYTHON", "XDG"))}
        return kept | {"HOME": str(self.home)}

    @property
    def cache(self) -> Path:
        return self.home / ".cache" / "penode"

    def session(self, commands: dict[str, list[str]]) -> dict:
        """The answers of session.py."""
        (self.place / "commands.json").write_text(json.dumps(commands))
        run([self.python, HERE / "session.py", "commands.json", "answers.json"], self.place, self.env)
        return json.loads((self.place / "answers.json").read_text())


def install(wheel: Path, folder: Path, python: str, packages: str) -> Installed:
    """An environment of an interpreter below `folder`; `packages`: folder with what the wheel depends on."""
    run([python, "-m", "venv", "--without-pip", folder / "venv"], folder)
    ours = Installed(folder / "venv" / "bin" / "python", folder / "place", folder / "home")
    ours.home.mkdir()
    run([sys.executable, "-m", "pip", "--python", ours.python, "install", "-q", "--no-deps", "--no-index", "--no-compile", wheel], folder)
    (site,) = (folder / "venv").glob("lib/python*/site-packages")
    (site / "dependencies.pth").write_text(packages + "\n")  # .pth files in there, such as that of an editable penode, are not read
    for path in (site / "penode_gen" / "native").rglob("*"):
        path.chmod(0o755 if path.is_dir() else 0o644)  # as an installer leaves it that keeps no modes
    ours.place.mkdir()
    for name in ("gen/nqvm/nqvm.toml", "test/training/quarter.toml", "test/install/exchange.toml", "test/exports/modelica/Translation.mo"):
        shutil.copy(ROOT / name, ours.place)
    shutil.copytree(ROOT / "gen/nqvm/networks", ours.place / "networks")
    shutil.copytree(ROOT / "sil/recordings/friction", ours.place / "friction")
    return ours
