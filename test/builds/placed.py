# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
The linker script of port/README.md places all that a step calls, and the sets: with and without -flto, for nqvm and for a model with
every law and every kind of layer. Without sections it stops the link.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from itertools import product
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "bench"))

import builds
from all_laws import all_laws
from builds import M4F, ROOT, RUNTIME, check

from penode_gen.emission.model_c import render

SECTIONS = ("-ffunction-sections", "-fdata-sections")
FLAGS = ("-std=c99", *M4F, "-ffreestanding", "-fno-tree-loop-distribute-patterns", "-nostdlib", "-Wl,--gc-sections,--no-warn-rwx-segments")
REGION = {"itcm": (0x0, 0x20000), "sector": (0x8000000, 0x40000), "rom": (0x8100000, 0x100000), "ram": (0x20000000, 0x100000)}
MAIN = """
#include "NAME.h"
NAME_t model;
NAME_banks_t banks;
volatile pen_real_t given;
volatile pen_status_t result;
void board_timer(void);
__attribute__((noinline, used)) void board_timer(void) /* an interrupt: called by no function that the compiler sees */
{
    NAME_u_t u = { 0 };
    NAME_y_t y;
    u.INPUT = given;
    result = NAME_step(&model, &u, &y);
}
int main(void)
{
    result = NAME_init(&model, &NAME_set_default, &banks);
    board_timer();
    result = NAME_tune_commit(&model);
    return (int)result;
}
"""


def script(name: str) -> str:
    """A linker script around the lines of the page."""
    (lines,) = re.findall(r"```ld\n(.*?)```", (ROOT / "port/README.md").read_text(), re.S)
    memory = "".join(f"{region} (rwx) : ORIGIN = {at:#x}, LENGTH = {size:#x}\n" for region, (at, size) in REGION.items())
    rest = "".join(
        f".{kind} : {{ *(.{kind}*) }} > {where}\n" for kind, where in (("text", "rom"), ("rodata", "rom"), ("data", "ram"), ("bss", "ram"))
    )
    return f"MEMORY\n{{\n{memory}}}\nENTRY(main)\nSECTIONS\n{{\n{lines.replace('nqvm', name)}{rest}}}\n"


def linked(folder: Path, name: str, *flags: str) -> str:
    """What the linker says, of folder/main.c and the C of the model beside it; nothing if all is there."""
    own = [folder / f"{name}.c", folder / f"{name}_params.c", folder / "main.c"]
    command = [
        "arm-none-eabi-gcc",
        *FLAGS,
        *flags,
        f"-I{folder}",
        *(f"-I{ROOT / part}" for part in ("inc", "port/gnu")),
        f"-T{folder / 'ld'}",
    ]
    run = subprocess.run([*command, "-o", str(folder / "program"), *map(str, [*own, *RUNTIME]), "-lgcc"], capture_output=True, text=True)
    return run.stderr if run.returncode else ""


def called(program: Path, root: str) -> set[str]:
    """All functions that a function reaches by branches, libgcc's left out."""
    run = subprocess.run(["arm-none-eabi-objdump", "-d", "--no-show-raw-insn", str(program)], capture_output=True, text=True, check=True)
    branches: dict[str, set[str]] = {}
    for block in re.split(r"\n(?=[0-9a-f]+ <)", run.stdout):
        head = re.match(r"[0-9a-f]+ <(.+?)>:", block)
        if head:
            branches[head[1]] = set(re.findall(r"\tc?b\S*\s[^\n]*<([^+>]+)>", block))
    found, left = set(), [root]
    while left:
        name = left.pop()
        if name not in found:
            found.add(name)
            left += branches.get(name, ())
    return {name for name in found if not name.startswith("__aeabi")}


def outside(program: Path, names: set[str], region: str) -> list[str]:
    """Those that do not lie in a region."""
    run = subprocess.run(["arm-none-eabi-nm", str(program)], capture_output=True, text=True, check=True)
    place = {words[2]: int(words[0], 16) for words in map(str.split, run.stdout.splitlines()) if len(words) == 3}
    at, size = REGION[region]
    return [name for name in sorted(names) if not at <= place.get(name, -1) < at + size]


def look(folder: Path, name: str) -> None:
    """Link a model at two levels, with and without -flto, and look where things lie."""
    for level, more in product(("-O2", "-Os"), ((), ("-flto",))):
        with_flags = " ".join(("with", level, *more))
        said = linked(folder, name, level, *more, *SECTIONS)
        check(f"{name} {with_flags} links", said == "", said[:2000])
        if said == "":
            program = folder / "program"
            left = outside(program, called(program, "board_timer"), "itcm")
            check(f"{name} {with_flags}: the interrupt, the step and all that they call are placed", not left, " ".join(left))
            left = outside(program, {f"{name}_set_default", f"{name}_value_default"}, "sector")
            check(f"{name} {with_flags}: the set is placed", not left, " ".join(left))


def main() -> int:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        model = all_laws(folder)
        texts = render(model, self_test=False) | {"ld": script(model.name)}
        for file, text in texts.items():
            (folder / file).write_text(text)
        (folder / "main.c").write_text(MAIN.replace("NAME", model.name).replace("INPUT", model.inputs[0].name))
        look(folder, model.name)
        said = linked(folder, model.name, "-O2", "-flto")
        check("without sections the link stops and says why", "penode: nothing is placed" in said, said[:2000])
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for path in (ROOT / "gen/nqvm/c").glob("nqvm*"):
            (folder / path.name).write_text(path.read_text())
        (folder / "main.c").write_text(MAIN.replace("NAME", "nqvm").replace("INPUT", "z_road"))
        (folder / "ld").write_text(script("nqvm"))
        look(folder, "nqvm")
        (folder / "ld").write_text(
            script("nqvm").replace("*(.text.board_timer* .text.nqvm_* .text.pen_*", "*main.o(.text*) *nqvm.o(.text*) *pen_*.o(.text*) *(")
        )
        said = linked(folder, "nqvm", "-O2", "-flto", *SECTIONS)
        check(
            "a script that names objects places nothing with -flto, and the link says so", "penode: nothing is placed" in said, said[:2000]
        )
    return int(builds.bad > 0)


if __name__ == "__main__":
    sys.exit(main())
