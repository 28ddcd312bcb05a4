# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""One wrong world: plant, excitation, mis-modelling, hidden effects; sizes set by simulating until they are what was drawn."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from . import effects, plants
from .effects import Array, At
from .plants import Site
from .signals import LEAD, RATE, beside, coloured, rms, roads, waves
from .solver import STEP, Law, Run, Runaway, run

EVERY = 8  # steps a sample: 500 Hz
SAMPLE = EVERY * STEP
LONG = {"train_1": 16.0, "train_2": 16.0, "holdout_1": 8.0}
WORTH = 0.12  # an effect is at least that share of the force at its place, so that a name is worth it
MAIN = ("quarter", "rig", "swing", "joint")
PATTERN = ("single", "null", "single", "pair", "single", "single", "null", "single", "pair", "single")  # the main draw, by index
STRATA = {
    "halfcar": ("coulomb_friction", "bump_stop", "inertia", "sensor_delay", ""),
    "drive": ("backlash", "cubic_spring", "coulomb_friction", ""),
}


@dataclass
class Effect:
    """A hidden effect: kind, site (or sensor, input, parameter), size x, sign and shape; the truth as far as it is known after settling."""

    kind: str
    site: str
    target: float
    x: float
    sign: float
    z: tuple[float, float]
    parameters: dict[str, float] = field(default_factory=dict)
    ratio: float = 0.0
    share: float = 0.0


@dataclass
class Record:
    """Excitation of one recording at the solver's step: inputs as the file has them, as they act without effects, gusts; start state."""

    u: Array
    error: Array  # [steps + 1, n_u], of unit size: the acting input is u + scale * error
    gust: Array  # [steps + 1]
    start: Array


class World:
    """Draws and settles one case. Everything follows from seed, index, stratum and attempt; `tolerances` False: the file states none."""

    def __init__(self, seed: int, index: int, stratum: str, tolerances: bool | None, attempt: int) -> None:
        key = sum(map(ord, stratum))
        self.seed, self.index, self.stratum = seed, index, stratum
        draw = np.random.default_rng([seed, index, key, attempt])
        self.group = PATTERN[index % len(PATTERN)] if stratum == "main" else ""
        name = MAIN[int(np.random.default_rng([seed, index, key]).integers(4))] if stratum == "main" else stratum
        self.kind = plants.MAKERS[name](draw)
        self.rng, self.draw = np.random.default_rng([seed, index, key, attempt, 1]), draw
        even = bool(np.random.default_rng([seed, index // 2, key, 3]).integers(2)) == bool(index % 2)
        self.tolerance = 0.03 if (even if tolerances is None else tolerances) else None
        self.e = float(draw.uniform(0.02, 0.05))
        self.true = {
            k: v if k in self.kind.exact else v * (1 + 0.01 * float(np.clip(draw.standard_normal(), -2, 2)))
            for k, (v, _) in self.kind.values.items()
        }
        self.effects = [self._effect(kind) for kind in self._kinds()]
        if self.effects:
            self.e = max(self.e, WORTH / min(x.target for x in self.effects))
        self.scale = dict.fromkeys(self.kind.sites, 1.0)
        self.mode = (0.01 * float(draw.uniform(0.7, 1.5)), float(draw.uniform(45, 90)))
        self.shape = {k: draw.uniform(0, 1, 4) for k in self.kind.sites}
        self.records = {k: self._record(s) for k, s in LONG.items() if k != "train_2" or name == "swing"}
        self.runs: dict[str, Run] = {}
        self._settle()

    def choices(self) -> list[str]:
        """Kinds that the plant may hide."""
        name = self.kind.name
        if name == "quarter":
            return [*effects.STRUT, *effects.TYRE, "hidden_resonance", "constant_force", "wrong_parameter", *effects.SENSOR]
        if name == "rig":
            return [*effects.STRUT, "hidden_resonance", "constant_force", "wrong_parameter", *effects.INPUT, *effects.SENSOR]
        if name == "joint":
            few = ["coulomb_friction", "stribeck_friction", "cubic_spring", "quadratic_damper", "bouc_wen", "backlash"]
            return [*few, "constant_force", "wrong_parameter", *effects.INPUT]
        return ["coulomb_friction", "cubic_spring", "quadratic_damper", "asymmetric_damper", "asymmetric_spring"]

    def _kinds(self) -> list[str]:
        if self.stratum != "main":
            kinds = STRATA[self.stratum]
            return [k for k in [kinds[self.index % len(kinds)]] if k]
        number = {"null": 0, "single": 1, "pair": 2}[self.group]
        return [str(k) for k in self.draw.choice(self.choices(), number, replace=False)]

    def _effect(self, kind: str) -> Effect:
        sites, pick = self.kind.sites, self.draw
        struts = [k for k, (s, _) in sites.items() if s.spring and s.road < 0]
        bodies = [k for k, (s, _) in sites.items() if s.coordinate >= 0]
        if kind == "inertia":
            kind, site = "wrong_parameter", "J"
        elif kind == "wrong_parameter":
            site = str(pick.choice([k for k in self.kind.values if k not in self.kind.exact and k != "m_w"]))
        elif kind in effects.TYRE:
            site = "tyre"
        elif kind in effects.SENSOR:
            site = str(pick.choice(list(self.kind.sensors)))
        elif kind in effects.INPUT:
            site = next(iter(self.kind.inputs))
        elif kind in ("hidden_resonance", "constant_force"):
            site = bodies[0]
        else:
            site = "load" if self.stratum == "drive" and kind == "coulomb_friction" else str(pick.choice(struts))
        ratio = float(np.exp(pick.uniform(np.log(3.2), np.log(9.4))))
        sign = 1.0 if kind == "wrong_parameter" and site in ("J_m",) else float(pick.choice([-1.0, 1.0]))
        return Effect(kind, site, ratio, 1.0, sign, (float(pick.random()), float(pick.random())))

    def _record(self, seconds: float) -> Record:
        rng, kind = self.rng, self.kind
        n = round((seconds + LEAD) * RATE) + 1
        first = np.zeros(2 * len(kind.masses))
        u, error = np.zeros((n, len(kind.inputs))), np.zeros((n, len(kind.inputs)))
        if kind.name == "swing":
            first[0] = rng.choice([-1, 1]) * rng.uniform(0.7, 1.2)
        elif kind.drive() >= 0:
            p, inertia = kind.values, kind.values[kind.masses[0][1]][0]
            size = 0.4 * p["k"][0] if kind.turning else 0.01 * p["k"][0]
            band = (0.5, 12.0) if kind.name == "drive" else (0.3, 2.0) if kind.turning else (0.5, 8.0)
            size = inertia * (8.0 if kind.name == "drive" else 0.0) or size
            u[:, 0] = size * waves(rng, seconds, *band, 0.6)
            error[:, 0] = effects.held(u[:, 0], int(0.005 * RATE)) - u[:, 0]
        else:
            roads(rng, u, error, seconds)
        return Record(u, error, coloured(rng, n), first)

    # -- settling: laws at their sizes, simulated, sizes corrected ------------------------------------------------------

    def _at(self, name: str, effect: Effect) -> At:
        site, r = self.kind.sites[name][0], self.runs["train_1"]
        p = {k: v for k, (v, _) in self.kind.values.items()}
        return At(
            rms(self.first.s[name]),
            rms(self.first.v[name]),
            self._force(name, self.first),
            p.get(site.spring, 0.0),
            p.get(site.damper, 0.0),
            LONG["train_1"] + LEAD + 0 * len(r.q),
            effect.sign,
            effect.z,
        )

    def _force(self, name: str, r: Run) -> float:
        """RMS of the force at a site: of its elements, or of the inertia where it has none."""
        site = self.kind.sites[name][0]
        f = sum((r.force[i] for i, law in enumerate(self.plant.laws) if law.place == name and law.role == "nominal"), np.zeros(len(r.q)))
        if site.spring or site.damper:
            return rms(f)
        return rms(r.ddq[:, site.coordinate]) * self.true[self.kind.masses[site.coordinate][1]]

    def _build(self) -> None:
        """The plant with effects and mis-modelling at their present sizes."""
        p = dict(self.true)
        for e in self.effects:
            if e.kind == "wrong_parameter":
                p[e.site] = self.kind.values[e.site][0] * max(1 + e.sign * 0.3 * e.x, 0.3)
                e.parameters = {e.site: p[e.site]}
        plant = self.plant = self.kind.plant(p)
        share, frequency = self.mode
        if self.kind.name != "swing":
            on = plant.add_mass(share * plant.inertia[0], 0)
            w = 2 * np.pi * frequency
            plant.laws.append(Law(on, "linear", [share * plant.inertia[0] * w * w, 0.06 * share * plant.inertia[0] * w], "mode"))
        if not self.runs:
            return
        for name, (site, _) in self.kind.sites.items():
            s, v, f = rms(self.first.s[name]), rms(self.first.v[name]), self._force(name, self.first)
            z, size = self.shape[name], self.scale[name] * 0.03 * f
            if site.spring:
                plant.laws.append(Law(name, "wave", [size * (0.5 + z[0]), s * (0.4 + 0.4 * z[1]), 2 * z[2]], "mis"))
            if site.damper:
                plant.laws.append(Law(name, "rub", [size * (0.3 + 0.7 * z[3]), v], "mis"))
                if z[0] > 0.5:
                    rate = min((500 + 400 * z[1]) / self.scale[name], 5e3)  # 1/s; 1.25 a step, stable up to 2.5
                    plant.laws.append(Law(name, "mount", [p[site.damper], p[site.damper] * rate], "mis"))
        for i, e in enumerate(self.effects):
            self._add(i, e)

    def _add(self, i: int, e: Effect) -> None:
        role = f"effect{i}"
        if e.kind in effects.FORCES:
            law, numbers, e.parameters = effects.FORCES[e.kind](self._at(e.site, e), e.x)
            self.plant.laws.append(Law(e.site, law, numbers, role))
        elif e.kind == "hidden_resonance":
            on = self.kind.sites[e.site][0].coordinate
            own = rms(self.first.ddq[:, on]) / max(rms(self.first.dq[:, on]), 1e-12)
            mass, w, zeta = 0.1 * e.x * self.plant.inertia[on], own * (0.9 + 0.6 * e.z[0]), 0.05 + 0.1 * e.z[1]
            self.plant.laws.append(Law(self.plant.add_mass(mass, on), "linear", [mass * w * w, 2 * zeta * mass * w], role))
            e.parameters = {"mass": mass, "frequency": w / 2 / np.pi, "damping_ratio": zeta}

    def _acts(self, record: Record) -> tuple[Array, Array]:
        """Inputs and outer forces that act in a recording."""
        u = record.u.copy()
        for e in self.effects:
            if e.kind in effects.INPUT:
                u[:, 0], e.parameters = effects.input_changed(e.kind, u[:, 0], e.x, e.sign, RATE, self.records["train_1"].u[:, 0])
        ext = np.zeros((len(record.gust), len(self.plant.inertia)))
        for name, (site, _) in self.kind.sites.items():
            if site.road >= 0:
                u[:, site.road] += self.scale[name] * record.error[:, site.road]
            if site.coordinate >= 0 and self.runs:
                ext[:, site.coordinate] += self.scale[name] * 0.02 * self._force(name, self.first) * record.gust
                if site.coordinate == 0 and (k := self.kind.drive()) >= 0:
                    ext[:, 0] += self.actuator * record.error[:, k]
        return u, ext

    def _simulate(self, name: str) -> Run:
        record = self.records[name]
        u, ext = self._acts(record)
        start = np.zeros(2 * len(self.plant.inertia))
        n = len(self.kind.masses)
        start[:n] = record.start[:n]
        return run(self.plant, u, ext, start, EVERY)

    def wrong(self, name: str) -> Array:
        """Force of all mis-modelling at a site in the first training recording, without what its parameters may take."""
        r, rec = self.runs["train_1"], self.records["train_1"]
        site = self.kind.sites[name][0]
        f = sum((r.force[i] for i, law in enumerate(self.plant.laws) if law.place == name and law.role == "mis"), np.zeros(len(r.q)))
        if site.coordinate >= 0:
            f = f - self.scale[name] * 0.02 * self._force(name, self.first) * rec.gust[::EVERY]
            if site.coordinate == 0 and (k := self.kind.drive()) >= 0:
                f = f - self.actuator * rec.error[::EVERY, k]
        if site.road >= 0:
            f = f - self.true[site.spring] * self.scale[name] * rec.error[::EVERY, site.road]
        return beside(f, *self.columns(name))

    def columns(self, name: str) -> list[Array]:
        """What free parameters of a site may take: deflection (or its sine) beside a spring, rate beside a damper, else acceleration."""
        site, r = self.kind.sites[name][0], self.runs["train_1"]
        spring = np.sin(r.s[name]) if name == self.kind.sine else r.s[name]
        both = [spring] * bool(site.spring) + [r.v[name]] * bool(site.damper)
        return both or [r.ddq[:, site.coordinate]]

    def effect_size(self, i: int) -> tuple[float, float]:
        """Size of an effect: force (or signal) RMS over that of the mis-modelling at its place, and over the force there."""
        e, r = self.effects[i], self.runs["train_1"]
        if e.kind in effects.SENSOR:
            y = self._clean(r, e.site)
            change = rms(effects.sensor_changed(e.kind, y, e.x, e.sign, 1 / SAMPLE)[0] - y) / max(float(np.std(y)), 1e-30)
            return change / self.e, change
        place = e.site
        if e.kind in effects.INPUT:
            place = next(k for k, (s, _) in self.kind.sites.items() if s.coordinate == 0)
            f = effects.input_changed(e.kind, self.records["train_1"].u[:, 0], e.x, e.sign, RATE)[0] - self.records["train_1"].u[:, 0]
        elif e.kind == "wrong_parameter":
            place, column = self._column(e.site, r)
            f = (self.plant_value(e.site) - self.kind.values[e.site][0]) * column
        else:
            f = next(r.force[j] for j, law in enumerate(self.plant.laws) if law.role == f"effect{i}")
            f = beside(f, *self.columns(place)) if e.kind != "constant_force" else f
        return rms(f) / rms(self.wrong(place)), rms(f) / self._force(place, r)

    def plant_value(self, parameter: str) -> float:
        """True value of a parameter."""
        hidden = {k: v for e in self.effects if e.kind == "wrong_parameter" for k, v in e.parameters.items()}
        return {**self.true, **hidden}[parameter]

    def _column(self, parameter: str, r: Run) -> tuple[str, Array]:
        """Where a parameter acts and what it multiplies."""
        for name, (site, _) in self.kind.sites.items():
            if parameter == site.spring:
                return name, np.sin(r.s[name]) if name == self.kind.sine else r.s[name]
            if parameter == site.damper:
                return name, r.v[name]
        body = next(i for i, (_, mass) in enumerate(self.kind.masses) if mass == parameter)
        return next(k for k, (s, _) in self.kind.sites.items() if s.coordinate == body), r.ddq[:, body]

    def _settle(self) -> None:
        """Simulate, compare sizes with those drawn, correct, until all are within 4 %."""
        self.actuator = 0.0
        self._build()
        self.runs["train_1"] = self.first = self._plain()
        base = next((k for k, (s, _) in self.kind.sites.items() if s.coordinate == 0), "")
        if (k := self.kind.drive()) >= 0:
            self.actuator = 0.015 * self._force(base, self.first) / max(rms(self.records["train_1"].error[:, k]), 1e-30)
        self.actuator_base = self.actuator
        for _ in range(14):
            self._build()
            self.runs["train_1"] = self._simulate("train_1")
            worst = 0.0
            for name in self.kind.sites:
                now = rms(self.wrong(name)) / self._force(name, self.runs["train_1"])
                factor = self.e / now
                worst = max(worst, abs(factor - 1))
                self.scale[name] *= float(np.clip(factor, 0.4, 2.5))
                if name == base:
                    self.actuator = self.actuator_base * self.scale[name]
            for i, e in enumerate(self.effects):
                e.ratio, e.share = self.effect_size(i)
                factor = e.target / max(e.ratio, 1e-9)
                worst = max(worst, abs(factor - 1))
                e.x *= float(np.clip(factor, 0.5, 1.8)) ** 0.8
                if e.x > LIMIT.get(e.kind, 8.0):
                    raise Runaway
            if worst < 0.04:
                break
        else:
            raise Runaway
        self._build()
        self.runs = {**self.runs, **{k: self._simulate(k) for k in self.records}}
        for i, e in enumerate(self.effects):
            e.ratio, e.share = self.effect_size(i)
            if e.kind == "asymmetric_damper" and min(e.parameters.values()) < 0.0:
                raise Runaway  # it would drive

    def _plain(self) -> Run:
        hidden, self.effects = self.effects, []
        found = self._simulate("train_1")
        self.effects = hidden
        return found

    # -- what is written ---------------------------------------------------------------------------------------------

    def _clean(self, r: Run, sensor: str) -> Array:
        _, _, what, row = self.kind.sensors[sensor]
        return (r.q if what == "q" else r.ddq)[:, : len(row)] @ np.array(row)

    def table(self, name: str, noise: dict[str, float]) -> tuple[str, Array]:
        """Header and columns of a recording."""
        r, rng = self.runs[name], np.random.default_rng([self.seed, self.index, len(name), 9])
        skip = 0 if self.kind.name == "swing" else int((LEAD - 0.2) / SAMPLE)
        columns, heads = [np.arange(len(r.q)) * SAMPLE], ["time [s]"]
        for k, (head, unit) in enumerate(self.kind.inputs.items()):
            columns.append(self.records[name].u[::EVERY, k])
            heads.append(f"{head} [{unit}]")
        for sensor, (_, unit, _, _) in self.kind.sensors.items():
            y = self._clean(r, sensor)
            for e in self.effects:
                if e.kind in effects.SENSOR and e.site == sensor:
                    y, e.parameters = effects.sensor_changed(e.kind, y, e.x, e.sign, 1 / SAMPLE, self._clean(self.runs["train_1"], sensor))
            columns.append(y + noise[sensor] * rng.standard_normal(len(y)))
            heads.append(f"{sensor} [{unit}]")
        out = np.column_stack(columns)[skip:]
        out[:, 0] -= out[0, 0]
        return ",".join(heads), out

    def noise(self) -> dict[str, float]:
        """Standard deviation of each sensor: 0.1 to 0.5 % of its signal."""
        rng = np.random.default_rng([self.seed, self.index, 8])
        return {k: float(np.std(self._clean(self.runs["train_1"], k)) * 10 ** rng.uniform(-3, -2.3)) for k in self.kind.sensors}

    def write(self, folder: Path) -> list[Path]:
        """Model file and recordings; the last one is the hold-out."""
        folder.mkdir(parents=True, exist_ok=True)
        noise, paths = self.noise(), []
        for name in self.records:
            head, table = self.table(name, noise)
            paths.append(folder / f"{name}.csv")
            np.savetxt(paths[-1], table, "%.9g", ",", header=head, comments="")
        (folder / "model.toml").write_text(plants.model_text(self.kind, self.tolerance, noise, SAMPLE))
        return paths

    def places(self, e: Effect) -> list[str]:
        """All words for the place of an effect: elements between the same ends, the body where the other end is ground."""
        if e.kind in effects.SENSOR:
            return [e.site]
        if e.kind in effects.INPUT:
            return [e.site, "actuator"]
        return [] if e.kind == "wrong_parameter" else [e.site, *self.kind.sites[e.site][0].elements]

    def companions(self, e: Effect) -> list[str]:
        """Parameters whose value beside an asymmetric curve is a convention: it may be that of either side, or of their mean."""
        site = self.kind.sites.get(e.site, (Site(()), ()))[0]
        return [{"asymmetric_spring": site.spring, "asymmetric_damper": site.damper}[e.kind]] if e.kind.startswith("asymmetric") else []


LIMIT = effects.LIMITS


def make(seed: int, index: int, stratum: str = "main", tolerances: bool | None = None) -> World:
    """The case; sizes that physics does not allow there are drawn again."""
    for attempt in range(40):
        try:
            return World(seed, index, stratum, tolerances, attempt)
        except (Runaway, FloatingPointError, np.linalg.LinAlgError):
            continue
    raise Runaway(f"{seed}:{index}")


def write_truth(truth: dict, path: Path) -> None:
    """The truth as JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(truth, indent=1))
