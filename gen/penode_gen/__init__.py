"""penode_gen: from a model file and its networks to C."""

from .emit_c import VERSION, generate, render
from .model import Model, ModelError
from .numeric import Numeric, numeric
from .read_toml import load
from .sets import set_head, set_values

__all__ = ["VERSION", "Model", "ModelError", "Numeric", "generate", "load", "numeric", "render", "set_head", "set_values"]
