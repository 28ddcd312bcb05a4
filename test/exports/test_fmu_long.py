# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""FMUs for a minute, compiled from their own sources by FMPy, and in other importers; make python-long."""

from __future__ import annotations

import importlib.util
import shutil
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from case_study import chirp
from fmpy.build import build_platform_binary
from master import Master, Unpacked, export
from test_fmu import SET, STEP, run, write_set

import penode_gen
from penode_gen.sets import layout
from penode_sil.schedule import Call
from penode_sil.targets import Sil

pytestmark = pytest.mark.long


@pytest.mark.parametrize("compiled", [False, True], ids=["binary", "compiled by FMPy"])
@pytest.mark.parametrize("version", [3, 2])
def test_a_minute_with_the_exchange_at_2_s(nqvm: Any, held: Any, tmp_path: Path, version: int, compiled: bool) -> None:
    """60 s of the chirp, 60 001 samples: equal to the bit to SiL with held inputs."""
    unpacked = Unpacked(export(nqvm, version, tmp_path), tmp_path / "unpacked")
    if compiled:
        if shutil.which("cmake") is None:
            pytest.skip("there is no cmake for FMPy")
        shutil.rmtree(unpacked.folder / "binaries")
        if version == 2:
            with_configuration(unpacked.folder)
        build_platform_binary(unpacked.folder, all_warnings=True)
    u = chirp(60.0)
    master = Master(unpacked)
    found = run(master, u, {2000: lambda: write_set(master, nqvm, SET)})
    reference = Sil(held).run(u, [Call(2001, "select", set=SET)]).y
    assert np.array_equal(found, reference)


def with_configuration(folder: Path) -> None:
    """FMPy compiles what a build description says, and FMI 2 has none: the list of modelDescription.xml must be all that is needed."""
    listed = {line.split('"')[1] for line in (folder / "modelDescription.xml").read_text().splitlines() if "<File name=" in line}
    assert listed == {path.name for path in (folder / "sources").glob("*.c")}


@pytest.mark.skipif(importlib.util.find_spec("libcosimpy") is None, reason="libcosimpy is not installed")
def test_libcosim_changes_weights_while_it_runs(nqvm: Any, held: Any, tmp_path: Path) -> None:
    """FMI 2 in libcosim, with Modelon's FMI Library: the road at rest, from a start state; all weights overridden at 0.5 s."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    fmu = export(nqvm, 2, tmp_path)
    unpacked = Unpacked(fmu, tmp_path / "unpacked")
    execution = CosimExecution.from_step_size(int(STEP * 1e9))
    slave = execution.add_local_slave(CosimLocalSlave(fmu_path=str(fmu), instance_name="one"))
    execution.real_initial_value(slave, unpacked.reference["state.z_b"], 0.02)
    observer, manipulator = CosimObserver.create_last_value(), CosimManipulator.create_override()
    execution.add_observer(observer)
    execution.add_manipulator(manipulator)
    found = []
    values = penode_gen.set_values(nqvm, SET)
    for k in range(1000):
        if k == 500:
            for array in layout.arrays(nqvm):
                elements = unpacked.elements(array.name)
                manipulator.slave_real_values(
                    slave, [unpacked.reference[n] for n in elements], np.ravel(layout.gather(array, values)).tolist()
                )
        execution.step()
        found.append(observer.last_real_values(slave, [unpacked.reference["z_b"], unpacked.reference["z_w"]]))
    start = np.array([0.02, 0.0, 0.0, 0.0], np.float32)
    reference = Sil(held).run(np.zeros((1001, 1)), [Call(0, "state", values=start), Call(501, "select", set=SET)]).y
    assert np.array_equal(np.array(found), reference[1:])


@pytest.mark.skipif(importlib.util.find_spec("ecospy") is None, reason="ecospy is not installed")
@pytest.mark.parametrize("version", [3, 2])
def test_ecos_computes_the_same(nqvm: Any, held: Any, tmp_path: Path, version: int) -> None:
    """From a start state, the road at rest. In FMI 3 ecos has no arrays; it sets a named set."""
    try:
        from ecospy.EcosSimulation import EcosSimulation
        from ecospy.EcosSimulationStructure import EcosSimulationStructure
    except OSError as missing:  # its C++ needs a library of the system
        pytest.skip(f"ecospy cannot be loaded: {missing}")

    fmu = export(nqvm, version, tmp_path)
    structure = EcosSimulationStructure()
    structure.add_model("one", str(fmu))
    structure.add_parameter_set("start", {"one::state.z_b": 0.02})
    found = []
    with EcosSimulation(step_size=STEP, structure=structure) as simulation:
        simulation.init(start_time=0, parameter_set="start")
        for _ in range(1000):
            simulation.step(1)
            found.append([simulation.get_real("one::z_b"), simulation.get_real("one::z_w")])
    start = np.array([0.02, 0.0, 0.0, 0.0], np.float32)
    reference = Sil(held).run(np.zeros((1001, 1)), [Call(0, "state", values=start)]).y
    assert np.array_equal(np.array(found), reference[1:])


def test_the_archive_is_whole(nqvm: Any, tmp_path: Path) -> None:
    with zipfile.ZipFile(export(nqvm, 3, tmp_path)) as archive:
        assert archive.testzip() is None
