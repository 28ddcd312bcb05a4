# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
Is a stated confidence what it says: of causes named with 90 %, are 90 % right? And what may it be: of answers that explain as much?

    build/venv/bin/python test/diagnosis/reliability.py build/campaign/rows.jsonl build/worlds/main/rows.jsonl ...
    build/venv/bin/python test/diagnosis/reliability.py ROWS.jsonl... --take-over      and reports of `penode diagnose` state it

Rows are those of campaign.py and worlds_campaign.py. A decile is inside if the mean confidence stated in it lies in the 95 % interval
(Wilson) of the share that is right. Exit code 2 for rows that cannot be read; with --gate 1 if something is not as it should be.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from score import wilson

from penode_sil.diagnosis import reliability as told

TABLE = (
    Path(__file__).resolve().parents[2] / "sil/penode_sil/diagnosis/templates/reliability.json"
)  # of which penode_sil.diagnosis.reliability reads
APART = 0.05  # that mean confidence and share right may be, over all
# shares of the power of the avoidable residual: from each on, up to the one before, answers are trusted alike. Of its amplitude, a tenth is
# left at most, a third, a half, or more
LEVELS = (0.99, 0.9, 0.75, 0.0)


def read(path: Path, command: str) -> tuple[list[dict], dict]:
    """Rows of one campaign, of a case that was timed again the later one, and what made them: seed, cases, code."""
    found: dict[str, dict] = {}
    head: dict = {}
    try:
        for k, text in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            row = json.loads(text)
            if k == 1 and "case" not in row and "code" in row:
                head = row
            elif row.get("command", command) == command:
                found[f"{row.get('stratum')} {row['case']}"] = row
                claimed = row["named"]
                row |= {"explained": row.get("explained"), "trust": row.get("trust") if claimed else None}
                sound = all({"confidence", "right", "nothing"} <= set(c) and 0.0 <= (c["confidence"] or 0.0) <= 1.0 for c in claimed)
                if not sound:
                    raise ValueError
    except (OSError, UnicodeDecodeError) as problem:
        raise SystemExit(_bad(f"{path}: cannot be read ({problem})")) from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise SystemExit(
            _bad(f"{path}:{k}: not a row that says how sure each named cause is and whether it is right; run the campaign again")
        ) from None
    rows = list(found.values())
    seeds = sorted({int(r["case"].partition(":")[0]) for r in rows})
    codes = sorted({str(r.get("code", head.get("code", ""))) for r in rows})
    return rows, {"seeds": seeds, "cases": len(rows), "codes": codes}


def _bad(text: str) -> int:
    print(text, file=sys.stderr)
    return 2


def table(rows: Sequence[Mapping]) -> dict:
    """Deciles of stated confidence with what was right in each, the same over all, and how many sizes may be nothing."""
    named = [c for r in rows for c in r["named"] if c["confidence"] is not None]
    deciles = []
    for k in range(10):
        own = [c for c in named if min(int(10.0 * c["confidence"] + 1e-9), 9) == k]
        if own:
            right, (low, high) = sum(c["right"] for c in own), wilson(sum(c["right"] for c in own), len(own))
            mean = sum(c["confidence"] for c in own) / len(own)
            deciles.append(
                {
                    "from": k / 10,
                    "to": (k + 1) / 10,
                    "named": len(own),
                    "right": right,
                    "stated": round(mean, 4),
                    "ci95": [round(low, 4), round(high, 4)],
                    "inside": low <= mean <= high,
                }
            )
    right = sum(c["right"] for c in named)
    return {
        "cases": len(rows),
        "named": len(named),
        "right": right,
        "deciles": deciles,
        "stated": sum(c["confidence"] for c in named) / len(named) if named else None,
        "nothing": [f"{r['case']} {c['cause']}" for r in rows for c in r["named"] if c["nothing"]],
        "unstated": sum(c["confidence"] is None for r in rows for c in r["named"]),
    }


def learnt(rows: Sequence[Mapping]) -> list[dict]:
    """For each of LEVELS: causes that a search found, named or not, how many were right, and their share of the posterior, as after one
    right and one wrong one more. A fault that samples show by themselves is more certain than any of these, and does not count."""
    found = []
    for level, above in zip(LEVELS, (np.inf, *LEVELS), strict=False):
        named = [(c, trust) for c, explained, trust in _found(rows) if level <= explained < above]
        right, posterior = sum(c["right"] for c, _ in named), sum(c["confidence"] / trust for c, trust in named)
        share = min((right + 1.0) / (posterior + 2.0), 0.99)
        found.append({"explained": level, "named": len(named), "right": right, "share": round(share, 4)})
    return found


def _found(rows: Sequence[Mapping]) -> Iterator[tuple[Mapping, float, float]]:
    """Causes of searches, each with what its answer explains and the trust in that."""
    for r in rows:
        yield from ((c, r["explained"], r["trust"]) for c in r["named"] if _searched(c, r))
        few = r.get("unlikely") or {"causes": ()}
        yield from ((c, few["explained"], few["trust"]) for c in few["causes"])


def trusted(rows: Sequence[Mapping], levels: Sequence[Mapping]) -> list[dict]:
    """Rows with the names, and the confidences of these, that these levels give."""

    def again(c: Mapping, explained: float, trust: float) -> dict:
        level = told.level(levels, explained)
        return {**c, "confidence": c["confidence"] / trust * level["share"], "likely": told.mostly_right(level)}

    return [
        {**r, "named": [*(c for c in r["named"] if not _searched(c, r)), *(c for c in (again(*x) for x in _found([r])) if c["likely"])]}
        for r in rows
    ]


def _searched(claim: Mapping, row: Mapping) -> bool:
    """Is a named cause one of the search, whose confidence is a posterior times the trust in what the answer explains?"""
    return bool(row["trust"]) and claim["confidence"] is not None and claim["confidence"] <= row["trust"] + 1e-9


def text(t: Mapping) -> str:
    """The table for a terminal."""
    lines = [f"{'confidence':<14}{'named':>7}{'right':>7}{'share':>8}  {'95 % interval':<18}{'stated':>8}  inside"]
    for d in t["deciles"]:
        low, high = d["ci95"]
        lines.append(
            f"{100 * d['from']:>3.0f} .. {100 * d['to']:>3.0f} %{d['named']:>8}{d['right']:>7}{100 * d['right'] / d['named']:>6.1f} %"
            f"  {100 * low:>5.1f} .. {100 * high:>5.1f} %{100 * d['stated']:>9.1f} %  {'yes' if d['inside'] else 'NO'}"
        )
    low, high = wilson(t["right"], t["named"])
    lines.append(
        f"over all: {t['named']} named causes of {t['cases']} cases, {100 * t['stated']:.1f} % stated, "
        f"{100 * t['right'] / t['named']:.1f} % right "
        f"({100 * low:.1f} .. {100 * high:.1f}): {100 * apart(t):+.1f} points (asked: within {100 * APART:.0f})"
    )
    lines.append(f"named with an interval that holds the model without the cause: {len(t['nothing'])} (asked: none)")
    lines += [f"  {what}" for what in t["nothing"]]
    lines += [f"without a stated confidence, left out: {t['unstated']}"] if t["unstated"] else []
    return "\n".join(lines)


def apart(t: Mapping) -> float:
    """Mean confidence minus share right: above 0, too sure."""
    return t["stated"] - t["right"] / t["named"]


def wrong(t: Mapping) -> list[str]:
    """What is not as it should be."""
    found = [f"{100 * d['from']:.0f} .. {100 * d['to']:.0f} % is outside of its interval" for d in t["deciles"] if not d["inside"]]
    found += [f"{100 * apart(t):+.1f} points over all"] if abs(apart(t)) > APART else []
    return found + ([f"{len(t['nothing'])} sizes may be nothing"] if t["nothing"] else [])


def source(made: Sequence[Mapping]) -> str:
    """Which campaigns: 597 cases of seed 5 and 300 of seed 808, commits 1234567 and 89abcde."""
    drawn: dict[str, int] = {}
    for m in made:
        seeds = ", ".join(map(str, m["seeds"]))
        drawn[seeds] = drawn.get(seeds, 0) + m["cases"]
    counts = [f"{cases}{' cases' * (k == 0)} of seed {seeds}" for k, (seeds, cases) in enumerate(drawn.items())]
    codes = sorted({c for m in made for c in m["codes"]})
    code = f"commits {' and '.join(c.removeprefix('commit ') for c in codes)}" if len(codes) > 1 else codes[0]
    return f"{' and '.join(counts)}, {code}"


def parsed() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", type=Path, nargs="+", metavar="ROWS.jsonl")
    parser.add_argument("--command", default="diagnose", help="of several in one file (diagnose)")
    parser.add_argument("--code", default="", help="what made rows that do not say it: commit 1234567")
    parser.add_argument("--take-over", action="store_true", help=f"write the table that reports state, {TABLE.name}")
    parser.add_argument(
        "--gate", action="store_true", help="exit code 1 if a decile is outside, over all by more than 5 points, or a size may be nothing"
    )
    return parser.parse_args()


def main() -> int:
    asked = parsed()
    read_all = [read(path, asked.command) for path in asked.rows]
    rows, made = [row for some, _ in read_all for row in some], [m for _, m in read_all]
    t = table(rows)
    if not t["named"]:
        return _bad(f"{', '.join(map(str, asked.rows))}: no named cause with a confidence")
    for m in made:
        m["codes"] = [c or asked.code for c in m["codes"]]
    print(text(t))
    if asked.take_over and not any(r["trust"] for r in rows):
        return _bad("not taken over: no row says what its answer explains; run the campaign again")
    if asked.take_over:
        if any(not c or c.endswith("-dirty") or c.startswith("an unknown") for m in made for c in m["codes"]):
            return _bad(
                "not taken over: the rows do not say which commit made them, or it had changes; --code names it where they say none"
            )
        levels = learnt(rows)
        t = table(trusted(rows, levels))
        print(f"with what was learnt:\n{text(t)}")
        kept = {"source": source(made), "cases": t["cases"], "trust": levels, "deciles": t["deciles"]}
        TABLE.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
        print(f"-> {TABLE}")
    return int(asked.gate and bool(wrong(t)))


if __name__ == "__main__":
    sys.exit(main())
