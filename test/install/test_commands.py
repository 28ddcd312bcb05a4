# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Every command of an installed wheel, in a folder of its own, with nothing that leads to a checkout."""

from __future__ import annotations

import filecmp
import json
import subprocess
import zipfile
from pathlib import Path

import pytest
from wheels import ROOT, Installed, run

import penode_gen
from penode_gen.exports import FORMATS

SUFFIXES = {"modelica": "mo", "ssp": "ssp", "a2l": "a2l"}
OPTIONS = {"fmu2": ["--source-only"], "ssp": ["--source-only"], "a2l": ["--elf", "served.elf"]}
COMMANDS = {
    **{on: ["simulate", "nqvm.toml", "--scenario", "exchange.toml", "--on", on, "-o", f"{on}.csv"] for on in ("mil", "sil", "pil:m4f")},
    "train": ["train", "quarter.toml", "--data", "recorded.csv", "--known", "m_b", "-o", "trained"],
    "diagnose": ["diagnose", "friction/model.toml", "--data", "friction/train.csv", "-o", "found"],
    "inspect": ["inspect", "friction/train.csv", "friction/model.toml"],
    **{
        f"export {name}": [
            "export",
            "nqvm.toml",
            "--format",
            name,
            *OPTIONS.get(name, []),
            "-o",
            f"nqvm.{name}.{SUFFIXES.get(name, 'fmu')}",
        ]
        for name in FORMATS
    },
    "import weights": ["import", "weights.mo", "-o", "spring.json"],
    "import model": ["import", "Translation.mo", "--model", "Translation.Swing", "-o", "swing.toml"],
    "measure": ["measure", "--signals", "z_b,sample", "--duration", "0.2 s", "-o", "log.mf4"],
    "stage": ["stage", "nqvm.toml:altered_friction"],
    "compare": ["compare", "nqvm.toml"],
}


@pytest.fixture(scope="module")
def answers(installed: Installed) -> dict:
    """Answers of all commands; `serve` and `generate` are called by the program `penode` itself."""
    import generator

    generator.make(generator.Truth(), 1, seconds=3.0).write(installed.place / "recorded.csv")
    (installed.place / "weights.mo").write_text(
        "record W parameter Real [2, 1] layer_1_weights = {{1}, {-2.5e-1}}; parameter Real [2] layer_1_bias = {0, 1};\n"
        "parameter Real layer_2_weights[1, 2] = {{1, 2}}; parameter Real layer_2_bias[1] = {3}; end W;"
    )
    program = installed.python.with_name("penode")
    run([program, "generate", "nqvm.toml", "-o", "c"], installed.place, installed.env)
    with subprocess.Popen(
        [program, "serve", "nqvm.toml", "--tcp", "0", "--json"], cwd=installed.place, env=installed.env, stdout=subprocess.PIPE, text=True
    ) as controller:
        try:
            assert controller.stdout
            address = json.loads(controller.stdout.readline())["address"]
            (served,) = installed.cache.glob("nqvm-serve-*.elf")
            (installed.place / "served.elf").write_bytes(served.read_bytes())
            return installed.session(
                {name: [*words, "--to", address] if name in ("measure", "stage", "compare") else words for name, words in COMMANDS.items()}
            )
        finally:
            controller.terminate()


def test_it_is_the_wheel_that_runs(answers: dict, installed: Installed) -> None:
    for name in ("penode_gen", "penode_sil"):
        assert Path(answers["imported"][name]).is_relative_to(installed.python.parents[1])
    assert answers["imported"]["version"] == penode_gen.VERSION and answers["editable"] == []


@pytest.mark.parametrize("name", COMMANDS)
def test_command(name: str, answers: dict, installed: Installed) -> None:
    answer = answers["commands"][name]
    assert not answer["error"], answer["error"]
    words = COMMANDS[name]
    if "-o" in words:
        assert (installed.place / words[words.index("-o") + 1]).exists()


def test_generated_c_is_the_committed_one(answers: dict, installed: Installed) -> None:
    for path in (installed.place / "c").iterdir():
        assert filecmp.cmp(path, ROOT / "gen" / "nqvm" / "c" / path.name, shallow=False), path.name


@pytest.mark.parametrize("on", ["mil", "sil", "pil:m4f"])
def test_simulation_has_the_bits_of_the_repository(on: str, answers: dict, installed: Installed, repository: Path) -> None:
    kept = repository / f"{on.replace('pil:m4f', 'sil')}.csv"  # both have the same bits
    assert (installed.place / f"{on}.csv").read_bytes() == kept.read_bytes()
    assert "new set in force at sample 101" in answers["commands"][on]["output"]


def test_fmu_is_that_of_the_repository(answers: dict, installed: Installed, repository: Path) -> None:
    assert (installed.place / "nqvm.fmu3.fmu").read_bytes() == (repository / "nqvm.fmu3.fmu").read_bytes()
    assert "documentation/licenses/license.txt" in zipfile.ZipFile(installed.place / "nqvm.fmu3.fmu").namelist()


def test_diagnosis_names_what_the_recording_hides(answers: dict, installed: Installed) -> None:
    found = json.loads((installed.place / "found" / "diagnosis.json").read_text())
    assert found["verdict"] == "explained" and "Coulomb friction at damper" in answers["commands"]["diagnose"]["output"]


def test_a_set_is_staged(answers: dict) -> None:
    assert "running: altered_friction" in answers["commands"]["compare"]["output"]


def test_nothing_that_was_compiled_comes_from_the_checkout(answers: dict, installed: Installed) -> None:
    """It lies in the user's cache; debug information names the folders that headers came from."""
    made = [path for path in installed.cache.rglob("*") if path.is_file()]
    assert {path.suffix for path in made} >= {".so", ".elf", ".o", ".c"}
    folders = [f"{ROOT}/{folder}".encode() for folder in ("inc", "src", "port", "sil", "gen")]
    assert not [path.name for path in made for folder in folders if folder in path.read_bytes()]
    assert b"site-packages/penode_gen/native/port/xcp" in (installed.place / "served.elf").read_bytes()
