# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Causes without a law: of parameters, sensors and numerics. Other modules find them."""

from collections.abc import Mapping, Sequence

from ..result import Cause, Named, Value
from .form import Form

MEANING = {
    "wrong_parameter": "A parameter of the model file is off by more than its tolerance.",
    "differs_between_recordings": "The parameter has another value in each recording: another load, another setting.",
    "sensor_bias": "The sensor reads a constant or slowly drifting amount too much.",
    "sensor_clipping": "The sensor is cut off beyond a limit.",
    "sensor_dropout": "The sensor lost samples.",
    "integration_error": "The physics is right; the deployed step integrates it too coarsely.",
    "outside_taxonomy": "A residual remains that is not noise and that no known kind explains.",
}
OFFSET = "sensor_bias"
PARAMETERS = {  # what each number of a report means
    "wrong_parameter": {"its name": "value in the recordings"},
    "differs_between_recordings": {"its name": "a value for each recording"},
    "sensor_bias": {"bias": "added to the signal"},
    "sensor_clipping": {"limit": "largest magnitude"},
    "sensor_dropout": {"share": "share of the samples that are lost"},
    "integration_error": {"rms_error_SENSOR": "error of the step, for each sensor that it affects"},
}
UNITS = {  # of these parameters, where it is not that of the signal
    "wrong_parameter": {"its name": "its own"},
    "differs_between_recordings": {"its name": "its own"},
    "sensor_dropout": {"share": "1"},
}
_CLIPPING, _DROPOUT, _DIFFERING = "sensor_clipping", "sensor_dropout", "differs_between_recordings"

WHERE = {
    "wrong_parameter": "a parameter",
    "differs_between_recordings": "a parameter",
    "integration_error": "the model",
    "outside_taxonomy": "none",
}


def lost(causes: Sequence[Cause]) -> set[str]:
    """Sensors that lost samples."""
    return {c.where for c in causes if c.kind == _DROPOUT}


def still_at_fault(again: Sequence[Cause], before: Sequence[Cause]) -> list[Cause]:
    """Faults of sensors found `again` beside an explanation, without drop-outs of a sensor that only had a rail `before`."""
    rails = {f.where for f in before if f.kind == _CLIPPING} - {f.where for f in before if f.kind == _DROPOUT}
    return [f for f in again if f.kind != _DROPOUT or f.where not in rails]


def offset(sensor: str, value: Value, confidence: float, alternatives: Sequence[Named] = ()) -> Cause:
    """An offset of a sensor as a cause, with what has the same effect."""
    return Cause(OFFSET, sensor, {"bias": value}, confidence, tuple(alternatives))


def clipped(sensor: str, limits: Mapping[str, Value]) -> Cause:
    """A sensor with samples at its limits, by what these are called."""
    return _shown(_CLIPPING, sensor, limits)


def limited(sensor: str, index: int, limit: float, note: str = "") -> Form:
    """The form of a sensor that is cut off beyond a limit, where only its motion shows that."""
    return Form(_CLIPPING, sensor, "clip", index, note=note, limit=limit)


def holed(sensor: str, share: Value) -> Cause:
    """A sensor that lost a share of its samples."""
    return _shown(_DROPOUT, sensor, {"share": share})


def coarse(model: str, errors: Mapping[str, Value]) -> Cause:
    """A step that is too long for its model, with its rms errors."""
    return _shown("integration_error", model, errors)


def differing(parameter: str, values: Mapping[str, Value], confidence: float, others: Sequence[str] = ()) -> Cause:
    """A parameter with a value for each recording, with the `others` that may differ as well instead."""
    return Cause(_DIFFERING, parameter, dict(values), confidence, tuple(Named(_DIFFERING, name) for name in others))


def _shown(kind: str, where: str, parameters: Mapping[str, Value]) -> Cause:
    """A cause that samples show by themselves, which no other explains."""
    return Cause(kind, where, dict(parameters), 0.99)
