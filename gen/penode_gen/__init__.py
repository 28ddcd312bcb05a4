"""penode_gen: from a model file and its networks to C."""

from .emission.model_c import generate, render
from .model import Model, ModelError
from .reading.model_file import load
from .sets.packing import set_head, set_values
from .sets.serial_form import SerialSet, read_serial, serial
from .twins.numeric import Numeric, numeric
from .version import VERSION

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
