# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""One training from recordings to networks: the method for each network, the fit, its uncertainty."""

from __future__ import annotations

import hashlib
import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy
from numpy.typing import NDArray

import penode_gen
from penode_gen import units
from penode_gen.model import Model, NetworkPort
from penode_gen.networks import Network
from penode_gen.sets import fold, promises

from ..errors import ModelError, NotConverged, RecordingError, WrongUse
from ..recordings.measured import Measured
from . import (
    apart,
    asked,
    bands,
    begin,
    curves,
    data,
    dense,
    ends,
    held_starts,
    heldout,
    judge,
    left,
    notes,
    promised,
    tries,
    unfold,
    unknown,
)
from .curve import Curve
from .curves import Tell
from .dense import Dense
from .engine import Engine
from .port import Port, inputs_of
from .problem import Point, Problem
from .result import Error, Force, Trained
from .resume import Journal
from .settings import SETTINGS
from .solve import Fit, Limits, solve

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Options:
    """`known`: parameters that were measured, with their values in SI, or None for that of the model file."""

    known: tuple[tuple[str, float | None], ...] = ()
    seed: int = 0
    start: begin.Start = field(default_factory=begin.Start)
    journal: Journal = field(default_factory=Journal)


def train(model: Model, train_: Sequence[Measured], held: Sequence[Measured], options: Options, tell: Tell) -> tuple[Model, Trained]:
    """The model with trained networks, and all that is known of them. UserError for what cannot be trained."""
    model, known = _with_known(model, options)
    check(model)
    engine = Engine(model, [p.name for p in model.parameters.values() if p.tolerance > 0.0 and p.value != 0.0])
    compiled = time.process_time()
    ports = ports_of(model, engine)
    templates = [model.sets["default"].networks[p.name] for p in ports]
    records = tuple(data.record(model, m, engine.signals) for m in train_)
    problem = Problem(
        engine,
        records,
        data.at_first(model, records, engine.signals),
        np.ones(len(ports)),
        apart=apart.find(model, engine.free, engine.networks),
        journal=options.journal,
    )
    bounds = [promised.bound(model.networks[p.name].promises, size=1.0) for p in ports]
    problem, fit, tried = _tried(problem, ports, templates, bounds, options, tell)
    problem, fit = coloured(problem, fit, bounds)
    seen = curves.seen_by(problem, fit.point)
    visited = judge.visited(ports, seen)
    _check_excited(model, ports, visited)
    networks, fit = written(model, problem, fit, ports, templates, visited)
    spent = time.process_time() - compiled + options.journal.before
    return _judged(model, problem, fit, ports, networks, visited, train_, held, (options, known, spent, tried), tell)


def _tried(
    problem: Problem,
    ports: Sequence[Port],
    templates: Sequence[Network],
    bounds: Sequence[Callable[[Curve], Limits]],
    options: Options,
    tell: Tell,
) -> tuple[Problem, Fit, tuple[tries.Try, ...]]:
    """The fit, from as many starts as it takes; what is known already is where the first one starts. UserError where none stays within
    bounds."""

    def one(k: int, tell: Tell) -> tuple[str, tuple[Problem, Fit] | None]:
        start = options.start if k == 0 else begin.Start()
        what = "where --from says" if start.parameters or start.networks else "straight lines" if k == 0 else f"start {k + 1}"
        try:
            if all(p.knots for p in ports):
                return what, curves.train(problem, ports, bounds, tell, lambda own, point: _started(own, point, ports, start), k)
            return what, ends.train(problem, ports, templates, bounds, options.seed + 1000 * k, tell, start, max(k - 1, 0))
        except FloatingPointError:
            return what, None

    def doubt() -> None:
        meant = asked.question(problem, ports)
        if meant:
            raise RecordingError(f"{', '.join(r.name for r in problem.records)}: {meant}")

    try:
        return tries.several(one, doubt, tell)
    except FloatingPointError as exc:
        raise NotConverged(
            f"{problem.model.path}: {exc}; check signs, units and start states of the model against the recording (penode inspect), or "
            "begin with what is known, by --known and --from"
        ) from exc


def _started(problem: Problem, point: Point, ports: Sequence[Port], start: begin.Start) -> Point:
    """Curves and parameters of a start in place of straight lines."""
    seen = curves.seen_by(problem, point)
    shapes = tuple(
        begin.curve(p, start.networks[p.name], float(np.max(np.abs(inputs_of(p, seen))))) if p.name in start.networks else s
        for p, s in zip(ports, point.shapes, strict=True)
    )
    return Point(begin.ratios(start, problem.engine.free, problem.model, point.ratios), point.starts, shapes)


def coloured(problem: Problem, fit: Fit, bounds: Sequence[Callable[[Curve], Limits]]) -> tuple[Problem, Fit]:
    """The fit with the colour of its residuals, for its estimate and its band. Residuals above the noise are errors of the model: there
    the estimate stays that of least errors, and curves bend as held-out parts of the recordings allow."""
    loud = heldout.loud(problem, fit.point)
    if loud:
        problem, fit = heldout.bent(problem, fit, curves.limits_of(problem, bounds))
    found = problem.residuals(fit.point)
    if found is None:
        return problem, fit
    noise = data.of_residuals(found[0], [r.good for r in problem.records], problem.noise, coloured=True)
    own = problem.with_(noise=noise)
    if loud or not any(len(c) for c in noise.colour):
        return own, replace(fit, normal=own.normal(fit.point))
    return own, solve(own, fit.point, 6, 1.0, curves.limits_of(own, bounds), damping=1e-6)


def check(model: Model) -> None:
    """UserError for a model that has nothing to train, or a network whose shape cannot be."""
    if not model.networks:
        raise ModelError([f"{model.path}: the model has no network to train; add one in [networks] and [sets.default] (gen/README.md)"])
    problems = []
    for name, network in model.sets["default"].networks.items():
        why = dense.trainable(network)
        problems += [f"{model.path}: network {name} {why}"] if why else []
    if model.outside == "fade":
        problems.append(
            f'{model.path}: outside = "fade" changes what networks give within their range; train with "extrapolate" or "clamp"'
        )
    if problems:
        raise ModelError(problems)


def ports_of(model: Model, engine: Engine) -> list[Port]:
    """What each network that acts is, in the engine's order."""
    found = []
    for name in engine.networks:
        port, template = model.networks[name], model.sets["default"].networks[name]
        at, seen = 0, []
        for called, n in engine.calls:
            if called == name:
                seen.append(tuple(range(at, at + n)))
            at += n
        elements = [e for e in model.elements if e.network == name]
        zero = port.promises.zero_at_zero or bool(elements and len(elements) == len(seen))
        knots = max(unfold.capacity(template) - (not zero), 0)
        if port.promises.max_force is not None and model.outside != "clamp":
            raise ModelError(
                [
                    f'{model.path}: network {name} promises max_force, which training keeps with outside = "clamp" only; '
                    "choose that, or promise max_slope"
                ]
            )
        if port.promises and not knots:
            raise ModelError(
                [
                    f"{model.path}: network {name} makes promises, which hold for a ReLU network of one input with room for kinks; "
                    "give it layers = [16, 16]"
                ]
            )
        found.append(Port(name, tuple(seen), _is_rate(port), zero, max(knots, 0) if knots >= 3 else 0))
    return found


def _is_rate(port: NetworkPort) -> bool:
    return any(units.same_dimension(port.input_units[0], u) for u in ("m/s", "rad/s"))


def _with_known(model: Model, options: Options) -> tuple[Model, tuple[str, ...]]:
    """The model with the measured parameters exact."""
    changed = dict(model.parameters)
    for name, value in options.known:
        if name not in changed:
            raise WrongUse(f"--known {name}: the model has no such parameter; it has {', '.join(changed)}")
        p = changed[name]
        changed[name] = replace(p, tolerance=0.0, value=p.value if value is None else value)
    return replace(model, parameters=changed), tuple(name for name, _ in options.known)


def _check_excited(model: Model, ports: Sequence[Port], visited: Sequence[Array]) -> None:
    problems = [
        f"{model.path}: the recordings do not move the input of {p.name} ({model.networks[p.name].input_units[k]}): nothing can be "
        "learnt of it; record the plant while it moves"
        for p, x in zip(ports, visited, strict=True)
        for k in range(x.shape[1])
        if np.ptp(x[:, k]) < SETTINGS.story_still
    ]
    if problems:
        raise RecordingError(*problems)


def written(
    model: Model, problem: Problem, fit: Fit, ports: Sequence[Port], templates: Sequence[Network], visited: Sequence[Array]
) -> tuple[list[Network], Fit]:
    """Networks that are the fitted shapes, promises kept by the margin of the certificate."""
    found: list[Network] = []
    for k, (port, template, x) in enumerate(zip(ports, templates, visited, strict=True)):
        low, high = x.min(axis=0), x.max(axis=0)
        given = model.networks[port.name].promises
        for n in range(SETTINGS.story_tries):
            shape = fit.point.shapes[k]
            if isinstance(shape, Dense):
                network = dense.network_of(shape, template, low, high)
                break
            if port.zero:
                low, high = (np.array([v]) for v in _envelope(float(low[0]), float(high[0]), model.pieces > 0))
            network = unfold.unfold(shape, template, float(low[0]), float(high[0]))
            if not given or not promises.broken(given, network, model.outside == "clamp"):
                break
            margin = SETTINGS.promised_first * SETTINGS.story_tighter ** (n + 1)
            bounds = [promised.bound(model.networks[p.name].promises, margin if p is port else SETTINGS.promised_first, 1.0) for p in ports]
            fit = solve(problem, fit.point, 2, 1.0, curves.limits_of(problem, bounds), damping=1e-6)
        else:
            raise ModelError(
                [
                    f"{model.path}: network {port.name} cannot keep its promises by their margin: "
                    f"{promises.broken(given, network, model.outside == 'clamp')[0]}; relax them"
                ]
            )
        found.append(network)
    return found, fit


def _envelope(low: float, high: float, folded: bool) -> tuple[float, float]:
    """The visited range with 0 in it: a folded network computes exactly 0 at 0 where the range is symmetric."""
    low, high = min(low, 0.0), max(high, 0.0)
    return (-max(high, -low), max(high, -low)) if folded else (low, high)


def _judged(
    model: Model,
    problem: Problem,
    fit: Fit,
    ports: Sequence[Port],
    networks: Sequence[Network],
    visited: Sequence[Array],
    train_: Sequence[Measured],
    held: Sequence[Measured],
    given: tuple[Options, tuple[str, ...], float, tuple[tries.Try, ...]],
    tell: Tell,
) -> tuple[Model, Trained]:
    """What is known of a fit."""
    tell(0.97, "what is known of it")
    options, known, spent, tried = given
    remains = left.of(problem, fit.point)
    assert remains is not None  # the fit ended there
    band = bands.of(problem, fit)
    values = dict(zip(model.parameters, problem.parameters(fit.point), strict=True))
    after = judge.with_networks(model, {p.name: n for p, n in zip(ports, networks, strict=True)}, values)
    ranges = [(x.min(axis=0), x.max(axis=0)) for x in visited]
    training, _, _ = judge.errors(problem, fit.point, train_, model, after, ports, ranges, problem.noise)
    holdout: tuple[Error, ...] = ()
    outside = masked = 0.0
    if held:
        records = tuple(data.record(model, m, problem.engine.signals) for m in held)
        there = held_starts.fitted(problem, records, fit.point, ports, curves.seen_by(problem, fit.point))
        if there is not None:
            holdout, outside, masked = judge.errors(*there, held, model, after, ports, ranges, problem.noise)
    forces = [
        _force(model, port, shape, network, x, band.deviation(k))
        for k, (port, shape, network, x) in enumerate(zip(ports, fit.point.shapes, networks, visited, strict=True))
    ]
    said = [
        *notes.noise(remains, tried),
        *_deployed(after, train_, fit.point, problem, training),
        *notes.of(problem, fit, ports, train_, held if not holdout else ()),
    ]
    sigma = {n: float(band.deviations[i]) * abs(model.parameters[n].value) for i, n in enumerate(problem.engine.free)}
    parameters = {n: (float(values[n]), sigma[n], model.parameters[n].value, model.parameters[n].unit) for n in sigma}
    found = Trained(
        model.name,
        tuple(forces),
        parameters,
        known,
        tuple(unknown.find(problem, fit, ports, visited)),
        training,
        holdout,
        outside,
        masked,
        (fit.ended or all(e.stated for e in training)) and not remains.above(SETTINGS.story_loud),
        tried,
        tuple(said),
        remains.chi2,
        spent,
        options.seed,
        {m.path.name: hashlib.sha256(m.path.read_bytes()).hexdigest() for m in (*train_, *held)} | {model.path.name: model.digest},
        versions(),
    )
    return after, found


def _deployed(after: Model, train_: Sequence[Measured], point: Point, problem: Problem, training: Sequence[Error]) -> list[str]:
    """What the generated C errs more because of how its inputs run between rows."""
    if after.interpolation != "linear" or not after.inputs or not any(e.deployed > SETTINGS.left_more * e.after for e in training):
        return []
    smooth = judge.deployed(problem, replace(after, interpolation="cubic"), train_, point)
    return notes.deployed(training, [replace(e, deployed=smooth[e.signal]) for e in training])


def versions() -> dict[str, str]:
    """Versions of the programs that determine the numbers of a training."""
    return {"penode": penode_gen.VERSION, "python": platform.python_version(), "numpy": np.__version__, "scipy": scipy.__version__}


def _force(model: Model, port: Port, shape: Curve | Dense, network: Network, x: Array, deviation: Callable[[Array], Array]) -> Force:
    """A force along each of its inputs, with its band: the standard deviation at places [n, inputs]."""
    xs, ys, sigmas, edges, counts = [], [], [], [], []
    for k in range(x.shape[1]):
        along = np.linspace(float(x[:, k].min()), float(x[:, k].max()), SETTINGS.story_across)
        at = np.zeros((SETTINGS.story_across, x.shape[1]))
        at[:, k] = along
        xs.append(along)
        ys.append(shape(along) if isinstance(shape, Curve) else shape(at))
        sigmas.append(deviation(at))
        count, edge = np.histogram(x[:, k], SETTINGS.story_bins)
        edges.append(edge)
        counts.append(count.astype(float))
    declared = model.networks[port.name]
    broken = promises.broken(declared.promises, network, model.outside == "clamp") if declared.promises else []
    assert network.input_min is not None and network.input_max is not None  # written() gives it the visited range
    low, high = (tuple(float(v) for v in values) for values in (network.input_min, network.input_max))
    pieces = fold.pieces(network, model.outside == "clamp") if fold.foldable(network) else 0
    way = "curve" if isinstance(shape, Curve) else "network"
    return Force(
        port.name,
        way,
        declared.input_units,
        declared.output_unit,
        low,
        high,
        tuple(xs),
        tuple(ys),
        tuple(sigmas),
        tuple(edges),
        tuple(counts),
        tuple(broken),
        pieces,
        network,
    )
