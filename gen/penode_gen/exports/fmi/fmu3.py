# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""FMI 3.0 Co-Simulation: sources and binaries, tunable arrays that come into force together, state, derivatives."""

from __future__ import annotations

from ...model import Model
from ..archive import zipped
from ..interface import Exporter, Options
from ..templating import render
from . import files as fmu_files, xcp as fmu_xcp


def build(model: Model, options: Options) -> bytes:
    """The FMU. Raises ExportError."""
    context = fmu_files.context(model, options, 3)
    texts = fmu_files.sources(model, context, ("fmi3_api.h", "fmi3.c"))
    made = {} if options["source_only"] else fmu_files.binaries(texts, model.name, 3, options["xcp"])
    if options["xcp"]:
        made, described = fmu_xcp.described(model, texts, made, 3, {target: target for target in made})
    else:
        described = {}
    files: dict[str, bytes | str] = {f"sources/{name}": text for name, text in texts.items()}
    files |= {f"binaries/{target}/{model.name}{fmu_files.suffix(target)}": data for target, data in made.items()}
    files |= described
    files |= fmu_files.documentation(context, sorted(made))
    files["sources/buildDescription.xml"] = render(
        "fmi/fmi3_build.xml.j2", **context, compiled=sorted(name for name in texts if name.endswith(".c"))
    )
    files["modelDescription.xml"] = render("fmi/fmi3.xml.j2", **context)
    files["terminalsAndIcons/terminalsAndIcons.xml"] = render("fmi/fmi3_terminals.xml.j2", **context)
    return zipped(files)


EXPORTER = Exporter("FMI 3.0 Co-Simulation FMU, with sources", (".fmu",), build, options=fmu_files.OPTIONS, notes=fmu_files.notes)
