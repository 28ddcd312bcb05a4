# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The page of `make campaign-train`: what its parts measured, beside what is asked; a part that has not run is named.

Parts write what they find into a folder: `rows.jsonl` (a training a line), and `damping.json`, `promises.json`, `rigs.json` and `adam.json`
(rows of text, and whether each is as it must be).
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import campaign

Row = dict[str, Any]
FOLDER = Path("build/campaign-train")
OPEN = "not measured"
STOPS = (
    "A stop of `x1, stops and degressive damper` turns within a cell of the spring's knots. "
    "Moved along its input until the turns meet knots, by half a cell to some millimetres, "
    "the curve leaves less than in its place, where straight pieces miss the turn; "
    "only samples at which the damper's rate passes 0 speak against it (1 N there is 0.1 mm). The first curves are "
    "straight at 0, which helps the worst of five (9.2 to 5.9 %), and a turn that is seen is reported. "
    "Knots that follow the turn by Gauss-Newton come nearer, by a tenth of what is left in each "
    "step of half a second, and end a third of the way short: tried, not kept."
)


def of(rows: list[Row], *words: str) -> list[Row]:
    """Trainings of the cases whose names hold a word."""
    return [r for r in rows if any(w in r["case"] for w in words)]


def most(rows: list[Row], value: Callable[[Row], float]) -> float:
    """The largest value of those that did not fail."""
    return max((value(r) for r in rows if "failed" not in r), default=float("nan"))


def error(r: Row) -> float:
    """The larger force error [%] of a training."""
    return max(r["forces"].values())


def covered(rows: list[Row]) -> float:
    """Mean share [%] of all curves that the band covers."""
    shares = [c for r in rows for c in r["covered"]]
    return sum(shares) / max(len(shares), 1)


Asked = tuple[str, str, str, bool | None]  # what, the bar, what was found, whether that is enough (None: not measured)


def judged(what: str, bar: str, some: list[Row], text: Callable[[], str], good: Callable[[], bool]) -> Asked:
    """A line of the requirements; `text` and `good` look at trainings that did not fail, and are called if there are any."""
    sound = [r for r in some if "failed" not in r]
    seeds = f"{len(some)} trainings: " if some else ""
    return what, bar, seeds + text() if sound else OPEN, bool(good()) and len(sound) == len(some) if sound else None


def seconds(rows: list[Row]) -> float:
    """The longest time [s] of those that did not fail."""
    return most(rows, lambda r: r["seconds"])


def plain(rows: list[Row], case: str) -> Asked:
    """Curves alone."""
    own = [r for r in rows if r["case"] == case]
    return judged(
        case,
        "5 s of processor time, force error 1 % of span",
        own,
        lambda: f"{seconds(own):.1f} s, {most(own, error):.2f} %",
        lambda: seconds(own) <= 5.0 and most(own, error) <= 1.0,
    )


def parameters_off(rows: list[Row], case: str, bar: str, key: str) -> Asked:
    """Curves and wrong parameters; `key`: which of a row's errors counts."""
    own = of(rows, case)
    return judged(
        f"x5, parameters off 10 %, {case}",
        f"10 s, 2.5 %, {bar}",
        own,
        lambda: f"{seconds(own):.1f} s, {most(own, error):.2f} %, {most(own, lambda r: r[key]):.2f} %",
        lambda: (
            seconds(own) <= 10.0
            and most(own, error) <= 2.5
            and most(own, lambda r: r[key]) <= 1.0
            and (key == "absolute" or all(r["scale"] for r in own if "failed" not in r))
        ),
    )


def end_to_end(rows: list[Row], noise: str, bar: float) -> Asked:
    """Networks that are trained as a whole."""
    own = of(rows, f"{noise}, tanh")
    good = [r for r in own if r.get("converged")]
    return judged(
        f"{noise}, tanh 2-16-16-1",
        f"60 s, {bar:g} %; 9 of 10 seeds converge, others say so",
        own,
        lambda: f"{len(good)} converged, these {seconds(good):.1f} s, {most(good, error):.2f} %; the others report that they did not",
        lambda: seconds(good) <= 60.0 and most(good, error) <= bar and len(good) >= 0.9 * len(own),
    )


def held_out(what: str, some: list[Row], bar: float) -> Asked:
    """Recordings that training did not see."""
    return judged(
        f"hold-out inside the trained range, {what}",
        f"within {bar:g} % of the noise; at most 10 % masked",
        some,
        lambda: f"{most(some, lambda r: r['holdout']):.2f} %, {most(some, lambda r: r['masked']):.1f} % masked",
        lambda: most(some, lambda r: r["holdout"]) <= bar and most(some, lambda r: r["masked"]) <= 10.0,
    )


def bands(what: str, some: list[Row]) -> Asked:
    """Bands of trained curves against the curves that are true."""
    return judged(
        what,
        "2 sigma cover 90 to 98 %",
        some,
        lambda: f"{2 * len(some)} curves, {covered(some):.1f} %",
        lambda: 90.0 <= covered(some) <= 98.0,
    )


def asked(rows: list[Row]) -> list[Asked]:
    """All that is asked of trainings."""
    turns = [r for r in rows if r.get("covered") and r.get("turns")]
    return [
        *(plain(rows, case) for case in ("x1, 1-16-16-1", "x1, 1-16-16-16-1")),
        parameters_off(rows, "m_b weighed", "parameters within 1 %", "absolute"),
        parameters_off(rows, "nothing weighed", "ratios within 1 %, scale reported", "ratios"),
        *(end_to_end(rows, noise, bar) for noise, bar in (("x1", 2.0), ("x5", 4.0))),
        held_out("curves", [r for r in rows if "tanh" not in r["case"]], 2.0),
        held_out("end to end", of(rows, "tanh"), 5.0),
        bands("bands of trained curves", [r for r in rows if r.get("covered") and not r.get("turns")]),
        *([bands("the same, beside a turn between two knots, which is reported", turns)] if turns else []),
    ]


def table(folder: Path, name: str) -> list[tuple[str, str, bool]]:
    """Rows of another part; none where it has not run."""
    path = folder / f"{name}.json"
    return [tuple(r) for r in json.loads(path.read_text(encoding="utf-8"))] if path.exists() else []


def page(folder: Path) -> str:
    """The whole page."""
    rows = campaign.read(folder / "rows.jsonl")
    marks = {True: "yes", False: "no", None: "open"}
    lines = [
        "# Trained networks against plants that are known",
        "",
        " ".join((campaign.__doc__ or "").split()).replace("`make campaign-train`: ", "Written by `make campaign-train`: ", 1),
        "",
    ]
    lines += ["## What is asked", "", "| what | asked | found | met |", "|---|---|---|---|"]
    lines += [f"| {what} | {bar} | {text} | {marks[good]} |" for what, bar, text, good in asked(rows)]
    parts = (
        ("rigs", "networks beside the laws of the diagnosis, measured dampers"),
        ("promises", "promises by exact arithmetic"),
        ("damping", "damping beside a network"),
        ("adam", "plain Adam on whole trajectories"),
    )
    for name, title in parts:
        found = table(folder, name)
        lines += [f"| {title}: {label} | | {figure} | {marks[bool(good)]} |" for label, figure, good in found] or [
            f"| {title} | | {OPEN} | open |"
        ]
    lines += [
        (
            "| trained set in the controller | hash of states of SiL and PiL equal; "
            "onnxruntime equal within rounding | not of this campaign: `test/training/test_deployed.py`, in `make test` | by test |"
        )
    ]
    lines += ["", STOPS] if of(rows, "stops") else []
    lines += ["", "## By case", "", campaign.HEAD]
    lines += [campaign.line(own) for case in campaign.CASES if (own := [r for r in rows if r["case"] == case.name])]
    versions = {c: sum(r.get("code") == c for r in rows) for c in dict.fromkeys(r.get("code") for r in rows)}
    lines += [
        "",
        "Trainings by digest of the trainer's sources: "
        + ", ".join(f"{n} by {c}" for c, n in versions.items())
        + f"; it is {campaign.code()} now.",
    ]
    earlier = [c.name for c in campaign.CASES if any(r["case"] == c.name and r.get("code") != campaign.code() for r in rows)]
    lines += [f"With trainings by an earlier one: {'; '.join(earlier)}."] if earlier else []
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=FOLDER)
    parser.add_argument("--page", type=Path, default=Path(__file__).with_name("CAMPAIGN.md"))
    given = parser.parse_args()
    given.page.write_text(page(given.folder), encoding="utf-8")
    print(given.page)


if __name__ == "__main__":
    main()
