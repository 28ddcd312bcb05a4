# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""FMUs of both versions with FMPy as the master: the same bits as SiL, sets that come into force whole, state."""

from __future__ import annotations

import ctypes
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from case_study import chirp
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu
from master import DISCARD, ERROR, WARNING, Master, Unpacked, export

import penode_gen
from penode_gen import exports
from penode_gen.sets import layout
from penode_sil.schedule import Call
from penode_sil.targets import Sil

STEP = 1e-3
SET = "altered_friction"


def write_set(master: Master, model: Any, name: str) -> None:
    """All arrays of a set, as a master writes them."""
    values = penode_gen.set_values(model, name)
    for array in layout.arrays(model):
        master.set(array.name, layout.gather(array, values))


def run(master: Master, u: np.ndarray, at: dict[int, Any], names: tuple[str, ...] = ("z_b", "z_w")) -> np.ndarray:
    """Outputs at each sample, with u held over each step; `at`: what to do between two steps, by sample."""
    master.initialise(z_road=u[0])
    found = [master.get(*names)]
    for k in range(len(u) - 1):
        at.get(k, lambda: None)()
        master.set("z_road", u[k])
        master.step(STEP)
        found.append(master.get(*names))
    return np.array(found)


def test_nothing_is_wrong_with_it(unpacked: Unpacked) -> None:
    """FMPy's checks, and those that no importer makes: number of start values, start within its limits, names in the binary."""
    path = unpacked.folder.parent / f"nqvm{unpacked.version}.fmu"
    assert validate_fmu(str(path)) == []
    names = [f for f in zipfile.ZipFile(path).namelist() if f.endswith(".so")]
    assert names and all(Path(n).stem == unpacked.description.coSimulation.modelIdentifier for n in names)
    for v in unpacked.description.modelVariables:
        if v.start is not None and unpacked.version == 3:
            assert len(str(v.start).split()) == np.prod(v.shape or (1,)), v.name
        if v.min is not None:
            assert float(v.min) <= float(v.start) <= float(v.max), v.name
    assert unpacked.description.guid.encode() in next(unpacked.folder.rglob("*.so")).read_bytes()
    assert {v.name for v in unpacked.description.modelVariables if v.causality == "input"} == {"z_road", "early.z_road"}
    assert sum(v.variability == "tunable" for v in unpacked.description.modelVariables) == (1 + 28 if unpacked.version == 3 else 1 + 1198)


def test_the_same_bits_as_sil_and_a_set_written_while_it_runs(unpacked: Unpacked, nqvm: Any, held: Any) -> None:
    u = chirp(2.2)
    master = Master(unpacked)
    found = run(master, u, {2000: lambda: write_set(master, nqvm, SET)})
    reference = Sil(held).run(u, [Call(2001, "select", set=SET)])
    assert np.array_equal(found, reference.y)
    unchanged = Sil(held).run(u)
    assert np.array_equal(found[:2001], unchanged.y[:2001]) and not np.array_equal(found[2001], unchanged.y[2001])
    assert master.get("set_id") == 1000 and master.get("set_checksum") == penode_gen.set_head(nqvm, SET)[3]
    assert master.log == []


def test_a_named_set_is_selected_in_any_order_with_arrays(unpacked: Unpacked, nqvm: Any) -> None:
    """parameter_set and an array of the same interval: both count, whichever is written first."""
    bias = np.zeros(1)
    found = []
    for order in ((0, 1), (1, 0)):
        master = Master(unpacked).initialise()
        calls = (lambda m=master: m.set("parameter_set", 2), lambda m=master: m.set("damper_net.bias_4", bias))
        for k in order:
            calls[k]()
        master.step(STEP)
        found.append(master.get("damper_net.weights_2", "damper_net.bias_4", "set_checksum"))
    assert np.array_equal(*found)
    altered = {a.name: layout.gather(a, penode_gen.set_values(nqvm, SET)) for a in layout.arrays(nqvm)}
    assert np.array_equal(found[0][:256], np.ravel(altered["damper_net.weights_2"])) and found[0][256] == 0.0
    master = Master(unpacked).initialise()
    master.set("parameter_set", 2)
    master.step(STEP)
    assert master.get("set_id") == penode_gen.set_head(nqvm, SET)[2]  # the model's own: nothing was copied


def test_the_same_values_again_commit_nothing(unpacked: Unpacked, nqvm: Any) -> None:
    master = Master(unpacked).initialise()
    for k in range(5):
        write_set(master, nqvm, "default" if k < 2 else SET)
        master.step(STEP)
        assert master.get("set_id") == (penode_gen.set_head(nqvm, "default")[2] if k < 2 else 1000)


def test_values_that_are_no_numbers_are_refused_at_once(unpacked: Unpacked) -> None:
    for wrong in (np.nan, np.inf, 1e300):
        master = Master(unpacked).initialise()
        before = master.get("damper_net.bias_2", "set_checksum")
        values = before[:-1].copy()
        values[7] = wrong
        with pytest.raises(FMICallException) as refused:
            master.set("damper_net.bias_2", values)
        assert refused.value.status == DISCARD
        assert master.log[-1] == (
            DISCARD,
            "sets",
            "damper_net.bias_2: element 8 is NaN, Inf or too large; nothing was written; set finite values",
        )
        master.step(STEP)
        if unpacked.version == 3:  # in FMI 2 the elements are variables of their own
            assert np.array_equal(master.get("damper_net.bias_2", "set_checksum"), before)


def test_state_is_saved_restored_and_given_to_another_instance(unpacked: Unpacked, nqvm: Any) -> None:
    """Also over an exchange that waits for the next step."""
    u = chirp(0.4)

    def steps(master: Master, first: int) -> np.ndarray:
        found = []
        for k in range(first, first + 100):
            master.set("z_road", u[k])
            master.step(STEP)
            found.append(master.get("z_b", "z_w", "state.v_b", "set_id", "set_checksum"))
        return np.array(found)

    master = Master(unpacked).initialise(z_road=u[0])
    steps(master, 0)
    write_set(master, nqvm, SET)
    state, now = master.save(), master.now
    data = master.to_bytes(state)
    once = steps(master, 100)
    master.restore(state)
    master.now = now
    assert np.array_equal(steps(master, 100), once) and once[0, 3] == 1000
    other = Master(unpacked).initialise()
    other.restore(other.from_bytes(data))
    other.now = now
    assert np.array_equal(steps(other, 100), once)
    for at in (5, len(data) // 2, len(data) - 9):  # seeded faults: a byte that has changed
        damaged = data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :]
        with pytest.raises(FMICallException):
            other.from_bytes(damaged)
    with pytest.raises(FMICallException):
        other.from_bytes(data[:-1])


def test_a_state_of_another_export_is_refused(tmp_path: Path) -> None:
    """Two models that differ in a constant alone: sizes and layout of their states are the same."""
    masters = []
    for k in (3, 4):
        path = tmp_path / f"{k}.toml"
        path.write_text(
            f'[model]\nname = "lag"\nsample_time = "1 ms"\n[parameters]\nk = {{ value = {k}, unit = "1" }}\n'
            f'T = {{ value = 1, unit = "s", tunable = true }}\n'
            '[inputs]\nu = { unit = "m" }\n[states]\nx = { unit = "m" }\n[equations]\n'
            'q = "der(x) = (k*u - x)/T"\n[outputs]\ny = { value = "x", unit = "m" }\n'
        )
        (tmp_path / str(k)).mkdir()
        masters.append(Master(Unpacked(export(penode_gen.load(path), 3, tmp_path / str(k)), tmp_path / f"unpacked{k}")).initialise())
    one, other = masters
    data = one.to_bytes(one.save())
    one.from_bytes(data)
    with pytest.raises(FMICallException):
        other.from_bytes(data)
    assert other.log[-1] == (ERROR, "logStatusError", "this state was saved by another FMU")


def test_linear_inputs(unpacked: Unpacked, nqvm: Any) -> None:
    """An announced end value gives SiL's linear input to the bit; a derivative of FMI 2 rounds the end value once more."""
    u = chirp(1.0)
    reference = Sil(nqvm).run(u).y
    master = Master(unpacked).initialise(z_road=u[0], input_between_samples=2)
    found = [master.get("z_b", "z_w")]
    for k in range(len(u) - 1):
        master.set("z_road", u[k])
        master.set("early.z_road", u[k + 1])
        master.step(STEP)
        found.append(master.get("z_b", "z_w"))
    assert np.array_equal(np.array(found), reference)
    if unpacked.version == 2:
        master = Master(unpacked).initialise(z_road=u[0])
        found = [master.get("z_b", "z_w")]
        for k in range(len(u) - 1):
            master.set("z_road", u[k])
            master.slope("z_road", (float(u[k + 1, 0]) - float(u[k, 0])) / STEP)
            master.step(STEP)
            found.append(master.get("z_b", "z_w"))
        assert np.abs(np.array(found) - reference).max() <= 5e-8  # an ulp of 0.02 m is 2e-9 m; the tyre follows it, the body damps it


def test_start_values_and_outputs_before_the_first_step(unpacked: Unpacked, nqvm: Any) -> None:
    master = Master(unpacked, start_time=3.0)
    master.initialise(z_road=[0.01], **{"state.z_b": 0.02, "parameter_set": 2})
    assert master.get("z_b", "state.z_b", "time", "set_id").tolist() == [
        np.float32(0.02),
        np.float32(0.02),
        3.0,
        penode_gen.set_head(nqvm, SET)[2],
    ]
    sensed = master.get("a_wheel")
    assert sensed != 0.0  # the road pushes at once
    master.step(10 * STEP)
    assert master.get("time") == pytest.approx(3.01, abs=1e-12)
    with pytest.raises(FMICallException):
        master.set("state.z_b", 0.0)


def test_mistakes_of_a_master_are_one_line_and_change_nothing(unpacked: Unpacked) -> None:
    master = Master(unpacked)
    with pytest.raises(FMICallException) as early:
        master.fmu.doStep(0.0, STEP)
    assert early.value.status == ERROR and "before initialisation" in master.log[-1][2]
    master.initialise()
    get, put = (master.fmu.getFloat64, master.fmu.setFloat64) if unpacked.version == 3 else (master.fmu.getReal, master.fmu.setReal)
    wrong = [
        (
            lambda: master.fmu.doStep(0.0, 1.5e-3),
            ERROR,
            "a communication step of 0.0015 s; use a whole multiple of the sample time, 0.001 s",
        ),
        (lambda: master.fmu.doStep(0.0, 0.5e-3), ERROR, "a communication step of 0.0005 s; use a whole multiple"),
        (lambda: master.fmu.doStep(0.0, 0.0), ERROR, "a communication step of 0 s; use a whole multiple"),
        (lambda: master.fmu.doStep(0.0, np.nan), ERROR, "a communication step of nan s; use a whole multiple"),
        (lambda: master.fmu.doStep(0.5, STEP), ERROR, "a step from 0.5 s, but the FMU is at 0 s"),
        (lambda: get([99_999]), ERROR, "no variable of this type with value reference 99999"),
        (lambda: put([99_999], [1.0]), ERROR, "no variable of this type with value reference 99999"),
        (lambda: master.set("z_b", 1.0), ERROR, "cannot be set now"),
        (lambda: master.set("parameter_set", 9), DISCARD, "parameter_set: there is no number 9; use 1 to 2"),
        (lambda: master.set("input_between_samples", 2), ERROR, "before the simulation only"),
        (
            lambda: master.derivative("z_b", "damper_net.bias_4" if unpacked.version == 3 else "damper_net.bias_4[1]"),
            ERROR,
            "derivatives are by inputs",
        ),
    ]
    if unpacked.version == 3:
        wrong.append(
            (
                lambda: master.fmu.setFloat64([unpacked.reference["damper_net.weights_2"]], [1.0] * 15),
                ERROR,
                "15 values for variables with 256 elements",
            )
        )
        wrong.append((lambda: master.fmu.getInt32([0]), ERROR, "fmi3GetInt32: this FMU does not provide it"))
    for call, status, line in wrong:
        lines = len(master.log)
        with pytest.raises(FMICallException) as found:
            call()
        assert found.value.status == status and len(master.log) == lines + 1, line
        assert line in master.log[-1][2] and master.log[-1][0] == status
    master.step(STEP)
    master.fmu.terminate()
    with pytest.raises(FMICallException):
        master.fmu.doStep(STEP, STEP)
    with pytest.raises(Exception, match="instantiate"):
        Master(unpacked, token="{0}")


def test_a_refused_set_is_a_warning_with_its_reason(tmp_path: Path, nqvm: Any) -> None:
    """A promise of the model file that the written set breaks; the running set stays, and the next good one is taken."""
    path = tmp_path / "promised.toml"
    path.write_text(
        f'[model]\nextends = "{nqvm.path}"\nname = "promised"\n[networks]\n'
        f'spring_net = {{ inputs = ["m"], output = "N", max_slope = "130000 N/m" }}\n'
    )
    model = penode_gen.load(path)
    master = Master(Unpacked(export(model, 3, tmp_path), tmp_path / "unpacked"), logging=True).initialise()
    factor = master.get("spring_net.factor_2")
    before = master.get("set_id", "set_checksum")
    master.set("spring_net.factor_2", 10 * factor)
    master.step(STEP)
    assert master.log == [
        (WARNING, "sets", "t = 0 s: the new set is refused and the running set stays: a network breaks a promise of the model file")
    ]
    assert np.array_equal(master.get("set_id", "set_checksum", "spring_net.factor_2"), [*before, *factor])
    master.set("spring_net.factor_2", 0.5 * factor)
    master.step(STEP)
    assert master.get("set_id") == 1000 and master.log[-1] == (
        0,
        "sets",
        "t = 0.001 s: the set that was written is in force from the next sample on",
    )


def test_inputs_that_are_no_numbers_hold_the_step(unpacked: Unpacked) -> None:
    master = Master(unpacked, logging=True).initialise()
    master.step(STEP)
    before = master.get("z_b", "z_w")
    for _ in range(3):
        master.set("z_road", np.nan)
        master.step(STEP)
    assert np.array_equal(master.get("z_b", "z_w"), before)
    assert [line[:2] for line in master.log] == [(WARNING, "range")]  # once, not at every step
    master.set("z_road", 0.5)
    master.step(STEP)
    assert master.log[-1][1] == "range" and "declared range" in master.log[-1][2]


@pytest.mark.parametrize("version", [3, 2])
def test_the_same_model_gives_the_same_bytes(nqvm: Any, version: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = exports.export(nqvm, f"fmu{version}", Path("a.fmu"), {"source_only": True})
    monkeypatch.chdir(tmp_path)
    assert exports.export(nqvm, f"fmu{version}", tmp_path / "b.fmu", {"source_only": True}) == first
    assert exports.export(replace(nqvm, digest="0" * 64), f"fmu{version}", Path("a.fmu"), {"source_only": True}) != first


def test_models_without_inputs_states_sensors_or_sets(tmp_path: Path) -> None:
    """What C cannot leave empty is left out of the FMU all the same."""
    swing = tmp_path / "swing.toml"
    swing.write_text(
        '[model]\nname = "swing"\nsample_time = "1 ms"\n[parameters]\nm = { value = 2, unit = "kg" }\n'
        'c = { value = 200, unit = "N/m", tunable = true }\n'
        '[bodies]\nbob = { mass = "m", start_position = "10 mm" }\n[elements]\n'
        's = { between = ["bob", "ground"], law = "linear_spring", stiffness = "c" }\n'
        '[outputs]\nx = { value = "z_bob", unit = "m" }\n'
    )
    gain = tmp_path / "gain.toml"
    gain.write_text(
        '[model]\nname = "gain"\nsample_time = "1 ms"\n[parameters]\nk = { value = 3, unit = "1" }\n[inputs]\nu = { unit = "m" }\n'
        '[outputs]\ny = { value = "k*u", unit = "m" }\n'
    )
    for path, name, versions in ((swing, "x", (2,)), (gain, "y", (3,))):
        model = penode_gen.load(path)
        for version in versions:
            fmu = export(model, version, tmp_path)
            assert validate_fmu(str(fmu)) == []
            master = Master(Unpacked(fmu, tmp_path / f"{model.name}{version}"))
            master.initialise()
            if name == "y":
                master.set("u", 2.0)
            for _ in range(500):
                master.step(STEP)
            expected = 0.01 * np.cos(10 * 0.5) if name == "x" else 6.0
            assert master.get(name) == pytest.approx([expected], abs=2e-6)  # float, 500 steps of RK4
            if name == "x":
                master.set("c", 800.0)
                master.step(STEP)
                assert master.get("set_id") == 1000


def test_all_functions_of_the_standard_are_there(unpacked: Unpacked) -> None:
    """Importers that look for each of them find it."""
    from penode_gen.exports.fmi.functions import functions

    library = ctypes.CDLL(str(next(unpacked.folder.rglob("*.so"))))
    assert (
        all(hasattr(library, f.name) for f in functions(unpacked.version))
        and len(functions(unpacked.version)) == {3: 75, 2: 44}[unpacked.version]
    )


def test_a_binary_that_is_missing_is_a_note(
    nqvm: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """With no compiler at all the FMU has its sources, and a line for each platform says why there is no more."""
    from penode_sil.cli import cli

    monkeypatch.setenv("PATH", str(tmp_path))
    cli(args=["export", str(nqvm.path), "--format", "fmu3", "-o", str(tmp_path / "bare.fmu")], standalone_mode=False)
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2 and all(
        line.startswith("note: no binary for ") and " is not installed; install it, on Debian: apt-get install gcc" in line
        for line in lines
    ), lines
    assert not any(name.startswith("binaries/") for name in zipfile.ZipFile(tmp_path / "bare.fmu").namelist())
    cli(args=["export", str(nqvm.path), "--format", "fmu3", "--source-only", "-o", str(tmp_path / "bare.fmu")], standalone_mode=False)
    assert capsys.readouterr().err == ""
