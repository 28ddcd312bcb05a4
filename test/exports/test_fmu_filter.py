# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""FMUs of models with a filter: measurements in, estimates and tests out, to the bit those of SiL."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from case_study import ROOT
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu
from master import ERROR, Master, Unpacked, export
from test_fmu import write_set
from test_fmu_xcp import Memory

import penode_gen
from penode_gen.exports import filtered
from penode_sil.calibration import a2l_read
from penode_sil.filtering.compiled import Compiled
from penode_sil.filtering.estimates import FLAGS, named
from penode_sil.filtering.watched import CompiledMonitor
from penode_sil.schedule import Call
from penode_sil.targets import Sil

STEP, SET, EXCHANGE, SAMPLES = 1e-3, "worn", 300, 600
WATCHED = ROOT / "sil/filter/watched.toml"


class Filtered(NamedTuple):
    """A model, its FMU, a road and measurements of it."""

    model: Any
    fmu: Unpacked
    path: Path
    u: np.ndarray
    z: np.ndarray


def recording(model: Any) -> tuple[np.ndarray, np.ndarray]:
    """Road and measurements with noise, some of them missing; from a sample on the plant is that of another set."""
    rng, u = np.random.default_rng(1), np.zeros((SAMPLES, 1), np.float32)
    for k in range(1, SAMPLES):
        u[k] = 0.998 * u[k - 1] + 3.2e-4 * rng.standard_normal()
    seen = np.asarray(Sil(model).run(u, [Call(EXCHANGE, "select", set=SET)] if SET in model.sets else []).z, float)
    used = [[s.name for s in model.sensors].index(s.name) for s in model.filter.sensors]
    z = seen[:, used] + rng.standard_normal((SAMPLES, len(used))) * [s.noise for s in model.filter.sensors]
    z[rng.random(z.shape) < 0.05] = np.nan
    return u, z.astype(np.float32)


def make(path: Path, version: int, folder: Path) -> Filtered:
    model = penode_gen.load(path)
    fmu = export(model, version, folder)
    return Filtered(model, Unpacked(fmu, folder / "unpacked"), fmu, *recording(model))


@pytest.fixture(scope="module", params=[3, pytest.param(2, marks=pytest.mark.long)], ids=["FMI 3", "FMI 2"])
def watched(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Filtered:
    """With a monitor; the road is estimated."""
    return make(WATCHED, request.param, tmp_path_factory.mktemp("watched"))


def outputs(model: Any) -> list[str]:
    """All that filter and monitor show, but for their status."""
    names = [e.name for e in filtered.estimates(model)]
    names += [filtered.deviation(name) for name in names] + [f"filter.ratio.{name}" for name in filtered.measurements(model)]
    return names + [f"monitor.{name}" for name in filtered.tests(model)] + [f"monitor.raised.{name}" for name in filtered.tests(model)]


def sil(of: Filtered, mask: np.ndarray | None = None, exchange: int | None = None) -> np.ndarray:
    """The same of SiL, sample by sample; another set from the sample `exchange` on. The last column is the status."""
    compiled, rows = Compiled(of.model), []
    own = CompiledMonitor(compiled, "default") if of.model.monitor else compiled.filter()
    at = [column for column, _, _ in named(of.model)]
    for part in (slice(0, exchange), slice(exchange, None)) if exchange else (slice(None),):
        if part.start:
            own.select(SET)
        found = own.run(of.u[part], of.z[part], None if mask is None else mask[part])[0]
        columns = [found.values[:, at], found.deviations[:, at], found.ratio]
        if isinstance(own, CompiledMonitor):
            columns += [own.watched().sums, own.watched().raised]
        rows.append(np.column_stack([*columns, found.status]).astype(float))
    return np.concatenate(rows)


def run(of: Filtered, master: Master, samples: range, at: dict[int, Any] | None = None, length: int = 1) -> np.ndarray:
    """What the FMU shows after each communication step of `length` samples; `at`: what to do before, by sample."""
    names, found = [*outputs(of.model), "filter.status"], []
    for k in samples[::length]:
        (at or {}).get(k, lambda: None)()
        master.set("z_road", of.u[k])
        for n, name in enumerate(filtered.measurements(of.model)):
            master.set(f"measured.{name}", of.z[k, n])
        master.step(length * STEP)
        found.append(master.get(*names))
    return np.array(found)


def test_nothing_is_wrong_with_it(watched: Filtered) -> None:
    assert validate_fmu(str(watched.path)) == []
    variables = watched.fmu.variables
    assert {name for name, v in variables.items() if v.causality == "input"} == {
        "z_road",
        "early.z_road",
        "measured.a_body",
        "measured.a_wheel",
    }
    shown = {*outputs(watched.model), "filter.status"}
    assert shown <= variables.keys() and {variables[name].causality for name in shown} == {"output"}
    assert {variables[name].declaredType.unit for name in ("filter.deflection", "filter.sd.deflection", "filter.z_road")} == {"m"}
    assert {"monitor.rubbing", "monitor.raised.other", "filter.ratio.a_wheel", "filter.sd.F_tyre"} <= shown
    depending = {o.variable.name: o.dependencies for o in watched.fmu.description.outputs}
    assert all((not depending[name] and depending[name] is not None) == (name in shown) for name in depending)


def test_estimates_are_those_of_sil_to_the_bit(watched: Filtered) -> None:
    """Over an exchange of sets by name and by values, with measurements that are missing; the model goes on as without a filter."""
    expected = sil(watched, exchange=EXCHANGE)
    assert expected[:EXCHANGE, -3].max() == 0.0 and np.isnan(watched.z).any()
    for exchange in (lambda m: m.set("parameter_set", 1 + list(watched.model.sets).index(SET)), lambda m: write_set(m, watched.model, SET)):
        master = Master(watched.fmu).initialise(z_road=watched.u[0])
        found = run(watched, master, range(SAMPLES), {EXCHANGE: lambda m=master, e=exchange: e(m)})
        assert np.array_equal(found, expected)
    plain = Master(watched.fmu).initialise(z_road=watched.u[0])
    for k in range(SAMPLES):
        plain.set("parameter_set", 1 + list(watched.model.sets).index(SET) * (k >= EXCHANGE))
        plain.set("z_road", watched.u[k])
        plain.step(STEP)
    names = ("z_b", "z_w", "state.v_w", "a_wheel")
    assert np.array_equal(plain.get(*names), master.get(*names))
    assert plain.get("filter.status") == 0 and plain.get("filter.ratio.a_body") == 0.0


def test_a_filter_with_the_old_set_finds_the_friction(watched: Filtered) -> None:
    found = run(watched, Master(watched.fmu).initialise(z_road=watched.u[0]), range(SAMPLES))
    raised = found[:, outputs(watched.model).index("monitor.raised.rubbing")]
    assert not raised[:EXCHANGE].any() and raised[EXCHANGE : EXCHANGE + 100].any()
    assert np.array_equal(found, sil(watched))


def test_an_fmu_without_measurements_has_no_filter_to_pay_for(watched: Filtered) -> None:
    """They are NaN until a master gives a number; then the filter begins, at its start."""
    master = Master(watched.fmu).initialise(z_road=watched.u[0])
    assert np.isnan(master.get("measured.a_body", "measured.a_wheel")).all()
    start = master.get(*outputs(watched.model))
    for _ in range(20):
        master.step(STEP)
    assert np.array_equal(master.get(*outputs(watched.model)), start)
    assert np.array_equal(run(watched, master, range(100)), sil(watched)[:100])


def test_a_longer_step_measures_at_its_start(watched: Filtered) -> None:
    mask = np.where(np.arange(SAMPLES) % 5 == 0, 3, 0).astype(np.uint32)
    held = watched._replace(u=watched.u.repeat(5, axis=0)[:SAMPLES])
    found = run(watched, Master(watched.fmu).initialise(z_road=watched.u[0]), range(SAMPLES), length=5)
    expected = sil(held, mask)[4::5]
    missing = np.isnan(watched.z[::5]).any(axis=1)
    assert np.array_equal(found[:, :-1], expected[:, :-1])
    assert np.array_equal(found[:, -1].astype(int) & FLAGS["missing"] > 0, missing)  # flags of all samples of the step


def test_state_is_saved_with_the_filter(watched: Filtered) -> None:
    """And given to another instance, while a written set runs."""
    master = Master(watched.fmu).initialise(z_road=watched.u[0])
    run(watched, master, range(200), {100: lambda: write_set(master, watched.model, SET)})
    state, now = master.save(), master.now
    data = master.to_bytes(state)
    once = run(watched, master, range(200, 300))
    master.restore(state)
    master.now = now
    assert np.array_equal(run(watched, master, range(200, 300)), once)
    other = Master(watched.fmu).initialise()
    other.restore(other.from_bytes(data))
    other.now = now
    assert np.array_equal(run(watched, other, range(200, 300)), once)
    master.fmu.reset()
    master.now = 0.0
    master.initialise(z_road=watched.u[0])
    assert np.array_equal(run(watched, master, range(100)), sil(watched)[:100])


def test_derivatives_are_those_of_the_model(watched: Filtered) -> None:
    master = Master(watched.fmu).initialise(z_road=watched.u[0])
    run(watched, master, range(10))
    assert master.derivative("z_w", "z_road") > 0.0
    assert master.derivative("z_w", "measured.a_body") == 0.0 and master.derivative("state.v_b", "measured.a_wheel") == 0.0
    with pytest.raises(FMICallException) as refused:
        master.derivative("filter.z_w", "z_road")
    assert refused.value.status == ERROR and "derivatives are of outputs and states" in master.log[-1][2]


def test_a_filter_with_a_noisy_input_and_without_a_monitor(tmp_path: Path) -> None:
    (tmp_path / "model.toml").write_text(
        (ROOT / "test/filter/models/measured_folded.toml").read_text().replace("../../../gen", str(ROOT / "gen"))
        + "[filter.inputs]\nz_road = { noise = 1e-4 }\n"
    )
    of = make(tmp_path / "model.toml", 3, tmp_path)
    assert np.array_equal(run(of, Master(of.fmu).initialise(z_road=of.u[0]), range(SAMPLES)), sil(of))


def test_a_filter_that_estimates_a_parameter(tmp_path: Path) -> None:
    """It steps a model of its own; its state is saved with it."""
    of = make(ROOT / "test/filter/models/mass.toml", 3, tmp_path)
    master, half = Master(of.fmu).initialise(z_road=of.u[0]), SAMPLES // 2
    first = run(of, master, range(half))
    state, now = master.save(), master.now
    found = np.concatenate([first, run(of, master, range(half, SAMPLES))])
    assert np.array_equal(found, sil(of))
    mass = outputs(of.model).index("filter.m_b")
    assert abs(found[0, mass] - 350.0) < 1.0 and np.ptp(found[:, mass]) > 1e-3  # the set's value, then what the recording shows
    master.restore(state)
    master.now = now
    assert np.array_equal(run(of, master, range(half, SAMPLES)), found[half:])


@pytest.mark.skipif(importlib.util.find_spec("elftools") is None, reason="pyelftools is not installed: pip install penode[xcp]")
def test_the_a2l_inside_names_the_filter(tmp_path: Path) -> None:
    model = penode_gen.load(WATCHED)
    fmu = Unpacked(export(model, 3, tmp_path, xcp=True), tmp_path / "unpacked")
    found = a2l_read.parse(next((fmu.folder / "extra").rglob("x86_64-linux/watched.a2l")).read_text(), "a2l")
    of = Filtered(model, fmu, tmp_path, *recording(model))
    master = Master(fmu).initialise(z_road=of.u[0])
    shown = dict(zip(outputs(model), run(of, master, range(50))[-1], strict=False))
    memory = Memory(fmu)
    for name in ("filter.ratio.a_body", "filter.ratio.a_wheel", "monitor.raised.rubbing"):
        assert memory.read(found.measurements[name])[0] == shown[name], name
    for name in model.filter.names[2:]:  # outputs z_b and z_w are to first order
        assert memory.read(found.measurements[f"filter.state.{name}"])[0] == shown[f"filter.{name}"], name
