# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Timed parameter exchanges as calls of the generated interface, for SiL and PiL alike."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

import penode_gen
from penode_gen.model import Model

from .scenario import Exchange, Instance, staging_samples

KINDS = ("begin", "write", "commit", "abort", "select", "rollback", "hold", "state")


@dataclass(frozen=True, eq=False)
class Call:
    """One call before the step of `sample`. What else is needed depends on `kind`:

    begin: head (layout, length, id, checksum); write: offset and values; select: set (a name of the model's);
    hold: on; state: values (all states). commit, abort, rollback: nothing.
    """

    sample: int
    kind: str
    head: tuple[int, int, int, int] = (0, 0, 0, 0)
    offset: int = 0
    values: NDArray[Any] = field(default_factory=lambda: np.empty(0))
    set: str = ""
    on: bool = False


def exchange_calls(model: Model, exchange: Exchange, dtype: type) -> list[Call]:
    """The calls of one exchange. The last of them stands between the sample of its time and the next one."""
    last = round(exchange.time / model.sample_time) + 1
    if exchange.how == "rollback":
        return [Call(last, "rollback")]
    if exchange.how == "select":
        return [Call(last, "select", set=exchange.set)]
    values = np.asarray(penode_gen.set_values(model, exchange.set, dtype))
    first = last - staging_samples(values.size, exchange.chunk) + 1
    calls = [Call(first, "hold", on=True)] if exchange.hold else []
    calls.append(Call(first, "begin", head=penode_gen.set_head(model, exchange.set, dtype)))
    for n, offset in enumerate(range(0, values.size, exchange.chunk)):
        calls.append(Call(first + n, "write", offset=offset, values=values[offset : offset + exchange.chunk]))
    calls.append(Call(last, "commit"))
    return calls + ([Call(last, "hold", on=False)] if exchange.hold else [])


def instance_calls(model: Model, instance: Instance, initial: dict[str, float], dtype: type) -> list[Call]:
    """All calls of an instance in the order in which they are made."""
    calls = []
    if initial:
        start = dict(zip(model.states, model.start, strict=True)) | initial
        calls.append(Call(0, "state", values=np.array([start[name] for name in model.states], dtype=dtype)))
    return calls + [call for exchange in instance.exchanges for call in exchange_calls(model, exchange, dtype)]
