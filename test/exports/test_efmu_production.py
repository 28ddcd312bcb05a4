# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Production Code of an eFMU: compiled as it is in the container and called through its manifest, it gives the bits of SiL."""

from __future__ import annotations

import ctypes
import importlib.util
import subprocess
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from conftest import chirp
from efmu_container import contents, export, problems, unmapped

import penode_gen
from penode_gen import layout
from penode_sil.schedule import Call
from penode_sil.targets import Sil

if importlib.util.find_spec("rumoca") is None:
    pytest.skip("rumoca, which has the schemas, is not installed: pip install penode[efmu]", allow_module_level=True)

FOLDERS = {np.float32: "ProductionCode_32bit", np.float64: "ProductionCode_64bit"}
NAN, UNSPECIFIED = 1 << 2, 1 << 5
FLAGS = "-std=c99 -O1 -ffp-contract=off -Wall -Wextra -Werror -Wconversion -Wshadow -pedantic -fPIC -shared".split()


@pytest.fixture(scope="module")
def files(nqvm: Any, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    return contents(export(nqvm, tmp_path_factory.mktemp("efmu")))


class Production:
    """An instance of the Production Code: types, members, functions and names as its manifest has them."""

    def __init__(self, files: dict[str, bytes], real: type, folder: Path):
        prefix = f"{FOLDERS[real]}/"
        for name, data in files.items():
            if name.startswith(prefix):
                (folder / name.removeprefix(prefix)).write_bytes(data)
        root = ElementTree.fromstring(files[f"{prefix}manifest.xml"])
        self.library = folder / "block.so"
        if not self.library.exists():
            sources = sorted(f.get("name") for f in root.findall("Files/File") if f.get("name").endswith(".c"))
            subprocess.run(["gcc", *FLAGS, *sources, "-o", str(self.library)], cwd=folder, check=True)
        self.functions = {r.find("ForeignFunctionReference").get("foreignRefId"): r.find("GlobalFunction").get("functionRefId") for r in root.iter("FunctionReference")}
        names = {f.get("id"): f.get("name") for f in root.iter("Function")}
        self.functions = {method: names[i] for method, i in self.functions.items()}
        self.members = {r.find("ForeignVariableReference").get("foreignRefId"): r.find("FormalParameter").get("componentIdentifier") for r in root.iter("DataReference")}
        coded = {t.get("id"): t.get("codedType") for t in root.iter("TargetType")}
        types = {t.get("id"): coded[t.find("Alias").get("targetTypeRefId")] for t in root.iter("Typedef") if t.find("Alias") is not None}
        of = {"float": ctypes.c_float, "double": ctypes.c_double, "bool": ctypes.c_bool, "uint32_t": ctypes.c_uint32}
        fields = []
        for c in root.iter("Component"):
            kind = of[types[c.get("typeDefRefId")]]
            for d in sorted(c.findall("Dimensions/Dimension"), key=lambda d: -int(d.get("number"))):
                kind = kind * int(d.get("size"))
            fields.append((c.get("name"), kind))
        self.memory = (ctypes.c_uint64 * (1 << 16))()  # members that no manifest names follow the ones that it does
        self.data = type("Block", (ctypes.Structure,), {"_fields_": fields}).from_buffer(self.memory)
        self._loaded = ctypes.CDLL(str(self.library))

    def run(self, method: str) -> int:
        """Call a method; its error signals."""
        function = getattr(self._loaded, self.functions[f"{method}()"])
        function.restype = ctypes.c_bool
        failed = function(ctypes.byref(self.data))
        signals = int(self["ErrorSignalStatus"])
        assert failed == (signals != 0)
        return signals

    def __getitem__(self, name: str) -> np.ndarray:
        """A variable by its name in the Algorithm Code; arrays can be written."""
        value = getattr(self.data, self.members[name])
        return np.ctypeslib.as_array(value) if isinstance(value, ctypes.Array) else value

    def __setitem__(self, name: str, value: Any) -> None:
        setattr(self.data, self.members[name], value)

    def tune(self, model: Any, chosen: str) -> None:
        values = penode_gen.set_values(model, chosen, np.float64)
        for a in layout.arrays(model):
            target = self[f"'{a.name}'"]
            target[...] = layout.gather(a, values).reshape(target.shape)


@pytest.fixture(scope="module", params=FOLDERS, ids=["32 bit", "64 bit"])
def made(request: pytest.FixtureRequest, files: dict[str, bytes], tmp_path_factory: pytest.TempPathFactory) -> tuple[type, Any]:
    folder = tmp_path_factory.mktemp("code")
    return request.param, lambda: Production(files, request.param, folder)


def steps(block: Production, u: np.ndarray) -> np.ndarray:
    found = []
    for value in u[:, 0]:
        block["z_road"] = value
        assert block.run("DoStep") == 0
        found.append([block[n] for n in ("'state.z_b'", "'state.z_w'", "'state.v_b'", "'state.v_w'", "z_b", "z_w")])
    return np.array(found)


def test_the_code_gives_the_bits_of_sil_with_recalibration(nqvm: Any, made: Any) -> None:
    """No warning, all through the manifest; the set in force from the step on that follows, states stay."""
    real, block = made[0], made[1]()
    u = chirp(0.6)
    assert block.run("Startup") == 0
    before = steps(block, u[:300])
    block.tune(nqvm, "altered_friction")
    assert block.run("Recalibrate") == 0
    found = np.concatenate([before, steps(block, u[300:])])
    run = Sil(nqvm, real).run(u, [Call(300, "select", set="altered_friction")])
    assert np.array_equal(found.astype(real), np.concatenate([run.x, run.y], axis=1))
    assert not np.array_equal(run.x[-1], Sil(nqvm, real).run(u).x[-1])
    assert block["'previous(z_road)'"] == real(u[-1, 0]) and block["'discrete.stepSize.active'"] and block["m_b"] == 350.0


def test_the_code_starts_as_the_block_does(nqvm: Any, files: dict[str, bytes], made: Any) -> None:
    block = made[1]()
    block.run("Startup")
    root = ElementTree.fromstring(files["AlgorithmCode/manifest.xml"])
    for v in root.find("Variables"):
        start = [s == "true" if v.tag == "BooleanVariable" else made[0](float(s)) for s in v.get("start").split()]
        assert np.array_equal(np.ravel(block[v.get("name")]).astype(float), start), v.get("name")


def test_what_is_refused_leaves_what_runs(nqvm: Any, made: Any) -> None:
    """NaN in a weight or at the input: NAN. A second set before the first has come into force: UNSPECIFIED_ERROR."""
    u, block = chirp(0.06), made[1]()
    block.run("Startup")
    found = [steps(block, u[:20])]
    weights = block["'damper_net.weights_2'"]
    kept, weights[1, 2] = weights[1, 2], np.nan
    assert block.run("Recalibrate") == NAN
    weights[1, 2] = kept
    found.append(steps(block, u[20:40]))
    state = block["'state.z_b'"]
    block["z_road"] = np.inf
    assert block.run("DoStep") == NAN and block["'state.z_b'"] == state == block["z_b"]
    found.append(steps(block, u[40:]))
    assert np.array_equal(np.concatenate(found).astype(made[0])[:, :4], Sil(nqvm, made[0]).run(u).x)
    assert block.run("Recalibrate") == 0 and block.run("Recalibrate") == UNSPECIFIED
    assert block.run("DoStep") == 0 and block.run("Recalibrate") == 0


def test_everything_of_the_block_is_mapped_once(files: dict[str, bytes]) -> None:
    """And each fault of a mapping is found."""
    for folder in FOLDERS.values():
        assert unmapped(files, folder) == []
        manifest = files[f"{folder}/manifest.xml"]
        for old, new in ((b'foreignRefId="z_b"', b'foreignRefId="z_w"'), (b'foreignRefId="DoStep()"', b'foreignRefId="Startup()"'), (b'foreignRefId="ErrorSignalStatus"', b'foreignRefId="c"')):
            assert old in manifest and unmapped(files | {f"{folder}/manifest.xml": manifest.replace(old, new)}, folder)
        for old, new in ((b'foreignRefId="z_b"', b'foreignRefId="z_c"'), (b'origin="true"', b'origin="true" checksum2=""'), (b'typeDefRefId="bool"', b'typeDefRefId="boole"')):
            assert problems(files | {f"{folder}/manifest.xml": manifest.replace(old, new)})
    assert any("origin" in p for p in problems(files | {"AlgorithmCode/manifest.xml": files["AlgorithmCode/manifest.xml"] + b" "}))
