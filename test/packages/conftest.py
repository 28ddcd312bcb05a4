# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What `make dist` lays out, once for all tests, on a machine on which Python does not run."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

import build  # needs the path above
from build import ROOT, VERSION, Built, run

WORK = ROOT / "build" / "packages-test"


@pytest.fixture(scope="session")
def no_python() -> dict[str, str]:
    """An environment in which each call of Python fails, and leaves a trace."""
    folder = WORK / "no-python"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name in ("python", "python3", f"python{'.'.join(map(str, os.sys.version_info[:2]))}"):
        (folder / name).write_text(f"#!/bin/sh\ntouch {folder}/called\nexit 1\n")
        (folder / name).chmod(0o755)
    return {"PATH": f"{folder}:{os.environ['PATH']}"}


@pytest.fixture(scope="session")
def checkout(no_python: dict[str, str]) -> Path:
    """A fresh checkout with a distribution made in it: the tracked files and those about to be."""
    folder = WORK / "checkout"
    shutil.rmtree(folder, ignore_errors=True)
    names = run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT).split("\n")
    for name in filter(None, names):
        if (ROOT / name).is_file():  # not what is about to go
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, folder / name)
    run(["make", "dist"], cwd=folder, env=no_python)
    return folder


@pytest.fixture(scope="session")
def dist(checkout: Path) -> Path:
    """The folder that it made."""
    return checkout / "build" / "dist"


@pytest.fixture(scope="session")
def tree(dist: Path) -> Path:
    """The packages, unpacked."""
    folder = WORK / "unpacked"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    run(["tar", "xzf", dist / f"penode-{VERSION}.tar.gz", "-C", folder])
    run(["tar", "xzf", dist / f"penode-{VERSION}-amalgamated.tar.gz", "-C", folder])
    return folder


@pytest.fixture(scope="session")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Built:
    """What all packages have to be."""
    return build.reference(tmp_path_factory.mktemp("reference"))
