# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The reliability of stated confidences, of rows made up here."""

import json
import subprocess
import sys

import pytest
import reliability
from scipy import stats

from penode_sil.diagnosis import reliability as told, verdict
from penode_sil.diagnosis.result import Cause


def claim(confidence, right, nothing=False):
    return {"cause": "coulomb_friction at damper", "confidence": confidence, "right": right, "nothing": nothing}


def written(path, claims, head=None, **more):
    """Rows of one case for each claim, of answers that explain all."""
    judged = {"explained": 1.0, "trust": 0.97}
    rows = [{"case": f"7:{i}", "stratum": "main", "named": [c], **judged, **more} for i, c in enumerate(claims)]
    path.write_text("".join(json.dumps(r) + "\n" for r in [*[head] * bool(head), *rows]))
    return path


def called(*arguments):
    return subprocess.run([sys.executable, reliability.__file__, *map(str, arguments)], capture_output=True, text=True)


def of(claims):
    return reliability.table([{"case": "7:1", "named": claims}])


def test_share_right_by_stated_confidence():
    """19 of 20 at 95 % are inside, 30 of 60 at 85 % are not: the interval of a half of 60 ends at 62 %."""
    t = of([*[claim(0.95, k > 0) for k in range(20)], *[claim(0.85, k % 2 == 0) for k in range(60)]])
    assert [(d["from"], d["named"], d["right"], d["inside"]) for d in t["deciles"]] == [(0.8, 60, 30, False), (0.9, 20, 19, True)]
    expected = stats.binomtest(30, 60).proportion_ci(method="wilson")
    assert t["deciles"][0]["ci95"] == pytest.approx([expected.low, expected.high], abs=1e-4)  # four digits are kept
    assert reliability.apart(t) == pytest.approx(0.875 - 49 / 80)
    assert reliability.wrong(t) == ["80 .. 90 % is outside of its interval", "+26.3 points over all"]
    assert " NO" in reliability.text(t) and "+26.3 points" in reliability.text(t)


def test_what_is_as_it_should_be_passes():
    assert reliability.wrong(of([claim(0.9, k > 0) for k in range(10)])) == []


@pytest.mark.parametrize("confidence, low", [(0.0, 0.0), (0.0999, 0.0), (0.1, 0.1), (0.7, 0.7), (0.3, 0.3), (0.99, 0.9), (1.0, 0.9)])
def test_deciles_hold_their_lower_end(confidence, low):
    """Also where ten times it is not a whole number in binary, as for 0.7 and 0.3."""
    t = of([claim(confidence, True)])
    assert [d["from"] for d in t["deciles"]] == [low]


def test_sizes_that_may_be_nothing_are_counted():
    t = of([claim(1.0, True), claim(1.0, True, nothing=True)])
    assert len(t["nothing"]) == 1 and reliability.wrong(t) == ["1 sizes may be nothing"]


def test_of_a_case_that_was_timed_again_the_later_row_counts(tmp_path):
    path = written(tmp_path / "rows.jsonl", [claim(0.95, True)] * 3, {"seed": 7, "code": "commit 1"}, command="diagnose")
    path.write_text(
        path.read_text()
        + json.dumps({"case": "7:1", "stratum": "main", "command": "diagnose", "named": [claim(0.95, False)]})
        + "\n"
        + json.dumps({"case": "7:1", "stratum": "main", "command": "neural", "named": []})
        + "\n"
    )
    rows, made = reliability.read(path, "diagnose")
    assert [c["right"] for r in rows for c in r["named"]] == [True, False, True]
    assert made == {"seeds": [7], "cases": 3, "codes": ["commit 1"]}


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "[]",
        '{"case": "1:2"}',
        '{"case": "1:2", "named": [{"confidence": 0.5}]}',
        '{"case": "1:2", "named": [{"confidence": 2, "right": true, "nothing": false}]}',
    ],
)
def test_rows_that_cannot_be_read_are_one_line(tmp_path, text):
    (tmp_path / "rows.jsonl").write_text(text + "\n")
    done = called(tmp_path / "rows.jsonl")
    assert done.returncode == 2 and done.stdout == "" and len(done.stderr.splitlines()) == 1 and "rows.jsonl:1: " in done.stderr


def test_no_file_and_no_name_are_one_line(tmp_path):
    (tmp_path / "none.jsonl").write_text('{"case": "1:2", "named": []}\n')
    for path in (tmp_path / "none.jsonl", tmp_path / "missing.jsonl"):
        done = called(path)
        assert done.returncode == 2 and len(done.stderr.splitlines()) == 1, done.stderr


def test_gate_and_table_from_the_command(tmp_path):
    good = written(tmp_path / "good.jsonl", [claim(0.95, k > 0) for k in range(20)])
    bad = written(tmp_path / "bad.jsonl", [claim(0.95, k > 9) for k in range(20)])
    assert [called(p, "--gate").returncode for p in (good, bad)] == [0, 1]
    assert called(bad).returncode == 0 and " NO" in called(bad).stdout


def test_changes_are_adopted_and_reported(tmp_path, monkeypatch):
    """What the script writes is what a report reads; not from rows whose commit is unknown."""
    monkeypatch.setattr(reliability, "TABLE", tmp_path / "reliability.json")
    rows = [
        written(tmp_path / "a.jsonl", [claim(0.97, k > 0) for k in range(40)], {"seed": 7, "code": "commit abc"}),
        written(tmp_path / "b.jsonl", [claim(0.55, k % 2 == 0) for k in range(10)], code="commit abc"),
    ]
    call = ["reliability.py", *map(str, rows), "--take-over"]
    monkeypatch.setattr(sys, "argv", call)
    assert reliability.main() == 0
    known = told.reliability([Cause("coulomb_friction", "damper", {}, 0.94)], 1.0, reliability.TABLE)
    assert known["trust"] == pytest.approx((44 + 1) / (40 + 10 * 0.55 / 0.97 + 2), abs=1e-4)  # right ones over their posterior
    low, high = (f"{100 * x:.0f}" for x in stats.binomtest(39, 40).proportion_ci(method="wilson"))
    assert told.line(known, 0.94) == (
        f"of causes named with 90 to 100 % confidence in simulated cases, 39 of 40 were right (98 %, 95 % interval {low} to {high} %); "
        "source: 50 cases of seed 7, commit abc"
    )
    assert [d["from"] for d in known["deciles"]] == [0.9]
    assert told.line(known, 0.2).startswith("no cause was named with this confidence")
    reliability.TABLE.unlink()
    for code in ("", "commit abc-dirty"):
        written(rows[0], [claim(0.97, True)], code=code)
        assert reliability.main() == 2 and not reliability.TABLE.exists()


def test_trust_is_learnt_from_what_answers_explain(tmp_path):
    """Of 30 causes in answers that explain all 29 are right, of 20 in answers that explain nine tenths 10, of 10 without a name that
    explain less 2, which have none again; faults that samples show are more certain than any of these, and leave that as it is."""

    def rows(explained, count, right, confidence=0.9):
        return [{"case": f"7:{k}", "explained": explained, "trust": 0.9, "named": [claim(confidence, k < right)]} for k in range(count)]

    few = [{**r, "unlikely": {"explained": 0.8, "trust": 0.9, "causes": r["named"]}, "named": []} for r in rows(0.0, 10, 2)]
    made = [*rows(1.0, 30, 29), *rows(0.95, 20, 10), *few, *rows(1.0, 5, 0, 0.99)]
    levels = reliability.learnt(made)
    assert [(x["named"], x["right"], x["share"]) for x in levels] == [(30, 29, 0.9375), (20, 10, 0.5), (10, 2, 0.25), (0, 0, 0.5)]
    named = [c for r in reliability.trusted(made, levels) for c in r["named"]]
    assert {c["confidence"] for c in named} == {0.9375, 0.99} and len(named) == 35
    levels[2] |= {"right": 6, "share": 0.6}
    assert sum(c["confidence"] == pytest.approx(0.6) for r in reliability.trusted(made, levels) for c in r["named"]) == 10
    table = tmp_path / "table.json"
    table.write_text(json.dumps({"trust": levels}))
    assert [told.trust(x, table) for x in (1.0, 0.99, 0.95, 0.8, 0.0, -0.2)] == [0.9375, 0.9375, 0.5, 0.6, 0.5, 0.5]
    assert told.is_likely(0.99, table) and not told.is_likely(0.95, table)  # even odds are no reason for a name


def test_without_a_table_that_is_said(tmp_path):
    assert told.reliability([], 1.0, tmp_path / "none.json") is None
    assert told.line(None, 0.9) == "how often causes named with this confidence are right is not recorded"


def test_kept_table_is_sound():
    """The one in the package, if there is one."""
    causes = [Cause("coulomb_friction", "damper", {}, k / 20) for k in range(21)]
    if (known := told.reliability(causes, 1.0)) is not None:
        assert known["source"] and known["cases"] > 0 and known["deciles"]
        assert all(0 < d["named"] >= d["right"] and d["ci95"][0] <= d["right"] / d["named"] <= d["ci95"][1] for d in known["deciles"])


def test_names_that_are_unlikely_are_kept_apart(tmp_path, monkeypatch):
    """The table of levels trusts half of the residual by 0.25: its cause has no name, but its confidence, and a note."""
    monkeypatch.setattr(told, "TABLE", tmp_path / "table.json")
    rows = [{"explained": 0.9, "named": 5, "right": 4, "share": 0.8}, {"explained": 0.0, "named": 4, "right": 2, "share": 0.25}]
    told.TABLE.write_text(json.dumps({"trust": rows}))
    causes = (Cause("coulomb_friction", "damper", {}, 0.6),)
    assert verdict._likely(causes, 0.95) == (causes, {}, [])
    named, unlikely, (note,) = verdict._likely(causes, 0.5)
    assert named == () and note.startswith("Coulomb friction at damper would explain 50% of the avoidable residual")
    assert (unlikely["explained"], unlikely["trust"]) == (0.5, 0.25)
    assert [(c["kind"], c["confidence"]) for c in unlikely["causes"]] == [("coulomb_friction", pytest.approx(0.15))]


def test_the_source_counts_cases_by_seed():
    """Of several campaigns with one seed, all cases; of several commits, all."""
    made = [{"seeds": [5], "cases": 40, "codes": ["commit abc"]}, *({"seeds": [7], "cases": n, "codes": ["commit def"]} for n in (20, 16))]
    assert reliability.source(made) == "40 cases of seed 5 and 36 of seed 7, commits abc and def"
    assert reliability.source(made[:1]) == "40 cases of seed 5, commit abc"
