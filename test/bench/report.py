# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""table.md and the block of README.md from the figures of bench.json."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from typing import Any

from figures import CORES, OURS, PRICES

OFF = "-ffp-contract=off"
Figures = dict[str, Any]


def number(value: int | float) -> str:
    return f"{value:,}".replace(",", " ")


def span(pair: Sequence[int]) -> str:
    """One number if both are the same."""
    return number(pair[0]) if pair[0] == pair[1] else f"{number(pair[0])} .. {number(pair[1])}"


def rows_of(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return "\n".join(f"| {' | '.join(row)} |" for row in [header, ["---"] * len(header), *rows])


def kilo(pair: Sequence[int]) -> str:
    """Low to high in thousands."""
    return " to ".join(f"{n / 1000:.{1 if n >= 10_000 else 2}f}" for n in pair)


def ours_at(figures: Figures, **keys: str) -> list[Figures]:
    return [row for row in figures["ours"] if all(row[key] == value for key, value in keys.items())]


def best_of_peers(figures: Figures) -> list[Figures]:
    """Each peer without contraction at the flags that give it the fewest cycles (low), fewest first."""
    best: dict[str, Figures] = {}
    for row in figures["peers"]:
        if row["contract"] == OFF and (row["name"] not in best or row["cycles"] < best[row["name"]]["cycles"]):
            best[row["name"]] = row
    return sorted(map(_quoted, best.values()), key=lambda row: row["cycles"])


def _quoted(row: Figures) -> Figures:
    """A peer that was not at hand says so."""
    return row | {"name": f"{row['name']}, quoted"} if row.get("quoted") else row


HOW = """\
# What a step costs

Made by `make bench`; all figures are in `bench.json`. The neural quarter vehicle of `gen/nqvm`: two networks of 593
parameters, 1-16-16-16-1, each evaluated once in every stage, sample time 1 ms.
Compiler: {compiler}. Emulator: {emulator}.

* **instructions** of one call of the step, from its first to its return: exact, counted in QEMU by a plugin
  (`count.c`), and for every row the same as by the emulated SysTick timer. Inputs: a chirp, noise of all sizes,
  subnormals, NaN, Inf. Two numbers: the fewest and the most.
* **modelled kilocycles** of a Cortex-M4 with FPU (`cortex_m4.py`), the most over the same inputs: from the low to the
  high reading of the core's technical reference manual. A model, not checked on silicon. It has **no wait states**:
  flash that is slower than the core adds to every row, most where much code or many weights are read once a stage; a
  cache or a prefetch buffer takes some of it back. Whether a VLDR follows another load without a bubble is open: low
  says yes, high says no. Other cores pair and overlap instructions, so for them only instructions are given.
* **text**, **constants**, **RAM** [B] of the step linked alone with all it calls, libgcc and the C library too;
  without the weights (4744 B, ours 4792 B with scaling and envelope), which every tool needs somewhere, and without
  the state.
* **stack** [B]: most that a call used (painted), and a bound from the machine code: the longest chain of calls. There
  is no recursion and no call through a pointer: checked.

Ours includes what the peers leave out: finite checks of input, state and result, trust envelope, adoption of a new
set, status and counters."""

SOFT = """\
The M3 has no FPU, and for double only the M7 (fpv5-d16) and the M55 have one: libgcc's soft float takes a path that
depends on the numbers, so no constant time can be promised there. Two numbers are what was seen."""

MEMORY = """\
An instance of a folded model holds the pieces of two sets. Without staging no buffers are needed; a set may lie in
flash. The stack of a commit is its bound."""

PEERS = """\
All peers compute the same step: each step from its own state before is within what rounding in float can explain
(derived in `reference.py`) of the same step in float64. They have the scaling of inputs and outputs worked into their
weights.

* textbook loop: three loops over layers, rows and columns.
* CMSIS-DSP: `arm_mat_vec_mult_f32`; bias and ReLU by hand.
* emlearn: its loadable networks, but with all digits of the weights (it prints 6 decimals). RAM: state of the C
  library, too.
* CasADi: generated C of the whole step with weights as an input. SX: every operation is a statement. MX: matrix
  operations. "called": the rates as SX, called by each stage of an MX step, the best that we found. "fmaxf": its C
  calls `fmax`, which computes in double; mended. RAM: work space; constants: zeros for inputs that are not given.
* scalarised: every multiply-add a statement, as the 117 KB in the paper that the quarter vehicle comes from. With
  literals the text holds the weights.
* onnx2c: the C that it makes of each network as ONNX, with its weights as constants. RAM: its buffers. At
  -O3 some weights are literals in the text.
* CMSIS-NN: `arm_fully_connected_f32`, which adds the bias and clamps for ReLU. Its kernels in float came after release
  7.0.0; they are in C but for cores with MVE, for which its packed layout of weights is. No other kernel there is a dense
  layer in float.
* Both are in no registry: measured where `ONNX2C_DIR` and `CMSIS_NN_DIR` name a checkout (`checkouts.py`), with the commit
  in their name; "quoted": it was not at hand, the figures are those of the last run that had it."""

HOST = "Ratios of one run, the best of seven rounds each; they differ by some 10 % from run to run."

MANY = """\
`penode_sil.batch` steps many runs of a model in the lanes of vector registers, each to the bit as alone; below is how
many steps it takes in the time of one step of the same C in a loop (the faster of gcc -O2 and -O3 -march=native), and of
one step of the same loop in NumPy and in SciPy's solve_ivp. One thread, one run, vectors of the machine at hand."""

WORST = """\
Everything that a constant-time step must not notice: inputs and states of any bits, special numbers, all sizes; every
end of a straight piece of the networks, every edge of their envelopes, every parameter of a law, and their neighbours;
staged sets of many sizes; sets whose memory was damaged into any bits, NaN, Inf, subnormals. "refused": a number was
not finite and the step kept state and outputs. "adopting": the step took over another set. "commit" checks a staged
set, and folds it, in the slow context; sets of more pieces than there is room for are among them. On the M3, whose
soft float takes a time that depends on the numbers, a tenth of the calls. "every law": a model with every law,
function and kind of layer that there is (`all_laws.py`); ros1 runs through all their slopes, too."""

HOSTS = {f"**penode, {what}**": f"**penode, {what}** ({OURS['RK4', what].title})" for what in ("layered", "folded")}
BATCH = {"nQVM, layer by layer": "`nqvm.toml`", "nQVM, folded": "`nqvm.toml`, pieces = 96", "hypothesis, 12 states": "`batch.py`"}
CALLER = ("instance", "banks", "set", "commit stack bound")
DECIDING = ("m3", "m4f", "m7")  # a core without an FPU, the most common one, and a fast one
COSTS = ("instructions", "modelled kilocycles", "text", "constants", "RAM", "stack", "its bound")


def summary(figures: Figures) -> str:
    """The short table of README.md: our RK4 steps and the best of each other tool, on a Cortex-M4F."""
    ours = _named(ours_at(figures, method="RK4", machine="m4f", real="float", level="-O2"))
    tools: dict[str, Figures] = {}
    for row in best_of_peers(figures):
        tools.setdefault(row["name"].split()[0].rstrip(","), row)
    rows = []
    for row in sorted([*ours, *tools.values()], key=lambda row: row["cycles"]):
        times = f"{row['cycles'][0] / ours[0]['cycles'][0]:.2f}"
        counts = [number(row["instructions"][1]), kilo(row["cycles"]), times, number(row["text"])]
        rows.append([row["name"], row["level"], *counts])
    header = ["RK4 step on a Cortex-M4F", "flags", "instructions", "modelled kilocycles", "times ours", "code [B]"]
    return rows_of(header, rows)


def files(figures: Figures) -> dict[str, str]:
    """The model file of each column of the price table; ValueError if one has figures of two, or of one that was changed."""
    found = {}
    for title, (method, evaluator) in PRICES.items():

        def of_ours(key, method=method, evaluator=evaluator):
            return [r["model"] for r in figures[key] if (r["method"], r["evaluator"]) == (method, evaluator)]

        exact = [row["file"] for row in figures["accuracy"] if row["model"] == title]
        names = {*of_ours("ours"), *of_ours("memory"), *exact}
        if len(names) != 1 or not all(name.endswith(".toml`") for name in names):
            raise ValueError(f"{title}: figures of {' and of '.join(sorted(names))} under one heading")
        found[title] = names.pop()
    return found


def prices(figures: Figures) -> str:
    """The price table of README.md: what decides between the methods, at -O2."""
    at = _at(figures)
    memory = _memory(figures)
    errors = {row["model"]: row for row in figures["accuracy"]}
    rows = [["model file", *files(figures).values()]]
    rows += [
        [f"instructions a step, {name}", *(span(at[title, machine, "-O2"]["instructions"]) for title in PRICES)]
        for machine, name in CORES.items()
        if machine in DECIDING
    ]
    names = {"text": "code of the whole step [B]", "stack": "its stack [B]"}
    rows += [[name, *(number(at[title, "m4f", "-O2"][key]) for title in PRICES)] for key, name in names.items()]
    rows.append(["an instance [B]", *(number(memory[PRICES[title]]["instance"]) for title in PRICES)])
    rows.append(["largest error after 10 s", *(_micrometres(errors[title]["largest"]) for title in PRICES)])
    return rows_of(["float, -O2; bytes on a Cortex-M4F", *PRICES], rows)


def all_prices(figures: Figures) -> tuple[str, ...]:
    """The same for all cores, at -O2 and -Os, with all of memory and accuracy: tables of table.md."""
    at, memory = _at(figures), _memory(figures)
    file = files(figures)
    columns = [(title, level) for title in PRICES for level in ("-O2", "-Os")]
    header = [f"{title} {level}" for title, level in columns]
    of = ["model file", *(file[title] for title, _ in columns)]
    counts = [[name, *(span(at[title, machine, level]["instructions"]) for title, level in columns)] for machine, name in CORES.items()]
    names = {"text": "code of the whole step", "rodata": "its constants, without weights", "stack": "its stack", "ram": "other RAM"}
    sizes = [[name, *(number(at[title, "m4f", level][key]) for title, level in columns)] for key, name in names.items()]
    caller = {"instance": "an instance", "set": "a parameter set, in flash or in RAM of the caller"}
    sizes += [[name, *(number(memory[PRICES[title]][key]) for title, _ in columns)] for key, name in caller.items()]
    errors = {row["model"]: row for row in figures["accuracy"]}
    exact = [
        [name, *(_micrometres(errors[title][key]) for title in PRICES)]
        for key, name in (("largest", "largest error of z_b, z_w"), ("RMS", "RMS error"))
    ]
    return (
        rows_of(["instructions a step", *header], [of, *counts]),
        rows_of(["bytes on a Cortex-M4F", *header], [of, *sizes]),
        rows_of(["float C at 1 ms against the exact solution, 10 s of a chirp", *PRICES], [["model file", *file.values()], *exact]),
    )


def _at(figures: Figures) -> dict[tuple[str, str, str], Figures]:
    """Our figures in float by title, core and level."""
    return {
        (title, machine, level): ours_at(figures, method=method, evaluator=evaluator, real="float", machine=machine, level=level)[0]
        for title, (method, evaluator) in PRICES.items()
        for machine in CORES
        for level in ("-O2", "-Os")
    }


def _memory(figures: Figures) -> dict[tuple[str, str], Figures]:
    """Memory of the caller in float by method and evaluator."""
    return {(row["method"], row["evaluator"]): row for row in figures["memory"] if row["real"] == "float"}


def _micrometres(nanometres: int) -> str:
    return f"{nanometres / 1000:.3g} µm" if nanometres < 1e6 else f"{nanometres / 1e6:.3g} mm"


def written(figures: Figures) -> str:
    """JSON with a line for each row."""
    parts = []
    for key, value in figures.items():
        rows = [value] if isinstance(value, dict) else value
        parts.append(f' "{key}": [\n' + ",\n".join(f"  {json.dumps(row)}" for row in rows) + "\n ]")
    return "{\n" + ",\n".join(parts) + "\n}\n"


FILTERS = """\
An update of an extended Kalman filter, made by `make bench-filters`: four states, two measurements, `test/filter/models/cost.toml`
with RK4 and folded networks, float. All call the same functions of the model and its derivatives, which the last row has
alone; after 400 samples all agree within 1 % of a standard deviation. Only ours has gates, counters, measurements that are
missing, refused or not offered, finite checks, and the last good state to return to. The forms with whole matrices
and with a root of the covariance are plain C written for this table (`filters/`), all sizes constant. At -O3 the compiler
writes all of them out: then what only ours does costs more than the form saves. Stack is measured, that of the whole
update; bytes are those of the caller beside the model."""


def filters(rows: list[Figures]) -> str:
    """The filters of filters.py, those with the fewest instructions at -O2 first."""
    of = {(row["filter"], row["level"]): row for row in rows}
    kinds = sorted((row for row in rows if row["level"] == "-O2"), key=lambda row: (row["filter"] == "model", row["most"]))
    levels = list(dict.fromkeys(row["level"] for row in rows))
    lines = [
        [
            _quoted(row)["name"],
            *(span([of[row["filter"], level]["least"], of[row["filter"], level]["most"]]) for level in levels),
            *(number(row[key]) for key in ("stack", "bytes")),
        ]
        for row in kinds
    ]
    return rows_of(["an update, Cortex-M4F", *(f"instructions, {level}" for level in levels), "stack, -O2", "bytes"], lines)


def table(figures: Figures) -> str:
    """table.md."""
    ours = ours_at(figures, machine="m4f")
    rivals = [*_named(r for r in ours if (r["method"], r["real"]) == ("RK4", "float")), *best_of_peers(figures)]
    parts = [
        HOW.format(**figures["made with"][0]),
        "## Ours",
        rows_of(["step, Cortex-M4F", "model file", "type", "flags", *COSTS], [[*_name(r), *_costs(r)] for r in ours]),
        "### On other cores",
        rows_of(["instructions", "model file", "type", "flags", *CORES.values()], [[*_name(r), *_by_core(figures, r)] for r in ours]),
        SOFT,
        "### Memory of the caller",
        rows_of(
            ["bytes that the caller gives", "model file", "type", "an instance", "buffers for staging", "a set", "stack of a commit"],
            [[f"{r['method']}, {r['evaluator']}", r["model"], r["real"], *(number(r[k]) for k in CALLER)] for r in figures["memory"]],
        ),
        MEMORY,
        "### The columns of README.md",
        *all_prices(figures),
        "## Peers, each at its best flags",
        rows_of(
            ["RK4 step, Cortex-M4F", "flags", *COSTS],
            [[r["name"], r["level"], *_costs(r)] for r in sorted(rivals, key=lambda r: r["cycles"])],
        ),
        PEERS,
        "### At all flags",
        rows_of(
            ["RK4 step, Cortex-M4F", "flags", "-ffp-contract", *COSTS],
            [[_quoted(r)["name"], r["level"], r["contract"].split("=")[1], *_costs(r)] for r in figures["peers"]],
        ),
        "### On the host",
        rows_of(
            ["time of a step, gcc -O2", "times ours"], [[HOSTS.get(r["name"], r["name"]), f"{r['ratio']:.2f}"] for r in figures["host"]]
        ),
        HOST,
        "### Many runs at once on the host",
        MANY,
        rows_of(
            ["model", "model file", "real", "times the C loop"],
            [[r["model"], BATCH[r["model"]], r["real"], f"{r['ratio']:.1f}"] for r in figures["batch"] if "real" in r],
        ),
        "\n".join(f"* {r['model']}: {number(r['ratio'])} times" for r in figures["batch"] if "real" not in r),
        "## Filters",
        FILTERS,
        filters(figures["filters"]),
        "## Worst case",
        WORST,
        rows_of(["float, -O2", "model file", "calls", *CORES.values(), "M4F, modelled kilocycles"], _worst(figures)),
    ]
    return "\n\n".join(parts) + "\n"


def _named(rows: Iterable[Figures]) -> list[Figures]:
    """Ours, with a name as peers have one."""
    return [row | {"name": f"**penode, {row['evaluator']}** ({row['model']})"} for row in rows]


def _name(row: Figures) -> list[str]:
    return [f"{row['method']}, {row['evaluator']}", row["model"], row["real"], row["level"]]


def _costs(row: Figures) -> list[str]:
    """The columns of COSTS."""
    found = [number(row[k]) if k in row else "" for k in ("text", "rodata", "ram", "stack", "stack bound")]
    return [span(row["instructions"]), kilo(row["cycles"]), *found]


def _by_core(figures: Figures, row: Figures) -> list[str]:
    """Instructions of the same step on each core."""
    same = ours_at(figures, **{k: row[k] for k in ("method", "evaluator", "real", "level")})
    found = {r["machine"]: span(r["instructions"]) for r in same}
    return [found[machine] for machine in CORES]


def _worst(figures: Figures) -> list[list[str]]:
    rows = []
    for m4f in (r for r in figures["worst case"] if r["machine"] == "m4f"):
        what = (m4f["evaluator"], m4f["kind"])
        same = {r["machine"]: r for r in figures["worst case"] if (r["evaluator"], r["kind"]) == what}
        cost = kilo(m4f["cycles"]) + (", constant" if m4f["constant cycles"] else ", the most")
        counts = [span(same[machine]["instructions"]) if machine in same else "" for machine in CORES]
        rows.append([", ".join(what), m4f["model"], number(m4f["calls"]), *counts, cost])
    return rows
