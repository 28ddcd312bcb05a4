# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: spin_swap.pml is src/pen_set.c, has no error in any of its states, and every fault put into it is found."""

from __future__ import annotations

import re
import sys
from typing import NamedTuple

import gate

MODEL = gate.HERE / "spin_swap.pml"
PARTS = [MODEL, gate.HERE / "spin_step.pml"]  # those that stand for lines of pen_set.c
SOURCE = gate.ROOT / "src" / "pen_set.c"
WORK = gate.BUILD / "spin"

FAULTS = {
    1: "publish: no barrier before pending",
    3: "adopt: no barrier between active and pending",
    4: "settle: no barrier after pending was read as nothing",
    5: "begin while a set waits",
    6: "select while a set waits",
    7: "rollback while a set waits",
    8: "adopt: pending cleared before active is flipped",
    9: "publish: pending before the slot is written",
    10: "begin: always the first bank",
    11: "begin: the rollback set is not given up with its bank",
    12: "publish: the new set becomes the rollback set",
    13: "adopt: active is not flipped",
    14: "adopt: not while holding",
    15: "publish: pending forgotten",
    16: "commit: values not checked",
    17: "write: goes on after the end",
    18: "abort: the set stays open",
    19: "publish: folded into the slot that runs",
    20: "commit: not all values needed",
    21: "withdraw: the tuning context clears pending itself",
    22: "adopt: adopts on any word",
    23: "adopt: withdraws on any request, without a look at its slot",
    24: "withdraw: requested without looking at pending",
    26: "withdraw: requested again while the step answers",
    27: "settle: the rollback set is not put back after a withdrawal",
    28: "adopt: a request that came too late is left in pending",
    29: "begin_copy: looks for the running set before it is settled",
    30: "publish: the rollback set is replaced before it is kept",
}
HARMLESS = "adopt: no barrier after pending was read; the one before pending is cleared comes before the set is read, too"  # 2


class Outcome(NamedTuple):
    """What Spin said: the first error, or None; how many states it saw; text that tells what is wrong with the run."""

    error: str | None
    states: int
    trouble: str


def search(*, weak: bool, live: bool, mutant: int = 0, limit: float = 3600) -> Outcome:
    """Look at all states; live: for a set that is never adopted, else for failed assertions and dead ends."""
    WORK.mkdir(parents=True, exist_ok=True)
    selects = ["-DSELECT"] if live and weak else []
    gate.make(["spin", *(["-DWEAK"] if weak else []), *selects, f"-DMUTANT={mutant}", "-a", MODEL], WORK)
    level = "-O0" if mutant else "-O2"  # a fault is found sooner than it is compiled
    gate.make(["gcc", level, "-w", "-DCOLLAPSE", *(["-DNFAIR=3"] if live else ["-DSAFETY", "-DNOCLAIM"]), "-o", "pan", "pan.c"], WORK)
    text = gate.run(["./pan", "-m1000000", *(["-a", "-f"] if live else [])], WORK, limit).stdout
    error = re.search(r"^pan:\d+: (.*?)(?: \(at depth.*)?$", text, re.M)
    states = re.search(r"^\s*([\d.e+]+) states, stored", text, re.M)
    whole = states and "errors:" in text and "too small" not in text and "out of memory" not in text
    return Outcome(error and error[1], int(float(states[1])) if states else 0, "" if whole or error else f"no whole search:\n{text}")


def differences() -> list[str]:
    """Where the C lines that stand in the model are not those of pen_set.c, in their order, or one is missing."""
    body = {m[1]: m[2] for m in re.finditer(r"^\w[^;=\n]*\b(\w+)\([^;]*?\)\n\{\n(.*?)^\}", SOURCE.read_text(), re.M | re.S)}
    body = {name: re.sub(r"\s*/\*.*?\*/", "", text, flags=re.S) for name, text in body.items()}
    text = "".join(part.read_text() for part in PARTS)
    quoted = {
        m[1]: re.findall(r"// (.*)$", m[2], re.M) for m in re.finditer(r"^inline (\w+)\(.*?\)[^\n]*\n\{\n(.*?)^\}", text, re.M | re.S)
    }
    found = []
    for name, lines in quoted.items():
        rest = body.get(name, "")
        for line in lines:
            _, hit, after = rest.partition(line.strip())
            found += [] if hit else [f"{name}: not in pen_set.c, or not there: {line}"]
            rest = after if hit else rest
    for name, text in body.items():
        shared = r"pen_port_\w+\(|tuning->[\w.\[\]^ ()]+ = |(?:copy_head|pen_set_copy)\((?:&tuning->|ready|head,)"
        for line in (line.strip() for line in text.splitlines()):
            if name != "pen_tuning_init" and re.search(shared, line) and line not in quoted.get(name, []):
                found.append(f"{name}: not in the model: {line}")
    return found


def main() -> int:
    good = gate.report("spin: the model is pen_set.c, line by line", differences())
    figures: dict[str, object] = {}
    for name, weak, live in (
        ("one core, every interleaving", False, False),
        ("two cores, late and reordered stores", True, False),
        ("one core: every committed set is adopted or withdrawn", False, True),
        ("two cores: every committed set is adopted or withdrawn", True, True),
    ):
        outcome = search(weak=weak, live=live)
        good &= gate.report(f"spin: {name}: {outcome.states} states", [t for t in (outcome.error, outcome.trouble) if t])
        figures[name] = {"states": outcome.states, "errors": int(outcome.error is not None)}
    caught = {}
    for number, fault in FAULTS.items():
        runs = (search(weak=weak, live=live, mutant=number, limit=900) for weak, live in ((False, False), (True, True), (True, False)))
        caught[fault] = next((outcome.error for outcome in runs if outcome.error), None)
    missed = [f"not found: {fault}" for fault, error in caught.items() if error is None]
    good &= gate.report(f"spin: {len(caught) - len(missed)} of {len(FAULTS)} faults of the protocol found", missed)
    outcome = search(weak=True, live=False, mutant=2)
    good &= gate.report("spin: a fault that is none is not found", [t for t in (outcome.error, outcome.trouble) if t])
    figures |= {"faults": list(FAULTS.values()), "faults found": len(caught) - len(missed), "harmless": HARMLESS}
    gate.keep("spin", figures)
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
