# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The Windows binary of FMUs: what it exports and needs, the same bytes, and that it computes the same in Wine (make python-long)."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from case_study import ROOT, chirp
from master import Unpacked

from penode_gen.exports.fmi import files as fmu_files
from penode_gen.exports.fmi.functions import functions
from penode_sil.schedule import Call
from penode_sil.targets import Sil

COMPILER, READER = "x86_64-w64-mingw32-gcc", "x86_64-w64-mingw32-objdump"
SYSTEM = {"KERNEL32.dll", "msvcrt.dll"}  # every Windows has them
pytestmark = pytest.mark.skipif(
    shutil.which(COMPILER) is None or shutil.which(READER) is None, reason=f"{COMPILER} is not installed: no Windows binary is checked"
)


def library_of(unpacked: Unpacked) -> Path:
    """The Windows binary, at the place that the standard gives it."""
    folder = {3: "x86_64-windows", 2: "win64"}[unpacked.version]
    return unpacked.folder / "binaries" / folder / f"{unpacked.description.coSimulation.modelIdentifier}.dll"


def problems(library: Path, version: int) -> list[str]:
    """What is wrong with the tables of a library."""
    text = subprocess.run([READER, "-p", library], capture_output=True, text=True, check=True).stdout
    exported = set(re.findall(r"^\s*\[ *\d+\] (?:\+base\[ *\d+\] +\w+ )?(\w+)$", text.partition("[Ordinal/Name Pointer] Table")[2], re.M))
    needed = set(re.findall(r"DLL Name: (\S+)", text))
    stamps = {
        stamp
        for stamp in re.findall(r"^Time/Date(?: stamp)?\s+(.+)", text, re.M)
        if stamp not in ("0", "00000000", "Thu Jan  1 00:00:00 1970")
    }
    standard = {f.name for f in functions(version)}
    found = [f"not exported: {name}" for name in standard - exported] + [f"not of the standard: {name}" for name in exported - standard]
    return found + [f"needs {name}" for name in needed - SYSTEM] + [f"time stamp {stamp}" for stamp in stamps]


def build(sources: Path, folder: Path, version: int, output: str = "made.dll", **changed: str) -> bytes:
    """The Windows binary of the sources in a folder, some of them changed, with the options of the export."""
    texts = {path.name: path.read_text() for path in sources.iterdir() if path.suffix in (".c", ".h")} | changed
    for name, text in texts.items():
        folder.joinpath(name).write_text(text)
    _, _, more = fmu_files._COMPILERS["x86_64-windows"]
    files = sorted(name for name in texts if name.endswith(".c"))
    command = [COMPILER, *fmu_files._FLAGS, *more, f"-DFMI{version}_OVERRIDE_FUNCTION_PREFIX", *files, "-o", output]
    subprocess.run(command, cwd=folder, check=True)
    return (folder / output).read_bytes()


def test_it_exports_the_functions_of_the_standard_and_needs_windows_alone(unpacked: Unpacked) -> None:
    assert problems(library_of(unpacked), unpacked.version) == []
    assert unpacked.description.guid.encode() in library_of(unpacked).read_bytes()
    page = (unpacked.folder / "documentation" / "index.html").read_text()
    assert f"{library_of(unpacked).parent.name.replace('win64', 'x86_64-windows')}" in page.split("<h2>Binaries</h2>")[1].split(";")[0]


def test_faults_of_a_binary_are_found(unpacked: Unpacked, tmp_path: Path) -> None:
    """Seeded: a function too many, one too few, a clock in the file."""
    sources, version = unpacked.folder / "sources", unpacked.version
    name = f"fmi{version}.c"
    text = (sources / name).read_text()
    build(sources, tmp_path, version, **{name: text + "\n__declspec(dllexport) int helper(void);\nint helper(void)\n{\n    return 1;\n}\n"})
    assert problems(tmp_path / "made.dll", version) == ["not of the standard: helper"]
    renamed = {
        file: path.read_text().replace(f"fmi{version}Reset", "fmiReset")
        for file in (name, f"fmi{version}_api.h")
        if (path := sources / file)
    }
    build(sources, tmp_path, version, **renamed)
    assert sorted(problems(tmp_path / "made.dll", version)) == [f"not exported: fmi{version}Reset", "not of the standard: fmiReset"]
    files = [str(path) for path in sources.glob("*.c")]
    subprocess.run(
        [COMPILER, "-shared", "-O0", f"-DFMI{version}_OVERRIDE_FUNCTION_PREFIX", "-o", tmp_path / "clock.dll", *files], check=True
    )
    assert any(line.startswith("time stamp") for line in problems(tmp_path / "clock.dll", version))


def test_the_same_sources_give_the_same_bytes(unpacked: Unpacked, tmp_path: Path) -> None:
    """From another folder, at another time."""
    (tmp_path / "other").mkdir()
    library = library_of(unpacked)
    assert build(unpacked.folder / "sources", tmp_path / "other", unpacked.version, output=library.name) == library.read_bytes()


@pytest.mark.long
@pytest.mark.skipif(shutil.which("wine64") is None, reason="wine64 is not installed: the Windows binary is not run")
def test_it_computes_the_same_in_wine(unpacked: Unpacked, held: Any, tmp_path: Path) -> None:
    """A minute of the chirp with a set selected at 2 s, from a master that is a Windows program: equal to the bit to SiL with held
    inputs."""
    version, refer = unpacked.version, unpacked.reference
    master = tmp_path / "master.exe"
    source = Path(__file__).with_name("windows_master.c")
    subprocess.run(
        [
            COMPILER,
            "-std=c99",
            "-O2",
            "-Wall",
            "-Werror",
            f"-DFMI_VERSION={version}",
            f"-I{unpacked.folder / 'sources'}",
            source,
            "-o",
            master,
        ],
        check=True,
    )
    u = chirp(60.0)
    u[:-1].astype("<f8").tofile(tmp_path / "in.bin")
    prefix = Path(os.environ.get("WINEPREFIX", ROOT / "build" / "wine"))  # kept: to make it takes 10 s
    prefix.parent.mkdir(exist_ok=True)
    words = [unpacked.description.guid, *(refer[n] for n in ("z_road", "parameter_set", "z_b", "z_w")), 2000, 2, "in.bin", "out.bin"]
    environment = os.environ | {"WINEPREFIX": str(prefix), "WINEDEBUG": "-all", "WINEDLLOVERRIDES": "mscoree,mshtml,winemenubuilder="}
    done = subprocess.run(["wine64", str(master), str(library_of(unpacked)), *map(str, words)], cwd=tmp_path, env=environment, timeout=300)
    assert done.returncode == 0, f"windows_master.c, line {done.returncode}"
    found = np.fromfile(tmp_path / "out.bin", "<f8").reshape(-1, 2)
    assert np.array_equal(found, Sil(held).run(u, [Call(2001, "select", set="altered_friction")]).y)
