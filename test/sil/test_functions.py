# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""sin, cos, sqrt, log and atan in a model: the same bits and a constant number of instructions everywhere, and right."""

from __future__ import annotations

import numpy as np
import pytest
from places import HERE
from samples import sample
from test_targets import BOARDS, HARD_FLOAT, need

import penode_gen
from penode_sil import mil
from penode_sil.batch import Batch
from penode_sil.scenario import Instance
from penode_sil.signals import Samples
from penode_sil.status import FLAGS
from penode_sil.targets import Pil, Sil

SAMPLES = 3000
NONFINITE = "step_nonfinite"


@pytest.fixture(scope="module")
def model() -> penode_gen.Model:
    return penode_gen.load(HERE / "models" / "functions.toml")


def drive(samples: int = SAMPLES) -> np.ndarray:
    """Strong enough for several turns, and a tank that fills and empties; [samples, 2]."""
    t = np.arange(samples) * 1e-3
    return np.column_stack([30 * np.sin(2 * np.pi * 0.4 * t), 0.06 + 0.05 * np.cos(7 * t)])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_step_follows_the_reference(model, dtype):
    t = np.arange(SAMPLES) * 1e-3
    u = drive()
    signals = {name: Samples(t, u[:, i]) for i, name in enumerate(("drive", "flow"))}
    exact = mil.solve(model, Instance("i", "default"), signals, t[-1], t, 1)
    run = Sil(model, dtype).run(u)
    assert np.ptp(exact.x[:, 0]) > 2 * np.pi  # all four quadrants
    # ROS2 at 1 ms: some h^2 |x'''| / 12 t = 1e-6 / 12 * (50/s)^2 * 3 rad * 3 s < 2e-3; float's rounding is far below
    assert np.max(np.abs(run.x - exact.x)) < 2e-3
    assert np.max(np.abs(run.z - exact.z)) < 2e-3 * 10  # log(level) at 0.1 m


@pytest.mark.parametrize("machine", sample(BOARDS, "m3", "m4f"))
def test_boards_have_the_bits_of_the_host(model, machine):
    need("gcc", "qemu-system-arm", "arm-none-eabi-gcc")
    u = drive(400)
    u[200:] *= 100  # beyond the limits of the inputs, and soon of the angle
    u[[50, 51], 0] = np.nan, np.inf
    sil, pil = Sil(model).run(u), Pil(model, machine).run(u)
    for name in ("x", "y", "z", "status"):
        assert getattr(sil, name).tobytes() == getattr(pil, name).tobytes(), name
    if machine in HARD_FLOAT:
        assert pil.cost["normal"].least == pil.cost["normal"].most


def test_what_has_no_root_is_reported_and_held(model):
    u = drive(1200)
    u[100:, 1] = -1.0  # the tank runs dry
    run = Sil(model).run(u)
    bad = (run.status >> FLAGS.index(NONFINITE)) & 1
    assert not bad[:100].any() and bad[-1] and np.isfinite(run.x).all() and run.x[-1, 2] >= 0


def test_angle_beyond_its_limit_is_reported(model):
    for start, ends in ((4095.0, False), (4097.0, True)):  # the step takes the cosine of twice the angle
        instance, u = Sil(model).instance(), drive(1)[0].astype(np.float32)
        instance.set_state(np.array([start, 0.0, 0.5], np.float32))
        instance.step(u)
        assert bool((int(instance.step(u)[2]) >> FLAGS.index(NONFINITE)) & 1) is ends


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_lanes_have_the_bits_of_the_step(model, dtype):
    u = drive(500)
    run = Batch(model, dtype).run(u, x0=np.array([model.start] * 3), states=model.states, outputs=[o.name for o in model.outputs])
    single = Sil(model, dtype).run(u)
    assert run.x[1].tobytes() == single.x.tobytes() and run.y[2].tobytes() == single.y.tobytes()


def test_quick_lanes_reduce_angles_as_well(model):
    """Reordered sums may cost digits elsewhere, but not in what the reduction of an angle rests on: 500 turns out, the
    pendulum starts to swing as from the same angle near 0, up to the rounding of the angle itself, 3e3 * 2^-53."""
    turns = 2 * np.pi * 500
    x0 = np.array([[0.3, 0.0, 0.5], [0.3 + turns, 0.0, 0.5]])
    run = Batch(model, np.float64, exact=False).run(drive(200), x0=x0, states=model.states, outputs=[])
    assert np.max(np.abs(run.x[0] - (run.x[1] - [turns, 0, 0]))) < 1e-10
