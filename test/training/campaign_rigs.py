# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""More of `make campaign-train`: networks beside the laws that the diagnosis finds in measured dampers.

The first half of a recording is diagnosed; beside the laws of the extended model, as they are, stand a network of place and one of rate
that are trained on the same half. RMS errors of the measured force are those of the second half, and of another recording where there is
one, in the generated C: of the laws alone, and with the networks. Skipped where there are no recordings (RIGS_DIR).
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

from penode_sil.errors import NotConverged

HERE = Path(__file__).resolve().parent
RIGS = HERE.parent / "diagnosis" / "rigs"
PENODE = Path(sys.executable).with_name("penode")
CASES = (
    ("friction_damper_backlash", "0.5Hz80lbtension.csv", ("1Hz80lbtension.csv",), "x"),
    ("friction_damper_backlash", "1Hz80lbtension.csv", ("0.5Hz80lbtension.csv",), "x"),
    ("labcontrol_mr", "data_simulation_4.1_MRdamper.csv", (), "pos"),
    ("labcontrol_mr", "data_simulation_4.2_MRdamper.csv", (), "pos"),
)
NETWORKS = """{at}_nn = {{ between = ["{place}", "ground"], law = "network", network = "{at}_net" }}
"""


def halves(path: Path, folder: Path) -> list[Path]:
    """Both halves of a table, as files of their own."""
    head, *rows = path.read_text().splitlines()
    made = []
    for name, part in (("first", rows[: len(rows) // 2]), ("second", rows[len(rows) // 2 :])):
        made.append(folder / f"{name}_{path.name}")
        made[-1].write_text("\n".join([head, *part]) + "\n")
    return made


def beside(extended: Path, place: str, out: Path) -> Path:
    """The extended model with networks beside its laws, which stay as they are."""
    text = extended.read_text()
    base = (extended.parent / re.search(r'extends = "([^"]*)"', text)[1]).resolve()
    text = re.sub(r'extends = "[^"]*"', f'extends = "{base}"\noutside = "clamp"', text)
    text = re.sub(r', tolerance = ("unknown"|[0-9.e+-]+)', ", exact = true", text)
    value = re.search(r'\[sensors\]\nforce = \{ value = "([^"]*)"', text)[1]
    text = text.replace(f'"{value}"', f'"({value}) + F_place_nn + F_rate_nn"')
    elements = "".join(NETWORKS.format(at=at, place=place) for at in ("place", "rate"))
    networks = '[networks]\nplace_net = { inputs = ["m"], output = "N" }\nrate_net = { inputs = ["m/s"], output = "N" }\n\n'
    text = text.replace("[outputs]", elements + "\n" + networks + "[outputs]", 1)
    out.write_text(text + "\n[sets.default]\nplace_net = { layers = [8, 8] }\nrate_net = { layers = [8, 8] }\n")
    return out


def called(*words: object) -> str:
    """What a command of penode prints, of a training that did not come down to the noise too; its message where it fails."""
    done = subprocess.run([str(PENODE), *map(str, words)], capture_output=True, text=True)
    if done.returncode not in (0, NotConverged.exit):
        raise SystemExit(done.stderr.strip())
    return done.stdout


def errors(rig: Path, name: str, others: tuple[str, ...], place: str, folder: Path) -> tuple[list[str], list[tuple[str, float, float]]]:
    """Causes that the diagnosis names; of each held-out part its name and the errors [N] of the laws, and with networks."""
    folder.mkdir(parents=True, exist_ok=True)
    described = tomllib.loads((RIGS / rig.name / "rig.toml").read_text())
    channels = [word for c in described["channels"] for word in ("--channel", c)]
    model = folder / "model.toml"
    model.write_bytes((RIGS / rig.name / "damper.toml").read_bytes())
    first, second = halves(rig / name, folder)
    if not (folder / "diagnosis" / "diagnosis.json").exists():
        called("diagnose", model, "--data", first, *channels, "-o", folder / "diagnosis", "--json")
    causes = [c["kind"] for c in json.loads((folder / "diagnosis" / "diagnosis.json").read_text())["causes"]]
    trained = beside(folder / "diagnosis" / "model_extended.toml", place, folder / "beside.toml")
    found = []
    for held in (second, *(rig / o for o in others)):
        answer = json.loads(called("train", trained, "--data", first, "--holdout", held, *channels, "-o", folder / "trained", "--json"))
        (error,) = [e for e in answer["holdout"] if e["signal"] == "force"]
        found.append(("second half" if held == second else held.name, error["before"], error["deployed"]))
    return causes, found


def main() -> None:
    """Rows for the page; exit code 1 where networks are worse than the laws alone on the other half."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rigs", type=Path, default=Path("../shared/measured"))
    parser.add_argument("--only", default="")
    parser.add_argument(
        "--work", type=Path, default=Path("build/campaign-train/rigs"), help="where diagnoses are kept; one that is there is not made again"
    )
    given = parser.parse_args()
    if not given.rigs.is_dir():
        print(f"SKIPPED: {given.rigs} does not exist; name a folder of measured rigs with --rigs")
        return
    rows = []
    for rig, name, others, place in CASES:
        if given.only not in f"{rig}/{name}" or not (given.rigs / rig / name).exists():
            continue
        causes, found = errors(given.rigs / rig, name, others, place, given.work.resolve() / Path(name).stem)
        for part, laws, networks in found:
            worse = networks > laws * 1.001  # a network at 0 may differ by the rounding of float, far below
            rows.append(
                (
                    f"{rig}, first half of {name} ({', '.join(causes)}), held out {part}",
                    f"laws {laws:.1f} N, with networks {networks:.1f} N",
                    not worse,
                )
            )
            print(*rows[-1], flush=True)
        given.work.with_suffix(".json").write_text(json.dumps(rows), encoding="utf-8")
    sys.exit(not all(good for *_, good in rows))


if __name__ == "__main__":
    main()
