# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
Wrong worlds: is the hidden effect named, and the mis-modelling everywhere else not?

    build/venv/bin/python test/diagnosis/worlds_campaign.py --cases 300 --out DIR                 a fresh draw; its seed is printed
    build/venv/bin/python test/diagnosis/worlds_campaign.py --stratum halfcar --cases 20 --no-tolerance
    build/venv/bin/python test/diagnosis/worlds_campaign.py --only 123:17 --out DIR               one case again, files and truth kept
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from campaign import commit, diagnose, drawing, drawn
from claims import nominals
from score import wilson
from worlds import equivalents, world
from worlds_score import added_laws, score, small

DEMANDED = {"single": 0.85, "null": 0.98, "pair": 0.65, "halfcar": 0.90, "drive": 0.90}  # of the issue; null: at most 2 % named


def one(seed: int, index: int, stratum: str, tolerances: bool | None, command: str, timeout: float, out: Path, keep: bool) -> dict:
    """One case from draw to row; the truth is written after the command is through."""
    case = world.make(seed, index, stratum, tolerances)
    folder = out / "cases" / f"{stratum}-{seed}-{index}"
    shutil.rmtree(folder, ignore_errors=True)
    found, seconds, why = diagnose(command, folder, case.write(folder), timeout)
    truth = equivalents.truth(case)
    row = score(truth, found, nominals(folder / "model.toml")) | {"seconds": round(seconds, 1), "why": why}
    extended = folder / "diagnosis" / "model_extended.toml"
    if row["answer"] and extended.exists():
        kinds = [a.split()[0] for a in row["answer"]] + small(found["notes"])
        row["laws"] = added_laws((folder / "model.toml").read_text(), extended.read_text(), kinds)
    world.write_truth(truth, out / "truth" / f"{stratum}-{seed}-{index}.json")
    if not keep:
        shutil.rmtree(folder)
    return row


def line(row: Mapping) -> str:
    """A row in words."""
    hidden = " + ".join(f"{k} {x:.1f}" for k, x in zip(row["kinds"], row["ratios"], strict=True)) or "nothing"
    return (
        f"{row['case']} {row['plant']} {row['outcome']}: "
        f"{hidden} -> {' + '.join(row['answer']) or row['verdict'] or row['why']}, {row['seconds']} s"
    )


def share(rows: Sequence[Mapping], what: str) -> str:
    """One row of the table."""
    right = sum(r["right"] for r in rows)
    low, high = wilson(right, len(rows))
    group = what.split(",", maxsplit=1)[0]
    asked = f"{DEMANDED[group]:.0%}" if group in DEMANDED else ""
    return f"| {what} | {len(rows)} | {right} | {right / len(rows):.0%} [{low:.0%}, {high:.0%}] | {asked} |"


def page(rows: Sequence[Mapping], about: str) -> str:
    """The table of the issue, by group, plant, kind; then what was wrong."""
    out = [f"# Wrong worlds\n\n{about}\n\n| | cases | right | share [95 %] | asked |\n|---|---|---|---|---|"]
    main = [r for r in rows if r["stratum"] == "main"]
    for group in ("single", "null", "pair"):
        for name, some in (
            ("", main),
            (", tolerances stated", [r for r in main if r["tolerance"]]),
            (", none stated", [r for r in main if not r["tolerance"]]),
        ):
            if some := [r for r in some if r["group"] == group]:
                out.append(share(some, group + name))
    for stratum in ("halfcar", "drive"):
        if some := [r for r in rows if r["stratum"] == stratum]:
            out.append(share(some, stratum))
            alarms = sum(r["outcome"] == "false alarm" for r in some if r["group"] == "null")
            out.append(f"| {stratum}, false alarms | {sum(r['group'] == 'null' for r in some)} | {alarms} named | | 0 |")
    for plant in sorted({r["plant"] for r in main}):
        out.append(share([r for r in main if r["plant"] == plant], f"plant {plant}"))
    for kind in sorted({k for r in rows if r["group"] == "single" for k in r["kinds"]}):
        out.append(share([r for r in rows if r["kinds"] == [kind]], kind))
    laws = [r["laws"] for r in rows if r.get("laws") and r["right"]]
    times = sorted(r["seconds"] for r in rows)
    out.append(f"\nOne textbook law a name: {sum(n <= m for n, m in laws)} of {len(laws)} rightly named." if laws else "")
    out.append(
        f"Time on one core: median {times[len(times) // 2]:.0f} s, "
        f"90 % within {times[int(0.9 * (len(times) - 1))]:.0f} s, longest {times[-1]:.0f} s.\n"
    )
    return "\n".join([*out, "## Not right\n", *(f"- {line(r)}" for r in rows if not r["right"])]) + "\n"


def parsed() -> argparse.Namespace:
    """The command line."""
    parser = drawing(__doc__, Path("build/worlds"))
    parser.add_argument("--stratum", choices=("main", "halfcar", "drive"), action="append")
    return parser.parse_args()


def main() -> int:
    args = parsed()
    seed, indices = drawn(args)
    tolerances = False if args.no_tolerance else None
    chosen = [(s, i) for s in args.stratum or ["main"] for i in indices]
    if args.generate:
        for s, i in chosen:
            case = world.make(seed, i, s, tolerances)
            case.write(args.out / "cases" / f"{s}-{seed}-{i}")
            world.write_truth(equivalents.truth(case), args.out / "truth" / f"{s}-{seed}-{i}.json")
        return 0
    rows, code = [], commit()
    with ProcessPoolExecutor(args.jobs) as pool, (args.out / "rows.jsonl").open("w") as file:
        jobs = [
            pool.submit(one, seed, i, s, tolerances, args.command, args.timeout, args.out, args.keep or bool(args.only)) for s, i in chosen
        ]
        for job in jobs:
            rows.append(job.result() | {"code": code})
            file.write(json.dumps(rows[-1]) + "\n")
            file.flush()
            print(line(rows[-1]), flush=True)
    text = page(
        rows,
        (
            f"Seed {seed}, {code}, `{args.command}`{', no tolerances' * args.no_tolerance}. "
            "Effects 3 to 10 times the mis-modelling at their place."
        ),
    )
    (args.out / "WORLDS.md").write_text(text)
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
