# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""One case: recordings, the hidden effects, and the truth about them. Everything follows from (seed, index)."""

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from . import faults, forces, memory, outside, plants  # noqa: F401 - the forms register themselves, in this order
from .bench import NOTHING, Bench, draw_bench, reach
from .effects import FORMS, OUTSIDE, Change, Form, places
from .plants import SIGNALS
from .solver import RATE, Motion

PATTERN = (  # the stratum of case i is PATTERN[i % 24]: 1/6 null, 1/2 with forms that no textbook has
    "single_foreign",
    "null",
    "single_common",
    "pair",
    "single_foreign",
    "hard",
    "single_common",
    "single_foreign",
    "outside",
    "null",
    "single_foreign",
    "single_common",
    "hard",
    "pair",
    "single_foreign",
    "null_hard",
    "single_common",
    "single_foreign",
    "triple",
    "hard",
    "null",
    "single_foreign",
    "single_common",
    "pair",
)
STRATA = tuple(dict.fromkeys(PATTERN))
KINDS = tuple(dict.fromkeys(f.kind for f in FORMS if f.kind != OUTSIDE))
BOUND = 50.0  # chi-square: below, an effect cannot be distinguished from noise with certainty, and "not identifiable" is right
APART = 30.0  # chi-square: a rival that leaves less of the effect unexplained is as good an answer
FAINT = 1000.0  # chi-square: below, every kind is tried as a rival
NEAR = {  # kinds that come near, beside wrong parameters, biases and scales, which are always tried
    "coulomb_friction": ("stribeck_friction", "bouc_wen"),
    "stribeck_friction": ("coulomb_friction", "bouc_wen"),
    "bouc_wen": ("coulomb_friction", "stribeck_friction", "maxwell_bushing"),
    "maxwell_bushing": ("bouc_wen", "hidden_resonance"),
    "hidden_resonance": ("maxwell_bushing",),
    "cubic_spring": ("bump_stop", "backlash"),
    "bump_stop": ("cubic_spring", "asymmetric_spring"),
    "asymmetric_spring": ("bump_stop", "cubic_spring"),
    "backlash": ("cubic_spring", "bouc_wen", "coulomb_friction"),
    "asymmetric_damper": ("quadratic_damper",),
    "degressive_damper": ("quadratic_damper", "coulomb_friction", "damper_fading"),
    "quadratic_damper": ("degressive_damper", "damper_fading"),
    "damper_fading": ("degressive_damper", "quadratic_damper"),
    "tyre_liftoff": ("tyre_nonlinear",),
    "tyre_nonlinear": ("tyre_liftoff",),
    "sensor_bias": ("constant_force",),
}
FAMILIES = (  # causes at the same time are of different families
    ("coulomb_friction", "stribeck_friction", "bouc_wen", "maxwell_bushing"),
    ("tyre_liftoff", "tyre_nonlinear", "tyre_damping"),
    ("degressive_damper", "quadratic_damper", "damper_fading", "asymmetric_damper"),
    ("constant_force", "sensor_bias"),
    ("cubic_spring", "bump_stop", "asymmetric_spring", "backlash"),
    ("sensor_scale", "wrong_parameter"),
    ("hidden_resonance",),
    ("sensor_delay", "sensor_clipping", "sensor_dropout"),
)
TOUCHES = {"c": "spring damper", "d": "spring damper", "c_t": "tyre", "m_b": "body", "m_w": "wheel", "m": "mass"}


@dataclass(frozen=True)
class Effect:
    form: Form
    where: str  # role of element, body, sensor or parameter
    size: float
    change: Change


@dataclass(frozen=True)
class Case:
    seed: int
    index: int
    stratum: str
    bench: Bench
    effects: tuple[Effect, ...]

    @property
    def changes(self) -> list[Change]:
        return [e.change for e in self.effects]

    def without(self, i: int) -> list[Change]:
        """All changes but one, each at its place, so that its random numbers stay."""
        return [NOTHING if k == i else c for k, c in enumerate(self.changes)]

    @cached_property
    def motions(self) -> list[Motion]:
        """Noise-free, of all recordings."""
        return [self.bench.move(d, self.changes) for d in self.bench.drives]

    @cached_property
    def differences(self) -> list[np.ndarray]:
        """What each effect changes in the training recordings, the others being there, in units of the noise."""
        if not self.effects:
            return []
        whole = self.bench.white([self.bench.observe(m, self.changes, i) for i, m in enumerate(self.motions[:-1])])
        return [whole - self.bench.response(self.without(i)) for i in range(len(self.effects))]

    def others(self, i: int) -> list[np.ndarray]:
        return [x for k, x in enumerate(self.differences) if k != i]

    @cached_property
    def energies(self) -> list[float]:
        """Chi-square of each effect after the nominal model and the sizes of the other effects are re-fitted."""
        found = [self.bench.left(x, self.others(i)) for i, x in enumerate(self.differences)]
        for i, e in enumerate(self.effects):
            for name, factor in e.change.factor.items():  # what is not linear in a large step is no evidence: a re-fit takes it
                step = self.bench.of_parameters[name] * (factor - 1.0)
                found[i] = min(found[i], self.bench.left(step, self.others(i)))
        return found

    def rivals(self, i: int) -> list[dict]:
        """Answers that leave less than APART of effect i unexplained: exact or near equivalents."""
        bench, effect, x, others = self.bench, self.effects[i], self.differences[i], self.others(i)
        if effect.form.kind == OUTSIDE or self.energies[i] < BOUND:
            return []
        tried = [("wrong_parameter", p, y) for p, y in bench.of_parameters.items()]
        tried += [(kind, s, y) for (kind, s), y in bench.of_sensors.items()]
        rng = np.random.default_rng([self.seed, self.index, 77, i])
        near = 3 * NEAR.get(effect.form.kind, ())  # three draws of gaps, time constants and so on
        for kind in near if self.energies[i] > FAINT else (*near, *KINDS):
            form = next(f for f in FORMS if f.kind == kind and f.common)
            for where in places(form, bench.plant, list(bench.noise)):
                build, size = form.make(rng, bench.place(where)), float(np.sqrt(form.sizes[0] * form.sizes[1]))
                try:
                    for _ in range(2):  # the second time about as strong as the effect
                        y = bench.response([build(size)], 2) - bench.linear
                        size = float(np.clip(size * np.sqrt(self.energies[i] / max(bench.left(y), 1e-9)), *form.sizes))
                except ArithmeticError:
                    continue
                tried.append((kind, where, y))
        if effect.form.kind == "constant_force" and bench.plant.kind == "quarter":  # a load of another course on the wheel
            tried += [
                ("constant_force", "wheel", bench.response([on(0.1)], 2) - bench.linear) for on in faults.courses(rng, bench.place("wheel"))
            ]
        if effect.form.kind == "sensor_bias":  # or a load that goes its way
            for where in {"quarter": ("body",), "mass": ("mass",)}.get(bench.plant.kind, ()):
                on = faults.going(rng, bench.place(where), lambda t: effect.change.sensor[effect.where](0.0 * t, None, 1 / (t[1] - t[0])))
                tried.append(("constant_force", where, bench.response([on(0.1)], 2) - bench.linear))
        found: dict[tuple[str, str], float] = {}
        hidden = {(e.form.kind, e.where) for e in self.effects}  # an answer names nothing twice
        for kind, where, y in tried:
            left = bench.left(x, [*others, y]) if (kind, where) not in hidden else np.inf
            if left < APART:
                found[kind, where] = min(left, found.get((kind, where), np.inf))
        answers = [{**self.answer(*key), "left": round(left, 1)} for key, left in found.items()]
        if ("sensor_bias", "deflection") in found and effect.form.kind == "constant_force":  # then a preload of the spring too
            answers.append({**self.answer("constant_force", "spring"), "left": round(found["sensor_bias", "deflection"], 1)})
        return answers

    def answer(self, kind: str, where: str) -> dict:
        """A cause in the names of the model file. Elements between the same ends are one place; no names: any place is right."""
        if kind == "wrong_parameter":
            return {"kind": kind, "where": [], "parameter": where}
        if kind == OUTSIDE or where == "motion":
            return {"kind": kind, "where": []}
        beside = ["spring", "damper", *(["drive"] if self.bench.plant.kind == "mass" else [])]
        same = beside if where in beside else ["mass", *beside] if (kind, where) == ("constant_force", "mass") else [where]
        return {"kind": kind, "where": [self.bench.plant.names[role] for role in same]}

    def lost(self, i: int) -> dict[str, float]:
        """The share of samples that drop-outs really took."""
        if self.effects[i].form.kind != "sensor_dropout":
            return {}
        full, rest = (
            [self.bench.observe(m, c, k)[self.effects[i].where] for k, m in enumerate(self.motions[:-1])]
            for c in (self.changes, self.without(i))
        )
        return {"share": float(np.mean(np.concatenate(full) != np.concatenate(rest)))}

    def truth(self) -> dict:
        """Everything that is known about the case; all values in SI."""
        bench, found = self.bench, []
        for i, e in enumerate(self.effects):
            values = {**e.change.parameters, **(e.change.memory(self.motions[0].memory) if e.change.memory else {}), **self.lost(i)}
            found.append(
                {
                    **self.answer(e.form.kind, e.where),
                    "form": e.form.name,
                    "common": e.form.common,
                    "size": e.size,
                    "energy": round(self.energies[i], 1),
                    "ratio": round(float(np.sqrt(self.energies[i] / bench.samples)), 3),
                    "parameters": {k: float(v) for k, v in values.items()},
                    "rivals": self.rivals(i),
                }
            )
        return {
            "seed": self.seed,
            "index": self.index,
            "stratum": self.stratum,
            "plant": bench.plant.kind,
            "effects": found,
            "bound": BOUND,
            "true_parameters": dict(bench.plant.true),
            "recordings": {d.file: d.label for d in bench.drives},
            "noise": {bench.plant.names[s]: n.rms for s, n in bench.noise.items()},
            "input_noise": bench.input_noise,
            **self.holdout(),
        }

    @cached_property
    def measured(self) -> list[tuple[np.ndarray, dict[str, np.ndarray]]]:
        """Input and signals as recorded, of every recording."""
        found = []
        for i, (drive, motion) in enumerate(zip(self.bench.drives, self.motions, strict=True)):
            rng, given = self.bench.rng(i, 99), drive.at_signals[0][:: int(RATE / self.bench.rate)]
            noise = {s: w.draw(rng, len(given)) for s, w in self.bench.noise.items()}
            found.append(
                (given + self.bench.input_noise * rng.standard_normal(len(given)), self.bench.observe(motion, self.changes, i, noise))
            )
        return found

    def holdout(self) -> dict:
        """For the gain: true signals, the residual that a perfect model keeps, and whether the hold-out stays in the trained range."""
        bench, drive = self.bench, self.bench.drives[-1]
        clean, (given, seen) = bench.observe(self.motions[-1], self.changes, len(bench.training)), self.measured[-1]
        error = np.fft.rfft(given - drive.at_signals[0][:: int(RATE / bench.rate)])  # of the input: a perfect model still hears it
        shaken = {s: np.fft.irfft(error * bench.transfer(len(given))[s], len(given)) for s in seen}
        floor = {bench.plant.names[s]: float(np.sqrt(np.mean((seen[s] - clean[s] - shaken[s]) ** 2))) for s in seen}
        trained, held = reach(bench.plant, self.motions[:-1], bench.training), reach(bench.plant, self.motions[-1:], [drive])
        inside = all(np.abs(h).max() <= np.abs(t).max() for e in trained for h, t in zip(held[e], trained[e], strict=True))
        return {
            "holdout_inside": bool(inside),
            "noise_floor": floor,
            "holdout_signals": {bench.plant.names[s]: [float(f"{v:.8g}") for v in x] for s, x in clean.items()},
        }

    def write(self, folder: Path) -> list[Path]:
        """model.toml and the recordings, as the explainer gets them. Returns the recordings; the hold-out is the last."""
        folder.mkdir(parents=True, exist_ok=True)
        bench, rng = self.bench, self.bench.rng(98)
        stated = {s: n.rms * rng.uniform(0.85, 1.2) for s, n in bench.noise.items()}
        (folder / "model.toml").write_text(plants.model_file(bench.plant, bench.rate, stated, bench.input_noise * rng.uniform(0.85, 1.2)))
        names, (role, unit) = bench.plant.names, plants.INPUT[bench.plant.kind]
        for drive, (given, seen) in zip(bench.drives, self.measured, strict=True):
            header = ["time [s]", f"{names[role]} [{unit}]", *(f"{names[s]} [{SIGNALS[bench.plant.kind][s][1]}]" for s in seen)]
            table = np.column_stack([np.arange(len(given)) / bench.rate, given, *seen.values()])
            np.savetxt(folder / drive.file, table, fmt="%.9g", delimiter=",", header=",".join(header), comments="")
        return [folder / d.file for d in bench.drives]


def draw_effect(rng: np.random.Generator, bench: Bench, form: Form, where: str, least: float) -> Effect:
    """An effect that stands out of the noise by a random ratio from `least` to 4, as far as its size stays plausible."""
    build, (low, high) = form.make(rng, bench.place(where)), form.sizes
    wanted = bench.samples * float(np.exp(rng.uniform(*np.log((least, 4.0))))) ** 2
    size = float(np.sqrt(low * high))
    for _ in range(4):
        try:
            energy = bench.left(bench.response([build(size)], 2) - bench.linear)
        except ArithmeticError:
            high, size = size / 2, size / 3
            continue
        if 0.5 < energy / wanted < 2:
            break
        size = float(np.clip(size * np.clip(np.sqrt(wanted / max(energy, 1e-9)), 0.02, 50), low, high))
    return Effect(form, where, size, build(size))


def rank(index: int) -> int:
    """How many cases of the same stratum come before."""
    own = PATTERN[index % len(PATTERN)]
    return index // len(PATTERN) * PATTERN.count(own) + PATTERN[: index % len(PATTERN)].count(own)


def kinds_of(seed: int, index: int) -> list[tuple[str, bool]]:
    """Kinds that hide in a case, and whether the form is a common one. Single effects take the kinds in turn."""
    stratum, rng = PATTERN[index % len(PATTERN)], np.random.default_rng([seed, index, 9])
    if stratum.startswith("null"):
        return []
    if stratum == "outside":
        return [(OUTSIDE, False)]
    if stratum in ("pair", "triple"):
        kinds = [str(rng.choice(FAMILIES[f])) for f in rng.permutation(len(FAMILIES))[: {"pair": 2, "triple": 3}[stratum]]]
        return [(k, k == "wrong_parameter" or rng.random() < 0.5) for k in kinds]
    turn = [k for k in KINDS if stratum != "single_foreign" or k != "wrong_parameter"]  # a wrong value has no other form
    kind = str(np.random.default_rng([seed, STRATA.index(stratum)]).permutation(turn)[rank(index) % len(turn)])
    return [(kind, stratum == "single_common" or kind == "wrong_parameter" or (stratum == "hard" and rng.random() < 0.5))]


def draw(seed: int, index: int, attempt: int) -> Case | None:
    """One attempt; None where a kind cannot be on the plant that was drawn, or two effects replace the same element."""
    stratum, rng = PATTERN[index % len(PATTERN)], np.random.default_rng([seed, index, attempt])
    forms = [[f for f in FORMS if f.kind == k and f.common == common] for k, common in kinds_of(seed, index)]
    chosen = [own[rng.integers(len(own))] for own in forms]
    chosen.sort(key=lambda f: f.kind == "wrong_parameter")  # last: one that another effect touches would hide there
    hard = "hard" in stratum
    kind = str(rng.choice(["quarter", "mass", "law"], p=[0.95, 0.05, 0.0] if hard else [0.75, 0.15, 0.1]))
    if any("tyre" in f.places or (kind == "law" and f.kind == "hidden_resonance") for f in chosen):
        kind = "quarter"
    bench = draw_bench(rng, (seed, index, attempt), kind, hard, any(f.kind == "tyre_liftoff" for f in chosen))
    found: list[Effect] = []
    for form in chosen:
        touched = {e.where for e in found}
        free = [p for p in places(form, bench.plant, list(bench.noise)) if not touched & set(TOUCHES.get(p, "").split())]
        if not free:
            return None
        where = free[rng.integers(len(free))]
        found.append(draw_effect(rng, bench, form, where, 0.04 if len(chosen) == 1 else 0.1))
    replaced = [law for e in found for law in e.change.laws if law in plants.ELEMENTS[kind]]
    return None if len(replaced) != len(set(replaced)) else Case(seed, index, stratum, bench, tuple(found))


def make(seed: int, index: int) -> Case:
    """The case with this number, of the draw with this seed. Up to eight attempts to have every effect above the bound."""
    best: Case | None = None
    for attempt in range(8):
        try:
            case = draw(seed, index, attempt)
            if case is not None and (best is None or min(case.energies, default=np.inf) > min(best.energies)):
                best = case
        except ArithmeticError:
            continue
        if best is not None and min(best.energies, default=np.inf) >= BOUND:
            return best
    if best is None:
        raise ArithmeticError(f"case {seed}:{index} failed in every attempt")
    return best


def write_truth(truth: dict, file: Path) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(truth))
