# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What `make bench` measures with: cycle model, counter, bound of the stack, check of peers; and a short worst case."""

from __future__ import annotations

import dataclasses
import itertools
import json
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples import sample

import penode_gen

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "bench"))

import bench  # needs the path above
import cortex_m4
import figures
import peers
import programs
import reference
import report
import worst_case


def assembled(text: str, folder: Path, entry: str = "f") -> Path:
    """A program of one or more functions, for a Cortex-M4F; C unless it has a directive of the assembler."""
    source = folder / ("program.s" if ".thumb" in text else "program.c")
    source.write_text(text)
    elf = folder / "program.elf"
    options = ["-O1", "-fno-inline", "-nostdlib", f"-Wl,-e,{entry}", "-o", str(elf), str(source)]
    subprocess.run(["arm-none-eabi-gcc", *programs.core("m4f"), *options], check=True)
    return elf


# Low and high cycles by hand from DDI 0439, tables 3-1 and 7-1 and section 3.3.3.
@pytest.mark.parametrize(
    ("code", "low", "high"),
    [
        ("ldr r1, [r0]; ldr r2, [r0, #4]; str r2, [r0]", (2, 1, 1), (2, 1, 1)),  # loads follow each other
        ("ldr r1, [r0]; ldr r2, [r1]", (2, 2), (2, 2)),  # but not where one has the address of the other
        ("ldr r1, [r0]; str r2, [r0, r3]", (2, 1), (2, 1)),
        ("str r2, [r0, r3]; ldr r1, [r0]", (2, 2), (2, 2)),  # nothing follows a store
        ("vldr s0, [r0]; vldr s1, [r0, #4]; vstr s1, [r0]", (2, 1, 1), (2, 2, 2)),
        ("vmul.f32 s0, s1, s2; vadd.f32 s3, s0, s4", (1, 2), (1, 2)),  # a result is waited for
        ("vmul.f32 s0, s1, s2; vadd.f32 s3, s4, s5", (1, 1), (1, 1)),
        ("vmul.f32 s0, s1, s2; vmla.f32 s0, s3, s4", (1, 3), (1, 3)),  # but not as an addend
        ("vmul.f32 s3, s1, s2; vfma.f32 s0, s3, s4", (1, 4), (1, 4)),
        ("vabs.f32 s0, s1; vadd.f32 s2, s0, s3", (1, 1), (1, 2)),
        ("vdiv.f32 s0, s1, s2; vstr s0, [r0]", (14, 2), (14, 3)),
        ("vcvt.f32.s32 s0, s0; vmov r0, s0; vmov s0, s1, r0, r1", (1, 2, 2), (1, 2, 2)),
        ("push {r4-r7, lr}; vpush {d8-d9}; vldmia r0!, {s0-s2}", (6, 5, 4), (6, 5, 4)),
        ("mla r0, r1, r2, r3; mul r0, r1, r2; udiv r0, r1, r2", (2, 1, 2), (2, 1, 12)),
        ("cmp r0, r1; it eq; moveq r0, r1; bls 1f; vmls.f32 s0, s1, s2; 1: bx lr", (1, 0, 1, 1, 3, 1), (1, 1, 1, 1, 3, 1)),
    ],
)
def test_cycles(code: str, low: tuple[int, ...], high: tuple[int, ...], tmp_path: Path) -> None:
    elf = assembled(f".syntax unified\n.thumb\n.fpu fpv4-sp-d16\n.global f\n.thumb_func\nf:\n{code}\n", tmp_path)
    instructions = cortex_m4.disassemble(elf)
    first = cortex_m4.base(instructions[0])
    cost = [first, *(cortex_m4.after(*pair) for pair in itertools.pairwise(instructions))]
    assert [c[0] for c in cost if c] == list(low)
    assert [c[1] for c in cost if c] == list(high)


def test_stack_bound_is_the_longest_chain(tmp_path: Path) -> None:
    functions = {
        "f": "push {r4, lr}; bl g; bl h; pop {r4, pc}",
        "g": "push {r0-r3}; sub sp, #24; add sp, #40; bx lr",
        "h": "vpush {s0}; b g",
    }
    text = "\n".join(f".global {name}\n.type {name}, %function\n{name}: {code}" for name, code in functions.items())
    elf = assembled(f".syntax unified\n.thumb\n.fpu fpv4-sp-d16\n{text}\n", tmp_path)
    assert programs.stack_bound(elf, "g") == 40
    assert programs.stack_bound(elf, "f") == 8 + 4 + 40


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("int f(int n) { return n ? 3 * f(n - 1) + 1 : 2; }", "recursion"),
        ("int f(int (*g)(void)) { return g() + 1; }", "pointer"),
        ("__attribute__((noipa)) void g(char *b) { b[0] = 1; } void f(int n) { char b[n]; g(b); }", "variable size"),
    ],
)
def test_stack_without_a_bound_is_refused(text: str, why: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=why):
        programs.stack_bound(assembled(text, tmp_path), "f")


def model(name: str = "nqvm") -> penode_gen.Model:
    return penode_gen.load(programs.ROOT / "gen" / "nqvm" / f"{name}.toml")


def test_plugin_and_timer_count_the_same() -> None:
    """The plugin against SysTick, painted stack against its bound: measured() compares both pairs."""
    found = bench.measured(programs.our_program(model()), bench.chirp(65))
    assert found["instructions"][0] == found["instructions"][1] > 0


CASES = [model("nqvm"), model("nqvm_folded"), *worst_case.everything()]


KERNELS = [(machine, case.name) for machine in worst_case.FPU for case in CASES]
# Each model on one core, each core with a model of every law; the layered one on the core with vectors, too.
SHORT = [
    ("m4f", "nqvm"),
    ("m4f", "nqvm_folded"),
    ("m4f", "all_laws_rk4_clamp"),
    ("m7", "all_laws_rk4_fade"),
    ("m33", "all_laws_ros1_clamp"),
    ("m55", "all_laws_ros1_fade"),
    ("m55", "nqvm"),
]


@pytest.mark.parametrize("machine, name", sample(KERNELS, *SHORT))
def test_every_step_costs_the_same(machine: str, name: str, show: Callable[[str], None]) -> None:
    """Some hundred hostile steps here, ten thousand in `make figures`. Adoption adds a few stores and barriers."""
    case = next(case for case in CASES if case.name == name)
    for level in bench.LEVELS:
        found = worst_case.measure(case, machine, 400, (level,))
        count = {kind: calls["instructions"] for kind, calls in found.items() if kind != "commit"}
        normal = count["normal"][0]
        assert all(len(values) > 0 for values in count.values())
        assert all((count[kind] == normal).all() for kind in ("normal", "refused", "holding"))
        assert (count["adopting"] == count["adopting"][0]).all()
        assert normal < count["adopting"][0] <= normal + 20
        more, steps = count["adopting"][0] - normal, sum(map(len, count.values()))
        show(f"{case.name} {level} on {machine}: {normal} instructions, {more} more to adopt a set, {steps} steps")


def test_a_peer_that_computes_something_else_is_found() -> None:
    """A state that is off by no more than its rounding passes; one weight in 1186 that is 1 % off does not."""
    case = peers.the_case()
    weights, bias = case.networks["spring"][1]
    wrong = weights.copy()
    at = np.unravel_index(np.abs(wrong).argmax(), wrong.shape)
    wrong[at] *= np.float32(1.01)
    other = dataclasses.replace(
        case, networks=case.networks | {"spring": [case.networks["spring"][0], (wrong, bias), *case.networks["spring"][2:]]}
    )
    u = bench.chirp(300)

    def run(of: peers.Case) -> np.ndarray:
        x = [np.zeros((1, 4))]
        for k in range(len(u) - 1):
            x.append(reference.reference_step(of, x[-1], u[k : k + 1], u[k + 1 : k + 2])[0].astype(np.float32))
        return np.concatenate(x[1:])

    assert reference.same_step(case, run(case), u) <= 1
    assert reference.same_step(case, run(other), u) > 1


def test_table_and_readme_are_those_of_the_figures() -> None:
    figures = json.loads(bench.KEPT.read_text())
    assert bench.TABLE.read_text() == report.table(figures)
    text = bench.README.read_text()
    assert bench.with_block(text, "bench", report.summary(figures)) == text


def test_ten_thousand_steps_cost_the_same_in_the_figures() -> None:
    rows = [row for row in json.loads(bench.KEPT.read_text())["worst case"] if row["machine"] in worst_case.FPU and row["kind"] != "commit"]
    assert all(row["instructions"][0] == row["instructions"][1] for row in rows)
    calls: dict[tuple[str, str], int] = {}
    for row in rows:
        calls[row["evaluator"], row["machine"]] = calls.get((row["evaluator"], row["machine"]), 0) + row["calls"]
    assert len(calls) == len(CASES) * len(worst_case.FPU) and min(calls.values()) >= 10_000


def test_readme_is_compared_to_the_word_and_to_two_percent_of_a_number():
    """Seconds are another machine's; nothing but the diagnosis has any room."""
    kept = "Price 730\n```\nquarter: explained\n  force   46.691 N  [46.407, 46.976]\n  100.0% explained, 4.8 s\n```\n"
    assert figures.same(kept, kept)
    assert figures.same(kept.replace("46.691", "46.712").replace("4.8 s", "17 s"), kept)
    assert not figures.same(kept.replace("46.691", "48.2"), kept)
    assert not figures.same(kept.replace("force", "moment"), kept)
    assert not figures.same(kept.replace("730", "731"), kept)
    assert not figures.same(kept.replace("100.0% explained, 4.8 s", ""), kept)


# -- one model under each heading -------------------------------------------------------------------------------------

KEPT = json.loads((Path(bench.__file__).with_name("bench.json")).read_text())
COMMITTED = figures.ROOT / "gen" / "nqvm" / "c"
FILE = re.compile(r"`(\w+\.(?:toml|py))`")


def tables(text: str) -> list[list[list[str]]]:
    """Each table of a page: rows of cells, the header first."""
    blocks = re.findall(r"(?:^\|.*\n)+", text + "\n", re.M)
    return [
        [[cell.strip() for cell in line.strip("|\n ").split("|")] for line in block.splitlines() if "| --- |" not in line]
        for block in blocks
    ]


def block(name: str) -> str:
    return re.search(rf"<!-- {name} -->\n(.*?)<!-- end of {name} -->", figures.README.read_text(), re.S)[1]


def test_each_column_of_the_price_table_is_one_committed_model() -> None:
    """Costs, memory and accuracy of a column come from one model file, and its C is in the repository."""
    assert report.files(KEPT) == {"RK4": "`nqvm.toml`", "RK4, folded": "`nqvm_folded.toml`", "explicit Euler": "`nqvm_euler.toml`"}
    for title, file in report.files(KEPT).items():
        ours = figures.OURS[figures.PRICES[title]]
        assert ours.title == file and ours.source == COMMITTED
        assert (COMMITTED / f"{ours.model().name}.c").exists()


@pytest.mark.parametrize("part", ["ours", "memory", "accuracy"])
@pytest.mark.parametrize("wrong", ["`nqvm.toml`", "`nqvm_euler.toml`, input = linear"])
def test_two_models_under_one_heading_are_refused(part: str, wrong: str) -> None:
    other = json.loads(json.dumps(KEPT))
    key = "file" if part == "accuracy" else "model"
    row = next(row for row in other[part] if row[key] == "`nqvm_euler.toml`")
    row[key] = wrong
    with pytest.raises(ValueError, match=r"explicit Euler: figures of .* and of"):
        report.prices(other)


def test_every_table_names_one_model_file_for_each_of_our_figures() -> None:
    for table in tables(block("figures")):
        names = next(row for row in table if row[0] == "model file")
        assert len(names) == len(table[0]) and all(FILE.fullmatch(name) for name in names[1:])
    seen = 0
    for table in tables(block("bench") + report.table(KEPT)):
        if "model file" in (row[0] for row in table):
            named = table[[row[0] for row in table].index("model file")][1:]
        elif "model file" in table[0]:
            named = [row[table[0].index("model file")] for row in table[1:]]
        else:
            named = [row[0] for row in table[1:] if "penode" in row[0]]
        assert all(len(FILE.findall(name)) == 1 for name in named), named
        seen += len(named)
    assert seen > 100


@pytest.mark.parametrize("title", figures.PRICES)
def test_the_price_table_is_what_the_committed_c_costs(title: str) -> None:
    """Measured anew from the model file that README names: to the instruction with the compiler that it was made with."""
    counts = tables(block("figures"))[0]
    column = counts[0].index(title)
    file = FILE.fullmatch(next(row for row in counts if row[0] == "model file")[column])[1]
    shown = int(next(row for row in counts if row[0] == "instructions a step, Cortex-M4F")[column].replace(" ", ""))
    program = programs.our_program(model(file.removesuffix(".toml")), source=COMMITTED)
    found = bench.measured(program, bench.chirp(65)[:, None])["instructions"][1]
    compiler = subprocess.run(["arm-none-eabi-gcc", "--version"], check=True, capture_output=True, text=True).stdout.splitlines()[0]
    assert abs(found - shown) <= (0 if compiler == KEPT["made with"][0]["compiler"] else 0.02 * shown)
