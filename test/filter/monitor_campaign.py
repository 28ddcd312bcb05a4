# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
How soon a monitor finds a friction of 30 N, and how often it is wrong, beside chi-square tests of the same false-alarm rate:

    monitor_campaign.py --runs 200 --hours 200    writes MONITOR.md; exit code 1 if what is asked is not met

Plant, noise and chi-square tests are those of monitor_campaign.c; filter and monitor are the generated C of monitored.toml.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from scipy.stats import chi2

import penode_gen
from penode_gen.emission import model_c
from penode_gen.model import Model

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
TESTS = ("monitor: the cause", "monitor: anything else", "chi-square, 1 sample", "chi-square, 1 s")
FORCE, WITHIN = 30.0, 10.0  # N, s
LEAST, MOST = 0.95, 16.0 / 200.0  # share of the runs; false alarms an hour
BLOCK = 1000  # samples
STRETCH = 900.0  # s of one run without a fault


def _numbers(values: Iterable[float]) -> str:
    return ", ".join(f"{float(v)!r}" for v in values)


def constants(model: Model) -> str:
    """The header of the plant: networks, noises and limits of the chi-square tests."""
    lines = ["struct dense { size_t rows; int relu; const double *weights, *bias; };"]
    lines += ["struct net { double shift_in, factor_in, factor_out, shift_out; size_t n_dense; const struct dense *dense; };"]
    for name in ("spring", "damper"):
        first, *dense, last = model.sets["default"].networks[f"{name}_net"].layers
        for k, layer in enumerate(dense):
            lines.append(f"static const double {name}_w{k}[] = {{ {_numbers(np.asarray(layer.weights).ravel())} }};")
            lines.append(f"static const double {name}_b{k}[] = {{ {_numbers(layer.bias)} }};")
        rows = (f"{{ {len(d.bias)}, {int(d.activation == 'relu')}, {name}_w{k}, {name}_b{k} }}" for k, d in enumerate(dense))
        lines.append(f"static const struct dense {name}_dense[] = {{ {', '.join(rows)} }};")
        ends = _numbers((first.shift[0], first.factor[0], last.factor[0], last.shift[0]))
        lines.append(f"static const struct net {name} = {{ {ends}, {len(dense)}, {name}_dense }};")
    given, monitor = model.filter, model.monitor
    assert given is not None and monitor is not None
    road, rate = given.inputs[0], model.sample_time / monitor.mean_time
    for name, values in (("START", (s.start for s in given.states)), ("NOISE", (s.noise for s in given.states))):
        lines.append(f"static const double {name}[] = {{ {_numbers(values)} }};")
    lines.append(f"static const double SENSORS[] = {{ {_numbers(s.noise for s in given.sensors)} }};")
    lines += [f"#define ROAD_NOISE {road.noise!r}", f"#define ROAD_STEP {road.step!r}", f"#define ROAD_DECAY {road.decay!r}"]
    n_z = len(given.sensors)
    limits = chi2.isf(rate, n_z), chi2.isf(rate * BLOCK, n_z * BLOCK)
    lines += [f"#define BLOCK {BLOCK}", f"#define SAMPLE_LIMIT {float(limits[0])!r}", f"#define BLOCK_LIMIT {float(limits[1])!r}"]
    return "\n".join([*lines, ""])


def build(folder: Path) -> Path:
    """The program."""
    model = penode_gen.load(HERE / "models" / "monitored.toml")
    model_c.generate(model, folder, self_test=False)
    (folder / "nets.h").write_text(constants(model))
    code = [folder / f"monitored{end}.c" for end in ("", "_ekf", "_monitor", "_params")]
    words = ["gcc", "-std=c11", "-O2", "-ffp-contract=off", "-D_GNU_SOURCE", '-DNETS="nets.h"', f"-I{folder}", f"-I{ROOT / 'inc'}"]
    words += [f"-I{ROOT / 'port' / 'gnu'}", str(HERE / "monitor_campaign.c"), *map(str, [*code, *sorted((ROOT / "src").glob("*.c"))])]
    subprocess.run([*words, "-lm", "-o", str(folder / "monitor_campaign")], check=True)
    return folder / "monitor_campaign"


def measure(program: Path, jobs: list[tuple[int, float, float, float]], workers: int) -> tuple[np.ndarray, np.ndarray]:
    """First alarms [runs, tests] and numbers of alarms of jobs (seed, seconds, from, force)."""

    def one(job: tuple[int, float, float, float]) -> list[float]:
        done = subprocess.run([str(program), *map(str, job)], capture_output=True, text=True, check=True)
        return [float(word) for word in done.stdout.split()]

    with ThreadPoolExecutor(workers) as pool:
        rows = np.array(list(pool.map(one, jobs)))
    return rows[:, : len(TESTS)], rows[:, len(TESTS) :]


def with_friction(program: Path, runs: int, workers: int = 1, force: float = FORCE) -> np.ndarray:
    """Delays [s] from the friction on [runs, tests]; NaN: not found in time."""
    begin = np.random.default_rng(1).uniform(5.0, 25.0, runs).round(3)
    first, _ = measure(program, [(k, b + WITHIN, b, force) for k, b in enumerate(begin, 1)], workers)
    return np.where(first < 0.0, np.nan, first - begin[:, None])


def without(program: Path, hours: float, workers: int = 1) -> np.ndarray:
    """Numbers of false alarms [tests]."""
    runs = max(1, round(hours * 3600.0 / STRETCH))
    seconds = hours * 3600.0 / runs
    _, alarms = measure(program, [(10_000 + k, seconds, seconds, 0.0) for k in range(runs)], workers)
    return alarms.sum(axis=0).astype(int)


def page(delays: np.ndarray, alarms: np.ndarray, hours: float, force: float, mean_time: float) -> str:
    """The page: one row a test, then what is asked."""
    lines = [
        "# A fault monitor against known faults",
        "",
        f"Written by `make campaign-monitor`. A friction of {force:g} N begins at a drawn time between body and wheel of a quarter vehicle:"
        f" {len(delays)} runs; then {hours:g} h without it. Plant, noise and chi-square tests are those of `monitor_campaign.c`, in double;"
        " filter and monitor are the generated C of `monitored.toml`, in float. Each test is set for one false alarm in"
        f" {mean_time / 3600.0:g} h.",
        "",
        f"| test | found within {WITHIN:g} s | median, s | 95 %, s | false alarms in {hours:g} h |",
        "|---|---|---|---|---|",
    ]
    for k, name in enumerate(TESTS):
        late = np.where(np.isfinite(delays[:, k]), delays[:, k], np.inf)
        middle, most = (np.sort(late)[min(int(share * len(late)), len(late) - 1)] for share in (0.5, 0.95))
        shown = ("never" if np.isinf(v) else f"{v:.3f}" for v in (middle, most))
        lines.append(f"| {name} | {np.isfinite(late).mean():.1%} | {' | '.join(shown)} | {alarms[k]} |")
    named, alarmed = np.isfinite(delays[:, :2]).any(axis=1).mean(), alarms[:2].sum()
    lines += [
        "",
        "| asked of the monitor, both tests together | found | met |",
        "|---|---|---|",
        f"| {LEAST:.0%} of the runs within {WITHIN:g} s | {named:.1%} | {'yes' if named >= LEAST else 'no'} |",
        f"| at most {MOST * hours:g} false alarms | {alarmed} | {'yes' if alarmed <= MOST * hours else 'no'} |",
    ]
    return "\n".join([*lines, ""])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--hours", type=float, default=200.0)
    parser.add_argument("--force", type=float, default=FORCE, help="N")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--folder", type=Path, default=ROOT / "build" / "monitor-campaign")
    parser.add_argument("--page", type=Path, default=HERE / "MONITOR.md")
    asked = parser.parse_args()
    asked.folder.mkdir(parents=True, exist_ok=True)
    program, monitor = build(asked.folder), penode_gen.load(HERE / "models" / "monitored.toml").monitor
    assert monitor is not None
    delays, alarms = with_friction(program, asked.runs, asked.jobs, asked.force), without(program, asked.hours, asked.jobs)
    text = page(delays, alarms, asked.hours, asked.force, monitor.mean_time)
    asked.page.write_text(text, encoding="utf-8")
    print(text)
    return int("| no |" in text)


if __name__ == "__main__":
    sys.exit(main())
