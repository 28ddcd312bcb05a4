# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Modelica: the whole model in a foreign compiler, networks as records and as C, and back with the same bits."""

from __future__ import annotations

import ctypes
import importlib.util
import io
import random
import re
import subprocess
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from case_study import chirp

import penode_gen
from penode_gen import exports
from penode_gen.emission.network_json import to_json
from penode_gen.imports import ImportProblem, Options, modelica
from penode_gen.networks import Affine
from penode_gen.reading.network_files import read_network
from penode_sil.targets import Sil

RUMOCA = pytest.mark.skipif(importlib.util.find_spec("rumoca") is None, reason="rumoca is not installed: pip install penode[modelica]")
POLYGON = """
function road
  input Real t;
  output Real y;
protected
  Real samples[{n}] = {{{samples}}};
  Integer i;
algorithm
  i := min(max(integer(floor(t/0.001)), 0), {n} - 2);
  y := samples[i + 1] + (t/0.001 - i)*(samples[i + 2] - samples[i + 1]);
end road;

model Driven
  nqvm plant;
equation
  plant.z_road = road(time);
end Driven;
"""


def export(model: Any, form: str, chosen: str = "default") -> str:
    return exports.export(model, "modelica", Path("m.zip" if form == "external" else "m.mo"), {"form": form, "set": chosen}).decode()


@RUMOCA
def test_a_foreign_compiler_simulates_the_whole_model(nqvm: Any, tmp_path: Path) -> None:
    """
    The road is the polygon of the samples, as the C sees it. RK4 in double at 1 ms is within 1e-9 m of the solution; the
    foreign solver is asked for its defaults, 1e-6 relative, which is 2e-8 m of the 20 mm here, and errs by more at kinks: 1e-6 m.
    """
    import rumoca

    u = chirp(0.5)
    (tmp_path / "Driven.mo").write_text(
        export(nqvm, "model") + POLYGON.format(n=len(u), samples=", ".join(repr(float(v)) for v in u[:, 0]))
    )
    result = rumoca.Session().load(str(tmp_path / "Driven.mo"), model="Driven").simulate(0.5, dt=1e-3)
    found = np.array([result[f"plant.{name}"] for name in ("z_b", "z_w")]).T
    assert np.abs(found - Sil(nqvm, np.float64).run(u).y).max() <= 1e-6
    assert np.abs(found - Sil(nqvm).run(u).y).max() <= 2e-6


@RUMOCA
def test_a_foreign_compiler_reads_the_values_of_the_record(nqvm: Any, tmp_path: Path) -> None:
    """Without its icon, which the Modelica Standard Library has: each array comes out as the sum that numpy finds."""
    import rumoca

    record = re.search(r"  record damper_net_parameters.*?end damper_net_parameters;", export(nqvm, "library"), re.S)[0]
    names = re.findall(r"parameter Real (\w+)\[([\d, ]+)\]", record)
    fixed = record.replace("    extends Modelica.Icons.Record;\n", "")
    lines = (
        [f"  Real {name}_[{shape}];\n" for name, shape in names] + ["equation\n"] + [f"  {name}_ = params.{name};\n" for name, _ in names]
    )
    (tmp_path / "Probe.mo").write_text(
        f"{fixed}\nmodel Probe\n  damper_net_parameters params;\n  Real x(start=0.0, fixed=true);\n"
        f"{''.join(lines)}  der(x) = 1.0;\nend Probe;\n"
    )
    result = rumoca.Session().load(str(tmp_path / "Probe.mo"), model="Probe").simulate(0.01, dt=0.01)
    from penode_gen.exports.modelica.model import arrays

    for name, values in arrays(nqvm.sets["default"].networks["damper_net"]):
        for index in np.ndindex(values.shape):
            assert result[f"{name}_[{','.join(str(i + 1) for i in index)}]"][0] == values[index], (name, index)


DAMPED = """
[model]
name = "damped"
sample_time = "1 ms"
[parameters]
m = { value = 30, unit = "kg" }
c = { value = 20000, unit = "N/m" }
d = { value = 500, unit = "N*s/m" }
[inputs]
z_road = { unit = "m" }
[bodies]
wheel = { mass = "m", position = "z_w", velocity = "v_w" }
[elements]
spring = { between = ["wheel", "z_road"], law = "linear_spring", stiffness = "c" }
damper = { between = ["wheel", "z_road"], law = "linear_damper", damping = "d" }
[outputs]
z_w = { value = "z_w", unit = "m" }
"""


@RUMOCA
def test_the_rate_of_an_input_is_an_input(tmp_path: Path) -> None:
    """Alone as a top model, whose inputs have no derivatives, it compiles; driven by a sine and its derivative, it is the model."""
    import rumoca

    (tmp_path / "damped.toml").write_text(DAMPED)
    model = penode_gen.load(tmp_path / "damped.toml")
    (tmp_path / "damped.mo").write_text(text := export(model, "model"))
    assert 'input Real der_z_road(unit="m/s")' in text and "der(z_road)" not in text
    rumoca.Session().load(str(tmp_path / "damped.mo"), model="damped")  # compiles it
    equations = "plant.z_road = 0.01*sin(30.0*time);\n  plant.der_z_road = 0.3*cos(30.0*time);"
    (tmp_path / "driven").mkdir()
    (tmp_path / "driven" / "Driven.mo").write_text(f"{text}\nmodel Driven\n  damped plant;\nequation\n  {equations}\nend Driven;\n")
    found = rumoca.Session().load(str(tmp_path / "driven" / "Driven.mo"), model="Driven").simulate(0.5, dt=1e-3)["plant.z_w"]
    u = 0.01 * np.sin(30.0 * np.arange(501) * 1e-3)[:, None]
    # the input is linear between samples, with a rate that is that of the sine within 30^3/12 * 1e-6 * 0.01 m/s
    assert np.abs(found - Sil(model, np.float64).run(u).y[:, 0]).max() <= 1e-5


def test_networks_as_c_beside_one_another(nqvm: Any, tmp_path: Path) -> None:
    """Both networks in one file, with names of their own, equal to numpy in double; no warning."""
    data = exports.export(nqvm, "modelica", Path("m.zip"), {"form": "external"})
    zipfile.ZipFile(io.BytesIO(data)).extractall(tmp_path)
    names = list(nqvm.networks)
    calls = "".join(
        f"void call_{n}(const double u[], double y[]);\nvoid call_{n}(const double u[], double y[])\n{{\n    nqvm_{n}(u, y);\n}}\n"
        for n in names
    )
    (tmp_path / "both.c").write_text(f'#include "nqvm_networks.c"\n#include "nqvm_networks.c"\n{calls}')
    folder = tmp_path / "nqvm_networks" / "Resources" / "Include"
    subprocess.run(
        [
            "gcc",
            "-std=c99",
            "-O2",
            "-Wall",
            "-Wextra",
            "-Wpedantic",
            "-Wconversion",
            "-Wshadow",
            "-Werror",
            "-shared",
            "-fPIC",
            f"-I{folder}",
            "-o",
            tmp_path / "both.so",
            tmp_path / "both.c",
            "-lm",
        ],
        check=True,
    )
    library = ctypes.CDLL(str(tmp_path / "both.so"))
    for name in names:
        network = nqvm.sets["default"].networks[name]
        for x in np.linspace(-0.2, 0.2, 41):
            u, y = (ctypes.c_double * 1)(x), (ctypes.c_double * 1)()
            getattr(library, f"call_{name}")(u, y)
            # three layers of 16 sums of 16 products: some 50 roundings of 1e-16 of the largest force
            assert abs(y[0] - network.evaluate([x])[0]) <= 1e-11 * 1e3
    package = (tmp_path / "nqvm_networks" / "package.mo").read_text()
    assert all(f'external "C" nqvm_{n}(u, y)' in package for n in names)


def same(a: Any, b: Any) -> bool:
    """Equal to the bit."""

    def parts(layer: Any) -> list[np.ndarray]:
        return [layer.shift, layer.factor] if isinstance(layer, Affine) else [layer.weights, layer.bias]

    ranges = all(
        np.array_equal(x, y) if x is not None and y is not None else x is y
        for x, y in ((a.input_min, b.input_min), (a.input_max, b.input_max))
    )
    return (
        a.architecture == b.architecture
        and ranges
        and all(np.array_equal(x, y) for p, q in zip(a.layers, b.layers, strict=True) for x, y in zip(parts(p), parts(q), strict=True))
    )


@pytest.mark.parametrize("chosen", ["default", "altered_friction"])
@pytest.mark.parametrize("before", [False, True], ids=["shape behind the name", "shape before the name"])
def test_what_was_exported_is_imported_with_the_same_bits(nqvm: Any, tmp_path: Path, chosen: str, before: bool) -> None:
    """Also as the paper writes records; through the JSON file into a set that the model file reads."""
    text = export(nqvm, "library", chosen)
    text = re.sub(r"Real (\w+)(\[[\d, ]+\])", r"Real \2 \1", text) if before else text
    found = modelica.networks(text, Path("n.mo"), Options())
    assert set(found) == set(nqvm.networks)
    for name, network in found.items():
        (tmp_path / f"{name}.json").write_text(to_json(network))
        assert same(network, nqvm.sets[chosen].networks[name]) and same(read_network(tmp_path / f"{name}.json"), network)
    model = tmp_path / "m.toml"
    sets = "\n".join(f'{name} = "{tmp_path / name}.json"' for name in found)
    model.write_text(f'[model]\nextends = "{nqvm.path}"\nname = "again"\n[sets.imported]\n{sets}\n')
    assert np.array_equal(penode_gen.set_values(penode_gen.load(model), "imported"), penode_gen.set_values(nqvm, chosen))


def test_a_record_alone_gets_its_activations_from_the_option() -> None:
    text = (
        "record W parameter Real [2, 1] layer_1_weights = {{1}, {-2.5e-1}}; parameter Real [2] layer_1_bias = {0, 1};\n"
        'parameter Real layer_2_weights[1, 2](each min=0) = {{3, 4}} "words; }"; parameter Real layer_2_bias[1] = {.5}; /* end W; */ end W;'
    )
    network = modelica.networks(text, Path("n.mo"), Options("tanh"))["W"]
    assert [layer.activation for layer in network.layers] == ["tanh", "identity"]
    assert network.evaluate([2.0])[0] == pytest.approx(3 * np.tanh(2.0) + 4 * np.tanh(0.5) + 0.5, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "n.mo: there is no record with parameters layer_1_weights and layer_1_bias; name a file that has one"),
        (
            "record W parameter Real layer_1_weights[1,1] = {{1}};",
            "n.mo: line 1: the record W has no end; the file is incomplete; export it again",
        ),
        (
            "record W\nparameter Real layer_1_weights[2,1] = {{1}}; end W;",
            "n.mo: line 2: layer_1_weights is declared with [2, 1], but has values of the shape [1, 1]; make them equal",
        ),
        (
            "record W parameter Real layer_1_weights[2,2] = {{1,2},{3}}; end W;",
            "n.mo: line 1: layer_1_weights has rows of different lengths; give every row one number a column",
        ),
        (
            "record W parameter Real layer_1_weights[1,1] = {{n}}; end W;",
            "n.mo: line 1: 'n' stands where a number or { is expected; export the record again",
        ),
        (
            "record W parameter Real layer_1_weights[1,1] = {{1e999}}; end W;",
            "n.mo: line 1: layer_1_weights has a number too large for a double; train or export the network again",
        ),
        ("record W parameter Real layer_1_weights[1,1] = {{1}}; end W;", "n.mo: record W: layer_1_bias is missing; add it"),
        (
            "record W parameter Real layer_2_weights[1,1] = {{1}}; parameter Real layer_2_bias[1] = {1}; end W;",
            "n.mo: record W: the layers are numbered 2; number them 1, 2, 3 ... without a gap",
        ),
        (
            "record W parameter Real layer_1_weights[1,1] = {{1}}; parameter Real layer_1_bias[2] = {1,2}; end W;",
            "n.mo: record W: layer_1: weights [1, 1] and bias [2] do not fit; they must be [n, m] and [n]",
        ),
    ],
)
def test_what_is_wrong_in_a_record_is_one_line(text: str, line: str) -> None:
    with pytest.raises(ImportProblem) as found:
        modelica.networks(text, Path("n.mo"), Options())
    assert found.value.problems == [line]


def damaged(text: str, rng: random.Random) -> str:
    """One of the ways in which files go wrong: cut, a character changed, a piece doubled, lost or moved, brackets in masses."""
    at, length = rng.randrange(len(text)), rng.randrange(1, 200)
    piece = text[at : at + length]
    other = rng.randrange(len(text))
    return rng.choice(
        [
            text[:at],
            text[:at]
            + chr(rng.choice([0, 34, 40, 44, 47, 59, 91, 92, 101, 123, 125, 0xD800 - 1, rng.randrange(1, 0x2FF)]))
            + text[at + 1 :],
            text[:at] + text[at + length :],
            text[:at] + piece * rng.randrange(2, 20) + text[at:],
            text[:other] + piece + text[other:],
            text[:at] + rng.choice("{([") * rng.choice([5, 5000]) + text[at:],
            piece,
            text.replace(rng.choice(["record", "end", "parameter", "{", ";", "."]), rng.choice(["", "end", "{{", "-"])),
        ]
    )


def check_damaged(nqvm: Any, seeds: range) -> None:
    """Each damaged file is read, or refused with one line; nothing else is raised."""
    small = "\n".join(line for line in export(nqvm, "library").splitlines() if not re.match(r" {8}\{.*\},?$", line) or "{{" in line)
    texts = [
        export(nqvm, "library"),
        small,
        "record W parameter Real layer_1_weights[1,1] = {{1}}; parameter Real layer_1_bias[1] = {1}; end W;",
    ]
    refused = 0
    for seed in seeds:
        rng = random.Random(seed)
        text = damaged(texts[seed % 3], rng)
        try:
            modelica.networks(text, Path("n.mo"), Options())
        except ImportProblem as problem:
            refused += 1
            assert len(problem.problems) == 1 and "\n" not in problem.problems[0] and len(problem.problems[0]) < 400
    assert refused > len(seeds) / 5


def test_damaged_files_are_refused_with_a_line(nqvm: Any) -> None:
    check_damaged(nqvm, range(60))


@pytest.mark.long
def test_1000_damaged_files_are_refused_with_a_line(nqvm: Any) -> None:
    check_damaged(nqvm, range(1000, 2000))


def test_other_models_and_unsupported_ones(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text(
        '[model]\nname = "m"\nsample_time = "1 ms"\n[parameters]\nk = { value = 3, unit = "1" }\n[inputs]\nu = { unit = "m" }\n'
        '[actuators]\nlate = { input = "u", law = "delay", samples = 3 }\n[outputs]\ny = { value = "k*late", unit = "m" }\n'
    )
    with pytest.raises(exports.ExportError, match="'late': an actuator that works on samples has no form in continuous Modelica"):
        export(penode_gen.load(path), "model")
    with pytest.raises(exports.ExportError, match="the model has no network; use --form model"):
        export(penode_gen.load(path), "library")
    path.write_text(
        '[model]\nname = "m"\nsample_time = "1 ms"\n[states]\nx = { unit = "1", start = 0.5 }\n[equations]\n'
        'q = "der(x) = where(x < 0.2, sigmoid(x), -max(x, 0)^2 + sqrt(abs(x)) + sign(x)*softplus(x) - 3*atan(x)/2)/T"\n'
        '[parameters]\nT = { value = 2, unit = "s" }\n[outputs]\ny = { value = "x", unit = "1" }\n'
    )
    text = export(penode_gen.load(path), "model")
    equation = next(line for line in text.splitlines() if "der(x) =" in line)
    for part in (
        "noEvent(if x < 0.2 then (1.0/(1.0 + exp(-(x))))",
        "noEvent(if x > 0.0 then 1.0 elseif",
        "sqrt(noEvent(abs(x)))",
        "max(",
        "log(1.0 + exp(",
    ):
        assert part in equation
