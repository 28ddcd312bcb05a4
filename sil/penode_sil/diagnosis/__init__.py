# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a simulation gets wrong against recordings, its cause by name, and the model file with that cause in it."""

from .engine import diagnose
from .result import Cause, Diagnosis
from .terminal import sentences

__all__ = ["Cause", "Diagnosis", "diagnose", "sentences"]
