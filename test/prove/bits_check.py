# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: exp, tanh, sigmoid and softplus give the same bits on the host and on every core, at a million floats."""

from __future__ import annotations

import os
import sys

import gate

from penode_sil.targets import MACHINES

WORK = gate.BUILD / "bits"
COMPILERS = {"gcc": ("host", "gcc"), "clang": ("host", "clang-19")} | {
    name: ("cortex-m", board) for name, board in MACHINES.items() if board
}


def hashes(name: str, *flags: str) -> list[str]:
    """What bits.c prints, built by one compiler for one machine."""
    port, target = COMPILERS[name]
    elf = WORK / f"{name}{''.join(flags)}"
    folder = gate.ROOT / "port" / port
    gate.make(
        [
            folder / "cc",
            target,
            "-std=c99",
            "-O2",
            "-fno-strict-aliasing",
            *flags,
            "-o",
            elf,
            gate.HERE / "bits.c",
            gate.ROOT / "src" / "pen_math.c",
        ]
    )
    done = gate.run([folder / "run", target, elf], limit=3600, env=os.environ | {"LIMIT": "3500"})
    return done.stdout.split() if done.returncode == 0 else [f"exit code {done.returncode}: {done.stdout}{done.stderr}"]


def main() -> int:
    WORK.mkdir(parents=True, exist_ok=True)
    found = {name: hashes(name) for name in COMPILERS}
    right = found["gcc"]
    problems = [f"{name}: {said}" for name, said in found.items() if said != right or len(set(said)) != 4]
    good = gate.report(f"bits: exp, tanh, sigmoid, softplus: 10^6 floats, the same on {len(found)} targets", problems)
    caught = hashes("m4f", "-ffp-contract=fast", "-DPEN_EXACT_H") != right  # without the header that prevents it
    good &= gate.report("bits: a fused multiply-add is found", [] if caught else ["not found"])
    gate.keep(
        "bits",
        {
            "floats": 1_000_000,
            "targets": list(found),
            "different": len(problems),
            "hashes": right,
            "faults": ["a fused multiply-add"],
            "faults found": int(caught),
        },
    )
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
