# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
What each threshold of the diagnosis decides: which of them go, and what each of the others costs or saves.

    ablate.py table NOTES [NOTES...]            which thresholds decide something in the cases that probes.py has noted, from NOTES/*.jsonl
    ablate.py off NAME NOTES [NOTES...] --draw SEED:INDEX... --worlds SEED:INDEX...
                                                those cases again with NAME switched off: won and lost

A threshold is switched off by giving each of its comparisons the outcome that it has most often. Where all of its comparisons come out
the same in all cases, it decides nothing, and can be removed. Else only the cases in which one of them came out otherwise are run again.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path

HERE = Path(__file__).resolve().parent
PROBES = f"{sys.executable} {HERE / 'probes.py'} diagnose"
FOLDER = {"campaign.py": "", "worlds_campaign.py": "main-"}  # how the folder of case SEED-INDEX begins, which is its name in the notes
Seen = dict[str, dict[str, tuple[bool, bool]]]  # case: place: did a comparison there hold, and did one not


def read(folders: Iterable[Path]) -> Seen:
    """What was noted, by case."""
    seen: Seen = {}
    for line in (line for folder in folders for file in sorted(folder.glob("*.jsonl")) for line in file.read_text().splitlines()):
        entry = json.loads(line)
        places = seen.setdefault(entry["case"], {})
        for place, (held, failed) in entry["seen"].items():
            before = places.get(place, (False, False))
            places[place] = before[0] or held > 0, before[1] or failed > 0
    return seen


def usual(seen: Seen) -> dict[str, bool]:
    """The outcome of each place that comes out so in most cases."""
    votes: dict[str, int] = defaultdict(int)
    for places in seen.values():
        for place, (held, failed) in places.items():
            votes[place] += held - failed
    return {place: vote > 0 for place, vote in votes.items()}


def deciding(seen: Seen) -> dict[str, set[str]]:
    """For each threshold, the cases in which one of its comparisons came out otherwise than usual."""
    most = usual(seen)
    found: dict[str, set[str]] = {place.partition(" @ ")[0]: set() for place in most}
    for case, places in seen.items():
        for place, (held, failed) in places.items():
            if failed if most[place] else held:
                found[place.partition(" @ ")[0]].add(case)
    return found


def table(seen: Seen) -> str:
    """Thresholds by the number of cases that they decide, those that decide nothing first."""
    rows = [f"{len(seen)} cases", "", "| threshold | cases in which it decides | places |", "|---|---|---|"]
    places: dict[str, list[str]] = defaultdict(list)
    for place in sorted(usual(seen)):
        name, _, where = place.partition(" @ ")
        places[name].append(where)
    for name, cases in sorted(deciding(seen).items(), key=lambda pair: (len(pair[1]), pair[0])):
        rows.append(f"| {name} | {len(cases)} | {', '.join(places[name][:4])} |")
    return "\n".join(rows)


def run(campaign: str, cases: Sequence[str], off: Path | None) -> dict[str, bool]:
    """Which cases, SEED:INDEX, of a campaign come out right."""
    environment = {k: v for k, v in os.environ.items() if k not in ("PROBES", "PROBES_OFF")} | ({"PROBES_OFF": str(off)} if off else {})
    right: dict[str, bool] = {}
    for case in cases:
        with tempfile.TemporaryDirectory() as folder:
            call = [sys.executable, str(HERE.parent / campaign), "--only", case, "--command", PROBES, "--out", folder]
            subprocess.run(call, env=environment, capture_output=True, check=False)
            rows = [json.loads(line) for line in (Path(folder) / "rows.jsonl").read_text().splitlines()]
            right[case] = bool(rows[-1]["right"])
    return right


def switched_off(name: str, seen: Seen, cases: dict[str, Sequence[str]]) -> str:
    """Cases won and lost without a threshold, among those that it decides and that are given."""
    off = {place: outcome for place, outcome in usual(seen).items() if place.partition(" @ ")[0] == name}
    decided = deciding(seen).get(name, set())
    with tempfile.NamedTemporaryFile("w", suffix=".json") as file:
        file.write(json.dumps(off))
        file.flush()
        won, lost, tried = [], [], 0
        for campaign, some in cases.items():
            chosen = [case for case in some if FOLDER[campaign] + case.replace(":", "-") in decided]
            before, after = run(campaign, chosen, None), run(campaign, chosen, Path(file.name))
            tried += len(chosen)
            won += [c for c in chosen if after[c] > before[c]]
            lost += [c for c in chosen if after[c] < before[c]]
    return f"{name} off: {tried} cases run, won {', '.join(won) or 'none'}; lost {', '.join(lost) or 'none'}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    what = parser.add_subparsers(required=True, dest="what")
    shown = what.add_parser("table", help="what each threshold decides")
    tried = what.add_parser("off", help="cases won and lost without one")
    tried.add_argument("name", help="as the table has it, such as worth.WORTH")
    tried.add_argument("--draw", nargs="*", default=[], help="cases of campaign.py")
    tried.add_argument("--worlds", nargs="*", default=[], help="cases of worlds_campaign.py")
    for each in (shown, tried):
        each.add_argument("notes", nargs="+", type=Path, help="folders of notes")
    asked = parser.parse_args()
    seen = read(asked.notes)
    if not seen:
        print(
            f"{', '.join(map(str, asked.notes))}: nothing noted; run a campaign with PROBES={asked.notes[0]} and probes.py as its command",
            file=sys.stderr,
        )
        return 2
    if asked.what == "table":
        print(table(seen))
    else:
        print(switched_off(asked.name, seen, {"campaign.py": asked.draw, "worlds_campaign.py": asked.worlds}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
