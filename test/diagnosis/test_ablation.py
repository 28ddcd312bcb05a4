# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Thresholds that are watched: they count as the numbers that they are, note what they decide, and can be switched off."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent / "ablation"))

import ablate
import probes

HERE = Path(__file__).resolve().parent


@pytest.fixture
def limit(monkeypatch):
    monkeypatch.setattr(probes, "SEEN", probes.defaultdict(lambda: [0, 0]))
    monkeypatch.setattr(probes, "OFF", {})
    return probes.watched("room.LIMIT", 0.5)


def outcomes() -> list[int]:
    return [sum(column) for column in zip(*probes.SEEN.values(), strict=True)]


def test_a_watched_number_is_the_number(limit):
    assert (limit, 2 * limit, limit + 1, -limit, limit**2, 1 / limit) == (0.5, 1.0, 1.5, -0.5, 0.25, 2.0)
    assert json.dumps({"limit": limit}) == '{"limit": 0.5}'
    assert list(range(probes.watched("room.COUNT", 2))) == [0, 1]
    assert np.array_equal(np.array([1.0, 2.0]) * limit, [0.5, 1.0])


def test_comparisons_are_noted_both_ways_and_with_what_a_threshold_is_multiplied_into(limit):
    assert limit < 0.6
    assert not 2.0 * limit < 0.9
    assert np.float64(0.6) > limit
    assert outcomes() == [2, 1]


def test_comparisons_with_arrays_and_bounds_are_noted(limit):
    assert (np.array([0.4, 0.6]) > limit).tolist() == [False, True]
    assert outcomes() == [1, 1]
    assert np.maximum(np.array([0.7, 0.8]), limit).tolist() == [0.7, 0.8]
    assert outcomes() == [2, 1]
    assert max(0.1, limit) == 0.5
    assert sum(outcomes()) == 4


def test_a_threshold_that_is_off_gives_one_outcome_whatever_is_compared(limit, monkeypatch):
    assert not limit > 9.0
    (place,) = probes.SEEN
    monkeypatch.setattr(probes, "OFF", {place: True})
    monkeypatch.setattr(probes, "place", lambda name: place)
    assert limit > 9.0
    assert (limit > np.array([9.0, 9.0])).all()


def noted(folder: Path, **cases: dict[str, list[int]]) -> Path:
    folder.mkdir()
    (folder / "1.jsonl").write_text("".join(json.dumps({"case": c.replace("_", "-"), "seen": seen}) + "\n" for c, seen in cases.items()))
    return folder


def test_what_comes_out_the_same_everywhere_decides_nothing(tmp_path):
    notes = noted(
        tmp_path / "notes",
        draw_1_0={"a.ALWAYS @ a.py:1": [3, 0], "a.ONCE @ a.py:2": [1, 0]},
        draw_1_1={"a.ALWAYS @ a.py:1": [9, 0], "a.ONCE @ a.py:2": [2, 1]},
        draw_1_2={"a.ALWAYS @ a.py:1": [1, 0], "a.ONCE @ a.py:2": [2, 0]},
    )
    seen = ablate.read([notes])
    assert ablate.usual(seen) == {"a.ALWAYS @ a.py:1": True, "a.ONCE @ a.py:2": True}
    assert ablate.deciding(seen) == {"a.ALWAYS": set(), "a.ONCE": {"draw-1-1"}}
    assert "| a.ALWAYS | 0 |" in ablate.table(seen)


def test_only_cases_that_a_threshold_decides_are_run_without_it(tmp_path, monkeypatch):
    notes = noted(
        tmp_path / "notes", **{"1_0": {"a.ONCE @ a.py:2": [1, 0]}, "1_1": {"a.ONCE @ a.py:2": [0, 1]}, "1_2": {"a.ONCE @ a.py:2": [1, 0]}}
    )
    calls = []

    def run(campaign, cases, off):
        calls.append((campaign, list(cases), json.loads(off.read_text()) if off else None))
        return dict.fromkeys(cases, off is None)

    monkeypatch.setattr(ablate, "run", run)
    assert ablate.switched_off("a.ONCE", ablate.read([notes]), {"worlds_campaign.py": ["1:1"]}).startswith(
        "a.ONCE off: 0 cases"
    )  # another draw
    calls.clear()
    said = ablate.switched_off("a.ONCE", ablate.read([notes]), {"campaign.py": ["1:0", "1:1", "1:2"]})
    assert said == "a.ONCE off: 1 cases run, won none; lost 1:1"
    assert calls == [("campaign.py", ["1:1"], None), ("campaign.py", ["1:1"], {"a.ONCE @ a.py:2": True})]


def test_without_notes_the_remedy_is_named(tmp_path):
    done = subprocess.run([sys.executable, HERE / "ablation" / "ablate.py", "table", tmp_path], capture_output=True, text=True)
    assert done.returncode == 2
    assert "nothing noted; run a campaign with PROBES=" in done.stderr


@pytest.mark.long
def test_a_watched_diagnosis_answers_the_same(tmp_path):
    from hidden import cases

    recordings = cases.make(917549355, 0).write(tmp_path / "case")
    rest = [str(tmp_path / "case" / "model.toml"), "--data", *map(str, recordings[:-1]), "--holdout", str(recordings[-1])]
    answers = []
    for name, command in (
        ("plain", [Path(sys.executable).parent / "penode"]),
        ("watched", [sys.executable, HERE / "ablation" / "probes.py"]),
    ):
        subprocess.run([*map(str, command), "diagnose", *rest, "-o", str(tmp_path / name)], check=True, capture_output=True)
        answer = json.loads((tmp_path / name / "diagnosis.json").read_text())
        answers.append({k: v for k, v in answer.items() if not k.endswith("seconds")})
    assert answers[0] == answers[1]
