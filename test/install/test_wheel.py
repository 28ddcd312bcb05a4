# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a wheel and an sdist hold, and what they say of themselves."""

from __future__ import annotations

import os
import re
import tarfile
import zipfile
from email.message import Message
from email.parser import Parser
from importlib.metadata import version
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from wheels import ROOT, build

import penode_gen

INFO = f"penode-{penode_gen.VERSION}.dist-info"


@pytest.fixture(scope="module")
def metadata(wheel: Path) -> Message:
    with zipfile.ZipFile(wheel) as archive:
        return Parser().parsestr(archive.read(f"{INFO}/METADATA").decode())


def names(wheel: Path) -> set[str]:
    with zipfile.ZipFile(wheel) as archive:
        return set(archive.namelist())


def below(package: Path) -> set[str]:
    """All files of a package, through links."""
    return {
        Path(folder, file).relative_to(package.parent).as_posix()
        for folder, _, files in os.walk(package, followlinks=True)
        for file in files
    }


def test_the_wheel_holds_all_files_of_both_packages(tree: Path, wheel: Path) -> None:
    """The packages for firmware and the page about ports are for those who have a checkout."""
    expected = {
        name
        for name in below(tree / "gen" / "penode_gen") | below(tree / "sil" / "penode_sil")
        if not name.startswith(("penode_gen/native/port/packages/", "penode_gen/native/port/README.md"))
    }
    for part in (
        "inc/penode/pen_set.h",
        "src/pen_set.c",
        "port/gnu/pen_port_target.h",
        "port/cortex-m/cc",
        "sil/firmware/pil.c",
        "LICENSE",
    ):
        assert f"penode_gen/native/{part}" in expected
    own = {f"{INFO}/{name}" for name in ("METADATA", "WHEEL", "RECORD", "entry_points.txt", "top_level.txt", "licenses/LICENSE")}
    assert names(wheel) == expected | own


def test_the_sdist_makes_the_same_wheel(sdist: Path, wheel: Path, tmp_path: Path) -> None:
    with tarfile.open(sdist) as archive:
        assert not [member.name for member in archive if member.issym() or member.islnk()]
        archive.extractall(tmp_path, filter="data")
    (unpacked,) = tmp_path.iterdir()
    (tmp_path / "made").mkdir()
    again = build("wheel", unpacked, tmp_path / "made")
    with zipfile.ZipFile(wheel) as first, zipfile.ZipFile(again) as second:
        assert sorted(first.namelist()) == sorted(second.namelist())
        for name in first.namelist():
            assert first.read(name) == second.read(name), name


def test_metadata(metadata: Message) -> None:
    assert metadata["Version"] == penode_gen.VERSION
    assert metadata["License-Expression"] == "MIT" and metadata["License-File"] == "LICENSE"
    assert metadata["Requires-Python"] == ">=3.11"
    assert metadata["Description-Content-Type"] == "text/markdown" and metadata.get_payload().lstrip().startswith("# penode")


def test_extras_that_are_advised_exist(metadata: Message) -> None:
    """Pages and messages say pip install penode[xcp]; the environment of the tests has all that extras ask for."""
    pages = [ROOT / "README.md", *(path for part in ("gen", "sil") for kind in ("md", "py") for path in ROOT.glob(f"{part}/**/*.{kind}"))]
    advised = {
        extra
        for path in pages
        for extras in re.findall(r"pip install '?(?:penode|\.)\[([\w,]+)\]", path.read_text(encoding="utf-8"))
        for extra in extras.split(",")
    }
    offered = set(metadata.get_all("Provides-Extra", []))
    assert {"cluster", "modelica", "xcp"} <= advised <= offered
    for text in metadata.get_all("Requires-Dist", []):
        need = Requirement(text)
        assert need.name == "penode" or need.specifier.contains(version(need.name)), text


def test_the_version_stands_in_one_file() -> None:
    """The header of the runtime has it for C, where nothing is read from Python; README and changelog name it."""
    header = (ROOT / "inc" / "penode" / "pen_real.h").read_text()
    assert re.findall(r'#define PEN_VERSION +"(.*)"', header) == [penode_gen.VERSION]
    assert f"penode-{penode_gen.VERSION}.tar.gz" in (ROOT / "port" / "README.md").read_text()
    assert re.findall(r"^## ([\d.]+)", (ROOT / "CHANGELOG.md").read_text(), re.M)[0] == penode_gen.VERSION
    written = [
        path.relative_to(ROOT).as_posix()
        for path in [ROOT / "pyproject.toml", *ROOT.glob("gen/penode_gen/**/*.py"), *ROOT.glob("sil/penode_sil/**/*.py")]
        if f'"{penode_gen.VERSION}"' in path.read_text(encoding="utf-8")
    ]
    assert written == ["gen/penode_gen/version.py"]
