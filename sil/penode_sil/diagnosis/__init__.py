# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a simulation gets wrong against recordings, its cause by name, and the model file with that cause in it.

`engine.diagnose` tells the story; its rooms, in the order of the work:
study      recordings with their noise, the model fitted within its tolerances, and what that leaves
plant      the model as it is searched: places of forces, linearised, compiled for many runs at once
evidence   an observer that follows unmodelled forces, and how well it predicts samples that it was not fitted to
catalogue  all causes that have a name: a file for a kind or a family, and nothing else knows a single kind
search     causes proposed, fitted, compared, accepted, reconsidered, named
checks     mix-ups, faults of sensors, tones, numerics, and what every answer has to pass
verdict    from what was found to the answer
extend     the extended model file, and what it gains
report     pictures and words; `terminal` is the short form, `result` what diagnosis.json has
`files`, `folder`, `table`: one diagnosis from files to files, many, and the table over them
"""

from .engine import diagnose
from .result import Cause, Diagnosis
from .terminal import sentences

__all__ = ["Cause", "Diagnosis", "diagnose", "sentences"]
