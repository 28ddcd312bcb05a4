# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
Model files without any tolerance, in which one value or two are wrong by 3 to 25 %: are these named, and no others?

    build/venv/bin/python test/diagnosis/values_cases/values_campaign.py --cases 100            a fresh draw; its seed is printed
    build/venv/bin/python test/diagnosis/values_cases/values_campaign.py --only 123:17          one case again, files kept

Plants and recordings are those of the own campaign with nothing hidden. A case is drawn again unless it can be solved: no other set of
as few values follows the recordings as well, by the linear plant.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import combinations
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from campaign import commit, diagnose, drawing, drawn
from hidden import cases
from score import wilson

ASKED = 0.95
WITHIN = 0.01  # of the true value, or in its interval
PLAIN = 100.0  # chi2 that every other set of as few values leaves at least
SIZES = 0.03, 0.25


def draw(seed: int, index: int) -> tuple[cases.Case, dict[str, float]]:
    """A case with nothing hidden, and the factors of its wrong values."""
    rng = np.random.default_rng([seed, index])
    while True:
        number = int(rng.integers(10**6)) * len(cases.PATTERN) + cases.PATTERN.index("null")
        case = cases.make(seed, number)
        names = sorted(case.bench.plant.true)
        chosen = rng.choice(names, size=min(int(rng.integers(1, 3)), len(names) - 1), replace=False)
        factors = {str(n): float(1.0 + rng.choice([-1.0, 1.0]) * rng.uniform(*SIZES)) for n in sorted(chosen)}
        if solvable(case, factors):
            return case, factors


def solvable(case: cases.Case, factors: Mapping[str, float]) -> bool:
    """Does every other set of as many values, or fewer, leave PLAIN at least?"""
    shown, starts = case.bench.of_parameters, case.bench.of_start
    x = np.sum([np.log(f) * shown[n] for n, f in factors.items()], axis=0)
    others = [s for k in range(len(factors) + 1) for s in combinations(sorted(shown), k) if set(s) != set(factors)]
    return all(left(x, [*(shown[n] for n in s), *starts]) > PLAIN for s in others)


def left(x: np.ndarray, free: Sequence[np.ndarray]) -> float:
    """Chi2 of a whitened difference that free directions leave."""
    if not free:
        return float(np.sum(x**2))
    columns = np.column_stack([f.ravel() / max(float(np.linalg.norm(f)), 1e-300) for f in free])
    return float(np.sum((x.ravel() - columns @ np.linalg.lstsq(columns, x.ravel(), rcond=1e-10)[0]) ** 2))


def write(case: cases.Case, factors: Mapping[str, float], folder: Path) -> list[Path]:
    """The recordings, and a model file without tolerances, true but for the wrong values."""
    paths = case.write(folder)
    text = re.sub(r",\s*tolerance\s*=\s*[^,}\s]+", "", (folder / "model.toml").read_text())
    for name, value in case.bench.plant.true.items():
        wrong = value * factors.get(name, 1.0)
        text = re.sub(rf"(?m)^({name}\s*=\s*\{{\s*value\s*=\s*)[-+0-9.eE]+", lambda m, x=wrong: f"{m[1]}{x:.9g}", text)
    (folder / "model.toml").write_text(text)
    return paths


def judged(case: cases.Case, factors: Mapping[str, float], found: Mapping | None) -> tuple[bool, list[str], list[float]]:
    """Are the wrong values named, and nothing else, each within WITHIN or in its interval? What was named, and the errors."""
    causes = (found or {}).get("causes") or []
    words = [f"{c['kind']} at {c['where']}" for c in causes]
    if sorted(words) != sorted(f"wrong_parameter at {n}" for n in factors):
        return False, words, []
    sizes = {n: v for c in causes for n, v in c["parameters"].items()}
    errors = {n: abs(sizes[n]["value"] / case.bench.plant.true[n] - 1.0) for n in factors}
    inside = {n: sizes[n]["ci95"][0] <= case.bench.plant.true[n] <= sizes[n]["ci95"][1] for n in factors}
    return all(errors[n] <= WITHIN or inside[n] for n in factors), words, list(errors.values())


def one(seed: int, index: int, command: str, timeout: float, out: Path, keep: bool) -> dict:
    """One case from draw to row."""
    case, factors = draw(seed, index)
    folder = out / "cases" / f"{seed}-{index}"
    shutil.rmtree(folder, ignore_errors=True)
    recordings = write(case, factors, folder)
    found, seconds, why = diagnose(command, folder, recordings, timeout) if command else (None, 0.0, "")
    right, words, errors = judged(case, factors, found)
    if not keep:
        shutil.rmtree(folder)
    hidden = {n: round(100.0 * (f - 1.0), 1) for n, f in factors.items()}
    row = {"case": f"{seed}:{index}", "hidden": hidden, "answer": words, "verdict": (found or {}).get("verdict"), "right": right}
    return row | {"errors": errors, "seconds": round(seconds, 1), "why": why}


def line(row: Mapping) -> str:
    """A row in words."""
    hidden = " + ".join(f"{n} {x:+.1f} %" for n, x in row["hidden"].items())
    return f"{row['case']} {'right' if row['right'] else 'WRONG'}: {hidden} -> {' + '.join(row['answer']) or row['verdict'] or row['why']}"


def page(rows: Sequence[Mapping], about: str) -> str:
    """The table, then what was not right."""
    out = [f"# Values without tolerances\n\n{about}\n\n| | cases | right | share [95 %] | asked |\n|---|---|---|---|---|"]
    for what, some in (
        ("all", rows),
        ("one value", [r for r in rows if len(r["hidden"]) == 1]),
        ("two", [r for r in rows if len(r["hidden"]) == 2]),
    ):
        right = sum(r["right"] for r in some)
        low, high = wilson(right, len(some))
        out.append(f"| {what} | {len(some)} | {right} | {right / max(len(some), 1):.0%} [{low:.0%}, {high:.0%}] | {ASKED:.0%} |")
    errors, times = sorted(e for r in rows for e in r["errors"]), sorted(r["seconds"] for r in rows)
    if errors:
        out.append(f"\nErrors of named values: median {errors[len(errors) // 2]:.2%}, largest {errors[-1]:.2%}.")
    out.append(f"Time on one core: median {times[len(times) // 2]:.0f} s, longest {times[-1]:.0f} s.\n")
    return "\n".join([*out, "## Not right\n", *(f"- {line(r)}" for r in rows if not r["right"])]) + "\n"


def main() -> int:
    args: argparse.Namespace = drawing(__doc__, Path("build/values")).parse_args()
    seed, indices = drawn(args)
    keep, command, rows = args.keep or bool(args.only) or args.generate, "" if args.generate else args.command, []
    with ProcessPoolExecutor(args.jobs) as pool, (args.out / "rows.jsonl").open("w") as file:
        for job in [pool.submit(one, seed, i, command, args.timeout, args.out, keep) for i in indices]:
            rows.append(job.result())
            file.write(json.dumps(rows[-1]) + "\n")
            file.flush()
            print(line(rows[-1]) if command else f"{rows[-1]['case']} {rows[-1]['hidden']}", flush=True)
    if args.generate:
        return 0
    text = page(rows, f"Seed {seed}, {commit()}, `{args.command}`.")
    (args.out / "VALUES.md").write_text(text)
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
