# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
Each search of the diagnosis alone, and both together, on the same cases of every generator: who is right where?

    build/venv/bin/python test/diagnosis/ablation/searches.py --cases 40 --worlds 20 --mechanisms 6 --mujoco 20 --out DIR      a fresh draw
    build/venv/bin/python test/diagnosis/ablation/searches.py --out DIR --page SEARCHES.md      the page of its rows

A draw goes on where it was stopped. MuJoCo's cases need build/mujoco: test/setup.sh mujoco.
"""

from __future__ import annotations

import argparse
import json
import secrets
import shutil
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import Any
from unittest import mock

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import score
import worlds_score
from campaign import commit, diagnose, forked
from claims import nominals
from hidden import cases
from mujoco_cases import cases as mujoco
from worlds import equivalents, world

from penode_sil.diagnosis import engine, verdict

SEARCHES = ("noise", "innovations", "both")
HEAD = "| | cases | sensor noise alone | innovations alone | both | both lose what one has | neither |\n|---|---|---|---|---|---|---|"


@contextmanager
def only(search: str) -> Iterator[None]:
    """The diagnosis with one of its searches alone; innovations leave what they do not support to the other."""

    def innovations(case: Any, study: Any, other: Any, bursts: Any) -> Any:
        if not verdict.supports(study.model):
            return both(case, study, other, bursts)
        faults = engine.broken_sensors(study.model, case.train, study, study.null.simulated, bursts)
        broken = partial(engine.still_broken, case.train, study, faults=faults, bursts=bursts)
        return verdict.conclude(case, study, verdict.searched(case, study), broken)

    both = engine._searched
    with (
        mock.patch.object(verdict, "supports", lambda model: False)
        if search == "noise"
        else mock.patch.object(engine, "_searched", innovations if search == "innovations" else both)
    ):
        yield


def campaign(seed: int, index: int, folder: Path) -> tuple[list[Path], Callable[[dict | None], dict]]:
    """A case of the own campaign: its recordings, and what scores an answer."""
    case = cases.make(seed, index)
    return case.write(folder), lambda found: score.score(case.truth(), found, 0.0)


def of_world(stratum: str, seed: int, index: int, folder: Path) -> tuple[list[Path], Callable[[dict | None], dict]]:
    """The same of a wrong world."""
    case = world.make(seed, index, stratum, None)
    return case.write(folder), lambda found: worlds_score.score(equivalents.truth(case), found, nominals(folder / "model.toml"))


def of_mujoco(seed: int, index: int, folder: Path) -> tuple[list[Path], Callable[[dict | None], dict]]:
    """The same of a case of MuJoCo."""
    case, refused = mujoco.make(seed, index, None)
    return case.write(folder), lambda found: worlds_score.score(case.truth(refused), found, nominals(folder / "model.toml"))


GENERATORS: dict[str, Callable[[int, int, Path], tuple[list[Path], Callable[[dict | None], dict]]]] = {
    "campaign": campaign,
    "worlds": lambda *at: of_world("main", *at),
    "half-cars": lambda *at: of_world("halfcar", *at),
    "drives": lambda *at: of_world("drive", *at),
    "mujoco": of_mujoco,
}


def one(generator: str, seed: int, index: int, timeout: float, out: Path) -> list[dict]:
    """One case, a row for each search; files go when it is through."""
    folder = out / f"{generator}-{index}"
    shutil.rmtree(folder, ignore_errors=True)
    recordings, scored = GENERATORS[generator](seed, index, folder)
    rows = []
    for search in SEARCHES:
        with only(search):
            found, seconds, why = diagnose("penode diagnose", folder, recordings, timeout, forked)
        shutil.rmtree(folder / "diagnosis", ignore_errors=True)
        row = scored(found)
        kept = {k: row[k] for k in ("kinds", "answer", "verdict", "outcome", "right")}
        stratum = row.get("group") or row["stratum"]
        about = {"generator": generator, "case": f"{seed}:{index}", "stratum": stratum, "search": search, "code": commit()}
        rows.append(about | kept | {"seconds": round(seconds - (found or {}).get("compile_seconds", 0.0), 1), "why": why})
    shutil.rmtree(folder)
    return rows


def by_case(rows: Sequence[Mapping]) -> list[dict[str, Mapping]]:
    """Rows of a case together, by search."""
    found: dict[tuple[str, str], dict[str, Mapping]] = {}
    for r in rows:
        found.setdefault((r["generator"], r["case"]), {})[r["search"]] = r
    return [c for c in found.values() if set(SEARCHES) <= set(c)]


def share(what: str, some: Sequence[Mapping[str, Mapping]]) -> str:
    """One row of the table."""
    right = [{s: bool(c[s]["right"]) for s in SEARCHES} for c in some]
    counts = [sum(r[s] for r in right) for s in SEARCHES]
    lost = sum(not r["both"] and (r["noise"] or r["innovations"]) for r in right)
    neither = sum(not any(r.values()) for r in right)
    return f"| {' | '.join(map(str, (what, len(some), *counts, lost, neither)))} |"


def page(rows: Sequence[Mapping], about: str) -> str:
    """The table by generator, by stratum and by kind of a single effect; then what both lose, and time."""
    every = by_case(rows)
    out = [f"# Each search alone\n\n{about}\n\nCases that are right: every effect named with its place, and nothing else.\n\n{HEAD}"]
    for generator in GENERATORS:
        some = [c for c in every if c["both"]["generator"] == generator]
        if not some:
            continue
        out.append(share(f"**{generator}**", some))
        strata = sorted({c["both"]["stratum"] for c in some})
        out += [share(f"{generator}, {s}", [c for c in some if c["both"]["stratum"] == s]) for s in strata]
    kinds = sorted({c["both"]["kinds"][0] for c in every if len(c["both"]["kinds"]) == 1})
    out += [share(f"`{k}`", [c for c in every if c["both"]["kinds"] == [k]]) for k in kinds]
    out.append("\n| processor time, without compilers | median | 90 % within | longest |\n|---|---|---|---|")
    for search in SEARCHES:
        times = sorted(c[search]["seconds"] for c in every)
        out.append(f"| {search} | {times[len(times) // 2]:.0f} s | {times[int(0.9 * (len(times) - 1))]:.0f} s | {times[-1]:.0f} s |")
    out.append("\n## Where not all three are right\n\n| case | hidden | sensor noise | innovations | both |\n|---|---|---|---|---|")
    for c in every:
        if not all(c[s]["right"] for s in SEARCHES):
            hidden = " + ".join(c["both"]["kinds"]) or "nothing"
            said = " | ".join(answered(c[s]) for s in SEARCHES)
            out.append(f"| {c['both']['generator']} {c['both']['case'].split(':')[1]} | {hidden} | {said} |")
    return "\n".join(out) + "\n"


def answered(row: Mapping) -> str:
    """An answer in words, a right one in bold."""
    text = " + ".join(row["answer"]) or row["verdict"] or row["why"]
    return f"**{text}**" if row["right"] else text


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, what in (
        ("cases", "own campaign"),
        ("worlds", "wrong worlds"),
        ("mechanisms", "half-cars and drives, each"),
        ("mujoco", "MuJoCo"),
    ):
        parser.add_argument(f"--{name}", type=int, default=0, help=f"cases of the {what}")
    parser.add_argument("--seed", type=int)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--timeout", type=float, default=300.0)
    parser.add_argument("--out", type=Path, default=Path("build/searches"))
    parser.add_argument("--page", type=Path, help="where the page goes (default: OUT/SEARCHES.md)")
    return parser.parse_args()


def main() -> int:
    args = arguments()
    args.out.mkdir(parents=True, exist_ok=True)
    file = args.out / "rows.jsonl"
    rows = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    seed = args.seed or (int(rows[0]["case"].split(":")[0]) if rows else secrets.randbelow(10**6))
    print(f"seed {seed}", flush=True)
    sizes = (args.cases, args.worlds, args.mechanisms, args.mechanisms, args.mujoco)
    draws = [[(g, i) for i in range(n)] for g, n in zip(GENERATORS, sizes, strict=True)]
    done = {(r["generator"], r["case"]) for r in rows}
    wanted = [a for some in zip_longest(*draws) for a in some if a and (a[0], f"{seed}:{a[1]}") not in done]
    with ProcessPoolExecutor(args.jobs) as pool, file.open("a") as kept:
        for job in [pool.submit(one, g, seed, i, args.timeout, args.out) for g, i in wanted]:
            for row in job.result():
                rows.append(row)
                kept.write(json.dumps(row) + "\n")
                kept.flush()
                hidden = "+".join(row["kinds"]) or "nothing"
                print(
                    f"{row['generator']} {row['case']} {hidden}: {row['search']} {row['outcome']} {row['answer']} {row['seconds']} s",
                    flush=True,
                )
    if rows:
        (args.page or args.out / "SEARCHES.md").write_text(page(rows, f"Seed {seed}, {', '.join(dict.fromkeys(r['code'] for r in rows))}."))
    return 0


if __name__ == "__main__":
    sys.exit(main())
