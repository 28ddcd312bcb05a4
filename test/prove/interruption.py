# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Where a program with interrupt.inc in it was interrupted, and where it should have been."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import gate
import numpy as np

sys.path.insert(0, str(gate.ROOT / "test" / "bench"))
import cycles

from penode_sil.targets import MACHINES, PORT


def interrupted(work: Path, machine: str, elf: Path) -> tuple[str, int, list[set[int]]]:
    """What the program says, its exit code, and the addresses at which it interrupted calls and steps."""
    bits = elf.with_suffix(".bits")
    done = gate.run([PORT / "run", MACHINES[machine], elf, 1, bits.name], work, env=os.environ | {"SHIFT": "10", "LIMIT": "300"})
    halves = np.unpackbits(np.fromfile(bits, np.uint8), bitorder="little").reshape(2, -1) if done.returncode in (0, 1) else np.zeros((2, 0))
    return done.stdout + done.stderr, done.returncode, [{2 * int(k) for k in np.flatnonzero(half)} for half in halves]


def executed(work: Path, machine: str, elf: Path, function: str) -> set[int]:
    """Addresses in the 64 kB of code that what a wrapper (one jump) calls executes when nothing interrupts it."""
    with cycles.counting(elf, [function], modelled=False) as result:
        done = gate.run([PORT / "run", MACHINES[machine], elf, 0, "quiet.bits"], work)
        if done.returncode != 0:
            raise SystemExit(f"FAIL  {elf.name} without interrupts: {done.stdout}{done.stderr}")
        counted = result()
    wrapper = cycles.symbols(elf)[function]
    places = {counted.code[k].address for k in np.flatnonzero(counted.hits.sum(axis=1))} - {wrapper}
    return {address & 0xFFFF for address in places}


def never(what: str, must: set[int], met: set[int]) -> list[str]:
    """A line for each address that was executed, but never interrupted; and one if hardly any was executed: a call has more than 100."""
    return [f"{what}: never interrupted at {address:#x}" for address in sorted(must - met)] + (
        [] if len(must) > 100 else [f"{what}: only {len(must)} addresses executed"]
    )
