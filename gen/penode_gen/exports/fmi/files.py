# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The files that FMUs of both versions share: C sources, binaries, documentation, licence."""

from __future__ import annotations

import hashlib
import platform
import re
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from ...emission.model_c import render
from ...model import Model
from ...resources import native, resource
from ...sets import layout
from ...sets.packing import RealType
from ...tools import not_installed
from ...version import VERSION
from ..interface import ExportError, Option, Options
from ..templating import render as template
from . import filtered, variables as fv
from .functions import functions

OPTIONS = (
    Option("real", "number type inside, float (default) or double", choices=("float", "double"), default="float"),
    Option("source_only", "leave the binaries out", "flag", default=False),
    Option("xcp", "an A2L inside, for XCP through the importer (FMI-LS-XCP); one instance in a process", "flag", default=False),
)
# Parts of the runtime that no FMU needs.
_LEFT_OUT = ("pen_xcp", "pen_selftest")
_FLAGS = (
    "-std=c99",
    "-O2",
    "-ffp-contract=off",
    "-fno-math-errno",
    "-fvisibility=hidden",
    "-ffunction-sections",
    "-fdata-sections",
    "-shared",
    "-Wl,--gc-sections",
)
# What a compiler is called, the suffix of a shared library and more options, by platform of FMI 3.
_COMPILERS: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "x86_64-windows": ("x86_64-w64-mingw32-gcc", ".dll", ("-s", "-static-libgcc", "-Wl,--no-insert-timestamp"))
}
if platform.system() == "Linux" and platform.machine() in ("x86_64", "aarch64"):
    _COMPILERS[f"{platform.machine()}-linux"] = ("gcc", ".so", ("-fPIC", "-Wl,--build-id=none"))


def dtype(options: Options) -> RealType:
    """float32 or float64 inside."""
    return np.float64 if options["real"] == "double" else np.float32


def token(model: Model, options: Options) -> str:
    """Names this export: the same for the same model, options and generator."""
    digest = hashlib.sha256(repr((VERSION, model.name, model.digest, options["real"])).encode()).hexdigest()
    return f"{{{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}}}"


def context(model: Model, options: Options, fmi: int) -> dict[str, Any]:
    """The context of the templates."""
    found = fv.variables(model, dtype(options))
    groups = fv.groups(found)
    arrays, block = [], 0
    for array in layout.arrays(model):
        shape = (*array.shape, 1, 1)
        arrays.append({"name": array.name, "rows": shape[0], "columns": shape[1], "blocks": array.blocks, "block": block})
        block += len(array.blocks)
    return {
        "model": model,
        "name": fv.identifier(model),
        "prefix": model.name.upper(),
        "version": VERSION,
        "fmi": fmi,
        "token": token(model, options),
        "variables": found,
        "groups": groups,
        "tunables": arrays,
        "end": found[-1].first + found[-1].count,
        "tunable_end": next(g["first"] for g in groups if g["key"] == "tunable") + sum(v.count for v in found if v.key == "tunable"),
        "n_u": len(model.inputs),
        "n_y": len(model.outputs),
        "n_z": len(model.sensors),
        "n_x": len(model.states),
        "inputs": model.inputs,
        "outputs": model.outputs,
        "sensors": model.sensors,
        "states": model.states,
        "start": model.start,
        "constants": [v.start[0] for v in found if v.key == "constant" and v.start],
        "sets": list(model.sets),
        "sampled": bool(model.sampled),
        "sample_time": repr(model.sample_time),
        "units": fv.unit_definitions(v.unit for v in found),
        "functions": functions(fmi),
        "real": options["real"],
        "provided": _provided(fmi),
        "xcp": options["xcp"],
    } | filtered.context(model)


def _provided(fmi: int) -> set[str]:
    """The functions that the template of the interface writes out; it makes stubs of the others."""
    text = resource("penode_gen.exports.fmi", "templates", f"fmi{fmi}.c.j2").read_text(encoding="utf-8")
    return set(re.findall(rf"^(?:[\w ]+[ *])(fmi{fmi}\w+)\(", text, re.M))


def runtime(model: Model) -> dict[str, str]:
    """Name -> text of the model's C and of the runtime that it needs, as they stand in the repository."""
    texts = {name: text for name, text in render(model, self_test=False).items() if name.endswith((".c", ".h"))}
    for folder, pattern in (("src", "*.c"), ("src", "*.h"), ("inc/penode", "*.h"), ("port/gnu", "*.h")):
        for path in sorted(native(folder).glob(pattern)):
            if not path.name.startswith(_LEFT_OUT):
                texts[path.name] = path.read_text(encoding="utf-8")
    for kept in ("pen_selftest.h", "pen_xcp.h", "pen_xcp_daq.h", "pen_xcp_parts.h"):
        if any(f"penode/{kept}" in text for text in texts.values()):
            texts[kept] = native("inc", "penode", kept).read_text(encoding="utf-8")
    return texts


def sources(model: Model, context: dict[str, Any], interface: tuple[str, ...]) -> dict[str, str]:
    """Name -> text of all C, in one folder; `interface`: templates of this version of FMI."""
    texts = runtime(model)
    header = texts[f"{model.name}.h"]
    derived = {"uses_input_rate": "y_u_before[" in header, "stepped": _stepped(header, model.name)}
    own = ("fmu_core.h", "fmu_core.c", "fmu_samples.c", "fmu_sets.h", "fmu_sets.c", "fmu_model.c")
    for name in (*own, *(("fmu_filter.c",) if model.filter else ()), *interface):
        texts[name] = template(f"fmi/{name}.j2", **context, **derived)
    return {name: flat(text, context["real"]) for name, text in texts.items()}


def _stepped(header: str, name: str) -> list[str]:
    """
    Members of the instance that a step changes and reads again. Folded pieces come with a set; samples kept for a trial are written
    alone, the same when a step is done again.
    """
    instance = header[: header.index(f"}} {name}_t;")].rpartition("typedef struct {")[2]
    members: list[str] = re.findall(r"^ +\w+ +(\w+)[\[;]", instance, re.M)
    return [member for member in members if member not in ("piece", "sample")]


def flat(text: str, real: str) -> str:
    """All in one folder; the number type is fixed in the sources, since importers compile them with options of their own."""
    text = re.sub(r'#include "penode/', '#include "', text)
    if real == "double":
        text = text.replace(
            "#ifdef PEN_REAL_DOUBLE\ntypedef double pen_real_t;",
            "#define PEN_REAL_DOUBLE /* as exported */\n#ifdef PEN_REAL_DOUBLE\ntypedef double pen_real_t;",
        )
    return text


def binaries(texts: dict[str, str], name: str, fmi: int, debug: bool = False) -> dict[str, bytes]:
    """
    Platform of FMI 3 -> shared library, for each compiler that is installed here; `debug`: ELF files with DWARF.

    Raises ExportError where one refuses.
    """
    made: dict[str, bytes] = {}
    with tempfile.TemporaryDirectory() as folder:
        for file, text in texts.items():
            Path(folder, file).write_text(text, encoding="utf-8", newline="\n")
        for target, (compiler, suffix, more) in _COMPILERS.items():
            if shutil.which(compiler) is None:
                continue
            output = f"{name}{suffix}"
            files = sorted(file for file in texts if file.endswith(".c"))
            command = [
                compiler,
                *_FLAGS,
                *more,
                *(["-g"] if debug and suffix == ".so" else []),
                f"-DFMI{fmi}_OVERRIDE_FUNCTION_PREFIX",
                *files,
                "-o",
                output,
            ]
            done = subprocess.run(command, cwd=folder, capture_output=True, text=True, stdin=subprocess.DEVNULL)
            if done.returncode:
                lines = [line for line in done.stderr.splitlines() if "error" in line] or done.stderr.splitlines() or ["?"]
                raise ExportError(f"{compiler} refused the C of the FMU: {lines[0]}; report this with the model file")
            made[target] = Path(folder, output).read_bytes()
    return made


def notes(options: Options) -> list[str]:
    """A line for each binary that is missing because there is no compiler; none if binaries were not requested."""
    if options.get("source_only"):
        return []
    return [
        f"no binary for {target} inside: {not_installed(compiler)}"
        for target, (compiler, _, _) in _COMPILERS.items()
        if shutil.which(compiler) is None
    ]


def documentation(context: dict[str, Any], platforms: list[str]) -> dict[str, str]:
    """Page and licence, by path in the FMU."""
    return {
        "documentation/index.html": template("fmi/fmu_page.html.j2", **context, platforms=platforms),
        "documentation/licenses/license.txt": "The C runtime in this FMU, and the code that penode generates:\n\n"
        + native("LICENSE").read_text(encoding="utf-8"),
    }


def suffix(target: str) -> str:
    """Suffix of a shared library on a platform."""
    return _COMPILERS[target][1]
