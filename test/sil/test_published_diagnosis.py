# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The published case study against the plant that its networks were trained to imitate: what it gets wrong has names."""

from __future__ import annotations

import math

import numpy as np
import pytest
from curves import curve, integrate
from published_reference import road_of_chirp
from samples import sample

from penode_sil import diagnosis
from penode_sil.recordings.measured import load

SECONDS = 10.0
NOISE = {"a_body": 0.02, "deflection": 1e-4}


def spring(s: float) -> float:
    """Progressive spring [N], README of the published numbers."""
    return (500.0 * (s + 0.03)) ** 2 - (500.0 * 0.03) ** 2


def friction(v: float) -> float:
    """Stribeck, Coulomb and viscous friction [N], same source."""
    stribeck = 0.02 / math.sqrt(2.0)
    return math.sqrt(2.0 * math.e) * 10.0 * math.exp(-((v / stribeck) ** 2)) * v / stribeck + 35.0 * math.tanh(v / 0.002) + 150.0 * v


@pytest.fixture(scope="module")
def recordings(shared, tmp_path_factory):
    """The published chirp, and a smaller one as hold-out, through the non-linear plant in steps of 0.5 ms, with noisy sensors."""
    folder, paths = tmp_path_factory.mktemp("measured"), []
    for seed, size in ((1, 1.0), (2, 0.8)):
        t = np.arange(int(SECONDS * 1000) + 1) * 1e-3
        z = size * road_of_chirp(t)
        road = curve(z, 1e-3)

        def rates(time: float, x: list[float], road=road) -> list[float]:
            force = 10e3 * (x[0] - x[1]) + 800.0 * (x[2] - x[3]) + spring(x[0] - x[1]) + friction(x[2] - x[3])
            return [x[2], x[3], -force / 350.0, (force - 300e3 * (x[1] - road(time))) / 90.0]

        x, dx = integrate(rates, [0.0] * 4, 1e-3, len(t))
        rng = np.random.default_rng(seed)
        signals = {"a_body": dx[2], "deflection": x[0] - x[1]}
        columns = [t, z, *(y + NOISE[k] * rng.standard_normal(len(t)) for k, y in signals.items())]
        header = "time [s],z_road [m],a_body [m/s^2],deflection [m]"
        paths.append(folder / f"chirp_{seed}.csv")
        np.savetxt(paths[-1], np.stack(columns, axis=1), delimiter=",", header=header, comments="", fmt="%.9g")
    return paths


@pytest.mark.parametrize("method, input", sample([("rk4", "linear"), ("euler", "held")], ("euler", "held")))
def test_causes_of_the_published_model(published, recordings, tmp_path, show, method, input):
    """The spring beyond what its network was trained on, and the numerics of the explicit Euler method but not of RK4."""
    model = published(method, input)
    found = diagnosis.diagnose(model, load(recordings[:1], model), load(recordings[1:], model), tmp_path / "out")
    show(f"{method}: {found.seconds:.0f} s, {[(c.kind, c.where) for c in found.causes]}")
    named = {(c.kind, c.where) for c in found.causes}
    assert ("network_extrapolation", "spring_nn") in named
    assert any(kind == "integration_error" for kind, _ in named) == (method == "euler")
    for gain in found.gain.values():
        assert gain.after_rmse < 0.5 * gain.before_rmse  # nothing else is left that is as large
