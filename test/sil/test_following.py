# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""An observer that does not follow, a neighbour of a fit that diverges, a block that is against a form, steps that laws ask for."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from curves import integrate

import penode_gen
from penode_sil.diagnosis.catalogue import memory
from penode_sil.diagnosis.evidence.bench import build, with_tolerances
from penode_sil.diagnosis.evidence.fit import _log_determinant
from penode_sil.diagnosis.evidence.observer import Predictor, Record, augmented, sample_noise
from penode_sil.diagnosis.plant import plant
from penode_sil.diagnosis.search import rounds
from penode_sil.diagnosis.study import driven
from penode_sil.recordings.measured import load

WIPER = """
[model]
name = "wiper"
sample_time = "2 ms"
input = "held"
[parameters]
J_m = { value = 2.31e-5, unit = "kg*m^2", tolerance = 0.06 }
J_a = { value = 0.0339, unit = "kg*m^2", tolerance = 0.05 }
ratio = { value = 0.0192307692308, unit = "1", exact = true }
k = { value = 93.7, unit = "N*m/rad", tolerance = 0.12 }
d = { value = 0.479, unit = "N*m*s/rad", tolerance = 0.15 }
b_m = { value = 1.16e-4, unit = "N*m*s/rad", tolerance = 0.15 }
T_f = { value = 1.01, unit = "N*m", tolerance = 0.15 }
[inputs]
T = { unit = "N*m" }
[bodies]
motor = { inertia = "J_m", position = "phi_m", velocity = "omega_m" }
arm = { inertia = "J_a", position = "phi_a", velocity = "omega_a" }
[points]
shaft = "ratio*phi_m"
[elements]
drive = { between = ["motor", "ground"], law = "expression", force = "-T" }
bearing = { between = ["motor", "ground"], law = "linear_damper", damping = "b_m" }
linkage = { between = ["shaft", "arm"], law = "linear_spring", stiffness = "k" }
linkage_d = { between = ["shaft", "arm"], law = "linear_damper", damping = "d" }
blade = { between = ["arm", "ground"], law = "coulomb_friction", force = "T_f", transition = "0.05 rad/s" }
[outputs]
twist = { value = "ratio*phi_m - phi_a", unit = "rad" }
[sensors]
n = { value = "omega_m", unit = "rad/s", noise = 1.0 }
arm = { value = "phi_a", unit = "rad", noise = 0.001 }
"""


def test_a_stick_slip_that_the_observer_does_not_follow_leaves_the_starts_where_they_were(tmp_path):
    """Its friction turns within 0.05 rad/s, 1.7 ms: an observer with corrections every 6 ms diverges to 1e200, and start states had that
    size. The arm moves by 0.7 rad, the motor by 52 times that."""
    h, n = 0.002, 4000
    t = np.arange(n + 1) * h
    torque = np.repeat((0.06 * np.sin(3.5 * t) * np.minimum(t, 1.0))[::5], 5)[: n + 1].tolist()

    def rates(time, x):
        s, v = x[0] / 52.0 - x[2], x[1] / 52.0 - x[3]
        force = 88.0 * s + 0.5 * v
        driving = torque[min(int(time / h + 1e-6), n)]
        return x[1], (driving - 1.2e-4 * x[1] - force / 52.0) / 2.4e-5, x[3], (force - np.tanh(x[3] / 0.05)) / 0.035

    moved = integrate(rates, [0.0] * 4, h, n, 8)[0]
    rng = np.random.default_rng(3)
    seen = moved[1][:n] + rng.standard_normal(n), moved[2][:n] + 0.001 * rng.standard_normal(n)
    np.savetxt(
        tmp_path / "r.csv",
        np.column_stack([t[:n], torque[:n], *seen]),
        "%.9g",
        ",",
        header="time [s],T [N*m],n [rad/s],arm [rad]",
        comments="",
    )
    (tmp_path / "model.toml").write_text(WIPER)
    model = with_tolerances(penode_gen.load(tmp_path / "model.toml"))
    e = driven.experiment(load([tmp_path / "r.csv"], model)[0], model)
    places = plant.places(model)
    fastest = plant.linearise(model, places, np.array([model.start]), e.u[:1]).fastest
    bench = build(model, places, [Record.of(e)], sample_noise([Record.of(e)], np.array([1.0, 0.001])), fastest)
    sizes = np.array([f.unit for f in bench.fit.free if f.target[0] == "start"])
    assert (sizes < 1e3).all() and np.isfinite(bench.fit.cost) and np.isfinite(bench.fit.slopes).all()


SHAFT = """
[model]
name = "shaft"
sample_time = "2 ms"
[parameters]
J_m = { value = 0.013, unit = "kg*m^2" }
J_l = { value = 0.14, unit = "kg*m^2" }
k = { value = 42, unit = "N*m/rad" }
d = { value = 0.08, unit = "N*m*s/rad" }
b = { value = 0.4, unit = "N*m*s/rad" }
gap = { value = 0.002, unit = "rad" }
[inputs]
tau = { unit = "N*m" }
[bodies]
motor = { inertia = "J_m", position = "phi_m", velocity = "omega_m" }
load = { inertia = "J_l", position = "phi_l", velocity = "omega_l" }
[elements]
shaft = { between = ["motor", "load"], law = "expression", force = "k*(max(s - gap, 0) + min(s + gap, 0))" }
shaft_d = { between = ["motor", "load"], law = "linear_damper", damping = "d" }
bearing = { between = ["load", "ground"], law = "linear_damper", damping = "b" }
drive = { between = ["motor", "ground"], law = "expression", force = "-tau" }
[outputs]
twist = { value = "phi_m - phi_l", unit = "rad" }
[sensors]
motor = { value = "phi_m", unit = "rad", noise = 3e-5 }
load = { value = "phi_l", unit = "rad", noise = 7e-5 }
"""


def test_an_offset_of_all_angles_of_a_free_shaft_is_another_start(tmp_path):
    """Without a spring to ground nothing shows it: the slopes along both are opposite. With steps of 1e-3 of a unit, about the noise, a
    play bent what the slopes show: a hundredth of them was left, enough for offsets known to 0.1 mrad in place of 40. Steps of 1e-6 of a
    unit are a thousandth of that, and so is what may be left, 1e-5."""
    h, n = 0.002, 3000
    t = np.arange(n + 1) * h
    torque = (0.5 * np.sin(9.0 * t) + 0.3 * np.sin(23.0 * t)).tolist()

    def rates(time, x):
        s = x[0] - x[1]
        force = 42.0 * (max(s - 0.002, 0.0) + min(s + 0.002, 0.0)) * (1.0 + 0.3 * math.sin(400.0 * s)) + 0.08 * (x[2] - x[3])
        at, share = divmod(time / h, 1.0)
        i = min(int(at), n - 1)
        return x[2], x[3], (torque[i] + share * (torque[i + 1] - torque[i]) - force) / 0.013, (force - 0.4 * x[3]) / 0.14

    moved, rng = integrate(rates, [0.0] * 4, h, n, 8)[0], np.random.default_rng(2)
    seen = moved[0][:n] + 3e-5 * rng.standard_normal(n), moved[1][:n] + 7e-5 * rng.standard_normal(n)
    rows = np.column_stack([t[:n], torque[:n], *seen])
    np.savetxt(tmp_path / "r.csv", rows, "%.9g", ",", header="time [s],tau [N*m],motor [rad],load [rad]", comments="")
    (tmp_path / "model.toml").write_text(SHAFT)
    model = with_tolerances(penode_gen.load(tmp_path / "model.toml"))
    e = driven.experiment(load([tmp_path / "r.csv"], model)[0], model)
    places = plant.places(model)
    fastest = plant.linearise(model, places, np.array([model.start]), e.u[:1]).fastest
    fit = build(model, places, [Record.of(e)], np.array([3e-5, 7e-5]), fastest).fit
    rows = (fit.slopes / np.sqrt(fit.variance)[None, :, None])[fit.used]
    known = {f.target: column / f.unit for f, column in zip(fit.free, rows.T, strict=True)}
    offset = known["motor_bias"] + known["load_bias"]
    start = known["start", 0, 0] + known["start", 0, 1]
    assert np.linalg.norm(offset - start) < 1e-5 * np.linalg.norm(known["motor_bias"])
    assert fit.deviation("motor_bias") > 1e-3


def test_the_width_of_a_posterior_is_finite_where_a_neighbour_diverges():
    """Curvatures of 1e41 beside others: the plain determinant rounds to 0, and its logarithm to minus infinity."""
    rng = np.random.default_rng(1)
    root = rng.standard_normal((5, 30)) * np.geomspace(1.0, 1e6, 5)[:, None]
    assert _log_determinant(root @ root.T) == pytest.approx(np.linalg.slogdet(root @ root.T)[1], abs=1e-9)
    steep = np.full((6, 6), 4.9e41) + np.diag(np.geomspace(1.0, 1e20, 6))
    assert not np.isfinite(np.linalg.slogdet(steep)[1])
    assert 6.0 * np.log(4.9e41) + 5.0 * np.log(1e-12) - 1.0 < _log_determinant(steep) < 6.0 * np.log(4.9e41)


@pytest.mark.parametrize(
    "better, accepted",
    [
        ([80.0, 90.0, -100.0, 94.0], False),
        ([80.0, 90.0, -30.0, 94.0], True),
        ([4.0, 5.0, 11.0, -9.0], True),
        ([4.0, 4.0, 1.0, -0.5], False),
    ],
)
def test_no_block_is_against_a_form_by_more_than_blocks_are_for_it(better, accepted):
    """Friction of a wheel holds it between bumps, where the noise of the road moves a model without: three blocks gain, the one with the
    bump loses."""
    fit = SimpleNamespace(value=lambda target: 1.0, deviation=lambda target, known: 0.1)
    form = SimpleNamespace(how="force")
    trial = SimpleNamespace(form=form, fit=fit, term=SimpleNamespace(free=[SimpleNamespace(target="f", origin=0.0, log=False)]))
    rig = SimpleNamespace(model=None)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rounds, "undetermined", lambda model, fit: ())
        assert rounds._accepted(rig, trial, np.array(better)) == accepted


BRUSH = """
[model]
name = "brush"
sample_time = "2 ms"
[parameters]
m = { value = 1.0, unit = "kg", tolerance = 0.05 }
[inputs]
F = { unit = "N" }
[bodies]
slide = { mass = "m", position = "x", velocity = "v" }
[elements]
push = { between = ["slide", "ground"], law = "expression", force = "-F" }
rail = { between = ["slide", "ground"], LAW }
[outputs]
x = { value = "x", unit = "m" }
[sensors]
x = { value = "x", unit = "m", noise = 1e-5 }
"""


@pytest.mark.parametrize(
    "law, steps",
    [
        ('law = "linear_damper", damping = "4 N*s/m"', 1),
        ('law = "coulomb_friction", force = "2 N", transition = "5 mm/s"', 4),
        ('law = "bouc_wen", force = "2 N", presliding = "0.2 mm"', 8),
        ('law = "lugre_friction", force = "2 N", presliding = "0.2 mm", rise = "0.5", stribeck = "10 mm/s"', 8),
    ],
)
def test_a_fit_takes_the_steps_that_its_laws_ask_for(tmp_path, law, steps):
    """Of a sample of 2 ms; longer ones gave half of the likelihood of a friction with bristles, and other causes had the credit."""
    (tmp_path / "model.toml").write_text(BRUSH.replace("LAW", law))
    model = penode_gen.load(tmp_path / "model.toml")
    record = Record("r", 0.002, np.zeros((100, 1)), np.zeros((100, 1)), smooth=False)
    assert Predictor(augmented(model), [record], 5).steps == 100 * steps


def test_bristles_that_bend_in_less_than_a_sample_have_a_finite_force():
    """0.2 m/s are 20 presliding ways in a sample of 10 ms; the force is between the level at speed and the breakaway."""
    s = 0.05 * np.sin(4.0 * np.arange(0.0, 4.0, 0.01))
    found = memory.force("lugre_friction", {"force": 1.0, "presliding": 1e-4, "rise": 0.5, "stribeck": 0.01}, s, 0.01)
    assert np.isfinite(found).all() and np.max(np.abs(found)) < 1.5
    fast = np.abs(np.gradient(s, 0.01)) > 0.1
    assert np.median(np.abs(found[fast])) == pytest.approx(1.0, abs=1e-3)
