# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""An SSP with one FMU, as the player needs it: signals, values to set at the start, and the schedule of sets (gen/SCHEDULE.md)."""

from __future__ import annotations

import math
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from .errors import ModelError

SSP = "http://ssp-standard.org/SSP1/SystemStructure"
SCHEDULE = "extra/penode/schedule.xml"
_SPACE = {
    "ssd": f"{SSP}Description",
    "ssv": f"{SSP}ParameterValues",
    "ssm": f"{SSP}ParameterMapping",
    "ps": "urn:penode:parameter-schedule:1",
}
_TYPES = ("Real", "Float64", "Float32", "Integer", "Enumeration", "Int64", "Int32", "UInt32", "Boolean")

Values = dict[str, tuple[float, ...]]  # by name in the component


@dataclass(frozen=True)
class Exchange:
    """Values that are set at the first communication point not before `time` [s]."""

    time: float
    values: Values
    source: str


@dataclass(frozen=True)
class System:
    """The component and what happens to it."""

    component: str
    fmu: bytes
    inputs: tuple[str, ...]  # of the system, which are the component's by their names there
    outputs: tuple[str, ...]
    wires: dict[str, str]  # connector of the system -> connector of the component
    start: Values
    schedule: tuple[Exchange, ...]
    stop: float | None


def read(path: Path) -> System:
    """The system in a file. Raises UserError with one line."""
    try:
        with zipfile.ZipFile(path) as archive:
            return _Reader(path, archive).system()
    except OSError as error:
        raise ModelError([f"{path}: {error.strerror or error}; name a file that can be read"]) from None
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, ValueError) as error:
        raise ModelError([f"{path}: not a readable SSP: {' '.join(str(error).split()) or type(error).__name__}; export it again"]) from None


class _Reader:
    def __init__(self, path: Path, archive: zipfile.ZipFile):
        self.path, self.archive = path, archive

    def error(self, where: str, what: str, remedy: str) -> ModelError:
        return ModelError([f"{self.path}: {where}: {' '.join(what.split())}; {remedy}"])

    def data(self, name: str, named_by: str, limit: int = 200_000_000) -> bytes:
        """A file of the archive, of up to `limit` bytes."""
        try:
            if self.archive.getinfo(name).file_size > limit:
                raise self.error(name, f"more than {limit} bytes", "this is no file of values or system")
            return self.archive.read(name)
        except KeyError:
            raise self.error(named_by, f"there is no {name!r} in the archive", "export it again") from None

    def xml(self, name: str, named_by: str, tag: str) -> ElementTree.Element:
        """The root of a file, which must be `tag`."""
        try:
            root = ElementTree.fromstring(self.data(name, named_by))
        except (ElementTree.ParseError, LookupError) as error:
            raise self.error(name, f"not readable XML: {error}", "export it again") from None
        space, _, local = tag.partition(":")
        if root.tag != f"{{{_SPACE[space]}}}{local}":
            raise self.error(name, f"its root is {root.tag!r}, not {local} of {_SPACE[space]}", "name another file")
        return root

    def attribute(self, element: ElementTree.Element, key: str, where: str) -> str:
        if key not in element.attrib:
            raise self.error(where, f"{element.tag.rpartition('}')[2]} has no attribute {key}", "add it")
        return element.attrib[key]

    def number(self, text: str, where: str) -> float:
        words = {"true": 1.0, "false": 0.0}
        try:
            value = words[text] if text in words else float(text)
        except ValueError:
            raise self.error(where, f"{text[:40]!r} is not a number", "correct it") from None
        if not math.isfinite(value):
            raise self.error(where, f"{text[:40]!r} is not finite", "correct it")
        return value

    def system(self) -> System:
        name = "SystemStructure.ssd"
        root = self.xml(name, str(self.path), "ssd:SystemStructureDescription")
        system = root.find("ssd:System", _SPACE)
        if system is None:
            raise self.error(name, "there is no System", "export it again")
        components = system.findall("ssd:Elements/*", _SPACE)
        if len(components) != 1 or components[0].tag != f"{{{_SPACE['ssd']}}}Component":
            raise self.error(name, f"{len(components)} elements", "this player takes a system of one component; use another one for more")
        component = components[0]
        owner = self.attribute(component, "name", name)
        kinds = {
            self.attribute(c, "name", name): self.attribute(c, "kind", name) for c in system.findall("ssd:Connectors/ssd:Connector", _SPACE)
        }
        wires = dict(self.wire(c, owner, name) for c in system.findall("ssd:Connections/ssd:Connection", _SPACE))
        if not kinds:  # players of SSP 1.0 take connections between components only: the component's own connectors are the signals
            kinds = {
                self.attribute(c, "name", name): self.attribute(c, "kind", name)
                for c in component.findall("ssd:Connectors/ssd:Connector", _SPACE)
            }
            wires = {connector: connector for connector in kinds}
        start: Values = {}
        for binding in component.findall("ssd:ParameterBindings/ssd:ParameterBinding", _SPACE):
            mapping = binding.find("ssd:ParameterMapping", _SPACE)
            start |= self.values(
                self.attribute(binding, "source", name), self.attribute(mapping, "source", name) if mapping is not None else "", name
            )
        experiment = root.find("ssd:DefaultExperiment", _SPACE)
        stop = self.number(experiment.attrib["stopTime"], name) if experiment is not None and "stopTime" in experiment.attrib else None
        return System(
            owner,
            self.data(self.attribute(component, "source", name), name),
            tuple(k for k, kind in kinds.items() if kind == "input" and k in wires),
            tuple(k for k, kind in kinds.items() if kind == "output" and k in wires),
            wires,
            start,
            self.schedule(owner),
            stop,
        )

    def wire(self, connection: ElementTree.Element, owner: str, where: str) -> tuple[str, str]:
        """Connector of the system, and that of the component which it is connected with."""
        ends = [(connection.get(f"{side}Element"), self.attribute(connection, f"{side}Connector", where)) for side in ("start", "end")]
        outer = [name for element, name in ends if element is None]
        inner = [name for element, name in ends if element == owner]
        if len(outer) != 1 or len(inner) != 1:
            raise self.error(where, "a connection that is not between the system and its component", "this player takes no other")
        return outer[0], inner[0]

    def values(self, source: str, mapping: str, named_by: str) -> Values:
        """An SSV through an SSM, if there is one."""
        found: Values = {}
        for parameter in self.xml(source, named_by, "ssv:ParameterSet").findall("ssv:Parameters/ssv:Parameter", _SPACE):
            name = self.attribute(parameter, "name", source)
            content = next((c for c in parameter if c.tag.rpartition("}")[2] in _TYPES), None)
            if content is None:
                raise self.error(source, f"{name} is neither a number nor an array of numbers", "leave it out")
            found[name] = tuple(self.number(word, f"{source}: {name}") for word in self.attribute(content, "value", source).split())
            if not found[name]:
                raise self.error(source, f"{name} has no value", "give it one")
        if not mapping:
            return found
        entries = self.xml(mapping, named_by, "ssm:ParameterMapping").findall("ssm:MappingEntry", _SPACE)
        names = {self.attribute(e, "source", mapping): self.attribute(e, "target", mapping) for e in entries}
        if any(len(entry) for entry in entries):
            raise self.error(mapping, "an entry with a transformation", "this player takes names only")
        return {names.get(name, name): value for name, value in found.items()}

    def schedule(self, owner: str) -> tuple[Exchange, ...]:
        """The exchanges, in time; none if there is no schedule."""
        if SCHEDULE not in self.archive.namelist():
            return ()
        root = self.xml(SCHEDULE, str(self.path), "ps:ParameterSchedule")
        found: list[Exchange] = []
        version = self.attribute(root, "version", SCHEDULE)
        if version.partition(".")[0] != "1":
            raise self.error(SCHEDULE, f"version {version}", "this player reads version 1")
        for entry in root.findall("ps:Exchange", _SPACE):
            element, source = self.attribute(entry, "element", SCHEDULE), self.attribute(entry, "source", SCHEDULE)
            time = self.number(self.attribute(entry, "time", SCHEDULE), SCHEDULE)
            if element != owner:
                raise self.error(SCHEDULE, f"there is no component {element!r}", f"the system has {owner!r}")
            if time < 0.0 or (found and time < found[-1].time):
                raise self.error(SCHEDULE, f"an exchange at {time:g} s", "times are 0 or more and ascend")
            found.append(Exchange(time, self.values(source, entry.get("mapping", ""), SCHEDULE), source))
        return tuple(found)
