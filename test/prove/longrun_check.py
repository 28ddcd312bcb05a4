# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: hours of samples with a new set every second: no step off by more than rounding, no drift, counters right."""

from __future__ import annotations

import argparse
import re
import shutil
import sys
from pathlib import Path

import gate

import penode_gen
from penode_sil.building import FLAGS, generated

WORK = gate.BUILD / "longrun"
U = 2.0**-24  # what one float operation may be off, relative
H = 1e-3  # [s]

# What the drive must not exceed, so that the bound holds: m, m/s, N, m/s^2, N/m, N*s/m.
MOST = {
    "z": 0.05,
    "rate": 0.5,
    "s": 0.03,
    "v": 0.5,
    "tyre": 0.01,
    "a": 20.0,
    "net_s": 400.0,
    "net_v": 400.0,
    "anchor_s": 600.0,
    "anchor_v": 400.0,
    "slope_s": 30_000.0,
    "slope_v": 40_000.0,
}
FAULTS = {
    "a sixth is not a sixth": ("nqvm_folded.c", ("(NQVM_FOLDED_STEP / (pen_real_t)6.0)", 0, "(NQVM_FOLDED_STEP / (pen_real_t)6.01)")),
    "the input is held, not linear": (
        "nqvm_folded.c",
        ("nqvm_folded_drive(nqvm_folded_node[s], u0, u1, us);", 0, "nqvm_folded_drive((pen_real_t)1, u0, u1, us);"),
    ),
    "steps are not counted": ("pen_step.h", ("pen_status_note_step(&self->log, result);", 0, "")),
    "a withdrawn set comes into force": (
        "pen_set.c",
        (
            "            status |= PEN_WITHDRAWN;",
            0,
            "            status |= PEN_WITHDRAWN;\n            active = other;\n            pen_port_store(&tuning->active, active);",
        ),
    ),
}  # file, and fault: see gate.faulty


def rounding(constants: dict[str, float]) -> list[float]:
    """
    What rounding can do in one step, by state. The step is exact but for: each operation, off by U of its result (first
    order; 1.1 covers the rest), and states, which are stored in float.

    A stage starts at x + (h*node)*k: the sum, and three operations in what is added. Forces take the differences of such
    states and multiply; a network adds offset + slope*(x - centre). Four additions make the sum of the forces. What a stage
    is off also moves the next one, by h times the steepest change of a rate, the damper's on the wheel: 0.001 s * 40 800
    N*s/m / 90 kg = 0.454. So 1 / (1 - 0.454) < 1.85 times the error of one stage covers all four. The new state: six weighted rates, added
    with four roundings, times h/6, itself rounded twice, added to the old state.
    """
    m = MOST
    z, rate = U * (m["z"] + 3 * H * m["rate"]), U * (m["rate"] + 3 * H * m["a"])  # start of a stage
    s, v = 2 * z + U * m["s"], 2 * rate + U * m["v"]
    tyre = z + 3 * U * m["z"] + U * m["tyre"]
    c, d, c_t = constants["STIFFNESS"], constants["DAMPING"], constants["TYRE"]
    net_s = m["slope_s"] * s + U * (m["net_s"] + 3 * m["anchor_s"])
    net_v = m["slope_v"] * v + U * (m["net_v"] + 3 * m["anchor_v"])
    forces = c * m["s"] + d * m["v"] + m["net_s"] + m["net_v"] + c_t * m["tyre"]
    force = c * s + d * v + net_s + net_v + 4 * U * forces
    a_body = force / constants["BODY"] + 2 * U * m["a"]
    a_wheel = (force + c_t * tyre) / constants["WHEEL"] + 2 * U * m["a"]
    return [
        1.1 * (1.85 * H * error + 7 * U * H * size + U * kept)
        for error, size, kept in (
            (rate + H * a_body, m["rate"], m["z"]),
            (rate + H * a_wheel, m["rate"], m["z"]),
            (a_body, m["a"], m["rate"]),
            (a_wheel, m["a"], m["rate"]),
        )
    ]


def drive(seconds: int, name: str, source: Path, root: Path = gate.ROOT) -> tuple[int, dict[str, str], str]:
    """Exit code, figures and words of longrun.c with the model's C in `source`."""
    model = penode_gen.load(gate.ROOT / "gen" / "nqvm" / "nqvm_folded.toml")
    constants = {"BODY": "m_b", "WHEEL": "m_w", "STIFFNESS": "c", "DAMPING": "d", "TYRE": "c_t"}
    values = {key: float(model.parameters[parameter].value) for key, parameter in constants.items()}
    elf = WORK / name
    gate.make(
        [
            "gcc",
            *FLAGS,
            "-D_GNU_SOURCE",
            "-O2",
            "-Wall",
            "-Wextra",
            *(f"-D{key}={value!r}" for key, value in values.items()),
            f"-I{root}/inc",
            f"-I{gate.ROOT}/port/gnu",
            f"-I{source}",
            "-o",
            elf,
            gate.HERE / "longrun.c",
            source / "nqvm_folded.c",
            source / f"{model.owner}_params.c",
            *sorted((root / "src").glob("*.c")),
            "-lm",
        ]
    )
    done = gate.run([elf, seconds, *rounding(values)], limit=100_000)
    figures = dict(re.findall(r"^(\w+) (.*)$", done.stdout, re.M))
    return done.returncode, figures, done.stdout + done.stderr


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--hours", type=float, default=1 / 6)
    options.add_argument("--as", dest="key", default="longrun", help="key in figures.json")
    given = options.parse_args()
    WORK.mkdir(parents=True, exist_ok=True)
    source = generated(penode_gen.load(gate.ROOT / "gen" / "nqvm" / "nqvm_folded.toml"))
    seconds = round(3600 * given.hours)
    code, figures, said = drive(seconds, "right", source)
    beyond = [
        f"{key} {figures[key]} is more than the bound was derived for" for key in MOST if not float(figures.get(key, "inf")) <= MOST[key]
    ]
    good = gate.report(f"longrun: {1000 * seconds} steps, {seconds} sets: no drift, counters right", beyond + ([said] if code else []))
    missed = []
    for k, (what, (file, change)) in enumerate(FAULTS.items()):
        copy = WORK / f"fault{k}"
        shutil.rmtree(copy, ignore_errors=True)
        for part, place in (("inc", gate.ROOT / "inc"), ("src", gate.ROOT / "src"), ("model", source)):
            shutil.copytree(place, copy / part)
        text = next(copy.rglob(file))
        text.write_text(gate.faulty(text.read_text(), change))
        missed += [] if drive(70, f"program{k}", copy / "model", copy)[0] else [f"not found: {what}"]
    good &= gate.report(f"longrun: {len(FAULTS) - len(missed)} of {len(FAULTS)} faults found", missed)
    gate.keep(
        given.key,
        {
            "steps": 1000 * seconds,
            "sets": int(figures.get("adopted", 0)),
            "withdrawn": int(figures.get("withdrawn", 0)),
            "outside": int(figures.get("outside", 0)),
            "share of the bound of a step": float(figures.get("step", "nan")),
            "share of the bound of the drift": float(figures.get("drift", "nan")),
            "apart [m, m, m/s, m/s]": [float(value) for value in figures.get("apart", "").split()],
            "faults": list(FAULTS),
            "faults found": len(FAULTS) - len(missed),
        },
    )
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
