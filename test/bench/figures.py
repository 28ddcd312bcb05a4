# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What the step costs and how exact it is: measured, kept in figures.json, shown in README.md.

`figures.py` measures and rewrites both; `figures.py --check` measures and fails where a figure is more than 2 % worse
than the kept one, or where the table of README.md is not that of figures.json.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import penode_gen
from penode_sil import mil
from penode_sil.scenario import Instance
from penode_sil.schedule import Call
from penode_sil.signals import VelocityChirp
from penode_sil.targets import MACHINES, Pil, Sil

ROOT = Path(__file__).resolve().parents[2]
KEPT = Path(__file__).with_name("figures.json")
README = ROOT / "README.md"
PICTURE = ROOT / "sil" / "recalibration.png"  # in README.md
CORES = {"m3": "Cortex-M3 (no FPU)", "m4f": "Cortex-M4F", "m7": "Cortex-M7", "m33": "Cortex-M33", "m55": "Cortex-M55"}
MODELS = {"nqvm": "RK4", "nqvm_euler": "explicit Euler"}
LEVELS = ("-O2", "-Os")
# What the project promises of the RK4 step on the Cortex-M4F; a figure above fails, whatever was kept.
LIMITS = {"nqvm m4f -O2 instructions": 18_000, "nqvm m4f -Os text": 1536, "nqvm m4f -Os stack": 400, "nqvm m4f static RAM": 0}


def hostile_inputs() -> np.ndarray:
    """Road heights that a constant-time step must not notice: a chirp, noise of all sizes, subnormals, zeros, NaN, Inf."""
    draw = np.random.default_rng(1)
    chirp = 0.02 * np.sin(np.arange(300) ** 2 * 1e-3)
    noise = draw.standard_normal(600) * 10.0 ** draw.uniform(-45, 3, 600)
    special = draw.choice([0.0, -0.0, np.nan, -np.nan, np.inf, -np.inf, 1e-45, -1e-39, 3e38, -3e38], 300)
    mixed = np.concatenate([chirp, noise, special])
    return np.concatenate([chirp, draw.permutation(mixed)]).astype(np.float32)[:, None]


def exchange(model: penode_gen.Model, at: int) -> list[Call]:
    """Select another set for sample `at`, hold a few samples, go on."""
    other = [name for name in model.sets if name != "default"][0]
    return [Call(at, "select", set=other), Call(at + 20, "hold", on=True), Call(at + 30, "hold", on=False)]


def step_size(model: penode_gen.Model, level: str, folder: Path) -> dict[str, int]:
    """Bytes of the step alone, with all it calls and without weights: linked from NAME_step with unused parts dropped."""
    cc = [str(ROOT / "port" / "cortex-m" / "cc"), MACHINES["m4f"]]
    source = ROOT / "gen" / "nqvm" / "c"
    objects = []
    for path in [*(ROOT / "src").glob("*.c"), source / f"{model.name}.c"]:
        objects.append(str(folder / f"{path.stem}.o"))
        subprocess.run([*cc, "-std=c99", level, f"-I{source}", "-c", str(path), "-o", objects[-1]], check=True)
    elf = str(folder / "step.elf")
    core = ["-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard"]
    subprocess.run(
        ["arm-none-eabi-gcc", *core, "-nostdlib", "-Wl,--gc-sections", f"-Wl,-e,{model.name}_step", "-o", elf, *objects, "-lgcc"], check=True
    )
    sections = subprocess.run(["arm-none-eabi-size", "-A", elf], check=True, capture_output=True, text=True).stdout
    sizes = {m[1]: int(m[2]) for m in re.finditer(r"^\.(\w+)\S*\s+(\d+)", sections, re.M)}
    return {"text": sizes.get("text", 0), "rodata": sizes.get("rodata", 0), "static RAM": sizes.get("data", 0) + sizes.get("bss", 0)}


def sizes_of(model: penode_gen.Model, folder: Path) -> dict[str, int]:
    """Bytes of RAM that an application gives: the instance and, for staging, the banks."""
    probe = folder / "probe.c"
    probe.write_text(f'#include "{model.name}.h"\nchar instance[sizeof({model.name}_t)];\nchar banks[sizeof({model.name}_banks_t)];\n')
    cc = [str(ROOT / "port" / "cortex-m" / "cc"), MACHINES["m4f"]]
    subprocess.run([*cc, f"-I{ROOT}/gen/nqvm/c", "-c", str(probe), "-o", str(folder / "probe.o")], check=True)
    lines = subprocess.run(["arm-none-eabi-nm", "-S", str(folder / "probe.o")], check=True, capture_output=True, text=True).stdout
    return {line.split()[3]: int(line.split()[1], 16) for line in lines.splitlines()}


def accuracy(models: dict[str, penode_gen.Model]) -> dict[str, int]:
    """Distance of the float C from the exact solution [nm] over 10 s of the published chirp: largest and RMS of z_b, z_w."""
    chirp, times = VelocityChirp(0.15, 1.0, 0.25, np.pi / 2), np.arange(10_001) * 1e-3
    first = models["nqvm"]
    exact = mil.solve(first, Instance("", "default"), {"z_road": chirp}, times[-1], times, len(penode_gen.set_values(first, "default"))).y
    found = {}
    for name, model in models.items():
        error = Sil(model, source=ROOT / "gen" / "nqvm" / "c").run(chirp.value(times)[:, None]).y - exact
        found[f"{name} error nm, largest"] = round(1e9 * float(np.abs(error).max()))
        found[f"{name} error nm, RMS"] = round(1e9 * float(np.sqrt((error**2).mean(axis=0)).max()))
    return found


def measure() -> dict[str, int]:
    """All figures by name."""
    figures: dict[str, int] = {}
    u = hostile_inputs()
    models = {name: penode_gen.load(ROOT / "gen" / "nqvm" / f"{name}.toml") for name in MODELS}
    for name, model in models.items():
        for core in CORES:
            for level in LEVELS:
                run = Pil(model, core, ROOT / "gen" / "nqvm" / "c", level).run(u, exchange(model, 400))
                at = f"{name} {core} {level}"
                figures[f"{at} instructions"] = run.cost["normal"].most
                figures[f"{at} instructions, least"] = run.cost["normal"].least
                figures[f"{at} instructions, adopting a set"] = max(run.cost[k].most for k in run.cost)
                figures[f"{at} stack"] = run.stack
        with tempfile.TemporaryDirectory() as folder:
            for level in LEVELS:
                for kind, size in step_size(model, level, Path(folder)).items():
                    figures[f"{name} m4f {kind}" if kind == "static RAM" else f"{name} m4f {level} {kind}"] = size
            for kind, size in sizes_of(model, Path(folder)).items():
                figures[f"{name} {kind} bytes"] = size
        figures[f"{name} set bytes"] = 4 * len(penode_gen.set_values(model, "default"))
    return figures | accuracy(models)


def table(figures: dict[str, int]) -> str:
    """The figures as the tables of README.md."""
    columns = [(name, level) for name in MODELS for level in LEVELS]
    rows = ["| instructions a step | " + " | ".join(f"{MODELS[name]} {level}" for name, level in columns) + " |", "|---" * 5 + "|"]
    for core, title in CORES.items():
        cells = []
        for name, level in columns:
            most, least = (f"{figures[f'{name} {core} {level} instructions{k}']:,}".replace(",", " ") for k in ("", ", least"))
            cells.append(most if most == least else f"{least} .. {most}")
        rows.append(f"| {title} | " + " | ".join(cells) + " |")
    rows += ["", "| bytes on a Cortex-M4F, RK4 | -O2 | -Os |", "|---|---|---|"]
    for kind, title in (("text", "code of the whole step"), ("rodata", "its constants, without weights"), ("stack", "its stack")):
        rows.append(f"| {title} | " + " | ".join(str(figures[f"nqvm m4f {level} {kind}"]) for level in LEVELS) + " |")
    rows += [
        f"| an instance | {figures['nqvm instance bytes']} | {figures['nqvm instance bytes']} |",
        f"| a parameter set, in flash or in RAM of the caller | {figures['nqvm set bytes']} | {figures['nqvm set bytes']} |",
        f"| other RAM | {figures['nqvm m4f static RAM']} | {figures['nqvm m4f static RAM']} |",
    ]
    rows += ["", "| float C at 1 ms against the exact solution, 10 s of a chirp | " + " | ".join(MODELS.values()) + " |", "|---|---|---|"]
    for kind, title in (("largest", "largest error of z_b, z_w"), ("RMS", "RMS error")):
        rows.append(f"| {title} | " + " | ".join(_micrometres(figures[f"{name} error nm, {kind}"]) for name in MODELS) + " |")
    return "\n".join(rows)


def _micrometres(nanometres: int) -> str:
    return f"{nanometres / 1000:.3g} µm" if nanometres < 1e6 else f"{nanometres / 1e6:.3g} mm"


def run_text() -> str:
    """What `make run` prints."""
    done = subprocess.run(["make", "run"], cwd=ROOT, check=True, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    return f"```\n{done.stdout.strip()}\n```"


def with_block(text: str, name: str, content: str) -> str:
    """README with the text between <!-- name --> and <!-- end of name --> replaced."""
    block = re.compile(rf"(<!-- {name} -->\n).*?(<!-- end of {name} -->)", re.S)
    return block.sub(lambda m: f"{m[1]}{content}\n{m[2]}", text)


def problems(new: dict[str, int], kept: dict[str, int]) -> list[str]:
    """What is worse than it was, or than it may be."""
    found = [f"{k}: {new[k]} is above the promised {limit}" for k, limit in LIMITS.items() if new[k] > limit]
    found += [f"{k}: {new.get(k)} instead of {v}, more than 2 % worse" for k, v in kept.items() if k not in new or new[k] > 1.02 * v]
    found += [
        f"{k}: {v} to {new[k]} instructions: the step's cost depends on its input"
        for k, v in ((k.removesuffix(", least"), v) for k, v in new.items() if k.endswith(", least") and " m3 " not in k)
        if new[k] != v
    ]
    return found


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--check", action="store_true", help="compare with what is kept, write nothing")
    check = arguments.parse_args().check
    new = measure()
    kept = json.loads(KEPT.read_text()) if check else new
    found = problems(new, kept)
    text = README.read_text()
    shown = with_block(with_block(text, "figures", table(kept)), "run", run_text())
    if check and shown != text:
        found.append("README.md: what it shows is not what make run and make figures give; run make figures")
    elif not check:
        KEPT.write_text(json.dumps(new, indent=1) + "\n")
        README.write_text(shown)
        shutil.copy(ROOT / "build" / "run" / "recalibration.png", PICTURE)
        print(table(new))
    for line in found:
        print(line, file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
