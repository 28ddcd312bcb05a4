# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Recordings: units are converted, and each kind of broken file gets a line with row, channel and remedy.

MDF files are written by asammdf, with values that are computed here.
"""

from __future__ import annotations

import re
import sys
import time as clock
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

sys.path.append(str(Path(__file__).resolve().parents[1] / "prove"))

import mdf_files  # needs the path above

from penode_sil.errors import UserError
from penode_sil.recordings import aliases, on_raster, pick, read, read_csv, resample


def write(tmp_path, text):
    path = tmp_path / "r.csv"
    path.write_text(text)
    return path


def test_channels_come_in_si_in_any_order(tmp_path):
    recording = read_csv(write(tmp_path, "a [m/s^2], z_road [mm] ,time [ms],note\n1,2,0,\n\n3,4,10,7\n"))
    assert recording.time() == pytest.approx([0.0, 0.01])
    assert recording.channel("z_road", "m") == pytest.approx([0.002, 0.004])
    assert recording.channel("a", "m/s^2").tolist() == [1.0, 3.0]


WRONG = [
    ("", r"it is empty; the first row must be a header"),
    ("time [s],z [m],z [m]\n0,0,0\n1,1,2\n", r':1: channel z is there twice; rename or remove one, or say --channel "z=z#1" or'),
    ("time [s]\n0\n1\n", r": there is no channel z; use one of: time"),
    ("time [s],z_b [m]\n0,0\n1,1\n", r": there is no channel z; use one of: time, z_b"),
    ("time [s],z\n0,0\n1,1\n", r':1: channel z has no unit; write "z \[m\]"'),
    ("time [s],z [kg]\n0,0\n1,1\n", r":1: channel z: kg cannot be turned into m; give it in m"),
    ("time [s],z [wug]\n0,0\n1,1\n", r":1: channel z: .*wug"),
    ("time [s],z [m]\n0,0\n1,x\n", r':3: channel z: "x" is not a number; correct the cell'),
    ("time [s],z [m]\n0,0\n1\n", r":3: 1 values for 2 channels, none for z; give one value a channel"),
    ("time [s],z [m]\n0,0\n1,nan\n2,\n3,inf\n", r":3: channel z has no finite value there \(and in 2 more rows\); cut"),
    ("time [s],z [m]\n0,0\n\nnan,0\n2,0\n", r":4: channel time has no finite value there; cut"),
    ("time [s],z [m]\n0,0\n", r"it has 1 rows; at least 2 are needed"),
    ("time [s],z [m]\n0,0\n2,0\n1,0\n3,0\n", r":4: channel time goes back; sort the rows by time"),
    ("time [s],z [m]\n0,0\n1,0\n1,0\n2,0\n", r":4: channel time has the same value as the row before; remove"),
    ("time [s],z [m]\n0,0\n1,0\n2,0\n5,0\n6,0\n", r":5: channel time has a gap \(rows are usually 1 s apart\); split"),
]


@pytest.mark.parametrize("text, expected", WRONG, ids=[expected[:40] for _, expected in WRONG])
def test_broken_recordings_name_row_channel_and_remedy(tmp_path, text, expected):
    path = write(tmp_path, text)
    with pytest.raises(UserError) as caught:
        recording = read_csv(path)
        recording.time()
        recording.channel("z", "m")
    assert all(line.startswith(str(path)) and "; " in line for line in caught.value.problems)
    assert re.search(expected, "\n".join(caught.value.problems)), caught.value.problems


def test_file_that_is_not_there_or_no_text(tmp_path):
    with pytest.raises(UserError, match=r"No such file.*; name a CSV file"):
        read_csv(tmp_path / "none.csv")
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00time")
    with pytest.raises(UserError, match=r"no CSV text.*; give a comma-separated file"):
        read_csv(tmp_path / "b.csv")


def test_all_kinds_of_time_trouble_come_at_once(tmp_path):
    with pytest.raises(UserError) as caught:
        read_csv(write(tmp_path, "time [s]\n0\n1\n2\n2\n9\n8\n9\n")).time()
    assert len(caught.value.problems) == 3


def test_rows_on_the_raster_are_kept_bit_for_bit():
    time, values = np.arange(1000) * 1e-3, np.random.default_rng(1).normal(size=(1000, 2))
    raster, kept, note = resample(time + 5.0, values, 1e-3)
    assert note == "" and np.array_equal(kept, values) and raster[0] == 5.0


def test_other_rates_are_interpolated_and_said():
    time = np.arange(101) * 0.01
    raster, values, note = resample(time, np.column_stack([3.0 * time]), 1e-3)
    assert raster.size == 1001 and "from 101 rows 10 ms apart to 1001 samples 1 ms apart" in note
    assert values[:, 0] == pytest.approx(3.0 * raster, abs=1e-15)  # a straight line stays one, but for rounding of 3


def test_faster_rows_are_low_passed_without_phase():
    time = np.arange(8001) * 5e-4  # 2 kHz to 1 kHz: passes 400 Hz, stops 500 Hz
    inner = slice(20, -20)  # half the kernel is 18.1 samples: 52 dB / (14.36 * 0.1) / 2
    for frequency in (1.0, 40.0, 200.0, 400.0):
        raster, values, note = resample(time, np.sin(2 * np.pi * frequency * time + 1.0)[:, None], 1e-3)
        # a Kaiser window designed for 60 dB leaves a ripple of 1e-3, and the sum of weights is made 1: 2e-3
        assert values[inner, 0] == pytest.approx(np.sin(2 * np.pi * frequency * raster + 1.0)[inner], abs=2e-3)
    assert "low-pass without phase (400 Hz)" in note
    for frequency in (500.0, 613.0, 999.0):
        assert np.max(np.abs(resample(time, np.sin(2 * np.pi * frequency * time)[:, None], 1e-3)[1][inner])) < 2e-3
    assert resample(time, np.ones((8001, 1)), 1e-3)[1] == pytest.approx(1.0, abs=1e-12)  # weights sum to 1
    line = resample(time, (3.0 + time)[:, None], 1e-3)  # turned round at its ends, a line goes straight on
    assert line[1][:, 0] == pytest.approx(3.0 + line[0], abs=1e-12)


def test_channels_on_a_raster_of_their_own(tmp_path):
    text = "time [s],a [m],b [m]\n" + "".join(f"{0.01 * k:.2f},{k},{2 * k}\n" for k in range(11))
    raster, values, notes = on_raster(read(write(tmp_path, text)), {"b": "m", "a": "m"}, 0.005)
    assert raster == pytest.approx(np.arange(21) * 0.005) and values[:, 0] == pytest.approx(2.0 * values[:, 1])
    assert values[1] == pytest.approx([1.0, 0.5]) and len(notes) == 1 and "by straight lines" in notes[0]


HABITS = [
    ("t_s,x_m,v_m_s,force_N\n0,1,2,3\n1,4,5,6\n", {"x": ("m", 1.0), "v": ("m/s", 2.0), "force": ("N", 3.0)}),
    ("t_ms,x_mm,a_m_s2\n0,1,2\n1000,4,5\n", {"x": ("m", 1e-3), "a": ("m/s^2", 2.0)}),
    ("Time (s),x (mm)\n0,1\n1,4\n", {"x": ("m", 1e-3)}),
    ("time [s];x [mm]\n0,0;1,5\n1,0;4\n", {"x": ("m", 1.5e-3)}),
    ("time [s]\tx [mm]\n0\t1.5\n1\t4\n", {"x": ("m", 1.5e-3)}),
    ("time [s],a [g]\n0,1\n1,4\n", {"a": ("m/s^2", 9.80665)}),
    ("\ufefftime [s],x [m]\r\n0,1\r\n1,4\r\n", {"x": ("m", 1.0)}),
    ("time [s],x [mm\n0,1\n1,4\n", {"x": ("m", 1e-3)}),
]


@pytest.mark.parametrize("text, first", HABITS)
def test_other_habits_are_read_where_they_leave_no_doubt(tmp_path, text, first):
    path = tmp_path / "r.csv"
    path.write_bytes(text.encode())
    recording = read_csv(path)
    assert recording.time().tolist() == [0.0, 1.0]
    for name, (unit, value) in first.items():
        assert recording.channel(name, unit)[0] == pytest.approx(value, rel=1e-15)


DOUBTS = [
    ("time [s],x_m,x_mm\n0,1,2\n1,4,5\n", r":1: channel x may be x_m or x_mm; rename or remove one"),
    ("time [s],x_b\n0,1\n1,4\n", r"no channel x; "),  # bytes are no length
    ("time [s],x_in\n0,1\n1,4\n", r"no channel x; "),  # inner or inch?
    ("time [s],x\n0,1\n1,4\n", r'channel x has no unit; write "x \[m\]"'),
    ("time [s];x [m]\n0;1.00,5\n1;4\n", r':2: channel x: "1.00,5" is not a number'),
    ("time [s],x [g]\n0,1\n1,4\n", r":1: channel x: g cannot be turned into m"),
]


@pytest.mark.parametrize("text, expected", DOUBTS)
def test_doubts_are_asked(tmp_path, text, expected):
    with pytest.raises(UserError, match=expected):
        read_csv(write(tmp_path, text)).channel("x", "m")


def test_a_channel_may_have_another_name_in_the_file(tmp_path):
    path = write(tmp_path, "t_s,pos_mm,F\n0,1,2\n1,4,5\n")
    (table,) = read(path, pairs=aliases(["x=pos_mm", "force = F [kN]"], ["x", "force"]))
    assert table.channel("x", "m").tolist() == [1e-3, 4e-3] and table.channel("force", "N").tolist() == [2e3, 5e3]
    with pytest.raises(UserError, match='channel "x" is not understood; write'):
        aliases(["x"], ["x"])


@pytest.fixture
def mdf(tmp_path):
    """mdf(*groups) writes a file; a group is (times, {name: (unit, values)}), optionally with invalid samples."""
    asammdf = pytest.importorskip("asammdf")

    def write_file(*groups, name="r.mf4", version="4.10"):
        with asammdf.MDF(version=version) as file:
            for time, channels in groups:
                file.append(
                    [
                        asammdf.Signal(values, time, name=channel, unit=unit, invalidation_bits=(invalid or [None])[0])
                        if values.dtype.kind != "S"
                        else asammdf.Signal(values, time, name=channel, encoding="utf-8")
                        for channel, (unit, values, *invalid) in channels.items()
                    ]
                )
            written = file.save((tmp_path / name).with_suffix(".mf4" if version > "4" else ".mdf"), overwrite=True)
        return Path(written).rename(tmp_path / name)

    return write_file


@pytest.fixture
def quick():
    """MDF files are read in forked processes; `test_mdf_gives_what_csv_gives` starts those that a user gets."""
    with mdf_files.quick():
        yield


T = np.arange(500) * 1e-3


@pytest.mark.parametrize("name, version", [("r.mf4", "4.10"), ("r.mf4", "4.20"), ("r.mdf", "3.30"), ("r.bin", "4.10")])
def test_mdf_gives_what_csv_gives(mdf, name, version):
    path = mdf((T, {"z_road": ("mm", 1e3 * T), "count": ("V", np.arange(500, dtype=np.uint8))}), name=name, version=version)
    (table,) = read(path)
    assert table.time() == pytest.approx(T) and table.channel("z_road", "m") == pytest.approx(T)
    assert table.channel("count", "V").tolist() == (np.arange(500) % 256).tolist()


def test_mdf_groups_keep_their_clocks_until_a_raster_is_asked_for(mdf, quick):
    slow = np.arange(100) * 5e-3 + 0.0005
    path = mdf((T, {"a": ("m", 2.0 * T), "note": ("", T.astype("S8"))}), (slow, {"b": ("m", 3.0 * slow)}))
    tables = read(path, ["a", "b", "time"])
    assert [t.time().size for t in tables] == [500, 100] and pick(tables, "b", "m") is tables[1]
    raster, values, notes = on_raster(tables, {"a": "m", "b": "m"}, 1e-3)
    assert raster[0] == 0.0005 and raster[-1] == pytest.approx(0.4955)  # what both cover
    assert values[:, 1] == pytest.approx(3.0 * raster, abs=1e-12)  # straight lines of a straight line
    assert values[:, 0] == pytest.approx(2.0 * raster, abs=1e-12) and len(notes) == 2


def test_mdf_samples_marked_as_invalid_are_missing(mdf, quick):
    (table,) = read(mdf((T, {"a": ("m", T, np.arange(500) == 7)})), ["a"])
    assert np.flatnonzero(np.isnan(table.columns["a"])).tolist() == [7]
    with pytest.raises(UserError, match=r"r\.mf4: sample 8: channel a has no finite value there; cut"):
        table.channel("a", "m")


def test_broken_mdf_gives_one_line(mdf, quick, tmp_path):
    def problem(path, name="a", unit="m"):
        with pytest.raises(UserError) as caught:
            pick(read(path, [name]), name, unit).channel(name, unit)
        (line,) = caught.value.problems
        assert line.startswith(str(path)) and "; " in line
        return line

    good = mdf((T, {"a": ("m", T), "c": ("", T), "n": ("", T.astype("S8"))}))
    assert "none of the channels q; use one of: a, c, n" in problem(good, "q")
    assert "channel a: m cannot be turned into s; give it in s" in problem(good, unit="s")
    assert "channel c has no unit; write it into the file" in problem(good, "c")
    assert "channel n holds no numbers" in problem(good, "n")
    twice = mdf((T, {"a": ("m", T)}), (T, {"a": ("m", 2.0 * T)}), name="twice.mf4")
    assert "channel a is there 2 times in one raster; say --channel" in problem(twice)
    for cut in (100, len(good.read_bytes()) // 2):
        (tmp_path / "cut.mf4").write_bytes(good.read_bytes()[:cut])
        assert "it is not a valid MDF file" in problem(tmp_path / "cut.mf4")
    assert "it is not a valid MDF file" in problem(write(tmp_path, "time [s]\n").rename(tmp_path / "text.mf4"))
    assert "No such file" in problem(tmp_path / "none.mf4")


SLOW = settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@settings(SLOW, max_examples=30, derandomize=True)  # `make prove-readers` searches further
@given(st.lists(st.tuples(st.integers(8, 3000), st.integers(0, 255)), min_size=1, max_size=20))
def test_damaged_mdf_is_read_or_refused(mdf, quick, tmp_path, damage):
    data = bytearray(mdf((T[:40], {"a": ("m", T[:40])})).read_bytes())
    for place, byte in damage:
        data[place % len(data)] = byte
    (tmp_path / "d.mf4").write_bytes(data)
    try:
        assert all("time" in table.columns for table in read(tmp_path / "d.mf4", ["a"]))
    except UserError as exc:
        assert all("\n" not in line for line in exc.problems)


def readable(path: Path) -> None:
    """Whatever stands in a file: a recording with rows as promised, or a UserError of single lines."""
    try:
        for table in read(path):
            sizes = {column.size for column in table.columns.values()}
            assert sizes == {table.lines.size} and list(table.units) == list(table.columns)
            for name in table.columns:
                table.find(name, "m")
            on_raster([table], {"x": "m"}, 0.1)
    except UserError as exc:
        assert exc.problems and all(line.startswith(str(path)) for line in exc.problems)


@settings(SLOW, max_examples=300)
@given(st.one_of(st.binary(max_size=200), st.text(max_size=200).map(lambda text: text.encode("utf-8", "surrogatepass"))))
def test_any_bytes_are_read_or_refused(tmp_path, data):
    (tmp_path / "r.csv").write_bytes(data)
    readable(tmp_path / "r.csv")


CELL = st.one_of(st.floats(-2.0, 2.0).map(repr), st.sampled_from(["", "nan", "-inf", "1e400", "x", "1,5", '"', "1_0", " 2 ", "\x00"]))


@settings(SLOW, max_examples=300)
@given(
    st.lists(st.sampled_from(["time [s]", "t_ms", "x [m]", "x_mm", "x", "y (kg)", "x [", ""]), min_size=1, max_size=4),
    st.lists(st.lists(CELL, min_size=1, max_size=4), max_size=6),
    st.sampled_from(",;\t"),
)
def test_any_table_is_read_or_refused(tmp_path, header, rows, separator):
    (tmp_path / "r.csv").write_text("\n".join(separator.join(row) for row in [header, *rows]))
    readable(tmp_path / "r.csv")


@settings(SLOW, max_examples=100)
@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=2, max_size=30))
def test_values_come_back_as_written(tmp_path, values):
    rows = "".join(f"{k},{value!r}\n" for k, value in enumerate(values))
    assert read_csv(write(tmp_path, "time [s],x [m]\n" + rows)).channel("x", "m").tolist() == values


def test_a_minute_at_2_khz_is_read_in_less_than_a_second(tmp_path):
    draw = np.random.default_rng(1).normal(size=(120_001, 5))
    rows = "".join("{:.4f},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g}\n".format(5e-4 * k, *row) for k, row in enumerate(draw.tolist()))
    path = write(tmp_path, "time [s]," + ",".join(f"c{k} [m]" for k in range(5)) + "\n" + rows)
    spent = []
    for _ in range(3):
        start = clock.process_time()
        recording = read_csv(path)
        spent.append(clock.process_time() - start)
    assert recording.columns["c4"] == pytest.approx(draw[:, 4], rel=1e-8)
    assert min(spent) < 1.0  # 0.4 s on the machine it was written on
