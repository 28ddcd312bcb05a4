#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
Fit the networks of the nQVM to the force laws that the published case study used as its reality.

    train.py            write networks/*.onnx beside this file and print how well they fit
    train.py --check    fit again and fail if a committed file would change

Each network has the layers 1-16-16-16-1, ReLU, 593 parameters, and *adds* to a linear element of the model (spring
10 000 N/m, damper 800 N s/m), which is no part of it. s = z_b - z_w and v = ds/dt are positive when the suspension gets
longer; a positive force pulls the two masses together.

The laws
    spring          F(s) = (c1 (s + s_u))^2 - (c1 s_u)^2
    damper          F(v) = sqrt(2 e) (F_brk - F_C) exp(-(v/v_St)^2) v/v_St + F_C tanh(v/v_C) + d_lin v
    damper_altered  the same with twice the friction: F_brk = 90 N and F_C = 70 N instead of 45 N and 35 N

The spring law is a parabola: it is lowest (-225 N) at s = -s_u = -30 mm, turns there, and is back at zero at -60 mm. It
is fitted as published over the whole range. With the linear spring it makes 250 000 N/m^2 s (s + 0.1 m), which still
pulls back everywhere above -100 mm, so the model keeps its single rest position; but below -50 mm the sum gets smaller
with every millimetre, which no real spring does. (A law that is mirrored at s = 0 would be the physical reading; it is
not the plant that the published networks and trajectories belong to.)

Twice the friction is what a bent strut or a cold damper has. In the chirp experiment (exchange at 2 s) it moves the
body by up to 3.4 mm against the unaltered damper, where the body moves by 36 mm: easy to see, the same kind of motion.

How it is fitted. A network with one input is a chain of straight pieces, and the best density of their ends is the
square root of the curvature of the law. So the first layer starts with its 16 kinks there, the next two with random
weights and kinks inside the range, and Levenberg-Marquardt moves all 593 numbers together on 1500 samples, half of them
evenly spread, half where the curvature is. Everything is computed in float64, then rounded to float32; the last bias is
chosen after rounding so that F(0) = 0.

The same bytes should come out on every x86-64 processor with AVX2: one thread, one BLAS kernel (set below), random
numbers without library functions, laws rounded to 1e-6 N before they are used.
"""

from __future__ import annotations

import os

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # the order of a sum, and so the result, would depend on the machine
os.environ["OPENBLAS_CORETYPE"] = "HASWELL"

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper
from scipy.linalg import cho_factor, cho_solve

Array = NDArray[np.float64]

WIDTH = 16
SHAPES = ((WIDTH, 1), (WIDTH,), (WIDTH, WIDTH), (WIDTH,), (WIDTH, WIDTH), (WIDTH,), (1, WIDTH), (1,))
SAMPLES = 1500
SPREAD = 0.5  # power of the local kink density that the first weights start with
DECAY = 1e-7  # keeps weights that do not matter small
FLOOR = 1e-4  # smallest damping of a parameter, as a part of the largest
SEED = 2  # of 10 tried, the one with the best fit of all three

C1, S_U = 500.0, 0.03  # N^(1/2)/m, m
V_BRK, D_LIN = 0.02, 150.0  # m/s, N s/m
V_ST, V_C = V_BRK / np.sqrt(2.0), V_BRK / 10.0  # m/s


def spring(s: Array) -> Array:
    """Progressive spring [N] at the deflection s [m]."""
    return (C1 * (s + S_U)) ** 2 - (C1 * S_U) ** 2


def spring_curvature(s: Array) -> Array:
    """d2F/ds2 [N/m^2]."""
    return np.full_like(s, 2.0 * C1**2)


def friction(v: Array, f_brk: float, f_c: float) -> Array:
    """Stribeck, Coulomb and viscous friction [N] at the rate v [m/s]; f_brk, f_c [N]."""
    stribeck = np.sqrt(2.0 * np.e) * (f_brk - f_c) * np.exp(-((v / V_ST) ** 2)) * v / V_ST
    return stribeck + f_c * np.tanh(v / V_C) + D_LIN * v


def friction_curvature(v: Array, f_brk: float, f_c: float) -> Array:
    """d2F/dv2 [N s^2/m^2]."""
    u, t = v / V_ST, np.tanh(v / V_C)
    stribeck = np.sqrt(2.0 * np.e) * (f_brk - f_c) * np.exp(-(u**2)) * (4.0 * u**3 - 6.0 * u) / V_ST**2
    return stribeck - 2.0 * f_c * t * (1.0 - t**2) / V_C**2


@dataclass(frozen=True)
class Task:
    """What one network is fitted to. It works on x / limit and gives F / scale."""

    name: str
    law: Callable[[Array], Array]
    curvature: Callable[[Array], Array]
    limit: float  # m or m/s: the trained range is -limit .. limit
    scale: float  # N, the largest force in the range
    signal: tuple[str, str]  # name and unit of the input
    text: str


def damper_task(name: str, f_brk: float, f_c: float, scale: float) -> Task:
    return Task(
        name,
        lambda v: friction(v, f_brk, f_c),
        lambda v: friction_curvature(v, f_brk, f_c),
        1.5,
        scale,
        ("rate", "m/s"),
        f"friction, F_brk = {f_brk:g} N, F_C = {f_c:g} N",
    )


TASKS = (
    Task("spring", spring, spring_curvature, 0.08, 2800.0, ("deflection", "m"), f"progressive spring, c1 = {C1:g}, s_u = {S_U:g} m"),
    damper_task("damper", 45.0, 35.0, 260.0),
    damper_task("damper_altered", 90.0, 70.0, 295.0),
)


def by_curvature(task: Task, n: int) -> Array:
    """n places in -1 .. 1 (of the limit), as dense as the square root of the curvature; rounded, see above."""
    x = np.linspace(-1.0, 1.0, 200_001)
    density = np.sqrt(np.abs(task.curvature(x * task.limit)))
    share = np.concatenate([[0.0], np.cumsum(density[1:] + density[:-1])])
    return np.round(np.interp((np.arange(n) + 0.5) / n, share / share[-1], x), 9)


def unpack(p: Array) -> list[Array]:
    """Weights and biases of the four layers, as views into the vector p [593]."""
    ends = np.cumsum([np.prod(s) for s in SHAPES])
    return [part.reshape(s) for part, s in zip(np.split(p, ends[:-1]), SHAPES, strict=True)]


def forward(p: Array, x: Array) -> tuple[Array, Array, Array, Array]:
    """Outputs of the three hidden layers [m, 16] and of the network [m] at x [m], both scaled."""
    w1, b1, w2, b2, w3, b3, w4, b4 = unpack(p)
    h1 = np.maximum(x[:, None] * w1[:, 0] + b1, 0.0)
    h2 = np.maximum(h1 @ w2.T + b2, 0.0)
    h3 = np.maximum(h2 @ w3.T + b3, 0.0)
    return h1, h2, h3, h3 @ w4[0] + b4[0]


def sensitivity(p: Array, x: Array) -> tuple[Array, Array]:
    """d y / d p [m, 593] and y [m]."""
    _, _, w2, _, w3, _, w4, _ = unpack(p)
    h1, h2, h3, y = forward(p, x)
    d3 = (h3 > 0.0) * w4[0]
    d2 = (d3 @ w3) * (h2 > 0.0)
    d1 = (d2 @ w2) * (h1 > 0.0)
    m = x.size
    w2_part = (d2[:, :, None] * h1[:, None, :]).reshape(m, -1)
    w3_part = (d3[:, :, None] * h2[:, None, :]).reshape(m, -1)
    return np.concatenate([d1 * x[:, None], d1, w2_part, d2, w3_part, d3, h3, np.ones((m, 1))], axis=1), y


def start(task: Task, x: Array, rng: np.random.Generator) -> Array:
    """Parameters to start from: see the head of this file. x [m] are the sorted samples, scaled."""
    kinks = by_curvature(task, WIDTH)
    w1 = np.where(np.arange(WIDTH) % 2 == 0, 1.0, -1.0) * rng.uniform(0.8, 1.2, WIDTH)
    w1 *= (2.0 / WIDTH / np.gradient(kinks)) ** SPREAD
    parts = [w1, -w1 * kinks]
    h = np.maximum(x[:, None] * w1 - w1 * kinks, 0.0)
    for _ in range(2):
        w = rng.uniform(-1.0, 1.0, (WIDTH, WIDTH))
        w /= (h @ w.T).std(axis=0)[:, None]
        at = rng.permutation(by_curvature(task, WIDTH))
        b = -(w * np.array([np.interp(at, x, column) for column in h.T]).T).sum(axis=1)
        parts += [w.ravel(), b]
        h = np.maximum(h @ w.T + b, 0.0)
    return np.concatenate([*parts, rng.uniform(-0.5, 0.5, WIDTH), [0.0]])


def fit(task: Task, iterations: int) -> Array:
    """The parameters p [593] as float64 numbers that float32 holds exactly."""
    x = np.sort(np.concatenate([np.linspace(-1.0, 1.0, SAMPLES // 2 + 1), by_curvature(task, SAMPLES // 2)]))
    target = np.round(task.law(x * task.limit), 6) / task.scale
    weight = np.where(x == 0.0, 30.0, 1.0)
    p = start(task, x, np.random.default_rng(SEED))

    def cost(q: Array, y: Array) -> float:
        return float((weight * (y - target) ** 2).sum() + DECAY * (q @ q))

    damping = 0.1
    for _ in range(iterations):
        j, y = sensitivity(p, x)
        normal = j.T @ (j * weight[:, None]) + DECAY * np.eye(p.size)
        slope = j.T @ (weight * (y - target)) + DECAY * p
        diagonal = normal.diagonal() + FLOOR * normal.diagonal().max()
        for _ in range(8):
            q = p - cho_solve(cho_factor(normal + np.diag(damping * diagonal)), slope)
            if cost(q, forward(q, x)[3]) < cost(p, y):
                break
            damping *= 4.0
        else:
            break  # no step makes it better
        p, damping = q, max(damping / 3.0, 1e-12)
    p = p.astype(np.float32).astype(np.float64)
    p[-1] = np.float32(p[-1] - forward(p, np.zeros(1))[3][0])
    return p


def model(task: Task, p: Array) -> onnx.ModelProto:
    """The network between its scalings, with physical units at both ends."""

    def constant(name: str, value: object) -> onnx.TensorProto:
        return numpy_helper.from_array(np.asarray(value, dtype=np.float32), name)

    signal, unit = task.signal
    constants = [constant("mean", [0.0]), constant("limit", [task.limit]), constant("scale", [task.scale])]
    nodes = [
        helper.make_node("Sub", [signal, "mean"], ["centred"], "centre"),
        helper.make_node("Div", ["centred", "limit"], ["h0"], "normalise"),
    ]
    layers = unpack(p)
    for i in range(1, 5):
        constants += [constant(f"weights{i}", layers[2 * i - 2]), constant(f"bias{i}", layers[2 * i - 1])]
        last = "h4" if i == 4 else f"z{i}"
        nodes.append(helper.make_node("Gemm", [f"h{i - 1}", f"weights{i}", f"bias{i}"], [last], f"dense{i}", transB=1))
        if i < 4:
            nodes.append(helper.make_node("Relu", [f"z{i}"], [f"h{i}"], f"relu{i}"))
    nodes.append(helper.make_node("Mul", ["h4", "scale"], ["force"], "denormalise"))
    ends = [helper.make_tensor_value_info(name, TensorProto.FLOAT, ["batch", 1]) for name in (signal, "force")]
    graph = helper.make_graph(nodes, task.name, ends[:1], ends[1:], constants)
    result = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8, producer_name="penode")
    result.doc_string = f"{task.text}; input {signal} in {unit}, output force in N; written by gen/nqvm/train.py"
    bounds = {"penode.input_min": f"{-task.limit:g}", "penode.input_max": f"{task.limit:g}"}
    helper.set_model_props(result, bounds)
    onnx.checker.check_model(result)
    return result


def row(task: Task, p: Array) -> str:
    """One line of the table: how far the rounded network is from its law, over the whole range."""
    even = np.linspace(-1.0, 1.0, 400_001)
    dense = np.concatenate([even, by_curvature(task, 100_000)])
    error, law = forward(p, dense)[3] * task.scale - task.law(dense * task.limit), task.law(even * task.limit)
    rms, worst, span = np.sqrt(np.mean(error[: even.size] ** 2)), np.abs(error).max(), np.ptp(law)
    active = np.concatenate(forward(p, np.sort(dense))[:3], axis=1) > 0.0
    pieces = 1 + np.count_nonzero((active[1:] != active[:-1]).any(axis=1))
    at_zero = forward(p, np.zeros(1))[3][0] * task.scale
    return (
        f"{task.name:15} {span:8.1f} {rms:8.3f} {100 * rms / span:8.4f} {worst:8.3f} {100 * worst / span:8.4f} "
        f"{at_zero:9.1e} {pieces:7} {np.count_nonzero(active.any(axis=0)):4} of {active.shape[1]}"
    )


def main() -> int:
    parser = argparse.ArgumentParser(description="fit the networks of the nQVM")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "networks", help="folder of the ONNX files")
    parser.add_argument("--check", action="store_true", help="write nothing; exit 1 if a file would change")
    parser.add_argument("--iterations", type=int, default=250, help="fewer for a quick, rough fit (default 250)")
    options = parser.parse_args()
    print("network           span N    RMS N    RMS %    max N    max %    F(0) N  pieces units used")
    changed = []
    for task in TASKS:
        p = fit(task, options.iterations)
        print(row(task, p), flush=True)
        content, path = model(task, p).SerializeToString(deterministic=True), options.out / f"{task.name}.onnx"
        if options.check:
            changed += [path.name] * (not path.exists() or path.read_bytes() != content)
        else:
            options.out.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
    if changed:
        print(f"changed: {', '.join(changed)}; run train.py without --check and commit the result", file=sys.stderr)
    return 1 if changed else 0


if __name__ == "__main__":
    sys.exit(main())
