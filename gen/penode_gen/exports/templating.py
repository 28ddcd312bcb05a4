# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
The templates of the exports: "ssp/system.xml.j2" is ssp/templates/system.xml.j2.

Filters: `xml` and `c` escape a text, `number` prints all digits of a double.
"""

from __future__ import annotations

from typing import Any
from xml.sax.saxutils import escape

import jinja2

from ..emission.model_c import compiled_templates
from ..resources import resource

# C strings: what C99 can write, byte by byte; octal, since a hexadecimal escape has no end
_C = {i: f"\\{i:03o}" for i in (*range(32), 34, 63, 92, 127)}


def xml(text: object) -> str:
    """A text as XML: as content, or between double quotes. Control characters, which XML has no form for, become blanks."""
    kept = "".join(c if c in "\t\n" or c >= " " else " " for c in str(text))
    return escape(kept, {'"': "&quot;", "\n": " ", "\t": " "})


def c_string(text: object) -> str:
    """A text between the quotes of a C string, in UTF-8."""
    return "".join(chr(b) if b < 128 and b not in _C else _C.get(b, f"\\{b:03o}") for b in str(text).encode())


_FOLDERS = sorted(resource("penode_gen.exports").glob("*/templates"))
_ENVIRONMENT = jinja2.Environment(
    loader=jinja2.PrefixLoader({folder.parent.name: jinja2.FileSystemLoader(folder) for folder in _FOLDERS}),
    bytecode_cache=compiled_templates(),
    undefined=jinja2.StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
    autoescape=False,
)
_ENVIRONMENT.filters |= {"xml": xml, "c": c_string, "number": lambda x: repr(float(x))}


def render(template: str, **context: Any) -> str:
    """The text of a template."""
    return _ENVIRONMENT.get_template(template).render(context)
