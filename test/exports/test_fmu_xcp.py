# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""FMI-LS-XCP: the A2L in an FMU names the memory of its binary, which an importer's XCP slave reads and writes while it runs."""

from __future__ import annotations

import ctypes
import importlib.util
import subprocess
import sys
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from case_study import chirp
from master import ERROR, WARNING, Master, Unpacked, export

import penode_gen
from penode_gen import exports
from penode_gen.sets import layout
from penode_sil.calibration import a2l_read
from penode_sil.schedule import Call
from penode_sil.targets import Sil

A2LTOOL = Path(sys.executable).with_name("a2ltool")
FOLDER = "extra/org.fmi-standard.fmi-ls-xcp"
SPACE = "{http://fmi-standard.org/fmi-ls-manifest}"
TARGET = {3: "x86_64-linux", 2: "linux64"}
STEP, SET = 1e-3, "altered_friction"

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("elftools") is None or importlib.util.find_spec("fmpy") is None,
    reason="pyelftools or FMPy is not installed: pip install penode[xcp,fmi]",
)


@pytest.fixture(scope="module", params=[3, pytest.param(2, marks=pytest.mark.long)], ids=["FMI 3", "FMI 2"])
def opened(request: pytest.FixtureRequest, nqvm: Any, tmp_path_factory: pytest.TempPathFactory) -> Unpacked:
    folder = tmp_path_factory.mktemp("xcp")
    path = export(nqvm, request.param, folder, xcp=True)
    made = Unpacked(path, folder / "unpacked")
    made.path = path
    return made


def a2l(opened: Unpacked, target: str = "") -> a2l_read.A2l:
    return a2l_read.parse((opened.folder / FOLDER / target / "nqvm.a2l").read_text(), "a2l")


def loaded_at(name: str) -> int:
    """Where the dynamic loader has put a shared library."""
    maps = [line.split() for line in Path("/proc/self/maps").read_text().splitlines() if line.endswith(name)]
    return min(int(words[0].split("-")[0], 16) - int(words[2], 16) for words in maps)


class Memory:
    """What an importer's XCP slave does: numbers at the addresses of the A2L."""

    def __init__(self, opened: Unpacked):
        self.base = loaded_at(str(next((opened.folder / "binaries").rglob("*.so"))))

    def read(self, entry: a2l_read.Entry) -> np.ndarray:
        return np.frombuffer(ctypes.string_at(self.base + entry.address, entry.size), entry.type)

    def write(self, entry: a2l_read.Entry, values: np.ndarray) -> None:
        ctypes.memmove(self.base + entry.address, np.ascontiguousarray(values, entry.type).tobytes(), entry.size)


def stage(memory: Memory, found: a2l_read.A2l, values: np.ndarray) -> None:
    first = found.segment[0]
    for entry in found.characteristics.values():
        at = (entry.address - first) // 4
        memory.write(entry, values[at : at + entry.count])


def test_manifest_and_files_are_where_the_standard_has_them(opened: Unpacked) -> None:
    names = set(zipfile.ZipFile(opened.path).namelist())
    root = ET.fromstring((opened.folder / FOLDER / "fmi-ls-manifest.xml").read_bytes())
    assert root.tag == "fmiLayeredStandardManifest"
    assert (root.get(f"{SPACE}fmi-ls-name"), root.get(f"{SPACE}fmi-ls-version")) == ("org.fmi-standard.fmi-ls-xcp", "1.0.0")
    (interface,) = root
    assert (interface.tag, interface.get("supportsDirectMemoryAccess"), interface.get("containsXCPService")) == (
        "Interface",
        "true",
        "false",
    )
    definition = interface.get("definition")
    for target in ("", f"{TARGET[opened.version]}/"):
        assert f"{FOLDER}/{target}{definition}" in names
    assert "documentation/fmi-ls-xcp.txt" in names
    assert opened.description.coSimulation.canBeInstantiatedOnlyOncePerProcess
    binary = next((opened.folder / "binaries").rglob("*.so")).read_bytes()
    assert b".debug_info" not in binary and b"/tmp/" not in binary


@pytest.mark.long
def test_the_same_bytes_again_and_none_of_it_without_the_option(opened: Unpacked, nqvm: Any) -> None:
    assert exports.export(nqvm, f"fmu{opened.version}", opened.path, {"xcp": True}) == opened.path.read_bytes()
    plain = exports.export(nqvm, f"fmu{opened.version}", opened.path, {"source_only": True})
    assert b"fmi-ls" not in plain


@pytest.mark.skipif(not A2LTOOL.exists(), reason="a2ltool is not installed: pip install a2ltool")
def test_a2ltool_finds_nothing_and_fills_in_the_addresses_of_compiled_sources(opened: Unpacked, tmp_path: Path) -> None:
    for target in ("", TARGET[opened.version]):
        done = subprocess.run(
            [A2LTOOL, opened.folder / FOLDER / target / "nqvm.a2l", "--strict", "--check"], capture_output=True, text=True
        )
        assert done.returncode == 0 and (done.stdout + done.stderr).strip() == "Consistency check complete. No problems found."
    zeros = a2l(opened)
    assert {entry.address for entry in (*zeros.characteristics.values(), *zeros.measurements.values())} == {0}
    sources = sorted((opened.folder / "sources").glob("*.c"))
    library, filled = tmp_path / "nqvm.so", tmp_path / "filled.a2l"
    subprocess.run(
        [
            "gcc",
            "-std=c99",
            "-O2",
            "-ffp-contract=off",
            "-fno-math-errno",
            "-fvisibility=hidden",
            "-ffunction-sections",
            "-fdata-sections",
            "-shared",
            "-Wl,--gc-sections",
            "-fPIC",
            "-Wl,--build-id=none",
            "-g",
            f"-DFMI{opened.version}_OVERRIDE_FUNCTION_PREFIX",
            *sources,
            "-o",
            library,
        ],
        check=True,
    )
    subprocess.run(
        [A2LTOOL, opened.folder / FOLDER / "nqvm.a2l", "--elffile", library, "--update", "ADDRESSES", "-o", filled],
        check=True,
        capture_output=True,
    )
    theirs, ours = a2l_read.parse(filled.read_text(), "filled"), a2l(opened, TARGET[opened.version])
    for kind in ("characteristics", "measurements"):
        assert {name: e.address for name, e in getattr(theirs, kind).items()} == {
            name: e.address for name, e in getattr(ours, kind).items()
        }


def test_memory_at_its_addresses_is_that_of_the_running_fmu(opened: Unpacked, nqvm: Any, held: Any) -> None:
    """A set written through memory while it runs: in force at the next sample, to the bit; measurements are those of the last one."""
    u, found = chirp(0.4), a2l(opened, TARGET[opened.version])
    master = Master(opened)
    memory = Memory(opened)
    text, address = found.epk
    assert ctypes.string_at(memory.base + address).decode() == text == opened.description.guid
    master.initialise(z_road=u[0])
    values = np.asarray(penode_gen.set_values(nqvm, SET))
    rows = [master.get("z_b", "z_w")]
    for k in range(len(u) - 1):
        if k == 200:
            stage(memory, found, values)
            array = next(a for a in layout.arrays(nqvm) if a.name == "damper_net.weights_2")
            assert np.array_equal(master.get(array.name), np.ravel(layout.gather(array, values)))  # as if the master had set it
        master.set("z_road", u[k])
        master.step(STEP)
        rows.append(master.get("z_b", "z_w"))
        measured = [float(memory.read(found.measurements[name])[0]) for name in ("z_b", "z_w", "z_road")]
        assert measured[:2] == rows[-1].tolist() and measured[2] == np.float32(u[k, 0])
        assert int(memory.read(found.measurements["samples"])[0]) == k + 1
    assert np.array_equal(np.array(rows), Sil(held).run(u, [Call(201, "select", set=SET)]).y)
    assert master.log == []
    stage(memory, found, np.where(np.arange(values.size) == 700, np.nan, values))
    master.set("z_road", u[0])
    master.step(STEP)
    assert [line[:2] for line in master.log] == [(WARNING, "sets")]  # refused: what runs stands there again
    assert all(
        np.array_equal(memory.read(e), values[(e.address - found.segment[0]) // 4 :][: e.count]) for e in found.characteristics.values()
    )
    master.fmu.freeInstance()


def test_one_instance_at_a_time(opened: Unpacked) -> None:
    first = Master(opened)
    second = Master.__new__(Master)
    with pytest.raises(Exception, match=r"[Ff]ailed to instantiate|instantiate"):
        second.__init__(opened)
    assert second.log[-1][0] == ERROR and "one instance in a process" in second.log[-1][2]
    first.fmu.freeInstance()
    Master(opened).fmu.freeInstance()


def test_without_a_compiler_it_is_one_line(nqvm: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shutil.which", lambda name: None)
    with pytest.raises(exports.ExportError, match="gcc is not installed; install it, on Debian: apt-get install gcc"):
        exports.export(nqvm, "fmu3", tmp_path / "x.fmu", {"xcp": True, "source_only": True})
