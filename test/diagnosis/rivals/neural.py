# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Rival of the diagnosis: an additional force without a name, a tanh network of 25 weights, fitted by output error.

The network sits beside the first spring and sees deflection and rate. Parameters are first fitted within their tolerance. Two thirds of
every training recording train it, the rest decides whether it is kept. Levenberg-Marquardt; derivatives by finite differences, all in one
simulation.
"""

import numpy as np
from numba import njit
from rig import Recording, Rig, run

HIDDEN = 6  # 2 * 6 inputs, 6 offsets, 6 outputs, 1 offset: 25 weights
WEIGHTS = 4 * HIDDEN + 1
ITERATIONS = 12
PRIOR = 10.0  # standard deviation of a weight: keeps flat directions where they are
SURE = 3.0  # standard errors of the mean by which blocks of a second have to become better


@njit(error_model="numpy", cache=True)
def walk(w: np.ndarray, both: np.ndarray, shifts: np.ndarray, g: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """States and forces (samples, rows, lanes) of networks with weights w (25, lanes), in SI, at the first place; see rig.stepped."""
    places, (n, lanes) = g.shape[1], start.shape
    x, f = np.zeros((len(shifts), n, lanes)), np.zeros((len(shifts), places, lanes))
    now, sums = np.zeros(n), np.zeros(len(both))
    for lane in range(lanes):
        now[:] = start[:, lane]
        for k in range(len(shifts)):
            x[k, :, lane] = now
            for i in range(len(both)):
                sums[i] = shifts[k, i]
                for j in range(n):
                    sums[i] += both[i, j] * now[j]
            s, v, total = sums[0], sums[places], w[-1, lane]
            for h in range(HIDDEN):
                inner = w[h, lane] * s + w[HIDDEN + h, lane] * v + w[2 * HIDDEN + h, lane]
                total += w[3 * HIDDEN + h, lane] * np.tanh(inner)
            f[k, 0, lane] = total
            for i in range(n):
                now[i] = sums[2 * places + i] + g[i, 0] * total
    return x, f


class Network:
    """Forces of networks with weights w (25, lanes) at the first of some places; scale: of deflection, rate and force."""

    def __init__(self, w: np.ndarray, scale: np.ndarray, places: int):
        self.places = places
        self.w = w * np.append(np.repeat([1 / scale[0], 1 / scale[1], 1.0, scale[2]], HIDDEN), scale[2])[:, None]

    def __call__(self, s: np.ndarray, v: np.ndarray) -> np.ndarray:
        by_s, by_v, offset, out = (self.w[i * HIDDEN : (i + 1) * HIDDEN] for i in range(4))
        f = np.zeros((self.places, self.w.shape[1]))
        f[0] = (out * np.tanh(by_s * s[0] + by_v * v[0] + offset)).sum(axis=0) + self.w[-1]
        return f

    def walk(self, *parts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return walk(self.w, *map(np.ascontiguousarray, parts))


def cut(r: Recording) -> Recording:
    """The first two thirds."""
    n = 2 * len(r.given) // 3
    return Recording(r.step, r.given[:n], {k: y[:n] for k, y in r.seen.items()})


def answer(rig: Rig, data: list[Recording], holdout: Recording) -> dict:
    lin = rig.linear(rig.fitted(data))
    starts, train, places = [rig.start(r, lin=lin) for r in data], [cut(r) for r in data], len(rig.places)
    plain = [rig.simulate(r, x0, lin=lin) for r, x0 in zip(data, starts, strict=True)]
    moved = np.vstack([x[:, :, 0] @ lin.s.T + r.given @ lin.su.T for r, (x, _, _) in zip(data, plain, strict=True)])
    s, v = moved[:, 0], moved[:, places]
    both = [rig.parameters[p] * m for m, law in ((s, "linear_spring"), (v, "linear_damper")) if (p := rig.coefficient(0, law))]
    scale = np.array([s.std(), v.std(), 0.1 * np.sum(both, axis=0).std()])

    def off(w: np.ndarray) -> np.ndarray:
        """Residuals (all samples, lanes) of the training part, with the prior's."""
        force, parts = Network(w, scale, places), []
        for r, x0 in zip(train, starts, strict=True):
            said = rig.simulate(r, np.repeat(x0, w.shape[1], axis=1), force, lin)[2]
            parts.append(rig.residual(r, said).reshape(-1, w.shape[1]))
        return np.vstack([*parts, w / PRIOR])

    w = np.random.default_rng(0).normal(0, 1, WEIGHTS)
    w[3 * HIDDEN :] *= 0.01
    damping, change = 1.0, 1e-4
    lanes = off(w[:, None] + change * np.eye(WEIGHTS, WEIGHTS + 1))
    for _ in range(ITERATIONS):
        r, slope = lanes[:, -1], (lanes[:, :-1] - lanes[:, -1:]) / change
        square = slope.T @ slope
        steps = np.column_stack(  # several lengths at once, the derivatives of the best follow
            [-np.linalg.solve(square + d * np.diag(np.diag(square) + 1e-9), slope.T @ r) for d in damping * 10.0 ** np.arange(-2, 3)]
        )
        costs = (off(w[:, None] + steps) ** 2).sum(axis=0)
        best, before = int(np.argmin(costs)), float(r @ r)
        if not costs[best] < before:
            damping *= 1e3
            if damping > 1e8:
                break
            continue
        w, damping = w + steps[:, best], damping * 10.0 ** (best - 2)
        if costs[best] > before * (1 - 1e-4):
            break
        lanes = off(w[:, None] + change * np.eye(WEIGHTS, WEIGHTS + 1))

    force, won = Network(w[:, None], scale, places), []
    for r, x0, (_, _, linear) in zip(data, starts, plain, strict=True):
        n, second = 2 * len(r.given) // 3, round(1 / r.step)
        less = rig.residual(r, linear) ** 2 - rig.residual(r, rig.simulate(r, x0, force, lin)[2]) ** 2
        less = less.sum(axis=(1, 2))[n:]
        won += [block.mean() for block in np.array_split(less, max(len(less) // second, 2))]
    sure = np.mean(won) > SURE * np.std(won, ddof=1) / np.sqrt(len(won))
    causes = [{"kind": "outside_taxonomy", "where": rig.element(0, "linear_spring") or "", "parameters": {}, "alternatives": []}]
    return {
        "verdict": "unexplained" if sure else "no_discrepancy",
        "causes": causes if sure else [],
        "gain": rig.gain(holdout, force if sure else None, lin),
    }


if __name__ == "__main__":
    run(answer, __doc__)
