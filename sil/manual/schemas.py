# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""JSON schemas of the files that the command writes, from the classes of their contents; their $id has the version."""

from __future__ import annotations

import dataclasses
import json
import types
import typing
from collections.abc import Mapping
from typing import Any

from penode_gen.errors import Problem
from penode_gen.version import VERSION
from penode_sil.diagnosis.result import VERDICTS, Diagnosis
from penode_sil.training.result import Trained

Schema = dict[str, Any]
PLAIN = {str: "string", int: "integer", float: "number", bool: "boolean", type(None): "null"}
NAMES = {"diagnosis": "diagnosis.json of `penode diagnose`", "training": "training.json of `penode train`", "error": "an error with --json"}


def of(hint: Any) -> Schema:
    """The schema of a type: dataclasses, tuples, mappings, unions, plain values; {} for anything else."""
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if hint in PLAIN:
        return {"type": PLAIN[hint]}
    if dataclasses.is_dataclass(hint):
        return of_class(hint)
    if origin in (typing.Union, types.UnionType):
        return {"anyOf": [of(one) for one in inner]}
    if origin is tuple and inner[-1] is not Ellipsis:
        return {"type": "array", "prefixItems": [of(one) for one in inner], "minItems": len(inner), "maxItems": len(inner)}
    if origin in (tuple, list):
        return {"type": "array", "items": of(inner[0])}
    if origin is dict:
        return {"type": "object", "additionalProperties": of(inner[1])}
    return {}


def of_class(kind: Any, left_out: tuple[str, ...] = ()) -> Schema:
    """The schema of a dataclass, all of whose fields are written."""
    hints: Mapping[str, Any] = typing.get_type_hints(kind)
    names = [f.name for f in dataclasses.fields(kind) if f.name not in left_out]
    return {"type": "object", "properties": {name: of(hints[name]) for name in names}, "required": names}


def schema(name: str) -> Schema:
    """One of NAMES."""
    found = {"diagnosis": _diagnosis, "training": _training, "error": _error}[name]()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "$id": f"penode:{name}:{VERSION}", "title": NAMES[name], **found}


def file(name: str) -> str:
    """What the schema is called on the site, in the folder schemas."""
    return f"{name}-{VERSION}.json"


def _diagnosis() -> Schema:
    found = of_class(Diagnosis, ("shown",))
    found["properties"]["verdict"] = {"enum": list(VERDICTS)}
    return found


def _training() -> Schema:
    """As Trained.as_json writes it."""
    hints = typing.get_type_hints(Trained)
    found = of_class(Trained, ("forces", "parameters", "unknown", "tried"))
    value = {"type": "object", "required": ["value", "sigma", "before", "unit"]}
    found["properties"] |= {
        "parameters": {"type": "object", "additionalProperties": value},
        "tried": {"type": "array", "items": {"type": "object"}},
        "not_identifiable": of(hints["unknown"]),
        "networks": {"type": "object", "additionalProperties": {"type": "object", "required": ["file", "low", "high", "band"]}},
    }
    return {**found, "required": [n for n in found["properties"] if n != "model"]}


def _error() -> Schema:
    hints = typing.get_type_hints(Problem)
    problem = {"type": "object", "properties": {name: {"anyOf": [of(hint), {"type": "null"}]} for name, hint in hints.items()}}
    problem["required"] = list(hints)
    properties = {"code": {"type": "string"}, "exit": {"enum": [2, 3, 4]}, "problems": {"type": "array", "items": problem}}
    properties["traceback"] = {"type": ["string", "null"]}
    inner = {"type": "object", "properties": properties, "required": ["code", "exit", "problems"]}
    return {"type": "object", "properties": {"error": inner}, "required": ["error"]}


def page() -> str:
    lines = ["# JSON schemas", ""]
    lines += [
        f"Of version {VERSION}, as draft 2020-12. A field may be added in any version; one is removed or changed only with a line in",
        "",
    ]
    lines[-2] += " `CHANGELOG.md`. Numbers are in SI units where no `unit` stands beside them."
    for name, title in NAMES.items():
        link = f'<a href="../../../schemas/{file(name)}">{file(name)}</a>'
        lines += [f"## {name}", "", f"Of {title}: {link}", "", "```json", json.dumps(schema(name), indent=2), "```", ""]
    return "\n".join(lines)
