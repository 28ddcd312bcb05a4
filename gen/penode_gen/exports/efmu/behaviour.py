# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The Behavioral Model of an eFMU: reference trajectories, also of a recalibration, with a column for each weight that changes."""

from __future__ import annotations

from ...model import Model
from ..templating import render
from . import manifest as manifests, variables as ev
from .code import Block
from .manifest import Representation
from .production import PRECISIONS
from .scenarios import columns, scenarios, time_column

FOLDER = "BehavioralModel"


def behaviour(model: Model, block: Block, algorithm: Representation, dialect: str, recalibration: str | None) -> Representation:
    """Manifest and tables. Raises ExportError."""
    found = scenarios(model, block.variables, recalibration)
    files = {f"{s.name}.csv": s.table(model) for s in found}
    signals = block.of("input") + block.of("output")
    tuned = [v for s in found for v, _, _ in s.tuned]
    id = manifests.identifier(model, FOLDER, dialect, str(recalibration))
    manifest = render(
        "efmu/behaviour.xml.j2",
        **manifests.shared(model, dialect),
        id=id,
        algorithm=algorithm,
        files=manifests.listed(files, {"csv": "ReferenceData"}),
        scenarios=found,
        signals=signals,
        outputs=block.of("output"),
        variables=[*signals, *tuned],
        columns=columns,
        pairs=zip,
        precisions=list(PRECISIONS),
        units=ev.unit_list([*signals, *tuned]),
        second=ev.unit_id("s"),
        sample_time=repr(float(model.sample_time)),
        time_column=time_column([v.label for v in signals]),
    )
    return Representation(FOLDER, "BehavioralModel", id, manifest, files)
