# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The model with a filter and a monitor for the diagnosed causes: the extended model with causes of size 0."""

from __future__ import annotations

import re
from pathlib import Path

import sympy as sp

import penode_gen
from penode_gen import units
from penode_gen.errors import ModelError
from penode_gen.laws import LAWS
from penode_gen.model import Element, Model

from .entries import table, toml

MONITORED = "model_monitored.toml"
MEAN_TIME = "20 h"  # between false alarms
BIAS, GAIN = "bias_", "gain_"  # what a fault of a sensor is called in an extended model: added to what it measures, a factor on it


def sizes(element: Element) -> list[str]:
    """Parameters of an element that its force is proportional to: one, or several together; none if there are no such."""
    law = LAWS.get(element.law)
    if law is None:
        return []
    symbols = {name: sp.Symbol(name) for name in (*law.arguments, *law.states, "s", "v")}
    force = sp.sympify(law.force.replace("^", "**").replace("min(", "Min(").replace("max(", "Max("), locals=symbols)
    linear = [name for name in law.arguments if symbols[name] in force.free_symbols and force.diff(symbols[name], symbols[name]) == 0]
    linear = [name for name in linear if not force.diff(symbols[name]).has(sp.Heaviside)]  # the edge of a Max: a place, no size
    alone = [name for name in linear if force.subs(symbols[name], 0) == 0]
    chosen = alone[:1] or linear
    gone = force.subs({symbols[name]: 0 for name in chosen})
    return [element.arguments[name] for name in chosen] if gone == 0 else []


def changes(nominal: Model, extended: Model) -> dict[str, dict[str, float]]:
    """Causes by name: their parameters, which without the fault have no effect, SI."""
    known, found = {e.name for e in nominal.elements}, {}
    for element in extended.elements:
        own = sizes(element) if element.name not in known else []
        if own and not set(own) & set(nominal.parameters):
            found[element.name] = {p: extended.parameters[p].value for p in own}
    for name, parameter in extended.parameters.items():
        start = next((start for start in (BIAS, GAIN) if name.startswith(start)), "")
        if start and name not in nominal.parameters and name.removeprefix(start) in {s.name for s in nominal.sensors}:
            found[name] = {name: parameter.value - (1.0 if start == GAIN else 0.0)}
    return {name: own for name, own in found.items() if any(own.values())}


def write(folder: Path, nominal: Model, model_file: str) -> str:
    """
    Write the monitored model beside the extended one, if the nominal model has a filter and something was named that can be watched for.

    Returns a note on what was written or not, "" where the model has no filter.
    """
    if nominal.filter is None:
        return ""
    extended = penode_gen.load(folder / model_file)
    text, path = (folder / model_file).read_text(), folder / MONITORED
    found = changes(nominal, extended)
    watched = {name: own for name, own in found.items() if _good(path, _text(text, extended, {name: own}))}
    if not watched:
        return f"no {MONITORED}: no cause was named that a monitor can watch for"
    path.write_text(_text(text, extended, watched), encoding="utf-8")
    return f"{MONITORED} watches for {', '.join(watched)}; `penode generate` writes the C of its filter and monitor"


def _good(path: Path, text: str) -> bool:
    """Can a model with a monitor be read? Leaves no file."""
    path.write_text(text, encoding="utf-8")
    try:
        penode_gen.load(path)
    except ModelError:
        return False
    finally:
        path.unlink()
    return True


def _text(text: str, extended: Model, watched: dict[str, dict[str, float]]) -> str:
    """The text of the extended model, with parameters as they are without a fault, and what is watched for."""
    causes = []
    for name, own in watched.items():
        entry = {}
        for parameter, change in own.items():
            factor = units.factor(extended.parameters[parameter].unit)
            healthy = toml(float((extended.parameters[parameter].value - change) / factor))
            text = re.sub(rf"(?m)^({parameter} = \{{ value = )[^,}}]*", rf"\g<1>{healthy}", text)
            entry[parameter] = change / factor
        causes.append(f"{name} = {table(entry)}")
    text = re.sub(r'(?m)^name = ".*"$', f"name = {toml(extended.name.removesuffix('_extended') + '_monitored')}", text, count=1)
    head = "# The named cause at its value without the fault; the monitor watches for its onset. Below: the comment of the extended model."
    return "\n".join([head, text.rstrip(), "", "[monitor]", f"mean_time = {toml(MEAN_TIME)}", "", "[monitor.causes]", *causes, ""])
