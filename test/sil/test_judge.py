# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""From explanations to a verdict: what each rule of the judge lets through and what it does not."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from penode_sil.diagnosis import broken, judging, noise, resting
from penode_sil.diagnosis.hypotheses import Basis
from penode_sil.diagnosis.result import Cause, Value

ROWS = 10_000
STUDY = SimpleNamespace(
    null=SimpleNamespace(residual=np.zeros(ROWS), cost=5.0 * ROWS),
    experiments=[SimpleNamespace(good=np.ones((ROWS, 1), bool))],
    model=SimpleNamespace(
        sample_time=1e-3,
        parameters={"c": SimpleNamespace(value=100.0, tolerance=0.01), "m": SimpleNamespace(value=400.0)},
        bodies=[SimpleNamespace(name="body", mass="m")],
    ),
)
QUIET = SimpleNamespace(**vars(STUDY) | {"null": SimpleNamespace(residual=np.zeros(ROWS), cost=float(ROWS))})
DROPOUT = Cause("sensor_dropout", "a", {"share": Value(0.01, "1", (0.009, 0.011))}, 0.99)
SIGMA = np.sqrt(2.0 * ROWS)  # of chi2


def found(*groups: tuple[str, str], left: float = 0.0, score: float = 1000.0, gain: float = 1000.0):
    """An explanation by groups that leaves `left` of chi2 beyond the noise."""
    fit = SimpleNamespace(chi2=ROWS + left, cost=ROWS + left, free=(), covariance=lambda: np.zeros((0, 0)))
    terms = [SimpleNamespace(group=g, candidate=SimpleNamespace(kind=g[0], what="")) for g in groups]
    return SimpleNamespace(groups=groups, terms=terms, built=SimpleNamespace(names=["x1"] * len(terms)), fit=fit, score=score, gain=gain)


@pytest.fixture
def values(monkeypatch):
    """What parameters have been found: {kind: {name: (value, low, high)}}; a test may change it."""
    said: dict[str, dict[str, tuple[float, float, float]]] = {}

    def made(study, best, group):
        return {k: Value(v, "1", (low, high)) for k, (v, low, high) in said.get(group[0], {}).items()}

    monkeypatch.setattr(judging.sized, "values", made)
    return said


def judged(*explanations, study=STUDY, faults=(), alike=0.0, shared=0.0, pure=False, changed=0.0):
    causes, verdict, _, _ = judging.judge(study, explanations, list(faults), alike, shared, pure, changed)
    return [c.kind for c in causes], verdict


OUT = ([judging.OUTSIDE], "unexplained")


@pytest.mark.parametrize(
    "losses, costs, told, loads, so",
    [
        ((1000.0, 1020.0), (1000.0, 1090.0), False, 1, True),  # eight numbers gain 20 beside a load that costs 70
        ((1000.0, 1020.0), (1000.0, 1090.0), False, 6, False),  # beside several loads that grow, with as many numbers
        ((1000.0, 1030.0), (1000.0, 1100.0), False, 1, False),
        ((1000.0, 1030.0), (1000.0, 1070.0), False, 1, True),  # more than noise, and yet less than they cost
        ((1000.0, 1030.0), (1000.0, 1030.0), True, 1, False),  # with the same causes, it moved
        ((1000.0, 1020.0), (1000.0, 1020.0), True, 1, True),
    ],
)
def test_a_load_put_on_at_rest_is_no_start_in_motion(losses, costs, told, loads, so):
    assert resting.rested(losses, costs, told, 8, loads) == so


def test_nothing_found(values):
    """Six deviations of chi2 are a discrepancy, fifteen hundredths of it or a tone or a correlation of sensors one that has no name."""
    assert judged(study=QUIET) == ([], "no_discrepancy")
    assert judged(study=QUIET, faults=[DROPOUT]) == (["sensor_dropout"], "explained")
    for sigmas, verdict in ((5.9, "no_discrepancy"), (6.1, "not_identifiable")):
        doubtful = SimpleNamespace(**vars(QUIET) | {"null": SimpleNamespace(residual=np.zeros(ROWS), cost=ROWS + sigmas * SIGMA)})
        assert judged(study=doubtful) == ([], verdict)
    assert judged(study=QUIET, pure=True) == OUT
    assert judged(study=QUIET, alike=noise.ALIKE + 0.1) == OUT
    assert judged() == OUT


def test_a_cause_has_to_explain_most_of_it(values):
    assert judged(found(("bump_stop", "spring"))) == (["bump_stop"], "explained")
    gap = 4.0 * ROWS  # that could be gained
    assert judged(found(("bump_stop", "spring"), left=0.14 * ROWS)) == (["bump_stop"], "explained")  # near the noise
    assert judged(found(("bump_stop", "spring"), left=0.05 * gap)) == (["bump_stop"], "partly_explained")
    assert judged(found(("bump_stop", "spring"), left=0.16 * gap)) == OUT
    assert judged(found(("bump_stop", "spring")), pure=True) == (["bump_stop"], "partly_explained")


def test_what_sensors_share_is_no_noise(values):
    assert judged(found(("bump_stop", "spring")), alike=noise.ALIKE + 0.1, shared=0.2 * 4.0 * ROWS) == OUT
    assert judged(found(("bump_stop", "spring")), alike=noise.ALIKE - 0.1, shared=0.2 * 4.0 * ROWS) == (["bump_stop"], "explained")
    patchwork = found(("bump_stop", "spring"), ("quadratic_damper", "damper"))
    assert judged(patchwork, alike=noise.ALIKE + 0.1, shared=0.02 * 4.0 * ROWS) == OUT
    assert judged(patchwork, alike=noise.ALIKE + 0.1, shared=0.01 * 4.0 * ROWS)[1] == "explained"


def test_several_causes_have_to_explain_more_of_it(values):
    """A sixteenth left beyond chance is a form that one cause may have and several may not."""
    patchwork = found(("bump_stop", "spring"), ("quadratic_damper", "damper"), left=0.07 * 4.0 * ROWS)
    assert judged(patchwork) == OUT
    assert judged(found(("bump_stop", "spring"), left=0.07 * 4.0 * ROWS))[0] == ["bump_stop"]
    assert judged(found(*patchwork.groups, left=0.05 * 4.0 * ROWS))[0] == ["bump_stop", "quadratic_damper"]
    faint = SimpleNamespace(**vars(STUDY) | {"null": SimpleNamespace(residual=np.zeros(ROWS), cost=ROWS + 20.0 * SIGMA)})
    assert judged(found(*patchwork.groups, left=5.0 * SIGMA), study=faint)[0] == ["bump_stop", "quadratic_damper"]


def test_what_changes_is_no_small_part_of_the_whole(values):
    """Beside nothing it is on no list; beside a cause only if it takes more than a patchwork may leave."""
    gained = 4.0 * ROWS
    assert judged(study=QUIET, changed=60.0) == OUT
    assert judged(found(("bump_stop", "spring")), changed=0.02 * gained) == OUT
    assert judged(found(("bump_stop", "spring")), changed=0.01 * gained) == (["bump_stop"], "explained")
    shares = {"changed": 0.001 * gained, "alike": noise.ALIKE + 0.1}  # and sensors share it
    assert judged(found(("bump_stop", "spring")), shared=0.017 * gained, **shares) == OUT
    assert judged(found(("bump_stop", "spring")), shared=0.014 * gained, **shares) == (["bump_stop"], "explained")


@pytest.mark.parametrize(
    "kind, size",
    [
        ("tyre_damping", "damping"),
        ("coulomb_friction", "force"),
        ("bouc_wen", "force"),
        ("maxwell_bushing", "stiffness"),
        ("hidden_resonance", "frequency"),
    ],
)
def test_a_size_that_may_be_zero_stands_for_something_else(values, kind, size):
    others = {"mass": (5.0, 4.0, 6.0), "damping_ratio": (0.1, 0.0, 0.2)} if kind == "hidden_resonance" else {}
    values[kind] = others | {size: (1.0, 0.1, 1.9)}
    assert judged(found((kind, "body"))) == ([kind], "explained")
    values[kind] = others | {size: (1.0, -0.1, 2.1)}
    assert judged(found((kind, "body"))) == OUT


@pytest.mark.parametrize(
    "gains, together, out",
    [
        ((320.0,), 0.0, False),
        ((200.0,), 0.0, True),
        ((200.0, 200.0), -0.9, False),
        ((200.0, 200.0), 0.9, True),
        ((200.0, -200.0), 0.9, False),
    ],
)
def test_laws_that_are_sure_make_up_for_a_size_that_is_not(values, gains, together, out):
    """A stiffness over a time that is hardly known; gains are known to 100 N s/m each, and two as far as they go `together`. Of a
    spring behind a damper, a size that may be nothing is none."""
    values["maxwell_bushing"] = {"stiffness": (1e6, -1e5, 2e6)}
    e = found(*[("maxwell_bushing", "spring")] * len(gains))
    e.groups, e.built.names = (("maxwell_bushing", "spring"),), ["x1", "x2"][: len(gains)]
    e.fit.free = [SimpleNamespace(target=f"x{i}_damping", value=g, unit=50.0) for i, g in enumerate(gains, 1)]
    e.fit.covariance = lambda: 4.0 * np.array([[1.0, together], [together, 1.0]])[: len(gains), : len(gains)]
    for law, expected in (("loose_damper", out), ("maxwell_bushing", True)):
        for t in e.terms:
            t.candidate = SimpleNamespace(kind="maxwell_bushing", what=Basis("maxwell_bushing", 0, law, ("damping", "N*s/m"), {}, 1, ()))
        assert (judged(e) == OUT) == expected


def test_several_wrong_parameters_are_another_vehicle_and_delays_another_clock(values):
    values["wrong_parameter"] = {"c": (120.0, 119.0, 121.0)}
    values["sensor_delay"] = {"delay": (0.01, 0.009, 0.011)}
    for kind in ("wrong_parameter", "sensor_delay"):
        assert judged(found((kind, "a"))) == ([kind], "explained")
        assert judged(found((kind, "a"), (kind, "b"))) == OUT


def test_a_resonance_needs_little_damping_and_one_mass(values, monkeypatch):
    mass = ("hidden_resonance", "body")
    for ratio, answer in ((0.1, ([mass[0]], "explained")), (judging.DAMPED + 0.01, OUT)):
        values[mass[0]] = {"frequency": (8.0, 7.0, 9.0), "mass": (5.0, 4.0, 6.0), "damping_ratio": (ratio, 0.0, 1.0)}
        assert judged(found(mass)) == answer
        lines = judging.damped([judging.cause(STUDY, [found(mass)], mass)])
        assert [("body" in line and "5 kg at 8 Hz" in line and "0.21" in line) for line in lines] == [True] * (answer == OUT)
    values[mass[0]]["damping_ratio"] = (0.1, 0.0, 1.0)
    two = found(mass)
    two.terms *= 2
    for share, answer in ((0.92, OUT), (0.94, ([mass[0]], "explained"))):
        monkeypatch.setattr(judging.explaining, "explain", lambda study, terms, share=share: found(mass, gain=share * two.gain))
        assert judged(two) == answer


@pytest.mark.parametrize(
    "kind, small, large",
    [
        ("sensor_scale", {"scale": 1.004}, {"scale": 0.994}),
        ("sensor_delay", {"delay": 19e-6}, {"delay": 21e-6}),
        ("wrong_parameter", {"c": 100.9}, {"c": 98.9}),
        ("hidden_resonance", {"mass": 0.7, "frequency": 8.0, "damping_ratio": 0.1}, {"mass": 0.9, "frequency": 8.0, "damping_ratio": 0.1}),
    ],
)
def test_what_is_significant_may_be_too_small(values, kind, small, large):
    """Half a per cent of a scale, a fiftieth of a sample, the tolerance, two thousandths of the body."""
    for size, answer in ((small, ([], "no_discrepancy")), (large, ([kind], "explained"))):
        values[kind] = {k: (v, 0.99 * v, 1.01 * v) for k, v in size.items()}
        assert judged(found((kind, "body"))) == answer


def test_faults_are_said_beside_causes_and_once(values):
    assert judged(found(("bump_stop", "spring")), faults=[DROPOUT]) == (["bump_stop", "sensor_dropout"], "explained")
    assert judged(found(("sensor_dropout", "a")), faults=[DROPOUT]) == (["sensor_dropout"], "explained")


def test_alternatives_are_near_and_take_one_place(values):
    """Behind by less than 50 of score; with another name for the one cause."""
    best = found(("bump_stop", "spring"), score=1000.0)
    near, far = found(("cubic_spring", "spring"), score=951.0), found(("backlash", "spring"), score=949.0)
    both = found(("asymmetric_spring", "spring"), ("sensor_scale", "a"), score=999.0)
    (cause,), _, _, _ = judging.judge(STUDY, [best, near, far, both], [], 0.0, 0.0, False)
    assert [o.kind for o in cause.alternatives] == ["cubic_spring"]
    assert 0.5 < cause.confidence < 0.99


@pytest.mark.parametrize(
    "high, model, kinds",
    [
        (2.5, 3.0, ["sensor_clipping"]),  # 15 samples at the greatest value there is, and the model goes on beyond
        (2.5, 1.0, ["sensor_dropout"]),  # the model is below: the sensor was held
        (9.0, 10.0, ["sensor_dropout"]),  # the value was exceeded elsewhere
    ],
)
def test_a_rail_may_be_met_once(high, model, kinds):
    """Flat samples that no statistics of the record shows, for they are too few, are a rail if the sensor never shows more."""
    y, at = np.zeros(ROWS), slice(5000, 5015)
    y[100], y[at] = min(high, 2.4) if high < 9.0 else high, 2.5
    quality = SimpleNamespace(rows=ROWS, low=None, high=None, quantum=0.0, held=0, missing=0, spikes=0)
    measured = SimpleNamespace(
        z={"a": y}, mask={"a": np.ones(ROWS, bool)}, shown={"a": np.ones(ROWS, bool)}, quality=SimpleNamespace(channels={"a": quality})
    )
    study = SimpleNamespace(experiments=[SimpleNamespace(time=np.arange(ROWS))], levels=[np.full((1, 1), 1e-4)])
    sensors = SimpleNamespace(sensors=[SimpleNamespace(name="a", unit="m/s^2")])
    simulated, burst = y.copy(), np.zeros((ROWS, 1), bool)
    simulated[at], burst[at] = model, True
    found = broken.broken_sensors(sensors, [measured], study, [simulated[:, None]], [burst])
    assert [c.kind for c in found] == kinds
    if kinds == ["sensor_clipping"]:
        assert found[0].parameters["high"].value == found[0].parameters["limit"].value == 2.5


@pytest.mark.parametrize("lost", [0, 30])
def test_between_two_rails_a_sensor_goes_on(lost):
    """Six samples on either rail are one burst with the eight between them, which the model agrees with. Of a hole elsewhere all count,
    near the model or not."""
    y = np.zeros(ROWS)
    y[5000:5020] = np.clip(np.linspace(-7.0, 7.0, 20), -2.5, 2.5)
    quality = SimpleNamespace(rows=ROWS, low=None, high=None, quantum=0.0, held=0, missing=0, spikes=0)
    measured = SimpleNamespace(
        z={"a": y}, mask={"a": np.ones(ROWS, bool)}, shown={"a": np.ones(ROWS, bool)}, quality=SimpleNamespace(channels={"a": quality})
    )
    study = SimpleNamespace(experiments=[SimpleNamespace(time=np.arange(ROWS))], levels=[np.full((1, 1), 1e-4)])
    sensors = SimpleNamespace(sensors=[SimpleNamespace(name="a", unit="m/s^2")])
    simulated, burst = y.copy(), np.zeros((ROWS, 1), bool)
    simulated[5000:5020], burst[5000:5020] = np.linspace(-7.0, 7.0, 20), True
    simulated[7000 : 7000 + lost], burst[7000 : 7000 + lost] = np.linspace(-1.0, 1.0, lost + 1)[:lost], True
    cause, *others = broken.broken_sensors(sensors, [measured], study, [simulated[:, None]], [burst])
    assert cause.kind == "sensor_clipping" and {k: v.value for k, v in cause.parameters.items()} == {"limit": 2.5, "low": -2.5, "high": 2.5}
    assert [(c.kind, c.parameters["share"].value) for c in others] == [("sensor_dropout", lost / ROWS)] * bool(lost)


def test_a_drift_of_clocks_has_no_name(values, monkeypatch):
    """Alone, or where others do less than half without it; beside one that does most, a note tells it."""
    drift, stop = (judging.CLOCK, ""), ("bump_stop", "spring")
    assert judged(found(drift)) == OUT
    for share, answer in ((0.4, OUT), (0.6, (["bump_stop"], "explained"))):
        monkeypatch.setattr(judging.explaining, "explain", lambda study, terms, share=share: found(stop, gain=share * 1000.0))
        assert judged(found(stop, drift)) == answer
    (cause,), _, _, _ = judging.judge(STUDY, [found(stop), found(drift, score=999.0)], [], 0.0, 0.0, False)
    assert cause.alternatives == () and cause.confidence < 0.7


def test_a_sensor_that_drops_out_does_so_near_its_value_too():
    """Zeros in two recordings, some of them while the model goes through zero: all count, and their ends say how sure that is."""
    t = np.arange(ROWS) * 1e-3
    model = np.sin(np.pi * t)
    recordings, simulated = [], []
    for holes in ((5490, 30, True), (7990, 20, False)), ((2490, 4, True),):
        y, mask = model + 0.01 * np.random.default_rng(len(holes)).normal(size=ROWS), np.ones(ROWS, bool)
        for first, n, seen in holes:
            y[first : first + n], mask[first : first + n] = 0.0, not seen
        held = int(np.count_nonzero(~mask))
        quality = SimpleNamespace(rows=ROWS, low=None, high=None, quantum=0.0, held=held, missing=0, spikes=0)
        channels = SimpleNamespace(channels={"a": quality})
        recordings.append(SimpleNamespace(z={"a": y}, mask={"a": mask}, shown={"a": np.ones(ROWS, bool)}, quality=channels))
        simulated.append(model[:, None])
    study = SimpleNamespace(experiments=[SimpleNamespace(time=t)] * 2, levels=[np.full((1, 1), 1e-4)] * 2)
    sensors = SimpleNamespace(sensors=[SimpleNamespace(name="a", unit="m/s^2")])
    (cause,) = broken.broken_sensors(sensors, recordings, study, simulated, [np.zeros((ROWS, 1), bool)] * 2)
    share = cause.parameters["share"]
    assert share.value == pytest.approx((30 + 20 + 4) / (2 * ROWS))
    assert share.ci95[0] < share.value < share.ci95[1] < 1.15 * share.value


@pytest.mark.parametrize(
    "held, away, quantum, told", [(3, 0.25, 0.0, True), (2, 0.25, 0.0, False), (4, 0.15, 0.0, False), (4, 0.25, 0.05, False)]
)
def test_few_samples_that_are_far_off_are_enough(held, away, quantum, told):
    """Three zeros, 25 deviations of the noise from the model; not two, not at 15, nor of a sensor that is coarse."""
    y, mask = np.full(ROWS, away) + 0.01 * np.random.default_rng(1).normal(size=ROWS), np.ones(ROWS, bool)
    y[5000 : 5000 + held], mask[5000 : 5000 + held] = 0.0, False
    quality = SimpleNamespace(rows=ROWS, low=None, high=None, quantum=quantum, held=held, missing=0, spikes=0)
    measured = SimpleNamespace(
        z={"a": y}, mask={"a": mask}, shown={"a": np.ones(ROWS, bool)}, quality=SimpleNamespace(channels={"a": quality})
    )
    study = SimpleNamespace(experiments=[SimpleNamespace(time=np.arange(ROWS))], levels=[np.full((1, 1), 1e-4)])
    sensors = SimpleNamespace(sensors=[SimpleNamespace(name="a", unit="m/s^2")])
    found = broken.broken_sensors(sensors, [measured], study, [np.full((ROWS, 1), away)], [np.zeros((ROWS, 1), bool)])
    assert [c.kind for c in found] == ["sensor_dropout"] * told


def test_parameters_are_those_of_the_wider_explanation(values):
    """Of a cause that is in it; another keeps its own."""
    values["bump_stop"] = {"gap": (0.02, 0.019, 0.021)}
    known = Cause("bump_stop", "spring", {"gap": Value(0.03, "m", (0.01, 0.05))}, 0.9)
    assert judging.resized(STUDY, found(("bump_stop", "spring")), known).parameters["gap"].value == 0.02
    assert judging.resized(STUDY, found(("backlash", "spring")), known) == known
