# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Production Code of an eFMU: compiled as it is in the container and called through its manifest, it gives the bits of SiL."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from case_study import ROOT, chirp
from efmu_container import SCHEMAS, contents, export, problems, unmapped
from efmu_instance import FOLDERS, Production

import penode_gen
from penode_gen.sets import layout
from penode_sil.schedule import Call
from penode_sil.targets import Sil

NAN, UNSPECIFIED = 1 << 2, 1 << 5


@pytest.fixture(params=FOLDERS, ids=["32 bit", "64 bit"])
def made(request: pytest.FixtureRequest, production: Any) -> tuple[type, Any]:
    return request.param, lambda: production(request.param)


def tune(block: Production, model: Any, chosen: str) -> None:
    values = penode_gen.set_values(model, chosen, np.float64)
    for a in layout.arrays(model):
        target = block[f"'{a.name}'"]
        target[...] = layout.gather(a, values).reshape(target.shape)


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
    tune(block, nqvm, "altered_friction")
    assert block.run("Recalibrate") == 0
    found = np.concatenate([before, steps(block, u[300:])])
    run = Sil(nqvm, real).run(u, [Call(300, "select", set="altered_friction")])
    assert np.array_equal(found.astype(real), np.concatenate([run.x, run.y], axis=1))
    assert not np.array_equal(run.x[-1], Sil(nqvm, real).run(u).x[-1])
    assert block["'previous(z_road)'"] == real(u[-1, 0]) and block["'discrete.stepSize.active'"] and block["m_b"] == 350.0


def test_the_code_starts_as_the_block_does(nqvm: Any, efmu: dict[str, bytes], made: Any) -> None:
    block = made[1]()
    block.run("Startup")
    root = ElementTree.fromstring(efmu["AlgorithmCode/manifest.xml"])
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


def test_everything_of_the_block_is_mapped_once(efmu: dict[str, bytes]) -> None:
    """And each fault of a mapping is found."""
    for folder in FOLDERS.values():
        assert unmapped(efmu, folder) == []
        manifest = efmu[f"{folder}/manifest.xml"]
        for old, new in (
            (b'foreignRefId="z_b"', b'foreignRefId="z_w"'),
            (b'foreignRefId="DoStep()"', b'foreignRefId="Startup()"'),
            (b'foreignRefId="block:ErrorSignalStatus"', b'foreignRefId="c"'),
        ):
            assert old in manifest and unmapped(efmu | {f"{folder}/manifest.xml": manifest.replace(old, new)}, folder)
        for old, new in (
            (b'foreignRefId="z_b"', b'foreignRefId="z_c"'),
            (b'origin="true"', b'origin="true" checksum2=""'),
            (b'typeDefRefId="bool"', b'typeDefRefId="boole"'),
        ):
            assert problems(efmu | {f"{folder}/manifest.xml": manifest.replace(old, new)})
    assert any("origin" in p for p in problems(efmu | {"AlgorithmCode/manifest.xml": efmu["AlgorithmCode/manifest.xml"] + b" "}))


def test_the_how_to_of_the_documentation(production: Any, tmp_path: Path) -> None:
    """The C of gen/EXPORTS.md, compiled against the container's, with a main around it."""
    code = re.search(r"```c\n(static nqvm_efmu_t block;.*?)```", (ROOT / "gen" / "EXPORTS.md").read_text(), re.S)[1]
    first, rest = code.split("\n", 1)
    (tmp_path / "main.c").write_text(
        f'#include "nqvm_efmu.h"\n{first}\nint main(void)\n{{\n'
        f"{rest}    return (block.sets == 1U) ? (int)block.error_signal_status : 1;\n}}\n"
    )
    library = production(np.float32).library
    subprocess.run(
        ["gcc", "-std=c99", "-Wall", "-Wextra", f"-I{library.parent}", "main.c", str(library), "-o", "main"], cwd=tmp_path, check=True
    )
    assert subprocess.run([str(tmp_path / "main")]).returncode == 0


@SCHEMAS
@pytest.mark.long
def test_names_of_the_structure_itself(tmp_path: Path) -> None:
    """A model without parameters to tune, whose names are those of the structure: it compiles without a warning, and runs as SiL."""
    path = tmp_path / "m.toml"
    path.write_text(
        '[model]\nname = "m"\nsample_time = "1 ms"\nmethod = "heun"\n[inputs]\nsets = { unit = "m" }\n'
        'staged = { unit = "m" }\n[parameters]\nbanks = { value = 1, unit = "s" }\n'
        '[states]\nx = { unit = "m", start = 0.5 }\n[equations]\nlag = "der(x)*banks = sets - staged - x"\n'
        '[outputs]\ninstance = { value = "x", unit = "m" }\n'
    )
    model = penode_gen.load(path)
    block = Production(contents(export(model, tmp_path)), np.float32, tmp_path)
    assert block.run("Startup") == 0 and block.run("Recalibrate") == 0
    u, found = np.random.default_rng(1).uniform(-1, 1, (20, 2)).astype(np.float32), []
    for row in u:
        block["sets"], block["staged"] = row
        assert block.run("DoStep") == 0
        found.append(block["instance"])
    assert np.array_equal(np.array(found, np.float32), Sil(model).run(u).y[:, 0])
