# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Modelica: the whole model, or its networks for the NeuralNetwork library, or as external C."""

from __future__ import annotations

from ...model import Model
from ..archive import zipped
from ..interface import Exporter, ExportError, Option, Options
from .library import external, library
from .model import text as whole_model

FORMS = ("model", "library", "external")


def build(model: Model, options: Options) -> bytes:
    """The .mo file, or for external C a zip of the package. Raises ExportError."""
    form, chosen = options["form"], options["set"]
    if model.sets and chosen not in model.sets:
        raise ExportError(f"--set: the model file has no set '{chosen}'; use one of: {', '.join(model.sets)}")
    if form == "external":
        return zipped(dict(external(model, chosen)))
    text = whole_model(model, chosen) if form == "model" else library(model, chosen)
    return text.encode()


EXPORTER = Exporter(
    "Modelica: the whole model, or its networks as blocks",
    (".mo", ".zip"),
    build,
    options=(
        Option(
            "form",
            "model: all of it, self-contained (default); library: record and block for NeuralNetwork 2.1; "
            "external: C with its block, a .zip",
            choices=FORMS,
            default="model",
        ),
        Option("set", "parameter set (default: default)", default="default"),
    ),
)
