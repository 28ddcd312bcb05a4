# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Rival of the diagnosis: an additional force without a name, a tanh network of 25 weights, fitted by output error.

The network sits beside the first spring and sees deflection and rate. Parameters are first fitted within their tolerance. Two thirds of every
training recording train it, the rest decides whether it is kept. Levenberg-Marquardt; derivatives by finite differences, all in one simulation.
"""

import numpy as np
from rig import Force, Recording, Rig, run

HIDDEN = 6  # 2 * 6 inputs, 6 offsets, 6 outputs, 1 offset: 25 weights
WEIGHTS = 4 * HIDDEN + 1
ITERATIONS = 12
PRIOR = 10.0  # standard deviation of a weight: keeps flat directions where they are
SURE = 3.0  # standard errors of the mean by which blocks of a second have to become better


def network(w: np.ndarray, scale: np.ndarray, places: int) -> Force:
    """Force of networks with weights w (25, lanes) at the first place; scale: of deflection, rate and force."""
    by_s, by_v, offset, out = (w[i * HIDDEN : (i + 1) * HIDDEN] for i in range(4))
    by_s, by_v, out, last = by_s / scale[0], by_v / scale[1], out * scale[2], w[-1] * scale[2]
    f, inner, more = np.zeros((places, w.shape[1])), np.empty_like(out), np.empty_like(out)

    def force(s: np.ndarray, v: np.ndarray) -> np.ndarray:
        np.multiply(by_s, s[0], out=inner)
        np.multiply(by_v, v[0], out=more)
        np.add(inner, more, out=inner)
        np.add(inner, offset, out=inner)
        np.multiply(out, np.tanh(inner, out=inner), out=inner)
        np.add(np.add.reduce(inner, out=f[0]), last, out=f[0])
        return f

    return force


def cut(r: Recording) -> Recording:
    """The first two thirds."""
    n = 2 * len(r.given) // 3
    return Recording(r.step, r.given[:n], {k: y[:n] for k, y in r.seen.items()})


def answer(rig: Rig, data: list[Recording], holdout: Recording) -> dict:
    lin = rig.linear(rig.fitted(data))
    starts, train, places = [rig.start(r, lin=lin) for r in data], [cut(r) for r in data], len(rig.places)
    plain = [rig.simulate(r, x0, lin=lin) for r, x0 in zip(data, starts)]
    moved = np.vstack([x[:, :, 0] @ lin.s.T + r.given @ lin.su.T for r, (x, _, _) in zip(data, plain)])
    s, v = moved[:, 0], moved[:, places]
    both = [rig.parameters[p] * m for m, law in ((s, "linear_spring"), (v, "linear_damper")) if (p := rig.coefficient(0, law))]
    scale = np.array([s.std(), v.std(), 0.1 * np.sum(both, axis=0).std()])

    def off(w: np.ndarray) -> np.ndarray:
        """Residuals (all samples, lanes) of the training part, with the prior's."""
        force, parts = network(w, scale, places), []
        for r, x0 in zip(train, starts):
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

    force, won = network(w[:, None], scale, places), []
    for r, x0, (_, _, linear) in zip(data, starts, plain):
        n, second = 2 * len(r.given) // 3, round(1 / r.step)
        less = rig.residual(r, linear) ** 2 - rig.residual(r, rig.simulate(r, x0, force, lin)[2]) ** 2
        less = less.sum(axis=(1, 2))[n:]
        won += [block.mean() for block in np.array_split(less, max(len(less) // second, 2))]
    sure = np.mean(won) > SURE * np.std(won, ddof=1) / np.sqrt(len(won))
    causes = [{"kind": "outside_taxonomy", "where": rig.element(0, "linear_spring") or "", "parameters": {}, "alternatives": []}]
    return {"verdict": "unexplained" if sure else "no_discrepancy", "causes": causes if sure else [],
            "gain": rig.gain(holdout, force if sure else None, lin)}  # fmt: skip


if __name__ == "__main__":
    run(answer, __doc__)
