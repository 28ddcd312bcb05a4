# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A rig with one mass between a spring and a damper, driven by a measured force: the model file that several tests diagnose with."""

from __future__ import annotations

STEP = 2e-3  # s, of a sample


def model(mass: float, stiffness: float, damping: float, tolerance: float, sensors: str) -> str:
    """The model file: kg, N/m, N*s/m; `tolerance` of each of them; `sensors`: their table."""
    return f"""
[model]
name = "rig"
sample_time = "2 ms"
[parameters]
m = {{ value = {mass}, unit = "kg", tolerance = {tolerance} }}
k = {{ value = {stiffness}, unit = "N/m", tolerance = {tolerance} }}
d = {{ value = {damping}, unit = "N*s/m", tolerance = {tolerance} }}
[inputs]
push = {{ unit = "N" }}
[bodies]
mass = {{ mass = "m", position = "x", velocity = "v" }}
[elements]
spring = {{ between = ["mass", "ground"], law = "linear_spring", stiffness = "k" }}
damper = {{ between = ["mass", "ground"], law = "linear_damper", damping = "d" }}
drive = {{ between = ["mass", "ground"], law = "expression", force = "-push" }}
[outputs]
x = {{ value = "x", unit = "m" }}
[sensors]
{sensors}
"""
