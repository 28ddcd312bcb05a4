# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: code and RAM of the XCP slave on a Cortex-M4F with -Os are what port/xcp/README.md states, and below what is promised."""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from pathlib import Path

import gate

from penode_sil.building import FLAGS
from penode_sil.targets import MACHINES, PORT

WORK = gate.BUILD / "xcp-size"
PAGE = gate.ROOT / "port" / "xcp" / "README.md"
SHARE = 0.02  # of the code: as in xcp_cost_check.py

CORE = ("pen_xcp.c", "pen_xcp_cal.c", "pen_xcp_memory.c")
DAQ = ("pen_xcp_daq.c", "pen_xcp_lists.c")
# Row of the page -> its files, the types whose RAM it counts, the most bytes of code it may have (None: no promise).
ROWS: dict[str, tuple[Sequence[str], Sequence[str], int | None]] = {
    "commands and pages": (CORE, ("pen_xcp_t",), 2048),
    "commands, pages and DAQ lists": ((*CORE, *DAQ), ("pen_xcp_t", "pen_xcp_daq_t"), 3584),
    "static DAQ lists, in addition": (("pen_xcp_static.c",), (), None),
    "keys and storing, in addition": (("pen_xcp_options.c",), (), None),
}
Sizes = dict[str, tuple[int, int]]  # row -> bytes of code with its constants, bytes of RAM


def compiled(source: Path, level: str) -> tuple[int, int]:
    """Bytes of a file on a Cortex-M4F: code with constants, variables."""
    out = WORK / f"{source.stem}.o"
    gate.make([PORT / "cc", MACHINES["m4f"], *FLAGS, level, "-c", "-o", out, source])
    done = gate.run(["arm-none-eabi-size", out])
    text, data, bss = (int(n) for n in done.stdout.splitlines()[1].split()[:3])
    return text, data + bss


def types() -> dict[str, int]:
    """sizeof on a Cortex-M4F, read from variables of these types."""
    names = sorted({name for _, of, _ in ROWS.values() for name in of})
    source = WORK / "types.c"
    source.write_text('#include "penode/pen_xcp_daq.h"\n' + "".join(f"{name} size_of_{name};\n" for name in names))
    out = WORK / "types.o"
    gate.make([PORT / "cc", MACHINES["m4f"], *FLAGS, "-Os", "-c", "-o", out, source])
    listed = gate.run(["arm-none-eabi-nm", "--print-size", "--radix=d", out]).stdout
    return {name: int(re.search(rf"^\d+ (\d+) \w size_of_{name}$", listed, re.M)[1]) for name in names}


def measured(level: str = "-Os", sources: Path = gate.ROOT / "src") -> Sizes:
    """Code and RAM of each row; variables that a file has count as RAM."""
    WORK.mkdir(parents=True, exist_ok=True)
    ram = types()
    found = {}
    for row, (files, of, _) in ROWS.items():
        parts = [compiled(sources / file, level) for file in files]
        found[row] = (sum(code for code, _ in parts), sum(own for _, own in parts) + sum(ram[name] for name in of))
    return found


def stated(text: str) -> dict[str, tuple[int, str, int]]:
    """The table of the page: code, at most, RAM."""
    rows = re.findall(r"^\| ([^|]+) \| ([\d ]+) \| ([^|]+) \| ([\d ]+) \|$", text, re.M)
    return {name: (int(code.replace(" ", "")), most, int(ram.replace(" ", ""))) for name, code, most, ram in rows}


def problems(said: dict[str, tuple[int, str, int]], found: Sizes) -> list[str]:
    """Where the slave is larger than promised, or the page wrong."""
    wrong = [f"{name}: {found.get(name)}, the page says {said.get(name)}" for name in sorted(found.keys() ^ said.keys())]
    for name in found.keys() & said.keys():
        (code, ram), most = found[name], ROWS[name][2]
        limit = f"{most:,}".replace(",", " ") if most else "-"
        wrong += [f"{name}: {code} B of code, at most {most}"] if most and code > most else []
        wrong += (
            [f"{name}: {code} B of code, at most {limit}, {ram} B of RAM, the page says {said[name]}"]
            if (abs(code - said[name][0]) > SHARE * said[name][0] or (limit, ram) != said[name][1:])
            else []
        )
    return wrong


def with_a_variable() -> Path:
    """The sources, one of which has a static variable."""
    place = WORK / "faulty"
    place.mkdir(exist_ok=True)
    for file in (gate.ROOT / "src").glob("pen_xcp*.c"):
        text = file.read_text()
        if file.name == "pen_xcp.c":
            right = "static void xcp_start(pen_xcp_t *xcp, bool connected)\n{\n"
            text = gate.faulty(text, (right, 0, f"{right}    static volatile uint32_t starts;\n\n    starts++;\n"))
        (place / file.name).write_text(text)
    return place


def main() -> int:
    text = PAGE.read_text(encoding="utf-8")
    found = measured()
    good = gate.report(
        f"xcp-size: {len(found)} parts of the slave are as large as port/xcp/README.md states", problems(stated(text), found)
    )
    larger = problems(stated(text), measured("-O2"))
    faults = {
        "code above the promise": any("at most 2048" in line for line in larger) and any("at most 3584" in line for line in larger),
        "a variable of its own": bool(problems(stated(text), measured(sources=with_a_variable()))),
        "a row that is missing": bool(problems({}, found)),
    }
    for name, seen in faults.items():
        good &= gate.report(f"xcp-size: seeded fault: {name}", [] if seen else ["not found"])
    gate.keep(
        "xcp-size",
        {
            **{name: {"code": code, "at most": ROWS[name][2], "RAM": ram} for name, (code, ram) in found.items()},
            "faults": list(faults),
            "faults found": sum(faults.values()),
        },
    )
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
