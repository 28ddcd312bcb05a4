# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The Production Code of an eFMU as an instance, and the scenarios of its Behavioral Model: all read from the manifests."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

FOLDERS = {np.float32: "ProductionCode_32bit", np.float64: "ProductionCode_64bit"}
PRECISIONS = {np.float32: "32-bit", np.float64: "64-bit"}
FLAGS = "-std=c99 -O1 -ffp-contract=off -Wall -Wextra -Werror -Wconversion -Wshadow -pedantic -fPIC -shared".split()


class Production:
    """An instance of the Production Code: types, members, functions and names as its manifest has them."""

    def __init__(self, files: dict[str, bytes], real: type, folder: Path):
        prefix = f"{FOLDERS[real]}/"
        for name, data in files.items():
            if name.startswith(prefix):
                (folder / name.removeprefix(prefix)).write_bytes(data)
        root = ElementTree.fromstring(files[f"{prefix}manifest.xml"])
        self.library = folder / "block.so"
        if not self.library.exists():
            sources = sorted(f.get("name") for f in root.findall("Files/File") if f.get("name").endswith(".c"))
            subprocess.run(["gcc", *FLAGS, *sources, "-o", str(self.library)], cwd=folder, check=True)
        self.functions = {
            r.find("ForeignFunctionReference").get("foreignRefId"): r.find("GlobalFunction").get("functionRefId")
            for r in root.iter("FunctionReference")
        }
        names = {f.get("id"): f.get("name") for f in root.iter("Function")}
        self.functions = {method: names[i] for method, i in self.functions.items()}
        self.members = {
            r.find("ForeignVariableReference").get("foreignRefId"): r.find("FormalParameter").get("componentIdentifier")
            for r in root.iter("DataReference")
        }
        coded = {t.get("id"): t.get("codedType") for t in root.iter("TargetType")}
        types = {t.get("id"): coded[t.find("Alias").get("targetTypeRefId")] for t in root.iter("Typedef") if t.find("Alias") is not None}
        of = {"float": ctypes.c_float, "double": ctypes.c_double, "bool": ctypes.c_bool, "uint32_t": ctypes.c_uint32}
        fields = []
        for c in root.iter("Component"):
            kind = of[types[c.get("typeDefRefId")]]
            for d in sorted(c.findall("Dimensions/Dimension"), key=lambda d: -int(d.get("number"))):
                kind = kind * int(d.get("size"))
            fields.append((c.get("name"), kind))
        self.memory = (ctypes.c_uint64 * (1 << 16))()  # members that no manifest names follow the ones that it does
        self.data = type("Block", (ctypes.Structure,), {"_fields_": fields}).from_buffer(self.memory)
        self._loaded = ctypes.CDLL(str(self.library))

    def run(self, method: str) -> int:
        """Call a method; its error signals."""
        function = getattr(self._loaded, self.functions[f"{method}()"])
        function.restype = ctypes.c_bool
        failed = function(ctypes.byref(self.data))
        signals = int(self["block:ErrorSignalStatus"])
        assert failed == (signals != 0)
        return signals

    def __getitem__(self, name: str) -> np.ndarray:
        """A variable by its name in the Algorithm Code; arrays can be written."""
        value = getattr(self.data, self.members[name])
        return np.ctypeslib.as_array(value) if isinstance(value, ctypes.Array) else value

    def __setitem__(self, name: str, value: Any) -> None:
        setattr(self.data, self.members[name], value)


@dataclass
class Scenario:
    """A table with what its columns mean. `stimuli` and `tuned`: (variable, index or None, column); `outputs`: (variable, column,
    tolerance)."""

    name: str
    lines: list[str]
    stimuli: list[tuple[str, int]]
    outputs: list[tuple[str, int, float]]
    tuned: list[tuple[str, int | None, int]]

    def rows(self) -> Iterator[tuple[float, list[float], list[float] | None]]:
        """Time, the leading columns, and what is tuned where it differs from the row before."""
        first, before = 1 + len(self.stimuli) + len(self.outputs), None
        for line in self.lines:
            *numbers, tail = line.split(",", first) if self.tuned else [*line.split(","), ""]
            changed = tail != before
            before = tail
            yield float(numbers[0]), [float(x) for x in numbers], [float(x) for x in tail.split(",")] if changed and self.tuned else None


def scenarios(files: dict[str, bytes], precision: str) -> dict[str, Scenario]:
    """The scenarios of the Behavioral Model with the tolerances of a precision."""
    root = ElementTree.fromstring(files["BehavioralModel/manifest.xml"])
    block = {v.get("id"): v.get("blockCausality") for v in ElementTree.fromstring(files["AlgorithmCode/manifest.xml"]).find("Variables")}
    of = {v.get("id"): v.find("ForeignVariableReference").get("foreignRefId") for v in root.find("Variables")}
    by_id = {e.get("id"): e for e in root.iter() if e.get("id")}
    found = {}
    for s in root.find("Scenarios"):
        header, *lines = files[f"BehavioralModel/{by_id[s.get('fileRefId')].get('name')}"].decode().splitlines()
        place = {name: k for k, name in enumerate(header.split(","))}
        tolerances = next(t for t in by_id[s.get("tolerancesSetupRefId")] if t.get("floatingPointPrecision") == precision)
        allowed = {t.get("variableRefId"): float(t.get("absoluteTolerance")) for t in tolerances}
        scenario = Scenario(s.get("name"), lines, [], [], [])
        for data in by_id[s.get("csvMappingRefId")].findall("ReferenceData"):
            name, causality = of[data.get("variableRefId")], block[of[data.get("variableRefId")]]
            for column in data:
                at, index = place[column.get("columnName")], column.get("elementIndex")
                if causality == "input":
                    scenario.stimuli.append((name, at))
                elif causality == "output":
                    scenario.outputs.append((name, at, allowed[data.get("variableRefId")]))
                else:
                    scenario.tuned.append((name, int(index) - 1 if index else None, at))
        found[scenario.name] = scenario
    return found


def play(instance: Any, scenario: Scenario) -> np.ndarray:
    """How far each output is from its reference at most, as a share of its tolerance. Recalibrates where parameters of the table change."""
    assert instance.run("Startup") in (0, set())
    worst = np.zeros(len(scenario.outputs))
    first = 1 + len(scenario.stimuli) + len(scenario.outputs)
    for _, row, tuned in scenario.rows():
        for name, at in scenario.stimuli:
            instance[name] = row[at]
        if tuned is not None:
            for name, index, at in scenario.tuned:
                if index is None:
                    instance[name] = tuned[at - first]
                else:
                    instance[name].ravel()[index] = tuned[at - first]
            assert instance.run("Recalibrate") in (0, set())
        assert instance.run("DoStep") in (0, set())
        worst = np.maximum(worst, [abs(float(instance[name]) - row[at]) / allowed for name, at, allowed in scenario.outputs])
    return worst
