# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a diagnosis says, and how it is written as diagnosis.json."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any

from ..compared import REJECTED, Compared, worsened
from ..recordings.measured import Measured

OUTSIDE = "outside_taxonomy"  # kind of an effect without a name
EXTENDED = "model_extended.toml"
NOT_NAMED = f"not named, but in {EXTENDED}"
SIZES = {"force", "stiffness", "damping", "mass", "bias", "offset", "delay", "lag", "scale", "gain"}
SIZES |= {"coefficient", "cubic", "quadratic", "difference"}  # of curves
NOTHING = {"scale": 1.0, "gain": 1.0}  # sizes without any effect; 0 for others
MAY_BE_NOTHING = f"may be nothing, by the 95 % interval of its size; {NOT_NAMED}"


@dataclass(frozen=True)
class Value:
    """A parameter in `unit`, with its 95 % interval."""

    value: float
    unit: str
    ci95: tuple[float, float]

    def may_be(self, x: float) -> bool:
        """Does the interval include x? So does one that could not be computed (NaN)."""
        return not (x < self.ci95[0] or self.ci95[1] < x)


@dataclass(frozen=True)
class Named:
    """A kind and the element, body or sensor where it is."""

    kind: str
    where: str


@dataclass(frozen=True)
class Cause:
    """A named cause. `confidence` 0..1 against the next best explanation; `alternatives` explain the data about as
    well, and `separate` says what excitation would tell them apart."""

    kind: str
    where: str
    parameters: dict[str, Value]
    confidence: float
    alternatives: tuple[Named, ...] = ()
    separate: str = ""

    def neutral(self, nominal: Mapping[str, float]) -> bool:
        """Does the interval of one of its sizes include what has no effect: 0, 1 of a scale, the `nominal` value of a parameter?"""
        none = {k: nominal.get(k, NOTHING.get(k, 0.0)) for k in self.parameters if k in nominal or k in SIZES or len(self.parameters) == 1}
        return any(self.parameters[k].may_be(x) for k, x in none.items())

    @property
    def may_be_nothing(self) -> bool:
        """Does the interval of its only size include no effect at all?"""
        return len(self.parameters) == 1 and all(v.may_be(NOTHING.get(k, 0.0)) for k, v in self.parameters.items())


UNKNOWN = Cause(OUTSIDE, "", {}, 0.5)  # one that is not in the catalogue


@dataclass(frozen=True)
class Gain:
    """RMS errors of one signal on data that were not used, with the generated C; `share` of the possible gain.
    `outside`: share of the samples at which an element moves farther or faster than in training."""

    before_rmse: float
    after_rmse: float
    noise_floor: float
    share_of_achievable: float | None
    unit: str
    outside: float
    share_ci95: tuple[float, float] | None = None

    @property
    def worsened(self) -> bool:
        """Is the extended model worse?"""
        return worsened(self.before_rmse, self.after_rmse)


@dataclass(frozen=True)
class Figure(Compared):
    """The same error of the nominal model with parameters within stated tolerances, start and offset as they fit best; of the written model
    as `penode simulate` gives it, with its parameter set `set`; and the noise."""

    refitted: float
    extended: float
    noise: float
    set: str = "default"


@dataclass(frozen=True)
class Recorded:
    """A recording that was used, with its faults. `role`: training or hold-out."""

    name: str
    role: str
    samples: int
    seconds: float
    problems: tuple[str, ...]

    @staticmethod
    def of(m: Measured, role: str) -> Recorded:
        return Recorded(m.title, role, len(m.time), float(m.time[-1] - m.time[0]), tuple(m.quality.problems))


@dataclass(frozen=True)
class Diagnosis:
    """See `penode diagnose`. `explained`: share of the avoidable residual that the causes take away in training;
    `residual`: where it is in time, frequency and state space (see residual.py); `shown`: the same sample by sample."""

    verdict: str
    causes: tuple[Cause, ...]
    gain: dict[str, Gain]
    numerics: dict[str, Any]
    explained: float
    evidence: float  # chi2 that the null fit leaves beyond the noise, in its standard deviations
    alike: float  # what sensors share of the residual that is left, in standard deviations of independent noise
    notes: tuple[str, ...] = ()
    data: tuple[Recorded, ...] = ()
    residual: dict[str, Any] = field(default_factory=dict)
    absorbed: dict[str, Any] = field(default_factory=dict)  # the same effect as a set of the running code, see absorb.py
    explanations: tuple[dict[str, Any], ...] = ()  # sets of causes that the recordings cannot tell apart, each with its posterior
    unlikely: dict[str, Any] = field(default_factory=dict)  # causes not named: such answers were wrong at least as often as right
    reliability: dict[str, Any] | None = None  # how often causes that were named as surely were right, see reliability.py
    advice: tuple[str, ...] = ()  # what to do next, the most useful first
    figures: tuple[Figure, ...] = ()  # of the written model, see checks
    simulated: str = ""  # options of `penode simulate` that give these figures
    model_file: str = EXTENDED  # what was learnt, in the folder of the answer
    seconds: float = field(default=0.0, compare=False)
    compile_seconds: float = field(default=0.0, compare=False)  # processor time of compilers, which the next call of its like needs not
    shown: Any = field(default=None, compare=False, repr=False)

    @property
    def rejected(self) -> bool:
        """Does the extended model predict worse than the nominal one?"""
        return self.model_file == REJECTED

    def as_json(self) -> dict[str, Any]:
        """All but `shown`, as plain data."""
        shallow = type(self)(**{f.name: getattr(self, f.name) for f in fields(self) if f.name != "shown"})
        return {k: v for k, v in asdict(shallow).items() if k != "shown"}


# -- words ------------------------------------------------------------------------------------------------------------

VERDICTS = {
    "no_discrepancy": "the model agrees with the recordings within noise and tolerances",
    "explained": "the model is wrong, and the causes named explain it",
    "partly_explained": "the model is wrong, and the causes named explain a part of it",
    "unexplained": "the model is wrong, and no known cause explains it",
    "not_identifiable": "something may be wrong, but these recordings cannot tell what",
}


PEOPLE = {"coulomb": "Coulomb", "stribeck": "Stribeck", "bouc wen": "Bouc-Wen", "maxwell": "Maxwell"}
PEOPLE |= {"outside taxonomy": "outside of the list"}


def plain(name: str) -> str:
    """The name of a kind in words: Coulomb friction for coulomb_friction."""
    text = name.replace("_", " ")
    for low, proper in PEOPLE.items():
        text = text.replace(low, proper)
    return text


def sigmas(evidence: float) -> str:
    """A number of standard deviations; beyond a thousand the exact number has no meaning."""
    return f"{evidence:.0f}" if evidence < 1000.0 else "more than 1000"


def place(kind: str, where: str) -> str:
    return f"{plain(kind)} at {where}" if where else plain(kind)
