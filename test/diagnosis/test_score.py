# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The scorer, on diagnoses written by hand."""

import itertools
import json
import math
import subprocess
import sys
import time

import campaign
import frozen
import pytest
import score
from scipy import stats

FRICTION = {
    "kind": "coulomb_friction",
    "where": ["spring", "damper"],
    "form": "smooth_sign",
    "common": True,
    "energy": 900.0,
    "ratio": 0.5,
    "parameters": {"force": 40.0},
    "rivals": [],
}
LOAD = {
    "kind": "constant_force",
    "where": ["body"],
    "form": "settled_load",
    "common": True,
    "energy": 800.0,
    "ratio": 0.5,
    "parameters": {"force": 100.0},
    "rivals": [{"kind": "sensor_bias", "where": ["deflection"], "left": 0.0}],
}
WRONG = {
    "kind": "wrong_parameter",
    "where": [],
    "parameter": "c",
    "form": "another_value",
    "common": True,
    "energy": 700.0,
    "ratio": 0.5,
    "parameters": {"c": 2e4},
    "rivals": [],
}
ALIEN = {
    "kind": "outside_taxonomy",
    "where": [],
    "form": "engine",
    "common": False,
    "energy": 900.0,
    "ratio": 0.5,
    "parameters": {"amplitude": 9.0},
    "rivals": [],
}


def truth(*effects, stratum="single_common", **more):
    return {
        "seed": 1,
        "index": 2,
        "stratum": stratum,
        "bound": 50.0,
        "effects": list(effects),
        "noise_floor": {"a_body": 0.02},
        "holdout_inside": True,
        **more,
    }


def cause(kind, where="", alternatives=(), **parameters):
    return {"kind": kind, "where": where, "alternatives": list(alternatives), "parameters": parameters}


def said(*causes, verdict="explained", **more):
    return {"verdict": verdict, "causes": list(causes), **more}


BIAS = ("sensor_bias", "deflection")
NEAR = LOAD | {"rivals": [{"kind": "sensor_bias", "where": ["deflection"], "left": 12.0}]}


@pytest.mark.parametrize(
    "effects, diagnosis, outcome",
    [
        ((FRICTION,), said(cause("coulomb_friction", "damper")), "right"),
        ((FRICTION,), said(cause("coulomb_friction", "spring")), "right"),
        ((FRICTION,), said(cause("coulomb_friction", "tyre")), "wrong name"),
        ((FRICTION,), said(cause("stribeck_friction", "damper")), "wrong name"),
        ((FRICTION,), said(cause("stribeck_friction", "damper", ["coulomb_friction"])), "wrong name"),
        ((FRICTION,), said(cause("coulomb_friction", "damper"), cause("cubic_spring", "spring")), "extra name"),
        ((FRICTION,), said(verdict="no_discrepancy"), "missed"),
        ((FRICTION,), said(verdict="not_identifiable"), "missed"),
        ((FRICTION,), said(cause("outside_taxonomy"), verdict="unexplained"), "missed"),
        ((FRICTION | {"energy": 49.0},), said(verdict="not_identifiable"), "right"),
        ((FRICTION | {"energy": 49.0},), said(verdict="unexplained"), "missed"),
        ((FRICTION, LOAD), said(cause("coulomb_friction", "damper"), cause("constant_force", "body", ["sensor_bias"])), "right"),
        ((FRICTION, LOAD), said(cause("constant_force", "body", ["sensor_bias"]), cause("coulomb_friction", "damper")), "right"),
        ((FRICTION, LOAD), said(cause("coulomb_friction", "damper")), "part missed"),
        ((FRICTION, LOAD | {"energy": 10.0}), said(cause("coulomb_friction", "damper")), "right"),
        ((FRICTION, LOAD), said(cause("coulomb_friction", "damper"), cause("coulomb_friction", "spring")), "part missed"),
        ((LOAD,), said(cause(*BIAS, ["constant_force"])), "right"),
        ((LOAD,), said(cause(*BIAS, [{"kind": "constant_force", "where": "body"}])), "right"),
        ((LOAD,), said(cause("constant_force", "body")), "equivalent not told"),
        ((LOAD,), said(cause(*BIAS)), "equivalent not told"),
        ((NEAR,), said(cause("constant_force", "body")), "right"),
        ((NEAR,), said(cause(*BIAS)), "equivalent not told"),
        ((NEAR,), said(cause(*BIAS, ["constant_force"])), "right"),
        ((LOAD,), said(cause("sensor_bias", "a_body", ["constant_force"])), "wrong name"),
        ((LOAD,), said(cause(*BIAS, ["constant_force", "bump_stop", "backlash", "cubic_spring", "bouc_wen"])), "equivalent not told"),
        ((WRONG,), said(cause("wrong_parameter", "spring", c={"value": 2e4})), "right"),
        ((WRONG,), said(cause("wrong_parameter", "spring", d={"value": 2e4})), "wrong name"),
        ((WRONG,), said(cause("wrong_parameter", "spring", c={"value": 2e4}, d={"value": 1.0})), "wrong name"),
        ((ALIEN,), said(cause("outside_taxonomy"), verdict="unexplained"), "right"),
        ((ALIEN,), said(verdict="unexplained"), "right"),
        ((ALIEN,), said(cause("outside_taxonomy"), cause("backlash", "spring")), "wrong name"),
        ((ALIEN,), said(verdict="no_discrepancy"), "missed"),
        ((), said(verdict="no_discrepancy"), "right"),
        ((), said(cause("coulomb_friction", "damper")), "false alarm"),
        ((), said(verdict="unexplained"), "false alarm"),
        ((), said(verdict="not_identifiable"), "open"),
    ],
)
def test_outcome(effects, diagnosis, outcome):
    row = score.score(truth(*effects), diagnosis, 1.0)
    assert (row["outcome"], row["right"]) == (outcome, outcome == "right")


def sized(kind, where="", confidence=0.9, alternatives=(), **intervals):
    """A cause whose parameters have these 95 % intervals."""
    values = {name: {"value": sum(ends) / 2, "ci95": list(ends)} for name, ends in intervals.items()}
    return cause(kind, where, alternatives, **values) | {"confidence": confidence}


@pytest.mark.parametrize(
    "effects, causes, right",
    [
        ((FRICTION,), [sized("coulomb_friction", "damper")], [True]),
        ((FRICTION,), [sized("coulomb_friction", "damper"), sized("coulomb_friction", "spring")], [True, False]),
        ((FRICTION, LOAD), [sized("backlash", "spring"), sized("constant_force", "body")], [False, True]),
        ((LOAD,), [sized("sensor_bias", "deflection")], [True]),  # it is, whether it tells its equivalent or not
        ((LOAD, LOAD | {"rivals": []}), [sized("constant_force", "body"), sized("sensor_bias", "deflection")], [True, True]),
        ((ALIEN,), [sized("backlash", "spring")], [False]),
        ((), [sized("backlash", "spring")], [False]),
        ((ALIEN,), [sized("outside_taxonomy")], []),
        ((), [], []),
    ],
)
def test_rows_have_the_confidence_and_correctness_of_each_named_cause(effects, causes, right):
    row = score.score(truth(*effects), said(*causes), 1.0)
    assert [c["right"] for c in row["named"]] == right
    assert all(c["confidence"] == 0.9 and c["cause"] for c in row["named"])


@pytest.mark.parametrize(
    "told, nothing",
    [
        (sized("coulomb_friction", "damper", force=(-1.0, 9.0)), True),
        (sized("coulomb_friction", "damper", force=(1.0, 9.0)), False),
        (sized("sensor_scale", "x", scale=(0.98, 1.05)), True),
        (sized("sensor_scale", "x", scale=(-0.1, 0.9)), False),
        (sized("input_gain", "u", gain=(0.7, 1.1)), True),
        (sized("wrong_parameter", c=(1.9e4, 2.3e4)), True),
        (sized("wrong_parameter", c=(2.1e4, 2.3e4)), False),
        (sized("bump_stop", "spring", gap=(-0.1, 0.1), stiffness=(1.0, 2.0)), False),
        (sized("asymmetric_damper", "damper", rebound=(1.0, 3.0), compression=(1.5, 3.5)), True),
        (sized("asymmetric_damper", "damper", rebound=(1.0, 3.0), compression=(4.0, 6.0)), False),
        (cause("coulomb_friction", "damper", force={"value": 3.0}), False),
        (cause("coulomb_friction", "damper"), False),
    ],
)
def test_a_size_may_be_nothing_where_its_interval_holds_the_model_without_it(told, nothing):
    row = score.score(truth(FRICTION), said(told), 1.0, nominal={"c": 2e4})
    assert [c["nothing"] for c in row["named"]] == [nothing]


def test_without_an_answer_every_case_is_wrong():
    assert not score.score(truth(), None, 9.0, "timeout")["right"]


def test_errors_and_intervals_count_for_common_forms_that_are_named_themselves():
    force = {"value": 42.0, "unit": "N", "ci95": [39.0, 45.0]}
    row = score.score(truth(FRICTION), said(cause("coulomb_friction", "damper", force=force)), 1.0)
    assert row["errors"] == [["coulomb_friction.force", pytest.approx(0.05), 0.5]] and row["covered"] == [["coulomb_friction.force", True]]
    narrow = score.score(truth(FRICTION), said(cause("coulomb_friction", "damper", force={**force, "ci95": [41.0, 43.0]})), 1.0)
    assert narrow["covered"] == [["coulomb_friction.force", False]]
    foreign = score.score(truth(FRICTION | {"common": False}), said(cause("coulomb_friction", "damper", force=force)), 1.0)
    rival = score.score(truth(LOAD), said(cause(*BIAS, ["constant_force"], bias=force)), 1.0)
    assert foreign["errors"] == foreign["covered"] == rival["errors"] == []


def test_errors_are_listed_for_effects_above_the_noise_and_for_all():
    def told(value):
        return said(cause("coulomb_friction", "damper", force={"value": value}))

    own = [score.score(truth(FRICTION | {"ratio": ratio}), told(value), 1.0) for ratio, value in ((0.99, 44.0), (1.0, 40.4), (3.0, 40.0))]
    out = score.summary(own)
    assert (out["parameters"]["n"], out["parameters"]["error_95"]) == (3, pytest.approx(0.1))
    assert (out["parameters_above_noise"]["n"], out["parameters_above_noise"]["error_95"]) == (2, pytest.approx(0.01))
    assert "above the noise (2): median error 0.00 % (asked 1 %), 95 % within 1.00 % (asked 6 %)" in score.text(out)


def test_gain_is_measured_against_the_true_noise_floor():
    """Not against the floor that the diagnosis claims."""
    gain = {"a_body": {"before_rmse": 0.08, "after_rmse": 0.021, "noise_floor": 0.021, "share_of_achievable": 1.0}}
    told = said(cause("coulomb_friction", "damper"), gain=gain)
    assert score.score(truth(FRICTION), told, 1.0)["gain"] == {"a_body": pytest.approx([4.0, 1.05])}
    assert score.score(truth(FRICTION), told, 1.0, measured={"a_body": 0.04})["gain"] == {"a_body": pytest.approx([4.0, 2.0])}


@pytest.mark.parametrize("right, n", [(0, 7), (3, 7), (97, 100), (100, 100)])
def test_wilson_interval_is_that_of_scipy(right, n):
    expected = stats.binomtest(right, n).proportion_ci(method="wilson")
    assert score.wilson(right, n) == pytest.approx((expected.low, expected.high), abs=1e-6)  # z has 7 digits


@pytest.mark.parametrize("n, rate, risk", [(24, 0.9, 1e-3), (7, 0.6, 1e-4), (100, 0.998, 1e-3), (5, 0.97, 1.25e-4)])
def test_gate_lets_a_right_program_fail_less_often_than_the_risk(n, rate, risk):
    k = score.allowed_failures([rate] * n, risk)
    assert stats.binom.sf(k, n, 1 - rate) < risk
    assert k == 0 or stats.binom.sf(k - 1, n, 1 - rate) >= risk, "and is as strict as that allows"


def test_gate_of_unlike_cases_is_that_of_the_enumeration():
    """All 2^n outcomes of n cases with their chances, added up."""
    rates, risk = [0.998, 0.97, 0.9, 0.9, 0.85, 0.6], 1e-2
    chance = [0.0] * (len(rates) + 1)
    for right in itertools.product((True, False), repeat=len(rates)):
        chance[right.count(False)] += math.prod(p if r else 1 - p for r, p in zip(right, rates, strict=True))
    k = score.allowed_failures(rates, risk)
    assert sum(chance[k + 1 :]) < risk <= sum(chance[k:])


def rows(stratum, right, n):
    return [
        score.score(
            truth(*([] if "null" in stratum else [FRICTION]), stratum=stratum),
            (
                said(verdict="no_discrepancy")
                if "null" in stratum
                else said(cause("coulomb_friction" if i < right else "backlash", "damper"))
            ),
            float(i),
        )
        for i in range(n)
    ]


def test_gate_names_the_stratum_that_is_too_bad():
    assert score.gate(rows("single_common", 19, 20) + rows("null", 20, 20)) == {"single_common": "", "null": "", "all": ""}
    found = score.gate(rows("single_common", 10, 20) + rows("null", 20, 20))
    assert found["single_common"] == "single_common: 10 of 20 wrong, at most 4 can be chance"
    assert found["null"] == "" and found["all"].startswith("all: 10 of 40 wrong")


def test_gate_leaves_out_groups_that_cannot_fail():
    """One case of a stratum may be wrong by chance; three of three may not."""
    few = [{**row, "right": False} for stratum in ("single_common", "single_foreign", "null") for row in rows(stratum, 1, 1)]
    assert score.gate([few[0], few[1], *rows("null", 1, 1)]) == {"all": ""}
    assert score.gate(few) == {"all": "all: 3 of 3 wrong, at most 2 can be chance"}


def test_a_forked_command_ends_as_one_that_was_started(tmp_path):
    (tmp_path / "model.toml").write_text("no model")
    started, forked = (
        campaign.diagnose(command, tmp_path, [tmp_path / "a.csv", tmp_path / "b.csv"], 60.0, start)
        for command, start in ((f"{sys.executable} -m penode_sil diagnose", campaign.started), ("penode diagnose", campaign.forked))
    )
    assert started[0] is forked[0] is None and started[2] == forked[2] and started[2].startswith("exit 2: penode: ")
    assert campaign.diagnose("penode diagnose", tmp_path, [tmp_path / "a.csv"], 1e-3, campaign.forked)[2] == "timeout"


def test_tables_add_up():
    out = score.summary(rows("single_common", 18, 20) + rows("null", 10, 10))
    assert out["strata"]["single_common"]["right"] == 18 and out["strata"]["null"]["share"] == 1.0
    assert out["kinds"]["coulomb_friction"]["single_common"]["instead"] == {"backlash at damper": 2}
    assert out["confusion"] == {"coulomb_friction": {"coulomb_friction": 18, "backlash": 2}, "nothing": {"no_discrepancy": 10}}
    assert [line.split() for line in score.confusion(out).splitlines()[1:]] == [
        ["1", "coulomb_friction", "18", ".", "2", "."],
        ["2", "nothing", ".", ".", ".", "10"],
        ["3", "backlash"],
        ["4", "no_discrepancy"],
    ]
    assert (out["time"]["longest"], out["time"]["q90"]) == (19.0, 16.0)
    first = [{**row, "compiling": 0.25} for row in rows("null", 10, 10)]  # time of compilers is listed apart
    assert score.summary(first)["time"] == {"median": 3.75, "q90": 7.75, "longest": 8.75, "compiling": 0.25}
    assert "18 of 20" in score.text(out) and "2x backlash at damper" in score.text(out)


ANSWERS = {
    "honest": 'json.dump({"verdict": "no_discrepancy", "causes": []}, open(out / "diagnosis.json", "w"))',
    "crash": 'sys.exit("penode: train_1.csv: too short")',
    "silent": "pass",
    "slow": "time.sleep(60)",
}


@pytest.mark.parametrize(
    "answer, outcome",
    [("honest", "right"), ("crash", "exit 1: penode: train_1.csv: too short"), ("silent", "no diagnosis"), ("slow", "timeout")],
)
def test_campaign_runs_a_command_and_survives_it(tmp_path, answer, outcome):
    script = tmp_path / "explain.py"
    script.write_text(
        "import json, pathlib, sys, time\nout = pathlib.Path(sys.argv[sys.argv.index('-o') + 1])\n"
        "assert pathlib.Path(sys.argv[1]).name == 'model.toml' and not list(pathlib.Path(sys.argv[1]).parent.glob('*truth*'))\n"
        f"out.mkdir()\n{ANSWERS[answer]}\n"
    )
    (row,) = campaign.run(1, 1, {"mine": f"{sys.executable} {script}"}, "", 5.0 if answer != "slow" else 0.5, tmp_path / "out", keep=True)
    assert row["stratum"] == "null" and (row["why"] or row["outcome"]).startswith(outcome)
    assert json.loads((tmp_path / "out" / "truth" / "1-1.json").read_text())["effects"] == []


def test_campaign_that_is_stopped_has_tables_of_finished_cases(tmp_path):
    """As soon as one of four cases is; the second never ends by itself."""
    mark, script, page = tmp_path / "second", tmp_path / "explain.py", tmp_path / "page.md"
    script.write_text(
        "import json, pathlib, sys, time\nout = pathlib.Path(sys.argv[sys.argv.index('-o') + 1])\n"
        f"if '-9/' in sys.argv[1]:\n    pathlib.Path({str(mark)!r}).touch()\n    time.sleep(600)\n"
        f"out.mkdir()\n{ANSWERS['honest']}\n"
    )
    call = [sys.executable, campaign.__file__, "--strata", "null", "--cases", "4", "--seed", "1", "--out", tmp_path / "out", "--page", page]
    running = subprocess.Popen(
        [*map(str, call), "--timeout", "5", "--command", f"{sys.executable} {script}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    while not mark.exists():
        assert running.poll() is None
        time.sleep(0.1)
    running.terminate()
    assert running.wait(60) == 0
    assert page.read_text().startswith("# Campaign of 1 cases, the first of 4, seed 1\n")


def test_extended_model_is_simulated_again(tmp_path):
    """The simulation here answers with the recording and an error of 0.5 in one signal."""
    recording = tmp_path / "holdout_1.csv"
    recording.write_text("time [s],z_road [m],a_body [m/s^2],deflection [m]\n0,0,1,2\n0.001,0,1,2\n")
    (tmp_path / "model_extended.toml").touch()
    script = tmp_path / "simulate.py"
    script.write_text(
        "import sys\nopen(sys.argv[5], 'w').write('time [s],deflection [m],a_body [m/s^2],z_b [m]\\n0,2,1.5,0\\n0.001,2,0.5,0\\n')\n"
    )
    found = campaign.simulated(f"{sys.executable} {script}", tmp_path / "model_extended.toml", recording)
    assert found["a_body"] == pytest.approx(0.5) and found["deflection"] == 0.0 and "z_b" not in found
    assert campaign.simulated(f"{sys.executable} -c 1/0", tmp_path / "model_extended.toml", recording) == {}
    assert campaign.simulated("true", tmp_path / "no_model.toml", recording) == {}


def test_the_floor_is_asked_of_rightly_named_cases():
    """Not of cases where a faint effect was rightly left without a name, nor of effects outside of the list."""
    gain = {"a_body": {"before_rmse": 0.05, "after_rmse": 0.05}}
    right = score.score(
        truth(FRICTION), said(cause("coulomb_friction", "damper"), gain={"a_body": {"before_rmse": 0.05, "after_rmse": 0.02}}), 1.0
    )
    faint = score.score(truth(FRICTION | {"energy": 40.0}), said(verdict="not_identifiable", gain=gain), 1.0)
    alien = score.score(truth(ALIEN, stratum="outside"), said(verdict="unexplained", gain=gain), 1.0)
    assert all(row["right"] for row in (right, faint, alien))
    found = score.summary([right, faint, alien])["gain"]
    assert (found["n"], found["within_5_percent_of_floor"]) == (1, 1.0)


def test_a_time_by_itself_counts_where_there_is_one():
    rows = [score.score(truth(FRICTION), said(cause("coulomb_friction", "damper")), seconds) for seconds in (12.0, 7.0)]
    rows[0]["alone"] = 9.0
    assert score.summary(rows)["time"]["longest"] == 9.0


def test_a_draw_that_was_stopped_goes_on(tmp_path):
    """With its own seed, and only the cases that are left; not by another command."""
    call = [sys.executable, campaign.__file__, "--brief", "--strata", "null", "--out", tmp_path]

    def run(*more: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run([*call, *more], capture_output=True, text=True)

    first = run("--cases", "1", "--command", "false")
    again = run("--cases", "2", "--command", "false", "--resume")
    head, *rows = (tmp_path / "rows.jsonl").read_text().splitlines()
    seed = json.loads(head)["seed"]
    assert first.stdout.startswith(f"1 cases, seed {seed}\n")
    assert again.stdout.startswith(f"2 cases, seed {seed}\n1 of them are through\n")
    assert [json.loads(r)["case"] for r in rows] == [f"{seed}:1", f"{seed}:9"]
    assert "# Campaign of 2 cases" in (tmp_path / "campaign.md").read_text()
    timed = run("--cases", "2", "--command", "false", "--resume", "--alone", "-1")
    _, *rows = map(json.loads, (tmp_path / "rows.jsonl").read_text().splitlines())
    assert timed.returncode == 0 and [r["case"] for r in rows] == [f"{seed}:{i}" for i in (1, 9, 1, 9)]
    assert ["alone" in r for r in rows] == [False, False, True, True]
    assert run("--cases", "2", "--command", "false", "--resume", "--alone", "-1").stdout.count("through") == 1
    assert "# Campaign of 2 cases" in (page := (tmp_path / "campaign.md").read_text()) and "Of the 2 cases" in page
    assert len((tmp_path / "rows.jsonl").read_text().splitlines()) == 5  # none is timed a third time
    other = run("--cases", "2", "--command", "true", "--resume")
    assert other.returncode == 2 and f"seed {seed}; remove it, or leave --resume out" in other.stderr


def test_two_diagnoses_of_the_same_cases():
    """Exact McNemar by hand: of six cases that one of two has right, all six lost is 2/2^6; as many won as lost is chance."""
    cases = [f"1:{i}" for i in range(8)]
    right, wrong = dict.fromkeys(cases, True), dict.fromkeys(cases, True) | dict.fromkeys(cases[:6], False)
    assert frozen.mcnemar(right, wrong) == (cases[:6], [], 2 / 2**6)
    even = dict.fromkeys(cases, True) | {cases[0]: False}
    assert frozen.mcnemar(even, even | {cases[0]: True, cases[1]: False}) == ([cases[1]], [cases[0]], 1.0)
    assert frozen.mcnemar(right, right) == ([], [], 1.0)


def test_rows_of_single_cases_are_compared_with_the_frozen_draw(tmp_path, capsys):
    """A campaign that runs single cases again has a seed of its own in its head; those of its cases count."""
    draw = json.loads((frozen.HERE / "frozen.json").read_text())
    rows = [{"seed": 1, "code": "now"}, *({"case": f"{draw['seed']}:{i}", "right": draw["right"][i]} for i in ("35", "36"))]
    (tmp_path / "rows.jsonl").write_text("".join(json.dumps(r) + "\n" for r in rows))
    assert frozen.main([str(tmp_path / "rows.jsonl")]) == 0 and "lost none; won none" in capsys.readouterr().out
    (tmp_path / "rows.jsonl").write_text(json.dumps(rows[0]) + "\n" + json.dumps({"case": "1:35", "right": True}) + "\n")
    assert frozen.main([str(tmp_path / "rows.jsonl")]) == 2 and f"--seed {draw['seed']}" in capsys.readouterr().err
