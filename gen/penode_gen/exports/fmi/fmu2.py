# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""FMI 2.0 Co-Simulation: as FMI 3.0, with a scalar for each element, W[1,2], and derivatives of inputs."""

from __future__ import annotations

from ...model import Model
from ..archive import zipped
from ..interface import Exporter, Options
from ..templating import render
from . import files as fmu_files, xcp as fmu_xcp

_FOLDERS = {"x86_64-linux": "linux64", "x86_64-windows": "win64"}  # FMI 2 has no name for other platforms


def build(model: Model, options: Options) -> bytes:
    """The FMU. Raises ExportError."""
    context = fmu_files.context(model, options, 2)
    texts = fmu_files.sources(model, context, ("fmi2_api.h", "fmi2.c"))
    made = {} if options["source_only"] else fmu_files.binaries(texts, model.name, 2, options["xcp"])
    made = {target: data for target, data in made.items() if target in _FOLDERS}
    if options["xcp"]:
        made, described = fmu_xcp.described(model, texts, made, 2, _FOLDERS)
    else:
        described = {}
    files: dict[str, bytes | str] = {f"sources/{name}": text for name, text in texts.items()}
    files |= {f"binaries/{_FOLDERS[target]}/{model.name}{fmu_files.suffix(target)}": data for target, data in made.items()}
    files |= described
    files |= fmu_files.documentation(context, sorted(made))
    files["modelDescription.xml"] = render("fmi/fmi2.xml.j2", **context, compiled=sorted(name for name in texts if name.endswith(".c")))
    return zipped(files)


EXPORTER = Exporter("FMI 2.0 Co-Simulation FMU, with sources", (".fmu",), build, options=fmu_files.OPTIONS, notes=fmu_files.notes)
