# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""FMPy as the master of an FMU of either version: variables by name, arrays as arrays, lines of the log with their status."""

from __future__ import annotations

import ctypes
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.fmi3 import FMU3Slave

from penode_gen import exports

WARNING, DISCARD, ERROR = 1, 2, 3


def export(model: Any, version: int, folder: Path, **options: Any) -> Path:
    """The FMU of a model, in a folder."""
    path = folder / f"{model.name}{version}.fmu"
    path.write_bytes(exports.export(model, f"fmu{version}", path, options))
    return path


class Unpacked:
    """An FMU in a folder, ready to be instantiated."""

    def __init__(self, fmu: Path, folder: Path):
        self.folder = folder
        fmpy.extract(str(fmu), str(folder))
        self.description = fmpy.read_model_description(str(fmu))
        self.version = int(self.description.fmiVersion[0])
        self.variables = {v.name: v for v in self.description.modelVariables}
        self.reference = {v.name: v.valueReference for v in self.description.modelVariables}

    def elements(self, name: str) -> list[str]:
        """The names that hold an array: one in FMI 3, in FMI 2 one for each element, row by row."""
        return [name] if name in self.reference else [n for n in self.reference if n.startswith(f"{name}[")]


class Master:
    """One instance. Calls raise FMICallException from status Discard on; warnings are only in the log."""

    def __init__(self, unpacked: Unpacked, start_time: float = 0.0, token: str | None = None, logging: bool = False):
        self.of, self.log = unpacked, []
        self.now = start_time
        kind = FMU3Slave if unpacked.version == 3 else FMU2Slave
        identifier = unpacked.description.coSimulation.modelIdentifier
        self.fmu: Any = kind(
            guid=token or unpacked.description.guid, unzipDirectory=str(unpacked.folder), modelIdentifier=identifier, instanceName="one"
        )
        if unpacked.version == 3:
            self.fmu.instantiate(loggingOn=logging, logMessage=lambda env, status, category, text: self._line(status, category, text))
        else:
            self.callbacks = fmi2CallbackFunctions()
            self.callbacks.logger = fmi2CallbackLoggerTYPE(lambda env, name, status, category, text: self._line(status, category, text))
            self.fmu.instantiate(loggingOn=logging, callbacks=self.callbacks)

    def _line(self, status: int, category: bytes, text: bytes) -> None:
        self.log.append((status, category.decode(), text.decode()))

    def initialise(self, **start: Any) -> Master:
        """Enter and leave initialisation mode, with start values between."""
        if self.of.version == 3:
            self.fmu.enterInitializationMode(startTime=self.now)
        else:
            self.fmu.setupExperiment(startTime=self.now)
            self.fmu.enterInitializationMode()
        for name, value in start.items():
            self.set(name, value)
        self.fmu.exitInitializationMode()
        return self

    def set(self, name: str, value: Any) -> None:
        references = [self.of.reference[n] for n in self.of.elements(name)]
        values = np.ravel(np.asarray(value)).tolist()
        if self.of.variables[self.of.elements(name)[0]].type == "Enumeration":
            (self.fmu.setInt64 if self.of.version == 3 else self.fmu.setInteger)(references, [int(v) for v in values])
        else:
            (self.fmu.setFloat64 if self.of.version == 3 else self.fmu.setReal)(references, values)

    def get(self, *names: str) -> np.ndarray:
        """Numbers, one after the other."""
        return np.concatenate([self._get(name) for name in names])

    def _get(self, name: str) -> np.ndarray:
        elements = self.of.elements(name)
        references = [self.of.reference[n] for n in elements]
        kind = self.of.variables[elements[0]].type
        if self.of.version == 2:
            return np.array((self.fmu.getInteger if kind in ("Integer", "Enumeration") else self.fmu.getReal)(references), float)
        if kind == "UInt32":
            return np.array(self.fmu.getUInt32(references), float)
        if kind == "Enumeration":
            return np.array(self.fmu.getInt64(references), float)
        count = int(np.prod(self.of.variables[name].shape or (1,)))
        return np.array(self.fmu.getFloat64(references, nValues=count), float)

    def step(self, size: float) -> None:
        self.fmu.doStep(self.now, size)
        self.now = round(self.now / 1e-3 + size / 1e-3) * 1e-3

    def slope(self, name: str, value: float) -> None:
        """FMI 2: the derivative of an input."""
        reference, order = (ctypes.c_uint * 1)(self.of.reference[name]), (ctypes.c_int * 1)(1)
        self.fmu.fmi2SetRealInputDerivatives(self.fmu.component, reference, 1, order, (ctypes.c_double * 1)(value))

    def derivative(self, unknown: str, known: str) -> float:
        return float(self.fmu.getDirectionalDerivative([self.of.reference[unknown]], [self.of.reference[known]], [1.0])[0])

    def save(self) -> Any:
        return self.fmu.getFMUState() if self.of.version == 3 else self.fmu.getFMUstate()

    def restore(self, state: Any) -> None:
        (self.fmu.setFMUState if self.of.version == 3 else self.fmu.setFMUstate)(state)

    def to_bytes(self, state: Any) -> bytes:
        return (self.fmu.serializeFMUState if self.of.version == 3 else self.fmu.serializeFMUstate)(state)

    def from_bytes(self, data: bytes) -> Any:
        return (self.fmu.deserializeFMUState if self.of.version == 3 else self.fmu.deSerializeFMUstate)(data)
