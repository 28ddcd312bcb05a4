# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Good MDF files to be damaged, and their reader in a forked process, for importing it anew for each file takes a second."""

from __future__ import annotations

import os
import random
import re
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr
from pathlib import Path

import numpy as np

from penode_sil.recordings import mdf

try:
    import asammdf
except ImportError:  # an optional extra
    asammdf = None


def good() -> list[bytes]:
    """The sensors of a quarter vehicle in two groups: as they are, and compressed. None without asammdf."""
    if asammdf is None:
        return []
    time, made = np.arange(400) * 1e-3, []
    for compression in (0, 2):
        with tempfile.TemporaryDirectory() as folder, asammdf.MDF(version="4.10") as file:
            road, body = 1e-3 * np.sin(20 * time), np.cos(30 * time)
            file.append([asammdf.Signal(road, time, "m", "z_road"), asammdf.Signal(body, time, "m/s^2", "a_body")], common_timebase=True)
            file.append([asammdf.Signal(-np.sin(9 * time[::2]), time[::2], "m/s^2", "a_wheel")])
            made.append(Path(file.save(Path(folder) / "good.mf4", compression=compression)).read_bytes())
    return made


def overwritten(data: bytes, pick: random.Random) -> bytes:
    """One to eight bytes in place, so that links still lead somewhere; every second time in a block's head or an entry of it."""
    heads = [m.start() for m in re.finditer(rb"##[A-Z][A-Z]", data)] or [0]
    at = pick.choice(heads) + pick.randrange(120) if pick.random() < 0.5 else pick.randrange(len(data) or 1)
    kept = data[at:][:8]
    new = pick.choice(
        [pick.randbytes(pick.randrange(1, 9)), bytes(len(kept)), b"\xff" * len(kept), kept[::-1], data[pick.choice(heads) :][:8]]
    )
    return data[:at] + new[: len(kept)] + data[at + len(new[: len(kept)]) :]


def forked(path: Path, asked: str) -> tuple[int, bytes]:
    """As mdf.apart: exit code (of a signal: negative) and output."""
    with tempfile.TemporaryFile() as out:
        child = os.fork()
        if child == 0:
            code = 1
            try:
                os.dup2(out.fileno(), 1)
                sys.stdout = stream = os.fdopen(1, "w")
                with open(os.devnull, "w") as nowhere, redirect_stderr(nowhere):
                    mdf._main(str(path), asked)
                stream.flush()
                code = 0
            finally:
                os._exit(code)
        status = os.waitpid(child, 0)[1]
        out.seek(0)
        return os.waitstatus_to_exitcode(status), out.read()


@contextmanager
def quick() -> Iterator[None]:
    """MDF files are read in forked processes."""
    before = mdf.apart
    mdf.apart = forked
    try:
        yield
    finally:
        mdf.apart = before
