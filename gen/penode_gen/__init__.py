"""penode_gen: from a model file and its networks to C."""

from .emit_c import VERSION, generate, render
from .model import Model, ModelError
from .numeric import Numeric, numeric
from .read_toml import load
from .serial_form import SerialSet, read_serial, serial
from .sets import set_head, set_values

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
