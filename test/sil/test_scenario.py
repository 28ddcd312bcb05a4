# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Scenario files: what is read, and that all that is wrong is reported at once, a line each: file, key, remedy."""

from __future__ import annotations

import re

import numpy as np
import pytest

from penode_sil import scenario as scenarios
from penode_sil.errors import UserError
from penode_sil.schedule import instance_calls
from penode_sil.signals import Bump, Chirp, Road, Sum, VelocityChirp

GOOD = """
title = "all kinds"
duration = "3 s"
[initial]
v = "-20 mm/s"
[input.foot]
kind = "sum"
[[input.foot.terms]]
kind = "chirp"
velocity_amplitude = "150 mm/s"
start_frequency = "1 Hz"
end_frequency = "60 min^-1"
phase = "90 deg"
[[input.foot.terms]]
kind = "chirp"
amplitude = "1 cm"
start_frequency = "2 Hz"
rate = "0.25 Hz/s"
[[input.foot.terms]]
kind = "road"
class = "B"
speed = "72 km/h"
seed = 4
[[input.foot.terms]]
kind = "bump"
height = "5 cm"
length = "2 m"
speed = "5 m/s"
start = "1 s"
[[instance]]
name = "plain"
[[instance]]
name = "changed"
set = "stiff"
[[instance.exchange]]
time = "1 s"
set = "default"
how = "select"
[[instance.exchange]]
time = "1500 ms"
how = "rollback"
[[instance.exchange]]
time = "2 s"
set = "default"
chunk = 1
hold = true
"""


def load(tmp_path, model, text, length=1):
    path = tmp_path / "s.toml"
    path.write_text(text)
    return scenarios.load(path, model, length)


def problems(tmp_path, model, text, length=1):
    with pytest.raises(UserError) as caught:
        load(tmp_path, model, text, length)
    for line in caught.value.problems:
        assert line.startswith(str(tmp_path / "s.toml") + ":") and "; " in line and "\n" not in line
    return [line.removeprefix(str(tmp_path / "s.toml") + ": ") for line in caught.value.problems]


def test_good_file_is_read_in_si(tmp_path, oscillator):
    plan = load(tmp_path, oscillator, GOOD)
    velocity, height, road, bump = plan.inputs["foot"].terms
    assert isinstance(plan.inputs["foot"], Sum)
    assert velocity == VelocityChirp(0.15, 1.0, 0.0, pytest.approx(np.pi / 2))
    assert height == Chirp(0.01, 2.0, 0.25, 0.0)
    assert road == Road(64e-6, pytest.approx(20.0), 4, 0.5)
    assert bump == Bump(0.05, 1.0, pytest.approx(0.4))
    assert plan.initial == {"v": pytest.approx(-0.02)}
    assert [i.name for i in plan.instances] == ["plain", "changed"]
    assert [(e.time, e.set, e.how) for e in plan.instances[1].exchanges] == [
        (1.0, "default", "select"),
        (1.5, "", "rollback"),
        (2.0, "default", "write"),
    ]


def test_exchange_ends_between_its_sample_and_the_next(tmp_path, oscillator):
    calls = instance_calls(oscillator, load(tmp_path, oscillator, GOOD).instances[1], {}, np.float32)
    assert [(c.sample, c.kind) for c in calls] == [
        (1001, "select"),
        (1501, "rollback"),
        (2001, "hold"),
        (2001, "begin"),
        (2001, "write"),
        (2001, "commit"),
        (2001, "hold"),
    ]
    assert [c.on for c in calls if c.kind == "hold"] == [True, False]


WRONG = [
    ('duration = "3 s"', 'duration = "3 kg"', r"duration: .*kg.*; give it in s"),
    ('duration = "3 s"', "", r'duration: is missing; add duration = "1 s"'),
    ('duration = "3 s"', 'duration = "-3 s"', r"duration: '-3 s' is negative; give more than 0 s"),
    ("title =", "titel =", r'titel: is not known here; did you mean "title"\?'),
    ("[input.foot]\nkind", "[input.food]\nkind", r'input.food: is not known here; did you mean "foot"'),
    ('kind = "road"', 'kind = "raod"', r'input.foot.terms\[3\].kind: "raod" is not known; did you mean "road"\?'),
    ('class = "B"', 'class = "X"', r'terms\[3\].class: "X" is not known; use one of: A, B, C, D'),
    ('speed = "72 km/h"', 'speed = "72 km"', r"terms\[3\].speed: .*; give it in m/s"),
    ("seed = 4", "seed = -4", r"terms\[3\].seed: -4 is not a whole number of at least 0"),
    ("seed = 4", "sead = 4", r'terms\[3\].sead: is not known here; did you mean "seed"\?'),
    ('amplitude = "1 cm"', "amplitude = 1", r"terms\[2\].amplitude: .*plain number.*mm"),
    ('amplitude = "1 cm"', 'amplitude = "one cm"', r"terms\[2\].amplitude: .*number and its unit"),
    ('amplitude = "1 cm"', "", r"terms\[2\]: needs exactly one of amplitude and velocity_amplitude"),
    ('v = "-20 mm/s"', 'w = "-20 mm/s"', r"initial.w: is not known here; .*v"),
    ('name = "plain"', 'name = "changed"', r'instance: two are called "changed"'),
    ('set = "stiff"', 'set = "stif"', r'instance\[2\].set: "stif" is not known; did you mean "stiff"\?'),
    ('time = "1 s"', 'time = "-1 s"', r"exchange\[1\].time: '-1 s' is negative; give at least 0 s"),
    ('time = "1 s"', 'time = "1.0005 s"', r"exchange\[1\].time: 1.0005 s is not on the raster"),
    ('time = "1 s"', 'time = "1e308 s"', r"exchange\[1\].time: 1e\+308 s is more samples than there are numbers; give a shorter time"),
    ('time = "1 s"', 'time = "4 s"', r"exchange\[1\].time: 4 s is not before the end at 3 s"),
    ('time = "1500 ms"', 'time = "500 ms"', r"exchange\[2\].time: staging would begin at 0.5 s, before 1.001 s"),
    ('how = "select"', 'how = "rollback"\nchunk = 3', r"exchange\[1\].how: there is nothing to roll back to"),
    ("hold = true", "hold = 1", r"exchange\[3\].hold: 1 is neither true nor false; write true or false"),
    ("chunk = 1", "chunk = 0", r"exchange\[3\].chunk: 0 is not a whole number of at least 1"),
]


@pytest.mark.parametrize("old, new, expected", WRONG, ids=[expected[:40] for *_, expected in WRONG])
def test_wrong_file_names_key_and_remedy(tmp_path, oscillator, old, new, expected):
    assert GOOD.count(old) >= 1
    found = problems(tmp_path, oscillator, GOOD.replace(old, new, 1))
    assert any(re.search(expected, line) for line in found), found


def test_all_problems_come_at_once(tmp_path, oscillator):
    text = GOOD
    for old, new, _ in (WRONG[0], WRONG[5], WRONG[13], WRONG[15]):
        text = text.replace(old, new, 1)
    assert len(problems(tmp_path, oscillator, text)) == 4


def test_staging_that_would_begin_before_the_start_is_refused(tmp_path, oscillator):
    # 1196 values by 1 take 1196 samples; the last falls on 1 s, so that the first would fall before 0
    text = GOOD.replace('how = "select"', "chunk = 1", 1)
    assert any("staging would begin at -0.195 s" in line for line in problems(tmp_path, oscillator, text, length=1196))


def test_input_without_a_signal_is_named(tmp_path, oscillator):
    assert problems(tmp_path, oscillator, 'duration = "1 s"\n') == ["input.foot: is missing; add [input.foot] with a kind"]


def test_missing_and_broken_files(tmp_path, oscillator):
    with pytest.raises(UserError, match=r"No such file.*; name a scenario file"):
        scenarios.load(tmp_path / "none.toml", oscillator, 1)
    with pytest.raises(UserError, match=r"not valid TOML.*line 1.*; correct it there"):
        load(tmp_path, oscillator, "duration = = 3")


def test_recording_shorter_than_the_scenario_is_refused(tmp_path, oscillator):
    (tmp_path / "r.csv").write_text("time [s],foot [mm]\n0,0\n1,1\n")
    text = 'duration = "2 s"\n[input.foot]\nkind = "recording"\nfile = "r.csv"\n'
    assert problems(tmp_path, oscillator, text) == ["input.foot.file: r.csv ends after 1 s; shorten the scenario's duration"]


def test_recording_is_read_in_si(tmp_path, oscillator):
    (tmp_path / "r.csv").write_text("foot [mm],time [ms]\n0,1000\n8,2000\n")
    plan = load(tmp_path, oscillator, 'duration = "1 s"\n[input.foot]\nkind = "recording"\nfile = "r.csv"\n')
    assert plan.inputs["foot"].value(np.array([0.0, 0.25, 1.0])) == pytest.approx([0.0, 0.002, 0.008])
