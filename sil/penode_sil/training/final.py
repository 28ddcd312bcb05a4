# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The final check of a training: the written model file is read back and simulated as `penode simulate` does it, beside the nominal one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import numpy as np

from penode_gen.model import Model

from ..compared import Compared, worsened
from ..errors import UserError
from ..predicted import Options, Predicted, both, read
from ..recordings.measured import Measured
from ..replay import Replay


@dataclass(frozen=True)
class Figure(Compared):
    """The same error of the trained model as written."""

    trained: float


@dataclass(frozen=True)
class Checked:
    """All figures; the options of `penode simulate` that give them; sensors that the trained model predicts `worse` than the nominal
    one, on the hold-out, or else in training; and notes on recordings that `penode simulate` does not read."""

    figures: tuple[Figure, ...]
    simulated: str
    worse: tuple[str, ...]
    notes: tuple[str, ...]


def checked(nominal: Model, trained: Model, train: Sequence[Measured], held: Sequence[Measured], channels: Sequence[str]) -> Checked:
    """Both models on all recordings, a file once. Start states are fitted to the first samples if both models together follow the
    recordings better with them than from those of the model file."""
    plain = Options("default", tuple(channels))
    recordings, notes = _read(nominal, plain, train, held)
    starts = (False, True) if nominal.states else (False,)
    tried = [both((nominal, trained), [r for _, r in recordings], replace(plain, measured=fitted)) for fitted in starts]
    options, pairs = min(tried, key=lambda t: _missed(t[1]))
    figures = tuple(f for (role, r), pair in zip(recordings, pairs, strict=True) for f in _figures(r, role, pair))
    judged = [f for f in figures if f.role == "hold-out"] or figures
    worse = tuple(dict.fromkeys(f.signal for f in judged if np.isfinite(f.nominal) and worsened(f.nominal, f.trained)))
    return Checked(figures, str(options), worse, notes)


def _read(
    nominal: Model, options: Options, train: Sequence[Measured], held: Sequence[Measured]
) -> tuple[list[tuple[str, Replay]], tuple[str, ...]]:
    """Recordings with their roles, and notes on those that `penode simulate` does not read as they are."""
    found: dict[Path, tuple[str, Replay]] = {}
    notes = {}
    for role, m in (*(("training", m) for m in train), *(("hold-out", m) for m in held)):
        if m.path in found or m.path in notes:
            continue
        try:
            found[m.path] = role, read(m, nominal, options)
        except UserError as exc:
            notes[m.path] = f"penode simulate does not take {m.path.name}, so the final check leaves it out: {exc.problems[0]}"
    return list(found.values()), tuple(notes.values())


def _figures(recording: Replay, role: str, pair: tuple[Predicted, Predicted]) -> list[Figure]:
    before, after = (p.errors for p in pair)
    return [
        Figure(recording.plan.path.name, role, name, e["unit"], e["samples"], e["value"], after[name]["value"])
        for name, e in before.items()
    ]


def _missed(pairs: Sequence[tuple[Predicted, Predicted]]) -> float:
    """Sum of the logarithms of all errors: a sensor counts by its ratio, in whatever unit it is."""
    errors = [e["value"] for p in chain.from_iterable(pairs) for e in p.errors.values()]
    return float(np.sum(np.log(np.maximum(np.nan_to_num(errors, nan=np.inf), 1e-300))))
