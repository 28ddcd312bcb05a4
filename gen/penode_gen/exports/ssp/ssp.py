# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""SSP: the FMU in a system, a file of values for each parameter set, and beside them a schedule of sets (gen/SCHEDULE.md)."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from ...model import Model
from ...networks import Affine
from ...sets import layout, packing
from ...version import VERSION
from ..archive import zipped
from ..fmi import files as fmu_files, fmu2, fmu3, variables as fv
from ..interface import Exporter, ExportError, Option, Options
from ..templating import render

VERSIONS = ("2.0", "1.0")
_EXCHANGE = re.compile(r"\s*(\d+(?:\.\d*)?(?:[eE][-+]?\d+)?)\s*(?:s\s*)?:\s*(\w+)\s*")


def schedule(model: Model, text: str) -> list[dict[str, Any]]:
    """Exchanges of `2:altered_friction, 7:default`, times in seconds, ascending. Raises ExportError."""
    found: list[dict[str, Any]] = []
    for part in text.split(",") if text.strip() else []:
        match = _EXCHANGE.fullmatch(part)
        if not match:
            raise ExportError(
                f"--schedule: '{part.strip()}' is no exchange; write a time in seconds, a colon and a set, "
                f"such as 2.5:{next(iter(model.sets), 'default')}"
            )
        time, name = float(match[1]), match[2]
        if name not in model.sets:
            raise ExportError(f"--schedule: the model file has no set '{name}'; use one of: {', '.join(model.sets)}")
        if abs(time / model.sample_time - round(time / model.sample_time)) > 1e-6:
            raise ExportError(
                f"--schedule: {time:g} s is no multiple of the sample time, {model.sample_time:g} s; "
                "a set comes into force between two samples"
            )
        if found and time <= found[-1]["time"]:
            raise ExportError(f"--schedule: {time:g} s does not come after {found[-1]['time']:g} s; give the times in order")
        found.append({"time": time, "set": name})
    return found


def values(model: Model, name: str, dtype: packing.RealType, scalar: bool) -> list[dict[str, Any]]:
    """The parameters of a set: name, shape and text of the values; `scalar`: a parameter for each element."""
    numbers = packing.set_values(model, name, dtype)
    found: list[dict[str, Any]] = []
    for array in layout.arrays(model):
        elements = layout.gather(array, numbers)
        if scalar:
            for index in np.ndindex(array.shape):
                suffix = f"[{','.join(str(k + 1) for k in index)}]" if array.shape else ""
                found.append({"name": array.name + suffix, "shape": (), "text": fv.number(float(elements[index]))})
        else:
            found.append({"name": array.name, "shape": array.shape, "text": " ".join(fv.number(v) for v in np.ravel(elements))})
    return found


def record_names(model: Model) -> list[tuple[str, str]]:
    """Names of the Modelica records (--format modelica --form library) and those of the FMU, for a mapping."""
    pairs = []
    for owner, network in (model.sets["default"].networks if model.sets else {}).items():
        dense = affine = 0
        pairs += [(f"{owner}.{edge}", f"{owner}.{edge}") for edge in ("input_min", "input_max")]
        for layer in network.layers:
            if isinstance(layer, Affine):
                affine += 1
                pairs += [(f"{owner}.scale_{affine}_{part}", f"{owner}.{part}_{affine}") for part in ("shift", "factor")]
            else:
                dense += 1
                pairs += [(f"{owner}.layer_{dense}_{part}", f"{owner}.{part}_{dense}") for part in ("weights", "bias")]
    return pairs


def build(model: Model, options: Options) -> bytes:
    """The SSP. Raises ExportError."""
    version = options["ssp_version"]
    exchanges = schedule(model, options["schedule"])
    if options["set"] not in (*model.sets, ""):
        raise ExportError(f"--set: the model file has no set '{options['set']}'; use one of: {', '.join(model.sets)}")
    old = version == "1.0"
    fmu = (fmu2 if old else fmu3).build(model, {option.name: options[option.name] for option in fmu_files.OPTIONS})
    dtype = fmu_files.dtype(options)
    context = {
        "model": model,
        "name": fv.identifier(model),
        "generator": f"penode {VERSION}",
        "version": version,
        "old": old,
        "exchanges": exchanges,
        "chosen": options["set"],
        "stop": (exchanges[-1]["time"] if exchanges else 0.0) + 10000 * model.sample_time,
        "units": fv.unit_definitions(v.unit for v in fv.variables(model, dtype)),
        "signals": [v for v in fv.variables(model, dtype) if v.key in ("input", "output", "sensor")],
        "pairs": record_names(model),
    }
    files: dict[str, bytes | str] = {
        f"resources/{model.name}.fmu": fmu,
        "SystemStructure.ssd": render("ssp/system.xml.j2", **context),
        "resources/modelica_names.ssm": render("ssp/mapping.xml.j2", **context),
        "extra/penode/schedule.xml": render("ssp/schedule.xml.j2", **context),
        "extra/penode/parameter-schedule.xsd": render("ssp/schedule.xsd"),
    }
    for name in model.sets:
        files[f"resources/{name}.ssv"] = render("ssp/values.xml.j2", **context, set=name, parameters=values(model, name, dtype, old))
    return zipped(files)


EXPORTER = Exporter(
    "SSP with the FMU, a file of values for each parameter set, and a schedule of sets",
    (".ssp",),
    build,
    options=(
        *fmu_files.OPTIONS,
        Option("ssp_version", "2.0 with FMI 3 (default), or 1.0 with FMI 2", choices=VERSIONS, default="2.0"),
        Option("schedule", 'exchanges of sets in time, "2:altered_friction, 7:default" in seconds', default=""),
        Option("set", "parameter set (default: default)", default="default"),
    ),
    notes=fmu_files.notes,
)
