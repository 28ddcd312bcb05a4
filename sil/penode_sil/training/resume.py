# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Where a training is, in one file: one that was interrupted goes on from there and ends with the same bits.

A training is a row of fits, and everything between them follows from where they ended. So it is enough to keep where each fit is: a
training that resumes runs again from its start, but each fit begins where it was. Bits are the same because all else is
computed again by the same programs from the same files, which the checkpoint names; a fit that starts elsewhere than it did is refused.
"""

from __future__ import annotations

import hashlib
import json
import time
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, is_dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import UserError, WrongUse
from ..output import whole

Array = NDArray[np.float64]
NAME = "checkpoint.npz"
ANEW = "leave out --resume to start again"


@dataclass(frozen=True, eq=False)
class State:
    """Where a fit is: all unknowns [n], cost there, damping of the next step, steps in a row that gained little, steps taken."""

    vector: Array
    cost: float
    damping: float
    poor: int
    steps: int


class OtherBits(WrongUse):
    """This computer computes other bits than the one that wrote a checkpoint, which stays."""


class Journal:
    """States of all fits of a training, in their order. `path`: the file that holds them, written whole after each step; None: none is."""

    def __init__(self, path: Path | None = None, identity: Mapping[str, str] | None = None):
        self.path, self.identity = path, dict(identity or {})
        self.before = 0.0  # processor time [s] of the runs before this one
        self.written = False
        self._started = time.process_time()
        self._entered = 0
        self._starts: list[str] = []  # digest of where each fit began
        self._states: dict[int, State] = {}

    def enter(self, start: Sequence[Array]) -> tuple[int, State | None]:
        """Number of the fit that begins at `start`, all that it starts from, and where it was when it was interrupted. UserError where
        another start is on record: then the bits of this computer are others."""
        number, self._entered = self._entered, self._entered + 1
        if self.path is None:
            return number, None
        key = hashlib.sha256(b"".join(np.ascontiguousarray(a, dtype=float).tobytes() for a in start)).hexdigest()
        if number == len(self._starts):
            self._starts.append(key)
        elif self._starts[number] != key:
            raise OtherBits(f"{self.path}: this computer does not compute the bits of the one that wrote it; go on there, or {ANEW}")
        return number, self._states.get(number)

    def note(self, number: int, state: State) -> None:
        """Keep where a fit is."""
        if self.path is None:
            return
        self._states[number], self.written = state, True
        self.path.parent.mkdir(exist_ok=True)
        numbers = sorted(self._states)
        states = [self._states[k] for k in numbers]
        with whole(self.path) as part:
            np.savez(
                part,
                identity=json.dumps(self.identity),
                starts=np.array(self._starts),
                numbers=np.array(numbers),
                spent=self.before + time.process_time() - self._started,
                lengths=np.array([len(s.vector) for s in states]),
                vectors=np.concatenate([s.vector for s in states]),
                costs=np.array([s.cost for s in states]),
                dampings=np.array([s.damping for s in states]),
                poor=np.array([s.poor for s in states]),
                steps=np.array([s.steps for s in states]),
            )

    def read(self) -> None:
        """What the file has. UserError for one that is damaged, or of another training."""
        assert self.path is not None
        try:
            with np.load(self.path, allow_pickle=False) as found:
                file = {name: found[name] for name in found.files}
            identity = json.loads(str(file["identity"]))
            self.before, self._starts = float(file["spent"]), [str(s) for s in file["starts"]]
            ends = np.cumsum(file["lengths"])
            vectors = np.split(file["vectors"], ends[:-1])
            rows = zip(file["numbers"], vectors, file["costs"], file["dampings"], file["poor"], file["steps"], strict=True)
            self._states = {int(n): State(v, float(c), float(d), int(p), int(s)) for n, v, c, d, p, s in rows}
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as exc:
            raise WrongUse(f"{self.path}: not a readable checkpoint ({exc}); {ANEW}") from exc
        differs = [name for name in {**identity, **self.identity} if identity.get(name) != self.identity.get(name)]
        if differs:
            raise WrongUse(f"{self.path}: a checkpoint of a training with other {', '.join(differs)}; call it as then, or {ANEW}")


@contextmanager
def journal(folder: Path, identity: Mapping[str, str], resume: bool) -> Iterator[Journal]:
    """The journal of a training whose results go into `folder`. The file goes away when the block ends, or fails for the user's input; it
    stays when it is interrupted."""
    found = Journal(folder / NAME, identity)
    new = not folder.exists()
    if resume and (folder / NAME).exists():
        found.read()
    elif resume and (folder / "training.json").exists():
        raise WrongUse(f"{folder}: this training has ended, there is nothing to resume; {ANEW}")
    try:
        yield found
    except UserError as exc:
        if found.written and not isinstance(exc, OtherBits):
            (folder / NAME).unlink(missing_ok=True)
        if new and folder.exists() and not any(folder.iterdir()):
            folder.rmdir()
        raise
    (folder / NAME).unlink(missing_ok=True)


def identity(facts: Mapping[str, object]) -> dict[str, str]:
    """Facts by name as digests: files and arrays by their content, mappings in the order of their names."""

    def bits(value: object) -> bytes:
        if isinstance(value, Path):
            return hashlib.sha256(value.read_bytes()).digest()
        if isinstance(value, np.ndarray):
            return np.ascontiguousarray(value).tobytes()
        if is_dataclass(value):
            value = tuple(vars(value).values())
        if isinstance(value, Mapping):
            value = sorted(value.items())
        if isinstance(value, (tuple, list)):
            return b"".join(hashlib.sha256(bits(v)).digest() for v in value)
        return repr(value).encode()

    return {name: hashlib.sha256(bits(value)).hexdigest() for name, value in facts.items()}
