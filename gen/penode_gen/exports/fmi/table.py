# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A table of variables of an FMU: each has a name and a place."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product, repeat
from math import prod
from typing import TypedDict, Unpack


@dataclass(frozen=True)
class Variable:
    """
    A variable; its elements, row by row, have the places [first, first + count) of templates/fmu_core.h.j2.

    `kind` is "real", "whole" or "choice" (of `choices`, from 1); `start` is None where the FMU computes the value.
    """

    key: str  # its group
    name: str
    first: int
    causality: str
    variability: str
    description: str
    unit: str = ""
    shape: tuple[int, ...] = ()
    start: tuple[float, ...] | None = None
    kind: str = "real"
    choices: tuple[str, ...] = ()
    minimum: float | None = None
    maximum: float | None = None

    @property
    def count(self) -> int:
        return prod(self.shape)

    @property
    def initial(self) -> str:
        """As in the standard; empty for the independent variable and for inputs, whose start is always exact."""
        return "" if self.causality in ("independent", "input") else "calculated" if self.start is None else "exact"

    @property
    def instant(self) -> bool:
        """Can it depend on an input at a communication point? What a filter gives comes from the step before."""
        return self.key not in ("filtered", "filter_status")

    @property
    def letter(self) -> str:
        return {"real": "r", "whole": "u", "choice": "e"}[self.kind]

    @property
    def start_text(self) -> str:
        """The start values with a blank between."""
        return " ".join(number(v, self.kind) for v in self.start or ())

    def elements(self) -> Iterator[tuple[str, int, float | None]]:
        """Name, place and start of each element: W[1,2] as FMI 2 and Modelica write it."""
        starts = repeat(None) if self.start is None else self.start
        indices = product(*([str(k + 1) for k in range(n)] for n in self.shape))
        names = (f"{self.name}[{','.join(index)}]" for index in indices) if self.shape else (self.name,)
        yield from zip(names, range(self.first, self.first + self.count), starts, strict=False)  # None is repeated without end

    def scalars(self, head: str, body: str) -> str:
        """
        The lines of all elements in FMI 2, with what they share: attributes, and the element inside.

        200 000 of them are too many for a template's loop.
        """
        before, between = '    <ScalarVariable name="', f" {head}><{body}"
        if self.start is None:
            return "".join(f'{before}{name}" valueReference="{place}"{between}/></ScalarVariable>\n' for name, place, _ in self.elements())
        kind = "choice" if self.kind == "choice" else "real"
        return "".join(
            f'{before}{name}" valueReference="{place}"{between} start="{number(start, kind)}"/></ScalarVariable>\n'
            for (name, place, _), start in zip(self.elements(), self.start, strict=True)
        )


def number(value: float, kind: str = "real") -> str:
    """The shortest text that is read as the same double, as XML has it."""
    return ("NaN" if math.isnan(value) else repr(float(value))) if kind == "real" else str(int(value))


class More(TypedDict, total=False):
    """Fields of a Variable that have a default."""

    unit: str
    shape: tuple[int, ...]
    start: tuple[float, ...] | None
    kind: str
    choices: tuple[str, ...]
    minimum: float | None
    maximum: float | None


class Table:
    """Variables one after the other, each at the first free place."""

    def __init__(self) -> None:
        self.variables: list[Variable] = []
        self.end = 0

    def add(self, key: str, name: str, causality: str, variability: str, description: str, **more: Unpack[More]) -> None:
        """One variable, scalar unless `more` has a shape."""
        self.variables.append(Variable(key, name, self.end, causality, variability, description, **more))
        self.end += self.variables[-1].count
