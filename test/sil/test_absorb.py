# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A cause as a parameter set of the running code, and a network for what has no name: by SciPy's plants, see test_diagnosis."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest
import test_folder
from samples import sample
from test_diagnosis import MODEL, drive, record, road

import penode_gen
from penode_gen.networks import Affine, Dense, Network
from penode_gen.reading.json_file import read_json
from penode_gen.sets import fold, packing
from penode_sil import diagnosis
from penode_sil.diagnosis.extend import absorb
from penode_sil.recordings.measured import load

PICK = np.random.default_rng(5)
NETWORK = Network(
    (
        Affine(np.array([-0.05]), np.array([10.0]), "centre"),
        Dense(PICK.normal(0, 2, (8, 1)), PICK.normal(0, 1, 8), "tanh"),
        Dense(PICK.normal(0, 1, (8, 8)), PICK.normal(0, 1, 8), "softplus"),
        Dense(PICK.normal(0, 0.1, (1, 8)), np.zeros(1), "identity"),
        Affine(np.array([-500.0]), np.array([1000.0]), "rescale"),
    ),
    np.array([-0.03]),
    np.array([0.03]),
    "spring",
)


def test_derivatives_are_those_of_differences():
    x = np.linspace(-0.04, 0.04, 7)[:, None]
    found = absorb.derivatives(NETWORK, x)
    step = 1e-5  # central: error step^2 / 6 of third derivatives, and 1e-16 * 1000 / step = 1e-8 of rounding
    for k in range(found.shape[1]):
        change = np.eye(1, found.shape[1], k)[0] * step
        up, down = (absorb.moved(NETWORK, sign * change).evaluate(x)[:, 0] for sign in (1, -1))
        assert found[:, k] == pytest.approx((up - down) / (2 * step), rel=1e-6, abs=1e-4)


def test_what_is_written_is_what_was_learnt(tmp_path):
    x = np.linspace(-0.05, 0.05, 200)[:, None]
    wanted = NETWORK.evaluate(x)[:, 0] + 4e6 * x[:, 0] ** 3
    learnt, left = absorb.learn(NETWORK, x, wanted)
    assert left < 0.02 * 4e6 * 0.05**3 / np.sqrt(7.0)  # RMS of the cube over the range, of which a fiftieth
    assert left == pytest.approx(np.sqrt(np.mean((learnt.evaluate(x)[:, 0] - wanted) ** 2)))
    path = tmp_path / "network.json"
    path.write_text(absorb.as_json(learnt))
    again = read_json(path)
    assert again.architecture == NETWORK.architecture
    assert again.evaluate(x) == pytest.approx(learnt.evaluate(x), rel=1e-12)  # ranges are stored, not factors
    assert (again.input_min, again.input_max) == (NETWORK.input_min, NETWORK.input_max)


def test_the_running_code_has_room_for_the_pieces_of_what_was_learnt():
    """pen_fold refuses a set with more of them, so such a one is not offered."""
    learnt = Network(
        (Dense(np.array([[1.0]] * 3), np.arange(3.0), "relu"), Dense(np.ones((1, 3)), np.zeros(1), "identity")), None, None, "x"
    )
    assert fold.pieces(learnt) == 5  # three kinks, four lines, and the one at the centre
    rooms = {(0, "refuse"): True, (4, "refuse"): False, (4, "layers"): True, (5, "refuse"): True}
    for (pieces, more), fits in rooms.items():
        assert absorb.roomy(SimpleNamespace(pieces=pieces, more_pieces=more, outside="extrapolate"), learnt) == fits
    assert absorb.roomy(SimpleNamespace(pieces=4, more_pieces="refuse", outside="extrapolate"), NETWORK)  # tanh has no pieces


def diagnosed(tmp_path, model_text: str, force):
    """Diagnosis of two recordings, one held out; everything lies in tmp_path."""
    (tmp_path / "car.toml").write_text(model_text)
    model = penode_gen.load(tmp_path / "car.toml")
    paths = [record(tmp_path / f"{seed}.csv", road(seed), drive(road(seed), force), seed) for seed in (1, 2)]
    train, holdout = (load([path], model) for path in paths)
    return model, diagnosis.diagnose(model, train, holdout, tmp_path / "found")


def test_a_law_is_absorbed_by_the_network_beside_it(tmp_path):
    element = 'spring_nn = { between = ["body", "wheel"], law = "network", network = "net" }'
    text = MODEL.replace("[outputs]", f'{element}\n[networks]\nnet = {{ inputs = ["m"], output = "N" }}\n[outputs]')
    neurons = {"activation": "tanh", "weights": [[40.0], [-60.0], [90.0]], "bias": [0.3, 0.5, -0.2]}
    weak = {"activation": "identity", "weights": [[0.1, 0.1, 0.1]], "bias": [0.0]}
    (tmp_path / "net.json").write_text(json.dumps({"layers": [neurons, weak]}))
    model, found = diagnosed(tmp_path, text + '[sets.default]\nnet = "net.json"\n', lambda s, v: 1.5e7 * s**3)
    assert [(c.kind, c.where) for c in found.causes] == [("cubic_spring", "spring")]
    assert found.absorbed["networks"].keys() == {"net"}
    again = penode_gen.load(tmp_path / "found" / absorb.FILE)
    assert packing.layout(again) == packing.layout(model)  # so the running code takes the set
    for name, gain in found.absorbed["gain"].items():
        # the law is missed by less than a tenth, and parameters within tolerance are not part of the set
        assert gain.after_rmse - gain.noise_floor < 0.2 * (gain.before_rmse - gain.noise_floor), name


def moved(tmp_path, force):
    """The same of spring and damper alone, which are moved from rest by twelve harmonics."""
    (tmp_path / "rig.toml").write_text(test_folder.MODEL)
    model, paths = penode_gen.load(tmp_path / "rig.toml"), []
    for seed in (1, 2):
        path = test_folder.record(tmp_path / f"{seed}.csv", seed, 0.0)
        t, x, f = np.loadtxt(path, delimiter=",", skiprows=1, unpack=True)
        columns = np.stack([t, x, f + force(x, np.gradient(x, t))], axis=1)
        np.savetxt(path, columns, delimiter=",", header="time [s],x [m],force [N]", comments="", fmt="%.9g")
        paths.append(path)
    train, holdout = (load([path], model) for path in paths)
    return model, diagnosis.diagnose(model, train, holdout, tmp_path / "found")


@pytest.mark.parametrize("vehicle", sample([False, True], False))
def test_what_has_no_name_is_taken_by_a_network_without_one(tmp_path, vehicle):
    """Damping that depends on the deflection is on no list."""

    def force(s, v):
        return 2500.0 * np.tanh((s / 0.006) ** 2) * v

    _, found = diagnosed(tmp_path, MODEL, force) if vehicle else moved(tmp_path, force)
    assert (found.verdict, [c.kind for c in found.causes]) == ("unexplained", ["outside_taxonomy"])
    assert "nameless_k1*tanh(" in (tmp_path / "found" / "model_extended.toml").read_text()
    assert any("without a name" in note for note in found.notes)
    for gain in found.gain.values():
        assert gain.after_rmse < 0.5 * gain.before_rmse


def test_nothing_is_invented_without_structure_or_without_a_cause_in_motion(tmp_path):
    _, found = diagnosed(tmp_path, MODEL, lambda s, v: 0.0)
    assert (found.verdict, found.causes, found.absorbed) == ("no_discrepancy", (), {})
    assert "nameless" not in (tmp_path / "found" / "model_extended.toml").read_text()
