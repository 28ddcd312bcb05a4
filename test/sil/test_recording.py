# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Recordings: units are converted, and each kind of broken file gets a line with row, channel and remedy."""

from __future__ import annotations

import re

import numpy as np
import pytest

from penode_sil.errors import UserError
from penode_sil.recording import read_csv, resample


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
    ("time [s],z [m\n0,0\n1,1\n", r':1: "z \[m" is no channel; write a name and its unit'),
    ("time [s],z [m],z [m]\n0,0,0\n1,1,1\n", r":1: channel z is there twice; rename"),
    ("time [s]\n0\n1\n", r": there is no channel z; use one of: time"),
    ("time [s],z_ [m]\n0,0\n1,1\n", r': there is no channel z; did you mean "z_"\?'),
    ("time [s],z\n0,0\n1,1\n", r':1: channel z has no unit; write "z \[m\]"'),
    ("time [s],z [kg]\n0,0\n1,1\n", r":1: channel z: kg cannot be turned into m; give it in m"),
    ("time [s],z [wug]\n0,0\n1,1\n", r":1: channel z: .*wug"),
    ("time [s],z [m]\n0,0\n1,x\n", r':3: channel z: "x" is no number; correct the cell'),
    ("time [s],z [m]\n0,0\n1\n", r":3: 1 values for 2 channels; give one value a channel"),
    ("time [s],z [m]\n0,0\n1,nan\n2,\n3,inf\n", r":3: channel z has no finite value there \(and in 2 more rows\); cut"),
    ("time [s],z [m]\n0,0\n\nnan,0\n2,0\n", r":4: channel time has no finite value there; cut"),
    ("time [s],z [m]\n0,0\n", r"it has 1 rows; at least 2 are needed"),
    ("time [s],z [m]\n0,0\n2,0\n1,0\n3,0\n", r":4: channel time goes back; sort the rows by time"),
    ("time [s],z [m]\n0,0\n1,0\n1,0\n2,0\n", r":4: channel time has the same value as the row before; remove"),
    ("time [s],z [m]\n0,0\n1,0\n2,0\n5,0\n6,0\n", r":5: channel time has a gap \(rows are usually 1 s apart\); split"),
]  # fmt: skip


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
    with pytest.raises(UserError, match="No such file.*; name a CSV file"):
        read_csv(tmp_path / "none.csv")
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00time")
    with pytest.raises(UserError, match="no CSV text.*; give a comma-separated file"):
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
    assert "aliased" in resample(np.arange(1001) * 1e-4, np.zeros((1001, 1)), 1e-3)[2]
