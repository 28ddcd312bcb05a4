# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What is compiled for the host and for emulated cores, made once and kept: keyed by sources, compiler and options."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path

import numpy as np

import penode_gen
from penode_gen.model import Model
from penode_gen.resources import native, resource
from penode_gen.tools import not_installed

from .errors import TargetError, ToolMissing

Part = str | bytes | Path  # of the input of a compilation: a text, or a file by its contents
FLAGS = ("-std=c99", "-ffp-contract=off", "-fno-math-errno")


def build_directory() -> Path:
    """Where compiled things are kept: PENODE_BUILD, else penode/ in the user's cache."""
    if os.environ.get("PENODE_BUILD"):
        return Path(os.environ["PENODE_BUILD"]).absolute()
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache").absolute() / "penode"


def digest_of(parts: Iterable[Part]) -> str:
    """A short name for texts, bytes and the contents of files."""
    sha = hashlib.sha256()
    for part in parts:
        data = part.read_bytes() if isinstance(part, Path) else part.encode() if isinstance(part, str) else part
        sha.update(len(data).to_bytes(8, "little") + data)
    return sha.hexdigest()[:16]


def sources_in(*places: tuple[str, str]) -> list[Path]:
    """Files of native/ by folder and pattern, sorted."""
    return sorted(path for folder, pattern in places for path in native(folder).rglob(pattern))


def include(*folders: str) -> list[str]:
    """Options of compilers: folders of native/ to look for headers in."""
    return [f"-I{native(folder)}" for folder in folders]


def generated(model: Model) -> Path:
    """The folder with the model's C, generated unless an earlier call did; keyed by model and generator."""
    sources = sorted(path for pattern in ("*.py", "*.j2") for path in resource("penode_gen").rglob(pattern))
    folder = build_directory() / f"{model.name}-{digest_of([model.digest, *sources])}"
    if not (folder / f"{model.name}.c").exists():
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent) as scratch:
            penode_gen.generate(model, Path(scratch) / "c", self_test=False)
            _move(Path(scratch) / "c", folder)
    return folder


def _move(source: Path, target: Path) -> None:
    """Rename, unless another process was faster."""
    try:
        os.replace(source, target)
    except OSError:
        if not target.exists():
            raise


def model_options(model: Model) -> list[str]:
    """Compiler options that tell sil/firmware/sample.h which model it is about."""
    return [
        f'-DMODEL_HEADER="{model.name}.h"',
        f"-DMODEL(name)={model.name}_##name",
        f"-DMODEL_SIZE(name)={model.name.upper()}_##name",
        *(["-DMODEL_STATES"] if model.states else []),
        *(["-DMODEL_SENSORS"] if model.sensors else []),
    ]


def filter_options(model: Model) -> list[str]:
    """Compiler options that tell the programs of sil/firmware of the filter and the monitor of a model; none without them."""
    if model.filter is None:
        return []
    names = [sensor.name for sensor in model.sensors]
    measured = ",".join(f"{names.index(sensor.name)}U" for sensor in model.filter.sensors)
    monitor = [f'-DMONITOR_HEADER="{model.name}_monitor.h"'] if model.monitor else []
    return [f'-DEKF_HEADER="{model.name}_ekf.h"', f"-DCORE(name)={model.stepped}_##name", f"-DMODEL_MEASURED={measured}", *monitor]


def code_of(model: Model, source: Path) -> list[Path]:
    """The C of a model in a folder: step, sets, filter with the model that it steps, monitor."""
    names = [model.name, f"{model.owner}_params", *([f"{model.name}_ekf", model.stepped] if model.filter else [])]
    names += [f"{model.name}_monitor"] if model.monitor else []
    return [source / f"{name}.c" for name in dict.fromkeys(names)]


def missing_tool(name: str) -> ToolMissing:
    """What to raise where a compiler or an emulator is not installed."""
    return ToolMissing(not_installed(name))


def compile_program(command: Sequence[str], output: Path) -> None:
    """Run a compiler that writes `output`, all or nothing. UserError if it is missing or refuses."""
    with tempfile.TemporaryDirectory(dir=output.parent) as scratch:
        part = Path(scratch) / output.name
        try:
            result = subprocess.run([*command, "-o", str(part)], capture_output=True, text=True, stdin=subprocess.DEVNULL)
        except FileNotFoundError as exc:
            raise missing_tool(command[0]) from exc
        if result.returncode != 0:
            lines = [line for line in result.stderr.splitlines() if "error" in line] or result.stderr.splitlines() or ["?"]
            raise TargetError(f"{output.name}: the compiler refused it: {lines[0]}; report this with the model file")
        _move(part, output)


def build_once(name: str, suffix: str, command: Sequence[str], read: Iterable[Part]) -> Path:
    """What a compiler makes, in the build directory; made once for a command and the contents of all that it reads."""
    output = build_directory() / f"{name}-{digest_of([*command, *read])}{suffix}"
    if not output.exists():
        output.parent.mkdir(parents=True, exist_ok=True)
        compile_program(command, output)
    return output


@cache
def compiler_version(compiler: str) -> bytes:
    """What a compiler says of itself, nothing if it is not installed."""
    return subprocess.run([compiler, "--version"], capture_output=True).stdout if shutil.which(compiler) else b""


def build_library(model: Model, dtype: type = np.float32, compiler: Sequence[str] = ("gcc", "-O2"), source: Path | None = None) -> Path:
    """The shared library of a model; `source` is a folder with its C if it is not to be generated."""
    source = source or generated(model)
    code, runtime = code_of(model, source), sources_in(("src", "*.c"))
    shim = native("sil", "firmware", "sil.c")
    options = [*compiler, *FLAGS, "-fPIC", *(["-DPEN_REAL_DOUBLE"] if dtype == np.float64 else []), *include("inc", "port/gnu")]
    read: list[Part] = [compiler_version(compiler[0]), *sources_in(("inc", "*.h"), ("port/gnu", "*.h"), ("sil/firmware", "*.h"))]
    same = build_once("runtime", ".o", [*options, "-r", "-nostdlib", *map(str, runtime)], [*read, *runtime])  # for every model
    own = ["-shared", *model_options(model), *filter_options(model), f"-I{source}", *map(str, [shim, *code, same])]
    return build_once(model.name, ".so", [*options, *own], [*read, shim, *code, *sorted(source.glob(f"{model.name}*.h")), same])
