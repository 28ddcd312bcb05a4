# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""`make bench-filters`: what an update of a Kalman filter costs, ours and other forms, on the same functions of the same model.

filters.py           measures all, writes bench.json and table.md; TINYEKF_DIR names a checkout of github.com/simondlevy/TinyEKF,
                     else what was measured of it last is quoted
filters.py --check   fails where a figure at -O2 is more than 2 % off the kept one, or where table.md shows something else
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import report

import penode_gen
from penode_sil.building import FLAGS
from penode_sil.targets import MACHINES, PORT

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
PLACE = ROOT / "build" / "bench" / "filters"
KEPT, TABLE = HERE / "bench.json", HERE / "table.md"
MODEL = ROOT / "test" / "filter" / "models" / "cost.toml"
LEVELS = ("-Os", "-O2", "-O3")
PROMISED = "-O2"  # the level that has a limit
SHARE = 0.02  # of a figure
CLOSE = 1e-2  # how far states [standard deviations] and variances [of them] may be from ours: rounding
NAMES = {
    "penode": "**penode** (`cost.toml`), UD factors",
    "cholesky": "root of the covariance (Cholesky)",
    "joseph": "whole matrices (Joseph)",
    "tinyekf": "TinyEKF",
    "model": "the model's functions alone",
}

Figures = dict[str, Any]


def generated() -> Path:
    """The C of the model, as test/filter/models/cost.toml has it, with Runge-Kutta of order 4."""
    PLACE.mkdir(parents=True, exist_ok=True)
    text = MODEL.read_text().replace("../../../gen", str(ROOT / "gen"))
    (PLACE / "model.toml").write_text(text.replace('name = "costly"', 'name = "costly"\nmethod = "rk4"'))
    penode_gen.generate(penode_gen.load(PLACE / "model.toml"), PLACE, self_test=False)
    return PLACE


def play(kind: str, level: str, options: list[str]) -> tuple[Figures, np.ndarray]:
    """Figures of one filter, and its last state and variances [2, 4]. SystemExit if it does not build or run."""
    elf = PLACE / f"{kind}{level}.elf"
    sources = sorted(path for path in (ROOT / "src").glob("*.c") if not path.name.startswith("pen_xcp"))
    sources += [*(PLACE / f"{part}.c" for part in ("costly", "costly_ekf", "nqvm_params"))]
    sources += [HERE / "filters" / "drive.c", HERE / "filters" / f"{kind}.c"]
    words = [*FLAGS, level, *options, "-DSET=nqvm_set_default", f"-I{PLACE}", f"-I{HERE / 'filters'}", "-o", elf, *sources, "-lm", "-lc"]
    for command in ([PORT / "cc", MACHINES["m4f"], *words], [PORT / "run", MACHINES["m4f"], elf]):
        done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
        if done.returncode != 0:
            raise SystemExit(f"filters: {kind} {level}: {done.stdout}{done.stderr}")
    rows = re.findall(r"^(\w+) (\d+)$", done.stdout, re.M)
    found = {name: int(value) for name, value in rows if name not in ("state", "variance")}
    bits = np.array([[int(value) for name, value in rows if name == part] for part in ("state", "variance")], np.uint32)
    return found | {"filter": kind, "level": level}, bits.view(np.float32).astype(float)


def tinyekf() -> tuple[str, list[str]] | None:
    """Its name with the commit, and options; None if no checkout is named. It wants a libc's headers, and warns."""
    if not os.environ.get("TINYEKF_DIR"):
        return None
    folder = Path(os.environ["TINYEKF_DIR"]).resolve()
    done = subprocess.run(["git", "-C", str(folder), "rev-parse", "--short=7", "HEAD"], check=True, capture_output=True, text=True)
    return f"TinyEKF ({done.stdout.strip()})", [f"-I{folder / 'src'}", "-w"]


def measured(levels: Sequence[str]) -> list[Figures]:
    """A row for each filter and level of optimisation; SystemExit if one of them computes something else."""
    generated()
    found, checkout = [], tinyekf()
    for level in levels:
        _, ours = play("penode", level, [])
        for kind, name in NAMES.items():
            if kind == "tinyekf" and checkout is None:
                continue
            row, own = play(kind, level, checkout[1] if kind == "tinyekf" and checkout else [])
            row["name"] = checkout[0] if kind == "tinyekf" and checkout else name
            off = max(np.abs(own[0] - ours[0]) / np.sqrt(ours[1])), max(np.abs(own[1] / ours[1] - 1.0))
            if kind != "model" and max(off) > CLOSE:
                raise SystemExit(f"filters: {kind} {level}: off ours by {off[0]:.2g} standard deviations, variances by {off[1]:.2g}")
            found.append(row)
    return found


def off(new: list[Figures], kept: list[Figures]) -> list[str]:
    """Figures that are not the kept ones."""
    before = {(row["filter"], row["level"]): row for row in kept}
    return [
        f"{row['filter']} {row['level']}: {row[key]} {key} instead of {was[key]}"
        for row in new
        if (was := before[row["filter"], row["level"]])
        for key in ("least", "most", "stack", "bytes")
        if abs(row[key] - was[key]) > SHARE * was[key]
    ]


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--check", action="store_true", help="write nothing, compare")
    given = arguments.parse_args()
    figures = json.loads(KEPT.read_text())
    kept, rows = figures.get("filters", []), measured([PROMISED] if given.check else LEVELS)
    if given.check:
        wrong = off(rows, kept)
        wrong += [] if report.table(figures) == TABLE.read_text() else ["table.md is not what bench.json has"]
        print("\n".join(wrong), file=sys.stderr)
        return int(bool(wrong))
    at_hand = {row["filter"] for row in rows}
    figures["filters"] = rows + [row | {"quoted": True} for row in kept if row["filter"] not in at_hand]
    KEPT.write_text(report.written(figures))
    TABLE.write_text(report.table(figures))
    print(report.filters(figures["filters"]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
