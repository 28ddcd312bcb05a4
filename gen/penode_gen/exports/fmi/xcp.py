# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
FMI-LS-XCP 1.0: an A2L beside each binary of an FMU, and one for its sources.

The FMU has no XCP slave of its own: the importer's reads and writes its memory between two communication steps. So the FMU has one
instance, a static variable. Addresses count from where the binary is loaded; in the A2L of the sources they are 0, and SYMBOL_LINKs say
what to fill in once it is compiled.
"""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from ...model import Model
from ...tools import not_installed
from ..a2l.a2l import describe, epk, transport
from ..a2l.elf_types import Program, read_program
from ..a2l.entries import Measurements
from ..a2l.filtered import add_filter, add_monitor
from ..interface import ExportError
from ..templating import render
from .files import binaries

FOLDER = "extra/org.fmi-standard.fmi-ls-xcp"
_ONLY = "fmu_only.core"  # the instance, of the templates fmi2.c and fmi3.c
_WIRE = "tcp:127.0.0.1:5555"  # an example: the importer's slave has its own


def described(
    model: Model, texts: dict[str, str], made: dict[str, bytes], fmi: int, folders: dict[str, str]
) -> tuple[dict[str, bytes], dict[str, bytes | str]]:
    """
    The binaries without their debug information, and the files of the layered standard by path in the FMU. `made`: platform of FMI 3 ->
    binary, compiled with debug information where it is an ELF file; `folders`: its folder in binaries/. Raises ExportError.
    """
    if importlib.util.find_spec("elftools") is None:
        raise ExportError("--xcp: the A2L needs the Python package pyelftools, which is not installed; pip install penode[xcp]")
    for tool in ("gcc", "objcopy"):
        if shutil.which(tool) is None:
            raise ExportError(f"--xcp: the A2L needs a compiler, and {not_installed(tool)}")
    stripped = dict(made)
    files: dict[str, bytes | str] = {}
    name = f"{model.name}.a2l"
    with tempfile.TemporaryDirectory() as folder:
        for target, data in (made or _compiled(texts, model.name, fmi)).items():
            if data[:4] != b"\x7fELF":  # the debug information of others is not read
                continue
            path = Path(folder, f"{target}.so")
            path.write_bytes(data)
            program = read_program(path, shared=True)
            if target in made:
                files[f"{FOLDER}/{folders[target]}/{name}"] = _text(model, program, True)
                stripped[target] = _stripped(path)
            files[f"{FOLDER}/{name}"] = _text(model, program, False)
    context: dict[str, Any] = {"model": model, "definition": name, "platforms": sorted(files), "fmi": fmi}
    files[f"{FOLDER}/fmi-ls-manifest.xml"] = render("fmi/fmi_ls_xcp.xml.j2", **context)
    files["documentation/fmi-ls-xcp.txt"] = render("fmi/fmi_ls_xcp.txt.j2", **context)
    return stripped, files


def _compiled(texts: dict[str, str], name: str, fmi: int) -> dict[str, bytes]:
    """Binaries only for the types in them: of an FMU of sources."""
    return binaries(texts, name, fmi, debug=True)


def _stripped(path: Path) -> bytes:
    subprocess.run(["objcopy", "--strip-debug", str(path)], check=True, stdin=subprocess.DEVNULL)
    return path.read_bytes()


def _text(model: Model, program: Program, addresses: bool) -> str:
    measured = Measurements(program)
    measured.of_model(model, f"{_ONLY}.self")
    measured.add("set", "samples", f"{_ONLY}.data.samples", text="samples since the start time")
    if model.filter:
        add_filter(measured, model, f"{_ONLY}.filter")
    if model.monitor:
        add_monitor(measured, model, f"{_ONLY}.monitor")
    values = program.find(f"{_ONLY}.data.staged")
    return describe(model, program, values, measured, transport(_WIRE), epk(program, None), pages=False, addresses=addresses)
