# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A2L (ASAP2 1.61) of a linked program: what a calibration tool may change and measure, where it lies, and how XCP gets there."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from ...model import Model
from ...version import VERSION
from ..interface import Exporter, ExportError, Option, Options
from ..templating import render
from . import filtered
from .elf_types import Place, Program, read_program
from .entries import Characteristic, Measurement, Measurements, characteristics, instance_of, page
from .lists import static_lists

_IDENTIFIER = re.compile(r"[A-Za-z_][\w.]*")
_TRANSPORTS = "tcp:HOST:PORT, udp:HOST:PORT, serial:BAUD, can:ID:ID or canfd:ID:ID"
_PACKET = {"tcp": 252, "udp": 252, "serial": 252, "can": 8, "canfd": 64}  # bytes of the longest packet, unless told


def transport(text: str) -> dict[str, Any]:
    """A transport as the template needs it. Raises ExportError."""
    kind, *words = text.split(":")
    try:
        if kind in ("tcp", "udp") and len(words) == 2 and words[0] and 0 < int(words[1]) < 65536:
            return {"kind": kind, "host": words[0], "port": int(words[1])}
        if kind == "serial" and len(words) == 1 and int(words[0]) > 0:
            return {"kind": kind, "baud": int(words[0])}
        if kind in ("can", "canfd") and len(words) == 2:
            master, slave = (int(word, 0) for word in words)
            if min(master, slave) >= 0 and max(master, slave) < 1 << 29 and master != slave:
                return {"kind": kind, "master": master, "slave": slave}
    except ValueError:
        pass
    raise ExportError(f'--transport: "{text}" is none; use {_TRANSPORTS}')


def epk(program: Program, symbol: str | None) -> tuple[str, int] | None:
    """Text and address of the EPK, which the program holds in a variable; None if it has none. Raises ExportError."""
    name = symbol or "penode_epk"
    try:
        place = program.find(name)
        text = program.bytes_at(place.address, place.size).split(b"\0")[0].decode("ascii")
    except KeyError as exc:
        if symbol is None:
            return None
        raise ExportError(f"--epk: {program.path} has no variable {symbol}; name an array of characters") from exc
    except UnicodeDecodeError as exc:
        raise ExportError(f"--epk: {name} is not ASCII text; name an array of characters") from exc
    if not text or quote(text) != f'"{text}"':  # a tool compares it with the memory, character by character
        raise ExportError(
            f'--epk: {name} holds "{text}", which an A2L cannot repeat as it is; use a text without quotes, backslashes and double spaces'
        )
    return text, place.address


def _measured(model: Model, program: Program, instance: str, named: str | None) -> Measurements:
    found = Measurements(program)
    others = [name.strip() for name in (named or "").split(",") if name.strip()]
    problems = []
    try:
        found.of_model(model, instance)
        filtered.add(found, model)
    except KeyError as exc:
        raise ExportError(
            f"{program.path}: {exc.args[0]} is not there; generate the C of {model.path.name} again with penode {VERSION}"
        ) from exc
    shown = [*program.names(f"{model.name}_z_t")[:1], *program.names(f"{model.name}_ekf_estimate_t")[:1]]
    for name in others or shown:
        try:
            found.of_variable(model, name)
        except KeyError as exc:
            problems.append(
                f"--measure: {program.path} has no variable {exc.args[0]}; name variables outside of functions, with commas between"
            )
    if problems:
        raise ExportError(*problems)
    return found


def _units(entries: Iterable[Characteristic | Measurement]) -> dict[str, str]:
    """Unit -> name of its COMPU_METHOD."""
    names: dict[str, str] = {}
    for unit in sorted({entry.unit for entry in entries}):
        plain = "unit_" + (re.sub(r"\W+", "_", unit.replace("/", "_per_"), flags=re.ASCII).strip("_") or "none")
        names[unit] = plain if plain not in names.values() else f"{plain}_{len(names)}"
    return names


def _build(model: Model, options: Options) -> bytes:
    if options["elf"] is None:
        raise ExportError("--elf: it is missing; name the linked program, compiled with -g, that the addresses are to be taken from")
    wire = transport(options["transport"])
    program = read_program(options["elf"])
    values = page(model, program)
    instance = instance_of(model, program, options["instance"])
    measured = _measured(model, program, instance, options["measure"])
    return describe(model, program, values, measured, wire, epk(program, options["epk"]), options["max_cto"]).encode()


def describe(
    model: Model,
    program: Program,
    values: Place,
    measured: Measurements,
    wire: dict[str, Any],
    identity: tuple[str, int] | None,
    max_cto: Any = None,
    pages: bool = True,
    addresses: bool = True,
) -> str:
    """
    The text of an A2L. `values`: the array of a set; `pages`: a slave of penode switches between two of them there; `addresses`: False for
    zeros, where SYMBOL_LINKs are to be resolved. Raises ExportError.
    """
    entries = characteristics(model, values, program.find(f"{values.path}[0]"))
    names = [entry.name for entry in entries] + list(measured.found)
    shown: list[Characteristic | Measurement] = [*entries, *measured.found.values()]
    highest = max(max(entry.address for entry in shown), values.address + values.size)
    if highest >= 1 << 32:
        raise ExportError(f"{program.path}: addresses of more than 32 bits; link the program with -no-pie")
    for name in names:
        if not _IDENTIFIER.fullmatch(name):
            raise ExportError(f"{model.path.name}: {name}: A2L has no such names; use letters without accents, digits and underscores")
    return render(
        "a2l/a2l.j2",
        version=VERSION,
        model=model,
        values=values,
        characteristics=entries,
        measurements=measured.found.values(),
        groups=_groups(entries, measured),
        units=_units(shown),
        scale={entry.unit: 1.0 / entry.factor for entry in shown},
        wire=wire,
        epk=identity,
        lists=static_lists(program),
        max_cto=int(max_cto or _PACKET[wire["kind"]]),
        little=program.little_endian,
        cycle=_cycle(model.sample_time),
        quote=quote,
        pages=pages,
        addresses=addresses,
    )


def quote(text: str) -> str:
    """A text as an A2L string."""
    return '"' + " ".join(text.split()).replace("\\", "/").replace('"', "'") + '"'


def _groups(entries: list[Characteristic], measured: Measurements) -> dict[str, tuple[str, list[str]]]:
    """Name -> what it refers to, and which."""
    found: dict[str, tuple[str, list[str]]] = {}
    for entry in entries:
        owner = entry.name.split(".")[0] if "." in entry.name else "parameters"
        found.setdefault(f"set_{owner}", ("CHARACTERISTIC", []))[1].append(entry.name)
    return found | {f"measured_{name}": ("MEASUREMENT", names) for name, names in measured.groups.items()}


def _cycle(seconds: float) -> tuple[int, int]:
    """A time as XCP codes it: (count, unit), unit 0: 1 ns, 1: 10 ns, ... 9: 1 s; (0, 0), not cyclic, if it is none of them."""
    for unit in range(9, -1, -1):
        count = seconds / 10.0 ** (unit - 9)
        if round(count) in range(1, 256) and abs(count - round(count)) < 1e-6:
            return round(count), unit
    return 0, 0


EXPORTER = Exporter(
    "A2L of a linked program, for calibration over XCP",
    (".a2l",),
    _build,
    (
        Option("elf", "Linked program, compiled with -g; it has the addresses.", "file"),
        Option("instance", "Variable that is the model's instance (default: the only one of its type)."),
        Option("measure", "More variables to measure, separated by commas (default: those of the sensors and of the filter's estimates)."),
        Option("transport", f"XCP transport: {_TRANSPORTS}.", default="tcp:127.0.0.1:5555"),
        Option("max_cto", "Bytes of the longest XCP packet (default: 8 on CAN, 64 on CAN FD, else 252).", "number"),
        Option("epk", "Variable with the text that identifies the program (default: penode_epk, if the program has it)."),
    ),
    ("elftools",),
    "xcp",
)
