# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""`make bench`: what a step costs, ours and that of other tools, measured anew; writes bench.json and table.md.

bench.py            measures everything (some minutes), writes both, and the blocks of README.md; see checkouts.py for
                    peers that are in no registry
bench.py --ours     the same, but keeps what was measured of others
bench.py --checkouts  measures only the peers of checkouts.py
bench.py --table    writes tables and blocks from bench.json
bench.py --check    measures the steps in float on the Cortex-M4F, and RK4 on all cores; fails where a figure is more than
                    2 % worse than the kept one or above what is promised, or where README.md shows something else
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import batch
import checkouts
import cycles
import numpy as np
import peers
import programs
import report
import worst_case
from figures import CORES, OURS, PRICES, README, ROOT, accuracy, hostile_inputs, run_text, same, with_block
from numpy.typing import NDArray
from programs import Program
from reference import same_step
from screenshot import screenshot

HERE = Path(__file__).parent
KEPT, TABLE = HERE / "bench.json", HERE / "table.md"

REALS = {"float": (), "double": ("-DPEN_REAL_DOUBLE",)}
DOUBLE_UNIT = {"m7": ("-mfpu=fpv5-d16",)}  # the M7 may have one, the M55 has it
LEVELS = ("-O2", "-Os")
CONTRACTIONS = (report.OFF, "-ffp-contract=fast")
PEER_LEVELS = ("-Os", "-O2", "-O3")

Figures = dict[str, Any]


# -- running ----------------------------------------------------------------------------------------------------------


def play(program: Program, u: NDArray, n_x: int = 4, rounds: int = 1) -> tuple[NDArray, NDArray, dict[str, int]]:
    """Drive a program through u [n, n_u]: calls (cycles.CALL), states [n - 1, n_x], stack and SysTick's counts."""
    with tempfile.TemporaryDirectory() as folder:
        u.tofile(Path(folder, "u"))
        with cycles.counting(program.elf, [program.step], program.machine == "m4f") as result:
            programs.run(program, ["u", "x", str(rounds)], Path(folder))
            calls = result().calls[program.step]
        words = np.fromfile(Path(folder, "x"), dtype="<u4")
    x = words[:-3].view(u.dtype).reshape(-1, n_x)
    stack, least, most = (int(word) for word in words[-3:])
    return calls, x, {"stack": stack - programs.own_frame(program.elf, "measured"), "least": least, "most": most}


def between(elf: Path) -> int:
    """Instructions of drive.c around its call of the step, between the calls that start and stop the count."""
    code = programs.instructions_of(elf, "measured")
    marks = [k for k, at in enumerate(code) if "<board_count_st" in at.text]
    return marks[1] - marks[0] - 1


def measured(program: Program, u: NDArray, n_x: int = 4, weights_inside: int = 0) -> Figures:
    """All figures of one program; raises AssertionError where two ways to the same figure disagree."""
    calls, _, seen = play(program, u, n_x)
    count = calls["instructions"]
    ticks = [seen["least"] - between(program.elf), seen["most"] - between(program.elf)]
    if ticks != [count.min(), count.max()]:
        raise AssertionError(f"{program.elf}: plugin {count.min()} .. {count.max()}, SysTick {ticks}")
    bound = programs.stack_bound(program.elf, program.step)
    marks = max(programs.stack_bound(program.elf, f"board_count_{mark}") for mark in ("start", "stop"))
    if seen["stack"] > max(bound, marks):
        raise AssertionError(f"{program.elf}: {seen['stack']} B of stack used, bound {bound}")
    stack = min(seen["stack"], bound)  # where starting and stopping the count took more than the step
    found: Figures = {"instructions": [int(count.min()), int(count.max())]}
    if program.machine == "m4f":
        found["cycles"] = [int(calls["low"].max()), int(calls["high"].max())]
    return found | programs.sizes(program, weights_inside) | {"stack": stack, "stack bound": bound}


# -- ours -------------------------------------------------------------------------------------------------------------


def our_figures(say: Callable[[str], None], wanted: Callable[[Figures], bool] = lambda row: True) -> list[Figures]:
    """One row for each method, evaluator, type, core and level that is wanted."""
    rows = []
    for (method, evaluator), ours in OURS.items():
        model = ours.model()
        for real, defines in REALS.items():
            dtype = np.float64 if real == "double" else np.float32
            u = np.repeat(hostile_inputs()[::12].astype(dtype), len(model.inputs), axis=1)
            for machine in CORES:
                keys = {"method": method, "evaluator": evaluator, "model": ours.title, "real": real, "machine": machine}
                if not wanted(keys):
                    continue
                say(", ".join(keys.values()))
                unit = DOUBLE_UNIT.get(machine, ()) if real == "double" else ()
                for level in LEVELS:
                    program = programs.our_program(model, machine, (level, *defines, *unit), source=ours.source)
                    rows.append(keys | {"level": level} | measured(program, u, len(model.states)))
    return rows


def memory_figures() -> list[Figures]:
    """Bytes that the caller gives, on an Arm core: an instance, buffers for staging, a set, the stack of a commit."""
    rows = []
    for method, evaluator in PRICES.values():
        for real, defines in REALS.items():
            ours = OURS[method, evaluator]
            model = ours.model()
            elf = programs.our_program(model, "m4f", ("-O2", *defines), HERE / "worst_case.c", ours.source).elf
            variables = {"instance": "model", "banks": "banks", "set": "staged"}
            row = {"method": method, "evaluator": evaluator, "model": ours.title, "real": real}
            row |= {k: programs.size_of(elf, v) for k, v in variables.items()}
            rows.append(row | {"commit stack bound": programs.stack_bound(elf, f"{model.name}_tune_commit")})
    return rows


# -- peers ------------------------------------------------------------------------------------------------------------


def chirp(samples: int) -> NDArray[np.float32]:
    """Road height [m] that takes the networks through most of their range."""
    return (0.1 * np.sin(np.arange(samples) ** 2 * 2e-5)).astype(np.float32)


def local_figures(case: peers.Case, say: Callable[[str], None], kept: list[Figures]) -> list[Figures]:
    """Peers of checkouts.py; of those not at hand the rows kept from when they were: quoted."""
    local = checkouts.at_hand()
    missing = [peer for variable, peer in checkouts.NAMES.items() if variable not in local]
    return [row | {"quoted": True} for row in kept if of_checkout(row) in missing] + peer_figures(case, say, local)


def of_checkout(row: Figures) -> str:
    """Whose row it is, without its commit."""
    return row["name"].split(" (")[0]


def peer_figures(case: peers.Case, say: Callable[[str], None], makers: dict[str, Callable]) -> list[Figures]:
    """One row for each peer, level and contraction; raises AssertionError where a peer computes something else."""
    rows = []
    for make in makers.values():
        peer = make(case)
        say(peer.name)
        for level in PEER_LEVELS:
            for contract in CONTRACTIONS:
                program = programs.peer_program(peer, "m4f", (level, contract))
                u = chirp(401)
                _, x, _ = play(program, u)
                share = same_step(case, x, u)
                if not share <= 1:
                    raise AssertionError(f"{peer.name} {level} {contract}: {share:.2g} times what rounding allows")
                found = measured(program, hostile_inputs()[::12, 0].copy(), weights_inside=peer.weights_inside)
                rows.append({"name": peer.name, "level": level, "contract": contract, "rounding": round(share, 3)} | found)
    return rows


# -- host -------------------------------------------------------------------------------------------------------------


def host_ratios(case: peers.Case, say: Callable[[str], None]) -> list[Figures]:
    """Time of a step on this machine in units of our layered RK4 step: one run, the best of several rounds each."""
    say("host")
    made = {}
    for evaluator in ("layered", "folded"):
        ours = OURS["RK4", evaluator]
        made[f"**penode, {evaluator}**"] = programs.our_program(ours.model(), "host", ("-O2",), source=ours.source)
    made |= {
        (peer := make(case)).name: programs.peer_program(peer, "host", ("-O2", report.OFF))
        for make in [*peers.PEERS.values(), *checkouts.at_hand().values()]
    }
    best = dict.fromkeys(made, np.inf)
    with tempfile.TemporaryDirectory() as folder:
        chirp(1025).tofile(Path(folder, "u"))
        for _ in range(7):
            for name, program in made.items():
                spent = []
                for rounds in (1, 101):
                    start = time.perf_counter()
                    programs.run(program, ["u", "x", str(rounds)], Path(folder))
                    spent.append(time.perf_counter() - start)
                best[name] = min(best[name], spent[1] - spent[0])
    unit = best["**penode, layered**"]
    return [{"name": name, "ratio": round(value / unit, 2)} for name, value in best.items()]


# -- the worst case ---------------------------------------------------------------------------------------------------


def worst_figures(say: Callable[[str], None], steps: int = 10_000) -> list[Figures]:
    """Fewest and most instructions by what the step had to do, over everything that may come."""
    rows = []

    def row(what: str, file: str, machine: str, kind: str, calls: NDArray) -> None:
        rows.append({"evaluator": what, "model": file, "machine": machine, "kind": kind, "calls": len(calls)})
        rows[-1]["instructions"] = [int(calls["instructions"].min()), int(calls["instructions"].max())]
        if machine == "m4f":
            rows[-1]["cycles"] = [int(calls[end].max()) for end in ("low", "high")]
            rows[-1]["constant cycles"] = bool(all(np.ptp(calls[end]) == 0 for end in ("low", "high")))

    for evaluator in ("layered", "folded"):
        ours = OURS["RK4", evaluator]
        for machine in CORES:
            say(f"worst case, {evaluator}, {machine}")
            soft = machine not in worst_case.FPU
            found = worst_case.measure(ours.model(), machine, 1000 if soft else steps, source=ours.source)
            for kind, calls in found.items():
                row(f"RK4, {evaluator}", ours.title, machine, kind, calls)
    for model in worst_case.everything():
        for machine in worst_case.FPU:
            say(f"worst case, {model.name}, {machine}")
            found = worst_case.measure(model, machine, steps)
            same = [calls for kind, calls in found.items() if kind not in ("adopting", "commit")]
            row(f"{model.method}, every law, {model.outside}", "`all_laws.py`", machine, "all but adopting", np.concatenate(same))
    return rows


# -- command ----------------------------------------------------------------------------------------------------------


def say(text: str) -> None:
    print(f"bench: {text}", file=sys.stderr, flush=True)


def measure_ours() -> Figures:
    """What changes with our code."""
    return {"ours": our_figures(say), "memory": memory_figures(), "accuracy": accuracy(), "worst case": worst_figures(say)}


def measure(kept: Figures) -> Figures:
    """Everything; of peers that are not at hand what is kept."""

    def first_line(*command: str) -> str:
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()[0]

    case = peers.the_case()
    return {
        "made with": [{"compiler": first_line("arm-none-eabi-gcc", "--version"), "emulator": first_line("qemu-system-arm", "--version")}],
        "peers": peer_figures(case, say, peers.PEERS) + local_figures(case, say, kept["peers"]),
        "host": host_ratios(case, say),
        "batch": batch.measure(),
    } | measure_ours()


# What is promised of the whole step on the Cortex-M4F in float, whatever was kept. 22 instructions of it are for the range of
# the input, its counter and the withdrawal of a set.
PROMISED = {
    ("RK4", "layered", "-O2"): {"instructions": 11_600, "cycles": 17_500, "stack bound": 288, "ram": 0},
    ("RK4", "layered", "-Os"): {"instructions": 9_200, "text": 1_200, "stack bound": 288, "ram": 0},
    ("RK4", "folded", "-O2"): {"instructions": 790, "cycles": 1_100, "stack bound": 288, "ram": 0},
    ("Rosenbrock 1", "layered", "-O2"): {"instructions": 7_700},
    ("Rosenbrock 1", "folded", "-O2"): {"instructions": 572},
}


def worse(new: list[Figures], kept: list[Figures]) -> list[str]:
    """What is worse than it was, or than it may be."""

    def name(row: Figures) -> str:
        return ", ".join(row[key] for key in ("method", "evaluator", "real", "machine", "level"))

    before, found = {name(row): row for row in kept}, []
    for row in new:
        limits = PROMISED.get((row["method"], row["evaluator"], row["level"]), {}) if row["machine"] == "m4f" else {}
        values = {"instructions": row["instructions"][1], **{key: row[key] for key in ("text", "rodata", "ram", "stack bound")}}
        for key, value in values.items():
            was = before[name(row)][key][1] if key == "instructions" else before[name(row)][key]
            if value > 1.02 * was:
                found.append(f"{name(row)}: {value} {key} instead of {was}, more than 2 % worse")
            if value > limits.get(key, value):
                found.append(f"{name(row)}: {value} {key} is above the promised {limits[key]}")
        if "cycles" in row and row["cycles"][row["evaluator"] == "folded"] > limits.get("cycles", np.inf):
            found.append(f"{name(row)}: {row['cycles']} cycles are above the promised {limits['cycles']}")
        if row["machine"] != "m3" and row["instructions"][0] != row["instructions"][1]:
            found.append(f"{name(row)}: {report.span(row['instructions'])} instructions: the step's cost depends on its input")
    return found


def check(figures: Figures) -> list[str]:
    """What is wrong with the code, or with what README.md says of it."""

    def wanted(row):
        return row["real"] == "float" and (row["machine"] == "m4f" or row["method"] == "RK4")

    found = worse(our_figures(lambda text: None, wanted), figures["ours"]) + batch.too_slow(figures["batch"])
    if figures["accuracy"] != accuracy():
        found.append(f"accuracy: {accuracy()} instead of {figures['accuracy']}; run make figures")
    if not same(shown(figures), README.read_text()):
        found.append("README.md: what it shows is not what make run and the figures give; run make figures")
    return found


def shown(figures: Figures) -> str:
    """README.md with its blocks as they should be."""
    text = with_block(README.read_text(), "figures", report.prices(figures))
    return with_block(with_block(text, "bench", report.summary(figures)), "run", run_text())


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    what = arguments.add_mutually_exclusive_group()
    what.add_argument("--ours", action="store_true", help="measure only what changes with our code")
    what.add_argument("--checkouts", action="store_true", help="measure only the peers of checkouts.py")
    what.add_argument("--table", action="store_true", help="measure nothing, write what is made from bench.json")
    what.add_argument("--check", action="store_true", help="write nothing, compare")
    given = arguments.parse_args()
    figures = json.loads(KEPT.read_text())
    if given.check:
        found = check(figures)
        for line in found:
            print(line, file=sys.stderr)
        return 1 if found else 0
    if given.checkouts:
        others = [row for row in figures["peers"] if of_checkout(row) not in checkouts.NAMES.values()]
        figures["peers"] = others + local_figures(peers.the_case(), say, figures["peers"])
        KEPT.write_text(report.written(figures))
    elif not given.table:
        figures |= measure_ours() if given.ours else measure(figures)
        KEPT.write_text(report.written(figures))
    TABLE.write_text(report.table(figures))
    README.write_text(shown(figures))
    shutil.copy(ROOT / "build" / "run" / "recalibration.png", ROOT / "sil" / "recalibration.png")
    say(screenshot(ROOT / "build" / "run" / "diagnosis" / "report.html", ROOT / "sil" / "diagnosis.png"))
    print(report.prices(figures), report.summary(figures), sep="\n\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
