# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Programs that drive a step, ours or a peer's, and what can be read off them: bytes, and a bound of the stack."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

import cortex_m4
import cycles
import peers

import penode_gen
from penode_sil.building import FLAGS, generated, model_options
from penode_sil.targets import MACHINES, PORT

HERE = Path(__file__).parent
ROOT = HERE.resolve().parents[1]
PLACE = ROOT / "build" / "bench"


@dataclass(frozen=True)
class Program:
    """A program with drive.c, the function in it that is one step, and the objects that this function needs."""

    elf: Path
    step: str
    objects: list[Path]
    machine: str  # of MACHINES


@cache
def core(machine: str) -> list[str]:
    """The compiler's options for a machine's core."""
    text = subprocess.run(
        ["sh", "-c", f". {shlex.quote(str(PORT))}/machines.sh; choose_machine {MACHINES[machine]}; echo $core -mthumb"],
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    return text.split()


def _run(command: Sequence[str | Path]) -> str:
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"bench: {' '.join(map(str, command))}\n{done.stderr}")
    return done.stdout


def _make(command: Sequence[str | Path], output: Path) -> None:
    """Run a compiler that writes `output`, all or nothing: another process may be at it, too."""
    part = output.with_name(f"{os.getpid()}-{output.name}")
    _run([*command, "-o", part])
    part.replace(output)


def _compiler(machine: str) -> list[str]:
    return [str(PORT / "cc"), MACHINES[machine]] if MACHINES[machine] else [str(ROOT / "port" / "host" / "cc"), "gcc"]


def our_program(
    model: penode_gen.Model,
    machine: str = "m4f",
    flags: Sequence[str] = ("-O2",),
    main: Path = HERE / "drive.c",
    source: Path | None = None,
) -> Program:
    """Our step with the runtime as it stands; `main` drives it. source: where the model's C is; None: it is generated."""
    folder = PLACE / "programs" / "-".join([model.name, machine, main.stem, *flags, *(["committed"] if source else [])])
    source = source or generated(model)
    folder.mkdir(parents=True, exist_ok=True)
    sets = ",".join(f"&{model.name}_set_{name}" for name in model.sets)
    command = [*_compiler(machine), *FLAGS, *flags, *model_options(model), f"-I{source}", f"-DMODEL_SETS={sets}"]
    step = folder / f"{model.name}.o"
    _make([*command, "-c", source / f"{model.name}.c"], step)
    objects = [step, *_runtime(machine, tuple(flags))]
    elf = folder / "program.elf"
    drives = [*command, "-fno-strict-aliasing", main]  # it looks into an instance and makes numbers of bits
    _make([*drives, source / f"{model.owner}_params.c", *objects], elf)
    return Program(elf, f"{model.name}_step", objects, machine)


@cache
def _runtime(machine: str, flags: tuple[str, ...]) -> list[Path]:
    """The objects of src/."""
    folder = PLACE / "programs" / "-".join(["runtime", machine, *flags])
    folder.mkdir(parents=True, exist_ok=True)
    objects = []
    for path in sorted(set((ROOT / "src").glob("*.c")) - set((ROOT / "src").glob("pen_xcp*.c"))):  # no step needs a slave
        objects.append(folder / f"{path.stem}.o")
        _make([*_compiler(machine), *FLAGS, *flags, "-c", path], objects[-1])
    return objects


def peer_program(peer: peers.Peer, machine: str = "m4f", flags: Sequence[str] = ("-O2", "-ffp-contract=off")) -> Program:
    """A peer's step. The peer gets what it may want of the C library."""
    folder = PLACE / "programs" / "-".join([re.sub(r"\W+", "_", peer.name), machine, *flags])
    folder.mkdir(parents=True, exist_ok=True)
    plain = ["arm-none-eabi-gcc", *core(machine)] if MACHINES[machine] else ["gcc"]
    sections = ["-std=gnu99", "-w", "-ffunction-sections", "-fdata-sections", f"-I{peer.folder}", f"-I{peers.GLUE}"]
    objects = [folder / f"{path.parent.name}_{path.stem}.o" for path in peer.sources]
    for path, made in zip(peer.sources, objects, strict=True):
        _make([*plain, *sections, *flags, *peer.options, "-c", path], made)
    weights = folder / "weights.o"
    _make([*plain, *sections, "-c", peer.folder / "weights.c"], weights)
    elf = folder / "program.elf"
    _make([*_compiler(machine), "-O2", HERE / "drive.c", *objects, weights, "-lm", "-lc"], elf)
    return Program(elf, "peer_step", objects, machine)


def run(program: Program, arguments: Sequence[str], folder: Path, limit: int = 600) -> None:
    """Run a program on its machine, in a folder, for at most `limit` seconds."""
    machine = MACHINES[program.machine]
    command = [str(PORT / "run"), machine, str(program.elf)] if machine else [str(program.elf)]
    done = subprocess.run([*command, *arguments], cwd=folder, env=os.environ | {"LIMIT": str(limit)}, capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"bench: {program.elf} ended with {done.returncode}: {done.stdout}{done.stderr}")


# -- bytes ------------------------------------------------------------------------------------------------------------


def sizes(program: Program, weights_inside: int = 0) -> dict[str, int]:
    """Bytes of text, rodata and RAM of the step with all it calls, without weights: linked alone."""
    elf = program.elf.with_name("size.elf")
    _make(
        [
            "arm-none-eabi-gcc",
            *core(program.machine),
            "-nostdlib",
            "-Wl,--gc-sections",
            f"-Wl,-e,{program.step}",
            "-Wl,--defsym=peer_weights=0x10000000",
            *program.objects,
            "-lm",
            "-lc",
            "-lgcc",
        ],
        elf,
    )
    text = _run(["arm-none-eabi-size", "-A", elf])
    found = {m[1]: int(m[2]) for m in re.finditer(r"^\.(\w+)\S*\s+(\d+)", text, re.M)}
    return {
        "text": found.get("text", 0),
        "rodata": max(found.get("rodata", 0) - weights_inside, 0),  # some weights may have become literals in the text
        "ram": found.get("data", 0) + found.get("bss", 0),
    }


def size_of(elf: Path, variable: str) -> int:
    """Bytes of a variable of a program."""
    lines = _run(["arm-none-eabi-nm", "-S", elf]).splitlines()
    return next(int(line.split()[1], 16) for line in lines if line.endswith(f" {variable}"))


# -- stack ------------------------------------------------------------------------------------------------------------


def stack_bound(elf: Path, entry: str) -> int:
    """
    A bound [bytes] of the stack of a function and all it calls, from the machine code: the longest chain of calls, each
    function counted with all its pushes. Refuses recursion, calls through pointers and frames of variable size; a jump
    through a table is taken for that of a switch.
    """
    functions, start = _functions(elf), cycles.symbols(elf)[entry]
    bounds: dict[int, int] = {}

    def bound(at: int, chain: tuple[int, ...]) -> int:
        if at in chain:
            raise ValueError(f"{elf}: recursion at {at:#x}")
        if at not in bounds:
            bytes_taken, calls = _frame(at, functions)
            bounds[at] = bytes_taken + max((bound(call, (*chain, at)) for call in calls), default=0)
        return bounds[at]

    return bound(start, ())


def own_frame(elf: Path, function: str) -> int:
    """Bytes of stack that a function takes without what it calls."""
    return _frame(cycles.symbols(elf)[function], _functions(elf))[0]


def instructions_of(elf: Path, function: str) -> list[cortex_m4.Instruction]:
    """The machine code of a function."""
    return _functions(elf)[cycles.symbols(elf)[function]]


def _functions(elf: Path) -> dict[int, list[cortex_m4.Instruction]]:
    """The machine code of each function by address; functions that jump into each other's middle (libgcc) are one."""
    return _functions_of(elf, elf.stat().st_mtime_ns)


@lru_cache(2)
def _functions_of(elf: Path, _made: int) -> dict[int, list[cortex_m4.Instruction]]:
    rows = (line.split() for line in _run(["arm-none-eabi-readelf", "-sW", elf]).splitlines())
    starts = {int(row[1], 16) & ~1 for row in rows if len(row) == 8 and row[3] == "FUNC"}
    found: dict[int, list[cortex_m4.Instruction]] = {}
    body: list[cortex_m4.Instruction] = []
    owner: dict[int, list[cortex_m4.Instruction]] = {}
    for at in cortex_m4.disassemble(elf):
        if at.address in starts:
            body = found[at.address] = []
        body.append(at)
        owner[at.address] = body
    for at in [at for body in found.values() for at in body]:
        target = _target(at)
        if at.name == "b" and target in owner and target not in starts and owner[target] is not owner[at.address]:
            both = owner[target] + owner[at.address]
            owner |= {part.address: both for part in both}
    return {start: owner[start] for start in found}


def _target(at: cortex_m4.Instruction) -> int | None:
    """Where a branch goes."""
    match = re.match(r"\S+ ([0-9a-f]+) <", at.text)
    return int(match[1], 16) if match and at.name in ("b", "bl") else None


def _frame(start: int, functions: dict[int, list[cortex_m4.Instruction]]) -> tuple[int, set[int]]:
    """Bytes that a function takes itself, and the functions that it calls or ends in."""
    taken, calls = 0, set()
    body = functions[start]
    inside = {at.address for at in body}
    for at in body:
        where = f"{at.address:#x}: {at.text}"
        if at.name in ("push", "vpush") or (at.name.startswith(("stm", "vstm")) and " sp!" in at.text):
            taken += 4 * at.count
        elif (m := re.search(r"\[sp, #-(\d+)\]!", at.text)) or (m := re.match(r"subw?(?:\.\w)? sp, (?:sp, )?#(\d+)$", at.text)):
            taken += int(m[1])
        elif re.match(r"(sub|mov)\S* sp,|add\S* sp, (?!sp, #|#)", at.text):
            raise ValueError(f"{where}: a frame of variable size")
        elif re.match(r"blx|bx\S* (?!lr)|(ldr|mov|add)\S* pc, (?!\[sp\], #|\[r\d+, r\d+, lsl #2\]$)", at.text):
            raise ValueError(f"{where}: a call through a pointer")
        target = _target(at)
        if target is not None and (target not in inside or (at.name == "bl" and target in functions)):
            if target not in functions:
                raise ValueError(f"{where}: a call into the middle of a function")
            calls.add(target)
    return taken, calls
