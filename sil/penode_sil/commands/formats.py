# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What `penode export --help` shows of the formats, without importing their exporters (penode_gen.exports); a test compares the two."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Shown:
    """An option as the command takes it: that of one or more formats, which its help names."""

    name: str
    help: str
    kind: str = "text"
    choices: tuple[str, ...] = ()


SUMMARIES = {
    "fmu3": "FMI 3.0 Co-Simulation FMU, with sources",
    "fmu2": "FMI 2.0 Co-Simulation FMU, with sources",
    "modelica": "Modelica: the whole model, or its networks as blocks",
    "ssp": "SSP with the FMU, a file of values for each parameter set, and a schedule of sets",
    "a2l": "A2L of a linked program, for calibration over XCP",
    "efmu": "eFMU: the container of eFMI, with Algorithm Code, Production Code and Behavioral Model",
}
OPTIONS = (
    Shown("real", "fmu3, fmu2, ssp: number type inside, float (default) or double", choices=("float", "double")),
    Shown("source_only", "fmu3, fmu2, ssp: leave the binaries out", kind="flag"),
    Shown("xcp", "fmu3, fmu2, ssp: an A2L inside, for XCP through the importer (FMI-LS-XCP); one instance in a process", kind="flag"),
    Shown(
        "form",
        "modelica: model: all of it, self-contained (default); library: record and block for NeuralNetwork 2.1; "
        "external: C with its block, a .zip",
        choices=("model", "library", "external"),
    ),
    Shown("set", "modelica, ssp: parameter set (default: default)"),
    Shown("ssp_version", "ssp: 2.0 with FMI 3 (default), or 1.0 with FMI 2", choices=("2.0", "1.0")),
    Shown("schedule", 'ssp: exchanges of sets in time, "2:altered_friction, 7:default" in seconds'),
    Shown("elf", "a2l: Linked program, compiled with -g; it has the addresses.", kind="file"),
    Shown("instance", "a2l: Variable that is the model's instance (default: the only one of its type)."),
    Shown("measure", "a2l: More variables to measure, separated by commas (default: those of the sensors and of the filter's estimates)."),
    Shown("transport", "a2l: XCP transport: tcp:HOST:PORT, udp:HOST:PORT, serial:BAUD, can:ID:ID or canfd:ID:ID."),
    Shown("max_cto", "a2l: Bytes of the longest XCP packet (default: 8 on CAN, 64 on CAN FD, else 252).", kind="number"),
    Shown("epk", "a2l: Variable with the text that identifies the program (default: penode_epk, if the program has it)."),
    Shown("dialect", "efmu: beta1: manifests of eFMI 1.0.0 Beta 1 (default); dymola: those of Dymola 2026x", choices=("beta1", "dymola")),
    Shown(
        "recalibration",
        'efmu: exchange of sets in a scenario of the Behavioral Model, such as "2:altered_friction", or none '
        "(default: at 2 s to the second set)",
    ),
    Shown("schemas", "efmu: folder with the schemas of the dialect (default for beta1: those in the package rumoca)"),
)
