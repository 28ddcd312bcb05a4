"""
penode_gen: from a model file and its networks to C.

What stands in `__all__` is imported when it is asked for: sympy and onnx take a second, and `penode --help` needs neither.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from .on_demand import names_from
from .version import VERSION

if TYPE_CHECKING:
    from .emission.model_c import generate, render
    from .errors import ModelError
    from .model import Model
    from .reading.model_file import load
    from .sets.packing import set_head, set_values
    from .sets.serial_form import SerialSet, read_serial, serial
    from .twins.numeric import Numeric, numeric

__all__ = [
    "VERSION",
    "Model",
    "ModelError",
    "Numeric",
    "SerialSet",
    "generate",
    "load",
    "numeric",
    "read_serial",
    "render",
    "serial",
    "set_head",
    "set_values",
]

_FROM = {  # name -> module that has it
    "Model": "model",
    "ModelError": "errors",
    "Numeric": "twins.numeric",
    "SerialSet": "sets.serial_form",
    "generate": "emission.model_c",
    "load": "reading.model_file",
    "numeric": "twins.numeric",
    "read_serial": "sets.serial_form",
    "render": "emission.model_c",
    "serial": "sets.serial_form",
    "set_head": "sets.packing",
    "set_values": "sets.packing",
}


__getattr__ = names_from(__name__, _FROM)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
