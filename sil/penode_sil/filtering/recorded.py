# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Recordings as a filter takes them: inputs on the model's raster, and each row of a sensor at the sample nearest to it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Model

from .. import replay
from ..errors import RecordingError
from ..replay import Replay
from .estimates import of

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Measured:
    """One recording on n samples, SI: inputs u [n, n_u], 0 where the filter estimates one; measurements z [n, n_z], and their mask [n]."""

    replay: Replay
    u: Array
    z: Array
    mask: NDArray[np.uint32]


def load(path: Path, model: Model, set_name: str | None, channels: Iterable[str], note: Callable[[str], None]) -> Measured:
    """Read a recording. Inputs that the filter estimates need not be in it. Raises UserError."""
    given = of(model)
    estimated = {i.name for i in given.inputs if not i.measured}
    read = replay.load(
        path, replace(model, inputs=tuple(i for i in model.inputs if i.name not in estimated)), set_name, channels, "linear", note
    )
    columns = iter(read.u.T)
    n = read.times.size
    u = np.column_stack([np.zeros((n, 0)), *(np.zeros(n) if i.name in estimated else next(columns) for i in model.inputs)])
    z, mask = np.full((n, len(given.sensors)), np.nan), np.zeros(n, np.uint32)
    for k, sensor in enumerate(given.sensors):
        sensed = read.sensed.get(sensor.name)
        if sensed is None:
            note(f"{path}: it holds no {sensor.name}; the filter goes without")
            continue
        at = np.rint((sensed.time - read.offset) / model.sample_time).astype(int)
        inside = (at >= 0) & (at < n)
        z[at[inside], k] = sensed.values[inside]
        mask[at[inside]] |= np.uint32(1 << k)
    if not mask.any():
        first = given.sensors[0].name
        raise RecordingError(
            f"{path}: it holds none of the sensors of the filter ({', '.join(s.name for s in given.sensors)}); name one, such as "
            f"--channel {first}=COLUMN",
            channel=first,
        )
    return Measured(read, u, z, mask)
