# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""eFMU, the container of eFMI 1.0.0 Beta 1: Algorithm Code in GALEC that keeps the tensor flow, Production Code in C, Behavioral Model."""

from __future__ import annotations

from ...model import Model
from ..archive import zipped
from ..interface import Exporter, Option, Options
from ..templating import render
from . import code, manifest as manifests, schemas, variables as ev
from .behaviour import behaviour
from .manifest import Representation
from .production import production_code

ALGORITHM, CODE = "AlgorithmCode", "block.alg"


def algorithm_code(model: Model, dialect: str) -> tuple[code.Block, Representation]:
    """The block and its folder. Raises ExportError."""
    block = code.block(model)
    files, id = {CODE: block.text}, manifests.identifier(model, ALGORITHM, dialect)
    manifest = render(
        "efmu/algorithm.xml.j2",
        **manifests.shared(model, dialect),
        id=id,
        code=CODE,
        files=manifests.listed(files, {"alg": "Code"}),
        clock=next(v for v in block.variables if v.label == ev.STEP_SIZE),
        signals=block.signals,
        units=ev.unit_list(block.variables),
        variables=block.variables,
    )
    return block, Representation(ALGORITHM, "AlgorithmCode", id, manifest, files)


def build(model: Model, options: Options) -> bytes:
    """The container, in the folder eFMU/ of a zip. Raises ExportError."""
    dialect = options["dialect"]
    block, algorithm = algorithm_code(model, dialect)
    found = schemas.schemas(dialect, options["schemas"])
    parts = [
        algorithm,
        *production_code(model, block, algorithm, dialect),
        behaviour(model, block, algorithm, dialect, options["recalibration"]),
    ]
    files: dict[str, bytes | str] = {f"eFMU/schemas/{path}": data for path, data in found.items()}
    for part in parts:
        files |= {f"eFMU/{part.folder}/{name}": text for name, text in part.files.items()}
        files[f"eFMU/{part.folder}/{manifests.MANIFEST}"] = part.manifest
    files["eFMU/__content.xml"] = manifests.content(model, dialect, parts)
    return zipped(files)


EXPORTER = Exporter(
    "eFMU: the container of eFMI, with Algorithm Code, Production Code and Behavioral Model",
    (".fmu", ".efmu"),
    build,
    options=(
        Option(
            "dialect",
            "beta1: manifests of eFMI 1.0.0 Beta 1 (default); dymola: those of Dymola 2026x",
            choices=tuple(schemas.DIALECTS),
            default="beta1",
        ),
        Option(
            "recalibration",
            'exchange of sets in a scenario of the Behavioral Model, such as "2:altered_friction", or none '
            "(default: at 2 s to the second set)",
        ),
        Option("schemas", "folder with the schemas of the dialect (default for beta1: those in the package rumoca)"),
    ),
)
