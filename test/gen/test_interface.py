# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The interface of generated models: derivatives of sensors and first samples, inputs before a step, saved instances, ranges."""

from __future__ import annotations

from pathlib import Path

import models
import numpy as np
import pytest

import penode_gen
from penode_sil.status import BIT, names
from penode_sil.targets import Sil

ROOT = Path(__file__).resolve().parents[2]
NQVM = ROOT / "gen" / "nqvm"
HISTORY = {"held": 0, "linear": 1, "parabola": 2, "cubic": 3}  # inputs before this one that rates depend on
N_X, N_U, N_Y, N_Z = 3, 2, 2, 2
SENSORS = '[sensors]\na_s = { value = "der(v)", unit = "m/s^2" }\n'
H = 5e-3


def rich(folder: Path, input: str = "linear", method: str = "rk4", head: str = "", **ranges: str) -> penode_gen.Model:
    """The rich model with a second sensor, that goes through the network and the input's rate; `head`: lines of [model]."""
    path = models.rich(folder, method, H, input)
    text = path.read_text().replace("[sensors]\n", SENSORS).replace("[model]\n", f"[model]\n{head}")
    for name, bounds in ranges.items():
        unit = {"F": "N", "z": "m"}[name]
        line = f'{name} = {{ unit = "{unit}" }}'
        assert line in text
        text = text.replace(line, f'{name} = {{ unit = "{unit}", {bounds} }}')
    path.write_text(text)
    return penode_gen.load(path)


@pytest.fixture(scope="module", params=HISTORY)
def kind(request, tmp_path_factory):
    """(model, double) for each interpolation."""
    return request.param, Sil(rich(tmp_path_factory.mktemp(request.param), request.param), np.float64)


def inputs(draw, n):
    return draw.uniform(-1, 1, (n, N_U)) * [1.0, 0.1]


def started(sil, past, x):
    """An instance after these inputs, then at state x."""
    instance = sil.instance()
    for u in past:
        instance.step(u)
    instance.set_state(x)
    return instance


def difference(function, at, index):
    d = np.zeros_like(at)
    d[index] = 1e-5
    return (function(at + d) - function(at - d)) / 2e-5


# Differences: third derivatives (about 1e3) * 1e-10 / 6, and rounding 2^-53 of values of 1e3 (rates of 0.1 m in 5 ms) over 1e-5.
TOLERANCE = {"rtol": 1e-6, "atol": 2e-7}


def test_derivatives_of_the_sensors(kind):
    """Along the state, and each input that a rate looks back to, after one to five samples: fewer than it would look back to at first."""
    input, sil = kind
    moving, draw = HISTORY[input], np.random.default_rng(5)
    for behind in range(1, 6):
        past, x = inputs(draw, behind), draw.uniform(-0.5, 0.5, N_X)
        found, status = started(sil, past, x).sensors_jacobian(N_Z * (N_X + N_U * (1 + moving)))
        assert not status & ~BIT["outside"]
        z_x = found[: N_Z * N_X].reshape(N_Z, N_X)
        z_u = found[N_Z * N_X :].reshape(1 + moving, N_Z, N_U)  # along u(k), u(k-1), ...
        for i in range(N_X):
            np.testing.assert_allclose(z_x[:, i], difference(lambda v, past=past: started(sil, past, v).sensors(), x, i), **TOLERANCE)
        for back in range(5):
            for i in range(N_U):
                along = z_u[back, :, i] if back <= moving else np.zeros(N_Z)
                if back < behind:
                    column = difference(lambda v, x=x: started(sil, v, x).sensors(), past, (behind - 1 - back, i))
                    np.testing.assert_allclose(along, column, **TOLERANCE)
                else:
                    assert not along.any()  # there was no such sample


def flatten(found, moving):
    """The parts of the jacobian struct by name."""
    shapes = [("x_x", N_X, N_X), ("x_u_before", N_X, N_U), ("x_u", N_X, N_U)]
    shapes += [(name, N_X, N_U) for name in ("x_u_earlier", "x_u_earliest")[: max(moving - 1, 0)]]
    shapes += [("y_x", N_Y, N_X), ("y_u", N_Y, N_U), *((name, N_Y, N_U) for name in ("y_u_before", "y_u_earlier", "y_u_earliest")[:moving])]
    parts, at = {}, 0
    for name, rows, columns in shapes:
        parts[name] = found[at : at + rows * columns].reshape(rows, columns)
        at += rows * columns
    assert at == len(found)
    return parts


def entries(moving):
    return N_X * N_X + N_X * N_U * max(moving + 1, 2) + N_Y * N_X + N_Y * N_U * (1 + moving)


def test_derivatives_at_the_first_sample(kind):
    """It stays where it is and has no rate: the outputs depend on this input alone, and directly."""
    input, sil = kind
    moving, draw = HISTORY[input], np.random.default_rng(6)
    x, u = draw.uniform(-0.5, 0.5, N_X), inputs(draw, 1)[0]
    instance = started(sil, [], x)
    _, found, status = instance.step_jacobian(u, entries(moving))
    assert status == 0 and np.array_equal(instance.get_state(), x)
    j = flatten(found, moving)
    assert np.array_equal(j["x_x"], np.eye(N_X)) and not j["x_u"].any() and not j["x_u_before"].any()
    for i in range(N_U):
        np.testing.assert_allclose(j["y_u"][:, i], difference(lambda v: started(sil, [], x).step(v)[1], u, i), **TOLERANCE)
    for name in ("y_u_before", "y_u_earlier", "y_u_earliest")[:moving]:
        assert not j[name].any()


def test_derivatives_after_an_input_was_set(kind):
    """That input is the one before: rates count from it, curves do not yet."""
    input, sil = kind
    moving, draw = HISTORY[input], np.random.default_rng(7)
    x, (before, now) = draw.uniform(-0.5, 0.5, N_X), inputs(draw, 2)

    def start(at):
        instance = started(sil, inputs(np.random.default_rng(8), 6), x)
        assert instance.set_input(at) == 0
        return instance

    def both(instance, u):
        state, y, _ = instance.step(u)
        return np.concatenate([state, y])

    _, found, status = start(before).step_jacobian(now, entries(moving))
    assert not status & ~BIT["outside"]
    j = flatten(found, moving)
    for i in range(N_U):
        column = difference(lambda v: both(start(before), v), now, i)
        np.testing.assert_allclose(j["x_u"][:, i], column[:N_X], **TOLERANCE)
        np.testing.assert_allclose((j["y_x"] @ j["x_u"] + j["y_u"])[:, i], column[N_X:], rtol=1e-6, atol=1e-5)
        column = difference(lambda v: both(start(v), now), before, i)
        np.testing.assert_allclose(j["x_u_before"][:, i], column[:N_X], **TOLERANCE)
        direct = j["y_u_before"] if moving else 0.0
        np.testing.assert_allclose((j["y_x"] @ j["x_u_before"] + direct)[:, i], column[N_X:], rtol=1e-6, atol=1e-5)
    for name in ("x_u_earlier", "x_u_earliest", "y_u_earlier", "y_u_earliest"):
        assert name not in j or not j[name].any()


def test_input_before_the_step(kind):
    """Whatever came before: a set input is to the step what a single sample of it would be, to the bit, and so are the steps that
    follow."""
    _, sil = kind
    draw = np.random.default_rng(9)
    for behind in range(6):
        past, x, (before, *later) = inputs(draw, behind), draw.uniform(-0.5, 0.5, N_X), inputs(draw, 12)
        instance, twin = started(sil, past, x), started(sil, [before], x)
        assert instance.set_input(before) == 0 and np.array_equal(instance.get_input(), before)
        for u in later:
            for a, b in zip(instance.step(u), twin.step(u), strict=True):
                assert np.array_equal(a, b)
            assert np.array_equal(instance.sensors(), twin.sensors()) and np.array_equal(instance.get_input(), u)
    assert names(instance.set_input([np.nan, 0.0])) == ["input_nonfinite"] and np.array_equal(instance.get_input(), later[-1])
    assert names(instance.set_input([0.0, -np.inf])) == ["input_nonfinite"]
    for a, b in zip(instance.step(u), twin.step(u), strict=True):
        assert np.array_equal(a, b)


def test_outputs_before_the_first_good_sample_are_0(kind):
    instance = kind[1].instance()
    assert not np.any(instance.step([np.nan, 0.0])[1]) and np.any(instance.step([0.0, 0.0])[1])


# -- saved and restored -------------------------------------------------------------------------------------------------

PHASES = ("fresh", "plain", "open", "pending", "to be withdrawn", "withdrawn", "adopted", "held")


def bring(instance, phase, other, u):
    """Into a phase of an exchange, after some samples."""
    sil = instance.sil
    if phase == "fresh":
        return
    for row in u:
        instance.step(row)
    values = penode_gen.set_values(sil.model, other, sil.dtype)
    if phase in ("open", "pending", "to be withdrawn", "withdrawn", "adopted"):
        assert instance.begin(penode_gen.set_head(sil.model, other, sil.dtype)) == 0
        assert instance.write(0, values[: len(values) // 2 if phase == "open" else None]) == 0
    if phase in ("pending", "to be withdrawn", "withdrawn", "adopted"):
        assert instance.commit() == 0
    if phase in ("to be withdrawn", "withdrawn"):
        assert instance.withdraw() == 0
    if phase in ("withdrawn", "adopted"):
        assert names(instance.step(u[0])[2] & ~BIT["outside"]) == [phase]
    if phase == "held":
        assert instance.hold(True) == 0


def alike(a, b, u, phase, other):
    """200 further steps, to the bit; with the rest of an exchange on the way."""
    values = penode_gen.set_values(a.sil.model, other, a.dtype)
    for k in range(200):
        for instance in (a, b) if k == 50 else ():
            if phase == "open":
                assert instance.write(len(values) // 2, values[len(values) // 2 :]) == 0 and instance.commit() == 0
            elif phase == "adopted":
                assert instance.rollback() == 0
            elif phase == "held":
                assert instance.hold(False) == 0
            elif phase != "pending":
                assert instance.select(other) == 0
        (x, y, status), (x_b, y_b, status_b) = a.step(u[k]), b.step(u[k])
        assert status == status_b and x.tobytes() == x_b.tobytes() and y.tobytes() == y_b.tobytes()
        assert a.sensors().tobytes() == b.sensors().tobytes() and a.verify(97) == b.verify(97) == 0
        assert bytes(a.running()) == bytes(b.running()) and a.pending() == b.pending()
    assert bytes(a.status()) == bytes(b.status())


@pytest.mark.parametrize("phase", PHASES)
def test_restored_from_any_phase(kind, phase):
    _, sil = kind
    draw = np.random.default_rng(3)
    u, a, b = inputs(draw, 210), sil.instance(), sil.instance()
    bring(a, phase, "heavy", u[:5])
    bring(b, PHASES[PHASES.index(phase) - 3], "heavy", inputs(draw, 7))  # it was about something else
    saved = a.save()
    assert b.restore(saved) == 0 and b.save() == saved
    alike(a, b, u[5:], phase, "heavy")


@pytest.mark.parametrize("phase", PHASES)
def test_restored_with_folded_networks(phase):
    """Pieces are not saved: they are found anew, for whatever set each slot holds."""
    sil = Sil(penode_gen.load(NQVM / "nqvm_folded.toml"))
    u, a, b = 0.02 * np.sin(0.07 * np.arange(210))[:, None], sil.instance(), sil.instance()
    bring(a, phase, "altered_friction", u[:5])
    bring(b, PHASES[PHASES.index(phase) - 3], "altered_friction", u[50:60])
    saved = a.save()
    assert b.restore(saved) == 0 and b.save() == saved
    alike(a, b, u[5:], phase, "altered_friction")


def test_bytes_of_a_model_with_the_same_sets_are_refused():
    """Two methods of one model share their sets, and their instances are of one size."""
    saved, other = Sil(penode_gen.load(NQVM / "nqvm.toml")).instance().save(), Sil(penode_gen.load(NQVM / "nqvm_euler.toml")).instance()
    assert len(saved) == len(other.save()) and names(other.restore(saved)) == ["set_layout"]


def test_bytes_of_another_model_or_type_are_refused(kind, tmp_path):
    _, sil = kind
    saved, instance = sil.instance().save(), sil.instance()
    assert names(sil.instance("heavy").restore(saved)) == ["set_layout"]  # another set was given to init
    assert names(sil.instance(banks=False).restore(saved)) == ["set_layout"]
    bad = bytearray(saved)
    bad[200] ^= 4
    assert names(instance.restore(bytes(bad))) == ["set_checksum"] and instance.restore(saved) == 0


# -- declared ranges ----------------------------------------------------------------------------------------------------

RANGES = {"F": "min = -0.5, max = 0.75", "z": "max = 0.04"}  # one side of z is open
LOW, HIGH = np.array([-0.5, -np.inf]), np.array([0.75, 0.04])


def ranged(folder, what):
    return Sil(rich(folder, head=f'out_of_range = "{what}"\n', **RANGES), np.float64)


def leaves(u):
    return ((u < LOW) | (u > HIGH)).any(axis=1)


def test_out_of_range_is_reported(tmp_path):
    """Used all the same: the bits of the model without ranges."""
    u = inputs(np.random.default_rng(1), 300)
    run, plain = ranged(tmp_path, "report").run(u), Sil(rich(tmp_path), np.float64).run(u)
    assert 100 < leaves(u).sum() < 280 and np.array_equal((run.status & BIT["input_range"]) > 0, leaves(u))
    assert not (plain.status & BIT["input_range"]).any() and np.array_equal(run.status & ~np.uint32(BIT["input_range"]), plain.status)
    assert run.x.tobytes() == plain.x.tobytes() and run.y.tobytes() == plain.y.tobytes() and run.z.tobytes() == plain.z.tobytes()


def test_out_of_range_is_clamped(tmp_path):
    """The bits of the model without ranges whose inputs NumPy has clipped."""
    u = inputs(np.random.default_rng(1), 300)
    sil, plain = ranged(tmp_path, "clamp"), Sil(rich(tmp_path), np.float64).run(np.clip(u, LOW, HIGH))
    run = sil.run(u)
    assert np.array_equal((run.status & BIT["input_range"]) > 0, leaves(u))
    assert run.x.tobytes() == plain.x.tobytes() and run.y.tobytes() == plain.y.tobytes() and run.z.tobytes() == plain.z.tobytes()


@pytest.mark.parametrize("what", ["report", "clamp", "hold"])
def test_inf_is_held_whatever_a_range_says(tmp_path, what):
    """An edge is no guess for a number that is none."""
    sil = ranged(tmp_path, what)
    u = inputs(np.random.default_rng(2), 10) * 0.3
    for bad in ([np.inf, 0.0], [-np.inf, 0.0], [0.0, np.inf], [0.0, -np.inf], [np.nan, 0.0], [np.inf, np.nan]):
        instance, twin = sil.instance(), sil.instance()
        for row in u[:5]:
            instance.step(row), twin.step(row)
        x, _y, status = instance.step(bad)
        assert status & BIT["input_nonfinite"] and x.tobytes() == twin.get_state().tobytes() and np.array_equal(instance.get_input(), u[4])
        for row in u[5:]:
            for a, b in zip(instance.step(row), twin.step(row), strict=True):
                assert np.array_equal(a, b)


def test_out_of_range_is_held(tmp_path):
    """State, outputs and input stay; the run goes on as if the sample had not been."""
    u = inputs(np.random.default_rng(1), 300)
    sil = ranged(tmp_path, "hold")
    run, plain = sil.run(u), Sil(rich(tmp_path), np.float64).run(u[~leaves(u)])
    good = ~leaves(u)
    assert all(names(int(s) & ~BIT["outside"]) == ["held", "input_range"] for s in run.status[~good])
    assert run.x[good].tobytes() == plain.x.tobytes() and run.y[good].tobytes() == plain.y.tobytes()
    for k in np.flatnonzero(~good)[1:]:
        assert np.array_equal(run.x[k], run.x[k - 1]) and np.array_equal(run.y[k], run.y[k - 1])


@pytest.mark.parametrize("what", ["report", "clamp", "hold"])
def test_input_before_the_step_keeps_to_its_range(tmp_path, what):
    """As a sample of it would: used, moved to the edge, or refused."""
    sil = ranged(tmp_path, what)
    x, good, bad = np.array([0.1, -0.2, 0.3]), np.array([0.25, 0.02]), np.array([2.0, 0.03])
    instance, twin = started(sil, [good], x), started(sil, [good if what == "hold" else bad], x)
    status = instance.set_input(bad)
    assert names(status) == ([] if what == "report" else ["input_range"])
    assert np.array_equal(instance.get_input(), {"report": bad, "clamp": [0.75, 0.03], "hold": good}[what])
    for u in ([0.1, 0.01], [0.2, -0.01], [0.3, 0.0]):
        for a, b in zip(instance.step(u), twin.step(u), strict=True):
            assert np.array_equal(a, b)
