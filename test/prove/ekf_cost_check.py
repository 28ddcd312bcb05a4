# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: a step of a filter takes, on a Cortex-M4F, the same instructions whatever is measured, and those that gen/README.md states.

Four states, two measurements, folded networks. The last faults are branches on what is measured: each has to be found.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import gate

import penode_gen
from penode_sil.building import FLAGS
from penode_sil.targets import MACHINES, PORT

WORK = gate.BUILD / "ekf-cost"
MODELS = gate.ROOT / "test" / "filter" / "models"
HEADER = gate.ROOT / "inc" / "penode" / "pen_ekf.h"
PAGE = gate.ROOT / "gen" / "README.md"
METHODS = ("euler", "heun", "rk4")
SHARE = 0.02  # of a count: what compilers of one version may differ by, as for all figures
MORE = {"with limits": "limited", "with a parameter": "cost_mass"}  # name of a row, and its model
KINDS = ("measured", "not offered", "missing", "infinite", "refused", "one of two")

# Faults of pen_ekf.h: see gate.faulty.
FAULTS = {
    "a missing measurement takes a shorter way": (
        "    const uint32_t there =",
        0,
        "    if (!(z >= zero) && !(z < zero)) { return PEN_EKF_MISSING; }\n    const uint32_t there =",
    ),
    "a refused measurement takes a shorter way": (
        "    const bool used = verdict == PEN_EKF_USED;",
        0,
        "    const bool used = verdict == PEN_EKF_USED;\n    if (verdict == PEN_EKF_IS_REFUSED) { return PEN_EKF_REFUSED; }",
    ),
}


def compiler(machine: str) -> list[object]:
    """The compiler for one of MACHINES."""
    return [PORT / "cc", MACHINES[machine]] if MACHINES[machine] else [gate.ROOT / "port" / "host" / "cc", "gcc"]


def measured(model: str, method: str, level: str, header: Path = HEADER, machine: str = "m4f") -> dict[str, tuple[int, int]]:
    """Least and most instructions by kind of sample; bytes of the filter, and of the model in it. SystemExit if one is not of its kind."""
    place = WORK / f"{model}-{method}"
    place.mkdir(parents=True, exist_ok=True)
    text = (MODELS / f"{model}.toml").read_text().replace("../../../gen", str(gate.ROOT / "gen"))
    text = re.sub(r'extends = "(\w+\.toml)"', rf'extends = "{MODELS}/\1"', text)
    name = re.search(r'name = "(\w+)"', text)[1]
    (place / "model.toml").write_text(text.replace(f'name = "{name}"', f'name = "{name}"\nmethod = "{method}"'))
    loaded = penode_gen.load(place / "model.toml")
    penode_gen.generate(loaded, place, self_test=False)
    told = [f"-DMODEL(name)={name}_##name", f"-DMODEL_SIZE(name)={name.upper()}_##name", f'-DEKF_HEADER="{name}_ekf.h"']
    told += [f"-DSTEPPED(name)={loaded.stepped}_##name", f"-DSET={loaded.owner}_set_default"]
    told += ["-include", header] if header != HEADER else []  # its guard keeps the other one out
    sources = sorted((gate.ROOT / "src").glob("*.c"))
    parts = dict.fromkeys((name, loaded.stepped, f"{name}_ekf", f"{loaded.owner}_params"))
    sources += [*(place / f"{part}.c" for part in parts), gate.HERE / "ekf" / "cost.c"]
    elf = place / f"cost{level}-{machine}.elf"
    gate.make([*compiler(machine), *FLAGS, level, *told, f"-I{place}", "-o", elf, *sources])
    done = gate.run([PORT / "run", MACHINES[machine], elf] if MACHINES[machine] else [elf])
    rows = {name: (int(a), int(b)) for name, a, b in re.findall(r"^(.+) (\d+) (\d+)$", done.stdout, re.M)}
    if done.returncode != 0 or rows.get("wrong") != (0, 0):
        raise SystemExit(f"FAIL  ekf-cost: {done.stdout}{done.stderr}")
    return rows


def spread(rows: dict[str, tuple[int, int]]) -> list[str]:
    """Kinds of samples that do not take what the first one takes."""
    wanted = rows[KINDS[0]][0]
    return [f"{kind}: {rows[kind]}, a measured sample {wanted}" for kind in KINDS if rows[kind] != (wanted, wanted)]


def stated() -> dict[str, tuple[int, int]]:
    """The table of the page: method, -O2, -Os."""
    rows = re.findall(
        r"^\| `(\w+`(?:, with limits|, with a parameter)?) \| ([\d ]+) \| ([\d ]+) \|$", PAGE.read_text(encoding="utf-8"), re.M
    )
    return {name.replace("`", ""): (int(a.replace(" ", "")), int(b.replace(" ", ""))) for name, a, b in rows}


def main() -> int:
    found = {(method, level): measured("cost", method, level) for method in METHODS for level in ("-O2", "-Os")}
    more = {name: {level: measured(model, "rk4", level) for level in ("-O2", "-Os")} for name, model in MORE.items()}
    others = [(f"{name} {level}", rows) for name, builds in more.items() for level, rows in builds.items()]
    uneven = [f"{key}: {line}" for key, rows in (*found.items(), *others) for line in spread(rows)]
    good = gate.report(f"ekf-cost: the same instructions for {len(KINDS)} kinds of samples, in {len(found) + len(others)} builds", uneven)
    page = stated()
    wrong = []
    rows = {method: [found[method, level] for level in ("-O2", "-Os")] for method in METHODS}
    rows |= {f"rk4, {name}": list(builds.values()) for name, builds in more.items()}
    for method, builds in rows.items():
        counts = tuple(build["measured"][0] for build in builds)
        said = page.get(method, (0, 0))
        wrong += [f"{method}: {counts}, the page says {said}"] * any(abs(a - b) > SHARE * b for a, b in zip(counts, said, strict=True))
    good &= gate.report("ekf-cost: those that gen/README.md states", wrong)
    bits = [{machine: measured(model, "rk4", "-O2", machine=machine)["bits"] for machine in MACHINES} for model in MORE.values()]
    good &= gate.report(
        f"ekf-cost: the same bits on {len(MACHINES)} machines after 400 samples", [str(b) for b in bits if len(set(b.values())) > 1]
    )
    missed = []
    for k, (fault, change) in enumerate(FAULTS.items()):
        copy = WORK / f"fault{k}.h"
        copy.write_text(gate.faulty(HEADER.read_text(), change))
        missed += [] if spread(measured("cost", "euler", "-O2", copy)) else [f"not found: {fault}"]
    good &= gate.report(f"ekf-cost: {len(FAULTS) - len(missed)} of {len(FAULTS)} faults found", missed)
    if "--print" in sys.argv:
        print(
            {f"{method} {level}": rows["measured"][0] for (method, level), rows in found.items()},
            {key: rows["measured"][0] for key, rows in others},
        )
    bytes_of = found["rk4", "-O2"]["struct"]
    figures = {f"{method} {level}": rows["measured"][0] for (method, level), rows in found.items()}
    figures |= {key: rows["measured"][0] for key, rows in others}
    gate.keep("ekf-cost", figures | {"bytes": bytes_of[0] - bytes_of[1], "faults": len(FAULTS), "faults found": len(FAULTS) - len(missed)})
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
