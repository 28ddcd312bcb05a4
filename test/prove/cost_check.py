# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: functions take the instructions that their headers name on a Cortex-M4F, the same for every argument."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import gate

from penode_sil.targets import MACHINES, PORT

WORK = gate.BUILD / "cost"
MATH = gate.ROOT / "src" / "pen_math.c"
HALVINGS = 7  # of 96 and 128 pieces
SLACK = {"pen_solve_": 18, "pen_fold_find": 5}  # instructions of the call in cost.c, of the last two comparisons

# Faults of pen_math.c: see gate.faulty.
FAULTS = {
    "a branch on the data": ("const power_t e = power(x,", 0, "if (x < EXP_LOW) { return ZERO; }\n    const power_t e = power(x,"),
    "slower than said": ("    power_t e;", 0, "    power_t e;\n    volatile pen_real_t more = x;\n    more *= x;"),
}


def promised() -> dict[tuple[str, str], int]:
    """Instructions by function and optimisation, as the headers say."""
    text = {path.stem: re.sub(r"\s*\n \* ?", " ", path.read_text()) for path in (gate.ROOT / "inc" / "penode").glob("*.h")}
    found: dict[tuple[str, str], int] = {}
    for name, fast, small in re.findall(r"(pen_\w+) +[\d.]+ +[\d.]+ +(\d+) / +(\d+)", text["pen_math"]):
        found |= {(name, "-O2"): int(fast), (name, "-Os"): int(small)}
    net = r"-1: (\d+) instructions, with its slope (\d+); optimised for size (\d+) and (\d+)"
    keys = [(name, level) for level in ("-O2", "-Os") for name in ("pen_net16", "pen_net16_slope")]
    found |= dict(zip(keys, map(int, re.search(net, text["pen_net16"]).groups()), strict=True))
    for n, cost in re.findall(r"(\d+): (\d+)", re.search(r"-O2: n = (.*?)\. Stack", text["pen_solve"])[1]):
        found["pen_solve_" + n, "-O2"] = int(cost)
    found["pen_solve2", "-O2"] = int(re.search(r"Cost: about (\d+) instructions", text["pen_solve"])[1])
    halving = int(re.search(r"(\d+) instructions for each halving of capacity, 7 halvings", text["pen_fold"])[1])
    found |= {(f"pen_fold_find_{n}", "-O2"): HALVINGS * halving for n in (96, 128)}
    note = re.search(r"Cost: (\d+) instructions, at -Os (\d+)", text["pen_status"])
    found |= {("pen_status_note_step", level): int(n) for level, n in zip(("-O2", "-Os"), note.groups(), strict=True)}
    test = re.search(r"pen_selftest +(\d+) / (\d+) instructions", text["pen_selftest"])
    found |= {("pen_selftest", level): int(n) for level, n in zip(("-O2", "-Os"), test.groups(), strict=True)}
    return found


def of_selftest() -> list[str]:
    """Where code and constants of a self-test are not the bytes that pen_selftest.h names, to 2 %."""
    text, found = (gate.ROOT / "inc" / "penode" / "pen_selftest.h").read_text(), []
    runtime = re.search(r"pen_selftest .* instructions, (\d+) / (\d+) bytes", text).groups()
    model = re.search(r"NAME_selftest +(\d+) / (\d+) bytes", text).groups()
    folder = gate.ROOT / "gen" / "nqvm" / "c"
    for source, said in ((gate.ROOT / "src" / "pen_selftest.c", runtime), (folder / "nqvm_selftest.c", model)):
        for level, bytes_said in zip(("-O2", "-Os"), map(int, said), strict=True):
            out = WORK / "selftest.o"
            gate.make([PORT / "cc", MACHINES["m4f"], "-std=c99", level, f"-I{folder}", "-c", "-o", out, source])
            columns = gate.run(["arm-none-eabi-size", out]).stdout.split("\n")[1].split()
            size = int(columns[0]) + int(columns[1])
            found += (
                []
                if abs(size - bytes_said) <= 0.02 * bytes_said
                else [f"{source.name} {level}: {size} bytes, the header says {bytes_said}"]
            )
    return found


def measured(level: str, pen_math: Path = MATH) -> dict[str, tuple[int, int]]:
    """Least and most instructions of each function of cost.c."""
    WORK.mkdir(parents=True, exist_ok=True)
    elf, board = WORK / f"{pen_math.stem}{level}.elf", MACHINES["m4f"]
    sources = [path for path in sorted((gate.ROOT / "src").glob("*.c")) if path != MATH]
    gate.make([PORT / "cc", board, "-std=c99", level, "-o", elf, gate.HERE / "cost.c", *sources, pen_math])
    said = gate.run([PORT / "run", board, elf]).stdout
    return {name: (int(least), int(most)) for name, least, most in re.findall(r"^(\w+) (\d+) (\d+)$", said, re.M)}


def differences(counts: dict[str, dict[str, tuple[int, int]]]) -> list[str]:
    """Where counts depend on the argument, or are not those of the headers, to 2 % and what the call takes."""
    found = []
    for level, row in counts.items():
        found += [f"{name} {level}: {least} to {most}" for name, (least, most) in row.items() if least != most]
    for (name, level), said in promised().items():
        slack = next((n for start, n in SLACK.items() if name.startswith(start)), 2)
        most = counts[level].get(name, (0, 0))[1]
        right = 0.98 * said - 3 <= most <= 1.02 * said + slack
        found += [] if right else [f"{name} {level}: {most} instructions, the header says {said}"]
    return found


PORT_CALLS = """
#include "penode/pen_port.h"
uint32_t load(const volatile uint32_t *word) { return pen_port_load(word); }
void store(volatile uint32_t *word, uint32_t value) { pen_port_store(word, value); }
pen_real_t size(pen_real_t x) { return pen_port_abs(x); }
void barrier(void) { pen_port_barrier(); }
"""


def of_port() -> list[str]:
    """What of the port takes another instruction than LDR, STR, VABS and DMB, on a Cortex-M with FPU."""
    source, found = WORK / "port.c", []
    source.write_text(PORT_CALLS)
    for machine in ("m4f", "m7", "m33", "m55"):
        gate.make([PORT / "cc", MACHINES[machine], "-std=c99", "-O2", "-c", "-o", WORK / "port.o", source])
        code = gate.run(["arm-none-eabi-objdump", "-d", "--no-show-raw-insn", WORK / "port.o"]).stdout
        words = re.findall(r"^ +[0-9a-f]+:\t([a-z]+)", code, re.M)
        right = ["ldr", "bx", "str", "bx", "vabs", "bx", "dmb", "bx"]
        found += [] if [word for word in words if word != "nop"] == right else [f"{machine}: {' '.join(words)}"]
    return found


def main() -> int:
    counts = {level: measured(level) for level in ("-O2", "-Os")}
    good = gate.report(f"cost: {len(promised())} counts of the headers are right, for every argument", differences(counts))
    good &= gate.report("cost: load, store, abs and barrier of the port are one instruction each", of_port())
    good &= gate.report("cost: bytes of the self-tests are those of the header", of_selftest())
    missed = []
    for k, (fault, change) in enumerate(FAULTS.items()):
        copy = WORK / f"fault{k}.c"
        copy.write_text(gate.faulty(MATH.read_text(), change))
        missed += [] if differences({level: measured(level, copy) for level in counts}) else [f"not found: {fault}"]
    good &= gate.report(f"cost: {len(FAULTS) - len(missed)} of {len(FAULTS)} faults found", missed)
    figures = {level: {name: most for name, (_, most) in row.items()} for level, row in counts.items()}
    faults = {"faults": list(FAULTS), "faults found": len(FAULTS) - len(missed)}
    gate.keep("cost", figures | {"counts of headers": len(promised())} | faults)
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
