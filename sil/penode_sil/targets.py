# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The generated C as it is deployed: compiled into a shared library (SiL), or for an emulated Cortex-M (PiL).

Both take the same inputs and the same calls (see schedule) and give the same bits.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import penode_gen
from penode_gen.algebra import placeholder
from penode_gen.model import Model
from penode_gen.resources import native

from .building import FLAGS, Part, build_library, build_once, compiler_version, generated, include, missing_tool, model_options, sources_in
from .choices import MACHINES as MACHINES
from .errors import TargetError
from .instance import Instance, Set
from .schedule import Call

Progress = Callable[[int], None]  # gets the samples done


@dataclass(frozen=True)
class Cost:
    """Instructions of the steps of one kind ("normal", "adopting", "holding"): how many steps, fewest and most."""

    steps: int
    least: int
    most: int


@dataclass(frozen=True, eq=False)
class Run:
    """What a target did: per sample x, y, z [n, .] and status [n]; per call its status; on PiL what it cost."""

    x: NDArray[Any]
    y: NDArray[Any]
    z: NDArray[Any]
    status: NDArray[np.uint32]
    calls: list[tuple[Call, int]]
    cost: dict[str, Cost] = field(default_factory=dict)
    stack: int = 0  # [bytes] most that a step took

    @property
    def digest(self) -> str:
        """SHA-256 over the bytes of states and outputs of all samples."""
        return hashlib.sha256(self.x.tobytes() + self.y.tobytes()).hexdigest()


# -- SiL --------------------------------------------------------------------------------------------------------------


class Sil:
    """A model's shared library; instance() gives as many independent copies as wanted."""

    def __init__(self, model: Model, dtype: type = np.float32, compiler: Sequence[str] = ("gcc", "-O2"), source: Path | None = None):
        self.model, self.dtype = model, dtype
        self._library = ctypes.CDLL(str(build_library(model, dtype, compiler, source)))
        sizes = list((ctypes.c_uint32 * 8).in_dll(self._library, "sil_sizes"))
        self.instance_size, self.banks_size, self.saved_size = sizes[0], sizes[1], sizes[7]
        if sizes[2] != np.dtype(dtype).itemsize:
            raise AssertionError("the library was built for another real type")
        self.n_x, self.n_u, self.n_y, self.n_z = (size // sizes[2] for size in sizes[3:7])
        self.set_length = self.banks_size // (2 * sizes[2])

    def function(self, name: str) -> Callable[..., int]:
        """A function of the generated interface, without the model's prefix, that returns a status."""
        return self.runtime(f"{self.model.name}_{name}")

    def loop(self) -> Callable[..., None]:
        """sil_run: many steps in one call."""
        found = self._library.sil_run
        found.restype = None
        run: Callable[..., None] = found
        return run

    def runtime(self, name: str) -> Callable[..., int]:
        """A function of the runtime, pen_..., that returns a status."""
        found = getattr(self._library, name)
        found.restype = ctypes.c_uint32
        function: Callable[..., int] = found
        return function

    def flash_set(self, name: str) -> Set:
        """The committed set of that name, as it lies in the library."""
        return Set.in_dll(self._library, f"{self.model.owner}_set_{name}")

    def instance(self, set_name: str = "default", banks: bool = True) -> SilInstance:
        """A fresh, initialised instance."""
        return SilInstance(self, set_name, banks)

    def run(self, u: NDArray[Any], calls: Sequence[Call] = (), set_name: str = "default", progress: Progress = lambda n: None) -> Run:
        """Initialise an instance with a set and step through u [n, n_u]."""
        return self.instance(set_name).run(u, calls, progress)


class SilInstance(Instance):
    """One instance, with scheduled calls and runs over many samples."""

    def call(self, call: Call) -> int:
        """Make one scheduled call."""
        if call.kind == "begin":
            return self.begin(call.head)
        if call.kind == "write":
            return self.write(call.offset, call.values)
        if call.kind == "select":
            return self.select(call.set)
        if call.kind == "hold":
            return self.hold(call.on)
        if call.kind == "state":
            return self.set_state(call.values)
        return {"commit": self.commit, "abort": self.abort, "rollback": self.rollback}[call.kind]()

    def run(self, u: NDArray[Any], calls: Sequence[Call] = (), progress: Progress = lambda n: None) -> Run:
        """Step through u [n, n_u], making each call before its sample."""
        u = np.ascontiguousarray(placeholder.columns(self.sil.model, u).reshape(-1, self.sil.n_u), dtype=self.dtype)
        total = len(u)
        samples = self._zeros(total, self.sil.n_x + self.sil.n_y + self.sil.n_z)
        status, made, done = np.zeros(total, dtype=np.uint32), [], 0
        loop = self.sil.loop()

        def advance(until: int) -> None:
            nonlocal done
            while done < until:
                n = min(until - done, 10_000)
                loop(
                    self._self,
                    ctypes.c_uint32(n),
                    self._pointer(u[done:]),
                    self._pointer(samples[done:]),
                    self._pointer(self._y),
                    self._pointer(status[done:]),
                )
                done += n
                progress(done)

        for call in calls:
            advance(min(call.sample, total))
            made.append((call, self.call(call)))
        advance(total)
        x, y, z = np.split(samples, np.cumsum([self.sil.n_x, self.sil.n_y]), axis=1)
        return Run(np.ascontiguousarray(x), np.ascontiguousarray(y), np.ascontiguousarray(z), status, made)


# -- PiL --------------------------------------------------------------------------------------------------------------

TAPE_MAGIC = int.from_bytes(b"PIL1", "little")
OPERATION = {"end": 0, "step": 1, "begin": 2, "write": 3, "commit": 4, "abort": 5, "select": 6, "rollback": 7, "hold": 8, "state": 9}
COST_KINDS = ("normal", "adopting", "holding")
PORT = native("port", "cortex-m")
SHELL = "sh"  # its scripts are called by it: not all that unpacks a wheel keeps that they are executable
TROUBLE = {
    1: "it could not open, read or write its files",
    2: "it was given a tape for another model",
    3: "it refused the first parameter set",
    70: "it met a processor fault",
    124: "it took too long",
}


def build_firmware(model: Model, machine: str, source: Path | None = None, optimise: str = "-O2") -> Path:
    """The PiL program of a model for one of MACHINES."""
    source = source or generated(model)
    code, runtime = [source / f"{model.name}.c", source / f"{model.owner}_params.c"], sources_in(("src", "*.c"))
    program, board = native("sil", "firmware", "pil.c"), MACHINES[machine]
    port = native("port", "host", "board.c")
    sets = ",".join(f"&{model.name}_set_{name}" for name in model.sets)
    compiler = "arm-none-eabi-gcc" if board else "gcc"
    options = [*(cross(board) if board else ["gcc", *include("inc", "port/gnu", "sil/firmware")]), *FLAGS, optimise]
    read: list[Part] = [compiler_version(compiler), *runtime, *_included()]
    same = build_once(f"runtime-{machine}", ".o", [*options, "-r", "-nostdlib", *map(str, runtime)], read)  # for every model
    files = [program, *code, same, *([] if board else [port])]
    command = [*options, *model_options(model), f"-DMODEL_SETS={sets}", f"-I{source}", *map(str, files)]
    return build_once(f"{model.name}-{machine}", ".elf", command, [*read, program, *code, source / f"{model.name}.h", same])


def cross(board: str) -> list[str]:
    """The compiler for an emulated board, port/cortex-m/cc. Raises UserError where that calls one that is not installed."""
    if shutil.which("arm-none-eabi-gcc") is None:
        raise missing_tool("arm-none-eabi-gcc")
    return [SHELL, str(PORT / "cc"), board]


def build_object(model: Any, machine: str, name: str) -> Path:
    """One file of a model's C as it is for an emulated one of MACHINES, by itself."""
    source = generated(model)
    command = [*cross(MACHINES[machine]), *FLAGS, "-O2", f"-I{source}", *include("src"), "-c", str(source / name)]
    read: list[Part] = [
        compiler_version("arm-none-eabi-gcc"),
        source / name,
        source / f"{model.name}.h",
        *sources_in(("src", "*.h")),
        *_included(),
    ]
    return build_once(f"{Path(name).stem}-{machine}", ".o", command, read)


def _included() -> list[Path]:
    """What any program for one of MACHINES may include, and how its compiler is called."""
    return [path for path in sources_in(("inc", "*.h"), ("port", "*"), ("sil/firmware", "*.h")) if path.is_file()]


class Pil:
    """A model's C in float on an emulated Cortex-M, or in a process of its own ("host")."""

    dtype = np.float32

    def __init__(self, model: Model, machine: str = "m4f", source: Path | None = None, optimise: str = "-O2", limit: int = 900):
        self.model, self.machine, self.limit = model, machine, limit
        self.program = build_firmware(model, machine, source, optimise)

    def run(self, u: NDArray[Any], calls: Sequence[Call] = (), set_name: str = "default", progress: Progress = lambda n: None) -> Run:
        """Initialise an instance with a set and step through u [n, n_u], making each call before its sample."""
        u = np.ascontiguousarray(placeholder.columns(self.model, u).reshape(-1, max(len(self.model.inputs), 1)), dtype=self.dtype)
        with tempfile.TemporaryDirectory() as folder:
            Path(folder, "tape").write_bytes(self._tape(u, calls, set_name))
            board = MACHINES[self.machine]
            if board and shutil.which("qemu-system-arm") is None:
                raise missing_tool("qemu-system-arm")
            command = [SHELL, str(PORT / "run"), board, str(self.program)] if board else [str(self.program)]
            process = subprocess.Popen(
                [*command, "tape", "record"],
                cwd=folder,
                env=os.environ | {"LIMIT": str(self.limit)},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
            )
            record = Path(folder, "record")
            while process.poll() is None:
                try:
                    process.wait(0.2)
                except subprocess.TimeoutExpired:
                    progress(min(len(u), self._rows(record.stat().st_size if record.exists() else 0)))
            text = (process.stdout.read() if process.stdout else "").strip().replace("\n", " | ")
            if process.returncode != 0:
                what = TROUBLE.get(process.returncode, f"it ended with {process.returncode}")
                raise TargetError(f"pil:{self.machine}: {what}{': ' + text if text else ''}; run make test to check the installation")
            progress(len(u))
            return self._read(np.fromfile(record, dtype="<u4"), len(u), calls)

    @property
    def _widths(self) -> tuple[int, int, int]:
        return len(self.model.states), len(self.model.outputs), len(self.model.sensors)

    def _rows(self, size: int) -> int:
        return size // (4 * (sum(self._widths) + 1))

    def _tape(self, u: NDArray[Any], calls: Sequence[Call], set_name: str) -> bytes:
        """Inputs and calls as pil.c reads them."""
        names, (n_x, n_y, n_z) = list(self.model.sets), self._widths
        layout, length, *_ = penode_gen.set_head(self.model, set_name, self.dtype)
        parts: list[Any] = [[TAPE_MAGIC, 4, 4 * n_x, 4 * u.shape[1], 4 * n_y, 4 * n_z, length, layout, names.index(set_name)]]
        done = 0
        for call in [*calls, None]:
            until = len(u) if call is None else min(call.sample, len(u))
            if until > done:
                parts += [[OPERATION["step"], until - done], u[done:until]]
                done = until
            if call is None:
                break
            parts.append([OPERATION[call.kind]])
            if call.kind == "begin":
                parts.append(list(call.head))
            elif call.kind == "write":
                parts += [[call.offset, len(call.values)], call.values]
            elif call.kind == "select":
                parts.append([names.index(call.set)])
            elif call.kind == "hold":
                parts.append([int(call.on)])
            elif call.kind == "state":
                parts.append(call.values)
        parts.append([OPERATION["end"]])
        return b"".join(np.asarray(p, dtype="<u4" if isinstance(p, list) else "<f4").tobytes() for p in parts)

    def _read(self, words: NDArray[np.uint32], total: int, calls: Sequence[Call]) -> Run:
        """The record as pil.c writes it."""
        widths = self._widths
        row = sum(widths) + 1
        if words.size != total * row + len(calls) + 3 * len(COST_KINDS) + 1:
            raise AssertionError(f"the record has {words.size} words, which is not what the tape asked for")
        rows, made, done, at = np.empty((total, row), dtype=np.uint32), [], 0, 0
        for call in [*calls, None]:
            until = total if call is None else min(call.sample, total)
            n = (until - done) * row
            rows[done:until] = words[at : at + n].reshape(-1, row)
            done, at = until, at + n
            if call is not None:
                made.append((call, int(words[at])))
                at += 1
        cost = {kind: Cost(*map(int, words[at + 3 * k : at + 3 * k + 3])) for k, kind in enumerate(COST_KINDS)}
        cost = {kind: c for kind, c in cost.items() if c.steps and c.most}
        x, y, z = np.split(rows[:, :-1].view(np.float32), np.cumsum(widths[:2]), axis=1)
        return Run(
            np.ascontiguousarray(x), np.ascontiguousarray(y), np.ascontiguousarray(z), rows[:, -1].copy(), made, cost, int(words[-1])
        )
