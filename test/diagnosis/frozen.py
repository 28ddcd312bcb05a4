# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A frozen draw: what an earlier diagnosis answered to cases that a seed makes again, for a later one to be compared with.

    frozen.py ROWS [--take-over OLD_ROWS]    compare rows.jsonl of a campaign with the draw, or write the draw from those of another one

frozen.json has the seed, the code that answered, and of each case whether it was right. Two diagnoses of the same cases differ beyond
chance where McNemar's exact test on the cases that only one of them has right says so.
"""

import argparse
import json
import sys
from pathlib import Path

from scipy import stats

HERE = Path(__file__).resolve().parent


def rows(path: Path) -> tuple[dict, dict[str, bool]]:
    """Head of a draw, and whether each case was right."""
    head, *found = map(json.loads, path.read_text().splitlines())
    return head, {r["case"]: bool(r["right"]) for r in found}


def mcnemar(old: dict[str, bool], new: dict[str, bool]) -> tuple[list[str], list[str], float]:
    """Cases lost and won, and the probability of so uneven a split, or a more uneven one, if neither is better."""
    both = old.keys() & new.keys()
    lost = sorted(c for c in both if old[c] and not new[c])
    won = sorted(c for c in both if new[c] and not old[c])
    p = float(stats.binomtest(len(lost), len(lost) + len(won)).pvalue) if lost or won else 1.0
    return lost, won, p


def main(arguments: list[str] | None = None) -> int:
    parse = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parse.add_argument("rows", type=Path)
    parse.add_argument("--take-over", action="store_true", help="write frozen.json from these rows")
    asked = parse.parse_args(arguments)
    kept = HERE / "frozen.json"
    head, new = rows(asked.rows)
    if asked.take_over:
        kept.write_text(
            json.dumps({"seed": head["seed"], "code": head["code"], "right": {c.split(":")[1]: r for c, r in new.items()}}) + "\n"
        )
        return 0
    draw = json.loads(kept.read_text())
    if others := {c.split(":")[0] for c in new} - {str(draw["seed"])}:  # by its cases: a campaign --only SEED:INDEX has no seed of its own
        print(
            (
                f"{asked.rows}: seed {', '.join(sorted(others))}; the frozen draw has {draw['seed']}: "
                f"run the campaign with --seed {draw['seed']}"
            ),
            file=sys.stderr,
        )
        return 2
    old = {f"{draw['seed']}:{index}": right for index, right in draw["right"].items()}
    lost, won, p = mcnemar(old, new)
    both = old.keys() & new.keys()
    print(f"{len(both)} cases: {sum(old[c] for c in both)} right by {draw['code']}, {sum(new[c] for c in both)} by {head['code']}")
    print(f"lost {', '.join(lost) or 'none'}; won {', '.join(won) or 'none'}; McNemar p = {p:.3g}")
    return int(p < 0.05 and len(lost) > len(won))


if __name__ == "__main__":
    sys.exit(main())
