# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Instructions and modelled Cortex-M4 cycles of the calls of a function, counted while a program runs in the emulator.

    cycles.py PROGRAM.elf FUNCTION [--machine m4f] [--annotate] [-- ARGUMENTS...]
    cycles.py MODEL.toml FUNCTION [--machine m4f] [--flags=-O2] [--annotate]

A model file is generated, compiled with the runtime as it stands, and driven with hostile inputs and an exchange of
sets. --annotate prints for each instruction its address, how often it was executed, and low and high cycles.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cortex_m4
import numpy as np
from figures import exchange, hostile_inputs
from numpy.typing import NDArray

import penode_gen
from penode_sil.building import build_directory
from penode_sil.targets import MACHINES, PORT, Pil

HERE = Path(__file__).parent
CALL = np.dtype([("entry", "<u8"), ("instructions", "<u8"), ("low", "<u8"), ("high", "<u8")])


@dataclass(frozen=True, eq=False)
class Counted:
    """What was counted: for each call its instructions and cycles, for each instruction how often it was executed."""

    calls: dict[str, NDArray]  # of CALL, by function
    code: Sequence[cortex_m4.Instruction]
    hits: NDArray[np.uint64]  # [instruction][reached from above, by a jump]
    cost: NDArray[np.uint32]  # [instruction][below, jumped, away][low, high]


def plugin() -> Path:
    """The compiled plugin."""
    source, made = HERE / "count.c", build_directory() / "count.so"
    if not made.exists() or made.stat().st_mtime < source.stat().st_mtime:
        made.parent.mkdir(parents=True, exist_ok=True)
        part = made.with_suffix(f".{os.getpid()}")
        subprocess.run(["gcc", "-O2", "-Wall", "-Wextra", "-shared", "-fPIC", "-o", str(part), str(source)], check=True)
        part.replace(made)
    return made


def symbols(elf: Path) -> dict[str, int]:
    """Addresses of the functions of a program."""
    return _symbols(elf, elf.stat().st_mtime_ns)


@lru_cache(8)
def _symbols(elf: Path, _made: int) -> dict[str, int]:
    lines = subprocess.run(["arm-none-eabi-nm", str(elf)], check=True, capture_output=True, text=True).stdout.splitlines()
    return {
        name: int(address, 16) & ~1 for address, kind, name in (line.split() for line in lines if len(line.split()) == 3) if kind in "tTwW"
    }


def costs(code: Sequence[cortex_m4.Instruction]) -> NDArray[np.uint32]:
    """Cycles of each instruction after the one above, after a jump, more if it jumps: [3][low, high]; 0 if unknown."""
    found = np.zeros((len(code), 3, 2), dtype=np.uint32)
    for k, this in enumerate(code):
        alone = cortex_m4.base(this)
        if alone is not None:
            above = code[k - 1] if k and code[k - 1].address + code[k - 1].size == this.address else None
            found[k] = (cortex_m4.after(above, this) if above else alone, alone, cortex_m4.away(this))
    return found


@contextmanager
def counting(elf: Path, functions: Sequence[str], modelled: bool = True) -> Iterator[Callable[[], Counted]]:
    """
    Runs of port/cortex-m/run inside of the block are counted; gives a function that reads the result of the last one.
    modelled: with cycles; then an instruction that a Cortex-M4 has not is an error.
    """
    code, places = cortex_m4.disassemble(elf), symbols(elf)
    unknown = [name for name in functions if name not in places]
    if unknown:
        raise SystemExit(f"{elf}: no function {', '.join(unknown)}; it may be inlined")
    cost = costs(code) if modelled else np.zeros((len(code), 3, 2), dtype=np.uint32)
    rows = np.zeros((len(code) + len(functions), 8), dtype="<u4")
    rows[: len(code), 0] = [i.address for i in code]
    rows[: len(code), 1] = [i.size for i in code]
    rows[: len(code), 2:] = cost.reshape(-1, 6)
    rows[len(code) :, 0] = [places[name] for name in functions]

    def read() -> Counted:
        calls = np.fromfile(files["calls"], dtype=CALL)
        hits = np.fromfile(files["hits"], dtype="<u8").reshape(-1, 2)
        strange = [code[k].text for k in np.flatnonzero(hits.sum(axis=1)) if modelled and cortex_m4.base(code[k]) is None]
        if strange:
            raise AssertionError(f"{elf}: cortex_m4.py does not know {strange[0]}")
        return Counted({name: calls[calls["entry"] == places[name]] for name in functions}, code, hits, cost)

    with tempfile.TemporaryDirectory() as folder:
        files = {kind: Path(folder, kind) for kind in ("table", "calls", "hits")}
        rows.tofile(files["table"])
        os.environ["PLUGIN"] = ",".join([str(plugin()), *(f"{kind}={path}" for kind, path in files.items())])
        try:
            yield read
        finally:
            del os.environ["PLUGIN"]


def count_program(elf: Path, functions: Sequence[str], machine: str = "m4f", arguments: Sequence[str] = ()) -> Counted:
    """Run a program of port/cortex-m and count the calls of its functions."""
    with counting(elf, functions, machine == "m4f") as result:
        subprocess.run([str(PORT / "run"), MACHINES[machine], str(elf), *arguments], check=True)
        return result()


def spread(values: NDArray) -> str:
    """Least and most, or the one value."""
    return f"{values.min()}" if values.min() == values.max() else f"{values.min()} .. {values.max()}"


def described(calls: NDArray, machine: str) -> str:
    """Calls (CALL) of one function in a line."""
    text = f"{len(calls)} calls, instructions {spread(calls['instructions'])}"
    cost = f", Cortex-M4 cycles low {spread(calls['low'])}, high {spread(calls['high'])}"
    return text + (cost if machine == "m4f" else "")


def annotate(counted: Counted) -> str:
    """Executed instructions with how often, and their cycles in all, low and high."""
    lines = []
    for k in np.flatnonzero(counted.hits.sum(axis=1)):
        below, jumped = counted.hits[k]
        low, high = below * counted.cost[k, 0] + jumped * counted.cost[k, 1]
        lines.append(f"{counted.code[k].address:8x} {below + jumped:10} {low:10} {high:10}  {counted.code[k].text}")
    return "\n".join(lines)


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("what", type=Path, help="a program for one of the boards of port/cortex-m, or a model file")
    arguments.add_argument("function", help="name of a function that is not inlined")
    arguments.add_argument("--machine", default="m4f", choices=[m for m in MACHINES if MACHINES[m]])
    arguments.add_argument("--flags", default="-O2", help="optimisation of a model file's program")
    arguments.add_argument("--annotate", action="store_true", help="print the executed instructions, too")
    arguments.add_argument("rest", nargs="*", help="arguments of the program")
    given = arguments.parse_args()
    if given.what.suffix == ".toml":
        counted = model_steps(given.what, given.machine, given.flags, given.function)
    else:
        counted = count_program(given.what, [given.function], given.machine, given.rest)
    if given.annotate:
        print(annotate(counted))
    print(f"{given.function}: {described(counted.calls[given.function], given.machine)}")
    return 0


def model_steps(path: Path, machine: str, flags: str, function: str) -> Counted:
    """Steps of a model with the runtime as it stands."""
    model = penode_gen.load(path)
    pil = Pil(model, machine, optimise=flags)
    with counting(pil.program, [function], machine == "m4f") as result:
        u = np.repeat(hostile_inputs(), len(model.inputs), axis=1)
        pil.run(u, exchange(model, 400) if len(model.sets) > 1 else [])
        return result()


if __name__ == "__main__":
    sys.exit(main())
