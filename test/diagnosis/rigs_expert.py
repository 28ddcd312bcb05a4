# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a plain fit by an expert reaches on a rig: the law that is known to be in it, least squares, free start; nothing of the diagnosis in
it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

Array = NDArray[np.float64]
FIRST = 50  # samples of a hold-out from which its start is taken
MOST = 4000  # samples of a recording that a fit looks at


def table(path: Path, columns: dict[str, object], part: tuple[float, float] = (0.0, 1.0)) -> tuple[Array, Array, Array]:
    """Time from 0, input (0 without) and sensor of a recording, on an even clock."""
    head = [h.split("[")[0].strip() for h in path.read_text().split("\n", 1)[0].split(",")]
    raw = np.genfromtxt(path, delimiter=",", skip_header=1)
    raw = raw[int(part[0] * len(raw)) : int(part[1] * len(raw))]
    t = raw[:, head.index(str(columns["time"]))]
    even = np.linspace(t[0], t[-1], len(t))
    y = np.interp(even, t, raw[:, head.index(str(columns["sensor"]))])
    u = np.zeros(len(t))
    if "input" in columns:
        u = np.interp(even, t, raw[:, head.index(str(columns["input"]))]) * float(columns.get("scale", 1.0))
    return even - even[0], u, y


def swung(p: Array, starts: Array, t: Array, u: Array, terms: Sequence[str]) -> Array:
    """Angles [N, m] of a swing for m columns of parameters p [7, m] (gain, w2, d, friction, constant, drag, spring) and starts [2, m]."""
    h = t[1] - t[0]
    x, w = np.array(starts[0], float), np.array(starts[1], float)
    out = np.empty((len(t), len(x)))
    sine = np.sin if "sine" in terms else np.asarray

    def acc(a: Array, r: Array, tau: float) -> Array:
        return p[0] * tau - p[1] * sine(a) - p[2] * r - p[3] * np.tanh(r / 0.02) - p[4] - p[5] * r * np.abs(r)

    for i in range(len(t)):
        out[i] = x
        if i + 1 < len(t):
            mid = 0.5 * (u[i] + u[i + 1])
            a1 = acc(x, w, u[i])
            a2 = acc(x + h / 2 * w, w + h / 2 * a1, mid)
            a3 = acc(x + h / 2 * (w + h / 2 * a1), w + h / 2 * a2, mid)
            a4 = acc(x + h * (w + h / 2 * a2), w + h * a3, u[i + 1])
            x, w = x + h * w + h * h / 6 * (a1 + a2 + a3), w + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return out


def begin(t: Array, y: Array) -> Array:
    """Angle and rate at the start, a parabola through the first ten samples; where a search begins."""
    n = min(10, len(t))
    c = np.polynomial.polynomial.polyfit(t[:n], y[:n], 2)
    return np.array([c[0], c[1]])


def jacobian(f: Callable[[Array], Array], x: Array) -> Array:
    """Forward differences, all columns in one simulation; f takes [n, m]."""
    d = 1e-6 * np.maximum(np.abs(x), 1e-2)
    both = f(np.column_stack([x[:, None] + np.diag(d), x]))
    return (both[:, :-1] - both[:, -1:]) / d


def swing(train: Sequence[tuple[Array, Array, Array]], held: tuple[Array, Array, Array], terms: Sequence[str]) -> float:
    """RMSE on the hold-out, started from its first samples, of a swing fitted to the training."""
    free = (
        [0] * any(u.any() for _, u, _ in train)
        + [1, 2]
        + [i for name, i in (("coulomb", 3), ("constant", 4), ("drag", 5)) if name in terms]
    )
    thin = [tuple(a[:: max(len(a) // MOST, 1)] for a in r) for r in train]

    def full(x: Array) -> Array:
        p = np.zeros((6, x.shape[1]))
        p[free] = x[: len(free)]
        return p

    def left(x: Array) -> Array:
        k = len(free)
        return np.concatenate([swung(full(x), x[k + 2 * i : k + 2 * i + 2], t, u, terms) - y[:, None] for i, (t, u, y) in enumerate(thin)])

    first = {0: 4.0, 1: 30.0 if 0 in free else 64.0, 2: 0.06}
    x0 = np.concatenate([[first.get(i, 0.0) for i in free], *(begin(t, y) for t, _, y in thin)])
    best = min(
        (
            least_squares(
                lambda x: left(x[:, None])[:, 0],
                np.where(np.arange(len(x0)) == len(free) - 1, x0 + kick, x0),
                lambda x: jacobian(left, x),
                x_scale="jac",
                max_nfev=60,
            )
            for kick in (0.0, 0.1)
        ),
        key=lambda r: r.cost,
    )
    t, u, y = held
    p = full(best.x[:, None])
    near = least_squares(lambda s: swung(p, s[:, None], t[:FIRST], u[:FIRST], terms)[:, 0] - y[:FIRST], begin(t, y), x_scale="jac").x
    return float(np.sqrt(np.mean((swung(p, near[:, None], t, u, terms)[:, 0] - y) ** 2)))


def features(r: tuple[Array, Array, Array], shape: Array, terms: Sequence[str]) -> Array:
    """Columns of a force law on a prescribed motion; shape: presliding (or width of the sign), half a play."""
    t, x, _ = r
    seen = x
    if "play" in terms:
        seen = np.empty_like(x)
        at = x[0]
        for i, xi in enumerate(x):
            at = min(max(at, xi - shape[1]), xi + shape[1])
            seen[i] = at
    v, vs = np.gradient(x, t), np.gradient(seen, t)
    columns = [v, seen, np.ones_like(x)]
    if "coulomb" in terms:
        columns.append(np.tanh(v / shape[0]))
    if "hysteresis" in terms:
        z, h = np.zeros_like(x), t[1] - t[0]
        for i in range(1, len(x)):
            goal = np.sign(vs[i])
            z[i] = goal + (z[i - 1] - goal) * np.exp(-abs(vs[i]) * h / shape[0])
        columns.append(z)
    return np.column_stack(columns)


def prescribed(train: Sequence[tuple[Array, Array, Array]], held: tuple[Array, Array, Array], terms: Sequence[str]) -> float:
    """RMSE on the hold-out of a force law fitted to the training: linear in its sizes, shapes by a search."""

    def sizes(log: Array) -> tuple[Array, Array]:
        a = np.concatenate([features(r, np.exp(log), terms) for r in train])
        y = np.concatenate([r[2] for r in train])
        c = np.linalg.lstsq(a, y, rcond=None)[0]
        return c, a @ c - y

    rate = float(np.std(np.gradient(train[0][1], train[0][0])))
    scale = np.log([rate if "coulomb" in terms else float(np.std(train[0][1])), float(np.std(train[0][1]))])
    starts = [scale + np.log([a, b]) for a in (0.03, 0.2) for b in ((0.1, 0.3) if "play" in terms else (0.1,))]
    best = min((least_squares(lambda x: sizes(x)[1], s, diff_step=0.02, max_nfev=30) for s in starts), key=lambda r: r.cost)
    return float(np.sqrt(np.mean((features(held, np.exp(best.x), terms) @ sizes(best.x)[0] - held[2]) ** 2)))


FORMS = {"swing": swing, "prescribed": prescribed}
