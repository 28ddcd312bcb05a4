# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
Actuators that work on samples: a delay of whole samples, a hold, and a limit of the rate.

To the equations their signals are further inputs. The C takes them from the instance's own past (templates/sampled.c.j2);
here they are computed from whole recordings, for the batch library, and sample by sample, for the self-test.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..model import Input, Model, Sampled
from ..units import si
from .causalise import Causal

LAWS = ("delay", "held", "slew_limit")
LONGEST = 10_000  # samples

Array = NDArray[Any]
Problem = Callable[[tuple[str, ...], str, str], None]


def read(
    where: tuple[str, str], entry: dict[str, Any], unit: str, made_by: str, sample_time: float, rate: float, problem: Problem
) -> Sampled | None:
    """An actuator that delays, holds, or follows by at most `rate` [unit/s]; `made_by`: the law of the actuator that it acts on, empty for
    an input. None if it is wrong."""
    law, source = entry["law"], entry["input"]
    if made_by and made_by not in LAWS:
        remedy = f"let {source} act on what '{where[1]}' makes of the input, instead of the reverse"
        problem((*where, "input"), f"'{source}' is made by the law '{made_by}', and '{law}' acts on the samples of an input", remedy)
        return None
    limited = law == "slew_limit"
    for key in ("gain", "time", "start", "width", "limit", "samples" if limited else "rate"):
        if key in entry:
            problem(
                (*where, key),
                f"the law '{law}' has no {key}",
                "give a number of samples, such as samples = 5" if key == "time" else "remove it",
            )
    needed = {"delay": "samples", "slew_limit": "rate"}.get(law)
    if needed and needed not in entry:
        problem(where, f"'{needed}' is missing", f"add {needed} = ...")
        return None
    if limited and not rate > 0.0:
        problem((*where, "rate"), "is not above zero", "give a positive rate")
        return None
    samples = entry.get("samples", 1)
    if not 1 <= samples <= LONGEST:
        problem((*where, "samples"), f"{samples} is out of range", f"give a whole number of samples, 1 to {LONGEST}")
        return None
    return Sampled(where[1], source, law, samples * sample_time, unit, rate)


def as_inputs(model: Model, causal: Causal) -> tuple[Model, Causal]:
    """Both with the signals of these actuators behind the other inputs."""
    if not model.sampled:
        return model, causal
    whole = replace(model, inputs=(*model.inputs, *(Input(s.name, s.unit) for s in model.sampled)))
    return whole, replace(causal, model=whole)


def context(model: Model) -> dict[str, Any]:
    """
    What templates see of them.

    `of` and `at`: where in the inputs are source and signal; `word`, `ring`: where in the instance's past.
    """
    names = [i.name for i in model.inputs]
    found: list[dict[str, Any]] = []
    words = values = 0
    for s in model.sampled:
        n, short = samples(model, s), len(found)
        entry = {"name": s.name, "law": s.law, "samples": n, "unit": si(s.unit), "at": len(names) + short, "ring": values, "word": words}
        entry["of"] = names.index(s.source) if s.source in names else next(e["at"] for e in found if e["name"] == s.source)
        entry["most"] = s.rate * model.sample_time
        entry["text"] = {
            "delay": f"{s.source}, {n} sample{'s' * (n > 1)} late",
            "held": f"{s.source}, held for {n} sample{'s' * (n > 1)}",
            "slew_limit": f"{s.source}, followed by at most {s.rate:.6g} {si(s.unit)} per second",
        }[s.law]
        if s.law == "held" and n == 1:
            entry["word"] = None
        else:
            words += 1
        values += n if s.law == "delay" else 0
        found.append(entry)
    limits_rate = any(s.law == "slew_limit" for s in model.sampled)
    return {
        "sampled": found,
        "limits_rate": limits_rate,
        "words": words,
        "past_values": values,
        "n_in": f"{model.name.upper()}_N_{'IN' if found else 'U'}",
    }


def samples(model: Model, s: Sampled) -> int:
    """Its delay, or how long it holds, in samples of the model."""
    return max(round(s.time / model.sample_time), 1)


def beside(model: Model, u: Array) -> Array:
    """Inputs [..., n, n_u] with the signals of these actuators as further columns, as an instance makes them from the first sample
    on. Samples that are not finite are not received, and not counted."""
    if not model.sampled:
        return u
    columns = {i.name: u[..., j] for j, i in enumerate(model.inputs)}
    received: NDArray[np.bool_] = np.asarray(np.isfinite(u).all(axis=-1))
    count = np.cumsum(received, axis=-1) - 1  # number of the last sample received, counted from 0
    place = np.argsort(~received, axis=-1, kind="stable")  # of the samples received, the first ones
    for s in model.sampled:
        if s.law == "slew_limit":
            columns[s.name] = _followed(columns[s.source], received, s.rate * model.sample_time)
            continue
        n = samples(model, s)
        number = np.maximum(count - n if s.law == "delay" else count - count % n, 0)
        columns[s.name] = np.take_along_axis(columns[s.source], np.take_along_axis(place, number, axis=-1), axis=-1)
    return np.stack(list(columns.values()), axis=-1)


def _followed(u: Array, received: Array, most: float) -> Array:
    """What follows samples [..., n], those that are received, by at most `most` from one to the next."""
    found = np.empty_like(u)
    rows = zip(u.reshape(-1, u.shape[-1]), np.broadcast_to(received, u.shape).reshape(-1, u.shape[-1]), strict=True)
    for lane, (row, good) in enumerate(rows):
        values, now = [], None
        for x, there in zip(row.tolist(), good.tolist(), strict=True):
            if there:
                now = x if now is None else now + min(max(x - now, -most), most)
            values.append(x if now is None else now)
        found.reshape(-1, u.shape[-1])[lane] = values
    return found


class Past:
    """The same for one instance of a model, sample by sample; `entries` as `context` gives them."""

    def __init__(self, entries: list[dict[str, Any]]):
        self._entries, self._seen = entries, 0
        self._before: list[list[Any]] = [[] for _ in entries]  # samples of a source, or what is held

    def beside(self, u: Array) -> Array:
        """A sample [n_u] with their signals behind it."""
        whole = list(u)
        for entry, before in zip(self._entries, self._before, strict=True):
            source, n = whole[entry["of"]], entry["samples"]
            if entry["law"] == "slew_limit":
                most = u.dtype.type(entry["most"])
                way = source - before[0] if before else u.dtype.type(0)
                before[:] = [before[0] + min(max(way, -most), most) if before else source]
                whole.append(before[0])
            elif entry["law"] == "delay":
                before.append(source)
                whole.append(before[max(self._seen - n, 0)])
            else:
                before[:] = [source] if self._seen % n == 0 else before
                whole.append(before[0])
        self._seen += 1
        return np.array(whole, dtype=u.dtype)
