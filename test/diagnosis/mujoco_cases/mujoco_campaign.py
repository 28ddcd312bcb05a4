# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
Recordings of MuJoCo with something hidden: is it named, with its place, and nothing else?

    build/venv/bin/python test/diagnosis/mujoco_cases/mujoco_campaign.py --cases 24               a fresh draw; its seed is printed
    build/venv/bin/python test/diagnosis/mujoco_cases/mujoco_campaign.py --only 123:17            one case again, files and truth kept
    build/venv/bin/python test/diagnosis/mujoco_cases/mujoco_campaign.py --cases 24 --generate    only the files and the truth

MuJoCo has to be in build/mujoco: test/setup.sh mujoco (make campaign-mujoco does it).
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from campaign import commit, diagnose, drawing, drawn
from claims import nominals
from score import allowed_failures, wilson
from worlds_score import score

from mujoco_cases import cases, engine

NARROW = ("input_dead_zone", "input_saturation")  # that are asked for by themselves
ASKED = {"single": 0.92, "null": 1.0, "dead zone and saturation": 0.80}
GATED = {"single": 0.92, "null": 0.998}  # null: "none named" stands for one in 500
RISK = 1e-3
FALSE = ("wrong name", "extra name", "false alarm", "claim without a name")  # of the outcomes, those that claim what is not so


def one(seed: int, index: int, tolerances: bool | None, command: str, timeout: float, out: Path, keep: bool) -> dict:
    """One case from draw to row; the truth is written after the command is through. Without a command only files and truth."""
    case, refused = cases.make(seed, index, tolerances)
    folder = out / "cases" / f"{seed}-{index}"
    shutil.rmtree(folder, ignore_errors=True)
    paths = case.write(folder)
    found, seconds, why = diagnose(command, folder, paths, timeout) if command else (None, 0.0, "")
    truth = case.truth(refused)
    cases.write_truth(truth, out / "truth" / f"{seed}-{index}.json")
    row = score(truth, found, nominals(folder / "model.toml")) | {"seconds": round(seconds, 1), "why": why, "refused": truth["refused"]}
    if not keep:
        shutil.rmtree(folder)
    return row


def line(row: Mapping) -> str:
    """A row in words."""
    hidden = " + ".join(f"{k} {x:.1f}" for k, x in zip(row["kinds"], row["ratios"], strict=True)) or "nothing"
    answer = " + ".join(row["answer"]) or row["verdict"] or row["why"]
    known = "tolerances" if row["tolerance"] else "none stated"
    return f"{row['case']} {row['plant']}, {known}, {row['outcome']}: {hidden} -> {answer}, {row['seconds']} s"


def groups(rows: Sequence[Mapping]) -> dict[str, list[Mapping]]:
    """Rows by what is asked of them."""
    return {
        "single": [r for r in rows if r["group"] == "single"],
        "null": [r for r in rows if r["group"] == "null"],
        "dead zone and saturation": [r for r in rows if r["kinds"] and r["kinds"][0] in NARROW],
    }


def share(what: str, rows: Sequence[Mapping], asked: float | None = None) -> str:
    """One row of the table: right, false, missed, and nulls that were named."""
    right, wrong = sum(r["right"] for r in rows), sum(r["outcome"] in FALSE for r in rows)
    low, high = wilson(right, len(rows))
    nulls = [r for r in rows if r["group"] == "null"]
    named = f"{sum(r['outcome'] == 'false alarm' for r in nulls)} of {len(nulls)}" if nulls else ""
    percent = f"{right / len(rows):.0%} [{low:.0%}, {high:.0%}]"
    cells = (what, len(rows), right, wrong, len(rows) - right - wrong, named, percent, "" if asked is None else f"{asked:.0%}")
    return f"| {' | '.join(map(str, cells))} |"


def page(rows: Sequence[Mapping], about: str) -> str:
    """The table, by what is asked, tolerances, plant and kind; then what was not right."""
    head = "| | cases | right | false | missed | nulls named | share [95 %] | asked |\n|---|---|---|---|---|---|---|---|"
    out = [f"# Cases of MuJoCo\n\n{about}\n\n{head}"]
    asked = groups(rows)
    out += [share(what, some, ASKED[what]) for what, some in asked.items() if some]
    out += [
        share(what, some)
        for what, known in (("single, tolerances stated", True), ("single, none stated", False))
        if (some := [r for r in asked["single"] if bool(r["tolerance"]) == known])
    ]
    out += [share(f"plant {plant}", [r for r in rows if r["plant"] == plant]) for plant in sorted({r["plant"] for r in rows})]
    kinds = sorted({k for r in asked["single"] for k in r["kinds"]})
    out += [share(kind, [r for r in asked["single"] if r["kinds"] == [kind]]) for kind in kinds]
    covered = [c for r in rows for _, c in r["covered"]]
    times = sorted(r["seconds"] for r in rows)
    refused = sum((Counter(r["refused"]) for r in rows), Counter())
    out.append(f"\n95 % intervals of rightly named effects: {sum(covered)} of {len(covered)} hold the truth.")
    out.append(
        f"Time on one core: median {times[len(times) // 2]:.0f} s, "
        f"90 % within {times[int(0.9 * (len(times) - 1))]:.0f} s, longest {times[-1]:.0f} s."
    )
    out.append("Drawn again: " + (", ".join(f"{n} {why}" for why, n in refused.most_common()) or "none") + ".\n")
    return "\n".join([*out, "## Not right\n", *(f"- {line(r)}" for r in rows if not r["right"])]) + "\n"


def gate(rows: Sequence[Mapping]) -> list[str]:
    """What is wrong more often than a program at the asked rates is, less than once in 1000 runs."""
    found = []
    for what, rate in GATED.items():
        some = groups(rows)[what]
        wrong, most = sum(not r["right"] for r in some), allowed_failures([rate] * len(some), RISK / len(GATED))
        if wrong > most:
            found.append(f"{what}: {wrong} of {len(some)} wrong, at most {most} can be chance")
    return found


def parsed() -> argparse.Namespace:
    """The command line."""
    parser = drawing(__doc__, Path("build/mujoco-cases"))
    parser.add_argument("--gate", action="store_true", help="exit code 1 where more is wrong than chance allows at the asked rates")
    return parser.parse_args()


def main() -> int:
    args = parsed()
    if engine.installed() is None:
        print(f"mujoco_campaign: {engine.REMEDY}", file=sys.stderr)
        return 2
    seed, indices = drawn(args)
    keep, tolerances = args.keep or bool(args.only) or args.generate, False if args.no_tolerance else None
    command, rows, code = "" if args.generate else args.command, [], commit()
    with ProcessPoolExecutor(args.jobs) as pool, (args.out / "rows.jsonl").open("w") as file:
        jobs = [pool.submit(one, seed, i, tolerances, command, args.timeout, args.out, keep) for i in indices]
        for job in jobs:
            rows.append(job.result() | {"code": code})
            file.write(json.dumps(rows[-1]) + "\n")
            file.flush()
            print(line(rows[-1]), flush=True)
    if args.generate:
        return 0
    text = page(rows, f"Seed {seed}, {code}, `{args.command}`{', no tolerances' * args.no_tolerance}.")
    (args.out / "MUJOCO.md").write_text(text)
    print(text)
    bad = gate(rows) if args.gate else []
    for what in bad:
        print(f"FAIL  {what}")
    if args.gate and not bad:
        print(f"ok    mujoco seed {seed}, {len(rows)} cases")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
