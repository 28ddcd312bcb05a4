# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
Recordings of laboratory rigs with something hidden: is it named, with its place, and nothing else?

    build/venv/bin/python test/diagnosis/rig_cases/rigs_campaign.py --cases 28               a fresh draw; its seed is printed
    build/venv/bin/python test/diagnosis/rig_cases/rigs_campaign.py --only 123:17            one case again, files and truth kept
    build/venv/bin/python test/diagnosis/rig_cases/rigs_campaign.py --cases 28 --generate    only the files and the truth
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

from rig_cases import cases, judging


def one(seed: int, index: int, command: str, timeout: float, out: Path, keep: bool) -> dict:
    """One case from draw to row; the truth is written after the command is through. Without a command only files and truth."""
    case = cases.make(seed, index)
    folder = out / "cases" / f"{seed}-{index}"
    shutil.rmtree(folder, ignore_errors=True)
    train, held_out = case.write(folder)
    found, seconds, why = None, 0.0, ""
    if command:
        found, seconds, why = diagnose(command, folder, train + held_out, timeout, holdouts=len(held_out))
    truth = case.truth()
    cases.write_truth(truth, out / "truth" / f"{seed}-{index}.json")
    if not keep:
        shutil.rmtree(folder)
    return judging.score(truth, found) | {"seconds": round(seconds, 1), "why": why}


def line(row: Mapping) -> str:
    """A row in words."""
    answer = " + ".join(row["answer"]) or row["verdict"] or row["why"] or "not diagnosed"
    beside = "" if row["beside_expert"] is None else f", hold-out {row['beside_expert']:.2f} of the true law's"
    return f"{row['case']} {row['rig']}, {row['outcome']}: {row['what']} -> {answer}{beside}, {row['seconds']} s"


def totals(rows: Sequence[Mapping]) -> str:
    """How many there are of each outcome."""
    hidden, nulls = (Counter(r["outcome"] for r in rows if r["null"] == null) for null in (False, True))
    counted = (judging.RIGHT, judging.SMALL, judging.FALSE, judging.MISSED, judging.PART, judging.NONE)
    words = ", ".join(f"{name} {hidden[name]}" for name in counted)
    null_words = ", ".join(f"{name} {nulls[name]}" for name in (judging.RIGHT, judging.UNSURE, judging.ALARM, judging.NONE))
    return f"{hidden.total()} with something hidden: {words}; {nulls.total()} nulls: {null_words}"


def parsed() -> argparse.Namespace:
    """The command line."""
    parser = drawing(__doc__, Path("build/rig-cases"))
    args = parser.parse_args()
    if args.no_tolerance:
        parser.error("--no-tolerance: the rigs state the tolerances of their data sheets, and are as wrong as these allow")
    return args


def main() -> int:
    args = parsed()
    seed, indices = drawn(args)
    keep, command, rows = args.keep or bool(args.only) or args.generate, "" if args.generate else args.command, []
    code = commit()
    with ProcessPoolExecutor(args.jobs) as pool, (args.out / "rows.jsonl").open("w") as file:
        jobs = [pool.submit(one, seed, i, command, args.timeout, args.out, keep) for i in indices]
        for job in jobs:
            rows.append(job.result() | {"code": code})
            file.write(json.dumps(rows[-1]) + "\n")
            file.flush()
            print(line(rows[-1]), flush=True)
    if not args.generate:
        print(f"seed {seed}, {code}: {totals(rows)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
