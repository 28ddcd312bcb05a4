# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A controller against its model: its sets and measurements, and a log against a SiL run with the exchange where it shows the new id."""

from __future__ import annotations

from typing import Any

import numpy as np

import penode_gen
from penode_sil.calibration import pages
from penode_sil.calibration.a2l_read import A2l
from penode_sil.calibration.codes import Slave
from penode_sil.calibration.link import Link
from penode_sil.calibration.measure import Log
from penode_sil.schedule import Call
from penode_sil.status import BIT
from penode_sil.targets import Sil

EIGHT = ["z_b", "z_w", "v_b", "v_w", "z_road", "a_body", "a_wheel", "deflection"]


def drive(model: Any, n: int = 2000) -> np.ndarray:
    """Inputs that never repeat within n samples: 30 mm, two incommensurate waves."""
    k = np.arange(n)
    return (0.02 * np.sin(0.02 * k) + 0.01 * np.sin(0.0313 * k)).reshape(-1, 1).astype(np.float32)


def sil_with_exchange(model: Any, u: np.ndarray, steps: int, adopting: int, name: str) -> np.ndarray:
    """Outputs [steps, n_y] of a SiL run whose step `adopting`, counted from 1, adopts a set."""
    values = np.asarray(penode_gen.set_values(model, name))
    calls = [
        Call(adopting - 1, "begin", head=penode_gen.set_head(model, name)),
        Call(adopting - 1, "write", values=values),
        Call(adopting - 1, "commit"),
    ]
    driven = np.tile(u, (steps // len(u) + 1, 1))[:steps]
    return np.asarray(Sil(model).run(driven, calls).y)


def check_log(model: Any, u: np.ndarray, log: Log, every: int) -> None:
    """No sample is missing, one exchange, to `altered_friction`, and z_b and z_w are those of SiL to the bit."""
    sample, ids = log.values["sample"].astype(int), log.values["set_in_force"]
    assert log.lost == 0 and (np.diff(sample) == every).all()
    changes = np.flatnonzero(np.diff(ids)) + 1
    assert len(changes) == 1 and (ids[0], ids[-1]) == (1, Slave.FIRST_ID)
    adopting = int(log.values["adopted_at"][-1])
    assert sample[changes[0]] - every < adopting <= sample[changes[0]]  # the log shows the new id with the step that adopts it
    expected = sil_with_exchange(model, u, int(sample[-1]), adopting, "altered_friction")[sample - 1]
    for n, name in enumerate(("z_b", "z_w")):
        assert (log.values[name].view(np.uint32) == expected[:, n].view(np.uint32)).all()
    other = sil_with_exchange(model, u, int(sample[-1]), adopting - 1, "altered_friction")[sample - 1]
    assert (log.values["z_b"] != other[:, 0]).any()  # one sample earlier is another log


def check_characteristics(model: Any, link: Link, a2l: A2l) -> None:
    """The running page is the set `default`, each of its values in one characteristic."""
    values = np.asarray(penode_gen.set_values(model, "default"))
    first, size, kind = pages.segment(a2l)
    seen = np.zeros(values.size, int)
    for entry in a2l.characteristics.values():
        at = (entry.address - first) // kind.itemsize
        seen[at : at + entry.count] += 1
        assert (link.values(entry) == values[at : at + entry.count]).all(), entry.name
    assert (seen == 1).all() and size == values.nbytes


def check_measurements(model: Any, u: np.ndarray, a2l: A2l, log: Log) -> None:
    """Every measurement of the A2L is in the log, and has the value of the model at each of its samples, to the bit."""
    sample = log.values["sample"].astype(int)
    run = Sil(model).run(np.tile(u, (sample[-1] // len(u) + 1, 1))[: sample[-1]])
    x, y, z, status = (np.asarray(of)[sample - 1] for of in (run.x, run.y, run.z, run.status))
    layout, running = penode_gen.set_head(model, "default")[0], model.sets["default"].id
    expected = {
        "sample": sample,
        "step_status": status,
        "set_in_force": running,
        "adopted_at": 0,
        "set.layout": layout,
        "set.active": 0,
        "set.id_0": running,
        "set.id_1": running,
    } | {f"count.{flag}": np.cumsum((run.status & bit) != 0)[sample - 1] for flag, bit in BIT.items()}
    expected |= {output.name: y[:, n] for n, output in enumerate(model.outputs)} | {
        i.name: u[(sample - 1) % len(u), n] for n, i in enumerate(model.inputs)
    }
    expected |= {f"state.{name}" if name in expected else name: x[:, n] for n, name in enumerate(model.states)}
    expected |= {sensor.name: z[:, n] for n, sensor in enumerate(model.sensors)}
    assert expected.keys() | {"late_steps"} == log.values.keys() == a2l.measurements.keys()  # late steps are those of the machine
    for name, values in expected.items():
        assert (log.values[name] == values).all(), name
    assert all(
        len(np.unique(log.values[entry.name])) > 1 for entry in (*model.inputs, *model.outputs, *model.sensors)
    )  # nothing stands still
