# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Channels with the opposite sign, or two that are exchanged. `checks` finds them."""

KINDS = ("input_sign", "sensor_sign", "swapped_channels")
MEANING = {
    "input_sign": "The input acts with the opposite sign of its recording, as where a drive turns the other way.",
    "sensor_sign": "The sensor has the opposite sign of the model.",
    "swapped_channels": "Two channels are exchanged: each has the name of the other.",
}


def kind(driving: bool, count: int) -> str:
    """What is wrong with one channel, or two: an input if it is `driving`, else a sensor."""
    return KINDS[2] if count > 1 else KINDS[0 if driving else 1]


RIVALS = {("input_sign", "sensor_sign"): "push it by hand to the side that the sensor calls positive"}
WHERE = {"swapped_channels": "two channels, their names joined by a comma"}
