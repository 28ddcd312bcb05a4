# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Causes without a law: what parameters, sensors, networks and numerics are off by. Other rooms find them."""

MEANING = {
    "wrong_parameter": "A parameter of the model file is off by more than its tolerance.",
    "differs_between_recordings": "The parameter has another value in each recording: another load, another setting.",
    "sensor_bias": "The sensor reads a constant or slowly drifting amount too much.",
    "sensor_clipping": "The sensor is cut off beyond a limit.",
    "sensor_dropout": "The sensor lost samples.",
    "network_extrapolation": "A network is used outside of what it was trained on.",
    "integration_error": "The physics is right; the deployed step integrates it too coarsely.",
    "outside_taxonomy": "Something is left that noise cannot make and that no kind on the list explains.",
}
