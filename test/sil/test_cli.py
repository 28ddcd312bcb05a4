# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The command as a user meets it: what it writes, and one line and exit code 2 for everything that can be mended."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from places import HERE, ROOT

MODEL = HERE / "models" / "oscillator.toml"
NQVM = ROOT / "gen" / "nqvm" / "nqvm.toml"
SCENARIO = """
duration = "1 s"
[input.foot]
kind = "bump"
height = "10 mm"
length = "1 m"
speed = "10 m/s"
[[instance]]
name = "plain"
[[instance]]
name = "changed"
exchange = [{ time = "0.3 s", set = "stiff" }]
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "s.toml").write_text(SCENARIO)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def table(path):
    """Header cells and values of a CSV file."""
    lines = path.read_text().splitlines()
    return lines[0].split(","), np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])


def test_generate_names_all_the_files_it_writes(penode, tmp_path):
    out = penode("generate", MODEL, "-o", tmp_path / "c").splitlines()
    written = sorted(p.name for p in (tmp_path / "c").iterdir())
    assert sorted(os.path.basename(line) for line in out) == written
    assert {f"oscillator{end}" for end in (".h", ".c", "_sets.h", "_params.c", "_layout.json")} <= set(written)


def test_scenario_on_all_targets_agrees(penode, folder):
    tables = {}
    for target in ("mil", "sil", "pil:host"):
        out = json.loads(penode("simulate", MODEL, "--scenario", "s.toml", "--on", target, "-o", "o.csv", "--json"))
        assert (out["model"], out["target"], out["samples"]) == ("oscillator", target, 1001)
        assert out["instances"][1]["adopted_at_sample"] == [301]
        tables[target] = table(folder / "o.csv")
    header, exact = tables["mil"]
    assert header == [
        "time [s]",
        "foot [mm]",
        "plain.z [mm]",
        "plain.a [m/s^2]",
        "plain.v [m/s]",
        "changed.z [mm]",
        "changed.a [m/s^2]",
        "changed.v [m/s]",
    ]
    assert exact[:, 1].max() == pytest.approx(10.0)
    header_sil, sil = tables["sil"]
    assert header_sil == [*header[:5], "plain.status [1]", *header[5:], "changed.status [1]"]
    assert np.array_equal(sil, tables["pil:host"][1])
    z = [(header.index(name), header_sil.index(name)) for name in ("plain.z [mm]", "changed.z [mm]")]
    # a bump of 0.1 s under straight lines of 1 ms: h^2/8 * 0.005 * (2 pi / 0.1)^2 = 2.5e-6 m of the foot
    assert all(np.max(np.abs(exact[:, a] - sil[:, b])) < 5e-3 for a, b in z)


def test_plot_is_written(penode, folder):
    penode("simulate", MODEL, "--scenario", "s.toml", "-o", "o.csv", "--plot", "p.png", "--signal", "a")
    assert (folder / "p.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    assert sorted(p.name for p in folder.iterdir()) == ["o.csv", "p.png", "s.toml"]


def test_recording_in_other_units_and_rate_predicts_all_sensors(penode, folder):
    t = np.arange(101) * 10.0
    rows = "".join(f"7,{0.002 * time:.9g},{1000 + time:.9g}\n" for time in t)  # a ramp of 2 mm/s in cm, and time in ms
    (folder / "r.csv").write_text("other [V],foot [cm],time [ms]\n" + rows.replace(",0,", ",0.0,"))
    out = penode("simulate", MODEL, "--input", "r.csv", "-o", "p.csv")
    assert "1001 samples" in out
    header, values = table(folder / "p.csv")
    assert header == ["time [s]", "foot [mm]", "z [mm]", "a [m/s^2]"]
    assert values[0, 0] == 1.0 and values[-1, 0] == pytest.approx(2.0)
    assert values[500, 1] == pytest.approx(10.0)  # 0.002 cm/ms * 500 ms = 1 cm


def test_a_recording_may_call_its_inputs_otherwise(penode, folder):
    (folder / "r.csv").write_text("t_s,Weg,z [mm]\n" + "".join(f"{0.001 * k:.3f},{0.1 * (k % 7):.1f},0\n" for k in range(50)))
    penode("simulate", MODEL, "--input", "r.csv", "-o", "p.csv", "--channel", "foot=Weg [cm]", "time=t_s")
    assert table(folder / "p.csv")[1][:, 1] == pytest.approx(np.arange(50) % 7)


def test_prediction_is_a_recording_again(penode, folder):
    (folder / "r.csv").write_text("time [s],foot [mm]\n" + "".join(f"{0.001 * k:.3f},{k % 7}\n" for k in range(50)))
    penode("simulate", MODEL, "--input", "r.csv", "-o", "p.csv")
    penode("simulate", MODEL, "--input", "p.csv", "-o", "q.csv")
    assert (folder / "p.csv").read_bytes() == (folder / "q.csv").read_bytes()


WRONG = [
    (["simulate", MODEL, "-o", "o.csv"], "exactly one of --scenario and --input"),
    (["simulate", MODEL, "--scenario", "s.toml"], "Missing option '-o'"),
    (["simulate", MODEL, "--scenario", "s.toml", "-o", "o.csv", "--on", "hil"], '--on: "hil" is not known; use mil'),
    (["simulate", MODEL, "--scenario", "s.toml", "-o", "o.csv", "--on", "pil:m4"], 'no machine "m4"; did you mean "m4f"?'),
    (["simulate", MODEL, "--scenario", "s.toml", "-o", "s.toml/o.csv"], "s.toml is a file and no directory"),
    (["simulate", MODEL, "--scenario", "s.toml", "-o", "no/o.txt"], 'cannot be written as ".txt"; end its name in .csv or .mf4'),
    (["simulate", MODEL, "--scenario", "s.toml", "-o", "."], "this is a directory; name a file in it"),
    (["simulate", MODEL, "--scenario", "s.toml", "-o", "o.csv", "--plot", "p.xyz"], "end its name in .png"),
    (["simulate", MODEL, "--scenario", "s.toml", "-o", "o.csv", "--signal", "q"], 'no signal "q"; use one of: z, a, v'),
    (["simulate", MODEL, "--scenario", "none.toml", "-o", "o.csv"], "none.toml: No such file or directory; name a scenario"),
    (["simulate", MODEL, "--input", "none.csv", "-o", "o.csv"], "none.csv: No such file or directory; name a CSV file"),
    (["simulate", MODEL, "--input", "bad.csv", "-o", "o.csv"], "bad.csv:3: channel foot has no finite value there"),
    (["simulate", MODEL, "--input", "gap.csv", "-o", "o.csv"], "gap.csv:5: channel time has a gap"),
    (["simulate", MODEL, "--input", "unit.csv", "-o", "o.csv"], "unit.csv:1: channel foot: kg cannot be turned into mm"),
    (["simulate", MODEL, "--input", "gap.csv", "--channel", "fot=x", "-o", "o.csv"], 'no input or sensor "fot"; did you mean'),
    (["simulate", MODEL, "--scenario", "s.toml", "--channel", "foot=x", "-o", "o.csv"], "--channel: it names what a recording holds"),
    (["simulate", MODEL, "--input", "gap.csv", "--set", "stif", "-o", "o.csv"], 'no set "stif"; did you mean "stiff"?'),
    (["simulate", "none.toml", "--scenario", "s.toml", "-o", "o.csv"], "none.toml: cannot be read"),
    (["simulate", "s.toml", "--scenario", "s.toml", "-o", "o.csv"], "s.toml"),
    (["generate", MODEL, "-o", "s.toml"], "this is a file; name a directory"),
    (["generate", MODEL, "-o", "no/such/place"], "there is no directory"),
    (["simulate", MODEL, "--scenario", "set.toml", "-o", "o.csv"], 'instance[2].exchange[1].set: "softer" is not known'),
    (["frobnicate"], "No such command"),
]


@pytest.mark.parametrize("words, expected", WRONG, ids=[expected[:40] for _, expected in WRONG])
def test_wrong_use_is_one_line_and_leaves_nothing(penode, folder, words, expected):
    (folder / "bad.csv").write_text("time [s],foot [mm]\n0,0\n1,nan\n")
    (folder / "gap.csv").write_text("time [s],foot [mm]\n0,0\n1,0\n2,0\n9,0\n")
    (folder / "unit.csv").write_text("time [s],foot [kg]\n0,0\n1,0\n")
    (folder / "set.toml").write_text(SCENARIO.replace("stiff", "softer"))
    before = sorted(p.name for p in folder.iterdir())
    lines = penode(*words, code=2)
    assert any(expected in line for line in lines), lines
    assert all(line.startswith("penode: ") for line in lines)
    assert sorted(p.name for p in folder.iterdir()) == before


def test_an_old_output_survives_a_failure(penode, folder):
    (folder / "o.csv").write_text("precious")
    penode("simulate", MODEL, "--input", "none.csv", "-o", "o.csv", code=2)
    assert (folder / "o.csv").read_text() == "precious"


def test_input_outside_the_models_range_is_said(penode, folder):
    (folder / "r.csv").write_text("time [s],foot [mm]\n0,0\n1,25\n")
    penode("simulate", MODEL, "--input", "r.csv", "-o", "p.csv")
    assert "note: input foot reaches 25 mm, above the model's range that ends at 20 mm" in penode.notes.splitlines()


def test_a_process_of_its_own_ends_with_2_and_no_traceback(folder):
    path = os.pathsep.join([str(ROOT / "gen"), str(ROOT / "sil")])
    result = subprocess.run(
        [sys.executable, "-m", "penode_sil", "simulate", "none.toml", "--input", "r.csv", "-o", "o.csv"],
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": path},
    )
    assert result.returncode == 2 and result.stdout == ""
    assert result.stderr.startswith("penode: none.toml: ") and result.stderr.count("\n") == 1


@pytest.mark.parametrize("name", sorted(p.name for p in (ROOT / "sil" / "scenarios").glob("*.toml")))
def test_committed_scenarios_run(penode, tmp_path, name):
    out = json.loads(
        penode(
            "simulate",
            NQVM,
            "--scenario",
            ROOT / "sil" / "scenarios" / name,
            "-o",
            tmp_path / "o.csv",
            "--plot",
            tmp_path / "p.png",
            "--json",
        )
    )
    assert out["model"] == "nqvm" and not any("nonfinite" in flag for i in out["instances"] for flag in i["flags"])
