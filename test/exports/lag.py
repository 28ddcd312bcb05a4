# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A lag behind a network: the smallest model whose set has weights."""

from __future__ import annotations


def lag(name: str, network: str, tunable: bool = False) -> str:
    """The text of its model file; `network`: the file of the network of its default set."""
    return f"""[model]
name = "{name}"
sample_time = "1 ms"
[inputs]
u = {{ unit = "m" }}
[states]
x = {{ unit = "m" }}
[parameters]
T = {{ value = 1, unit = "s"{", tunable = true" if tunable else ""} }}
[networks]
n = {{ inputs = ["m"], output = "m" }}
[equations]
q = "der(x) = (n(u) - x)/T"
[outputs]
y = {{ value = "x", unit = "m" }}
[sets.default]
n = "{network}"
"""
