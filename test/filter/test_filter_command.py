# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""`penode filter` and `penode simulate --filter`."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import plant
import pytest

import penode_gen
from penode_sil.filtering.compiled import Compiled
from penode_sil.filtering.exact import Exact

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
QUARTER = ROOT / "sil" / "filter" / "quarter.toml"
ROAD = 'title = "road"\nduration = "{s} s"\n[input.z_road]\nkind = "road"\nclass = "A"\nspeed = "10 m/s"\nseed = 1\n'


def penode(*words: object, fails: bool = False) -> str:
    """What the command prints; on stderr if it has to fail with exit code 2."""
    done = subprocess.run([sys.executable, "-m", "penode_sil", *map(str, words)], capture_output=True, text=True, check=False)
    assert done.returncode == (2 if fails else 0), done.stderr
    return done.stderr if fails else done.stdout


def table(path: Path) -> dict[str, np.ndarray]:
    with open(path, newline="") as file:
        head, *rows = csv.reader(file)
    return dict(zip(head, np.array(rows, float).T, strict=True))


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict]:
    """Two seconds of road with the filter beside it: the folder, and the summary."""
    folder = tmp_path_factory.mktemp("filter")
    (folder / "road.toml").write_text(ROAD.format(s=2))
    words = ["simulate", QUARTER, "--scenario", folder / "road.toml", "--filter", "-o", folder / "sil.csv", "--json"]
    return folder, json.loads(penode(*words, "--plot", folder / "sil.png", "--signal", "deflection"))


def test_simulation_has_truth_estimate_and_deviation(simulated: tuple[Path, dict]) -> None:
    folder, summary = simulated
    found, entry = table(folder / "sil.csv"), summary["instances"][0]["filter"]
    error = found["deflection.estimate [m]"] - found["deflection [m]"]
    rmse = entry["errors"]["deflection"]["rmse"]
    assert rmse == pytest.approx(float(np.sqrt(np.mean(error**2))), rel=1e-3)
    assert rmse < 1e-3 and entry["errors"]["F_tyre"]["rmse"] < 20.0
    assert entry["measurements"]["a_body"]["used"] == 2001 and entry["measurements"]["a_body"]["missing"] == 0
    assert {"z_road.estimate [m]", "z_road.sd [m]", "a_body.ratio [1]", "filter.status [1]"} <= found.keys()
    assert (folder / "sil.png").stat().st_size > 1000


def test_recording_without_road_gives_deflection(simulated: tuple[Path, dict]) -> None:
    """From the two accelerations alone, with the deflection that was recorded to compare with."""
    folder, _ = simulated
    found, rng = table(folder / "sil.csv"), np.random.default_rng(1)
    rows = found["time [s]"].size
    noisy = {"a_body [m/s^2]": 0.02, "a_wheel [m/s^2]": 0.1, "deflection [m]": 1e-4}
    columns = {"time [s]": found["time [s]"]} | {n: found[n] + s * rng.standard_normal(rows) for n, s in noisy.items()}
    lines = [",".join(columns), *(",".join(map(repr, map(float, row))) for row in zip(*columns.values(), strict=True))]
    lines[500] = ",".join([lines[500].split(",")[0], "", *lines[500].split(",")[2:]])
    (folder / "rec.csv").write_text("\n".join(lines) + "\n")
    summary = json.loads(penode("filter", QUARTER, "--data", folder / "rec.csv", "-o", folder / "est.csv", "--json"))
    assert summary["measurements"]["a_body"]["used"] >= rows - 3 and summary["measurements"]["a_body"]["not_offered"] >= 1
    assert summary["checked"]["deflection"]["rmse"] < 1e-3 and "a_body" not in summary["checked"]
    assert 0.7 < summary["measurements"]["a_body"]["mean_ratio"] < 1.3
    assert table(folder / "est.csv")["deflection [m]"].size == rows


def test_what_cannot_be_filtered_is_one_line(simulated: tuple[Path, dict], tmp_path: Path) -> None:
    folder, _ = simulated
    road, out = folder / "road.toml", tmp_path / "out.csv"
    nqvm = ROOT / "gen" / "nqvm" / "nqvm.toml"
    (tmp_path / "rec.csv").write_text("time [s],other [m]\n0,1\n0.001,1\n0.002,1\n")
    said = penode("simulate", nqvm, "--scenario", road, "--filter", "-o", out, fails=True)
    assert said == f"penode: {nqvm}: has no [filter]; add one, as gen/README.md describes it\n"
    said = penode("simulate", QUARTER, "--scenario", road, "--filter", "--on", "pil", "-o", out, fails=True)
    assert said == "penode: --filter: it runs on mil and sil; choose one of them by --on\n"
    said = penode("simulate", QUARTER, "--input", tmp_path / "rec.csv", "--filter", "-o", out, fails=True)
    assert said == 'penode: --filter: it needs the truth of a scenario; for a recording use "penode filter"\n'
    said = penode("filter", QUARTER, "--data", tmp_path / "rec.csv", "--signal", "deflexion", "-o", out, fails=True)
    assert said.startswith('penode: --signal: the filter estimates no "deflexion"; ') and "deflection" in said
    said = penode("filter", QUARTER, "--data", tmp_path / "rec.csv", "-o", out, fails=True)
    assert len(said.splitlines()) == 1 and "rec.csv" in said and "--channel" in said
    assert not out.exists()


@pytest.mark.parametrize("name", ["layered", "measured"])
def test_filter_in_numpy_is_the_compiled_one(name: str) -> None:
    """Different arithmetic, derivatives by differences: 1e-5 of a standard deviation, of which 2e-6 were measured."""
    model = penode_gen.load(HERE / "models" / f"{name}.toml")
    z = plant.drive(plant.Plant(model), model, 150, 1, seed=2, road=name == "layered").z[:, 0]
    z[40, 0] = np.nan
    mask = np.full(150, 3, np.uint32)
    mask[60:70] = 1
    u = np.zeros((150, 1))
    one, two = Exact(model).run(u, z, mask), Compiled(model, np.float64).filter().run(u, z, mask)[0]
    assert np.max(np.abs(one.values - two.values)[:, two.deviations[0] > 0.0] / two.deviations[:, two.deviations[0] > 0.0]) < 1e-5
    assert one.deviations == pytest.approx(two.deviations, rel=1e-5)
    assert np.array_equal(one.verdict, two.verdict) and np.array_equal(one.counts, two.counts)
    assert np.array_equal(one.status, two.status)
