# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""[filter] of a model file: what it means, and one line for each thing that is wrong."""

from __future__ import annotations

import math
import os
import subprocess
from pathlib import Path

import numpy as np
import plant
import pytest

import penode_gen
from penode_gen.emission.model_c import render
from penode_gen.errors import ModelError
from penode_sil.filtering.compiled import Compiled
from penode_sil.targets import MACHINES, PORT

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
QUARTER = ROOT / "sil" / "filter" / "quarter.toml"
TEXT = (HERE / "models" / "layered.toml").read_text().replace("../../../gen", str(ROOT / "gen"))


def load(folder: Path, *changes: tuple[str, str], more: str = ""):
    text = TEXT
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    (folder / "model.toml").write_text(text + more)
    return penode_gen.load(folder / "model.toml")


def test_noises_are_those_of_the_sample(tmp_path: Path) -> None:
    found = load(tmp_path).filter
    assert [s.name for s in found.sensors] == ["a_body", "a_wheel"]
    assert [s.noise for s in found.sensors] == [0.02, 0.1] and found.sensors[0].gate is None
    assert found.states[2].noise == pytest.approx(1e-4 * math.sqrt(1e-3))
    road = found.inputs[0]
    assert road.decay == pytest.approx(math.exp(-1e-3)) and not road.measured
    assert road.step == pytest.approx(road.noise * math.sqrt(1.0 - math.exp(-2e-3)))
    walk = load(tmp_path, ('noise = 1e-3, correlation = "1 s"', "walk = 0.1, start = 2e-3")).filter.inputs[0]
    assert (walk.noise, walk.decay, walk.measured) == (2e-3, 1.0, False) and walk.step == pytest.approx(0.1 * math.sqrt(1e-3))
    white = load(tmp_path, (', correlation = "1 s"', "")).filter.inputs[0]
    assert (white.noise, white.step, white.decay, white.measured) == (1e-3, 1e-3, 0.0, True)


def test_limits_are_sums_of_states(tmp_path: Path) -> None:
    more = '\n[filter.limits]\ntyre = { value = "F_tyre", unit = "N", max = 300 }\n'
    found = load(tmp_path, ("z_b = { start = 1e-4,", "z_b = { start = 1e-4, max = 0.1,"), more=more).filter.limits
    assert [(limit.name, limit.coefficients) for limit in found] == [("z_b", {"z_b": 1.0}), ("tyre", {"z_w": 1.0, "z_road": -1.0})]
    assert (found[0].least, found[0].most) == (None, 0.1)
    assert found[1].most == pytest.approx(1e-3)


# What is changed, what is added, and the line.
WRONG = [
    (("[filter.sensors]\na_body = {}", "[filter.sensors]\na_bodi = {}"), "", "the model has no sensor 'a_bodi'; did you mean 'a_body'?"),
    (("a_body = {}", "a_body = { noise = -1 }"), "", "-1 is not above zero; give a standard deviation, or a number of them"),
    (("a_body = {}", "a_body = { gate = 0 }"), "", "0 is not above zero"),
    (("a_body = {}\na_wheel = {}", ""), "", "0 sensors; name 1 to 32 sensors of the model"),
    (("[filter.states]", "[filter.stats]"), "", "filter.stats: unknown key; did you mean 'states'?"),
    (("z_b = { start = 1e-4, noise = 1e-5 }", ""), "", "filter.states.z_b: 'start' is missing; add z_b = { start = ... }"),
    (("z_b = { start = 1e-4,", "z_b = { start = 1e-4, min = 2, max = 1,"), "", "min is not below max; exchange them"),
    (("z_b = { start = 1e-4,", "z_b = { start = 1e-4, min = 1,"), "", "the start state is not inside of it; move the bound"),
    (("z_b = { start = 1e-4, noise = 1e-5", "z_b = { start = 1e-4, noise = -1e-5"), "", "-1e-05 is below zero; give a standard deviation"),
    (("z_road = { noise = 1e-3,", "z_road = { noise = 1e-3, walk = 1,"), "", "needs exactly one of noise and walk"),
    (('noise = 1e-3, correlation = "1 s"', "walk = 1"), "", "filter.inputs.z_road: 'start' is missing"),
    (('correlation = "1 s"', 'correlation = "1 m"'), "", "'1 m' is not measured in s; give a quantity in s"),
    (('correlation = "1 s"', 'correlation = "0 s"'), "", "0 s is not above zero; give a time such as '0.5 s'"),
    (('name = "layered"', 'name = "layered"\ninput = "cubic"'), "", 'write input = "linear" or "held" in [model]'),
    (('name = "layered"', 'name = "layered"'), '[filter.limits]\nl = { value = "z_b", unit = "N", max = 1 }', "correct the units"),
    (('name = "layered"', 'name = "layered"'), '[filter.limits]\nl = { value = "z_b*z_b", unit = "m^2", max = 1 }', "is no sum of states"),
    (
        ('name = "layered"', 'name = "layered"'),
        '[filter.limits]\nl = { value = "der(v_b)", unit = "m/s^2", max = 1 }',
        "depends on the network",
    ),
    (
        ('name = "layered"', 'name = "layered"'),
        '[filter.limits]\nl = { value = "z_b", unit = "m" }',
        "has neither min nor max; add one of them",
    ),
    (('name = "layered"', 'name = "layered"'), '[filter.limits]\nl = { value = "z_x", unit = "m", max = 1 }', "z_x"),
]


@pytest.mark.parametrize(("change", "more", "line"), WRONG, ids=[line[:40] for _, _, line in WRONG])
def test_what_is_wrong_is_one_line(tmp_path: Path, change: tuple[str, str], more: str, line: str) -> None:
    with pytest.raises(ModelError) as caught:
        load(tmp_path, change, more=f"\n{more}\n")
    own = [p for p in caught.value.problems if line in p]
    assert len(own) == 1 and "model.toml:" in own[0] and ": filter" in own[0], caught.value.problems


def test_a_model_without_a_filter_has_no_files_of_it() -> None:
    assert not [name for name in render(penode_gen.load(ROOT / "gen/nqvm/nqvm.toml"), self_test=False) if "ekf" in name]


@pytest.mark.parametrize("name", ["layered", "measured_folded", "scaled"])
@pytest.mark.parametrize("double", [False, True])
def test_the_c_gives_no_warning(tmp_path: Path, name: str, double: bool) -> None:
    """All that clang can say, but for its opinions on C99, padding, comments and plain arrays; and what gcc says strictly."""
    penode_gen.generate(penode_gen.load(HERE / "models" / f"{name}.toml"), tmp_path, self_test=False)
    include = [f"-I{ROOT / part}" for part in ("inc", "port/gnu")]
    options = ["-std=c99", "-fsyntax-only", "-Werror", *include, *(["-DPEN_REAL_DOUBLE"] if double else [])]
    silent = [f"-Wno-{w}" for w in ("padded", "documentation", "declaration-after-statement", "unsafe-buffer-usage", "double-promotion")]
    source = str(tmp_path / f"{name}_ekf.c")
    subprocess.run(["clang-19", "-Weverything", *silent, *options, source], check=True)
    strict = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Wshadow", "-Wfloat-equal", "-Wundef", "-O2"]
    subprocess.run(["gcc", *strict, *options, source], check=True)


def test_white_errors_of_a_measured_input_are_those_of_the_reference(tmp_path: Path) -> None:
    """Against a filter whose measurement noise has the input's share: for the first sample, where nothing else correlates."""
    model = load(tmp_path, (', correlation = "1 s"', ""))
    z = np.array([[0.3, -0.5]])
    _, x, f = Compiled(model, np.float64).filter().run(np.array([[1e-3]]), z, covariance=True)
    own = plant.Plant(model)
    seen, hx, hu = own.sense(np.zeros(4), np.float64(1e-3))
    p = np.diag([s.start**2 for s in model.filter.states])
    r = np.diag([s.noise**2 for s in model.filter.sensors]) + np.outer(hu, hu) * 1e-6
    gain = p @ hx.T @ np.linalg.inv(hx @ p @ hx.T + r)
    assert x[0, :4] == pytest.approx(gain @ (z[0] - seen), rel=1e-9)
    assert plant.covariance(f[0])[:4, :4] == pytest.approx(p - gain @ hx @ p, rel=1e-7, abs=1e-16)


@pytest.mark.parametrize(
    "path",
    [pytest.param(QUARTER, marks=pytest.mark.long), HERE / "models" / "cost_mass.toml"],  # test_monitor_c.py has a plain filter
    ids=["states", "parameters"],
)
def test_the_c_keeps_misra(tmp_path: Path, path: Path) -> None:
    """As the models of gen/nqvm: nothing found in a program that calls every function of the headers."""
    model = penode_gen.load(path)
    penode_gen.generate(model, tmp_path)
    parts = dict.fromkeys((model.name, model.stepped, f"{model.name}_ekf"))
    headers = [*(tmp_path / f"{part}.h" for part in parts), *sorted(f"inc/penode/{p.name}" for p in (ROOT / "inc/penode").glob("*.h"))]
    headers.append("port/template/pen_port_target.h")
    entry = tmp_path / "every_entry.c"
    made = subprocess.run(["test/misra/every_entry", *headers], cwd=ROOT, capture_output=True, text=True, check=True)
    entry.write_text(made.stdout)
    sources = [entry, *(tmp_path / f"{part}.c" for part in (*parts, f"{model.name}_selftest"))]
    done = subprocess.run(
        ["test/misra/check", "clean", *sources], cwd=ROOT, capture_output=True, text=True, env=os.environ | {"OPTIONS": f"-I{tmp_path}"}
    )
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("machine", ["m4f", "m3"])
@pytest.mark.parametrize("level", ["-O2", "-Os", "-O3"])
def test_the_c_needs_nothing_from_outside(tmp_path: Path, machine: str, level: str) -> None:
    """Neither libc nor heap: functions of the runtime and of the model, and soft float where there is no FPU."""
    penode_gen.generate(penode_gen.load(QUARTER), tmp_path, self_test=False)
    tries = "-ftree-loop-distribute-patterns"  # with which gcc may try memcpy
    out, sources = tmp_path / "filter.o", [str(tmp_path / "quarter_ekf.c"), str(ROOT / "src" / "pen_ekf.c")]
    found: set[str] = set()
    for source in sources:
        subprocess.run([PORT / "cc", MACHINES[machine], "-std=c99", level, tries, f"-I{tmp_path}", "-c", "-o", out, source], check=True)
        listed = subprocess.run(["arm-none-eabi-nm", "-u", out], capture_output=True, text=True, check=True).stdout
        found |= {line.split()[-1] for line in listed.splitlines()}
    soft = {name for name in found if name.startswith(("__aeabi_f", "__aeabi_ui2f", "__aeabi_i2f"))}
    assert {name for name in found - (soft if machine == "m3" else set()) if not name.startswith(("pen_", "quarter_"))} == set()
