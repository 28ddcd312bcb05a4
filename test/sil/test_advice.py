# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What to do next, and which explanations are left, of diagnoses written by hand."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from penode_sil.diagnosis.advice import advice, doubts, likely
from penode_sil.diagnosis.catalogue import MEANING, OTHERWISE, RIVALS, separating
from penode_sil.diagnosis.report.words import headline
from penode_sil.diagnosis.result import OUTSIDE, Cause, Diagnosis, Gain, Named, Recorded, Value
from penode_sil.diagnosis.terminal import sentences

RUB, PEAK, LOOP = (Named(kind, "damper") for kind in ("coulomb_friction", "stribeck_friction", "bouc_wen"))
GAIN = {"a": Gain(0.1, 0.02, 0.02, 1.0, "m/s^2", 0.0)}
CAR = SimpleNamespace(name="car")


def cause(kind="coulomb_friction", where="damper", confidence=0.9, alternatives=()):
    c = Cause(kind, where, {"force": Value(40.0, "N", (38.0, 42.0))}, confidence, tuple(alternatives))
    return replace(c, separate=separating(kind, [a.kind for a in alternatives]))


def said(verdict="explained", *causes, posteriors=None, gain=GAIN, notes=(), residual=None, explained=0.99, data=(), **more):
    sets = tuple({"causes": [{"kind": n.kind, "where": n.where}], "posterior": p} for n, p in (posteriors or {}).items())
    d = Diagnosis(verdict, causes, gain, {}, explained, 512.0, 0.0, tuple(notes), data, residual or {}, explanations=sets, **more)
    return replace(d, advice=advice(d))


def screen(d):
    lines = sentences(CAR, d, Path("out")).splitlines()
    assert len(lines) <= 24 and all(len(x) <= 80 for x in lines)
    return " ".join(" ".join(lines).split())


@pytest.mark.parametrize(
    "posteriors, left",
    [
        ({}, []),
        ({RUB: 0.96, PEAK: 0.04}, [RUB]),
        ({RUB: 0.6, PEAK: 0.4}, [RUB, PEAK]),
        ({RUB: 0.3, PEAK: 0.5, LOOP: 0.15}, [PEAK, RUB, LOOP]),  # 80 of 95 without the last
        ({RUB: 0.6, PEAK: 0.38, LOOP: 0.02}, [RUB, PEAK]),
        ({RUB: 0.0}, [RUB]),
    ],
)
def test_sets_that_hold_95_percent_are_left(posteriors, left):
    assert [x["causes"] for x in likely(said(posteriors=posteriors))] == [[{"kind": n.kind, "where": n.where}] for n in left]


def test_what_the_data_do_not_tell_is_said_with_what_would():
    d = said("explained", cause(confidence=0.6, alternatives=(PEAK, LOOP)), posteriors={RUB: 0.6, PEAK: 0.38, LOOP: 0.02})
    (found,) = doubts(d)
    assert found.others == ((PEAK, 0.38),) and str(found) == "Stribeck friction at damper (38%)"
    assert found.how.startswith("slow motion with many reversals") and "strokes" not in found.how  # that would tell a Bouc-Wen loop
    assert d.advice[0] == f"tell Coulomb friction at damper from Stribeck friction at damper: {found.how}"
    assert "or Stribeck friction at damper (38%): the recordings do not tell which" in screen(d)


def test_what_is_the_same_in_all_sets_is_not_told_either():
    """A load and an offset that do the same to all sensors: no set of explanations has the second, for nothing could weigh it."""
    offset = Named("input_offset", "u")
    d = said("explained", cause("constant_force", "body", alternatives=(offset,)), posteriors={RUB: 0.99})
    assert [x.others for x in doubts(d)] == [((offset, None),)]
    assert "or input offset at u: the recordings do not tell which" in screen(d)
    assert (
        d.advice[0]
        == "tell constant force at body from input offset at u: switch the actuator off: a load remains, an offset of the input does not"
    )


def test_what_is_told_has_no_rivals():
    d = said("explained", cause(confidence=0.98, alternatives=(PEAK,)), posteriors={RUB: 0.98, PEAK: 0.02})
    assert doubts(d) == [] and "do not tell" not in screen(d) and "Stribeck" not in screen(d)


def test_pairs_of_the_catalogue_are_of_its_kinds():
    assert all(pair <= set(MEANING) and how for pair, how in RIVALS.items())
    assert separating("coulomb_friction", []) == "" and separating("coulomb_friction", ["tyre_damping", "backlash"]) == OTHERWISE


@pytest.mark.parametrize(
    "d, parts",
    [
        (said("no_discrepancy", gain={}), ["keep the model", "hold out a recording"]),
        (said("no_discrepancy"), ["use model_extended.toml: it is the model as fitted"]),  # the file only guessed, and missed the hold-out
        (said("not_identifiable"), ["record again with more excitation"]),
        (said("explained", cause()), ["use model_extended.toml"]),
        (said("explained", cause(), gain={}), ["use model_extended.toml", "--holdout"]),
        (
            said("partly_explained", cause(), model_file="model_rejected.toml"),
            ["keep the nominal model: model_rejected.toml predicts worse"],
        ),
        (
            said("explained", cause(), gain={"a": replace(GAIN["a"], outside=0.3)}),
            ["use model_extended.toml", "30% of its samples go beyond"],
        ),
        (said("explained", cause("sensor_scale", "a")), ["check a: the sensor is at fault"]),
        (said("explained", cause("sensor_scale", "a"), cause()), ["check a: the sensor is at fault", "use model_extended.toml"]),
        (said("explained", cause("input_delay", "u")), ["check actuator and channel of u", "use model_extended.toml"]),
        (said("explained", cause("sensor_sign", "a")), ["correct the sign of a in the recordings"]),
        (
            said("explained", cause("swapped_channels", "a,b"), cause()),
            ["exchange a and b (--channel a=b --channel b=a)", "use model_extended"],
        ),
        (said("partly_explained", cause(), explained=0.7), ["use model_extended.toml", "look for the rest: 30%"]),
        (said("unexplained", Cause(OUTSIDE, "", {}, 0.5)), ["compare signals"]),
        (
            said("unexplained", residual={"places": [{"place": "spring", "share": 0.9}, {"place": "tyre", "share": 0.4}]}),
            ["look at spring first"],
        ),
    ],
)
def test_advice_for_each_verdict(d, parts):
    assert len(d.advice) == len(parts) and all(part in text for part, text in zip(parts, d.advice, strict=True)), d.advice
    text = screen(d)
    assert all(part in text for part in parts)


def test_the_first_line_advises_whether_to_keep_the_nominal_model():
    kept = said("partly_explained", cause(), model_file="model_rejected.toml")
    assert screen(kept).startswith("car: keep the nominal model; partly explained")
    assert headline(kept).startswith("Keep the nominal model: ") and not headline(said("explained", cause())).startswith("Keep")


def test_what_has_no_name_has_no_confidence_on_the_screen():
    text = screen(said("unexplained", Cause(OUTSIDE, "", {}, 0.11), explained=0.8))
    assert "confidence" not in text and "explained," not in text and "512 standard deviations" in text


def test_a_full_screen_states_how_many_more_lines_the_report_has():
    """Advice goes before notes; each note is whole, or counted."""
    notes = tuple(f"{word} " * 40 + "end" for word in ("one", "two", "three", "four", "five", "six"))
    text = screen(said("explained", cause(), notes=notes, data=(Recorded("a.csv", "training", 9, 1.0, ("x: 2 samples are missing",)),)))
    shown = [word for word in ("one", "two", "three", "four", "five", "six") if f"note: {word} {word}" in text]
    assert text.index("next: ") < text.index("note: ") and text.count(" end") == len(shown) < 6
    assert f"{7 - len(shown)} more in the report" in text


def test_a_full_screen_still_has_the_first_advice():
    many = tuple(cause("coulomb_friction", f"damper_{k}") for k in range(20))
    text = screen(said("explained", *many, notes=("a note",)))
    assert "next: use model_extended.toml" in text and "more in the report" in text
