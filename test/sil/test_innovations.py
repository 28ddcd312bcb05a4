# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Evidence by innovations: the filter, the observer in the batch, held-out blocks, and whole searches on rigs that share no
integrator with the diagnosis."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from curves import integrate
from samples import sample
from scipy import linalg, stats

import penode_gen
from penode_gen.model import Parameter
from penode_sil.batch import Batch, Observer
from penode_sil.diagnosis.catalogue import FILES, drives
from penode_sil.diagnosis.catalogue.actuators import Drive
from penode_sil.diagnosis.catalogue.form import Motion, Moved
from penode_sil.diagnosis.checks import leftover
from penode_sil.diagnosis.evidence import bench, blocks
from penode_sil.diagnosis.evidence.bench import with_tolerances
from penode_sil.diagnosis.evidence.gain import Gains, Level, riccati
from penode_sil.diagnosis.evidence.observer import MAX_INNOVATION, Filter, Predictor, Record, augmented, sample_noise
from penode_sil.diagnosis.plant import plant
from penode_sil.diagnosis.search import naming
from penode_sil.diagnosis.study import driven
from penode_sil.diagnosis.study.study import begin
from penode_sil.recordings.measured import load

SWING = """
[model]
name = "swing"
sample_time = "4 ms"
[parameters]
J = {{ value = 0.01, unit = "kg*m^2", exact = true }}
k = {{ value = {k}, unit = "N*m/rad"{tolerance} }}
d = {{ value = 0.004, unit = "N*m*s/rad"{tolerance} }}
[inputs]
tau = {{ unit = "N*m" }}
[bodies]
arm = {{ inertia = "J", position = "phi", velocity = "omega" }}
[elements]
spring = {{ between = ["arm", "ground"], law = "linear_spring", stiffness = "k" }}
bearing = {{ between = ["arm", "ground"], law = "linear_damper", damping = "d" }}
motor = {{ between = ["arm", "ground"], law = "expression", force = "-tau" }}
[outputs]
phi = {{ value = "phi", unit = "rad" }}
[sensors]
phi = {{ value = "phi", unit = "rad", noise = 1e-4 }}
"""


LEVER = """
[model]
name = "lever"
sample_time = "1 ms"
[inputs]
u = { unit = "1" }
[outputs]
y = { value = "2*u", unit = "1" }
[sensors]
z = { value = "3*u", unit = "1" }
"""


def swing(folder, torque, seed=1, k=0.64, tolerance=", tolerance = 0.05", seconds=24.0):
    """A model file and a recording of a driven arm with J = 0.01, k = 0.64, d = 0.004 on which torque(phi, omega) acts as well."""
    h, n = 0.004, int(seconds / 0.004)
    rng = np.random.default_rng(seed)
    drive = np.cumsum(rng.standard_normal(n // 25 + 2))
    drive = np.interp(np.arange(n + 1) / 25.0, np.arange(len(drive)), drive - np.linspace(0.0, drive[-1], len(drive)))
    drive *= 0.25 / np.std(drive)
    tau, fine = drive.tolist(), 4

    def rates(time, x):
        i = min(int(time / h + 1e-6), n - 1)
        pushed = tau[i] + (tau[i + 1] - tau[i]) * (time / h - i)
        return x[1], (pushed - 0.64 * x[0] - 0.004 * x[1] - torque(x[0], x[1])) / 0.01

    angle = integrate(rates, [0.0, 0.0], h, n, fine)[0][0]
    rows = np.column_stack([np.arange(n) * h, drive[:n], angle + 1e-4 * rng.standard_normal(n)])
    (folder / "model.toml").write_text(SWING.format(k=k, tolerance=tolerance))
    np.savetxt(folder / "train_1.csv", rows, delimiter=",", header="time [s],tau [N*m],phi [rad]", comments="", fmt="%.9g")
    model = penode_gen.load(folder / "model.toml")
    return model, [driven.experiment(m, model) for m in load([folder / "train_1.csv"], model)]


def answered(model, experiments):
    places = plant.places(model)
    fastest = plant.linearise(model, places, np.array([model.start]), experiments[0].u[:1]).fastest
    return naming.answer(model, places, experiments, fastest, "default", lambda text: None)


def test_steady_gain_is_that_of_the_recursion():
    """The gain by doubling against 4000 steps of the covariance recursion, where its slowest mode, 0.98 a step, has died out to 1e-35.
    Both add up in double; their condition, 1e4 here, leaves 1e-11."""
    rng = np.random.default_rng(3)
    f = rng.standard_normal((4, 4))
    f *= 0.98 / np.max(np.abs(np.linalg.eigvals(f)))
    h = rng.standard_normal((2, 4))
    root = rng.standard_normal((6, 6))
    joint = root @ root.T
    q, s, r = joint[:4, :4], joint[:4, 4:], joint[4:, 4:]
    k = riccati(f, h, q, s, r)
    p = q.copy()
    for _ in range(4000):
        v = h @ p @ h.T + r
        gain = (f @ p @ h.T + s) @ np.linalg.inv(v)
        p = f @ p @ f.T - gain @ v @ gain.T + q
    forgetting = 2e-6 * 50.0  # FORGETTING moves f by 1e-6, and a mode of 0.98 adds that up 50 times
    assert np.max(np.abs(k - gain)) < (1e-9 + forgetting) * np.max(np.abs(gain))
    assert np.max(np.abs(np.linalg.eigvals(f - k @ h))) < 1.0


def test_filter_predicts_a_mean_over_samples():
    """One state that stays (a = 0) under a rate driven by noise, seen by means over 8 samples: the closed loop, run sample by sample in
    Python, is stable, and its innovations are white: their correlation from one to the next is within 4/sqrt(n) of zero."""
    dt, samples, tau = 0.01, 8, 0.02
    a, c = np.array([[0.0, 1.0], [0.0, -1.0 / tau]]), np.array([[1.0, 0.0]])
    nothing = np.zeros((2, 0)), np.zeros((1, 0))
    linear = plant.Linear(a, nothing[0], nothing[0], c, nothing[1], nothing[1], 0, 1)
    names = "x", "unmodelled0_f"
    gains = Gains(names, names, linear, np.zeros(0), np.array([1.0]), np.array([0.01]), samples * dt, samples)
    k = gains.at(Level(0.5, tau)).gain
    step = linalg.expm(a * dt)
    rng = np.random.default_rng(5)
    truth, follows, nus = np.zeros(2), np.zeros(2), []
    for _ in range(4000):
        beyond = 0.0
        for _ in range(samples):
            # the exact sampled process: the force is held by its own step, the state integrates it
            noise = np.linalg.cholesky(_intensity(tau, dt, 2.0 * 0.25 / tau)) @ rng.standard_normal(2)
            truth, follows = step @ truth + noise, step @ follows
            beyond += (truth[0] + 0.01 * rng.standard_normal() - follows[0]) / samples
        follows = follows + k[:, 0] * beyond
        nus.append(beyond)
    nu = np.array(nus[100:])
    assert abs(np.corrcoef(nu[1:], nu[:-1])[0, 1]) < 4.0 / math.sqrt(len(nu))


def _intensity(tau, dt, q):
    """Covariance of [x, w] over a step dt for w' = -w/tau + white noise of intensity q, x' = w, in closed form."""
    e = math.exp(-dt / tau)
    ww = q * tau / 2.0 * (1.0 - e * e)
    xw = q * tau**2 / 2.0 * (1.0 - e) ** 2
    xx = q * tau**2 * (dt - 2.0 * tau * (1.0 - e) + tau / 2.0 * (1.0 - e * e))
    return np.array([[xx, xw], [xw, ww]])


def test_observer_moves_states_by_the_mean_innovation(tmp_path):
    """The batch with an observer against the same in Python, sample by sample, with the batch for one sample at a time."""
    model, (e,) = swing(tmp_path, lambda s, v: 0.0, seconds=0.4)
    batch = Batch(model)
    gain = np.array([[0.3], [2.0]])
    y = np.array(e.y)
    y[5] = np.nan
    whole = batch.run(e.u, observer=Observer(4, y, gain), states=model.states)
    x = np.zeros(2)
    plain = batch.run(e.u[:4], states=model.states)
    assert np.array_equal(whole.z[0, :4], plain.z[0])
    nu = np.nanmean(y[:4] - plain.z[0], axis=0)
    x = plain.x[0, -1] + gain @ nu
    after = batch.run(e.u[3:8], x0=x, states=model.states)  # its first sample is the start itself
    assert np.max(np.abs(whole.z[0, 4:8] - after.z[0, 1:])) < 1e-15
    nu = np.nanmean(y[4:8] - after.z[0, 1:], axis=0)  # one of these was not measured
    again = batch.run(e.u[7:9], x0=after.x[0, -1] + gain @ nu, states=model.states)
    assert np.max(np.abs(whole.x[0, 8] - again.x[0, 1])) < 1e-14  # rounding of a mean of four, and of one step


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_innovations_are_means_of_measured_less_simulated(tmp_path, dtype):
    """To the bit, added in the order of the samples; NaN where nothing was measured since the update before. 19 runs: no multiple of any
    number of lanes. The last 2 of 102 samples have no update."""
    (tmp_path / "model.toml").write_text(SWING.format(k=0.64, tolerance="") + 'rate = { value = "omega", unit = "rad/s" }\n')
    model = penode_gen.load(tmp_path / "model.toml")
    rng, runs, n, update = np.random.default_rng(2), 19, 102, 5
    u, x0 = 0.01 * rng.standard_normal((n, 1)), 0.1 * rng.standard_normal((runs, 2))
    y = 0.1 * rng.standard_normal((runs, n, 2)).astype(dtype)
    y[rng.random(y.shape) < 0.3] = np.nan
    y[:, 10:15], y[4], y[5, :35] = np.nan, np.nan, np.nan
    batch, gain = Batch(model, dtype), rng.uniform(0.0, 0.5, (runs, 2, 2))
    run = batch.run(u, x0=x0, observer=Observer(update, y, gain), states=model.states)
    total, count = np.zeros((2, runs, n // update, 2), dtype)
    for k in range(n // update * update):
        there = np.isfinite(y[:, k])
        total[:, k // update] += np.where(there, y[:, k] - run.z[:, k], dtype(0.0))
        count[:, k // update] += there
    means = np.where(count > 0, total / np.maximum(count, 1), dtype(np.nan))
    assert run.nu.dtype == dtype and np.array_equal(run.nu, means, equal_nan=True)
    assert np.isnan(run.nu[4]).all() and np.isnan(run.nu[:, 2]).all() and np.isnan(run.nu[5, :7]).all()
    assert np.isfinite(run.nu[6, 3:]).any() and (run.first_bad < 0).all()
    less = batch.run(u, x0=x0, observer=Observer(update, y, gain), sensors=())  # sensors need not be kept for it
    assert less.z.shape == (runs, n, 0) and np.array_equal(less.nu, run.nu, equal_nan=True)
    assert batch.run(u, x0=x0).nu.shape == (runs, 0, 2)


def test_a_model_without_states_has_innovations_too(tmp_path):
    (tmp_path / "lever.toml").write_text(LEVER)
    y = np.arange(8.0)[:, None]
    nu = Batch(penode_gen.load(tmp_path / "lever.toml")).run(np.ones((8, 1)), observer=Observer(4, y, np.zeros((0, 1)))).nu
    assert nu.tolist() == [[[1.5 - 3.0], [5.5 - 3.0]]]


def test_innovations_of_a_run_that_left_all_bounds_stay_within_theirs(tmp_path):
    """Of an observer that overshoots more each time; one that stayed is not touched by it."""
    model, (e,) = swing(tmp_path, lambda s, v: 0.0, seconds=4.0)
    wide = augmented(model)
    gains = [Filter(np.array([[g], [0.0], [0.0]]), np.ones(1)) for g in (0.3, 5.0)]
    predictor = Predictor(wide, [Record("r", e.step, e.drive, np.array(e.y))], 5)
    both = predictor.predict((), np.zeros((2, 0)), Filter.many(gains))[0]
    alone = predictor.predict((), np.zeros((1, 0)), gains[0])[0]
    assert both.sane[0] and np.array_equal(both.nu[0][0], alone.nu[0][0])
    assert np.max(np.abs(both.nu[0])) == MAX_INNOVATION


def test_width_of_a_students_t():
    """Of 20 000 draws with 4 degrees of freedom and a width of 2: Fisher's information of log width is n (1/2) 4/7, so that its deviation
    is 0.013; five of these."""
    x = 2.0 * stats.t(4).rvs(20000, random_state=7)
    assert abs(math.log(blocks.spread(x, 0.0) / 4.0)) < 2 * 5 * 0.5 * 0.0265


def test_posterior_spreads_where_blocks_disagree():
    """One that is first in all blocks is sure; two that share them are not."""
    assert blocks.posterior([np.array([9.0, 9, 9, 9]), np.zeros(4)])[0] == 1.0
    shared = blocks.posterior([np.array([5.0, 5, 0, 0]), np.array([0.0, 0, 5, 5])])
    assert 0.4 < shared[0] < 0.6  # by symmetry a half; 4000 draws deviate by 0.008


def test_forms_are_linear_in_their_gains(tmp_path):
    """Every form of every file of the catalogue gives finite forces, that are not all zero, along a motion with stops and reversals."""
    model, _ = swing(tmp_path, lambda s, v: 0.0, seconds=0.4)
    t = np.arange(4000) * 0.004
    s = 0.4 * np.sin(3.0 * t) + 0.1 * np.sin(11.0 * t)
    motion = Motion.of([Moved(s, np.gradient(s, t), t, {"+ F_spring": np.abs(s)})], 1.0)
    kinds = set()
    for role, ends in (("force", ("arm", "ground")), ("body", ("arm", "ground")), ("tyre", ("arm", "z_road"))):
        trained = (("spring", "s", -0.2, 0.2, True),) * (role == "force")
        place = plant.Place(ends, (("spring", 1),) if role != "body" else (), role, trained, lacks=("linear_spring", "linear_damper"))
        for file in FILES:
            for form in file.forms(model, 0, place, motion):
                kinds.add(form.kind)
                for part in form.parts:
                    force = part.along(motion.parts[0])
                    assert force.shape == t.shape and np.isfinite(force).all() and np.any(force != 0.0), form
    assert kinds == {k for file in FILES for k in file.KINDS}
    drive = Drive([s], 0.004, 0.04, 1.0)
    channels = [*drives.inputs(model, 1), *drives.bent(model, 0, drive), *drives.sensors(model, 1)]
    assert {f.kind for f in channels} == set(drives.KINDS) - {"input_hold"}


def test_forces_follow_their_shapes(tmp_path):
    """The force of a part is that of its shapes as they are, not as they were proposed: each free shape changes it."""
    model, _ = swing(tmp_path, lambda s, v: 0.0, seconds=0.4)
    t = np.arange(4000) * 0.004
    s = 0.4 * np.sin(3.0 * t) + 0.1 * np.sin(11.0 * t)
    motion = Motion.of([Moved(s, np.gradient(s, t), t)], 1.0)
    place = plant.Place(("arm", "ground"), (("spring", 1),), "force")
    parts = [p for file in FILES for form in file.forms(model, 0, place, motion) for p in form.parts]
    for part in parts:
        for name in set(part.shapes) - set(part.fixed):
            value, unit = part.shapes[name]
            other = replace(part, shapes={**part.shapes, name: (0.7 * value, unit)}).along(motion.parts[0])
            assert np.std(other - part.along(motion.parts[0])) > 1e-3 * np.std(other), (part.law, name)


@pytest.mark.parametrize("share, named", ((0.1, True), (0.03, False)))
def test_a_constant_torque_is_worth_a_name(tmp_path, share, named, show):
    """A constant of this share of what the spring reaches beside waves in it: above 7 %, but for what waves of 3 % may make of it."""
    model, experiments = swing(tmp_path, lambda s, v: share * 0.64 * 0.5 + BENT * math.sin(11.0 * s), 5)
    found = answered(model, experiments)
    show([(c.kind, {k: (v.value, v.ci95) for k, v in c.parameters.items()}) for c in found.causes])
    assert [c.kind for c in found.causes] == ["constant_force"] * named
    if named:
        low, high = found.causes[0].parameters["force"].ci95
        assert low < -share * 0.64 * 0.5 < high


@pytest.mark.parametrize("bent", (False, True))
def test_a_world_with_errors_everywhere_leaves_more_than_noise(tmp_path, bent):
    """Made-up data of the model itself leave noise, by which alone causes may be judged; with waves in the spring they leave more."""
    law = (lambda s, v: 0.03 * 0.64 * 0.3 * math.sin(9.0 * s) + 0.0005 * math.sin(40.0 * v)) if bent else (lambda s, v: 0.0)
    model, experiments = swing(tmp_path, law)
    study = begin(with_tolerances(model), experiments)
    assert leftover.left_over(study, study.null.simulated) == bent


BENT = 0.03 * 0.64 * 0.5  # a spring of waves, 3 % of the force there: no law of the catalogue


@pytest.mark.parametrize("seed", sample((1, 2), 1))
def test_friction_in_a_wrong_world(tmp_path, seed, show):
    """Coulomb friction of 0.06 N*m beside a spring that is bent in waves: one name, and its size within its interval widened by what the
    waves may take of it (their rms, 0.007 N*m)."""
    model, experiments = swing(tmp_path, lambda s, v: 0.06 * math.tanh(v / 0.01) + BENT * math.sin(11.0 * s), seed)
    found = answered(model, experiments)
    show([(c.kind, {k: (v.value, v.ci95) for k, v in c.parameters.items()}) for c in found.causes])
    assert [c.kind for c in found.causes] == ["coulomb_friction"]
    low, high = found.causes[0].parameters["force"].ci95
    assert low - 0.007 < 0.06 < high + 0.007


def test_small_deviations_have_no_name(tmp_path):
    model, experiments = swing(tmp_path, lambda s, v: BENT * math.sin(11.0 * s), 3)
    assert answered(model, experiments).causes == ()


@pytest.mark.parametrize("value, tolerance", ((0.3, 0.0), (0.3, 0.1), (-2.0, 0.1)))
def test_a_parameter_keeps_its_sign(value, tolerance):
    f = bench.parameter(Parameter("d", value, "N*s/m", tolerance))
    assert (f.low, f.high) == ((0.0, np.inf) if value > 0.0 else (-np.inf, 0.0))


def test_parameter_without_a_tolerance(tmp_path, penode):
    """A stiffness that is 12 % off in a file without tolerances: the parameter is named, and no spring of another form."""
    swing(tmp_path, lambda s, v: 0.0, 4, k=0.64 / 1.12, tolerance="")
    penode("diagnose", tmp_path / "model.toml", "--data", tmp_path / "train_1.csv", "-o", tmp_path / "out")
    causes = json.loads((tmp_path / "out" / "diagnosis.json").read_text())["causes"]
    assert [(c["kind"], list(c["parameters"])) for c in causes] == [("wrong_parameter", ["k"])]
    value = causes[0]["parameters"]["k"]
    assert value["ci95"][0] < 0.64 < value["ci95"][1]


def test_noise_of_a_sample_is_what_neighbours_show():
    """White noise of 0.01 on a slow motion, stated as 0.5: 6000 second differences deviate by 1.3 % of it; five of these."""
    rng = np.random.default_rng(2)
    y = np.sin(np.arange(6000) * 1e-3) + 0.01 * rng.standard_normal(6000)
    assert abs(sample_noise([Record("r", 1e-3, np.zeros((6000, 0)), y[:, None])], np.array([0.5]))[0] / 0.01 - 1.0) < 0.065


def test_dressed_model_is_the_model(tmp_path):
    """With biases of 0, scales of 1 and no unmodelled force, to the bit."""
    model, (e,) = swing(tmp_path, lambda s, v: 0.0, seconds=0.4)
    assert np.array_equal(Batch(model).run(e.u).z, Batch(augmented(model)).run(e.u).z)
