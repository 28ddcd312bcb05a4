# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Units as people write them, aliases, columns that nobody needs, rasters, `penode inspect`, and how a crash ends."""

from __future__ import annotations

import json
import math
import re
import shlex
import subprocess
import sys

import numpy as np
import pytest
from click.testing import CliRunner

from penode_sil import cli, guard
from penode_sil.errors import UserError
from penode_sil.recordings import aliases, pick, read
from penode_sil.recordings.similar import proposals
from penode_sil.recordings.unit_text import scale
from penode_sil.recordings.units import UnitError

TURN, DEGREE, G = math.tau, math.tau / 360.0, 9.80665
# as written in a file; what the model asks for; SI units per unit
UNITS = [
    *(
        (text, "m/s^2", 1.0)
        for text in (
            "m/s2",
            "m/s²",
            "m/s/s",
            "m s-2",
            "m.s^-2",
            "ms-2",
            "m·s⁻²",
            "m/(s^2)",
            "m/sec2",
            "M/S^2",
            "m/s**2",
            "m/(s*s)",
            "ms2",
            "mps2",
        )
    ),
    *((text, "m/s^2", G) for text in ("g", "G", "gn", "gee")),
    ("mg", "m/s^2", 1e-3 * G),
    ("g", "kg", 1e-3),
    ("mg", "kg", 1e-6),
    *((text, "N*m", 1.0) for text in ("Nm", "N m", "N.m", "N-m", "NM", "J")),
    ("kNm", "N*m", 1e3),
    ("mNm", "N*m", 1e-3),
    ("Nmm", "N*m", 1e-3),
    ("nm", "m", 1e-9),
    ("Nm/deg", "N*m/rad", 1.0 / DEGREE),
    ("Nms/rad", "N*m*s/rad", 1.0),
    ("Ns/m", "N*s/m", 1.0),
    ("N/(m/s)", "N*s/m", 1.0),
    *((text, "rad/s", TURN / 60.0) for text in ("1/min", "rpm", "RPM", "U/min", "min-1", "min^-1", "/min", "rev/min", "r/min")),
    *((text, "rad/s", DEGREE) for text in ("deg/s", "°/s", "dps", "deg/sec", "Grad/s")),
    ("rev/s", "rad/s", TURN),
    ("Hz", "rad/s", TURN),
    ("1/min", "Hz", 1.0 / 60.0),
    ("rpm", "Hz", 1.0 / 60.0),
    ("1/s", "Hz", 1.0),
    ("rpm/s", "rad/s^2", TURN / 60.0),
    ("deg/s2", "rad/s^2", DEGREE),
    *((text, "m/s", 1.0 / 3.6) for text in ("km/h", "kph", "kmh", "km/hr", "KM/H")),
    *((text, "m/s", 1.0) for text in ("mps", "m/sec")),
    ("%", "1", 0.01),
    ("pct", "1", 0.01),
    ("-", "1", 1.0),
    ("", "1", 1.0),
    ("µs", "s", 1e-6),
    ("msec", "s", 1e-3),
    ("S", "s", 1.0),
    ("KN", "N", 1e3),
    ("kgm2", "kg*m^2", 1.0),
    ("N/mm", "N/m", 1e3),
    ("Grad", "rad", DEGREE),
]


@pytest.mark.parametrize("given, asked, expected", UNITS)
def test_units_are_read_by_what_the_model_asks_for(given, asked, expected):
    assert scale(given, asked) == pytest.approx(expected, rel=1e-12)  # a few roundings


@pytest.mark.parametrize(
    "given, asked, why",
    [
        ("1/s", "rad/s", "may be rad/s or"),
        ("grad", "rad", "may be deg or grad"),
        ("-", "rad", "is no angle"),
        ("g", "m", "cannot be turned"),
        ("Nm", "m", r"^N\*m cannot be turned"),
        ("Ohm", "V/A", "unknown unit 'Ohm'; write 'ohm'"),
        ("1/min", "s", "cannot be turned"),
        ("wug", "m", "unknown unit"),
        ("m/s2", "m/s", "m/s2|cannot"),
    ],
)
def test_units_that_do_not_fit_are_refused(given, asked, why):
    with pytest.raises(UnitError, match=why):
        scale(given, asked)


def write(folder, text):
    (folder / "r.csv").write_text(text)
    return folder / "r.csv"


def channel(path, name, unit, *options):
    tables = read(path, [name, "time"], aliases(options, ["x", "y"]))
    return pick(tables, name, unit).channel(name, unit)


def test_a_bad_cell_in_an_unused_channel_is_ignored(tmp_path):
    path = write(tmp_path, "time [s],x [m],y [m],q [wug],q [V],\n0,1,oops,2,RUN,\n1,2,3,,,\n2,3\n")
    assert channel(path, "x", "m").tolist() == [1.0, 2.0, 3.0]
    with pytest.raises(UserError, match=r':2: channel y: "oops" is not a number; correct the cell'):
        channel(path, "y", "m")


def test_rows_without_a_clock_may_be_given_one(tmp_path):
    path = write(tmp_path, "nr,x [m],note\n7,1,\n8,2,a\n9,3,\n")
    with pytest.raises(UserError, match=r'there is no channel time; .*, or say --channel "time=@1ms" if rows are 1 ms apart'):
        read(path)[0].time()
    (table,) = read(path, ["x", "time"], aliases(["time=@20ms"], ["x"]))
    assert table.time() == pytest.approx([0.0, 0.02, 0.04]) and table.channel("x", "m").tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize(
    "header",
    [
        "time_sec,x_cm,y_m_s2",
        "time_s_,x_cm_,y_m_s_2_",
        "Time_[s],X_[cm],y_[m/s2]",
        "t (s),x; cm,y m/s²",
        "s,cm,m/s^2\ntime,x,y",
        "time,x,y\ns,cm,m/s2\nbool,digits,n. a.",
    ],
)
def test_headers_of_other_programs(tmp_path, header):
    (tmp_path / "r.csv").write_text(f"{header}\n0,10,1\n1,20,2\n2,30,3\n", encoding="utf-8")
    assert channel(tmp_path / "r.csv", "x", "m").tolist() == pytest.approx([0.1, 0.2, 0.3], rel=1e-15)
    assert channel(tmp_path / "r.csv", "y", "m/s^2").tolist() == [1.0, 2.0, 3.0]


def test_text_with_commas_at_the_end_of_a_row_is_text(tmp_path):
    path = write(tmp_path, "time [s],x [m],note\n0,1,RUN\n1,2,idle, cold, wet\n2,3,\n")
    assert channel(path, "x", "m").tolist() == [1.0, 2.0, 3.0]
    with pytest.raises(UserError, match=":3: 4 values for 3 channels; give one value a channel, separated by commas"):
        channel(write(tmp_path, "time [s],x [m],y [m]\n0,1,2\n1,2,3,4\n2,3,4\n"), "x", "m")


def test_the_option_is_asked_before_anything_is_refused(tmp_path):
    path = write(tmp_path, "time [s],x_m,x_mm,x [kg],a=b [c] [mm]\n0,1,2,3,4\n1,2,3,4,5\n")
    with pytest.raises(UserError, match="kg cannot be turned into m") as caught:
        channel(path, "x", "m")
    assert '--channel "x=x [m]"' in str(caught.value)
    for option, expected in (
        ("x=x [mm]", 3e-3),
        ("x=x_mm", 2e-3),
        ("x=x_m [cm]", 1e-2),
        ("x = a=b [c]", 4e-3),
        ("x=a=b [c] [mm]", 4e-3),
        ("x=a=b [c] [m]", 4.0),
    ):
        assert channel(path, "x", "m", option)[0] == pytest.approx(expected, rel=1e-15), option
    with pytest.raises(UserError, match=r'there is no column "x_cm" for --channel "x=x_cm"; did you mean "x_m'):
        channel(path, "x", "m", "x=x_cm")


@pytest.mark.parametrize(
    "text, first",
    [
        ("time [s];x [m]\n0;1,5\n1;-\n", 1.5),
        ("time [s];x [m]\n0;1.5\n1;n/a\n", 1.5),
        ("time [s];x [m]\n0;1,25D-1\n1;\n", 0.125),
        ("time [s];x [m]\n0,5;1'234,5\n1,5;-\n", 1234.5),
        ("time [s],x [m]\n0,\u22121.5\n1,#N/A\n", -1.5),
    ],
)
def test_signs_for_missing_values_and_other_notations(tmp_path, text, first):
    (tmp_path / "r.csv").write_text(text, encoding="utf-8")
    (table,) = read(tmp_path / "r.csv")
    values = table.channel("x", "m", finite=False)
    assert values[0] == first and np.isnan(values[1])


def test_decimal_signs_are_not_mixed(tmp_path):
    path = write(tmp_path, "time [s];x [m];y [m]\n" + "".join(f"{k}.5;{k}.25;1,{k}00\n" for k in range(5)))
    assert channel(path, "x", "m")[1] == 1.25
    with pytest.raises(UserError, match=r':2: channel y: "1,000" is not a number beside decimal points'):
        channel(path, "y", "m")


def test_rasters_and_units_of_mdf(tmp_path):
    asammdf = pytest.importorskip("asammdf")
    time, path = np.arange(400) * 2e-3, tmp_path / "r.mf4"
    with asammdf.MDF(version="4.10") as file:
        for every, factor, name, unit in ((10, 3.0, "x", "m"), (1, 2.0, "x\\XCP:1", "mm"), (5, 4.0, "x", "")):
            file.append([asammdf.Signal(factor * time[::every], time[::every], name=name, unit=unit)])
        file.append([asammdf.Signal(5.0 * time, time, name="y", unit="")])
        file.save(path, overwrite=True)
    assert channel(path, "x", "m")[1] == pytest.approx(1e-3 * 2.0 * 2e-3)  # the finest, with a device behind its name
    assert channel(path, "x", "m", "x=x@20ms")[1] == pytest.approx(3.0 * 0.02)
    assert channel(path, "x", "m", "x=x@10ms [mm]")[1] == pytest.approx(1e-3 * 4.0 * 0.01)
    with pytest.raises(UserError, match=r'has no raster of 3 ms; say --channel "x=x@20ms" or --channel "x=x@10ms"'):
        channel(path, "x", "m", "x=x@3ms")
    with pytest.raises(UserError, match=r'channel y has no unit; write it into the file, or say --channel "y=y \[m\]"'):
        channel(path, "y", "m")
    assert channel(path, "y", "m", "y=y [m]")[1] == pytest.approx(5.0 * 2e-3)


def test_columns_are_proposed_by_words_and_units():
    missing = {"z_road": "m", "a_body": "m/s^2", "a_wheel": "m/s^2", "travel": "m", "tau": "N*m"}
    names = {"Ground 1": "mm", "acc. chassis": "g", "AccWheel": None, "S.x": "m", "Speed": "m/s", "state": None}
    found = {name: column for name, (column, _) in proposals(missing, names, {key: key for key in names}).items()}
    assert found == {"a_body": "acc. chassis", "a_wheel": "AccWheel", "z_road": "Ground 1", "travel": "S.x"}


def test_inspect_gives_options_that_work(tmp_path, cli_model):
    time = np.arange(300) * 1e-3
    rows = "".join(f"{1e3 * t:.6g};{3.0 * np.sin(9 * t):.6g};{np.cos(5 * t):.6g};RUN\n" for t in np.delete(time, [100, 101, 102]))
    path = write(tmp_path, "Zeit [ms];Road height 1 [mm];Accel. body;state\n" + rows)
    run = CliRunner().invoke(cli.cli, ["inspect", str(path), str(cli_model)])
    assert run.exit_code == 0 and "1 ms apart" in run.output and "1 gap\n" in run.output and "holds no numbers" in run.output
    assert "..." not in run.output
    said = json.loads(CliRunner().invoke(cli.cli, ["inspect", str(path), str(cli_model), "--json"]).output)
    assert [c["name"] for t in said["tables"] for c in t["channels"]] == ["Road height 1", "Accel. body", "state"]
    options = shlex.split(" ".join(said["options"]))
    assert options[::2] == ["--channel"] * 2 and options[1::2] == ["z_road=Road height 1", "a_body=Accel. body [m/s^2]"]
    again = json.loads(CliRunner().invoke(cli.cli, ["inspect", str(path), str(cli_model), "--json", *options]).output)
    kinds = {s["name"]: s["column"] for s in again["signals"]}
    assert kinds["z_road"] == "Road height 1" and kinds["a_body"] == "Accel. body" and not again["options"]


@pytest.fixture
def cli_model(tmp_path):
    """A mass on a spring on a road."""
    (tmp_path / "m.toml").write_text(
        '[model]\nname = "rig"\nsample_time = "1 ms"\n[parameters]\nm = { value = 300.0, unit = "kg" }\nc = { value = 2e4, unit = "N/m" }\n'
        '[inputs]\nz_road = { unit = "m" }\n[bodies]\nbody = { mass = "m", position = "z", velocity = "v" }\n[elements]\n'
        'spring = { between = ["body", "z_road"], law = "linear_spring", stiffness = "c" }\n'
        '[outputs]\nz_out = { value = "z", unit = "m" }\n'
        '[sensors]\na_body = { value = "der(v)", unit = "m/s^2" }\n'
    )
    return tmp_path / "m.toml"


def test_a_crash_is_one_line_and_a_file(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["penode", "simulate", "a b.toml"])
    with pytest.raises(SystemExit) as ended:
        guard.guarded(lambda: {}["lost\nkey"])
    assert ended.value.code == 3
    (line,) = capsys.readouterr().err.splitlines()
    (path,) = tmp_path.iterdir()
    assert str(path) in line and "KeyError" in line and "report it with" in line
    assert "Traceback" in path.read_text() and "penode simulate 'a b.toml'" in path.read_text()


def test_numpy_prints_no_warning(tmp_path):
    code = "import numpy as np; from penode_sil.guard import guarded; guarded(lambda: np.float64(1.0) / np.float64(0.0))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path)
    assert run.returncode == 0 and not re.search("warning", run.stderr, re.IGNORECASE) and not run.stderr


def test_a_channel_that_is_not_found_gets_an_option_that_works(tmp_path):
    path = write(tmp_path, "time [s],Ground z [mm],q [V],y\n0,1,2,3\n1,2,3,4\n")
    with pytest.raises(
        UserError, match=r'there is no channel z_road; use one of: Ground z, q, y, or say --channel "z_road=Ground z" if it is that'
    ):
        pick(read(path), "z_road", "m")
    with pytest.raises(UserError, match=r'there is no channel w; .*, or say --channel "w=COLUMN" if it is one of these'):
        pick(read(path), "w", "rad/s")


def test_a_crash_of_one_recording_is_a_line_too(tmp_path, monkeypatch):
    from penode_sil.diagnosis import files, folder

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(files, "run", lambda *given, **options: 1 // 0)
    for name in ("m.toml", "r.csv"):
        (tmp_path / name).touch()
    answer, line = folder.attempt(files.Job(tmp_path / "m.toml", (tmp_path / "r.csv",), (), tmp_path / "out"))
    (path,) = tmp_path.glob("penode-crash-*.txt")
    assert answer is None and "\n" not in line and "ZeroDivisionError" in line and f"report this bug with {path}" in line
    assert "Traceback" in path.read_text()


@pytest.mark.parametrize(
    "given, asked, at_zero, at_ten",
    [
        ("°C", "K", 273.15, 283.15),
        ("degC", "K", 273.15, 283.15),
        ("deg C", "K", 273.15, 283.15),
        ("\u2103", "K", 273.15, 283.15),
        ("Celsius", "K", 273.15, 283.15),
        ("C", "K", 273.15, 283.15),
        ("°F", "K", 459.67 / 1.8, 469.67 / 1.8),
        ("degF", "K", 459.67 / 1.8, 469.67 / 1.8),
        ("K", "K", 0.0, 10.0),
        ("°C/s", "K/s", 0.0, 10.0),  # differences
        ("°F/min", "K/s", 0.0, 10.0 / 1.8 / 60.0),
        ("W/°C", "W/K", 0.0, 10.0),
        ("C", "C", 0.0, 10.0),  # coulomb, where a charge is asked for
        ("ft/s^2", "m/s^2", 0.0, 3.048),
        ("ft/s/s", "m/s^2", 0.0, 3.048),
        ("fps", "m/s", 0.0, 3.048),
        ("in/s", "m/s", 0.0, 0.254),
        ("mph", "m/s", 0.0, 4.4704),
    ],
)
def test_units_with_another_zero_and_imperial_ones(tmp_path, given, asked, at_zero, at_ten):
    path = write(tmp_path, f"time [s],x [{given}]\n0,0\n1,10\n")
    assert channel(path, "x", asked) == pytest.approx([at_zero, at_ten], rel=1e-12)


def test_endings_of_names_are_units_too(tmp_path):
    path = write(tmp_path, "time_s,a_ft_s2,T_degC\n0,10,20\n1,20,30\n")
    assert channel(path, "a", "m/s^2")[0] == pytest.approx(3.048) and channel(path, "T", "K")[0] == pytest.approx(293.15)
