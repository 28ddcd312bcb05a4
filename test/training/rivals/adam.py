# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Plain Adam on whole trajectories, in JAX: what training the two networks of a quarter vehicle costs without penode.

`adam.py WORK.npz OUT.npz` reads road, accelerations and their noise (campaign_adam.py writes them) and trains two ReLU networks
1-16-16-16-1 through Runge-Kutta steps of the recording's 1 ms, start state too, by the gradient over the whole recording. Physical
parameters are known. The loop is compiled (lax.scan) and the same in diffrax is timed beside it; the faster one is run to its end. The rate
of learning is that of three that came furthest on the first ten seconds; it falls to 0 as half a cosine. What is reached is kept every 50
epochs, and a call goes on there.
"""

from __future__ import annotations

import os

os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"

import itertools
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from scipy.interpolate import CubicSpline

Tree = Any
WIDTH = (1, 16, 16, 16, 1)
STEP = 1e-3  # [s]
RATES = (3e-3, 1e-2, 3e-2)
TRIED, SHORT = 40, 10_000  # epochs and samples to choose a rate by
EPOCHS, KEPT, STILL = 1000, 50, 1e-3  # ends earlier where the loss fell by less than STILL of itself in 100 epochs
SCALE = (0.03, 0.5), 1000.0  # of deflection [m] and its rate [m/s]; of forces [N]


def weights(key: jax.Array) -> Tree:
    """Weights of a network; its output is small at first."""
    found = []
    for n, (i, o) in enumerate(itertools.pairwise(WIDTH)):
        key, one, two = jax.random.split(key, 3)
        last = n == len(WIDTH) - 2
        found.append(
            (jax.random.normal(one, (o, i)) * (0.02 if last else np.sqrt(2.0 / i)), (0.0 if last else 0.3) * jax.random.normal(two, (o,)))
        )
    return found


def network(net: Tree, x: jax.Array) -> jax.Array:
    """Force at an input, both scaled; 0 at 0."""
    h, rest = jnp.reshape(x, (1,)), jnp.zeros(1)
    for w, b in net[:-1]:
        h, rest = jax.nn.relu(w @ h + b), jax.nn.relu(w @ rest + b)
    return (net[-1][0] @ (h - rest))[0]


def rates(known: dict[str, float], p: Tree, x: jax.Array, road: jax.Array) -> jax.Array:
    """Rates of the states: places of body and wheel, speeds of both."""
    s, v = x[1] - x[0], x[3] - x[2]
    force = known["c"] * s + known["d"] * v + SCALE[1] * (network(p["spring"], s / SCALE[0][0]) + network(p["damper"], v / SCALE[0][1]))
    tyre = known["c_t"] * (x[1] - road[0]) + known["d_t"] * (x[3] - road[1])
    return jnp.stack([x[2], x[3], force / known["m_b"], (-force - tyre) / known["m_w"]])


def scan(known: dict[str, float]) -> Callable[[Tree, jax.Array], jax.Array]:
    """Accelerations [n, 2] by a compiled loop; road [n, 2, 2]: value and rate, at a sample and half a step later."""

    def step(p: Tree, x: jax.Array, at: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
        here, after = at
        k1 = rates(known, p, x, here[0])
        k2 = rates(known, p, x + 0.5 * STEP * k1, here[1])
        k3 = rates(known, p, x + 0.5 * STEP * k2, here[1])
        k4 = rates(known, p, x + STEP * k3, after)
        return x + STEP / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4), k1[2:]

    return lambda p, road: jax.lax.scan(lambda x, at: step(p, x, at), p["start"], (road, jnp.roll(road[:, 0], -1, axis=0)))[1]


def by_diffrax(known: dict[str, float]) -> Callable[[Tree, jax.Array], jax.Array]:
    """The same by diffrax, Tsit5 in constant steps."""

    def found(p: Tree, road: jax.Array) -> jax.Array:
        ts = jnp.arange(len(road)) * STEP
        half = jnp.reshape(road, (-1, 2))
        way = diffrax.LinearInterpolation(jnp.arange(len(half)) * 0.5 * STEP, half)
        solved = diffrax.diffeqsolve(
            diffrax.ODETerm(lambda t, x, p: rates(known, p, x, way.evaluate(t))),
            diffrax.Tsit5(),
            ts[0],
            ts[-1],
            STEP,
            p["start"],
            p,
            saveat=diffrax.SaveAt(ts=ts),
            max_steps=len(road) + 8,
        )
        return jax.vmap(lambda x, r: rates(known, p, x, r[0])[2:])(solved.ys, road)

    return found


def loss_of(
    simulate: Callable[[Tree, jax.Array], jax.Array], road: jax.Array, y: jax.Array, noise: jax.Array
) -> Callable[[Tree], jax.Array]:
    """Mean square of the residual over the noise: 1 is the best possible."""
    return lambda p: jnp.mean(((simulate(p, road) - y) / noise) ** 2)


def adam(
    gradient: Callable[[Tree], tuple[jax.Array, Tree]], p: Tree, state: tuple[Tree, Tree], epoch: int, rate: float
) -> tuple[Tree, tuple[Tree, Tree], float]:
    """One epoch (Kingma and Ba, 2015)."""
    value, g = gradient(p)
    m = jax.tree.map(lambda m, g: 0.9 * m + 0.1 * g, state[0], g)
    v = jax.tree.map(lambda v, g: 0.999 * v + 0.001 * g * g, state[1], g)
    a, b = 1.0 - 0.9 ** (epoch + 1), 1.0 - 0.999 ** (epoch + 1)
    p = jax.tree.map(lambda p, m, v: p - rate * (m / a) / (jnp.sqrt(v / b) + 1e-8), p, m, v)
    return p, (m, v), float(value)


def zeros(p: Tree) -> tuple[Tree, Tree]:
    """Adam's memory at first."""
    return jax.tree.map(jnp.zeros_like, p), jax.tree.map(jnp.zeros_like, p)


def chosen(gradient: Callable[[Tree], tuple[jax.Array, Tree]], p: Tree) -> tuple[float, dict[str, float]]:
    """The rate of learning that comes furthest in a few epochs, and what each came to."""
    ends = {}
    for rate in RATES:
        q, state = p, zeros(p)
        for epoch in range(TRIED):
            q, state, value = adam(gradient, q, state, epoch, rate)
        ends[rate] = value if np.isfinite(value) else np.inf
    return min(ends, key=lambda r: ends[r]), {str(r): e for r, e in ends.items()}


def timed(gradient: Callable[[Tree], tuple[jax.Array, Tree]], p: Tree) -> dict[str, float]:
    """Processor seconds of compiling, and of an epoch (mean of two)."""
    started = time.process_time()
    jax.block_until_ready(gradient(p))
    compiled = time.process_time()
    for _ in range(2):
        jax.block_until_ready(gradient(p))
    return {"first": compiled - started, "epoch": 0.5 * (time.process_time() - compiled)}


def keep(out: Path, p: Tree, state: tuple[Tree, Tree], facts: dict[str, Any]) -> None:
    """All that a later call goes on from."""
    leaves = {f"leaf{n}": np.asarray(v) for n, v in enumerate(jax.tree.leaves((p, state)))}
    nets = {
        f"{name}_{kind}{n}": np.asarray(v)
        for name in ("spring", "damper")
        for n, pair in enumerate(p[name])
        for kind, v in zip("wb", pair, strict=True)
    }
    part = out.with_suffix(".part.npz")
    np.savez(part, **leaves, **nets, facts=json.dumps(facts))
    part.replace(out)


def begin(work: dict[str, Any], out: Path) -> tuple[Tree, tuple[Tree, Tree], dict[str, Any]]:
    """Weights, memory and facts: random and none, or where an earlier call ended."""
    one, two = jax.random.split(jax.random.PRNGKey(0))
    p = {"spring": weights(one), "damper": weights(two), "start": jnp.array([work["road"][0], work["road"][0], 0.0, 0.0])}
    if not out.exists():
        return p, zeros(p), {"epoch": 0, "seconds": 0.0, "losses": []}
    with np.load(out) as kept:
        tree = jax.tree.structure((p, zeros(p)))
        leaves = [jnp.asarray(kept[f"leaf{n}"]) for n in range(tree.num_leaves)]
        return *jax.tree.unflatten(tree, leaves), json.loads(str(kept["facts"]))


def main() -> None:
    """Train, or go on with it, to the end."""
    with np.load(sys.argv[1]) as file:
        work = {n: file[n] for n in file.files}
    out, known = Path(sys.argv[2]), json.loads(str(work["known"]))
    curve = CubicSpline(work["time"], work["road"])
    at = work["time"][:, None] + np.array([0.0, 0.5 * STEP])
    road = jnp.asarray(np.stack([curve(at), curve(at, 1)], axis=2), dtype=jnp.float32)
    y, noise = jnp.asarray(work["y"], dtype=jnp.float32), jnp.asarray(work["noise"], dtype=jnp.float32)
    p, state, facts = begin(work, out)
    gradient = jax.jit(jax.value_and_grad(loss_of(scan(known), road, y, noise)))
    if "scan" not in facts:
        facts["scan"] = timed(gradient, p)
        print(json.dumps(facts), flush=True)
        facts["diffrax"] = timed(jax.jit(jax.value_and_grad(loss_of(by_diffrax(known), road, y, noise))), p)
        print(json.dumps(facts), flush=True)
    if facts["diffrax"]["epoch"] < facts["scan"]["epoch"]:
        gradient = jax.jit(jax.value_and_grad(loss_of(by_diffrax(known), road, y, noise)))
    if "rate" not in facts:
        started = time.process_time()
        facts["rate"], facts["tried"] = chosen(jax.jit(jax.value_and_grad(loss_of(scan(known), road[:SHORT], y[:SHORT], noise))), p)
        facts["choosing"] = time.process_time() - started
        print(json.dumps(facts), flush=True)
    while facts["epoch"] < EPOCHS and not still(facts["losses"]):
        started = time.process_time()
        for epoch in range(facts["epoch"], facts["epoch"] + KEPT):
            p, state, value = adam(gradient, p, state, epoch, facts["rate"] * 0.5 * (1.0 + np.cos(np.pi * epoch / EPOCHS)))
            facts["losses"].append(value)
        facts["epoch"] += KEPT
        facts["seconds"] += time.process_time() - started
        keep(out, p, state, facts)
        print(facts["epoch"], f"{facts['seconds']:.1f} s, loss {value:.4g}", flush=True)


def still(losses: list[float]) -> bool:
    """Has the loss stopped falling?"""
    return len(losses) > 200 and min(losses[-100:]) > (1.0 - STILL) * min(losses[:-100])


if __name__ == "__main__":
    main()
