# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""`penode simulate --ssp`: the FMU of an SSP with its schedule of parameter sets, run by FMPy."""

from __future__ import annotations

import importlib.util
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import recordings, ssp_file
from .errors import ModelError, RecordingError, ToolMissing
from .output import Column
from .recordings.order import Ordered

Array = NDArray[np.float64]
Tell = Callable[[str], None]  # gets a line


def play(path: Path, record: Path | None, tell: Tell = lambda line: None, channels: Sequence[str] = ()) -> list[Column]:
    """
    Time, inputs and outputs at each sample, as columns. Raises UserError.

    `record`: a recording of inputs of the system, read as everywhere, in the units of the FMU; a value holds from its row to the next.
    `channels` are texts like `x=pos_mm`. Without it inputs keep their start values until the stop time of the SSP. `tell` takes a line for
    each warning of the FMU, and for each exchange that is scheduled too late.
    """
    if importlib.util.find_spec("fmpy") is None:
        raise ToolMissing("--ssp: it needs the Python package FMPy, which is not installed; pip install penode[ssp]")
    system = ssp_file.read(path)
    if record is None and system.stop is None:
        raise ModelError([f"{path}: it has no stop time; give inputs with --input"])
    with _component(path, system, tell) as fmu:
        units = {name: fmu.unit(system.wires[name]) for name in system.inputs}
        table = _record(record, units, channels, tell) if record else {}
        stop = float(table["time"][0][-1]) if table else float(system.stop or 0.0)
        steps = round(stop / fmu.step_size)
        rows = _run(path, system, fmu, table, steps)
    times = np.arange(steps + 1, dtype=float) * fmu.step_size
    names = [*system.inputs, *system.outputs]
    return [
        Column("time", "s", times),
        *(Column(name, fmu.unit(system.wires[name]), values) for name, values in zip(names, rows.T, strict=True)),
    ]


def _run(path: Path, system: ssp_file.System, fmu: _Fmu, table: dict[str, tuple[Array, Array]], steps: int) -> Array:
    """Rows of inputs and outputs: an output beside the input at its own sample."""
    times = np.arange(steps + 1, dtype=float) * fmu.step_size
    half = fmu.step_size / 2
    inputs = np.empty((len(system.inputs), steps + 1))
    for i, name in enumerate(system.inputs):
        if name in table:
            time, values = table[name]
            inputs[i] = values[np.maximum(np.searchsorted(time, times + half * 1e-3, side="right") - 1, 0)]
        else:
            inputs[i] = _start(system, fmu, name)
    outputs = np.empty((steps + 1, len(system.outputs)))
    waiting = list(system.schedule)
    fmu.initialise({**system.start, **{system.wires[n]: (u[0],) for n, u in zip(system.inputs, inputs, strict=True)}}, f"{path}: start")
    for k in range(steps + 1):
        outputs[k] = [fmu.get(system.wires[name]) for name in system.outputs]
        if k == steps:
            break
        while waiting and waiting[0].time <= times[k] + half * 1e-3:
            exchange = waiting.pop(0)
            fmu.set(exchange.values, f"{path}: {exchange.source} at {exchange.time:g} s")
        fmu.set({system.wires[n]: (u[k],) for n, u in zip(system.inputs, inputs, strict=True)}, f"{path}: inputs")
        fmu.step(k)
    for exchange in waiting:
        fmu.tell(f"{exchange.source} at {exchange.time:g} s is never in force: the run ends at {times[-1]:g} s")
    return np.column_stack([inputs.T, outputs])


def _start(system: ssp_file.System, fmu: _Fmu, name: str) -> float:
    """Start value of an input of the system: what the SSP binds to it, or else the FMU's own."""
    bound = system.start.get(system.wires[name])
    return bound[0] if bound else fmu.get(system.wires[name])


def _record(path: Path, units: dict[str, str], channels: Sequence[str], tell: Tell) -> dict[str, tuple[Array, Array]]:
    """Times [s] and values (SI) of "time" and of each input, name -> unit, that a recording has, on the clock of its table."""
    tables = recordings.read(path, [*units, "time"], recordings.aliases(channels, units))
    found: dict[str, tuple[Array, Array]] = {}
    for name, unit in units.items():
        if any(table.find(name, unit) for table in tables):
            table = recordings.pick(tables, name, unit)
            values = table.channel(name, unit)
            rows = _rows(table, tell)
            found[name] = rows.time, values[rows.rows]
    shared = min((time[-1] for time, _ in found.values()), default=None) if found else _rows(tables[0], tell).time[-1]
    return {"time": (np.array([shared]), np.array([shared])), **found}


def _rows(table: recordings.Recording, tell: Tell) -> Ordered:
    """The rows of a table in the order of time, each at a time of its own."""
    time = table.channel("time", "s")
    if not time.size:
        raise RecordingError(f"{table.path}: it has no rows; write time and inputs of the system, a row for each value that they take")
    rows = table.ordered(np.arange(time.size))
    if rows.note:
        tell(rows.note)
    again = np.flatnonzero(np.diff(rows.time) == 0.0)
    if again.size:
        where = table.place(int(rows.rows[again[0] + 1]))
        raise RecordingError(
            f"{where}: channel time has the same value as the row before{recordings.more(again.size)}; remove the duplicate"
        )
    return rows


class _Fmu:
    """The component in FMPy; every refusal is a UserError with what the FMU logged."""

    def __init__(self, path: Path, folder: str, description: Any, name: str, tell: Tell):
        from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
        from fmpy.fmi3 import FMU3Slave

        self.path, self.tell, self.now, self.lines = path, tell, 0.0, [""]
        self.new = description.fmiVersion.startswith("3")
        self.variables = {v.name: v for v in description.modelVariables}
        experiment = description.defaultExperiment
        self.step_size = float((experiment and experiment.stepSize) or 1e-3)
        identifier = description.coSimulation.modelIdentifier
        self.fmu: Any = (FMU3Slave if self.new else FMU2Slave)(
            guid=description.guid, unzipDirectory=folder, modelIdentifier=identifier, instanceName=name
        )
        if self.new:
            self.fmu.instantiate(logMessage=lambda env, status, category, text: self.line(status, text))
        else:
            self.callbacks = fmi2CallbackFunctions()
            self.callbacks.logger = fmi2CallbackLoggerTYPE(lambda env, instance, status, category, text: self.line(status, text))
            self.fmu.instantiate(callbacks=self.callbacks)

    def line(self, status: int, text: bytes) -> None:
        self.lines.append(text.decode("utf-8", "replace"))
        if status == 1:
            self.tell(self.lines[-1])

    @contextmanager
    def guarded(self, doing: str) -> Iterator[None]:
        from fmpy.fmi1 import FMICallException

        try:
            yield
        except FMICallException as error:
            raise ModelError([f"{doing}: the FMU refuses it: {self.lines[-1] or error}; correct the SSP"]) from None

    def unit(self, name: str) -> str:
        variable = self.variables[name]
        return variable.unit or (variable.declaredType.unit if variable.declaredType else None) or "1"

    def known(self, name: str, where: str) -> Any:
        if name not in self.variables:
            raise ModelError([f"{where}: the FMU has no variable {name!r}; correct the SSP"])
        return self.variables[name]

    def set(self, values: ssp_file.Values, where: str) -> None:
        for name, given in values.items():
            variable = self.known(name, where)
            size = int(np.prod(variable.shape or (1,))) if self.new else 1
            if len(given) != size:
                raise ModelError([f"{where}: {name} has {size} elements, and {len(given)} values are given; correct the SSP"])
            with self.guarded(f"{where}: {name}"):
                if variable.type == "Enumeration":
                    (self.fmu.setInt64 if self.new else self.fmu.setInteger)([variable.valueReference], [int(v) for v in given])
                else:
                    (self.fmu.setFloat64 if self.new else self.fmu.setReal)([variable.valueReference], list(given))

    def get(self, name: str) -> float:
        reference = [self.known(name, str(self.path)).valueReference]
        with self.guarded(name):
            return float((self.fmu.getFloat64 if self.new else self.fmu.getReal)(reference)[0])

    def initialise(self, values: ssp_file.Values, where: str) -> None:
        with self.guarded(where):
            if not self.new:
                self.fmu.setupExperiment(startTime=0.0)
            self.fmu.enterInitializationMode()
            self.set(values, where)
            self.fmu.exitInitializationMode()

    def step(self, k: int) -> None:
        with self.guarded(f"{self.path}: step at {k * self.step_size:g} s"):
            self.fmu.doStep(k * self.step_size, self.step_size)


@contextmanager
def _component(path: Path, system: ssp_file.System, tell: Tell) -> Iterator[_Fmu]:
    """The FMU in a folder of its own for as long as it runs."""
    import fmpy

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "component.fmu"
        file.write_bytes(system.fmu)
        try:
            description = fmpy.read_model_description(str(file))
            fmpy.extract(str(file), str(Path(folder) / "fmu"))
            fmu = _Fmu(path, str(Path(folder) / "fmu"), description, system.component, tell)
        except Exception as error:  # FMPy raises many kinds
            raise ModelError(
                [f"{path}: its FMU cannot be used: {' '.join(str(error).split())[:300]}; export it again, with a binary for this machine"]
            ) from None
        missing = [name for name in system.wires.values() if name not in fmu.variables]
        if missing:
            raise ModelError([f"{path}: the FMU has no variable {missing[0]!r}; correct the SSP"])
        try:
            yield fmu
        finally:
            fmu.fmu.freeInstance()
