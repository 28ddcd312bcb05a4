# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Production Code: the model's own C for 32 and 64 bit, a structure with every variable of the block, and the mapping between them."""

from __future__ import annotations

import re
from typing import Any

from ...model import Model
from ...version import VERSION
from ..fmi.files import flat, runtime
from ..templating import render
from . import manifest as manifests
from .code import Block
from .manifest import Representation

PRECISIONS = {"32-bit": "float", "64-bit": "double"}
_METHODS = {"Startup": "startup", "Recalibrate": "recalibrate", "DoStep": "dostep"}


def production_code(model: Model, block: Block, algorithm: Representation, dialect: str) -> list[Representation]:
    """A folder for each precision. Raises ExportError."""
    texts = runtime(model)
    return [_of_precision(model, block, algorithm, dialect, texts, precision) for precision in PRECISIONS]


def _of_precision(
    model: Model, block: Block, algorithm: Representation, dialect: str, texts: dict[str, str], precision: str
) -> Representation:
    real = PRECISIONS[precision]
    wrapper = _wrapper(model, block)
    files = {name: flat(text, real) for name, text in (texts | wrapper).items()}
    folder = f"ProductionCode_{precision.replace('-', '')}"
    id = manifests.identifier(model, folder, dialect)
    entries = manifests.listed(files, {"c": "Code", "h": "Code"})
    manifest = render(
        "efmu/production.xml.j2",
        **manifests.shared(model, dialect),
        id=id,
        algorithm=algorithm,
        files=entries,
        precision=precision,
        real=real,
        name=f"{model.name}_efmu",
        variables=block.variables,
        signals=block.signals,
        methods=_METHODS,
        includes=_includes(files),
        lengths=model.owner,
    )
    return Representation(folder, "ProductionCode", id, manifest, files)


def _wrapper(model: Model, block: Block) -> dict[str, str]:
    """The C that has the block's methods as functions."""
    context: dict[str, Any] = {
        "model": model,
        "version": VERSION,
        "name": model.name,
        "block": f"{model.name}_efmu",
        "prefix": model.name.upper(),
        "owner": model.owner,
        "variables": block.variables,
        "tunables": [v for v in block.variables if v.element],
        "inputs": model.inputs,
        "outputs": model.outputs,
        "states": model.states,
        "constants": [v for v in block.variables if v.causality == "constant"],
        "member": {v.label: v.member for v in block.variables},
        "starts": {v.label: float(v.start) for v in block.variables if v.causality in ("input", "constant")},
    }
    return {f"{model.name}_efmu.{suffix}": render(f"efmu/block.{suffix}.j2", **context) for suffix in ("h", "c")}


def _includes(files: dict[str, str]) -> dict[str, list[str]]:
    """File -> the other files of the folder that it includes."""
    return {name: [f for f in re.findall(r'^#include "([^"]+)"', text, re.M) if f in files] for name, text in files.items()}
