# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: a fault in a kernel in assembler of port/gnu is found by the test of its bits."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import gate

from penode_sil.targets import MACHINES, PORT

WORK = gate.BUILD / "kernels"
GNU = gate.ROOT / "port" / "gnu"
TEST = "test_pen_net16"
UNITY = gate.ROOT / "build" / "unity" / "src"

# Faults by file and the optimisation that takes it: see gate.faulty.
FAULTS = {
    ("pen_port_net16.h", "-O2"): {
        "two rows exchanged": ("vadd.f32 s3, s3, s19", 0, "vadd.f32 s3, s3, s20"),
        "a row left out": ("vadd.f32 s15, s15, s23", 0, "vmov.f32 s15, s15"),
        "rounded once, not twice": ("vadd.f32 s0, s0, s16", 0, r"vldr.f32 s16, [%[w], #-32]\n   vfma.f32 s0, s16, pen_column"),
        "ReLU left out": ("vadd.f32 s26, s26, s18", 0, "vadd.f32 s26, s26, s26"),
        "ReLU that hides -Inf": ("vabs.f32 s17, s25", 0, "vmov.f32 s17, s25"),
        "a column taken twice": (".req s27", 0, ".req s26"),
        "a column less": ("movs     %[turns], #4", 0, "movs     %[turns], #3"),
        "a layer more": ("subs     %[hidden], #1", 0, "subs     %[hidden], #0"),
        "sums of the last layer in another order": ("vadd.f32 s24, s24, s4", 0, "vadd.f32 s24, s24, s5"),
        "last layer not halved": ("vmul.f32 %[y], s24, %[half]", 0, "vmov.f32 %[y], s24"),
        "bias not doubled": ("vadd.f32 s24, s24, s24", 0, "vmov.f32 s24, s24"),
    },
    ("pen_port_rows.h", "-Os"): {
        "two rows exchanged": ("vmla.f32 s5, s21, %[x]", 0, "vmla.f32 s5, s22, %[x]"),
        "rounded once, not twice": ("vmla.f32 s9, s17, %[x]", 0, "vfma.f32 s9, s17, %[x]"),
        "first layer with ReLU": ("b        3f", 0, "nop"),
        "a column less": ("movs     %[n], #16", 0, "movs     %[n], #15"),
        "last layer not halved": ("vmul.f32 %[y],", 0, "vadd.f32 %[y],"),
        "bias not doubled": ("vadd.f32 %[y], %[y], %[y]", 0, "vmov.f32 %[y], %[y]"),
    },
}


def tested(headers: Path, level: str) -> str:
    """What the unit test prints on the Cortex-M4F with the port's headers of a folder; empty if it passes."""
    elf, board, runner = WORK / f"{headers.name}{level}.elf", MACHINES["m4f"], WORK / f"{TEST}_runner.c"
    sources = [runner, gate.ROOT / "test" / "unit" / f"{TEST}.c", gate.ROOT / "test" / "unit" / "unity_output.c", UNITY / "unity.c"]
    options = ["-std=c99", level, "-iquote", headers, f"-I{gate.ROOT / 'test' / 'unit'}", f"-I{UNITY}", "-include", "unity_config.h"]
    gate.make(["ruby", UNITY.parent / "auto" / "generate_test_runner.rb", sources[1], runner])
    gate.make([PORT / "cc", board, *options, "-o", elf, *sources, "-lc"])
    done = gate.run([PORT / "run", board, elf], limit=60)
    return "" if done.returncode == 0 else done.stdout + done.stderr


def main() -> int:
    WORK.mkdir(parents=True, exist_ok=True)
    wrong = [f"{level}: {text}" for level in ("-O2", "-Os") if (text := tested(GNU, level))]
    good = gate.report("kernels: their bits are those of the C", wrong)
    missed, faults = [], [(where, *fault) for where, row in FAULTS.items() for fault in row.items()]
    for (name, level), fault, change in faults:
        copy = WORK / "faulty"
        shutil.copytree(GNU, copy, dirs_exist_ok=True)
        (copy / name).write_text(gate.faulty((GNU / name).read_text(), change))
        missed += [] if tested(copy, level) else [f"not found: {name}, {fault}"]
    good &= gate.report(f"kernels: {len(faults) - len(missed)} of {len(faults)} faults found", missed)
    gate.keep("kernels", {"faults": len(faults), "found": len(faults) - len(missed)})
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
