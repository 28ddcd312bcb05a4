# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: Frama-C Eva finds nothing that could go wrong in runtime and models, has seen every statement, and finds seeds.

eva.py RUN...           these runs only, such as "runtime, filters"; --seeds: and their seeded faults
"""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import eva_xcp
import gate

WORK = gate.BUILD / "eva"
HARNESS = gate.HERE / "eva"

PROMISES = [
    "[networks]",
    'spring_net = { inputs = ["m"], output = "N", max_slope = "1e7 N/m", max_force = "1e6 N" }',
    'damper_net = { inputs = ["m/s"], output = "N", dissipative = "100 N", max_slope = "1e6 N*s/m" }',
    "[outputs]",
    'z_b = { value = "z_b", unit = "m", trial_bound = 0.01 }',
]
WET = 'wet_tyre = { between = ["wheel", "z_road"], law = "linear_damper", damping = "100 N*s/m" }'
# What becomes of gen/nqvm/nqvm.toml. The first three stand in gen/nqvm/c as they are.
MODELS = {
    "nqvm": [],
    "nqvm_euler": [],
    "nqvm_folded": [],
    "clamped": ['method = "heun"', 'outside = "clamp"', 'input = "held"', "substeps = 2", 'out_of_range = "clamp"'],
    "implicit": [
        'method = "ros1"',
        'outside = "clamp"',
        'input = "parabola"',
        'out_of_range = "hold"',
        'on_damage = "rollback"',
        "[elements]",
        WET,
    ],
    "fading": ['method = "ros2"', 'outside = "fade"', "fade_width = 0.5", 'on_damage = "hold"'],
    "folded_or_not": ['method = "euler"', 'outside = "clamp"', "pieces = 96", 'more_pieces = "layers"', 'on_damage = "rollback"'],
}
# With sets of their own. For coverage.py: Eva does not analyse them.
PROMISED = {
    "promised": ['outside = "clamp"', 'method = "heun"', "trial = 8", *PROMISES],
    "folded_and_promised": ['outside = "clamp"', "pieces = 96", "trial = 8", 'on_damage = "rollback"', *PROMISES],
}
OWNED = ("nqvm_sets.h", "nqvm_params.c")  # the sets of all others
PARTS = (
    "all_layers",
    "elements",
    "elementary",
    "networks_of_16",
    "systems",
    "filters",
    "monitors",
    "folding",
    "sets",
    "serial",
    "selftest",
)
# Parts in a file of their own.
OF_FILE = {"trial": "promise.c", "promises": "promise.c"} | eva_xcp.ENTRIES

OPTIONS = [
    *(
        "-eva",
        "-eva-precision",
        "3",
        "-eva-split-return",
        "full",
        "-eva-domains-function",
        "octagon:pen_tuning_write,octagon:pen_tuning_write_bytes,octagon:pen_serial_get_bytes,octagon:pen_serial_put_bytes,octagon:pen_fold",
        "-eva-octagon-through-calls",
    ),
    *("-eva-slevel-function", "go:1,pen_fold:1"),  # where they write needs no look at each turn: quicker without
    *("-warn-special-float", "none"),  # NaN and Inf are values
    *("-warn-unsigned-downcast", "-warn-signed-downcast", "-eva-no-show-progress", "-eva-msg-key=-final-states"),
]

# Loops over layers and neurons, with states merged between: numbers of rows stay known, and no decision multiplies states.
UNROLLED = ["-eva-precision", "0", "-eva-min-loop-unroll", "24"]
OPTIONS_OF = {"promises": UNROLLED, "trial": UNROLLED} | {entry: eva_xcp.options(entry) for entry in eva_xcp.ENTRIES}

LIMIT = 1800  # seconds that an analysis may take


@dataclass(frozen=True)
class Run:
    """One analysis: a model, or None for the runtime alone, from an entry of the harness on."""

    model: str | None
    entry: str
    size_build: bool = False
    big_endian: bool = False

    def __str__(self) -> str:
        return (
            f"{self.model or 'runtime'}, {self.entry}{', size build' if self.size_build else ''}{', big endian' if self.big_endian else ''}"
        )


@dataclass(frozen=True)
class Seen:
    """What Eva said: alarms with their places, other trouble, statements (reached, all) of each function."""

    alarms: list[str]
    trouble: list[str]
    statements: dict[str, tuple[int, int]] = field(default_factory=dict)
    defined: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Seed:
    """A fault: in this file, `old` becomes `new`; Eva has to raise an alarm in this run."""

    file: str
    old: str
    new: str
    run: Run


MODEL = Run("nqvm_euler", "corrupted")
ORDER = Run("nqvm_euler", "in_order")
PROMISE = Run(None, "promises")
SEEDS = [
    Seed("pen_set.c", " || (n > (length - offset))", "", MODEL),
    Seed("pen_set.c", "((offset > length) || (n", "((n", MODEL),
    Seed("pen_set.c", "n > (length - offset)", "n > (tuning->slot[0].head.length - offset)", MODEL),
    Seed("pen_set.c", " || (n > (size - offset))", "", MODEL),
    Seed("pen_set.c", "    if (bank == NULL) {", "    if (tuning->open != YES) {", MODEL),
    Seed("pen_set.c", "return (pen_port_load(&tuning->active) & 1U) ^ 1U", "return pen_port_load(&tuning->active) ^ 1U", MODEL),
    Seed("pen_set.c", "uint32_t active = pen_port_load(&tuning->active) & 1U", "uint32_t active = pen_port_load(&tuning->active)", MODEL),
    Seed("pen_set.c", "((set == NULL) || (set->value == NULL))", "(set == NULL)", MODEL),
    Seed("pen_set.c", "(head == NULL) || ", "", MODEL),
    Seed("pen_set.c", "} else if (tuning->previous.value == NULL) {", "} else if (false) {", ORDER),
    Seed("pen_set.c", "            pen_set_copy(&tuning->slot[i], set);\n", "            pen_set_copy(&tuning->slot[0], set);\n", ORDER),
    Seed("pen_set.c", "(tuning == NULL) || ", "", Run(None, "sets")),
    Seed("pen_serial.c", "table[next & 0x0fU]", "table[next & 0x1fU]", MODEL),
    Seed("pen_serial.c", "i < n; i++) {\n        to[", "i <= n; i++) {\n        to[", MODEL),
    Seed("pen_instance.c", "while ((*n > 0U) && (guard->at < length)) {", "while (*n > 0U) {", MODEL),
    Seed("pen_instance.c", "while ((*n > 0U) && (guard->at < end)) {", "while (*n > 0U) {", Run("nqvm_folded", "corrupted")),
    Seed("pen_saved.c", "(tuning->bank[i] != NULL) ? tuning->bank[i]", "banks ? tuning->bank[i]", MODEL),
    Seed("pen_set.c", "} else if (tuning->previous.value == NULL) {", "} else if (false) {", Run("implicit", "corrupted")),
    Seed("pen_saved.c", "((place - KNOWN) < model->sets)", "((place - KNOWN) <= model->sets)", MODEL),
    Seed("pen_saved.c", "(byte != NULL) && (size == ", "(size == ", MODEL),
    Seed(
        "pen_saved.c",
        "(found != NULL) ? found : tuning->initial.value;\n    return none || ((found != NULL) && ",
        "found;\n    return none || (",
        ORDER,
    ),
    Seed("pen_instance.c", "return (self != NULL) && ", "return ", MODEL),
    Seed("pen_status.c", "i < PEN_STATUS_FLAGS", "i <= PEN_STATUS_FLAGS", MODEL),
    Seed("pen_step.h", "self->scrub % round", "self->scrub", MODEL),
    Seed("nqvm_euler.c", "self->u[1U - (self->head.running & 1U)]", "self->u[1U - self->head.running]", MODEL),
    Seed("nqvm_euler.c", "((u == NULL) || (y == NULL))", "(u == NULL)", MODEL),
    Seed("nqvm_euler.c", "(self != NULL) && ", "", MODEL),
    Seed(
        "pen_instance.c",
        "        if (found == PEN_OK) {\n            self->guard.pieces",
        "        if (true) {\n            self->guard.pieces",
        ORDER,
    ),
    Seed("pen_solve.c", "(n <= PEN_SOLVE_MAX) && ", "", Run(None, "systems")),
    Seed("pen_solve.c", "for (size_t i = k + 1U; i < n; i++)", "for (size_t i = k + 1U; i <= n; i++)", Run(None, "systems")),
    Seed("pen_ekf.c", "(test[i].verdict % PEN_EKF_VERDICTS)", "test[i].verdict", Run(None, "filters")),
    Seed("pen_ekf.h", "&work[(n + 1U) * wide]", "&work[(n + 2U) * wide]", Run(None, "filters")),
    Seed("pen_ekf.h", "verdicts[there + sound + (within & number)]", "verdicts[there + sound + within + number]", Run(None, "filters")),
    Seed("pen_monitor.c", "i < (2U * model->n_causes * model->n_x)", "i <= (2U * model->n_causes * model->n_x)", Run(None, "monitors")),
    Seed("pen_monitor.c", "&sample->direct[c * model->n_z]", "&sample->direct[c * n]", Run(None, "monitors")),
    Seed("pen_monitor.c", "const uint32_t good = advanced & finite;", "const uint32_t good = advanced + finite;", Run(None, "monitors")),
    Seed("pen_math.c", "UINT32_C(1) << (k & 31U)", "UINT32_C(1) << (k & 63U)", Run(None, "elements")),
    Seed("pen_math.c", "#define EXP_HIGH      89.0F", "#define EXP_HIGH      189.0F", Run(None, "elements")),
    Seed("pen_net.c", "(row + 4U) <= n_out", "row < n_out", Run(None, "all_layers")),
    Seed("pen_fold.c", "while (more && (left > 0U) && ", "while (more && ", Run(None, "folding")),
    Seed("pen_fold.c", "        } else if ((kink < walk->chain->neurons) && !flat) {", "        } else if (!flat) {", Run(None, "folding")),
    Seed("pen_cell.c", "part->neuron[(part->open < PEN_CELL_OPEN) ? part->open : 0U]", "part->neuron[part->open]", PROMISE),
    Seed("pen_cell.c", " && (part->open <= PEN_CELL_OPEN)", "", PROMISE),
    Seed("pen_cell.c", "at[stride * (i + 1U)]", "at[stride * (i + 2U)]", PROMISE),
    Seed("pen_cell.c", "&work[7U * width]", "&work[8U * width]", PROMISE),
    Seed("pen_promise.c", "p = &p[layer->n_out * (layer->n_in + 1U)]", "p = &p[layer->n_out * (layer->n_in + 2U)]", PROMISE),
    Seed("pen_selftest.c", "pen_dense(WIDE, 2U, w, x, y)", "pen_dense(WIDE, 3U, w, x, y)", Run(None, "selftest")),
    Seed("pen_fold.h", "&at[n - 1U]; /* of the two", "&at[n]; /* of the two", Run(None, "folding")),
    *(Seed(file, old, new, Run(None, entry)) for file, old, new, entry in eva_xcp.SEEDS),
]


def models(place: Path) -> None:
    """Copy or generate the C of all models."""
    for name, lines in (MODELS | PROMISED).items():
        if lines:
            file = place / f"{name}.toml"
            base = gate.ROOT / "gen" / "nqvm" / "nqvm.toml"
            file.write_text("\n".join(["[model]", f'extends = "{base}"', f'name = "{name}"', *lines, ""]))
            gate.make([Path(sys.executable).parent / "penode", "generate", file, "-o", place])
        else:
            for file in (f"{name}.c", f"{name}.h", f"{name}_selftest.c", *OWNED):
                shutil.copy(gate.ROOT / "gen" / "nqvm" / "c" / file, place)


def owner(model: str) -> str:
    """The model whose sets are those of `model`."""
    return model if model in PROMISED else "nqvm"


def told(model: str) -> list[str]:
    """Options that select the model of a program."""
    return [f'-DMODEL_HEADER="{model}.h"', f"-DMODEL(name)={model}_##name", f"-DMODEL_SIZE(name)={model.upper()}_##name"]


def sources(seed: Seed | None = None) -> Path:
    """A copy of inc/ and src/ and the models, with the seed in it; SystemExit if it does not fit."""
    place = WORK / "copy"
    shutil.rmtree(place, ignore_errors=True)
    for part in ("inc", "src"):
        shutil.copytree(gate.ROOT / part, place / part)
    for file in (*WORK.glob("*.c"), *WORK.glob("*.h")):
        shutil.copy(file, place / "src")
    if seed:
        (file,) = place.rglob(seed.file)
        if seed.old not in file.read_text():
            raise SystemExit(f"FAIL  eva: {seed.file} no longer has: {seed.old.strip()}")
        file.write_text(file.read_text().replace(seed.old, seed.new))
    return place


def analyse(run: Run, place: Path) -> Seen:
    """Let Eva look at one run."""
    words = [f"-I{place}/inc", f"-I{place}/src", "-Iport/template", *(["-D__OPTIMIZE_SIZE__"] if run.size_build else [])]
    of_xcp = run.entry in eva_xcp.ENTRIES
    words += eva_xcp.WORDS if of_xcp else []
    files = sorted(set((place / "src").glob("pen_*.c")) - (set() if of_xcp else set((place / "src").glob(eva_xcp.FILES))))
    if run.model:
        words += [f"'{word}'" for word in told(run.model)]
        files += [place / "src" / f"{run.model}.c", place / "src" / f"{owner(run.model)}_params.c", HARNESS / "model.c"]
    else:
        files += [HARNESS / OF_FILE.get(run.entry, "runtime.c")]
    # The limits of pen_math.c are volatile only to stop compilers; elsewhere a volatile read may give anything.
    split = [f"-cpp-extra-args-per-file={place}/src/pen_math.c:-Dvolatile="]
    last = ["-then", "-metrics", "-metrics-eva-cover"]
    machine = "ppc_32" if run.big_endian else "gcc_x86_32"  # 32 bits, as a Cortex-M
    # Half an hour of processor time, however busy the machine is.
    command = [
        "prlimit",
        f"--cpu={LIMIT}",
        "frama-c",
        "-machdep",
        machine,
        f"-cpp-extra-args={' '.join(words)}",
        *split,
        *files,
        "-main",
        run.entry,
        *OPTIONS,
        *OPTIONS_OF.get(run.entry, []),
        *last,
    ]
    done = gate.run(command, limit=48 * LIMIT)
    text = done.stdout + done.stderr
    alarms = [f"{run}: {' '.join(m.split())}" for m in re.findall(r"^\[eva:alarm\] (.*\n(?:  .*\n)*)", text, re.M)]
    counted = re.search(r"^  (\d+) alarms? generated", text, re.M)
    clean = re.search(r"by the Eva analyzer: +0 errors +0 warnings", text) or "No errors or warnings raised" in text
    unproven = re.findall(r"^ +(?:Assertions|Preconditions) +\d+ valid +(\d+) unknown +(\d+) invalid", text, re.M)
    whole = done.returncode == 0 and counted and clean and not any(n != "0" for pair in unproven for n in pair)
    listed = re.search(r"Defined functions \(\d+\)\n.*?\n(.*?)\n *\n", text, re.S)
    names = re.findall(r"(\w+) \(\d+ calls?\)", listed[1]) if listed else []
    statements: dict[str, tuple[int, int]] = {}
    for name, reached, total in re.findall(r"^ +(\w+): (\d+) stmts out of (\d+)", text, re.M):
        key, now = plain(name), (int(reached), int(total))
        worst = min(statements.get(key, now), now, key=lambda pair: pair[0] - pair[1])
        statements[key] = worst
    trouble = [] if whole and names and statements else [f"{run}: no whole analysis\n{text[-3000:]}"]
    if counted and int(counted[1]) != len(alarms):
        trouble.append(f"{run}: {counted[1]} alarms counted, {len(alarms)} read")
    return Seen(alarms, trouble, statements, frozenset(map(plain, names)))


def plain(name: str) -> str:
    """A function's name in the source: Frama-C numbers those that several files have."""
    return re.sub(r"_\d+$", "", name)


def reached(seen: dict[Run, Seen]) -> tuple[int, list[str]]:
    """Number of statements in all functions, and what Eva has not reached in any run: of the runtime, or of a model."""
    harness = {name for file in HARNESS.glob("*.[ci]*") for name in re.findall(r"^\w[\w *]*\b(\w+)\([^;]*\)$", file.read_text(), re.M)}
    runtime = frozenset().union(*(s.defined for run, s in seen.items() if not run.model)) - harness
    total, missing = 0, []
    for group in (None, *dict.fromkeys(run.model for run in seen if run.model)):
        runs = [s for run, s in seen.items() if group in (None, run.model)]
        wanted = runtime if group is None else frozenset().union(*(s.defined for s in runs)) - runtime - harness
        for name in sorted(wanted):
            found = [s.statements[name] for s in runs if name in s.statements]
            total += max((all_of_it for _, all_of_it in found), default=0)
            if not any(a == b for a, b in found):
                missing.append(f"{group or 'runtime'}: {name}: {max(found, default='never called')}")
    return total, missing


def nan() -> list[str]:
    """What Eva cannot tell about NaN in elementary functions, tried out."""
    program = WORK / "nan"
    sanitize = ["-fsanitize=undefined,float-cast-overflow", "-fno-sanitize-recover=all"]
    gate.make(
        [
            "gcc",
            "-O2",
            "-ffp-contract=off",
            *sanitize,
            "-Iinc",
            "-Iport/template",
            "-o",
            program,
            HARNESS / "nan.c",
            *map("src/pen_{}.c".format, ("math", "trig", "atan", "log", "root")),
        ]
    )
    done = gate.run([program])
    return [] if done.returncode == 0 else [done.stdout + done.stderr]


def found_seeds(runs: Collection[Run]) -> tuple[bool, int, int]:
    """Are the seeded faults of these runs all found; how many are, of how many."""
    found, seeds = 0, [seed for seed in SEEDS if seed.run in runs]
    for seed in seeds:
        outcome = analyse(seed.run, sources(seed))
        found += bool(outcome.alarms)
        name = f"eva: seeded fault in {seed.file}: {' '.join(seed.old.split())} -> {' '.join(seed.new.split()) or 'nothing'}"
        gate.report(name, [] if outcome.alarms else ["not found", *outcome.trouble])
    return found == len(seeds), found, len(seeds)


def main(only: Sequence[str]) -> int:
    shutil.rmtree(WORK, ignore_errors=True)
    WORK.mkdir(parents=True)
    runs = [Run(None, part) for part in (*PARTS, *OF_FILE)] + [
        Run(None, "networks_of_16", size_build=True),
        Run(None, "serial", big_endian=True),
    ]
    runs += [ORDER, *(Run(model, "corrupted") for model in MODELS)]
    runs = [run for run in runs if not only or str(run) in only]
    if any(run.model for run in runs):
        models(WORK)
    good = True
    place = sources()
    seen: dict[Run, Seen] = {}
    for run in runs:
        seen[run] = analyse(run, place)
        good &= gate.report(f"eva: {run}", seen[run].alarms + seen[run].trouble)
    if only:
        return int(not (good and ("--seeds" not in only or found_seeds(runs)[0])))
    good &= gate.report("eva: every NaN through the elementary functions", nan())
    total, missing = reached(seen)
    good &= gate.report(f"eva: {total} statements reached", missing)
    seeds_good, found, seeds = found_seeds(runs)
    good &= seeds_good
    gate.keep(
        "eva",
        {
            "alarms": sum(len(s.alarms) for s in seen.values()),
            "runs": len(seen),
            "statements": total,
            "functions not wholly reached": len(missing),
            "faults": seeds,
            "faults found": found,
        },
    )
    return int(not good)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
