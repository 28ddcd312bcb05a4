# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Modelica models of masses, springs and dampers as model files: the same motion, and what is not read is a line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.integrate import solve_ivp

import penode_gen
from penode_gen.imports import ImportProblem
from penode_gen.imports.modelica_model import model_file
from penode_sil.cli import cli
from penode_sil.targets import Sil

rumoca = pytest.importorskip("rumoca", reason="rumoca is not installed: pip install penode[modelica]")
LIBRARY = Path(__file__).with_name("modelica") / "Translation.mo"
STEP, SAMPLES = 1e-3, 2001


def imported(name: str, folder: Path, library: Path = LIBRARY) -> Any:
    """The model of the library, read as penode import writes it."""
    path = folder / f"{name}.toml"
    done = CliRunner().invoke(cli, ["import", str(library), "--model", f"{library.stem}.{name}", "-o", str(path)])
    assert done.exit_code == 0, done.output
    return penode_gen.load(path)


def test_a_swing_moves_as_in_the_foreign_compiler(tmp_path: Path) -> None:
    """rumoca's own simulation of the same file, its solver to 1e-10. Float in C: 2000 steps of 0.5 ulp of 0.01 m (4.7e-10 m) are 9.3e-7 m
    at most."""
    ours = Sil(imported("Swing", tmp_path)).run(np.zeros((SAMPLES, 1))).y[:, 0]
    exact = rumoca.SimConfig(rtol=1e-10, atol=1e-12)
    theirs = rumoca.Session().load(str(LIBRARY), model="Translation.Swing").simulate(2.0, dt=STEP, config=exact)["body.s"]
    assert np.ptp(ours) > 0.01 and np.abs(ours - np.asarray(theirs)[:SAMPLES]).max() < 1e-6


def test_masses_without_anything_between_them_are_one(tmp_path: Path) -> None:
    """Against their equations, written by hand: lengths of 0.2 m and 0.1 m between the springs."""
    model = imported("Pair", tmp_path)

    def rates(t: float, x: np.ndarray) -> list[float]:
        s1, v1, s3, v3 = x
        left, right = 300 * (s1 - 0.1) + 2 * v1, 100 * (s3 - (s1 + 0.1 + 0.1)) + (v3 - v1)
        return [v1, (right - left) / 2.0, v3, -right]

    t = np.arange(SAMPLES) * STEP
    reference = solve_ivp(rates, (0, t[-1]), [0.3, 0, 0.5, 0], t_eval=t, rtol=1e-10, atol=1e-12).y
    assert np.ptp(reference[0]) > 0.05 and list(model.states) == ["one_s", "one_v", "three_s", "three_v"]
    found = Sil(model).run(np.zeros((SAMPLES, 1))).y
    # positions of 0.5 m: 2000 steps of at most 0.5 ulp (3e-8 m) add up to 6e-5 m where all have one sign, and to 1.3e-6 m as a random walk
    assert np.abs(found[:, [0, 2]] - reference[[0, 2]].T).max() < 6e-5


def test_a_motor_and_a_load_that_turn(tmp_path: Path) -> None:
    """A torque of 2 N·m from the start, against the equations written by hand."""
    model = imported("Drive", tmp_path, LIBRARY.with_name("Rotation.mo"))

    def rates(t: float, x: np.ndarray) -> list[float]:
        a, wa, b, wb = x
        twist = 40 * (b - a) + 0.1 * (wb - wa)
        return [wa, (2 + twist) / 0.1, wb, -twist / 0.5]

    t = np.arange(SAMPLES) * STEP
    reference = solve_ivp(rates, (0, t[-1]), [0.2, 0, 0, 0], t_eval=t, rtol=1e-10, atol=1e-12).y
    found = Sil(model, np.float64).run(np.full((SAMPLES, 1), 2.0)).y
    # RK4 in double at 1 ms, 22 rad/s: a step's error is (0.022)^5/120 of 0.2 rad, 2000 of them 2e-8 rad
    assert reference[0].max() > 5 and np.abs(found - reference.T)[:, [0, 2]].max() < 1e-7


def test_a_quarter_vehicle_is_that_of_elements(tmp_path: Path) -> None:
    """The model file that an engineer would write, over a step of the road; the force of the tyre is an output."""
    path = tmp_path / "elements.toml"
    path.write_text(
        '[model]\nname = "elements"\nsample_time = "1 ms"\n[inputs]\nz_road = { unit = "m" }\n'
        '[bodies]\nbody = { mass = "380 kg" }\nwheel = { mass = "36 kg" }\n[elements]\n'
        'spring = { between = ["body", "wheel"], law = "linear_spring", stiffness = "21 kN/m" }\n'
        'damper = { between = ["body", "wheel"], law = "linear_damper", damping = "1500 N*s/m" }\n'
        'tyre = { between = ["wheel", "z_road"], law = "linear_spring", stiffness = "190 kN/m" }\n'
        '[outputs]\nz = { value = "z_body", unit = "m" }\nF = { value = "F_tyre", unit = "N" }\n'
    )
    u = np.where(np.arange(SAMPLES) < 100, 0.0, 0.02)[:, None]
    ours, by_hand = (Sil(m, np.float64).run(u).y for m in (imported("Quarter", tmp_path), penode_gen.load(path)))
    assert np.ptp(ours[:, 0]) > 0.02
    # double: one form of the same equations against another
    assert np.abs(ours[:, 0] - by_hand[:, 0]).max() < 1e-12 and np.abs(np.abs(ours[:, 1]) - np.abs(by_hand[:, 1])).max() < 1e-7


HEAD = (
    'model M\n  parameter Real k(unit = "N/m") = 2;\n  Real x(unit = "m", start = 1);\n  Real v(unit = "m/s");\nequation\n  v = der(x);\n'
)
REFUSED = {
    "  when x > 1 then\n    reinit(v, 0);\n  end when;\n  1.0*der(v) = -k*x;\n": "M has events",
    "  der(v) = if x > 0 then -k*x else 0;\n": "M has events",
    "  der(v) = -k*sin(time)*x;\n": "it depends on time",
    "  der(v) = -k*besselj(x);\n": "rumoca cannot compile M",
    "  der(v) = -k*x;\n  v = der(x);\n": "rumoca cannot compile M",
    "  der(v) = -k*cosh(x);\n": "the function 'cosh' with 1 arguments is not supported",
    "  der(v) = -k*x;\ninitial equation\n  x = 2;\n": "'initial equation' is not read",
    "  der(v) = -k*x/0;\n": "no model file can be made of it",
    "  der(v) = -k*x + 0/0;\n": "",
    "  der(v) = -k*(x + v)^99999;\n": "the exponent '99999' is not read",
    "  der(v) = -k*x + 9^9^9;\n": "",
    f"  der(v) = -k*{'(' * 3000}x{')' * 3000};\n": "",
    "  der(v) = -k*x + 1e999;\n": "",
    "  der(v) = -k*x;\n": "no model file can be made of it",  # m/s^2 is no N: the units do not fit
}


@pytest.mark.parametrize("text", REFUSED)
def test_what_is_not_read_is_a_line(text: str, tmp_path: Path) -> None:
    path, output = tmp_path / "M.mo", tmp_path / "m.toml"
    path.write_text(f"{HEAD}{text}end M;\n")
    done = CliRunner().invoke(cli, ["import", str(path), "-o", str(output)], standalone_mode=False)
    assert done.exception is not None and len(done.exception.problems) == 1, done.output
    assert REFUSED[text] in done.exception.problems[0] and "\n" not in done.exception.problems[0]
    assert not output.exists() and sorted(tmp_path.iterdir()) == [path]


def test_files_beside_it_do_not_count(tmp_path: Path) -> None:
    """A second model of the same name in the folder, which the compiler alone would read as well."""
    text = f"{HEAD}  1.0*der(v) = -k*x/2;\nend M;\n".replace('"N/m"', '"1/s2"').replace("1.0*", "")
    for name in ("M.mo", "copy of M.mo"):
        (tmp_path / name).write_text(text)
    assert "der(v) = -k*x/2" in model_file(text, tmp_path / "M.mo")


def test_options_of_the_other_kind(tmp_path: Path) -> None:
    for words, line in (
        (["-o", "m.toml", "--activation", "relu"], "--activation: it is for a network"),
        (["-o", "m.json", "--model", "M"], "--model: it is for a model"),
    ):
        done = CliRunner().invoke(cli, ["import", str(LIBRARY), *words], standalone_mode=False)
        assert done.exception is not None and line in done.exception.problems[0]


def test_other_lines(tmp_path: Path) -> None:
    path = tmp_path / "M.mo"
    for text, line in {
        "record R end R;": "there is no model in it",
        LIBRARY.read_text(): "it has 10 models: Compliant, Mass,",
        "model M\n  Real x;\nequation\n  der(x) = -x;\nend M;": "x has no unit, and none follows from a sum",
        'model M\n  Real x(unit = "bogus2");\nequation\n  der(x) = -x;\nend M;': "which is not known",
        'model M\n  Real x[3](each unit = "m");\nequation\n  der(x) = -x;\nend M;': "only Real scalars are",
        'model M\n  parameter Real y(unit = "m") = 1;\n'
        '  Real x(unit = "m");\nequation\n  x = y;\nend M;': "nothing in it changes with time",
        "model M" + " Real x;" * 500_000: "characters; name the file of the model alone",
    }.items():
        path.write_text(text)
        with pytest.raises(ImportProblem) as refused:
            model_file(text, path)
        assert line in refused.value.problems[0], refused.value.problems
    with pytest.raises(ImportProblem, match="is no name of a model"):
        model_file(LIBRARY.read_text(), LIBRARY, "a; b")
