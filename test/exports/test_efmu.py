# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""eFMU: its Algorithm Code runs as the C does, its manifests are valid and name what is there, the same bytes on any day."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from case_study import ROOT, chirp
from click.testing import CliRunner
from efmu_container import Schemas, contents, export, problems
from galec import Block
from galec_against_c import distances
from galec_types import GalecError

import penode_gen
from penode_gen import exports
from penode_gen.exports.efmu import code as efmu_code, manifest as efmu_manifest, schemas as efmu_schemas
from penode_sil.cli import cli

sys.path.append(str(ROOT / "test" / "gen"))
from models import BARE, network_file, rich  # needs the path above


@pytest.fixture(scope="module")
def text(nqvm: Any) -> str:
    return efmu_code.block(nqvm).text


# Two roundings: of the last sum of the method, and what different orders of the sums before it leave of it (their terms are a
# step's worth of rates, some 1e-3 of the state's largest value).
MOST = 2.0


@pytest.mark.parametrize("real", [np.float32, np.float64], ids=["float", "double"])
def test_the_block_makes_the_steps_of_the_c(nqvm: Any, real: type) -> None:
    assert distances(nqvm, chirp(0.2), real).max() <= MOST


@pytest.mark.long
@pytest.mark.parametrize("real", [np.float32, np.float64], ids=["float", "double"])
def test_the_block_makes_10000_steps_of_the_c(nqvm: Any, real: type, capsys: pytest.CaptureFixture[str]) -> None:
    found = distances(nqvm, chirp(10.0)[:10_000], real)
    with capsys.disabled():
        print(f"{np.dtype(real).name}: {found.max():.2f} ulp of the largest value at most, over {len(found)} steps")
    assert len(found) == 10_000 and found.max() <= MOST


FAULTS = {
    "a weight": (r"(damper_net\.weights_2' := \{\{)[^,]+", r"\g<1>0.5"),
    "a constant": (r"350\.0", "351.0"),
    "a weight of the method": (r"\{1\.0, 2\.0, 2\.0, 1\.0\}", "{1.0, 2.0, 1.0, 2.0}"),
    "input held": (r"'previous\(z_road\)' \+ \(share \* [^;]*;", "'previous(z_road)';"),
    "a neuron": (r"h3\[i\] := 0\.5 \* \(p3\[i\] \+ absolute\(p3\[i\]\)\)", "h3[i] := p3[i]"),
    "two networks exchanged": (r"(F_spring_nn := network\(.*), s_spring\)", r"\1, v_spring)"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_in_the_block_is_found(nqvm: Any, text: str, fault: str) -> None:
    wrong, count = re.subn(*FAULTS[fault], text)
    assert count and distances(nqvm, chirp(0.1), np.float32, wrong).max() > 2 * MOST


VARIANTS = [
    {"method": "heun", "substeps": 3, "outside": "clamp", "low": -0.001},
    pytest.param({"method": "euler", "outside": "fade", "low": -0.001}, marks=pytest.mark.long),
    pytest.param({"method": "rk4"}, marks=pytest.mark.long),
    pytest.param({"method": "rk4", "input": "held", "activation": "sigmoid"}, marks=pytest.mark.long),
    pytest.param({"method": "heun", "activation": "relu", "input": "held", "substeps": 2}, marks=pytest.mark.long),
]


@pytest.mark.parametrize("options", VARIANTS, ids=lambda o: " ".join(map(str, o.values())))
def test_other_models_make_the_steps_of_their_c(tmp_path: Path, options: dict[str, Any]) -> None:
    """
    Networks of two inputs, the rate of an input, elementary functions, an algebraic loop, all methods; in double.

    The C's own exp and tanh are within some ulp of NumPy's (test/accuracy), and outputs are rates: 40 ulp, of 1e-16.
    """
    model = penode_gen.load(rich(tmp_path, **options))
    t = np.arange(60) * 1e-3
    assert distances(model, np.stack([np.sin(40 * t), 0.02 * np.sin(25 * t)], axis=1), np.float64).max() <= 40.0


@pytest.mark.parametrize(
    ("activations", "sizes"),
    [
        (["step", "tanh", "identity"], [3, 17, 2, 1]),
        pytest.param(["softplus", "relu"], [1, 1, 1], marks=pytest.mark.long),
        pytest.param(["sigmoid"], [1, 1], marks=pytest.mark.long),
    ],
)
def test_models_that_are_a_network(tmp_path: Path, activations: list[str], sizes: list[int]) -> None:
    """No state; one neuron, one input, one layer. step compares, so the function has a signal."""
    network_file(tmp_path / "net.json", sizes, activations, 3)
    names = [f"u{k}" for k in range(sizes[0])]
    inputs = "\n".join(f'{n} = {{ unit = "1" }}' for n in names)
    path = tmp_path / "bare.toml"
    path.write_text(BARE.format(outside="extrapolate", inputs=inputs, units=["1"] * len(names), names=", ".join(names)))
    model = penode_gen.load(path)
    assert distances(model, np.random.default_rng(1).uniform(-1, 1, (50, len(names))), np.float64).max() <= 40.0
    assert ("signals NAN;\n    input" in efmu_code.block(model).text) == ("step" in activations)


def test_signals_and_what_then_stays(text: str) -> None:
    """NaN and Inf at the input or in a weight: NAN, and state and outputs stay; then it goes on."""
    block = Block(text, np.float32)
    block.run("Startup")
    for k in range(20):
        block.values["z_road"] = np.float32(0.001 * k)
        assert block.run("DoStep") == set()
    kept = {k: v for k, v in block.values.items() if k.startswith("'state") or k in ("z_b", "'previous(z_road)'")}
    for bad in (np.nan, np.inf, -np.inf):
        block.values["z_road"] = np.float32(bad)
        assert block.run("DoStep") == {"NAN"} and all(block.values[k] == v for k, v in kept.items())
    block.values["z_road"] = np.float32(0.02)
    weights = block.values["'damper_net.weights_2'"]
    good, weights[3, 4] = weights[3, 4], np.nan
    assert block.run("Recalibrate") == {"NAN"} and block.run("DoStep") == {"NAN"} and block.values["z_b"] == kept["z_b"]
    weights[3, 4] = good
    assert block.run("Recalibrate") == set() and block.run("DoStep") == set() and block.values["z_b"] != kept["z_b"]


def test_the_tensor_flow_is_not_scalarised(text: str) -> None:
    """Below 10 KB without the initial weights, both networks in one function with a matrix product a layer."""
    code = re.sub(r"^ +self\.'\w+_net\.\w+' := [^;]*;\n", "", text, flags=re.M)
    assert "12.5" in text and "12.5" not in code
    assert len(code.encode()) < 10_000
    assert text.count("function network\n") == 1 and len(re.findall(r":= \(weights_\d \* \w+\) \+ bias_\d;", code)) == 4


# What the public compliance checker does not see, and more: each is refused when the block is read.
@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        (r"weights_2 \* h2", "weights_2 * h1", "is assigned to|Real"),
        (r"weights_2 \* h2", "weights_2 * p5", "Real"),
        (r"absolute\(p2", "relu(p2", "there is no function relu"),
        (r"/\* force of spring \*/", "// force of spring", "character|token"),
        (r"(?s)  method Recalibrate.*?end Recalibrate;", "", "the methods are"),
        (r"for i in 1:16", "for i in 1:17", "subscript"),
        (r"0\.5 \*", "1 *", "Integer"),
        (r"'state\.z_b' := 0\.0;", "'state.z_b' := 0;", "Integer"),
        (r"self\.z_b := 0\.0;", "", "Startup does not set z_b"),
        (r"end network;", "end net;", "ends as"),
        (r"signals NAN;", "signals OVERFLOW;", "declares the signals"),
        (r"0\.0 - \(F", "-(F", "token"),
        (r"\(weights_2 \* h2\) \+ bias_2", "weights_2 * h2 + bias_2", "token"),
        (r"350\.0", "3.5e2", "token|character"),
        (r"self\.z_b := y", "self.z_c := y", "z_c is not declared"),
        (r"x0\[4\]", "x0[5]", "assigned"),
        (r"signal NAN;", "signal NONE;", "no signal"),
    ],
)
def test_what_is_no_galec_is_refused(text: str, old: str, new: str, line: str) -> None:
    wrong, count = re.subn(old, new, text)
    assert count
    with pytest.raises(GalecError, match=line):
        Block(wrong, np.float32)


# -- the container ------------------------------------------------------------------------------------------------


def test_every_manifest_is_valid_and_names_what_is_there(efmu: dict[str, bytes], tmp_path: Path) -> None:
    """By the schemas of eFMI 1.0.0 Beta 1; and each fault is found."""
    schemas = Schemas(efmu, tmp_path)
    assert problems(efmu) == [] and schemas.errors_of_all(efmu) == []
    assert b"Modelica Association" in efmu["schemas/LICENSE"]
    manifest = efmu["AlgorithmCode/manifest.xml"]
    for old, new in (
        (b'kind="DoStep"', b'kind="Step"'),
        (b'xsdVersion="0.14.0"', b'xsdVersion="0.13.0"'),
        (b"Units>", b"Unit>"),
        (b'number="1"', b'number="0"'),
    ):
        assert schemas.errors("AlgorithmCode", manifest.replace(old, new)), old
    assert schemas.errors("", efmu["__content.xml"].replace(b"__content", b"").replace(b'id="{', b'id="'))


def test_faults_between_the_files_are_found(efmu: dict[str, bytes]) -> None:
    code, manifest = efmu["AlgorithmCode/block.alg"], efmu["AlgorithmCode/manifest.xml"]
    for wrong in (
        {"AlgorithmCode/block.alg": code + b" "},
        {"AlgorithmCode/manifest.xml": manifest + b" "},
        {"AlgorithmCode/more.alg": b""},
        {"AlgorithmCode/manifest.xml": manifest.replace(b'variableRefId="', b'variableRefId="no')},
    ):
        assert problems(efmu | wrong)


def test_the_manifest_has_the_variables_of_the_block(nqvm: Any, efmu: dict[str, bytes]) -> None:
    """Name, causality, shape and start values; signals of the methods; the clock."""
    root = ElementTree.fromstring(efmu["AlgorithmCode/manifest.xml"])
    block = Block(efmu["AlgorithmCode/block.alg"].decode(), np.float64)
    block.run("Startup")
    kinds = {"input": "input", "output": "output", "tunableParameter": "parameter", "constant": "constant", "state": ""}
    entries = {e.get("name"): e for e in root.find("Variables")}
    assert list(entries) == list(block.variables)
    for name, e in entries.items():
        assert kinds[e.get("blockCausality")] == block.kinds[name] and e.get("id") == name
        assert tuple(int(d.get("size")) for d in e.findall("Dimensions/Dimension")) == block.variables[name].shape
        assert e.tag == f"{block.variables[name].kind}Variable"
        start = [s == "true" if e.tag == "BooleanVariable" else float(s) for s in e.get("start").split()]
        assert np.array_equal(np.ravel(block.values[name]), start)
    assert {m.get("kind"): {s.get("value") for s in m.iter("Signal")} for m in root.find("BlockMethods")} == {
        m: block.clauses[m] for m in ("Startup", "Recalibrate", "DoStep")
    }
    assert float(entries[root.find("Clock").get("variableRefId")].get("start")) == nqvm.sample_time


def test_the_same_bytes_from_the_command_line(nqvm: Any, efmu: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From another folder; the time is that of SOURCE_DATE_EPOCH."""
    monkeypatch.chdir(tmp_path)
    assert CliRunner().invoke(cli, ["export", str(nqvm.path), "--format", "efmu", "-o", "again.fmu"], catch_exceptions=False).exit_code == 0
    assert contents(tmp_path / "again.fmu") == efmu and b'generationDateAndTime="1980-01-01T00:00:00Z"' in efmu["__content.xml"]
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1767225600")
    assert efmu_manifest.time_stamp() == "2026-01-01T00:00:00Z"
    for wrong in ("soon", "1e9", str(10**30)):
        monkeypatch.setenv("SOURCE_DATE_EPOCH", wrong)
        with pytest.raises(exports.ExportError, match=f"SOURCE_DATE_EPOCH: '{wrong}' is not a time in seconds"):
            export(nqvm, tmp_path)


def test_schemas_of_a_folder(efmu: dict[str, bytes], tmp_path: Path) -> None:
    """The same as those of the package; incomplete ones and those of another dialect are refused with a line."""
    for name, data in efmu.items():
        if name.startswith("schemas/"):
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name).write_bytes(data)
    given = str(tmp_path / "schemas")
    assert efmu_schemas.schemas("beta1", given) == {
        n.removeprefix("schemas/"): data for n, data in efmu.items() if n.startswith("schemas/")
    }
    for dialect, path, data, line in (
        ("dymola", "", b"", "efmiContainerManifest.xsd is not version 0.10.0, which the dialect dymola has"),
        ("beta1", "efmiUnits.xsd", b"<a>", "efmiUnits.xsd is no XML"),
        ("beta1", "efmiUnits.xsd", None, "includes efmiUnits.xsd, which is missing"),
        ("beta1", "efmiContainerManifest.xsd", None, "it has no efmiContainerManifest.xsd"),
    ):
        kept = (tmp_path / "schemas" / path).read_bytes() if path else b""
        if path and data is None:
            (tmp_path / "schemas" / path).unlink()
        elif path:
            (tmp_path / "schemas" / path).write_bytes(data)
        with pytest.raises(exports.ExportError, match=re.escape(line)):
            efmu_schemas.schemas(dialect, given)
        if path:
            (tmp_path / "schemas" / path).write_bytes(kept)


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ('[model]\nmethod = "ros2"', 'method = "ros2": it has no form in Algorithm Code here; use one of euler, heun, rk4'),
        ('[model]\ninput = "cubic"', 'input = "cubic": it has no form in Algorithm Code here; use held or linear'),
        (
            '[actuators]\nlate = { input = "z_road", law = "delay", samples = 3 }',
            "'late': an actuator that works on samples has no form in Algorithm Code here",
        ),
    ],
)
def test_what_has_no_form_is_one_line(nqvm: Any, tmp_path: Path, change: str, line: str) -> None:
    head = f'[model]\nextends = "{nqvm.path}"\nname = "other"\n'
    path, output = tmp_path / "m.toml", tmp_path / "m.fmu"
    path.write_text(change.replace("[model]\n", head) if "[model]" in change else head + change)
    done = CliRunner().invoke(cli, ["export", str(path), "--format", "efmu", "-o", str(output)])
    assert isinstance(done.exception, exports.ExportError) or done.exit_code == 2
    assert line in (str(done.exception) + done.output) and not output.exists()


def test_without_the_package_of_the_schemas(nqvm: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(efmu_schemas.importlib.util, "find_spec", lambda name: None)
    for options, line in (
        ({}, "pip install penode\\[efmu\\], or name their folder"),
        ({"schemas": "/none"}, "there is no such folder"),
        ({"dialect": "dymola"}, "its schemas are in no package"),
    ):
        with pytest.raises(exports.ExportError, match=line):
            export(nqvm, tmp_path, **options)


def test_names_that_the_language_keeps_are_quoted(tmp_path: Path) -> None:
    """Inputs, parameters, states and outputs named as keywords and functions; no input at all; names that it cannot have."""
    path = tmp_path / "m.toml"
    path.write_text(
        '[model]\nname = "block"\nsample_time = "1 ms"\nmethod = "heun"\n[parameters]\nsignal = { value = 1, unit = "s" }\n'
        'x = { value = 2, unit = "m", tunable = true }\n'
        '[states]\ntanh1D = { unit = "m", start = 0.5 }\n[equations]\nlag = "der(tanh1D)*signal = x - tanh1D"\n'
        '[outputs]\nlimit = { value = "tanh1D + x", unit = "m" }\n'
        'x = { value = "tanh1D", unit = "m" }\n'
    )
    with pytest.raises(exports.ExportError, match="'x' would be two variables of the eFMU"):
        efmu_code.block(penode_gen.load(path))
    path.write_text(path.read_text().replace('x = { value = "tanh1D"', 'y = { value = "tanh1D"'))
    model = penode_gen.load(path)
    assert distances(model, np.zeros((30, 0)), np.float64).max() <= MOST
    assert (
        all(f"{kind} 'signal';" in efmu_code.block(model).text for kind in ("constant Real",))
        and "block 'block'" in efmu_code.block(model).text
    )
