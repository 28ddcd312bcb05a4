# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: a packet to the XCP slave takes, on a Cortex-M4F, the instructions that port/xcp/README.md states."""

from __future__ import annotations

import re
import sys

import gate

from penode_sil.building import FLAGS
from penode_sil.targets import MACHINES, PORT

WORK = gate.BUILD / "xcp-cost"
PAGE = gate.ROOT / "port" / "xcp" / "README.md"
SHARE = 0.02  # of a count: what compilers of one version may differ by, as for all figures of README.md


def measured(level: str) -> dict[str, int]:
    """Instructions by packet. SystemExit if one was refused."""
    folder = gate.ROOT / "gen" / "nqvm" / "c"
    WORK.mkdir(parents=True, exist_ok=True)
    elf = WORK / f"cost{level}.elf"
    sources = [*sorted((gate.ROOT / "src").glob("*.c")), folder / "nqvm.c", folder / "nqvm_params.c"]
    gate.make(
        [PORT / "cc", MACHINES["m4f"], *FLAGS, level, "-Wall", "-Wextra", f"-I{folder}", "-o", elf, gate.HERE / "xcp_cost.c", *sources]
    )
    done = gate.run([PORT / "run", MACHINES["m4f"], elf], WORK)
    rows = dict(re.findall(r"^(.+) (\d+)$", done.stdout, re.M))
    if done.returncode != 0 or "refused" in rows or not rows:
        raise SystemExit(f"FAIL  xcp-cost: {done.stdout}{done.stderr}")
    return {name: int(n) for name, n in rows.items()}


def stated(text: str) -> dict[str, tuple[int, int]]:
    """The table of the page: packet, -O2, -Os."""
    rows = re.findall(r"^\| `?([^|`]+)`? \| ([\d ]+) \| ([\d ]+) \|$", text, re.M)
    return {name.strip(): (int(fast.replace(" ", "")), int(small.replace(" ", ""))) for name, fast, small in rows}


def problems(said: dict[str, tuple[int, int]], found: dict[str, tuple[int, int]]) -> list[str]:
    """Where the page is wrong by more than SHARE, or silent."""
    wrong = [f"{name}: {found.get(name)}, the page says {said.get(name)}" for name in sorted(found.keys() ^ said.keys())]
    return wrong + [
        f"{name}: {found[name]}, the page says {said[name]}"
        for name in found
        if name in said and any(abs(a - b) > SHARE * b for a, b in zip(found[name], said[name], strict=True))
    ]


def main() -> int:
    fast, small = measured("-O2"), measured("-Os")
    found = {name: (fast[name], small[name]) for name in fast}
    if "--print" in sys.argv:
        print("\n".join(f"| {name} | {f'{a:,} | {b:,}'.replace(',', ' ')} |" for name, (a, b) in found.items()))
    text = PAGE.read_text(encoding="utf-8")
    good = gate.report(
        f"xcp-cost: {len(found)} kinds of packet take the instructions that port/xcp/README.md states", problems(stated(text), found)
    )
    worse = {name: (2 * a, b) for name, (a, b) in found.items()}
    good &= gate.report(
        "xcp-cost: packets that take twice as many are found", [] if len(problems(stated(text), worse)) == len(found) else ["not found"]
    )
    gate.keep("xcp-cost", {name: {"-O2": a, "-Os": b} for name, (a, b) in found.items()})
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
