# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A log of a controller against a SiL run with the exchange where the log shows the new id."""

from __future__ import annotations

from typing import Any

import numpy as np

import penode_gen
from penode_sil.calibration.codes import Slave
from penode_sil.calibration.measure import Log
from penode_sil.schedule import Call
from penode_sil.targets import Sil


def drive(model: Any, n: int = 2000) -> np.ndarray:
    """Inputs that never repeat within n samples: 30 mm, two incommensurate waves."""
    k = np.arange(n)
    return (0.02 * np.sin(0.02 * k) + 0.01 * np.sin(0.0313 * k)).reshape(-1, 1).astype(np.float32)


def sil_with_exchange(model: Any, u: np.ndarray, steps: int, adopting: int, name: str) -> np.ndarray:
    """Outputs [steps, n_y] of a SiL run whose step `adopting`, counted from 1, adopts a set."""
    values = np.asarray(penode_gen.set_values(model, name))
    calls = [Call(adopting - 1, "begin", head=penode_gen.set_head(model, name)), Call(adopting - 1, "write", values=values), Call(adopting - 1, "commit")]
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
