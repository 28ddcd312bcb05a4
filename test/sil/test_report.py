# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The report: one page by itself, with the facts of diagnosis.json, readable in both colour schemes."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from typing import ClassVar

import numpy as np
import pytest
from click.testing import CliRunner
from test_diagnosis import MODEL, SAMPLES, STEP, drive, record, road

import penode_gen
from penode_sil import building
from penode_sil.cli import cli
from penode_sil.diagnosis import advice, catalogue, files, reliability, report, result, terminal
from penode_sil.diagnosis.report import changes, figure as fig, panels
from penode_sil.diagnosis.study import noise, residual, restoring

RECORDING = "track <2> & more.csv"  # a name that HTML has to escape
EXTENDED = """# Extension of car.toml from recordings: coulomb_friction at damper.

[model]
extends = "car.toml"
name = "car_extended"

[parameters]
d = { value = 1490.0, unit = "N*s/m", tolerance = 0.01 }
f_c = { value = 61.3, unit = "N" }
v_c = { value = 0.004, unit = "m/s" }

[elements]
coulomb_friction = { between = ["body", "wheel"], law = "coulomb_friction", force = "f_c", transition = "v_c" }
"""


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "car.toml"
    path.write_text(MODEL)
    return penode_gen.load(path)


@pytest.fixture(scope="module")
def extended(model):
    path = model.path.with_name("model_extended.toml")
    path.write_text(EXTENDED)
    return path


@pytest.fixture(scope="module")
def found(model):
    """A diagnosis written down by hand, with signals of which before, after and noise are known."""
    rng = np.random.default_rng(1)
    n = 3000
    time = np.arange(n) * STEP
    sigma = np.array([0.02, 0.1, 1e-4])
    u, noisy = rng.standard_normal((n, 1)), sigma * rng.standard_normal((n, 3))
    signal = 30.0 * sigma * np.sin(2.0 * np.pi * 1.3 * time)[:, None]
    wrong = 5.0 * sigma * np.sin(2.0 * np.pi * 4.0 * time)[:, None]
    good = np.ones((n, 3), bool)
    e = noise.prepare(RECORDING, time, u, signal + wrong + noisy, good, np.zeros(1), [None] * 3)
    floor = e.frequencies, np.tile(sigma**2, (len(e.frequencies), 1))
    train = residual.channels(e, model, signal, signal + wrong, floor)
    held = residual.channels(e, model, signal, signal + wrong, floor, time > 5.0)
    s, v = 0.02 * rng.standard_normal((2, n))
    edges = (np.linspace(-0.06, 0.06, restoring.BINS + 1),) * 2
    surface = restoring.Surface(
        "spring", ("spring", "damper"), s, v, 22e3 * s + 60.0 * np.sign(v), 22e3 * s, 22e3 * s + 61.3 * np.tanh(v / 4e-3), edges
    )
    shown = residual.Shown(tuple(train), tuple(held), (surface,))
    cause = result.Cause(
        "coulomb_friction", "damper", {"force": result.Value(61.3, "N", (59.8, 62.9))}, 0.87, (result.Named("stribeck_friction", "damper"),)
    )
    cause = replace(cause, separate=catalogue.separating("coulomb_friction", ["stribeck_friction"]))
    gain = {
        "a_body": result.Gain(0.104, 0.0203, 0.02, 0.9964, "m/s^2", 0.31, (0.97, 1.02)),
        "a_wheel": result.Gain(0.1, 0.1, 0.1, None, "m/s^2", 0.31),
    }
    data = (result.Recorded(RECORDING, "training", n, 6.0, ("deflection: 12 samples are missing",)),)
    numerics = {"a_body": {"rms_error": 1.25e-3, "unit": "m/s^2", "share_of_signal": 0.0021}}
    notes = (f"{RECORDING}: 31.0% of the samples move farther or faster than in training",)
    known = {
        "source": "100 cases of seed 7",
        "cases": 100,
        "deciles": [{"from": 0.8, "to": 0.9, "named": 60, "right": 51, "ci95": [0.739, 0.92]}],
    }
    sets = tuple(
        {"causes": [{"kind": f"{k}_friction", "where": "damper"}], "posterior": p} for k, p in (("coulomb", 0.87), ("stribeck", 0.13))
    )
    d = result.Diagnosis(
        verdict="explained",
        causes=(cause,),
        gain=gain,
        numerics=numerics,
        explained=0.991,
        evidence=512.0,
        alike=0.0,
        notes=notes,
        data=data,
        residual=shown.numbers(),
        seconds=7.5,
        shown=shown,
        explanations=sets,
        reliability=known,
    )
    return replace(d, advice=advice.advice(d))


@pytest.fixture(scope="module")
def page(model, found, extended):
    return report.render(model, found, extended)


class Tree(HTMLParser):
    """Tags that HTML demands to be closed must be, in order; keeps text, ids and attributes."""

    FREE: ClassVar = {"meta", "br", "tr", "td", "th", "dt", "dd", "p", "html", "head", "body"}  # closed by what follows, or never

    def __init__(self, text: str):
        super().__init__()
        self.open, self.ids, self.tags, self.text, self.problems = [], [], [], [], []
        self.feed(text)
        self.close()
        self.problems += [f"{tag} is not closed" for tag in self.open]

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        self.ids += [v for k, v in attributes if k == "id"]
        if tag not in self.FREE:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        if tag not in self.FREE and (not self.open or self.open.pop() != tag):
            self.problems.append(f"</{tag}> at {self.getpos()}")

    def handle_data(self, data):
        if not self.open or self.open[-1] not in ("style", "script"):
            self.text.append(data)

    def of(self, tag: str) -> list[dict[str, str]]:
        return [a for t, a in self.tags if t == tag]


@pytest.fixture(scope="module")
def tree(page):
    return Tree(page)


def test_page_needs_nothing_else(page, tree):
    assert "://" not in page and "@import" not in page and "url(" not in page
    assert not any(k in a for _, a in tree.tags for k in ("src", "srcset", "action", "data"))
    assert not tree.of("link") and not tree.of("img") and not tree.of("iframe") and not tree.of("object")
    links = [a["href"] for a in tree.of("a")]
    assert links and all(h[0] == "#" and h[1:] in tree.ids for h in links)
    assert len(page.encode()) < 1_000_000


def test_page_is_sound_html(tree):
    assert not tree.problems
    assert len(set(tree.ids)) == len(tree.ids)
    assert tree.of("html")[0]["lang"] == "en" and len(tree.of("h1")) == 1


def test_page_has_the_results_of_the_diagnosis(found, tree):
    text = " ".join(" ".join(tree.text).split())
    for fact in (
        "Coulomb friction at damper explains what the model gets wrong",
        *("61.3 N", "59.8 … 62.9 N", "± 2.5 %", "Confidence 87 %"),
        *("Stribeck friction at damper", found.causes[0].separate),
        (
            "Of causes named with 80 to 90 % confidence in simulated cases, 51 of 60 were right (85 %, "
            "95 % interval 74 to 92 %); source: 100 cases of seed 7."
        ),
        *("The recordings do not tell these apart", "Coulomb friction at damper (87 %) or Stribeck friction at damper (13 %)"),
        *("the recordings do not rule out others.", "Tell Coulomb friction at damper from Stribeck friction at damper: slow motion"),
        "0.104 → 0.0203 m/s² RMS of a_body; noise 0.02 m/s², 99.6 % of what can be gained",
        *("0.104 m/s²", "0.0203 m/s²", "99.6 %", "97 % … 102 %", "nothing to gain", "31.0% of the samples"),
        *("512 σ", "deflection: 12 samples are missing", RECORDING, "0.00125 m/s²", "0.2 %"),
    ):
        assert fact in text, fact
    for s, c in zip(found.residual["signals"], found.shown.train, strict=True):
        level = residual.rms(c.before.values)
        assert level == pytest.approx(s["before_rms"], rel=1e-4)  # five digits are in the file
        assert report.value(level, c.unit) in text and report.percent(s["share_of_signal"]) in text
    worst = report.ordered(found.shown.train)[0]
    assert f"half of it near {worst.f[np.argmin(np.abs(worst.f - 4.0))]:.2g} Hz" in text  # where `wrong` was put


def test_page_is_the_same_every_time(model, found, page, extended):
    assert report.render(model, found, extended) == page


def test_figures_have_titles_units_and_words(tree, page):
    figures = tree.of("figure")
    panels = 2 * 3  # sensors, in training and on hold-out
    assert len(figures) == 4 * panels + 6 == page.count("<figcaption>") and len(tree.of("title")) > 1
    assert all(len(f["data-x"].split()) == 3 and "|" in f["data-units"] for f in figures)
    plots = [a for a in tree.of("svg") if a.get("class") == "plot"]
    assert len(plots) == len(figures) and all(a["role"] == "img" and " over " in a["aria-label"] for a in plots)
    for axis in ("residual in", "time in s", "frequency in Hz", "coherence", "deflection in mm", "rate in m/s", "force in N"):
        assert axis in page


def test_values_can_be_read_back_from_paths(found):
    """Half of a unit of the box is what rounding to it may cost."""
    c = found.shown.train[0]
    f = panels.over_time(c, 10_000)
    line = next(m for m in f.marks if m.name == "before")
    x, y = [], []
    for part in line.path.split("M")[1:]:
        n = [int(k) for k in re.findall(r"-?\d+", part)]
        x += list(np.cumsum([n[0], *n[2::2]]))
        y += list(np.cumsum([n[1], *n[3::2]]))
    factor = (f.y.unit.startswith("µ") and 1e6) or (f.y.unit == "mm" and 1e3) or 1.0
    low, high = f.y.low, f.y.high
    assert np.allclose(np.array(x) / fig.WIDE * f.x.high, c.time, atol=0.51 / fig.WIDE * f.x.high)
    assert np.allclose(high - np.array(y) / fig.HIGH * (high - low), factor * c.before.values, atol=0.51 / fig.HIGH * (high - low))


def luminance(colour: str) -> float:
    """Relative luminance of #rrggbb by WCAG 2."""
    parts = [int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def schemes(page: str) -> dict[str, dict[str, str]]:
    roots = re.findall(r"(@media screen and \(prefers-color-scheme: dark\) \{\s*)?:root \{(.*?)\}", page, re.S)
    return {"dark" if media else "light": dict(re.findall(r"--(\w+): (#[0-9a-f]{6})", body)) for media, body in roots}


def test_both_colour_schemes_can_be_read(page):
    found = schemes(page)
    assert set(found) == {"light", "dark"} and set(found["light"]) == set(found["dark"])
    used = set(re.findall(r"var\(--(\w+)\)", page))
    assert used == set(found["light"])  # each is there, none is left over
    for name, colours in found.items():
        pairs = [
            (ink, ground)
            for ink in ("ink", "faint", "before", "after", "noise", "plus", "minus", "good", "bad")
            for ground in ("paper", "card")
        ]
        for ink, ground in [*pairs, ("ink", "add"), ("ink", "drop")]:
            high, low = sorted((luminance(colours[ink]), luminance(colours[ground])), reverse=True)
            assert (high + 0.05) / (low + 0.05) >= 4.5, (name, ink, ground)
    assert luminance(found["light"]["paper"]) > 0.8 and luminance(found["dark"]["paper"]) < 0.05


def test_difference_shows_what_was_learnt(model, extended):
    got = changes.difference(model.path, extended)
    assert ("-", 'd = { value = 1500.0, unit = "N*s/m", tolerance = 0.01 }') in got
    at = got.index(("+", 'd = { value = 1490.0, unit = "N*s/m", tolerance = 0.01 }'))
    assert got[at - 1][0] == "-" and got[at + 1] == ("+", 'f_c = { value = 61.3, unit = "N" }')
    assert (" ", "[elements]") in got and all(sign == " " for sign, text in got if "name" in text or "extends" in text)


def test_price_is_left_out_without_a_compiler(model, found, monkeypatch, extended):
    monkeypatch.setattr(changes.shutil, "which", lambda name: None)
    assert changes.price(model, extended) == []
    assert "What it costs" not in report.render(model, found, extended)


def test_notes_are_there_without_a_hold_out(model, found, extended):
    text = " ".join(Tree(report.render(model, replace(found, gain={}, notes=("a long note " * 60 + "to its end",)), extended)).text)
    assert "a long note" in text and "note to its end." in text and "not measured" in text


def test_other_verdicts_have_a_page_too(model, found, extended):
    quiet = replace(found, verdict="no_discrepancy", causes=(), gain={}, notes=())
    for verdict, causes in (
        ("no_discrepancy", ()),
        ("not_identifiable", ()),
        ("unexplained", (result.Cause("outside_taxonomy", "", {}, 0.5),)),
    ):
        shown = residual.Shown(tuple(replace(c, after=None) for c in found.shown.train), (), ())
        text = report.render(model, replace(quiet, verdict=verdict, causes=causes, shown=shown), extended)
        assert not Tree(text).problems and report.headline(replace(quiet, verdict=verdict, causes=causes)) in text


def test_summary_fits_one_screen(model, found, tmp_path):
    many = replace(found, causes=found.causes * 9, notes=("a long note " * 20,) * 5)
    for d in (found, many):
        lines = terminal.sentences(model, d, tmp_path).splitlines()
        assert len(lines) <= 24 and all(len(line) <= 80 or "report.html" in line for line in lines)
        assert "explained" in lines[0] and lines[-1].endswith("report.html")
    text = terminal.sentences(model, found, tmp_path)
    assert (
        "or Stribeck friction at damper (13%): the recordings do not tell which" in text
        and "next: tell Coulomb friction at damper from Str" in text
    )
    assert "61.3 N" in text and "[59.8, 62.9]" in text and "Stribeck friction at damper" in text and "0.0203" in text


def test_command_writes_all_and_is_silent_in_a_pipe(tmp_path, monkeypatch):
    table = {
        "source": "100 cases of seed 7",
        "cases": 100,
        "deciles": [{"from": 0.9, "to": 1.0, "named": 60, "right": 51, "ci95": [0.74, 0.92]}],
        "trust": [{"explained": 0.0, "named": 60, "right": 56, "share": 0.95}],
    }
    (tmp_path / "table.json").write_text(json.dumps(table))
    monkeypatch.setattr(reliability, "TABLE", tmp_path / "table.json")
    (tmp_path / "car.toml").write_text(MODEL)
    z = road(21)
    files = [
        record(tmp_path / f"{name}.csv", height, drive(height, lambda s, v: 60.0 * np.tanh(v / 4e-3)), seed)
        for name, height, seed in (("a", z, 22), ("b", 0.9 * z, 23))
    ]
    call = [
        "diagnose",
        str(tmp_path / "car.toml"),
        "--data",
        str(files[0]),
        "--holdout",
        str(files[1]),
        "-o",
        str(tmp_path / "d"),
        "--json",
    ]
    done = CliRunner().invoke(cli, call)
    assert done.exit_code == 0 and done.stderr == ""
    written = json.loads((tmp_path / "d" / "diagnosis.json").read_text())
    assert json.loads(done.stdout) == written and written["causes"][0]["kind"] == "coulomb_friction"
    assert written["advice"] and written["reliability"] == {**table, "trust": 0.95}
    assert {"verdict", "causes", "gain", "numerics", "residual", "data"} <= set(written) and "shown" not in written
    text = (tmp_path / "d" / "report.html").read_text(encoding="utf-8")
    tree = Tree(text)
    assert not tree.problems and "://" not in text
    assert report.value(written["causes"][0]["parameters"]["force"]["value"], "N") in "".join(tree.text)
    place = written["residual"]["state_space"][0]
    assert (
        place["after_rms"] < place["before_rms"]
        and written["residual"]["signals"][0]["after_rms"] <= written["residual"]["signals"][0]["before_rms"]
    )
    assert pytest.approx(written["data"][0]["seconds"], abs=2 * STEP) == SAMPLES * STEP


def test_price_is_compiled_once(model, monkeypatch, extended):
    first = changes.price(model, extended)

    def refuse(*_):
        raise AssertionError("compiled again")

    monkeypatch.setattr(building, "compile_program", refuse)
    assert first and changes.price(model, extended) == first


def test_what_compilers_take_for_the_report_counts_as_well(model, found, monkeypatch, tmp_path):
    done = []
    monkeypatch.setattr(files, "load_model", lambda job: model)
    monkeypatch.setattr(files, "load", lambda *_: [])
    monkeypatch.setattr(files, "diagnose", lambda *_: found)
    monkeypatch.setattr(files.report, "write", lambda *_: done.append("report"))
    monkeypatch.setattr(files, "compilers", lambda: 5.5 if done else 2.0)
    files.run(files.Job(model.path, (), (), tmp_path))
    assert json.loads((tmp_path / "diagnosis.json").read_text())["compile_seconds"] == 3.5
