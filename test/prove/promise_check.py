# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: pen_promise_kept() accepts no set that breaks a promise, and refuses none that keeps it by more than the margin."""

from __future__ import annotations

import argparse
import ctypes
import os
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

import gate
import numpy as np
import promise_nets
from promise_reference import ZERO_AT_ZERO, Line, Margins, Net, Promise, zero_bits

WORK = gate.BUILD / "promise"
SOURCES = ("pen_promise", "pen_cell", "pen_net", "pen_math")
KINDS = {0x1: "increasing", 0x2: "decreasing", 0x4: "dissipative", 0x8: "max_slope", 0x10: "max_force", 0x20: "zero_at_zero"}
LOOKS = 2000
LAYERS = {"dense": 0, "relu": 1, "centre": 2, "rescale": 3}

# Faults: file, and the change of gate.faulty.
FAULTS = {
    "no rounding errors": ("pen_cell", ("((pen_real_t)0.53125F * PEN_REAL_EPSILON)", 0, "ZERO")),
    "the margin is eight times as wide": (
        "pen_cell",
        ("((pen_real_t)0.53125F * PEN_REAL_EPSILON)", 0, "((pen_real_t)4 * PEN_REAL_EPSILON)"),
    ),
    "a promise is not looked at": ("pen_promise", ("broken |= bounded ? 0U : PEN_PROMISE_MAX_SLOPE;", 0, "(void)bounded;")),
    "the outer pieces are not looked at": ("pen_promise", ("broken |= at_edge ? 0U :", 0, "broken |= (at_edge || endless) ? 0U :")),
    "one side only": ("pen_promise", ("broken = travel(&line, promise, start, -ONE, lowest, &looks, &at);", 0, "broken = 0U;")),
    "undecided neurons are off": ("pen_cell", ("(((pattern >> i) & 1U) != 0U)", 0, "false")),
    "undecided neurons are on or off at once": ("pen_cell", ("pattern < ((uint32_t)1U << part->open)", 0, "pattern < 1U")),
    "many undecided neurons are off": (
        "pen_cell",
        ("const pen_real_t most = (high > ZERO) ? high : ZERO;", 0, "const pen_real_t most = ZERO;"),
    ),
    "a cell goes on past the kink": ("pen_cell", ("? ((size - error) / closing)", 0, "? ((pen_real_t)4 * ((size - error) / closing))")),
}


def library(real: type, name: str = "right", fault: str = "", changed: tuple[str, int, str] = ("", 0, "")) -> Path:
    """The promise check with the kernels it calls, as a shared library; with a change in one file."""
    WORK.mkdir(parents=True, exist_ok=True)
    sources = [gate.ROOT / "src" / f"{source}.c" for source in SOURCES]
    if fault:
        copy = WORK / f"{name}.c"
        copy.write_text(gate.faulty((gate.ROOT / "src" / f"{fault}.c").read_text(), changed))
        sources = [copy if source.stem == fault else source for source in sources]
    target = WORK / f"{name}-{real.__name__}.so"
    options = ["-DPEN_REAL_DOUBLE"] if real is np.float64 else []
    gate.make(
        [
            "gcc",
            "-std=c99",
            "-O2",
            "-ffp-contract=off",
            "-shared",
            "-fPIC",
            *options,
            f"-I{gate.ROOT}/inc",
            f"-I{gate.ROOT}/port/gnu",
            "-o",
            target,
            *sources,
        ]
    )
    return target


class Checker:
    """pen_promise_kept() of one real type."""

    def __init__(self, path: Path, real: type):
        number = ctypes.c_float if real is np.float32 else ctypes.c_double

        class Made(ctypes.Structure):
            _fields_ = [
                ("kinds", ctypes.c_uint32),
                ("looks", ctypes.c_uint32),
                ("band", number),
                ("max_slope", number),
                ("max_force", number),
            ]

        class Breach(ctypes.Structure):
            _fields_ = [("network", ctypes.c_uint32), ("kind", ctypes.c_uint32), ("at", number)]

        self.made, self.breach, self.real = Made, Breach, real
        self.function = ctypes.CDLL(str(path)).pen_promise_kept
        self.function.restype = ctypes.c_bool

    def load(self, net: Net) -> None:
        """Put a network where the C finds it."""
        self.layers = (ctypes.c_uint32 * (3 * len(net.layers)))()
        for i, layer in enumerate(net.layers):
            self.layers[3 * i : 3 * i + 3] = (
                LAYERS[layer.kind],
                layer.n_out if layer.kind in ("centre", "rescale") else layer.n_in,
                layer.n_out,
            )
        width = max([1] + [layer.n_out for layer in net.layers])
        neurons = sum(layer.n_out for layer in net.layers if layer.kind == "relu")

        class Chain(ctypes.Structure):
            _fields_ = [("layer", ctypes.c_void_p), ("layers", ctypes.c_uint32), ("width", ctypes.c_uint32), ("neurons", ctypes.c_uint32)]

        self.chain = Chain(ctypes.addressof(self.layers), len(net.layers), width, neurons)
        self.values = np.concatenate([np.array([net.low, net.high]), *(_stream(layer) for layer in net.layers)]).astype(self.real)
        self.work = np.full(8 * width, np.nan, self.real)
        self.active = np.zeros(max(1, neurons), np.uint8)
        self.clamp = net.clamp

    def keeps(self, promise: Promise) -> tuple[bool, int, float]:
        breach = self.breach()
        made = self.made(promise.kind, LOOKS, *(3 * [promise.limit]))
        kept = self.function(
            ctypes.byref(made),
            ctypes.byref(self.chain),
            ctypes.c_void_p(self.values.ctypes.data),
            ctypes.c_bool(self.clamp),
            ctypes.c_size_t(0),
            None,
            ctypes.c_void_p(self.work.ctypes.data),
            ctypes.c_void_p(self.active.ctypes.data),
            ctypes.byref(breach),
        )
        return kept, breach.kind, breach.at


def _stream(layer) -> np.ndarray:
    """A layer's values in the order of inc/penode/pen_net.h, for up to three rows of blocks of 16, 4 and 1."""
    if layer.kind in ("centre", "rescale"):
        return np.array([*layer.weights[0], *layer.bias])
    w, b, parts, row = np.array(layer.weights), np.array(layer.bias), [], 0
    for size in (16, 4, 1):
        while len(b) - row >= size:
            parts += [b[row : row + size], w[row : row + size].T.ravel()]
            row += size
    return np.concatenate(parts)


@dataclass
class Result:
    bad: int = 0
    good: int = 0
    close: int = 0  # bad ones that would be accepted if the limit were moved by a hair, or that break by less than the margin
    between: Counter = field(default_factory=Counter)
    kinds: Counter = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)


def trial(seed: int, bad: int, good: int, paths: dict[type, Path], first: bool = False) -> Result:
    """Draw networks until so many sets were bad, and so many good; with `first` only up to the first wrong answer."""
    draw, found = np.random.default_rng(seed), Result()
    checkers = {real: Checker(path, real) for real, path in paths.items()}
    while (found.bad < bad or found.good < good) and not (first and found.wrong):
        net = promise_nets.net(draw)
        line, margins = Line(net), None
        checker = checkers[net.real]
        checker.load(net)
        for promise in promise_nets.promises(draw, net, line):
            kept, broken, at = checker.keeps(promise)
            holds = zero_bits(net) if promise.kind == ZERO_AT_ZERO else line.keeps(promise)
            if not holds:
                found.bad += 1
                found.kinds["bad " + KINDS[promise.kind]] += 1
            elif found.good < good or kept is False:
                if margins is None and promise.kind != ZERO_AT_ZERO:
                    margins = Margins(net, line, float if net.real is np.float32 else Fraction)
                beyond = promise.kind == ZERO_AT_ZERO or margins.keeps(promise)
                found.good += beyond
                found.kinds[("good " if beyond else "between ") + KINDS[promise.kind]] += 1
                found.between[kept] += not beyond
                if beyond and not kept:
                    found.wrong.append(f"refused: {KINDS[promise.kind]} {promise.limit!r} at {at!r}: {net}")
            if kept and not holds:
                found.wrong.append(f"accepted: {KINDS[promise.kind]} {promise.limit!r}: {net}")
            if kept != (broken == 0) or (broken & ~promise.kind):
                found.wrong.append(f"tells {broken:#x} of {promise.kind:#x}: {net}")
    return found


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--bad", type=int, default=100_000, help="sets that break a promise")
    options.add_argument("--good", type=int, default=10_000, help="sets that keep it by more than the margin")
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    options.add_argument("--as", dest="key", default="promise", help="key in figures.json; none: not kept")
    options.add_argument("--no-faults", action="store_true", help="only the networks, no faults in the C")
    given = options.parse_args()
    paths = {real: library(real) for real in (np.float32, np.float64)}
    parts = max(given.jobs, given.bad // 1000)
    total = Result()
    with ProcessPoolExecutor(given.jobs) as pool:
        runs = [pool.submit(trial, given.seed * 100_000 + k, -(-given.bad // parts), -(-given.good // parts), paths) for k in range(parts)]
        for done in (run.result() for run in runs):
            total.bad, total.good, total.between, total.kinds = (
                total.bad + done.bad,
                total.good + done.good,
                total.between + done.between,
                total.kinds + done.kinds,
            )
            total.wrong += done.wrong
    good = gate.report(
        f"promise: 0 of {total.bad} sets that break a promise accepted, 0 of {total.good} that keep it by more than the margin refused",
        total.wrong[:10],
    )
    print(
        "    "
        + ", ".join(f"{n} {what}" for what, n in sorted(total.kinds.items()))
        + f"; between, accepted {total.between[True]}, refused {total.between[False]}"
    )
    if given.no_faults:
        return int(not good)
    missed = []
    for k, (fault, (file, change)) in enumerate(FAULTS.items()):
        wrong = trial(given.seed, 6000, 1200, {real: library(real, f"fault{k}", file, change) for real in paths}, first=True).wrong
        missed += [] if wrong else [f"not found: {fault}"]
    good &= gate.report(f"promise: {len(FAULTS) - len(missed)} of {len(FAULTS)} faults found", missed)
    if given.key != "none":
        gate.keep(
            given.key,
            {
                "bad": total.bad,
                "good": total.good,
                "wrong": len(total.wrong),
                "faults": list(FAULTS),
                "faults found": len(FAULTS) - len(missed),
            },
        )
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
