# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Tunable parameters as states of a filter: [filter.parameters]."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import filter_campaign
import numpy as np
import pytest
from samples import sample

import penode_gen
from penode_gen.emission.model_c import render
from penode_gen.errors import ModelError
from penode_gen.model import Model
from penode_sil.filtering.compiled import Compiled
from penode_sil.filtering.estimates import FLAGS
from penode_sil.filtering.exact import Exact
from penode_sil.filtering.variable import variances

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
MASS = HERE / "models" / "mass.toml"
ENTRY = "m_b = { start = 70, walk = 0.05, min = 200, max = 500 }"

# One body on a spring and a damper, moved by a foot: what it measures depends on mass, stiffness and a factor of the damper.
AXLE = """
[model]
name = "axle"
sample_time = "1 ms"
method = "METHOD"
input = "INPUT"

[parameters]
m = { value = 2, unit = "kg", tunable = true }
c = { value = 800, unit = "N/m", tunable = true }
d = { value = 12, unit = "N*s/m" }
worn = { value = 1, unit = "1", tunable = true }

[inputs]
foot = { unit = "m" }

[bodies]
body = { mass = "m", position = "z_b", velocity = "v_b" }

[elements]
spring = { between = ["body", "foot"], law = "linear_spring", stiffness = "c" }
damper = { between = ["body", "ground"], law = "expression", force = "worn*d*v_damper" }

[outputs]
F = { value = "F_spring", unit = "N" }

[sensors]
a = { value = "der(v_b)", unit = "m/s^2", noise = 0.05 }
z_abs = { value = "z_b", unit = "m", noise = 1e-4 }

[sets.default]

[sets.loaded]
m = "2.4 kg"

[filter.sensors]
a = {}
z_abs = {}

[filter.states]
z_b = { start = 1e-4, noise = 1e-4 }
v_b = { start = 1e-2, noise = 1e-3 }

[filter.inputs]
foot = { noise = 1e-4 }

[filter.parameters]
worn = { start = 0.2, walk = 1e-3, min = 0.2, max = 3 }
m = { start = 0.4, walk = 1e-3, min = 1, max = 4 }
"""


def axle(folder: Path, method: str = "rk4", held: bool = False, *changes: tuple[str, str]) -> Model:
    text = AXLE.replace("METHOD", method).replace("INPUT", "held" if held else "linear")
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    (folder / "axle.toml").write_text(text)
    return penode_gen.load(folder / "axle.toml")


def ridden(model: Model, samples: int, seed: int, **values: float) -> tuple[np.ndarray, np.ndarray]:
    """Inputs and measurements of a body with other values of its parameters, by the float64 equations and small steps."""
    rng, h = np.random.default_rng(seed), model.sample_time
    own = penode_gen.numeric(model).with_parameters(values)
    u, x, z = np.zeros((samples, 1)), np.zeros(2), np.zeros((samples, 2))
    u[:, 0] = 0.02 * np.sin(2.0 * np.pi * np.cumsum(np.linspace(0.5, 6.0, samples)) * h)
    for k in range(samples):
        rate = (u[k] - u[max(k - 1, 0)]) / h
        for part in range(10 if k else 0):
            at = u[k - 1] if model.interpolation == "held" else u[k - 1] + (part + 0.5) / 10.0 * (u[k] - u[k - 1])
            middle = x + 0.05 * h * own.rates(x, at, rate)
            x = x + 0.1 * h * own.rates(middle, at, rate)
        z[k] = own.sensors(x, u[k], rate) + np.array([0.05, 1e-4]) * rng.standard_normal(2)
    return u, z


MOVED = (  # the damper stands on the foot, whose rate counts then; so the foot is no state of the filter
    ('between = ["body", "ground"], law = "expression"', 'between = ["body", "foot"], law = "expression"'),
    ("[filter.inputs]\nfoot = { noise = 1e-4 }\n", ""),
)


@pytest.mark.parametrize(("held", "changes"), [(False, ()), (True, ()), (False, MOVED)], ids=["line", "held", "rate"])
def test_filter_in_numpy_is_the_compiled_one(tmp_path: Path, held: bool, changes: tuple[tuple[str, str], ...]) -> None:
    """Which gives the equations values of parameters, and takes differences: nothing of how the C does it. Runge-Kutta of order 4."""
    model = axle(tmp_path, "rk4", held, *changes)
    u, z = ridden(model, 400, 1, m=2.3, worn=0.7)
    z[40, 0], mask = np.nan, np.full(400, 3, np.uint32)
    mask[60:70] = 1
    one, two = Exact(model).run(u, z, mask), Compiled(model, np.float64).filter().run(u, z, mask)[0]
    some = two.deviations[0] > 0.0  # of the foot that is no state there is none
    assert np.max(np.abs(one.values - two.values)[:, some] / two.deviations[:, some]) < 1e-5
    assert one.deviations == pytest.approx(two.deviations, rel=1e-5)
    assert np.array_equal(one.verdict, two.verdict) and np.array_equal(one.status, two.status)


@pytest.mark.parametrize("method", ["euler", "heun", "rk4", "ros1", "ros2"])
def test_mass_and_damper_are_found_with_every_method(tmp_path: Path, method: str, show: Callable[[str], None]) -> None:
    """From 15 % and 30 % off, within four standard deviations; the float64 equations move the body, in small steps."""
    model = axle(tmp_path, method)
    u, z = ridden(model, 4000, 2, m=2.3, worn=0.7)
    found, x, _ = Compiled(model).filter().run(u, z)
    names = list(model.filter.names)
    worn, mass = x[-1, names.index("worn")], x[-1, names.index("m")]
    deviation = found.deviations[-1, -2:]
    show(f"{method}: damper {worn:.3f} of 0.7, mass {mass:.4f} of 2.3 kg; deviations {deviation[0]:.3f}, {deviation[1]:.4f}")
    assert not found.status.any() and (deviation < [0.05, 0.05]).all()
    assert abs(worn - 0.7) < 4.0 * deviation[0] + (0.05 if method in ("euler", "ros1") else 0.0)  # order 1: damping of its own
    assert abs(mass - 2.3) < 4.0 * deviation[1] + 0.01


def test_mass_20_percent_off_is_found_and_its_interval_is_honest(tmp_path: Path, show: Callable[[str], None]) -> None:
    """24 runs of 20 s; 100 of 60 s: make campaign-filter."""
    found = filter_campaign.masses(24, 20, tmp_path)
    show(f"at most {np.abs(found.error).max():.3%} off; the interval covers the mass in {found.share.mean():.1%} of the samples")
    assert np.abs(found.error).max() < 0.02 and 0.9 <= found.share.mean() <= 0.98


def test_bounds_hold_to_the_bit(tmp_path: Path) -> None:
    """Of a mass that is above them."""
    model = axle(tmp_path, "rk4", False, ("min = 1, max = 4", "min = 1.9, max = 2.2"), ('m = "2.4 kg"', 'm = "2.1 kg"'))
    u, z = ridden(model, 2000, 3, m=2.3)
    found, x, _ = Compiled(model).filter().run(u, z, estimates=False)
    assert (x[:, -1] <= np.float32(2.2)).all() and (x[:, -1] >= np.float32(1.9)).all()
    assert (found.status & FLAGS["limited"] > 0).mean() > 0.5 and x[-1, -1] > 2.199


def test_estimates_start_with_the_set_and_outlive_an_exchange(tmp_path: Path) -> None:
    """They are in the filter, not in a set: sets are read only."""
    model = axle(tmp_path)
    u, z = ridden(model, 1500, 4, m=2.3)
    names = list(model.filter.names)
    at, compiled = names.index("m"), Compiled(model)
    assert compiled.filter("loaded").run(u[:1], z[:1] * np.nan)[1][0, at] == np.float32(2.4)
    own = compiled.filter()
    before = own.run(u[:1000], z[:1000])[1]
    assert own.select("loaded") == 0
    after = own.run(u[1000:], z[1000:])[1]
    assert before[0, at] == pytest.approx(2.0, abs=0.4) and before[-1, at] == pytest.approx(2.3, abs=0.02)
    assert after[0, at] == pytest.approx(before[-1, at], abs=1e-3) and after[-1, at] == pytest.approx(2.3, abs=0.02)
    compiled.filter()  # refuses a set whose checksum is not that of its values
    exact = Exact(model, "loaded")
    assert exact.x[at] == 2.4


def test_the_plain_step_is_that_without_the_table(tmp_path: Path) -> None:
    """NAME.c and NAME.h do not change but for the digest of the file."""
    (tmp_path / "plain").mkdir()
    whole, plain = axle(tmp_path), axle(tmp_path / "plain", "rk4", False, (AXLE[AXLE.index("[filter.parameters]") :], ""))
    one, two = render(whole), render(plain)
    for name in ("axle.c", "axle.h", "axle_selftest.c", "axle_params.c", "axle_sets.h"):
        assert one[name].replace(whole.digest[:16], "").replace(whole.digest[:8], "") == two[name].replace(plain.digest[:16], "").replace(
            plain.digest[:8], ""
        )
    assert {"axle_augmented.c", "axle_augmented.h"} == one.keys() - two.keys()


# What is changed, and the line.
WRONG = [
    ((ENTRY, ENTRY.replace("m_b", "m_bb")), "filter.parameters.m_bb: the model has no parameter 'm_bb'; did you mean 'm_b'?"),
    (
        (ENTRY, ENTRY.replace("m_b", "c")),
        "filter.parameters.c: is not tunable, and the C has it as a constant; add tunable = true to it in",
    ),
    (
        (ENTRY, ENTRY.replace("start = 70, ", "")),
        "filter.parameters.m_b: 'start' is missing; add start = ..., its standard deviation at the",
    ),
    ((ENTRY, ENTRY.replace("walk = 0.05, ", "")), "filter.parameters.m_b: 'walk' is missing; add walk = ..., how far it moves in a second"),
    ((ENTRY, ENTRY.replace("min = 200, ", "")), "filter.parameters.m_b: 'min' is missing; add min = ..., its lower bound"),
    ((ENTRY, ENTRY.replace("0.05", "0")), "filter.parameters.m_b.walk: 0 is not above zero"),
    (
        (ENTRY, ENTRY.replace("0.05", "1e-4")),
        "filter.parameters.m_b.walk: 0.0001 is lost in the rounding of a float; give at least 0.00066",
    ),
    ((ENTRY, ENTRY.replace("200", "600")), "filter.parameters.m_b: min is not below max; exchange them"),
    (
        (ENTRY, ENTRY.replace("200", "360")),
        "filter.parameters.m_b: its value in 'default', 'altered_friction' of [sets] is not inside of its bounds; move a bound",
    ),
    (
        (ENTRY, ENTRY.replace("200", "-1")),
        "filter.parameters.m_b: the model divides by it, and its bounds reach 0; give bounds of one sign",
    ),
    ((ENTRY, f'{ENTRY}\n[filter.limits]\nl = {{ value = "m_b*z_b", unit = "kg*m", max = 9 }}'), "filter.limits.l: is no sum of states"),
    (('name = "mass"', 'name = "mass"\ninput = "parabola"'), 'filter.parameters: a parameter of the filter, and input = "parabola"'),
    (
        (ENTRY, f'{ENTRY}\n[monitor]\nmean_time = "1 h"\n[monitor.causes]\nload = {{ m_b = 50 }}'),
        "the filter follows its changes, and the cause",
    ),
]


@pytest.mark.parametrize(("change", "line"), WRONG, ids=[line[:60] for _, line in WRONG])
def test_what_is_wrong_is_one_line(tmp_path: Path, change: tuple[str, str], line: str) -> None:
    text = MASS.read_text().replace("../../../gen", str(ROOT / "gen"))
    assert change[0] in text
    (tmp_path / "model.toml").write_text(text.replace(*change))
    with pytest.raises(ModelError) as caught:
        penode_gen.load(tmp_path / "model.toml")
    (problem,) = caught.value.problems
    assert line in problem and "model.toml:" in problem


def test_a_parameter_that_changes_nothing_is_refused(tmp_path: Path) -> None:
    spare = 'spare = { value = 1, unit = "kg", tunable = true }'
    with pytest.raises(ModelError) as caught:
        axle(
            tmp_path,
            "rk4",
            False,
            ("[inputs]", f"{spare}\n\n[inputs]"),
            ("m = { start", "spare = { start = 1, walk = 1, min = 0, max = 2 }\nm = { start"),
        )
    assert "filter.parameters.spare: changes neither a rate nor a sensor of the filter; remove it" in caught.value.problems[0]


def test_a_limit_may_hold_a_parameter(tmp_path: Path) -> None:
    limit = '[filter.limits]\nheavy = { value = "2*m", unit = "kg", max = 6 }\n\n[filter.states]'
    found = {one.name: one for one in axle(tmp_path, "rk4", False, ("[filter.states]", limit)).filter.limits}
    assert found["heavy"].coefficients == {"m": 1.0} and found["heavy"].most == 3.0 and list(found) == ["worn", "m", "heavy"]


@pytest.mark.parametrize("double", [False, True])
def test_the_c_gives_no_warning(tmp_path: Path, double: bool) -> None:
    """As test_filter_file.py has it; of the model that the filter steps, too."""
    penode_gen.generate(penode_gen.load(MASS), tmp_path, self_test=False)
    options = ["-std=c99", "-fsyntax-only", "-Werror", *(f"-I{ROOT / part}" for part in ("inc", "port/gnu"))]
    options += ["-DPEN_REAL_DOUBLE"] if double else []
    silent = [f"-Wno-{w}" for w in ("padded", "documentation", "declaration-after-statement", "unsafe-buffer-usage", "double-promotion")]
    strict = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Wshadow", "-Wfloat-equal", "-Wundef", "-O2"]
    for name in ("mass_ekf", "mass_augmented"):
        subprocess.run(["clang-19", "-Weverything", *silent, *options, str(tmp_path / f"{name}.c")], check=True)
        subprocess.run(["gcc", *strict, *options, str(tmp_path / f"{name}.c")], check=True)


@pytest.mark.parametrize("place", sample(["sil", "mil"], "sil"))
def test_commands_know_parameters(tmp_path: Path, place: str) -> None:
    """`penode simulate --filter` follows a mass that an exchange of sets changes in the vehicle; `penode tune-filter` fits its walk."""
    axle(tmp_path, "rk4", False, ("m = { start = 0.4, walk = 1e-3", "m = { start = 0.4, walk = 0.3"))
    scenario = 'duration = "4 s"\n[input.foot]\nkind = "chirp"\namplitude = "2 cm"\nstart_frequency = "1 Hz"\nend_frequency = "5 Hz"\n'
    exchange = '[[instance]]\nname = "driven"\nset = "default"\n[[instance.exchange]]\nhow = "select"\ntime = "1 s"\nset = "loaded"\n'
    (tmp_path / "ride.toml").write_text(scenario + exchange)
    words = [sys.executable, "-m", "penode_sil", "simulate", tmp_path / "axle.toml", "--scenario", tmp_path / "ride.toml", "--filter"]
    done = subprocess.run([*map(str, words), "--on", place, "-o", str(tmp_path / "out.csv"), "--json"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    with open(tmp_path / "out.csv", newline="") as file:
        head, *rows = csv.reader(file)
    mass = np.array(rows, float)[:, head.index("m.estimate [kg]")]
    assert mass[900] == pytest.approx(2.0, abs=0.05) and mass[-1] == pytest.approx(2.4, abs=0.05)
    assert json.loads(done.stdout)["instances"][0]["filter"]["errors"]["m"]["within_3_sd"] > 0.8
    given = penode_gen.load(tmp_path / "axle.toml").filter
    more = variances(given, {("parameters", "m"): 10.0})
    assert more["noise"][-1] == pytest.approx(100.0 * variances(given, {})["noise"][-1]) and more["start"] == variances(given, {})["start"]
