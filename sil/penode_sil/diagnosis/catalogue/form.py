# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Forms of causes: each is a sum of laws at one place, or a fault of an input or a sensor."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from penode_gen import laws
from penode_gen.model import Model
from penode_gen.twins.numeric import along

from ..plant.plant import Place
from ..study.fit import Series
from . import memory

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Moved:
    """Deflection s, rate v [n] of a place along one recording, at times t [s] from 0 on; magnitudes of the `loads` [n] there and at places
    beside it, by their expressions. `left`: seconds of the recording behind its end, which are not looked at."""

    s: Array
    v: Array
    t: Array
    loads: Mapping[str, Array] = field(default_factory=dict)
    left: float = 0.0

    @property
    def step(self) -> float:
        return float(self.t[1] - self.t[0])

    def whole(self) -> Moved:
        """To the end of the recording, as if it went back as it came: heat goes on like that while nothing is looked at."""
        n = min(round(self.left / self.step), len(self.s) - 1)
        back = slice(-2, -2 - n, -1)
        t = self.t[0] + self.step * np.arange(len(self.t) + n)
        return Moved(np.concatenate([self.s, self.s[back]]), np.concatenate([self.v, -self.v[back]]), t)


@dataclass(frozen=True, eq=False)
class Motion:
    """A place along all recordings: rms of deflection and rate, and what they reach but for a thousandth of the time; `force`: rms of the
    force there already, about its mean."""

    parts: tuple[Moved, ...]
    s_rms: float
    v_rms: float
    s_reach: float
    v_reach: float
    force: float = 0.0

    @staticmethod
    def of(parts: Iterable[Moved], force: float = 0.0) -> Motion:
        parts = tuple(parts)
        s, v = (np.concatenate([getattr(p, k) for p in parts]) for k in "sv")
        s_rms, v_rms = (float(np.sqrt(np.mean(x**2))) for x in (s, v))
        s_reach, v_reach = (float(np.quantile(np.abs(x), 0.999)) for x in (s, v))
        return Motion(parts, s_rms, v_rms, s_reach, v_reach, force)

    @property
    def rates(self) -> Array:
        """Rates in all recordings [n]."""
        return np.concatenate([p.v for p in self.parts])

    @property
    def longest(self) -> float:
        """Length of the longest recording [s]."""
        return float(max(p.t[-1] for p in self.parts))


@dataclass(frozen=True, eq=False)
class Part:
    """One law of a form: a named one (penode_gen.laws), or an expression of s, v and its arguments. `gain`: which argument multiplies it,
    with its unit; `shapes`: the others, value and unit; `sign` of the gain (0: either); `fixed` shapes are no free values; those
    of `later` are, within a factor, once the form is accepted: before, its gain would be poorly known beside them. A shape stays within
    a factor of `span`: a bend that is far below the motion is an edge, and another kind. `edge`: a shape that only rounds a jump, within a
    factor of `rounds`, and may become as small as recordings ask for once the form is accepted. `kind`: what the law is by itself, where
    that is another cause. `load`: the expression whose magnitude an expression calls `load`. `includes`: a law that it has the curve of
    too. `takes`: the law of linear elements that it takes a share of; `own`: the parameter of such an element, and its value in the file,
    where it takes all of it: that is its gain, and the first free shape its size."""

    law: str
    gain: tuple[str, str]
    shapes: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    sign: int = 0
    fixed: tuple[str, ...] = ()
    span: float = 30.0
    rounds: float = 2.0
    edge: str = ""
    kind: str = ""
    load: str = ""
    includes: str = ""
    takes: str = ""
    own: tuple[str, float] | None = None
    later: Mapping[str, float] = field(default_factory=dict)

    @property
    def loose(self) -> list[str]:
        """Its shapes that are free values."""
        return [name for name in self.shapes if name not in self.fixed and name not in self.later]

    def along(self, m: Moved) -> Array:
        """Force [n] for gain 1."""
        shapes = {name: value for name, (value, _) in self.shapes.items()}
        known = laws.LAWS.get(self.law)
        if known and known.states:
            return memory.force(self.law, {self.gain[0]: 1.0, **shapes}, m.s, m.step)
        text = known.force if known else self.law
        values = {self.gain[0]: 1.0, **shapes, "s": m.s, "v": m.v, **({"load": m.loads[self.load]} if self.load else {})}
        return np.broadcast_to(along(text, tuple(values))(*values.values()), m.s.shape)


@dataclass(frozen=True, eq=False)
class Form:
    """A form of a kind at a place of the model (its index), an input or a sensor (its index): `how` is "force", or what is wrong with the
    input (a key of ACTUATORS, or "input_added": a `series`) or sensor ("scale", "late", "lag", "clip": beyond a `limit`). `limit`: where
    the fit of a value begins whose effect is not proportional to it. Of one family, forms stand for the same name. `alike`: kinds and
    places of what does the same beside another form."""

    kind: str
    where: str
    how: str
    index: int
    parts: tuple[Part, ...] = ()
    note: str = ""
    series: Series | None = None
    limit: float = 0.0
    alike: tuple[tuple[str, str], ...] = ()

    @property
    def at(self) -> int | str:
        """Where it is, whatever it is called there: the index of its place, or the name of its input or sensor."""
        return self.index if self.how == "force" else self.where

    @property
    def kinds(self) -> tuple[str, ...]:
        """The form's own kind, then the kinds of those of its laws that count as separate causes."""
        return tuple(dict.fromkeys([self.kind, *(p.kind for p in self.parts if p.kind)]))


@dataclass(frozen=True, eq=False)
class Sizes:
    """What a fit found of a form: v(part, argument); v.nominal(law, argument) is the sum of what the place has of a linear law already;
    `moving`: the model has bodies; `alone`: the value of a form of an input or a sensor; `first`: motion of the place along the first
    recording."""

    values: Mapping[tuple[int, str], float]
    own: Mapping[str, float]
    moving: bool
    alone: float = 0.0
    first: Moved | None = None

    def __call__(self, part: int, argument: str) -> float:
        return self.values[part, argument]

    def nominal(self, law: str, argument: str) -> float:
        return self.own.get(f"{law}.{argument}", 0.0)


class Kind(Protocol):
    """A file of the catalogue, for kinds of one curve. `forms` that may be at a place, given the motion of it; `MEANING` of each in a
    sentence; `sizes`: what a report gives of a form, name to unit and value (SI); `ONE`: only one of them is at a place, another one is but
    a form of it; `STRAIGHT`: kinds with a straight part, which a place shares with its linear elements; `LIKE_MASSES`: kinds that may do
    what another mass does."""

    KINDS: tuple[str, ...]
    MEANING: dict[str, str]

    @staticmethod
    def forms(model: Model, index: int, place: Place, motion: Motion) -> Iterable[Form]: ...

    @staticmethod
    def aside(form: Form) -> Form | None:
        """The same curve with its middle elsewhere, where that is a form; a file may be without this."""
        return None

    @staticmethod
    def fitted(form: Form, laws: Sequence[tuple[float, Part]], motion: Motion) -> str:
        """The kind of a form with its laws as they are fitted, each with its gain, empty where another form has their curve with fewer
        values; a file may be without this."""
        return form.kind

    @staticmethod
    def sizes(form: Form, v: Sizes) -> dict[str, tuple[str, float]]: ...
