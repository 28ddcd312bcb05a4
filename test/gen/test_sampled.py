# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Actuators that delay or hold the samples of an input: C, batch, exact solution and saved instances against loops written down by hand."""

from __future__ import annotations

import re
import subprocess
import zlib
from pathlib import Path

import numpy as np
import pytest

import penode_gen
from penode_gen.emission.model_c import Emitter
from penode_gen.twins.evaluate import Evaluator
from penode_sil import mil, scenario
from penode_sil.batch import Batch
from penode_sil.signals import Chirp, Samples
from penode_sil.targets import Sil

ROOT = Path(__file__).resolve().parents[2]
FLAGS = "-std=c99 -pedantic -Wall -Wextra -Wconversion -Wsign-conversion -Wshadow -Werror -ffp-contract=off".split()

DRIVE = """
[model]
name = "late"
sample_time = "2 ms"
method = "{method}"
substeps = {substeps}
input = "{input}"
out_of_range = "{out_of_range}"
trial = 6
[parameters]
k_t = {{ value = 0.8, unit = "1", tunable = true }}
[inputs]
tau = {{ unit = "N*m", min = -8, max = 8 }}
z = {{ unit = "m" }}
[actuators]
bus = {{ input = "tau", law = "delay", samples = 3 }}
stage = {{ input = "bus", law = "held", samples = 4 }}
dac = {{ input = "tau", law = "held" }}
torque = {{ input = "stage", law = "gain", gain = "k_t" }}
smooth = {{ input = "dac", law = "lag", time = "20 ms" }}
road = {{ input = "z", law = "delay", samples = 7 }}
[bodies]
drum = {{ inertia = "0.5 kg*m^2" }}
load = {{ mass = "2 kg", start_position = "10 mm" }}
[elements]
drive = {{ between = ["drum", "ground"], law = "expression", force = "-torque - smooth" }}
friction = {{ between = ["drum", "ground"], law = "coulomb_friction", force = "0.7 N*m", transition = "0.3 rad/s" }}
spring = {{ between = ["load", "road"], law = "linear_spring", stiffness = "300 N/m" }}
damper = {{ between = ["load", "road"], law = "linear_damper", damping = "9 N*s/m" }}
[outputs]
stage = {{ value = "stage", unit = "N*m" }}
bus = {{ value = "bus", unit = "N*m", trial_bound = 1e-30 }}
[sensors]
dac = {{ value = "dac", unit = "N*m" }}
road = {{ value = "road", unit = "m" }}
alpha = {{ value = "der(omega_drum)", unit = "rad/s^2" }}
push = {{ value = "F_damper", unit = "N" }}
"""


@pytest.fixture
def load(tmp_path):
    def one(text: str, name: str = "model") -> penode_gen.Model:
        path = tmp_path / f"{name}.toml"
        path.write_text(text)
        return penode_gen.load(path)

    return one


def drive(method: str = "rk4", input: str = "linear", substeps: int = 1, out_of_range: str = "report") -> str:
    return DRIVE.format(method=method, input=input, substeps=substeps, out_of_range=out_of_range)


def inputs(n: int, seed: int = 1) -> np.ndarray:
    """Torque and road, uneven from sample to sample; the first ones are not zero."""
    draw = np.random.default_rng(seed)
    return np.column_stack([3.0 + np.cumsum(draw.normal(0, 0.6, n)), 0.02 + np.cumsum(draw.normal(0, 1e-3, n))])


def by_hand(tau: list[float], z: list[float]) -> list[tuple[float, float, float, float]]:
    """bus, stage, dac and road at each sample received."""
    found, stage = [], 0.0
    for k in range(len(tau)):
        bus = tau[k - 3] if k >= 3 else tau[0]
        stage = bus if k % 4 == 0 else stage
        found.append((bus, stage, tau[k], z[k - 7] if k >= 7 else z[0]))
    return found


@pytest.mark.parametrize("method, input, substeps", [("rk4", "linear", 1), ("ros2", "cubic", 1), ("euler", "held", 2)])
def test_c_batch_and_evaluator_agree_to_the_bit(load, tmp_path, method, input, substeps):
    """And their signals are the samples of the inputs themselves, bit by bit."""
    text = drive(method, input, substeps)
    model = load(
        text if input != "held" else text.replace('damper = { between = ["load", "road"]', 'damper = { between = ["load", "ground"]')
    )
    u = inputs(80)
    dtype = np.float32 if method == "euler" else np.float64
    run, batch = Sil(model, dtype).run(u), Batch(model, dtype).run(np.stack([u, u[::-1]]), outputs=["stage", "bus"], states=model.states)
    assert not run.status.any()
    wanted = np.array(by_hand(*u.astype(dtype).T.tolist()), dtype=dtype)
    assert np.array_equal(run.y, wanted[:, [1, 0]]) and np.array_equal(run.z[:, :2], wanted[:, 2:])
    assert all(np.array_equal(a, b[0]) for a, b in ((run.x, batch.x), (run.y, batch.y), (run.z, batch.z)))
    assert np.array_equal(batch.x[1], Sil(model, dtype).run(u[::-1]).x)
    machine = Evaluator(Emitter(model).context(), dtype)
    for sample, x, y in zip(u, run.x, run.y, strict=True):
        assert machine.step(sample.astype(dtype)) and np.array_equal(machine.x, x) and np.array_equal(machine.y, y)
    penode_gen.generate(model, tmp_path)
    include = [f"-I{place}" for place in (ROOT / "inc", ROOT / "port" / "gnu", tmp_path)]
    for source in ("late.c", "late_selftest.c"):
        subprocess.run(["gcc", *FLAGS, "-fsyntax-only", *include, str(tmp_path / source)], check=True)


def test_the_torque_between_samples_is_held_and_not_joined(load):
    """The drum under steps alone, without friction: its rate is the sum of the samples before, and the lag is exp(-h/T) a sample. RK4 errs
    by (h/T)^5/120 of what the lag has before it in each substep, 8e-11 of 6 N*m: 1.2e-7 N*m after 240 substeps, and 2.4e-7 of that over
    0.5 kg*m^2 in 1 s. Straight lines would err by half a step of the torque, some 0.1 N*m."""
    model = load(drive(substeps=4).replace("0.7 N*m", "0 N*m"))
    u, h = inputs(60), 2e-3
    signals = np.array(by_hand(*u.T.tolist()))
    run = Sil(model, np.float64).run(u)
    x = dict(zip(model.states, run.x.T, strict=True))
    speed = smooth = 0.0
    for k in range(1, 60):
        level, fade = signals[k - 1, 2], np.exp(-h / 0.02)
        speed += (0.8 * signals[k - 1, 1] * h + level * h + (smooth - level) * 0.02 * (1 - fade)) / 0.5
        smooth = level + (smooth - level) * fade
        assert abs(x["smooth"][k] - smooth) < 1e-6 and abs(x["omega_drum"][k] - speed) < 1e-6


def test_the_exact_solution_is_what_smaller_steps_come_to(load):
    """RK4 in 2 ms with 20 substeps on lines between samples against the exact solution on the same lines: order 4, 1e-9 of some rad/s."""
    model = load(drive(substeps=20))
    n = 60
    u, times = inputs(n), np.arange(n) * 2e-3
    plan = scenario.Instance("late", "default")
    signals = {name: Samples(times, column) for name, column in zip(("tau", "z"), u.T, strict=True)}
    exact = mil.solve(model, plan, signals, float(times[-1]), times, 1)
    run = Sil(model, np.float64).run(u)
    assert np.max(np.abs(exact.y - run.y)) < 1e-12
    assert np.max(np.abs(exact.x - run.x)) < 1e-7
    assert np.max(np.abs(exact.z[:, :3] - run.z[:, :3])) < 1e-6


def test_a_delay_of_a_smooth_input_is_that_input_later(load):
    """The exact solution with a chirp is the solution without the delay, later by it: the load is at rest until then."""
    text = drive().replace('start_position = "10 mm"', 'start_position = "0 mm"')
    model, undelayed = (
        load(text),
        load(text.replace('input = "z", law = "delay", samples = 7', 'input = "z", law = "gain", gain = "1"'), "u"),
    )
    times, late = np.arange(200) * 2e-3, 14e-3
    signals = {"tau": Chirp(0.0, 1.0, 0.0, 0.0), "z": Chirp(0.01, 2.0, 3.0, 0.0)}
    plan = scenario.Instance("late", "default")
    a = mil.solve(model, plan, signals, float(times[-1]), times, 1)
    b = mil.solve(undelayed, plan, signals, float(times[-1]), times, 1)
    at = model.states.index("z_load")
    assert np.max(np.abs(a.x[7:, at] - b.x[:-7, at])) < 1e-9 and not a.x[:7, at].any()
    assert late == pytest.approx(7 * model.sample_time)


def test_a_saved_instance_continues_with_the_same_bits(load):
    model = load(drive("ros2", "cubic"))
    sil, u = Sil(model, np.float64), inputs(60)
    for cut in (0, 1, 2, 5, 6, 7, 8, 23):
        first, second = sil.instance(), sil.instance()
        for k in range(cut):
            first.step(u[k])
        for k in range(11):
            second.step(u[-k])
        saved = first.save()
        assert second.restore(saved) == 0
        for k in range(cut, 60):
            assert all(np.array_equal(a, b) for a, b in zip(first.step(u[k]), second.step(u[k]), strict=True))
    for at in range(len(saved) - 4 * 8, len(saved)):  # the end of the rings, and their checksum
        broken = bytearray(saved)
        broken[at] ^= 1
        before = second.save()
        assert second.restore(bytes(broken)) != 0 and second.save() == before


@pytest.mark.parametrize("out_of_range", ["report", "hold"])
def test_a_sample_that_is_not_received_does_not_count(load, out_of_range):
    """As if it had not been there; also for the batch, which reports it."""
    model = load(drive(out_of_range=out_of_range))
    u = np.clip(inputs(40), -7, 7)
    bad = u.copy()
    bad = np.insert(bad, [0, 5, 5, 9, 30], [[np.nan, 0.0]], axis=0)
    good = np.isfinite(bad).all(axis=1)
    run = Sil(model, np.float64).run(bad)
    whole = Sil(model, np.float64).run(u)
    assert np.array_equal(run.y[good], whole.y) and np.array_equal(run.x[good], whole.x)
    batch = Batch(model).run(np.stack([bad, bad]), outputs=["stage", "bus"], states=model.states)
    assert np.array_equal(batch.x[1], run.x) and np.array_equal(batch.y[1][good], run.y[good])
    if out_of_range == "hold":
        beyond = np.where(np.isnan(bad), 9.0, bad)
        assert np.array_equal(Sil(model, np.float64).run(beyond).y[good], whole.y)


def test_set_input_restarts_the_past(load):
    model = load(drive())
    sil, u = Sil(model, np.float64), inputs(30)
    instance = sil.instance()
    for k in range(9):
        instance.step(u[-k])
    assert instance.set_input(u[0]) == 0
    assert np.array_equal(instance.get_input(), u[0])
    wanted = by_hand(*u.T.tolist())
    assert [tuple(instance.step(u[k])[1]) for k in range(1, 30)] == [(w[1], w[0]) for w in wanted[1:]]


def test_the_jacobian_is_that_of_differences(load):
    """Of the step along its inputs and signals, by states and outputs that follow from changed samples. Central differences of 1e-5 err by
    1e-10 of the third derivative of tanh(v/0.3), 7e-8 per sample of 2 ms; 1e-6 of derivatives up to 0.1."""
    model = load(drive(input="parabola"))
    sil, n, k = Sil(model, np.float64), 7, 20
    u = inputs(40)
    n_x, n_y = len(model.states), 2

    def after(change: int, column: int, by: float) -> np.ndarray:
        v = u.copy()
        v[change, column] += by
        run = sil.run(v[: k + 1])
        return np.concatenate([run.x[k], run.y[k]])

    instance = sil.instance()
    for sample in u[:k]:
        instance.step(sample)
    width = len(model.inputs) + 4
    _, flat, status = instance.step_jacobian(u[k], n_x * n_x + 3 * n_x * width + n_y * n_x + 3 * n_y * width)
    assert status == 0
    x_u_before, x_u, x_u_earlier = np.split(flat[n_x * n_x : n_x * n_x + 3 * n_x * width].reshape(3 * n_x, width), 3)
    by = 1e-5
    assert n == 7
    # z reaches sample k through `road` alone: sample k - 7 is its column of this sample, k - 8 that of the one before
    for late, columns in ((7, x_u), (8, x_u_before), (9, x_u_earlier)):
        found = (after(k - late, 1, by) - after(k - late, 1, -by))[:n_x] / (2 * by)
        earlier = np.zeros(n_x)
        if late > 7:  # and through the state before, which the Jacobian of this step has in x_x
            run = [
                sil.run(np.where((np.arange(40) == k - late)[:, None] & np.array([False, True]), u + sign * by, u)[:k]).x[-1]
                for sign in (1, -1)
            ]
            earlier = flat[: n_x * n_x].reshape(n_x, n_x) @ ((run[0] - run[1]) / (2 * by))
        assert np.max(np.abs(found - earlier - columns[:, width - 1])) < 1e-6
    held = (after(k - 1, 0, by) - after(k - 1, 0, -by))[:n_x] / (2 * by)
    assert np.max(np.abs(held - x_u_before[:, 4])) < 1e-6 and not x_u[:, 4].any()


def test_a_new_set_is_tried_on_delayed_samples(load):
    """The trial steps through kept samples: with the running set's own values nothing differs, so a bound of 1e-30 is kept."""
    instance = Sil(load(drive()), np.float64).instance()
    for sample in inputs(20):
        instance.step(sample)
    assert instance.begin_copy(5) == 0 and instance.commit() == 0


def test_damage_in_the_past_wears_off(load):
    """Any place and any sample that an instance keeps of its past. 8 samples later (the longest delay, and the one that the step integrates
    from), the delayed torque is that of an instance that was not damaged, and the hold shows one of its last four samples."""
    sil, u = Sil(load(drive()), np.float64), inputs(60)
    whole, size = sil.instance(), 3 * 4 + 10 * 8 + 4
    for sample in u[:30]:
        whole.step(sample)
    saved = whole.save()
    wanted = [tuple(whole.step(sample)[1]) for sample in u[30:]]
    at = [len(saved) - size + 4 * k for k in range(3)] + [len(saved) - 4 - 8 * k for k in range(1, 11)]
    for k, place in enumerate(at):
        for bits in (b"\xff\xff\xff\xff", b"\x07\x00\x00\x00", b"\x00\x00\x00\x80") if k < 3 else (b"\xff" * 8, b"\x77" * 8):
            broken = bytearray(saved)
            broken[place : place + len(bits)] = bits
            broken[-4:] = zlib.crc32(bytes(broken[:-4])).to_bytes(4, "little")
            instance = sil.instance()
            assert instance.restore(bytes(broken)) == 0
            found = [tuple(instance.step(sample)[1]) for sample in u[30:]]
            assert [y[1] for y in found[8:]] == [y[1] for y in wanted[8:]]
            assert all(y[0] in [w[1] for w in wanted[n - 3 : n + 1]] for n, y in list(enumerate(found))[8:])


FAULTS = {
    "slot": ("(at % n) * full", "((at + 1U) % n) * full"),
    "first sample": ("return (at == 0U) ? 1U : 0U;", "return (at == 1U) ? 1U : 0U;"),
    "round": ("late_past_next(*at + received, 2U * n, n)", "late_past_next(*at + received, 2U * n, 0U)"),
    "received": ("late_past_pick(received, ring[slot], sample)", "sample"),
    "period": ("return (at < end) ? at : begin;", "return (at <= end) ? at : begin;"),
}


@pytest.fixture(scope="module")
def runtime(tmp_path_factory) -> Path:
    """The runtime's objects as one, in double."""
    made = tmp_path_factory.mktemp("runtime") / "runtime.o"
    subprocess.run([*DOUBLE, "-r", "-nostdlib", f"-I{ROOT / 'inc'}", *map(str, (ROOT / "src").glob("*.c")), "-o", str(made)], check=True)
    return made


@pytest.mark.parametrize("fault", [None, *FAULTS])
def test_faults_are_found(load, runtime, tmp_path, fault):
    """Changed C does not give the samples of the loop by hand; as it is, it does."""
    penode_gen.generate(load(drive()), tmp_path)
    if fault:
        text = (tmp_path / "late.c").read_text()
        assert text.count(FAULTS[fault][0]) == 1
        (tmp_path / "late.c").write_text(text.replace(*FAULTS[fault]))
    (tmp_path / "main.c").write_text(LOOP)
    include = [f"-I{place}" for place in (ROOT / "inc", ROOT / "port" / "gnu", tmp_path)]
    program = tmp_path / "check"
    sources = [str(tmp_path / name) for name in ("late.c", "late_params.c", "main.c")]
    subprocess.run([*DOUBLE, *include, str(runtime), *sources, "-o", str(program)], check=True)
    u = np.insert(inputs(40), [2, 9, 9], [[np.nan, 0.0]], axis=0)
    lines = subprocess.run(
        [str(program)], input="".join(f"{a!r} {b!r}\n" for a, b in u.tolist()), text=True, capture_output=True, check=True
    ).stdout
    found = [tuple(map(float, line.split())) for line, good in zip(lines.splitlines(), np.isfinite(u).all(axis=1), strict=True) if good]
    assert (found == [(w[1], w[0]) for w in by_hand(*inputs(40).T.tolist())]) is (fault is None)


DOUBLE = ["gcc", "-std=c99", "-O0", "-ffp-contract=off", "-DPEN_REAL_DOUBLE", f"-I{ROOT / 'port' / 'gnu'}"]
LOOP = """
#include <stdio.h>
#include "late.h"
int main(void)
{
    static late_t self;
    late_u_t u;
    late_y_t y;
    if (late_init(&self, &late_set_default, NULL) != PEN_OK) { return 1; }
    while (scanf("%lf %lf", &u.tau, &u.z) == 2) {
        (void)late_step(&self, &u, &y);
        printf("%.17g %.17g\\n", y.stage, y.bus);
    }
    return 0;
}
"""


@pytest.mark.parametrize(
    "old, new, what",
    [
        ("samples = 3", "samples = 0", "actuators.bus.samples: 0 is out of range; give a whole number of samples, 1 to 10000"),
        ("samples = 3", "samples = 10001", "10001 is out of range"),
        ('law = "delay", samples = 3', 'law = "delay"', "'samples' is missing; add samples = ..."),
        ("samples = 3", 'samples = 3, time = "6 ms"', "the law 'delay' has no time; give a number of samples, such as samples = 5"),
        ("samples = 4", 'samples = 4, start = "1 N*m"', "the law 'held' has no start; remove it"),
        ('gain = "k_t"', 'gain = "k_t", samples = 2', "the law 'gain' has no samples"),
        ('gain = "k_t"', 'gain = "k_t", start = "1 N*m"', "the law 'gain' has no start"),
        (
            'road = {{ input = "z"',
            'road = {{ input = "smooth"',
            "'smooth' is made by the law 'lag', and 'delay' acts on the samples of an input; let smooth act on what 'road' makes",
        ),
        (
            'between = ["load", "road"]',
            'between = ["load", "stair"]',
            "the model uses the rate of 'stair', which moves in steps; put a lag behind it",
        ),
        ('road = {{ input = "z"', 'drum = {{ input = "z"', "'drum' is taken by the body of that name"),
        ('road = {{ input = "z"', 'smooth_slip = {{ input = "z"', "is no body, point, input or ground"),
    ],
)
def test_refused(tmp_path, old, new, what):
    path = tmp_path / "bad.toml"
    text = DRIVE.replace('road = {{ input = "z"', 'stair = {{ input = "z", law = "held", samples = 2 }}\nroad = {{ input = "z"')
    path.write_text(text.replace(old, new).format(method="rk4", input="linear", substeps=1, out_of_range="report"))
    with pytest.raises(penode_gen.ModelError, match=re.escape(what)):
        penode_gen.load(path)
