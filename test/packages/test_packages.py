# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Each package has all of the runtime and computes the bits of the repository; what is left out of one is noticed."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import build
import pytest
import yaml
from build import PACKAGES, ROOT, VERSION, Built, Fails, run


@pytest.mark.parametrize("package", PACKAGES)
def test_package_computes_the_same(package: str, tree: Path, tmp_path: Path, reference: Built):
    assert reference.said.endswith("good\n")
    assert PACKAGES[package](tree, tmp_path) == reference


def test_double_and_a_port_of_ones_own(tree: Path, tmp_path: Path):
    port = tmp_path / "my port"
    shutil.copytree(tree / f"penode-{VERSION}" / "port" / "template", port)
    (tmp_path / "reference").mkdir()
    built = build.subdirectory(tree, tmp_path, "-DPEN_REAL_DOUBLE=ON", f"-DPENODE_PORT={port}")
    assert built == build.reference(tmp_path / "reference", double=True)
    (tmp_path / "nowhere").mkdir()
    with pytest.raises(Fails, match=r"PENODE_PORT=nowhere: there is no pen_port_target\.h"):
        build.subdirectory(tree, tmp_path / "nowhere", "-DPENODE_PORT=nowhere")


# -- what is left out of a package is noticed -------------------------------------------------------------------------


def edit(file: str, pattern: str, by: str = "") -> Callable[[Path], None]:
    """Replace in a file of the packages; the pattern must be there."""

    def change(tree: Path) -> None:
        path = tree / file.replace("TREE", f"penode-{VERSION}")
        text, times = re.subn(pattern, by, path.read_text(encoding="utf-8"), flags=re.MULTILINE)
        assert times > 0, f"{file} has no {pattern}"
        path.write_text(text, encoding="utf-8")

    return change


def remove(file: str) -> Callable[[Path], None]:
    """Remove a file of the packages."""
    return lambda tree: (tree / file.replace("TREE", f"penode-{VERSION}")).unlink()


# Left out are files that the hash program could do without, where there is such a one.
FAULTS = {
    "subdirectory lacks a source": ("subdirectory", edit("TREE/CMakeLists.txt", r"^.*src/pen_solve\.c\n")),
    "subdirectory lacks a header": ("subdirectory", remove("TREE/inc/penode/pen_solve.h")),
    "subdirectory does not pass its include paths on": ("subdirectory", edit("TREE/CMakeLists.txt", r"\$<BUILD_INTERFACE:.*inc>")),
    "install lacks the headers": ("find_package", edit("TREE/CMakeLists.txt", r"^install\(DIRECTORY inc.*\n")),
    "install lacks the port": ("find_package", edit("TREE/CMakeLists.txt", r"^install\(DIRECTORY \"\$\{penode_port.*\n")),
    "pkg-config does not tell the port": ("pkg_config", edit("TREE/penode.pc.in", r" -I\S*/penode/port")),
    "tarball lacks a source": ("tarball", remove("TREE/src/pen_solve.c")),
    "tarball lacks a header": ("tarball", remove("TREE/inc/penode/pen_solve.h")),
    "penode.c lacks a source": ("amalgamated", edit("TREE-amalgamated/penode.c", r"(?s)/\* ==== pen_solve\.c.*?(?=/\* ====)")),
    "penode.h lacks a header": ("amalgamated", edit("TREE-amalgamated/penode.h", r"(?s)/\* ==== pen_serial\.h.*?(?=/\* ====)")),
    "library.json names no port": ("platformio", edit("TREE/library.json", r'"-I port/gnu", ')),
    "library.json names another folder": ("platformio", edit("TREE/library.json", r'"src"', '"models"')),
    "Zephyr lacks a source": ("zephyr", edit("TREE/zephyr/CMakeLists.txt", r"^.*src/pen_solve\.c\n")),
    "Zephyr does not pass its include paths on": ("zephyr", edit("TREE/zephyr/CMakeLists.txt", r"^.*zephyr_include_dir.*\n")),
    "Kconfig lacks an option": ("zephyr", edit("TREE/zephyr/Kconfig", r"^config PENODE_PORT\n.*\n.*\n.*\n.*\n.*\n")),
    "pdsc lacks a source": ("cmsis_pack", edit("TREE/penode.penode.pdsc", r"^.*src/pen_solve\.c.*\n")),
    "pdsc lacks a header": ("cmsis_pack", edit("TREE/penode.penode.pdsc", r"^.*inc/penode/pen_solve\.h.*\n")),
    "pdsc lists what is not there": ("cmsis_pack", remove("TREE/models/nqvm/nqvm_euler.c")),
    "a weight differs": ("tarball", edit("TREE/models/nqvm/nqvm.c", r"10000\.0", "10000.01")),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_fault_is_noticed(fault: str, tree: Path, tmp_path: Path, reference: Built):
    package, change = FAULTS[fault]
    shutil.copytree(tree, tmp_path / "tree")
    (tmp_path / "work").mkdir()
    change(tmp_path / "tree")
    try:
        built = PACKAGES[package](tmp_path / "tree", tmp_path / "work")
    except Fails:
        return
    assert built != reference, "not noticed"


# -- manifests --------------------------------------------------------------------------------------------------------

# Of Zephyr's documentation of modules: key, and what its value names in the module.
MODULE = {"cmake": "{}/CMakeLists.txt", "kconfig": "{}"}


def manifests(tree: Path, work: Path) -> list[str]:
    """Problems that the tools' own readers find."""
    python = ROOT / "build" / "packages" / "bin" / "python"
    return run([python, build.HERE / "manifests.py", tree / f"penode-{VERSION}", work / "Kconfig"]).splitlines()


def test_manifests(tree: Path, tmp_path: Path):
    assert manifests(tree, tmp_path) == []


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (edit("TREE/library.json", r'"version": ".*?"', '"version": "new"'), "version"),
        (edit("TREE/library.json", r'"name"', '"title"'), "name"),
        (edit("TREE/library.json", r'"keywords"', '"words"'), "words is no field"),
        (edit("TREE/zephyr/Kconfig", r"^\tstring", "\tstirng"), "Kconfig"),
        (edit("TREE/zephyr/Kconfig", r"^config PENODE_PORT", "config PENODE_PRT"), "Kconfig"),
    ],
)
def test_bad_manifest_is_noticed(change: Callable[[Path], None], problem: str, tree: Path, tmp_path: Path):
    shutil.copytree(tree, tmp_path / "tree")
    change(tmp_path / "tree")
    found = manifests(tmp_path / "tree", tmp_path)
    assert found and problem in "\n".join(found)


def test_zephyr_module(tree: Path):
    module = tree / f"penode-{VERSION}"
    read = yaml.safe_load((module / "zephyr" / "module.yml").read_text(encoding="utf-8"))
    assert set(read) == {"name", "build"} and read["name"] == "penode"
    assert set(read["build"]) == set(MODULE)
    for key, value in read["build"].items():
        assert (module / MODULE[key].format(value)).is_file()


def test_pack_description(tree: Path):
    """The rules of PACK.xsd that can be checked without it; with it (PACK_XSD names a copy) all of them."""
    from lxml import etree

    source = tree / f"penode-{VERSION}" / "penode.penode.pdsc"
    pack = etree.parse(source).getroot()
    assert source.name == f"{pack.findtext('vendor')}.{pack.findtext('name')}.pdsc"
    assert {"vendor", "name", "description", "url", "license", "releases"} <= {child.tag for child in pack}
    assert pack.find("releases/release").get("version") == VERSION
    known = {condition.get("id") for condition in pack.iter("condition")}
    seen = set()
    for component in pack.iter("component"):
        place = tuple(component.get(key) for key in ("Cclass", "Cgroup", "Csub"))
        assert place not in seen and component.get("Cversion") == VERSION
        assert component.get("condition") in {None, *known}
        seen.add(place)
    for needed in pack.iter("require"):
        assert any(needed.get("Cclass") == place[0] and needed.get("Cgroup") == place[1] for place in seen)
    assert {file["category"] for files in build.pack_files(source.parent).values() for file in files} == {
        "doc",
        "include",
        "header",
        "source",
    }
    if schema := os.environ.get("PACK_XSD"):
        etree.XMLSchema(etree.parse(schema)).assertValid(pack)


# -- the same bytes, without Python -----------------------------------------------------------------------------------


def digest(folder: Path) -> dict[str, str]:
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in folder.glob("*.tar.gz")}


def test_same_bytes_again(checkout: Path, dist: Path, no_python: dict[str, str]):
    """Also with other times, modes and umask, and when called from elsewhere."""
    first = digest(dist)
    assert set(first) == {f"penode-{VERSION}.tar.gz", f"penode-{VERSION}-amalgamated.tar.gz"}
    for path in (checkout / "src").glob("*.c"):
        path.touch()
        path.chmod(0o640)
    run(["sh", "-c", f"umask 077; {checkout}/port/packages/dist.sh again"], cwd=checkout.parent, env=no_python)
    assert digest(checkout.parent / "again") == first
    assert not (Path(no_python["PATH"].split(":")[0]) / "called").exists()
    assert run(["sh", "-c", "python3 || echo refused"], env=no_python) == "refused\n"
    shutil.rmtree(checkout.parent / "again")
