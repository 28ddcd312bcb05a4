# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Which causes: a search that scores all hypotheses at once (score), fits the best few by simulation, and looks again.

A cause is a curve, not a formula: a kind takes up to TERMS elementary laws, and another kind comes in only by what no curve
of the first one's family at the same place could do. Explanations are compared by their likelihood, each with the noise that
suits it, so that slow noise and a cause compete like any two causes.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from penode_gen.model import Model

from .build import Extended, Term, all_free, extended
from .fit import Fit, Problem
from .hypotheses import BENDS, CLOCK, HALVES, KNEE, STRIBECK, VALUED, Basis, Fault
from .naming import DAMPERS, FRICTION, straight, with_kinds
from .noise import ALIKE, correlation
from .score import DAMPINGS, RESONANCES, Candidate, Regression, where
from .study import Study, loss, noise_of, regression, with_noise_of

GRAVITY = 9.81  # [m/s^2]
SHARP = 3.0  # of a sensor's limits, to begin with
BENT = 0.1  # more of a signal at its largest, to begin with
TERMS = 3  # elementary laws of one kind
WANDERING = 5  # and of a bias, which may go any slow way
CHANCE = 3.0  # deviations of chi2
COST = 10.0  # chi2 that an elementary law must gain for each of its numbers, and the choice among many
NEW = 50.0  # chi2 that a further kind must gain beyond that
FORM = 7e-4  # of what has been gained: a number more must gain that, or it only mends the form
OCTAVE = 2.0  # factor of frequency, within which another form of a hidden mass is seen
CLOSED = 1e-4  # of what there is to gain: a fit that gains less by an iteration is good enough to be compared
LEAST = 1e-3  # of what has been gained: less, beside a curve, is a matter of its memory that no family has
CURVES = {  # kinds of one family at one place are one curve with one name
    "coulomb_friction": "friction", "stribeck_friction": "friction", "bouc_wen": "friction",
    "degressive_damper": "damper", "quadratic_damper": "damper", "asymmetric_damper": "damper", "damper_fading": "damper",
    "cubic_spring": "spring", "asymmetric_spring": "spring", "bump_stop": "spring", "backlash": "spring",
    "network_extrapolation": "spring",
    "tyre_nonlinear": "tyre", "tyre_liftoff": "tyre",
}  # fmt: skip
SHAPED = {*FRICTION, *DAMPERS} - {"bouc_wen"}  # kinds whose names follow from the shape of a curve alone, whatever laws it is made of
FILTER = 0.93  # of what two hidden masses gain: where one gains less, they are a filter that stands for other dynamics
RIVAL = 0.8  # of a cause's worth: what another must explain of it to be tried in its place
KEPT = 0.5  # of what a regression promises: a fit that keeps less than that of it began in the wrong place
MAX_LOSS = 0.3  # of all that was gained: an explanation that gains less by that is not gone on with
SMALL = 0.03  # of all that was gained: a cause worth less than that may be a remainder of another
PART = 0.1  # of the size a law has alone: left to it where its companions do the rest
WHOLE = 0.97  # share that is a whole explanation
NEAR = 0.1  # of what there is to be explained: two explanations that differ less may change places with more laws
REST = 0.5  # of the noise: a load at rest that leaves so much more than a start in motion is none
CLOSE = 0.02  # of the gain: an exchanged cause that is nearly as good gets more laws
MIN_TAKEN = 0.5  # of what is more than noise
DOUBLE = 0.5  # of the noise: a residual with less on top of it is noise of a colour
HOPELESS = 0.3  # of what is more than noise: causes that take less have no name, whatever is exchanged among them
MENDS = 4  # laws, at most, that only mend the form of what is named
STIFF = 1.5  # of the highest frequency of hidden masses: one that a fit has taken beyond it moves with its body
MASS_FREQUENCIES = (8.0, 16.0, 30.0)  # [Hz] frequencies to begin with of a mass that may be on a spring
WEAK = 2.0  # times the cost of a law: if to first order it is worth less, it may not be worth it
HEAVY = 2e6  # steps for all derivatives: where it takes more, only the best explanation is gone on with, and with one rival of a cause
ROUGH = 5e5  # the same: where it takes more, fits begin with longer steps
LABOUR = 1.5e6  # the same: where it takes more, one law is enough to mend the form of what is named
SLACK = 10.0  # of score, that a textbook law may be worse by
TEXTBOOK = {
    "bump_stop": ("bump_stop", "rebound_stop"), "cubic_spring": ("cubic_spring",), "backlash": ("backlash",),
    "asymmetric_spring": (BENDS["s"], "linear_spring"), "asymmetric_damper": (BENDS["v"], "linear_damper"),
    "coulomb_friction": ("coulomb_friction",), "bouc_wen": ("bouc_wen_loop",), "maxwell_bushing": ("maxwell_bushing",),
    "stribeck_friction": (STRIBECK,), "quadratic_damper": ("quadratic_damper",), "tyre_nonlinear": ("quadratic_spring",),
    "degressive_damper": (KNEE,), "damper_fading": ("heating_damper",), "tyre_damping": ("linear_damper",),
}  # fmt: skip
TAKING = {  # laws that take an element away: its law and argument
    "backlash": ("linear_spring", "stiffness"),
    "liftoff": ("linear_spring", "stiffness"),
    "loose_damper": ("linear_damper", "damping"),
    **dict.fromkeys(HALVES, ("linear_spring", "stiffness")),
}
LINES = {"linear_spring": ("stiffness", "N/m"), "linear_damper": ("damping", "N*s/m")}  # laws and their gains
LINES_OF = {"spring": "linear_spring", "damper": "linear_damper"}
TWO = ("asymmetric_spring", "asymmetric_damper")  # of two numbers, and the nominal element is hardly their mean
EXACT = ("wrong_parameter", "constant_force", "hidden_resonance", CLOCK)  # a formula after all
SINGLE = ("wrong_parameter", "hidden_resonance", CLOCK)  # kinds that have one law only
FORMULAS = ("wrong_parameter", "constant_force", "sensor_bias", "sensor_scale", "sensor_delay")  # and of one number
LOADS = {"constant_force", "sensor_bias"}  # one looks like the other
Group = tuple[str, str]


@dataclass(frozen=True, eq=False)
class Explanation:
    """Some causes, fitted. `gain`: fall of the loss against the null fit, `formulas` the part of it that causes had taken which are
    formulas and leave no form to mend; `score`: gain less what the freedom is worth."""

    terms: tuple[Term, ...]
    built: Extended
    problem: Problem
    fit: Fit
    gain: float
    formulas: float = 0.0

    def whole(self) -> Explanation:
        """With all derivatives."""
        return replace(self, fit=self.problem.complete(self.fit))

    @property
    def groups(self) -> tuple[Group, ...]:
        return tuple(dict.fromkeys(t.group for t in self.terms))

    @property
    def freedom(self) -> float:
        """What its numbers are worth in chi2."""
        return sum(cost(t.candidate) - COST * bool(t.own) for t in self.terms)

    @property
    def price(self) -> float:
        """And its causes."""
        return self.freedom + NEW * len(self.groups)

    @property
    def score(self) -> float:
        form = 0.0
        plain = len(self.terms) == len(self.groups) and all(kind in (*EXACT, *FORMULAS) for kind, _ in self.groups)
        slow = all(kind == "sensor_bias" or kind in EXACT for kind, _ in self.groups)  # a bias is no form, however it wanders
        filtering = sum(t.candidate.kind == "hidden_resonance" for t in self.terms) > 1  # a second mass may be any form of the first
        if not plain and not slow or filtering:
            bent = self.gain - (0.0 if filtering else self.formulas)
            numbers = self.freedom / COST - sum(t.candidate.kind == "constant_force" for t in self.terms)  # see cost
            form = (FORM * numbers + LEAST * (len(self.groups) - 1)) * bent
        return self.gain - self.price - max(form, 0.0)


def rows(study: Study) -> float:
    """Chi2 that noise leaves."""
    return len(study.null.residual) * float(np.mean([np.mean(e.good) for e in study.experiments]))


def only_noise(study: Study, e: Explanation) -> bool:
    """Is what an explanation leaves no more than noise? Of few chi2 it is, what a wrong form leaves is hundreds of deviations more."""
    return e.fit.chi2 < rows(study) + CHANCE * np.sqrt(2.0 * rows(study))


def exact(groups: Sequence[Group]) -> bool:
    """Are all of them formulas, that leave nothing of themselves to others?"""
    return all(kind in EXACT for kind, _ in groups)


def cost(c: Candidate) -> float:
    """What the freedom of an elementary law is worth in chi2."""
    if isinstance(c.what, tuple):
        return 4.0 * COST  # three numbers, found among hundreds of places in the spectrum
    own = 2.0 if c.kind == "constant_force" else 1.0  # where a bias explains as much, it is the bias
    return COST * (own + (len(c.what.shapes) if isinstance(c.what, Basis) else 0))


def pools(r: Regression) -> dict[Group, list[int]]:
    """The candidates of each kind and place."""
    found: dict[Group, list[int]] = {}
    for k, c in enumerate(r.candidates):
        found.setdefault((c.kind, c.where), []).append(k)
    return found


def room(kind: str) -> int:
    """How many elementary laws a kind may take at first."""
    return WANDERING if kind == "sensor_bias" else TERMS


def pursue(r: Regression, pool: Sequence[int], base: Sequence[int] = (), terms: int = TERMS, alone: bool = True) -> tuple[float, list[int]]:
    """Gain and choice of up to `terms` candidates of a pool beside `base`, the best next one at a time; not `alone`: beside others of
    their kind, so the first may be a companion."""
    chosen: list[int] = []
    costs = {p: cost(r.candidates[p]) for p in pool}
    gain = start = r.gain(base)[0] if base else 0.0
    while len(chosen) < (room(r.candidates[chosen[0]].kind) if chosen and terms == TERMS else terms):
        usable = [p for p in pool if p not in chosen and (chosen or not alone or not r.candidates[p].companion)]
        if chosen and r.candidates[chosen[0]].kind == "hidden_resonance":
            break  # one mass; a second would be any filter
        step, best = r.best_single([*base, *chosen], usable, costs)
        if best < 0:
            break
        new = r.gain([*base, *chosen, best])[0]
        enough = 2e-3 * (gain - start) if chosen and r.candidates[chosen[0]].kind != "sensor_bias" else 0.0  # which is of no form
        if new - gain < max(costs[best], enough):
            break
        gain, chosen = new, [*chosen, best]
    return gain - start, chosen


def pair(r: Regression) -> tuple[float, list[int]]:
    """Worth and choice of the best two causes that are formulas: a curve may look like both together."""
    plain = [k for k, c in enumerate(r.candidates) if c.kind in FORMULAS and not c.companion and r.alive[k]]
    worth = {k: r.gain([k])[0] - cost(r.candidates[k]) for k in plain}
    plain = [k for k in plain if worth[k] > 0.0]
    best = 0.0, []
    for i, k in enumerate(plain):
        for j in plain[:i]:
            if (r.candidates[k].kind, r.candidates[k].where) != (r.candidates[j].kind, r.candidates[j].where):
                found = r.gain([j, k])[0] - sum(cost(r.candidates[x]) for x in (j, k)) - 2.0 * NEW
                if found > max(best[0], worth[j], worth[k]):
                    best = found, [j, k]
    return best


def explain(
    study: Study, terms: Sequence[Term], iterations: int = 12, start: Fit | None = None, formulas: float = 0.0
) -> Explanation:
    """Fit some terms by simulation, with everything else from where a fit has left it. What ends without force is left out."""
    recordings = len(study.experiments)
    built = extended(study.model, study.places, terms, recordings if study.moving else 0, recordings)
    problem = Problem(built.model, study.experiments, study.metrics, study.set_name, study.linear.fastest, built.faults)
    values = {f.target: f.value for f in (start or study.null).free}
    free = [
        replace(f, value=values.get(f.target, f.value)) if i < len(study.null.free) else f
        for i, f in enumerate(all_free(study.null.free, built))
    ]
    known = start if start is not None and start.whole and start.metrics is study.metrics else study.null
    columns = {f.target: column for f, column in zip(known.free, known.jacobian.T)}
    near = {i: columns[f.target] for i, f in enumerate(study.null.free) if f.target in columns and f.target not in built.loosened}
    most = rows(study) * np.log(max(study.null.cost / rows(study), 1.0))  # that noise of one level could gain by being as quiet as it may
    close = max(CLOSED * most, 0.5)
    if len(free) * problem.steps > ROUGH and problem.rough is not None:
        free = problem.rough.solve(problem.rough.eased(free), iterations, close, near).free
    else:
        free = problem.eased(free)
    fit = problem.solve(free, iterations, close, near)
    gain = study.nothing - loss(study, fit) if np.isfinite(fit.cost) else -np.inf
    found = fitted(terms, built, fit)
    if len(acting(found)) < len(found):
        return explain(study, acting(found), 2, fit, formulas)
    return Explanation(with_kinds(found, built.names, fit, study), built, problem, fit, gain, formulas)


def acting(terms: Sequence[Term]) -> list[Term]:
    """The terms that have a force, and those that companions with one need to be a cause."""
    forceful = [t for t in terms if t.gain != 0.0 or not isinstance(t.candidate.what, Basis)]
    led = {t.group for t in forceful if not t.candidate.companion}
    bare = {t.group for t in forceful} - led
    return [t for t in terms if t in forceful or t.group in bare and not t.candidate.companion]


def singles(study: Study, r: Regression, few: int = 3) -> list[Explanation]:
    """The best explanations by one kind, fitted."""
    ranked = []
    for group, pool in pools(r).items():
        gain, chosen = pursue(r, pool)
        if chosen:
            ranked.append((gain - sum(cost(r.candidates[c]) for c in chosen) - NEW, group, chosen))
    ranked = sorted((x for x in ranked if x[0] > 0.0), key=lambda x: -x[0])
    if not ranked:
        return []
    best = ranked[0][0]
    taken = [x for x in ranked if x[0] > 0.5 * best - NEW][:few]
    known = [x for x in ranked if x[1][0] == "network_extrapolation" and x[0] > 0.2 * best]  # to happen, of its motion
    taken += [x for x in known if x not in taken]
    choices = [chosen for _, _, chosen in taken]
    worth, both = pair(r)
    if worth > 0.7 * best:
        choices.append(both)
    ways = [terms_of(r, chosen) for chosen in choices]
    ways += [in_series(study, r, group) for _, group, _ in taken]
    found = []
    for k, terms in enumerate(ways):
        if terms:
            found.append(explain(study, terms))
            kept = study.null.cost - found[-1].fit.cost
            if k < len(taken) and kept < KEPT * r.gain(choices[k])[0] and (other := terms_of(r, elsewhere(r, taken[k][1], choices[k]))):
                found.append(explain(study, other))
    found += [explain(study, [needed], start=e.fit) for e in found for needed in (*sufficient(study, e), *rigid(study, e.terms))]
    found += [explain(study, poled) for e in found if (poled := through_a_pole(r, e))]
    return distinct([softened(study, e) for e in found if e.groups])


def elsewhere(r: Regression, group: Group, chosen: Sequence[int]) -> list[int]:
    """The best choice of one law of a kind that is none of those chosen: another one to begin with."""
    failed = {_law(r.candidates[k]) for k in chosen}
    return pursue(r, [k for k in pools(r)[group] if _law(r.candidates[k]) not in failed], terms=1)[1]


def sufficient(study: Study, e: Explanation) -> list[Term]:
    """Of two causes of one number each, those beside which the other one is worth less than it costs: a regression may have asked for
    two parameters in place of one that is far off."""
    if len(e.terms) != 2 or len(e.groups) != 2:
        return []
    variance, index = np.diag(e.fit.covariance()), {f.target: i for i, f in enumerate(e.fit.free)}
    found = []
    for other, target in zip(e.terms[::-1], gains(e.terms, e.built.names)):
        f = e.fit.free[index[target]]
        nominal = study.model.parameters[target].value if target in study.model.parameters else 0.0
        if ((f.value - nominal) / f.unit) ** 2 < (NEW + COST) * variance[index[target]]:
            found.append(other)
    return found


def rigid(study: Study, terms: Sequence[Term]) -> list[Term]:
    """The parameter of a body in place of a hidden mass alone, whose spring or damper does not give way: together they are a heavier
    body."""
    if len(terms) != 1 or terms[0].candidate.kind != "hidden_resonance":
        return []
    _, _, frequency, damping = terms[0].candidate.what
    if max(1.0, 2.0 * damping) * frequency < STIFF * RESONANCES[-1]:
        return []
    mass = next(b.mass for b in study.model.bodies if b.name == terms[0].candidate.where)
    return [Term(Candidate("wrong_parameter", mass, 0, False, mass), 0.0)] if study.model.parameters[mass].tolerance > 0.0 else []


def through_a_pole(r: Regression, e: Explanation) -> list[Term]:
    """A dead time as late through one pole: where that is slower than the signal, no small step leads from one to the other."""
    if len(e.terms) != 1 or e.groups[0][0] != "sensor_delay":
        return []
    [late] = e.terms
    rolled = [c for c in r.candidates if (c.kind, c.where) == e.groups[0] and getattr(c.what, "what", "") == "roll_off"]
    return [late, *(Term(c, 0.45 * late.gain**2) for c in rolled)]


def in_series(study: Study, r: Regression, group: Group) -> list[Term]:
    """A spring or a play in series with all of a damper; none if that is not of the group. With a damping of its own,
    many values of the rest do about as well, and a fit may end in the wrong ones."""
    pool = [k for k in pools(r)[group] if _law(r.candidates[k]) == "loose_damper"]
    _, best = r.best_single([], pool, dict.fromkeys(pool, 0.0))
    terms = terms_of(r, [best]) if best >= 0 else []
    return [tied for tied in (whole(study, t) for t in terms) if tied]


def refined(study: Study, e: Explanation, parameters: Sequence[str]) -> Explanation:
    """The explanation with more elementary laws of its kinds, where they earn their cost."""
    kinds = related(e.groups) - set(SINGLE)
    if not kinds:
        return e
    e = e.whole()
    return refine(study, e, regression(study, e.fit, parameters, kinds), parameters, kinds)[0]


def refine(
    study: Study, e: Explanation, r: Regression, parameters: Sequence[str], kinds: Collection[str] = ()
) -> tuple[Explanation, Regression]:
    """Give each kind of an explanation more elementary laws, as long as they earn their cost; `kinds`: that the regression is about,
    if not all."""
    for _ in range(2):
        best = None
        for group in e.groups:
            if group[0] != "hidden_resonance" and sum(t.group == group for t in e.terms) < room(group[0]) + 1:
                own = {_fault(t.candidate) for t in e.terms if t.group == group} - {None}
                laws = family(study, r, [group]) if group[0] in SHAPED else pools(r).get(group, [])
                pool = [k for k in laws if r.candidates[k].kind in {group[0], *SHAPED} and _fault(r.candidates[k]) not in own]
                gain, chosen = pursue(r, pool, terms=1, alone=group[0] not in ("sensor_bias", "sensor_delay", "maxwell_bushing"))
                if chosen and gain > max(cost(r.candidates[chosen[0]]), 2e-3 * e.gain) and (best is None or gain > best[0]):
                    best = gain, chosen[0], r.gain(chosen)[1][0]
        if best is None:
            break
        wider = explain(study, [*e.terms, Term(r.candidates[best[1]], float(best[2]))], start=e.fit, formulas=e.formulas)
        if wider.score < e.score + 2e-3 * e.gain:
            break
        e = wider.whole()
        r = regression(study, e.fit, parameters, kinds)
    return e, r


def filtered(study: Study, e: Explanation, r: Regression) -> Explanation | None:
    """The explanation with a second hidden mass, if it has one and that gains by another: any filter will do, and has no name."""
    for group in e.groups:
        if group[0] == "hidden_resonance" and sum(t.group == group for t in e.terms) == 1:
            gain, chosen = pursue(r, pools(r).get(group, []), terms=1)
            if chosen and gain > (1.0 / FILTER - 1.0) * e.gain:
                return explain(study, [*e.terms, *terms_of(r, chosen)], start=e.fit, formulas=e.formulas)
    return None


def strongest(r: Regression, groups: Collection[Group]) -> list[int]:
    """The choice of another kind than some that takes most, whether or not these could take it as well."""
    found = [pursue(r, pool) for group, pool in pools(r).items() if group not in groups]
    return max(found, key=lambda x: x[0] - sum(cost(r.candidates[c]) for c in x[1]), default=(0.0, []))[1]


def gains(terms: Sequence[Term], names: Sequence[str]) -> list[str | tuple[str, int]]:
    """What is free as the gain of each term."""
    found: list[str | tuple[str, int]] = []
    faults = 0
    for term, name in zip(terms, names):
        what = term.candidate.what
        if isinstance(what, Basis):
            found.append(term.own or f"{name}_{what.gain[0]}")
        elif isinstance(what, Fault):
            series = what.what not in VALUED
            found.append(("fault", faults) if series else (what.what, what.sensor))
            faults += series
        else:
            found.append(what if isinstance(what, str) else f"{name}_mass")
    return found


def fitted(terms: Sequence[Term], built: Extended, fit: Fit) -> list[Term]:
    """The terms with gains and shapes where the fit left them."""
    values = {name: p.value for name, p in built.model.parameters.items()} | {f.target: f.value for f in fit.free}
    found = []
    for term, name, target in zip(terms, built.names, gains(terms, built.names)):
        what, gain, bend = term.candidate.what, values[target], 0.0
        if isinstance(what, Basis):
            what = replace(what, shapes={k: (values[f"{name}_{k}"], u) for k, (_, u) in what.shapes.items()})
        elif isinstance(what, tuple):
            k, d = (values[f"{name}_{key}"] for key in ("stiffness", "damping"))
            w = np.sqrt(k / gain)
            what, bend = (what[0], what[1], w / (2 * np.pi), d / (2 * w * gain)), values[f"{name}_cubic"]
        found.append(replace(term, candidate=replace(term.candidate, what=what), gain=gain, bend=bend))
    return found


def at_rest(rest: Study, free: Study, told: Sequence[Explanation], log) -> tuple[Study, list[Explanation]]:
    """Explanations of a start in motion by a load that was put on at the start, alone or beside the causes that were found, or by
    the bias of a sensor that looks like one, and the study with the noise they leave; none where such a load is out of the
    question. `told`: what is about as good in motion, from best to worst."""
    r = regression(rest, rest.null, [], {"constant_force"})
    gains = {k: r.gain([k])[0] for k in range(len(r.candidates))}
    gains = {k: g for k, g in gains.items() if g > 0.8 * (rest.null.cost - free.null.cost)}
    if not gains:
        return rest, []
    rest = replace(rest, nothing=loss(rest, rest.null))
    loads = {r.candidates[k].where: terms_of(r, [k]) for k in sorted(gains, key=gains.__getitem__)}.values()  # the best of each place
    lighter = [t for e in told[:1] for t in e.terms if t.candidate.kind != "constant_force"]
    others = [t for t in lighter if t.candidate.kind != "sensor_bias"]  # in motion, a load looks like one
    ways = [(load, others) for load in loads]
    for e in [e for e in told if LOADS & {g[0] for g in e.groups} == {"sensor_bias"}][:1]:
        bias = [t for t in e.terms if t.candidate.kind == "sensor_bias"]
        ways.append((bias, [t for t in e.terms if t not in bias]))
    there, formulas = (told[0].fit, told[0].formulas) if told else (None, 0.0)
    moving = rest.nothing - free.nothing + (told[0].score if told else 0.0)
    idle = None
    if lighter and set(lighter) not in [set(first + more) for first, more in ways]:
        idle = explain(rest, lighter, start=there, formulas=formulas)
        log(f"at rest without a load {idle.score:.0f}, moving {moving:.0f}")
        if idle.score > moving - NEW and not loaded(told[0]):
            return rest, []  # nothing moved that a load could have stood for
    beam = []
    for first, more in ways:
        beam.append(explain(rest, first))
        beam += [explain(rest, [*first, *more], start=there, formulas=max(beam[-1].gain, formulas))] if more else []
    beam.sort(key=lambda e: -e.score)
    log(f"at rest with {beam[0].groups} {beam[0].score:.0f}, moving {moving:.0f}")
    if idle is not None and beam[0].score < idle.score + NEW:
        if not loaded(told[0]):
            return rest, []
        beam = [idle]  # the load was but a start in motion that is none
    if beam[0].score < max(NEW, moving - min(NEAR * moving, REST * rows(rest)) - NEW) or taken(rest, beam[0]) < HOPELESS:
        return rest, []
    quiet = with_noise_of(rest, beam[0].fit)
    again = [explain(quiet, e.terms, 4, e.fit, e.formulas) for e in beam[:3]]
    if told and set(beam[0].groups) == set(told[0].groups):  # which has been looked at from all sides, in motion
        found = ranked(quiet, settled(quiet, again[0]), again[1:], log)
    else:
        quiet, found = grow(quiet, again, log, 1)
    return quiet, [e for e in found if loaded(e) < weight(rest.model)]


def taken(study: Study, e: Explanation) -> float:
    """The share of what is more than noise that an explanation takes, in the noise it was fitted in."""
    return (study.null.cost - e.fit.cost) / max(study.null.cost - rows(study), 1.0)


def loaded(e: Explanation) -> float:
    """What the loads of an explanation are at most, all together [N]: some that nearly cancel each other count in full."""
    return sum(abs(t.gain) for t in e.terms if t.candidate.kind == "constant_force")


def numbers(e: Explanation) -> int:
    """How many numbers are of its loads: a size each, and when and how long one grows."""
    return sum(1 + len(t.candidate.what.shapes) for t in e.terms if t.candidate.kind == "constant_force")


def weight(model: Model) -> float:
    """Of all bodies [N], without any no bound. A load beyond it is a start in motion in disguise."""
    return GRAVITY * sum(model.parameters[b.mass].value for b in model.bodies) or np.inf


def related(groups: Sequence[Group]) -> set[str]:
    """All kinds that are of one curve with some groups, wherever."""
    own = {CURVES.get(kind, kind) for kind, _ in groups}
    return own | {kind for kind, its in CURVES.items() if its in own}


def curve(c: Candidate) -> tuple[str, object]:
    """The curve at a place, the fault of a sensor or the parameter that a candidate is about."""
    return CURVES.get(c.kind, c.kind), c.what.place if isinstance(c.what, Basis) else c.where


def family(study: Study, r: Regression, groups: Sequence[Group]) -> list[int]:
    """All candidates that are of one curve, or one fault of a sensor, with some groups."""
    places = {(c.kind, c.where): c.what.place for c in r.candidates if isinstance(c.what, Basis)}
    own = {(CURVES.get(g[0], g[0]), places.get(g, g[1])) for g in groups}
    return [k for k, c in enumerate(r.candidates) if curve(c) in own]


def resembles(e: Explanation, c: Candidate) -> bool:
    """May what another form of a cause of `e` does look like this candidate of its family? A hidden mass only near its frequency: at
    all of them, masses do what any filter can."""
    if c.kind != "hidden_resonance":
        return True
    own = [t.candidate.what[2] for t in e.terms if t.group == (c.kind, c.where)]
    return any(f / OCTAVE < c.what[2] < OCTAVE * f for f in own)


def further(study: Study, e: Explanation, r: Regression) -> list[list[int]]:
    """Choices of one more kind by what no curve of the causes so far can do, from best to worst."""
    taken = [k for k in family(study, r, e.groups) if resembles(e, r.candidates[k])]
    rest, kin = r.beside(taken), set(taken)
    least = 0.0 if exact(e.groups) else LEAST * e.gain
    found = []
    for pool in pools(r).values():
        if kin.isdisjoint(pool):
            gain, chosen = pursue(rest, pool, terms=2)
            price = sum(cost(r.candidates[c]) for c in chosen)
            if chosen and gain > max(NEW + price, least):
                found.append((gain - price, chosen))
    return [chosen for _, chosen in sorted(found, key=lambda x: -x[0])]


def terms_of(r: Regression, chosen: Sequence[int]) -> list[Term]:
    """The chosen candidates with the sizes that the regression gives them. Where only companions are left, the first of the others
    keeps a part of what it has alone; none if that is nothing."""
    _, gains = r.gain(chosen)
    alone = [c for c in chosen if not r.candidates[c].companion][:1]
    if all(g == 0.0 or r.candidates[c].companion for c, g in zip(chosen, gains)):
        small = PART * r.gain(alone)[1] if alone else np.zeros(1)
        gains = np.where([c in alone for c in chosen], small, gains) if small[0] else np.zeros(len(chosen))
    return [Term(r.candidates[c], float(g)) for c, g in zip(chosen, gains) if g != 0.0]


def search(study: Study, log=lambda text: None) -> tuple[Study, list[Explanation]]:
    """Explanations from best to worst, empty if there is nothing to explain; and the study with the noise that the best of
    them leaves. The first look is taken twice: the null fit may take a cause for slow noise."""
    parameters = [f.target for f in study.null.free if isinstance(f.target, str)]
    study = replace(study, nothing=loss(study, study.null))
    bare = with_noise_of(study, study.null, coloured=False)
    bare = replace(bare, nothing=min(study.nothing, loss(bare, bare.null)))
    first = singles(bare, regression(bare, bare.null, parameters), 2)
    white = bool(first) and first[0].score > 0.0 and with_noise_of(bare, first[0].fit) is bare
    if bare.metrics is not study.metrics and not white and not any(only_noise(bare, e) for e in first):
        slow = replace(study, nothing=bare.nothing)
        first = sorted([*first, *singles(slow, regression(slow, slow.null, parameters), 1)], key=lambda e: -e.score)
    for e in first:
        log(f"first {e.groups} {e.gain:.0f}")
    if not first or first[0].score <= 0.0 and not hopeful(bare, first[0]):
        return study, []
    quiet = with_noise_of(bare, first[0].fit)
    if quiet is bare:
        return grow(quiet, first, log)
    again = [*singles(quiet, regression(quiet, quiet.null, parameters)), explain(quiet, first[0].terms, start=first[0].fit)]
    return grow(quiet, distinct(again), log)


def heavy(e: Explanation, most: float = HEAVY) -> bool:
    """Do its derivatives take so many steps that the search has to be narrow to end in time?"""
    return len(e.fit.free) * e.problem.steps > most


def hopeful(study: Study, e: Explanation) -> bool:
    """Does a cause take most of what is more than noise, though noise of another colour would do as well? Then another cause is left
    that was hidden in that noise, such as a bias, and both together may do better."""
    more = study.null.cost - rows(study)
    return more > DOUBLE * rows(study) and study.null.cost - e.fit.cost > MIN_TAKEN * more


def distinct(found: Sequence[Explanation]) -> list[Explanation]:
    """The best explanation by each choice of causes, from best to worst."""
    best: dict[frozenset[Group], Explanation] = {}
    for e in sorted(found, key=lambda e: -e.score):
        best.setdefault(frozenset(e.groups), e)
    return list(best.values())


def grow(study: Study, beam: Sequence[Explanation], log, width: int = 2) -> tuple[Study, list[Explanation]]:
    """Explanations by one kind, by two and by three, from best to worst; `width`: how many of each are given a further one."""
    parameters = [f.target for f in study.null.free if isinstance(f.target, str)]
    for e in beam:
        log(f"{e.groups} {e.gain:.0f}")
    done = list(beam)
    ended: list[Explanation] = []
    share = 0.0
    for _ in (2, 3):
        grown: list[Explanation] = []
        enough = beam[0].gain - MAX_LOSS * abs(beam[0].gain)
        for e in beam[: 1 if heavy(beam[0]) else width]:
            alike = {curve(t.candidate) for t in e.terms} == {curve(t.candidate) for t in beam[0].terms}
            if e.gain < (max(enough, (1.0 - NEAR) * beam[0].gain) if alike else enough):
                break  # of one curve, the worse form of it will not become the better one
            if any(len(e.terms) >= len(o.terms) and e.gain < o.gain - NEW for o in ended):
                continue  # it would need more laws to become as good
            akin, _ = correlation(study.experiments, study.metrics, e.fit.simulated)
            here = with_noise_of(study, e.fit, coloured=akin < ALIKE)  # what sensors share is no noise
            if here is not study:
                e = explain(here, e.terms, 4, e.fit, e.formulas)
            e = e.whole()
            e, r = refine(here, e, regression(here, e.fit, parameters), parameters)
            if any(kind == "backlash" for kind, _ in e.groups):  # else another cause may come in for what two halves of a play do
                tied = owned(here, e, log)
                if tied is not e:
                    e = tied.whole()
                    r = regression(here, e.fit, parameters)
            if any(kind == "sensor_clipping" for kind, _ in e.groups):
                soft = softened(here, e, log)
                if soft is not e:
                    soft = soft.whole()
                    e, r = refine(here, soft, regression(here, soft.fit, parameters), parameters)
            done.append(e)
            share = max(share, taken(here, e))
            log(f"refined {e.groups} x{len(e.terms)} {e.gain:.0f} {[_law(t.candidate) for t in e.terms]}")
            if second := filtered(here, e, r):
                done.append(second)
                log(f"  two masses: {second.gain:.0f}")
            choices = further(here, e, r)[:2] + ([strongest(r, e.groups)] if second else [])  # what is taken for a second mass
            ways = [*filter(None, (terms_of(r, chosen) for chosen in choices))]
            if not ways and e.fit.chi2 - rows(here) < (1.0 - WHOLE) * e.gain:
                enough = (1.0 - NEAR) * e.gain  # it is whole: only what is about as good may take its place
                ended = [e] if only_noise(here, e) else []
            for new in ways:
                wider = explain(here, [*e.terms, *new], start=e.fit, formulas=e.gain if exact(e.groups) else e.formulas)
                log(f"  + {wider.groups[-1]} -> {wider.gain:.0f}")
                share = max(share, taken(here, wider))
                if wider.score > e.score:
                    grown.append(wider)
        done += grown
        if not grown:
            break
        beam = sorted(grown, key=lambda e: -e.score)
    done = sorted((e for e in spared(done) if e.score > 0.0), key=lambda e: -e.score)
    if done:
        study = with_noise_of(study, done[0].fit)
    if done and len(done[0].groups) > 1 and share > HOPELESS:
        found = exchanged(study, done[0], parameters, log)
        if found and max(e.score for e in found) > done[0].score:
            found += lightened(study, max(found, key=lambda e: e.score), log)
        done = sorted(done + found, key=lambda e: -e.score)
    if not done:
        return study, []
    others = [e for e in done[1:] if unloaded(e) != unloaded(done[0]) and len(e.groups) <= len(done[0].groups)]  # for loads, see ranked
    equal = [e for e in others if e.gain > done[0].gain - SLACK]  # and may be the plainer one
    first = level([done[0], *equal[:1]])
    plainer = list(zip(first, level([plain(study, e, parameters, log) for e in first])))
    best = settled(study, owned(study, max(plainer, key=lambda both: max(e.score for e in both))[1], log))
    return study, ranked(study, best, done[1:], log)


def ranked(study: Study, best: Explanation, others: Sequence[Explanation], log) -> list[Explanation]:
    """Explanations from best to worst, with those that differ from the best one by the like of a load or a bias."""
    alike = equals(study, best, log)
    swapped = max([best, *alike], key=lambda e: e.score)
    return [best, *others, *alike] if swapped is best else [settled(study, swapped), best, *others, *alike]


def spared(found: Sequence[Explanation]) -> list[Explanation]:
    """Explanations with the gain by formulas of those that have more causes beside the same: what a formula takes there leaves no form
    here either, and in which order causes came in does not count."""
    most = {frozenset(e.groups): max(o.formulas for o in found if set(e.groups) <= set(o.groups)) for e in found}
    return [replace(e, formulas=most[frozenset(e.groups)]) for e in found]


def unloaded(e: Explanation) -> frozenset[Group]:
    """Its causes but for a load or a bias."""
    return frozenset(g for g in e.groups if g[0] not in LOADS)


def level(found: Sequence[Explanation]) -> list[Explanation]:
    """Explanations with the same gain by formulas where all but a load or a bias is the same: one of these is no more a formula
    than the other."""
    beside = [unloaded(e) for e in found]
    most = {rest: max(e.formulas for e, own in zip(found, beside) if own == rest) for rest in beside}
    return [replace(e, formulas=most[rest]) for e, rest in zip(found, beside)]


def settled(study: Study, e: Explanation) -> Explanation:
    """The explanation fitted to the end in the noise of the study."""
    free = [replace(f, value=v.value) for f, v in zip(all_free(study.null.free, e.built), e.fit.free)]
    problem = Problem(e.built.model, study.experiments, study.metrics, study.set_name, study.linear.fastest, e.built.faults)
    return replace(e, problem=problem, fit=problem.solve(free))


def plain(study: Study, e: Explanation, parameters: Sequence[str], log) -> Explanation:
    """The explanation with the textbook law of a kind in place of several laws, and with constant friction in place of one that falls,
    where it does about as well: its parameters are known better."""
    e = level_friction(study, leaner(study, unlagged(study, unbent(study, e, log), log), log), log)
    laws = {g: [_law(t.candidate) for t in e.terms if t.group == g] for g in e.groups if g[0] in TEXTBOOK}
    laws = {g: own for g, own in laws.items() if own != ["loose_damper"]}  # one as well
    ways = [(g, g) for g, own in laws.items() if len(own) > len(TEXTBOOK[g[0]]) or not set(own) <= set(TEXTBOOK[g[0]])]
    ways += [(g, ("coulomb_friction", g[1])) for g in laws if g[0] == "stribeck_friction"]  # a fall at rates that are rare is none
    if not ways:
        return joined(study, e, log)
    whole = e.whole()
    r = regression(study, whole.fit, parameters, {kind for _, (kind, _) in ways})
    for group, other in ways:
        if group not in e.groups:
            continue
        pool = pools(r).get(other, [])
        if group == other:
            pool = [k for k in pool if _law(r.candidates[k]) in TEXTBOOK[group[0]]]
        without = r.without(missing(whole, group))
        chosen = pursue(without, pool, terms=len(TEXTBOOK[group[0]]) if group == other else TERMS)[1]
        if group[0] in TWO and len(chosen) == 1:
            chosen += [k for k in pool if without.candidates[k].companion]
        new = terms_of(without, chosen)
        if new:
            simple = explain(study, [*(t for t in e.terms if t.group != group), *new], start=e.fit, formulas=e.formulas)
            log(f"  plain {group} as {other[0]}, {simple.groups}: {simple.gain:.0f} for {e.gain:.0f}, {simple.score:.0f} for {e.score:.0f}")
            same = set(simple.groups) == {other if g == group else g for g in e.groups}
            if same and (group == other and simple.gain > e.gain - SLACK or simple.score > e.score - SLACK):
                e = simple
    return joined(study, e, log)


def level_friction(study: Study, e: Explanation, log) -> Explanation:
    """The explanation with friction of one level that yields as far in place of one that falls, where it does about as well: no candidate
    yields as little as a fit has found."""
    for t in [t for t in e.terms if _law(t.candidate) == "falling_friction"]:
        what = t.candidate.what
        one = replace(what, kind="coulomb_friction", law="dahl_friction", shapes={"presliding": what.shapes["presliding"]})
        term = replace(t, candidate=replace(t.candidate, kind="coulomb_friction", what=one))
        level = explain(study, [*(x for x in e.terms if x.group != t.group), term], start=e.fit, formulas=e.formulas)
        log(f"  one level of {t.group}: {level.gain:.0f} for {e.gain:.0f}, {level.score:.0f} for {e.score:.0f}")
        if len(level.groups) == len(e.groups) and level.score > e.score - SLACK:
            return level
    return e


def unlagged(study: Study, e: Explanation, log) -> Explanation:
    """The explanation with a spring that hardens in place of a bushing that hardens, where it does as well without its memory."""
    for t in [t for t in e.terms if _law(t.candidate) == "hardening_bushing"]:
        if t.group in e.groups:
            what = replace(t.candidate.what, kind="cubic_spring", law="cubic_spring", shapes={})
            place = where("cubic_spring", study.places[what.place], study.model)
            term = replace(t, candidate=replace(t.candidate, kind="cubic_spring", where=place, companion=False, what=what))
            spring = explain(study, [*(x for x in e.terms if x.group != t.group), term], start=e.fit, formulas=e.formulas)
            log(f"  no memory in {t.group}: {spring.gain:.0f} for {e.gain:.0f}")
            e = spring if spring.score > e.score - SLACK else e
    return e


def joined(study: Study, e: Explanation, log) -> Explanation:
    """The explanation with the straight part of a curve in place of a wrong parameter of the element at its place: together they are
    one curve, which has one name."""
    for group in [g for g in e.groups if g[0] == "wrong_parameter"]:
        linear = {x.law: x.name for x in study.model.elements if group[1] in x.arguments.values() and x.law in LINES}
        for t in [t for t in e.terms if t.candidate.kind in (*DAMPERS, "cubic_spring", "asymmetric_spring")]:
            what = t.candidate.what
            law = LINES_OF[CURVES[t.candidate.kind]]
            if linear.get(law) in {name for name, _ in study.places[what.place].elements} and group in e.groups:
                line = replace(what, law=law, gain=LINES[law], shapes={}, sign=0, series=(), companion=True, fixed={}, least={})
                more = e.fit.value(group[1]) - study.model.parameters[group[1]].value
                term = Term(replace(t.candidate, sign=0, companion=True, what=line), more)
                one = explain(study, [*(x for x in e.terms if x.group != group), term], start=e.fit, formulas=e.formulas)
                log(f"  {group} in {t.group}: {one.gain:.0f} for {e.gain:.0f}")
                e = one if one.score > e.score else e
    return e


def leaner(study: Study, e: Explanation, log) -> Explanation:
    """The explanation without laws that the others of their kind do as well without: they only blur its parameters, or its name."""
    kept: list[Term] = []
    while spare := [t for t in weak(e) if t not in kept]:
        simple = explain(study, [t for t in e.terms if t is not spare[0]], 4, e.fit, e.formulas)
        if simple.gain > (1.0 - CLOSE) * e.gain:  # else more steps will not make it as good
            simple = explain(study, simple.terms, start=simple.fit, formulas=e.formulas)
        log(f"  lean {spare[0].group}: {simple.gain:.0f} for {e.gain:.0f}")
        if len(simple.groups) == len(e.groups) and simple.score > e.score:
            e, kept = simple, []
        else:
            kept.append(spare[0])
    return e


def weak(e: Explanation) -> list[Term]:
    """Laws beside others of their kind that may be worth less than they cost, the least one first."""
    places = {f.target: i for i, f in enumerate(e.fit.free)}
    variance = np.diag(e.fit.covariance())
    found = []
    for term, target in zip(e.terms, gains(e.terms, e.built.names)):
        several = sum(t.group == term.group for t in e.terms) > 1 and term.group[0] != "sensor_bias"
        if not term.candidate.companion and sum(t.group == term.group and not t.candidate.companion for t in e.terms) == 1:
            continue  # companions alone are no cause
        if several and not term.own and getattr(term.candidate.what, "what", "") not in ("rail", "sharpness"):
            i = places[target]
            f = e.fit.free[i]
            found.append(((f.value / f.unit) ** 2 / max(variance[i], 1e-300), term))
    bound = WEAK * (COST + FORM * e.gain)
    return [term for worth, term in sorted(found, key=lambda x: x[0]) if worth < bound * cost(term.candidate) / COST]


def unbent(study: Study, e: Explanation, log) -> Explanation:
    """The explanation with the parameter of an element in place of a curve beside it that is a straight line."""
    for group in e.groups:
        name = straight(study.model, study.places, e.terms, e.built.names, group, {f.target: f.value for f in e.fit.free})
        if name and all(t.group != ("wrong_parameter", name) for t in e.terms):
            term = Term(Candidate("wrong_parameter", name, 0, False, name), 0.0)
            simple = explain(study, [*(t for t in e.terms if t.group != group), term], start=e.fit, formulas=e.formulas)
            log(f"  straight {group}: {simple.gain:.0f} for {e.gain:.0f}")
            if simple.score > e.score - SLACK:
                e = simple
    return e


def owned(study: Study, e: Explanation, log) -> Explanation:
    """The explanation with laws that take away all of an element, where they do as well as with a share of it: else how
    wide a play is would be known no better than how much it takes. A play that is not in the middle has two halves."""
    best = e
    for terms in ([t if t.candidate.companion else whole(study, t) or t for t in e.terms], halved(study, e)):
        if terms != list(e.terms):
            tied = explain(study, terms, start=e.fit, formulas=e.formulas)
            log(f"  all of an element: {tied.gain:.0f} for {e.gain:.0f}")
            best = tied if tied.groups == e.groups and tied.score > best.score else best
    return best


def softened(study: Study, e: Explanation, log=lambda text: None) -> Explanation:
    """The explanation with a sensor that comes near its limits smoothly in place of one that is bent at several values."""
    for group in [g for g in e.groups if g[0] == "sensor_clipping"]:
        own = [t for t in e.terms if t.group == group]
        if any(t.candidate.what.what == "rail" for t in own):
            continue
        sensor = own[0].candidate.what.sensor
        top = max(float(np.max(np.abs(x.y[x.good[:, sensor], sensor]), initial=1e-300)) for x in study.experiments)
        for laws in ({"sharpness": SHARP}, {"sharpness": 0.0, "scale_bend": BENT}):  # a tanh of what is bent is sharper than one
            sizes = {"rail": 1.0 / top} | laws
            faults = [Fault("sensor_clipping", sensor, what, what != "scale_bend", (), top) for what in sizes]
            soft = [Term(replace(own[0].candidate, what=fault), x) for fault, x in zip(faults, sizes.values())]
            smooth = explain(study, [*(t for t in e.terms if t.group != group), *soft], start=e.fit, formulas=e.formulas)
            log(f"  smooth {group}: {smooth.gain:.0f} for {e.gain:.0f}")
            e = smooth if smooth.score > e.score else e
    return e


def halved(study: Study, e: Explanation) -> list[Term]:
    """The terms with two halves, each of which takes away all of a spring, for a play with one half beside it."""
    terms = list(e.terms)
    for group in [g for g in e.groups if g[0] == "backlash"]:
        laws = {_law(t.candidate): t for t in terms if t.group == group}
        play, beside = laws.get("backlash"), [law for law in HALVES if law in laws]
        if play is not None and play.gain > 0.0 and len(beside) == 1:
            half = laws[beside[0]]
            gap, more = (t.candidate.what.shapes["gap"][0] for t in (play, half))
            gaps = {law: gap + (half.gain / play.gain * more if law in beside else 0.0) for law in HALVES}
            basis = play.candidate.what
            kinds = [replace(basis, law=law, gain=half.candidate.what.gain, shapes={"gap": (x, "m")}) for law, x in gaps.items()]
            both = [whole(study, replace(play, own="", candidate=replace(play.candidate, what=kind))) for kind in kinds]
            if all(both) and min(gaps.values()) > 0.0:
                terms = [*(t for t in terms if t.group != group), *both]
    return terms


def whole(study: Study, t: Term) -> Term | None:
    """A law that takes away all of the element at its place; None if it is no such law, or already does."""
    law, argument = TAKING.get(_law(t.candidate), ("", ""))
    near = {name for name, _ in study.places[t.candidate.what.place].elements} if law and not t.own else set()
    own = [x.arguments[argument] for x in study.model.elements if x.law == law and x.name in near]
    if len(own) != 1 or t.gain == 0.0:
        return None
    what, all_of_it = t.candidate.what, study.model.parameters[own[0]].value
    share = t.gain / all_of_it  # of a narrow play, only its gap times what it takes is seen
    shapes = {k: (x * share if k == "gap" else x, unit) for k, (x, unit) in what.shapes.items()}
    return replace(t, candidate=replace(t.candidate, what=replace(what, shapes=shapes)), gain=all_of_it, own=own[0])


def _fault(c: Candidate) -> tuple[str, float] | None:
    """What a fault is, so that none comes twice; the size of a bend is the unit of its gain only."""
    return (c.what.what, 0.0 if c.what.what == "scale_bend" else c.what.shape) if isinstance(c.what, Fault) else None


def _law(c: Candidate) -> str:
    return getattr(c.what, "law", "")


def mended(study: Study, e: Explanation, log) -> tuple[Explanation, Explanation]:
    """The explanation with as many more laws of its causes as are worth their numbers, under the same names: with laws of the sign of
    their kinds, from which its causes have their sizes; and then of any sign. A name is what a curve does in the large; what the
    extended model foretells depends on all of the curve, and may need less of a law as well as more."""
    most = len(e.terms) + (1 if heavy(e, LABOUR) else MENDS)
    study, sized, r = formed(study, e, None, most, log)
    more = r is not None and not heavy(sized, LABOUR)
    return sized, formed(study, sized, r.unsigned(), most, log)[1] if more else sized


def formed(
    study: Study, e: Explanation, r: Regression | None, most: int, log
) -> tuple[Study, Explanation, Regression | None]:
    """The explanation with more laws as they are in a regression about it, if it is known already, up to so many terms; with the study
    that has the noise it leaves, and the regression about it. Laws may have any sign if they may in the regression."""
    parameters = [f.target for f in study.null.free if isinstance(f.target, str)]
    spare = [g for g in e.groups if g[0] not in ("wrong_parameter", "constant_force", "sensor_delay", CLOCK)]
    anyway = r is not None
    if spare and r is None:
        e = e.whole()
        r = regression(study, e.fit, parameters, related(spare))
    while spare and len(e.terms) < most:
        found = []
        for group in spare:
            own = {_fault(t.candidate) for t in e.terms if t.group == group} - {None}
            pool = [k for k in family(study, r, [group]) if _fault(r.candidates[k]) not in own]
            gain, chosen = pursue(r, pool, terms=1, alone=False)
            if chosen and gain > 2.0 * cost(r.candidates[chosen[0]]):
                found.append((gain, group, Term(r.candidates[chosen[0]], float(r.gain(chosen)[1][0]))))
        if not found:
            break
        _, group, new = max(found, key=lambda x: x[0])
        wider = called(explain(study, [*e.terms, new], start=e.fit, formulas=e.formulas), e)
        log(f"  mended {group}: {wider.gain:.0f} for {e.gain:.0f}")
        if set(wider.groups) == set(e.groups) and wider.gain > e.gain + 2.0 * cost(new.candidate):
            levels, metrics = noise_of(study, wider.fit)  # what is mended had been taken for noise
            study = replace(study, levels=levels, metrics=metrics)
            e = settled(study, wider).whole()
            r = regression(study, e.fit, parameters, related(spare))
            r = r.unsigned() if anyway else r
        else:
            spare.remove(group)
    return study, e, r


def called(e: Explanation, known: Explanation) -> Explanation:
    """The explanation with its curves called what they are in a known one."""
    names = {curve(t.candidate): t.group for t in known.terms}
    groups = [names.get(curve(t.candidate), t.group) for t in e.terms]
    candidates = [replace(t.candidate, kind=kind, where=where) for t, (kind, where) in zip(e.terms, groups)]
    return replace(e, terms=tuple(replace(t, candidate=c) for t, c in zip(e.terms, candidates)))


def exchanged(study: Study, e: Explanation, parameters: Sequence[str], log) -> list[Explanation]:
    """Explanations with one cause of `e` exchanged for another: the first one found may have stood in for it."""
    e = e.whole()
    r = regression(study, e.fit, parameters)
    found: list[Explanation] = []
    for group in e.groups:
        without = r.without(missing(e, group))
        worth = without.chi2 - r.chi2
        kept = [t for t in e.terms if t.group != group]
        if worth < SMALL * e.gain:  # it may have stood in for what another cause can do by itself
            alone = explain(study, kept, start=e.fit, formulas=e.formulas)
            if alone.gain > (1.0 - MAX_LOSS) * e.gain:
                alone = refined(study, alone, parameters)
            found.append(alone)
            log(f"  without {group}: {alone.gain:.0f} for {e.gain:.0f}, x{len(alone.terms)}")
        ranked = []
        for other, pool in pools(r).items():
            if other not in e.groups:
                gain, chosen = pursue(without, pool)
                if chosen and gain > RIVAL * worth:
                    ranked.append((gain - sum(cost(r.candidates[c]) for c in chosen), chosen))
        best = sorted(ranked, key=lambda x: -x[0])[: 1 if heavy(e) else 2]
        ways = [terms_of(without, chosen) for _, chosen in best]
        ways.append(rigid(study, [t for t in e.terms if t.group == group]))
        for new in [*filter(None, ways), *sprung(study, e, r, group)]:
            found.append(explain(study, [*kept, *new], start=e.fit, formulas=e.formulas))
            log(f"  {group} for {found[-1].groups[-1]}: {found[-1].gain:.0f}")
    close = [x for x in found if set(x.groups) != set(e.groups) and x.gain > (1.0 - CLOSE) * e.gain]
    for other in distinct(close)[:2]:
        found.append(refined(study, other, parameters))
        log(f"  refined {found[-1].groups} x{len(found[-1].terms)}: {found[-1].gain:.0f}")
    return found


def sprung(study: Study, e: Explanation, r: Regression, group: Group) -> list[list[Term]]:
    """What a mass that is too small may be instead: the rest of it on a spring, which moves along at frequencies below its own."""
    model = study.model
    body = next((b.name for b in model.bodies if group == ("wrong_parameter", b.mass)), "")
    more = e.fit.value(group[1]) - model.parameters[group[1]].value if body else 0.0
    masses = [c for c in r.candidates if c.kind == "hidden_resonance" and c.where == body]
    if more <= 0.0 or not masses:
        return []
    nearest = [min(masses, key=lambda c: abs(np.log(c.what[2] / f)) + abs(np.log(c.what[3] / DAMPINGS[1]))) for f in MASS_FREQUENCIES]
    return [[Term(c, more)] for c in nearest]


def lightened(study: Study, e: Explanation, log) -> list[Explanation]:
    """Explanations with one of three causes or more left out: one that stood in for a cause found later is not needed."""
    fewer = [[t for t in e.terms if t.group != group] for group in e.groups] if len(e.groups) > 2 else []
    found = [explain(study, terms, start=e.fit, formulas=e.formulas) for terms in fewer]
    for less in found:
        log(f"  only {less.groups}: {less.gain:.0f} for {e.gain:.0f}")
    return found


def equals(study: Study, e: Explanation, log) -> list[Explanation]:
    """The explanation with a load or a bias exchanged for the one of its like that does about as well, however it grows."""
    loads = [g for g in e.groups if g[0] in LOADS]
    if not loads:
        return []
    e = e.whole()
    r = regression(study, e.fit, [f.target for f in study.null.free if isinstance(f.target, str)], LOADS)
    found = []
    for group in loads:
        without = r.without(missing(e, group))
        alike = [k for k, c in enumerate(r.candidates) if c.kind in LOADS and (c.kind, c.where) not in e.groups]
        _, first = pursue(without, alike, terms=1)
        gain, chosen = pursue(without, pools(without)[_group(without, first)]) if first else (0.0, [])
        if chosen and gain > RIVAL * (without.chi2 - r.chi2):
            kept = [t for t in e.terms if t.group != group]
            found.append(explain(study, [*kept, *terms_of(without, chosen)], start=e.fit, formulas=e.formulas))
            log(f"  {group} as {found[-1].groups[-1]}: {found[-1].gain:.0f} for {e.gain:.0f}")
    return found


def _group(r: Regression, chosen: Sequence[int]) -> Group:
    return r.candidates[chosen[0]].kind, r.candidates[chosen[0]].where


def missing(e: Explanation, group: Group) -> Fit:
    """The fit as it would be without a cause, to first order."""
    names = {f"{n}_" for t, n in zip(e.terms, e.built.names) if t.group == group}
    shrinking = [("gap", "relaxation") if t.own else ("mass",) for t in e.terms]  # what goes to nothing with a cause
    sizes = {f"{n}_{key}" for n, keys in zip(e.built.names, shrinking) for key in keys}
    faults = [t.candidate.what for t in e.terms if t.group == group and isinstance(t.candidate.what, Fault)]
    own = []
    for i, f in enumerate(e.fit.free):
        if isinstance(f.target, str):
            own += [i] if f.target == group_parameter(e, group) or any(f.target.startswith(n) for n in names) else []
        elif f.target[0] in VALUED:
            own += [i] if any(f.target == (x.what, x.sensor) for x in faults) else []
        elif f.target[0] == "fault":
            own += [i] if e.built.faults[f.target[1]] in faults else []
    effect = np.zeros(len(e.fit.residual))
    for i in own:
        f = e.fit.free[i]
        if f.log:
            effect += e.fit.jacobian[:, i] if f.target in sizes else 0.0
        else:
            effect += e.fit.jacobian[:, i] * (f.value - f.origin) / f.unit
    rest = [i for i in range(len(e.fit.free)) if i not in own]
    return replace(
        e.fit, free=tuple(e.fit.free[i] for i in rest), residual=e.fit.residual + effect, jacobian=e.fit.jacobian[:, rest],
        whole=False,
    )  # fmt: skip


def group_parameter(e: Explanation, group: Group) -> str:
    """The parameter of the model that a cause is about, if it is about one."""
    return group[1] if group[0] == "wrong_parameter" else ""
