# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
Real rigs: what the diagnosis names, hold-out before and after (predicted from its first 50 samples), what a plain expert fit reaches, time.

    build/venv/bin/python test/diagnosis/rigs_table.py --rigs ../shared/measured [--only pendulum] [--page build/rigs/RIGS.md]

A rig is a folder of recordings with a README; rig.toml and the model files stand in it, or in test/diagnosis/rigs/ under its name.
Exit code 0 also if names are not among the accepted: the table is a figure, not a gate.
"""

from __future__ import annotations

import argparse
import json
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import rigs_expert
from campaign import diagnose

HERE = Path(__file__).resolve().parent / "rigs"


def described(folder: Path) -> Path | None:
    """Where the description of a rig is: in its folder, or here under its name."""
    return next((p for p in (folder, HERE / folder.name) if (p / "rig.toml").exists()), None)


def parts(folder: Path, names: list[str], out: Path, half: int, halves: bool) -> list[Path]:
    """The recordings; with `halves` the first or the second half of each, as a file of its own."""
    if not halves:
        return [folder / n for n in names]
    made = []
    for name in names:
        head, *rows = (folder / name).read_text().splitlines()
        middle = len(rows) // 2
        made.append(out / f"{('first', 'second')[half]}_{name}")
        made[-1].write_text("\n".join([head, *(rows[:middle], rows[middle:])[half]]) + "\n")
    return made


def moves(model: Path) -> bool:
    """Whether a model file, or one that it extends, has bodies."""
    text = tomllib.loads(model.read_text())
    base = text.get("model", {}).get("extends")
    return "bodies" in text or (base is not None and moves(model.parent / base))


def predicted(command: str, model: Path, recording: Path, rig: dict) -> float | None:
    """RMSE of a model file on a recording, started from its first 50 samples where it has states; None if it cannot be simulated."""
    call = [
        *shlex.split(command),
        "simulate",
        str(model),
        "--input",
        str(recording),
        "-o",
        str(model.with_name("prediction.csv")),
        "--json",
    ]
    call += ["--start", f"measured:{rigs_expert.FIRST}"] if moves(model) else []
    call += [x for c in rig.get("channels", []) for x in ("--channel", c)]
    done = subprocess.run(call, capture_output=True, text=True, timeout=600)
    if done.returncode:
        print(done.stderr.strip()[-300:], file=sys.stderr)
        return None
    return find(json.loads(done.stdout), rig["sensor"])


def find(tree: object, sensor: str) -> float | None:
    """The RMSE of a sensor somewhere in the answer of `simulate --json`."""
    if isinstance(tree, dict):
        inner = tree.get("rmse", {})
        if isinstance(inner, dict) and sensor in inner:
            value = inner[sensor]
            return float(value["value"] if isinstance(value, dict) else value)
        tree = list(tree.values())
    return next((x for part in tree if (x := find(part, sensor)) is not None), None) if isinstance(tree, list) else None


def case(command: str, folder: Path, place: Path, rig: dict, one: dict, out: Path, timeout: float) -> dict:
    """One row of the table."""
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    model = out / "model.toml"
    model.write_bytes((place / one["model"]).read_bytes())
    halves = bool(rig.get("halves"))
    train, held = (parts(folder, one[k], out, i, halves) for i, k in enumerate(("train", "holdout")))
    # --json ends the list of channels, which would take the model for one more
    asked = f"{command} diagnose" + "".join(f" --channel {shlex.quote(c)}" for c in rig.get("channels", [])) + " --json"
    found, seconds, why = diagnose(asked, out, [*train, held[0]], timeout)
    fitted, expert = None, None
    if "expert" in one:
        fitted, expert = by_expert(one["expert"], [rigs_expert.table(p, rig["columns"]) for p in (*train, held[0])], model)
    extended = out / "diagnosis" / "model_extended.toml"
    names = [c["kind"] for c in (found or {}).get("causes") or []]
    accepted = [sorted(a) for a in one.get("accept", rig.get("accept_all", []))]
    return {
        "rig": folder.name,
        "case": one["name"],
        "names": names,
        "verdict": (found or {}).get("verdict") or why,
        "right": sorted(names) in accepted,
        "before": predicted(command, model, held[0], rig),
        "after": predicted(command, extended, held[0], rig) if extended.exists() else None,
        "fitted": fitted,
        "expert": expert,
        "unit": rig["unit"],
        "seconds": round(seconds, 1),
    }


def by_expert(asked: dict, tables: list, model: Path) -> tuple[float, float]:
    """Hold-out RMSE, of the last of the tables, by the law of a model file refitted, and by the law that is known to be in the rig."""
    nominal = ["viscous", *["sine"] * ("sin(" in model.read_text())]
    fitted, known = (rigs_expert.FORMS[asked["form"]](tables[:-1], tables[-1], t) for t in (nominal, asked["terms"]))
    return fitted, known


def shown(value: float | None, unit: str) -> str:
    """A size in words; angles in mrad."""
    if value is None:
        return "-"
    return f"{value * 1e3:.4g} mrad" if unit == "rad" else f"{value:.4g} {unit}"


def row(r: dict) -> str:
    """A line of the table."""
    sizes = " | ".join(shown(r[k], r["unit"]) for k in ("before", "fitted", "after", "expert"))
    return (
        f"| {r['rig']}: {r['case']} | {' + '.join(r['names']) or r['verdict']} "
        f"| {'yes' if r['right'] else 'no'} | {sizes} | {r['seconds']:.0f} s |"
    )


HEAD = """# Real rigs

Hold-out RMSE, predicted from its first 50 samples. Refitted, expert: least squares, without the diagnosis, of the law of the
file and of the law that is known to be in the rig; "file as it is" has guessed parameters where it says that they are unknown.

| rig | named | accepted | file as it is | its law, refitted | extended | expert | time |
|---|---|---|---|---|---|---|---|"""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rigs", type=Path, default=Path("../shared/measured"))
    parser.add_argument("--only", action="append", help="name of a rig")
    parser.add_argument("--command", default="build/venv/bin/penode")
    parser.add_argument("--page", type=Path, default=Path("build/rigs/RIGS.md"))
    parser.add_argument("--timeout", type=float, default=1200.0)
    args = parser.parse_args()
    if not args.rigs.is_dir():
        print(f"rigs: SKIPPED, {args.rigs} does not exist; set RIGS_DIR to a folder of measured rigs")
        return 0
    args.page.parent.mkdir(parents=True, exist_ok=True)
    lines = [HEAD]
    print(HEAD, flush=True)
    for folder in sorted(p for p in args.rigs.iterdir() if p.is_dir() and (not args.only or p.name in args.only)):
        if (place := described(folder)) is None:
            print(f"| {folder.name} | SKIPPED: no rig.toml in it or in {HERE} | | | | | |", flush=True)
            continue
        rig = tomllib.loads((place / "rig.toml").read_text())
        for i, one in enumerate(rig["case"]):
            lines.append(row(case(args.command, folder, place, rig, one, args.page.parent / f"{folder.name}-{i}", args.timeout)))
            print(lines[-1], flush=True)
    args.page.write_text("\n".join(lines) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
