# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A folder of recordings: one answer each, one table; the same from one process, several, and a Dask cluster."""

from __future__ import annotations

import csv
import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from dying import dying
from samples import sample

from penode_sil.cli import main
from penode_sil.diagnosis import folder, table
from penode_sil.diagnosis.files import Job
from penode_sil.errors import UserError

C, D, FORCE = 20e3, 1500.0, 60.0
MODEL = f"""
[model]
name = "rig"
sample_time = "2 ms"
[parameters]
c = {{ value = {C}, unit = "N/m", tolerance = 0.02 }}
d = {{ value = {D}, unit = "N*s/m", tolerance = 0.02 }}
[inputs]
x = {{ unit = "m" }}
[elements]
spring = {{ between = ["x", "ground"], law = "linear_spring", stiffness = "c" }}
damper = {{ between = ["x", "ground"], law = "linear_damper", damping = "d" }}
[outputs]
force = {{ value = "F_spring + F_damper", unit = "N" }}
[sensors]
force = {{ value = "F_spring + F_damper", unit = "N", noise = 2 }}
"""
T = np.arange(2500) * 2e-3


def record(path: Path, seed: int, friction: float) -> Path:
    """Twelve harmonics of way x from rest, the force of spring, damper and friction, noise of 2 N."""
    rng = np.random.default_rng(seed)
    f = rng.uniform(0.3, 6.0, 12)[:, None]
    a, w, phase = 0.004 / f**0.7, 2.0 * np.pi * f, 2.0 * np.pi * f * T + rng.uniform(0.0, 2.0 * np.pi, 12)[:, None]
    x, v, t = np.sum(a * np.sin(phase), axis=0), np.sum(a * w * np.cos(phase), axis=0), np.minimum(T, 1.0)
    x, v = (3.0 - 2.0 * t) * t**2 * x, (3.0 - 2.0 * t) * t**2 * v + 6.0 * t * (1.0 - t) * x
    force = C * x + D * v + friction * np.tanh(v / 3e-3) + 2.0 * rng.standard_normal(T.size)
    np.savetxt(path, np.stack([T, x, force], axis=1), delimiter=",", header="time [s],x [m],force [N]", comments="", fmt="%.9g")
    return path


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """model.toml and data/: a recording with friction, a sound one, and a file that is none."""
    place = tmp_path_factory.mktemp("folder")
    (place / "model.toml").write_text(MODEL)
    (place / "data").mkdir()
    record(place / "data" / "a friction.csv", 1, FORCE)
    (place / "data" / "b broken.MF4").write_bytes(b"MDF     4.10\0" + bytes(40))
    record(place / "data" / "c sound.csv", 2, 0.0)
    (place / "data" / "notes.txt").write_text("no recording")
    (place / "data" / ".d.csv").write_text("")
    return place


def job(place: Path, output: Path, **changes) -> Job:
    return Job(place / "model.toml", **{"data": (place / "data",), "holdout": (), "output": output} | changes)


def results(rows) -> list:
    """All that two runs must have in common: everything but the time it took."""
    return [(r.recording, r.folder, r.source, r.error, {**(r.diagnosis or {}), "seconds": None}) for r in rows]


@pytest.fixture(scope="module")
def alone(place, tmp_path_factory):
    """The rows of one process, and where they are."""
    output = tmp_path_factory.mktemp("alone") / "out"
    return folder.diagnose(job(place, output)), output


def test_each_recording_has_its_own_answer(alone, place):
    rows, output = alone
    assert [Path(r.recording).name for r in rows] == ["a friction.csv", "b broken.MF4", "c sound.csv"]
    assert [r.verdict for r in rows] == ["explained", "failed", "no_discrepancy"]
    (cause,) = rows[0].causes
    assert (cause["kind"], cause["where"]) == ("coulomb_friction", "damper")
    assert cause["parameters"]["force"]["value"] == pytest.approx(FORCE, rel=0.02)  # 2 N in 2500 samples: 0.1 %; form 1 %
    assert re.fullmatch(rf"{re.escape(rows[1].recording)}: it is not a valid MDF file \(.*\); export it again", rows[1].error)
    for row in (rows[0], rows[2]):
        whole = json.loads((output / row.folder / "diagnosis.json").read_text())
        assert row.diagnosis == {key: whole[key] for key in table.KEPT} and (output / row.folder / "report.html").exists()
        assert (output / row.folder / "model_extended.toml").exists()
    assert not (output / rows[1].folder).exists()


def test_the_table_says_the_same_in_all_its_forms(alone):
    rows, output = alone
    assert [table.Row(**r) for r in json.loads((output / "diagnoses.json").read_text())["recordings"]] == list(rows)
    with open(output / "diagnoses.csv", newline="") as file:
        cells = list(csv.DictReader(file))
    assert [c["verdict"] for c in cells] == [r.verdict for r in rows] and cells[1]["error"] == rows[1].error
    value = rows[0].causes[0]["parameters"]["force"]
    low, high = value["ci95"]
    assert cells[0]["parameters"] == f"force = {value['value']:.4g} N [{low:.4g}, {high:.4g}]"
    page = (output / "index.html").read_text()
    assert not re.search(r"https?:|<script|<link|@import", page)  # self-contained
    links = re.findall(r'href="(.*?)"', page)
    assert len(links) == 2 and all((output / link.replace("%20", " ")).exists() for link in links)
    assert rows[1].error.split(": ")[-1] in page.replace("&#39;", "'")
    text = table.sentences("rig", rows, output).splitlines()
    assert text[1].split()[:2] == ["a", "friction.csv"] and "coulomb_friction" in text[1] and "failed" in text[2]
    assert "3 recordings: 1 coulomb friction at damper, 1 failed, 1 no discrepancy" in text[-1]


def test_several_processes_find_the_same(alone, place, tmp_path):
    reported = []
    rows = folder.diagnose(job(place, tmp_path / "out"), 2, tell=lambda done, of: reported.append((done, of)))
    assert results(rows) == results(alone[0])
    assert reported == [(0, 3), (1, 3), (2, 3), (3, 3)]


@pytest.fixture(scope="module")
def cluster():
    """A real one on this machine: two processes that are ready for work."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0", silence_logs=50) as cluster:
        yield cluster.scheduler_address


@pytest.mark.long
def test_a_cluster_finds_the_same(alone, place, cluster, tmp_path):
    assert results(folder.diagnose(job(place, tmp_path / "out"), scheduler=cluster)) == results(alone[0])


@pytest.mark.parametrize("where", sample(["processes", "cluster"], "processes"))
def test_a_process_that_dies_takes_only_its_recording_along(place, tmp_path, monkeypatch, where, request):
    monkeypatch.setattr(folder, "attempt", dying)
    scheduler = ""
    if where == "cluster":
        monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))  # its processes must find this module
        dask, distributed = pytest.importorskip("dask"), pytest.importorskip("distributed")
        alone = {"distributed.scheduler.allowed-failures": 0, "distributed.scheduler.worker-saturation": 1.0}
        with dask.config.set(alone):  # one job at a time on a worker, given up when that dies once
            cluster = distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0", silence_logs=60)
        request.addfinalizer(cluster.close)
        scheduler = cluster.scheduler_address
    rows = folder.diagnose(job(place, tmp_path / "out"), 2, scheduler)
    assert rows[0].error == f"{rows[0].recording}: {folder.DIED}"
    for row in rows[1:]:
        assert row.error.startswith(f"{row.recording}: its files are not in {tmp_path / 'out' / row.folder}; use a folder")


def test_what_is_done_is_kept_and_what_changed_is_done_anew(place, tmp_path):
    data = tmp_path / "data"
    data.mkdir()
    paths = [record(data / f"{name}.csv", k, 0.0) for k, name in enumerate("ab")]
    first = folder.diagnose(job(place, tmp_path / "out", data=(data,)))
    record(paths[1], 7, 0.0)
    reported = []
    rows = folder.diagnose(job(place, tmp_path / "out", data=(data,)), resume=True, tell=lambda done, of: reported.append(done))
    assert rows[0] == first[0] and rows[1].source != first[1].source and reported == [1, 2]
    assert folder.diagnose(job(place, tmp_path / "out", data=(data,)), resume=True) == rows
    other = folder.plan(job(place, tmp_path / "out", data=(data,), channels=("force=f",)))
    assert not {row.source for row in rows} & {folder._source(one, folder.files.load_model(one)) for one in other}


def test_a_recording_is_named_after_its_file_and_after_its_path_if_that_is_ambiguous(place, tmp_path):
    for name in ("one/r.csv", "two/r.csv", "two/s.mf4"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("")
    plan = folder.plan(job(place, tmp_path / "out", data=(tmp_path / "two", tmp_path / "two" / "s.mf4")))
    assert [(one.data[0].name, one.output.name) for one in plan] == [("r.csv", "r"), ("s.mf4", "s")]
    plan = folder.plan(job(place, tmp_path / "out", data=(tmp_path / "one", tmp_path / "two")))
    ways = [one.output.relative_to(tmp_path / "out") for one in plan]
    assert ways == [Path("one/r.csv"), Path("two/r.csv"), Path("two/s.mf4")]


@pytest.fixture
def penode(monkeypatch, capsys):
    """penode(words) runs `penode diagnose` here; gives exit code, stdout and the lines of stderr."""

    def run(*words):
        monkeypatch.setattr(sys, "argv", ["penode", "diagnose", *map(str, words)])
        try:
            main()
            code = 0
        except SystemExit as exc:
            code = exc.code or 0
        out, err = capsys.readouterr()
        return code, out, err.splitlines()

    return run


def test_the_command_prints_the_table_and_ends_with_2_if_one_failed(place, penode, tmp_path):
    code, out, lines = penode(place / "model.toml", "--data", place / "data", "-o", tmp_path / "out", "--jobs", 2)
    assert code == 2 and "coulomb_friction" in out and len(lines) == 1  # no bar in a pipe
    assert lines[0].startswith(f"penode: {place / 'data' / 'b broken.MF4'}: it is not a valid MDF file")
    files = [place / "data" / name for name in ("c sound.csv", "a friction.csv")]
    code, out, lines = penode(place / "model.toml", "--data", *files, "--each", "-o", tmp_path / "out", "--resume", "--json")
    assert code == 0 and lines == []
    assert [r["diagnosis"]["verdict"] for r in json.loads(out)["recordings"]] == ["no_discrepancy", "explained"]
    code, out, lines = penode(place / "model.toml", "--data", place / "data", "-o", tmp_path / "out", "--resume", "--json")
    found = json.loads(out)
    assert (code, len(lines), len(found["recordings"])) == (2, 1, 3) and found["error"]["code"] == "recording"
    assert found["error"]["problems"][0]["place"] == str(place / "data" / "b broken.MF4")


def test_what_cannot_begin_is_said_in_one_line_and_leaves_nothing(place, penode, tmp_path, monkeypatch):
    (tmp_path / "empty").mkdir()
    broken = place / "data" / "b broken.MF4"
    out = tmp_path / "out"
    data = ("--data", place / "data")
    for words, text in (
        (("--data", tmp_path / "empty"), "empty: there is no recording in this folder; put .csv, .mf4, .mdf files into it"),
        ((*data, "--holdout", broken), "b broken.MF4: it is not a valid MDF file"),
        ((*data, "--jobs", 2, "--scheduler", "tcp://127.0.0.1:1"), "--jobs: the cluster of --scheduler has its own"),
        ((*data, "--scheduler", "tcp://127.0.0.1:1"), "--scheduler tcp://127.0.0.1:1: no Dask scheduler answers there; start"),
        ((*data, "--scheduler", "somewhere"), "--scheduler somewhere: no Dask scheduler answers there; start"),
        (("--data", place / "data" / "c sound.csv", "--resume"), "--resume: these recordings are one study; give a folder"),
    ):
        code, _, lines = penode(place / "model.toml", *words, "-o", out)
        assert code == 2 and len(lines) == 1 and text in lines[0] and not out.exists(), lines
    code, _, lines = penode(place / "model.toml", *data, "-o", place / "data")
    assert code == 2 and "the results would lie among the recordings; name another directory" in lines[0]
    monkeypatch.setitem(sys.modules, "distributed", None)
    code, _, lines = penode(place / "model.toml", *data, "-o", out, "--scheduler", "tcp://127.0.0.1:1")
    assert (code, len(lines)) == (2, 1) and "Dask is not installed here; pip install penode[cluster]" in lines[0]


def test_a_cluster_without_workers_or_with_another_penode_is_refused(place, cluster, tmp_path, monkeypatch):
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(folder, "PATIENCE", 0.5)
    with (
        distributed.LocalCluster(n_workers=0, dashboard_address=":0", silence_logs=60) as idle,
        pytest.raises(UserError, match="the cluster has no workers; start some"),
    ):
        folder.diagnose(job(place, tmp_path / "out"), scheduler=idle.scheduler_address)
    monkeypatch.setattr(folder.metadata, "version", lambda name: "0.0.1")
    with pytest.raises(UserError, match=r"has penode 0.0.1; install [\d.]+ there as here"):
        folder.diagnose(job(place, tmp_path / "out"), scheduler=cluster)
    assert not (tmp_path / "out").exists()
