# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
Is every answer checked? Over campaign cases and wrong worlds: is each figure that is reported what `penode simulate` gives for the written
file, is a written model that predicts the hold-out worse than the nominal one rejected, and how many with a right name are?

    build/venv/bin/python test/diagnosis/checked_campaign.py --cases 200 --worlds 100 --out DIR
"""

from __future__ import annotations

import argparse
import json
import shlex
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from campaign import diagnose
from claims import nominals
from hidden import cases
from score import score
from worlds import equivalents, world
from worlds_score import score as score_world

PENODE = str(Path(sys.executable).with_name("penode"))


def errors(model: Path, recording: Path, options: str, set_name: str = "default") -> dict[str, float]:
    """By sensor, in the unit of the model file, as the command gives them with a parameter set."""
    options += f" --set {set_name}" * (set_name != "default")
    call = [PENODE, "simulate", str(model), "--input", str(recording), "-o", str(recording.with_suffix(".predicted.csv")), "--json"]
    run = subprocess.run([*call, *shlex.split(options)], capture_output=True, text=True, timeout=300, check=True)
    return {k: e["value"] for k, e in json.loads(run.stdout)["instances"][0]["rmse"].items()}


def one(name: str, case: object, out: Path, timeout: float) -> dict:
    """One case: how many figures differ from those of the command, whether the written model is worse, and whether it is rejected."""
    folder = out / name
    recordings = case.write(folder)
    found, seconds, why = diagnose(f"{PENODE} diagnose", folder, recordings, timeout)
    if not found:
        return {"case": name, "why": why}
    if isinstance(case, world.World):
        right = score_world(equivalents.truth(case), found, nominals(folder / "model.toml"))["outcome"] == "right"
    else:
        right = score(case.truth(), found, seconds, why, {}, nominals(folder / "model.toml")).get("right", False)
    other = {"nominal": folder / "model.toml", "extended": folder / "diagnosis" / found["model_file"]}
    differing, worse = 0, []
    for recording in recordings:
        own = [f for f in found["figures"] if f["recording"] == recording.name]
        sets = {"extended": own[0]["set"] if own else "default"}
        given = {what: errors(model, recording, found["simulated"], sets.get(what, "default")) for what, model in other.items()}
        differing += sum(f[what] != given[what][f["signal"]] for f in own for what in given)
        worse += [f["signal"] for f in own if f["role"] == "hold-out" and not f["extended"] <= 1.05 * f["nominal"]]
    rejected = found["model_file"] == "model_rejected.toml"
    kinds = [f"{c['kind']} at {c['where']}" for c in found["causes"]]
    row = {"case": name, "verdict": found["verdict"], "answer": kinds, "right": bool(right), "rejected": rejected, "worse": worse}
    return row | {"figures": len(found["figures"]), "differing": differing, "seconds": round(seconds, 1)}


def main() -> None:
    parse = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parse.add_argument("--cases", type=int, default=200)
    parse.add_argument("--worlds", type=int, default=100)
    parse.add_argument("--seed", type=int, default=20261128)
    parse.add_argument("--timeout", type=float, default=600.0)
    parse.add_argument("--out", type=Path, required=True)
    asked = parse.parse_args()
    made = [(f"case-{k}", lambda k=k: cases.make(asked.seed, k)) for k in range(asked.cases)]
    made += [(f"world-{k}", lambda k=k: world.make(asked.seed, k, "main", True)) for k in range(asked.worlds)]
    rows = []
    for name, make in made:
        rows.append(one(name, make(), asked.out, asked.timeout))
        print(json.dumps(rows[-1]), flush=True)
    done = [r for r in rows if "verdict" in r]
    right = [r for r in done if r["right"]]
    differing = sum(r["differing"] for r in done)
    print(
        f"{len(done)} of {len(rows)}: {sum(r['figures'] for r in done)} figures, {differing} differ from the command's; "
        f"{sum(bool(r['worse']) and not r['rejected'] for r in done)} written models worse than nominal without the line; "
        f"{sum(r['rejected'] for r in done)} rejected, {sum(r['rejected'] for r in right)} of {len(right)} beside a right name"
    )


if __name__ == "__main__":
    main()
