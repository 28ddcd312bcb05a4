# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: whatever packets come, the XCP slave answers as the standard says, and only whole sets come into force: xcp_fuzz.c."""

from __future__ import annotations

import argparse
import re
import shutil
import sys
from pathlib import Path

import gate

WORK = gate.BUILD / "xcp_fuzz"
FAULT_RUNS = 60_000
PACKETS = 10_000_000  # at least, in a run whose figures are kept

# File, and fault: see gate.faulty.
FAULTS = {
    "a text is read past its end": ("pen_xcp_memory.c", ("(n <= xcp->left) ? xcp->text : NULL", 0, "xcp->text")),
    "a region is read past its end": ("pen_xcp_memory.c", ("(offset <= size) && (n <= (size - offset))", 0, "(offset <= size)")),
    "an address below is taken": ("pen_xcp_memory.c", ("(offset <= size) && ", 0, "")),
    "a packet is read past its end": ("pen_xcp_memory.c", ("} else if (n < now) {", 0, "} else if (false) {")),
    "a number is read past the end of a short packet": (
        "pen_xcp_daq.c",
        ("(n >= 4U) ? pen_xcp_get(&in[2], 2U) : 0U", 0, "pen_xcp_get(&in[2], 2U)"),
    ),
    "the flash page is written to the working page": (
        "pen_xcp_cal.c",
        ("    if (xcp->page == XCP_WORKING) {\n        error = xcp_open", 0, "    if (true) {\n        error = xcp_open"),
    ),
    "a refused commit is answered as done": (
        "pen_xcp_cal.c",
        ("error = xcp_error_of(xcp, config->commit());", 0, "(void)config->commit(); error = PEN_XCP_DONE;"),
    ),
    "half a block is committed": ("pen_xcp_cal.c", ("    if (!xcp->torn) {", 0, "    if (true) {")),
    "an edit changes the running set": (
        "pen_xcp_cal.c",
        (
            "    if (!xcp_open(xcp)) {\n        const pen_set_head_t head",
            0,
            "    if (!xcp_open(xcp) && xcp_on_reference(xcp)) {\n        const pen_set_head_t head",
        ),
    ),
    "the working page is lost on the reference": ("pen_xcp_cal.c", ("            xcp->kept = kept;", 0, "            (void)kept;")),
    "reconnecting keeps the open set": ("pen_xcp_cal.c", ("    (void)pen_tuning_abort(xcp->tuning);\n    xcp->kept", 0, "    xcp->kept")),
    "every packet of a refused block is answered": ("pen_xcp_memory.c", ("            xcp->refused = (error != PEN_XCP_DONE);", 0, "")),
    "the sequence of a block is not compared": ("pen_xcp_memory.c", ("(in[0] == 0xefU) && (total != xcp->block)", 0, "false")),
    "the checksum of another page": (
        "pen_xcp_cal.c",
        ("return (xcp->page == XCP_WORKING) ? xcp_working(xcp)", 0, "return (xcp->page != XCP_WORKING) ? xcp_working(xcp)"),
    ),
    "an entry past the last one is written": ("pen_xcp_lists.c", ("    if (daq->left == 0U) {", 0, "    if (false) {")),
    "an ODT that no packet has room for": ("pen_xcp_daq.c", ("good = good && (n <= xcp->config->max_cto);", 0, "")),
    "the ring is filled past its end": ("pen_xcp_daq.c", ("if ((head + list->odts) < (tail + ahead)) {", 0, "if (true) {")),
    "an entry without address is sampled": ("pen_xcp_daq.c", ("good = good && (entry->byte != NULL);", 0, "")),
    "lists change while they run": ("pen_xcp_daq.c", ("        if (pen_port_load(&xcp->sampling) != 0U) {", 0, "        if (false) {")),
}


COMPILER = (
    "clang-19",
    "-fsanitize=fuzzer,address,undefined",
    "-fno-sanitize-recover=all",
    "-std=c99",
    "-ffp-contract=off",
    "-O1",
    "-g",
    "-Wall",
    "-Wextra",
    "-fno-strict-aliasing",
    f"-I{gate.ROOT}/inc",
    f"-I{gate.ROOT}/port/gnu",
)


def compiled(source: Path, to: Path) -> Path:
    gate.make([*COMPILER, "-c", "-o", to, source])
    return to


def objects() -> dict[str, Path]:
    """xcp_fuzz.c and the runtime, without a fault, by their names."""
    shutil.rmtree(WORK, ignore_errors=True)
    WORK.mkdir(parents=True)
    sources = [gate.HERE / "xcp_fuzz.c", *sorted((gate.ROOT / "src").glob("*.c"))]
    return {path.name: compiled(path, WORK / f"{path.stem}.o") for path in sources}


def program(parts: dict[str, Path], fault: tuple[str, tuple[str, int, str]] | None = None) -> Path:
    """The fuzzer, with a fault in one of its files."""
    elf = WORK / ("faulty" if fault else "fuzz")
    if fault:
        name, change = fault
        source = WORK / name
        source.write_text(gate.faulty((gate.ROOT / "src" / name).read_text(), change))
        parts = parts | {name: compiled(source, WORK / "faulty.o")}
    gate.make([*COMPILER, "-o", elf, *parts.values(), "-lm"])
    return elf


def fuzz(elf: Path, runs: int) -> tuple[str, int]:
    """What libFuzzer has found, its last lines, "" if nothing; and the packets that were sent."""
    done = gate.run([elf, f"-runs={runs}", "-max_len=1500", "-len_control=0", "-seed=1", f"-artifact_prefix={elf}-"], cwd=WORK, limit=36000)
    sent = re.search(r"^packets: (\d+)$", done.stderr, re.M)
    return "" if done.returncode == 0 else "\n".join(done.stderr.splitlines()[-30:]), int(sent[1]) if sent else 0


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--runs", type=int, default=200_000, help="sequences of packets")
    parser.add_argument("--as", dest="key", default="xcp fuzz", help="key in figures.json")
    parser.add_argument("--keep", action="store_true", help="put the figures into figures.json")
    chosen = parser.parse_args()
    parts = objects()
    found, packets = fuzz(program(parts), chosen.runs)
    wrong = [found] if found else []
    wrong += [f"{packets} packets, not {PACKETS}"] if chosen.keep and packets < PACKETS else []
    good = gate.report(f"xcp fuzz: {packets} packets in {chosen.runs} sequences, as the oracle says", wrong)
    missed = []
    for name, fault in FAULTS.items():
        if not fuzz(program(parts, fault), FAULT_RUNS)[0]:
            missed.append(name)
        good &= gate.report(f"xcp fuzz: seeded fault: {name}", ["not found"] if name in missed else [])
    if chosen.keep:
        gate.keep(
            chosen.key,
            {
                "sequences": chosen.runs,
                "packets": packets,
                "failures": int(bool(found)),
                "faults": list(FAULTS),
                "faults found": len(FAULTS) - len(missed),
            },
        )
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
