# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A wheel and an sdist of the checkout, and an environment in an empty folder that has the wheel and what it depends on."""

from __future__ import annotations

import shutil
import sys
import sysconfig
from pathlib import Path

import pytest

import penode_gen

sys.path.insert(0, str(Path(__file__).parent))
sys.path.append(str(Path(__file__).parents[1] / "training"))  # generator.py

import session  # needs the path above
from wheels import HERE, ROOT, Installed, build, install

SOURCES = ("gen/penode_gen", "sil/penode_sil", "sil/firmware", "inc", "src", "port")


@pytest.fixture(scope="session")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a checkout has of penode, without what was built there: an old build/lib would get into the wheel."""
    folder = tmp_path_factory.mktemp("checkout")
    for name in SOURCES:
        shutil.copytree(ROOT / name, folder / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, folder)
    return folder


@pytest.fixture(scope="session")
def wheel(tree: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build("wheel", tree, tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="session")
def sdist(tree: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build("sdist", tree, tmp_path_factory.mktemp("sdist"))


@pytest.fixture(scope="session")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Installed:
    """With the interpreter of the tests, and the packages of its environment."""
    return install(wheel, tmp_path_factory.mktemp("empty"), sys.executable, sysconfig.get_path("purelib"))


@pytest.fixture(scope="session")
def repository(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what the repository's own penode makes of the same."""
    assert Path(penode_gen.__file__).is_relative_to(ROOT)
    folder, model = tmp_path_factory.mktemp("repository"), str(ROOT / "gen" / "nqvm" / "nqvm.toml")
    for on in ("mil", "sil"):
        words = ["simulate", model, "--scenario", str(HERE / "exchange.toml"), "--on", on, "-o", str(folder / f"{on}.csv")]
        assert not session.answer(words)["error"]
    assert not session.answer(["export", model, "--format", "fmu3", "-o", str(folder / "nqvm.fmu3.fmu")])["error"]
    return folder
