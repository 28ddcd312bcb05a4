# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A training that was interrupted goes on from its last checkpoint and ends with the same bits."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import generator
import numpy as np
import pytest
from click.testing import CliRunner, Result

from penode_sil.cli import cli
from penode_sil.training import report, resume

MODEL = Path(__file__).with_name("quarter.toml")
SHORT = 1.5  # [s] of a recording where it does not matter how good what is trained is


def call(folder: Path, data: Path, *more: str, model: Path = MODEL) -> Result:
    return CliRunner().invoke(cli, ["train", str(model), "--data", str(data), "-o", str(folder), *more])


@pytest.fixture(autouse=True, scope="module")
def no_pictures() -> Iterator[None]:
    """The report's pictures take longer than the training."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(report, "write", lambda path, found: None)
        yield


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return generator.make(generator.Truth(), 1, seconds=SHORT).write(tmp_path_factory.mktemp("short") / "rec.csv")


def results(folder: Path) -> dict[str, bytes]:
    """All that a training wrote, but for the time that it took."""
    report = json.loads((folder / "training.json").read_text())
    report.pop("seconds")
    files = {p.name: p.read_bytes() for p in folder.iterdir() if p.suffix in (".onnx", ".set")}
    parameters = (folder / "model_trained.toml").read_text().split("[parameters]")[1].encode()
    return files | {"training.json": json.dumps(report).encode(), "parameters": parameters}


def interrupted(folder: Path, data: Path, monkeypatch: pytest.MonkeyPatch, steps: int, *more: str, model: Path = MODEL) -> int:
    """A training that is interrupted after so many steps of its fits; how many it came to."""
    note, done = resume.Journal.note, []

    def stop(self: resume.Journal, number: int, state: resume.State) -> None:
        note(self, number, state)
        done.append(number)
        if len(done) == steps:
            raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(resume.Journal, "note", stop)
        result = call(folder, data, *more, model=model)
    assert (result.exit_code != 0) == (len(done) == steps), result.output
    return len(done)


@pytest.fixture(scope="module")
def whole(short: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int]:
    """The folder of a training that nothing interrupted, and how many steps it took."""
    folder = tmp_path_factory.mktemp("whole")
    with pytest.MonkeyPatch.context() as patched:
        total = interrupted(folder, short, patched, 10**9)
    assert not (folder / resume.NAME).exists()
    return folder, total


def test_ends_with_the_same_bits_wherever_it_stopped(
    short: Path, whole: tuple[Path, int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ended, total = whole
    for steps in (1, total // 2, total):
        folder = tmp_path / f"after{steps}"
        interrupted(folder, short, monkeypatch, steps)
        assert [p.name for p in folder.iterdir()] == [resume.NAME]
        went = call(folder, short, "--resume")
        assert went.exit_code == 0, went.output
        assert results(folder) == results(ended) and not (folder / resume.NAME).exists(), steps


def test_goes_on_rather_than_anew_and_may_stop_again(
    short: Path, whole: tuple[Path, int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ended, total = whole
    interrupted(tmp_path / "out", short, monkeypatch, total // 2)
    interrupted(tmp_path / "out", short, monkeypatch, total // 4, "--resume")
    left = interrupted(tmp_path / "out", short, monkeypatch, 10**9, "--resume")
    assert left == total - total // 2 - total // 4
    assert results(tmp_path / "out") == results(ended)


@pytest.mark.long
def test_networks_of_any_shape_too(short: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model = tmp_path / "tanh.toml"
    model.write_text(MODEL.read_text().replace("{ layers = [16, 16, 16] }", '{ layers = [3], activation = "tanh" }'))
    total = interrupted(tmp_path / "whole", short, monkeypatch, 10**9, model=model)
    interrupted(tmp_path / "out", short, monkeypatch, 2 * total // 3, model=model)
    left = interrupted(tmp_path / "out", short, monkeypatch, 10**9, "--resume", model=model)
    assert left == total - 2 * total // 3 and results(tmp_path / "out") == results(tmp_path / "whole")


def test_a_killed_process_leaves_a_checkpoint(short: Path, whole: tuple[Path, int], tmp_path: Path) -> None:
    code = "from penode_sil.cli import cli; cli()"
    process = subprocess.Popen(
        [sys.executable, "-c", code, "train", str(MODEL), "--data", str(short), "-o", str(tmp_path / "out")], stdout=subprocess.DEVNULL
    )
    for _ in range(6000):
        if (tmp_path / "out" / resume.NAME).exists() or process.poll() is not None:
            break
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert process.returncode == -signal.SIGKILL
    went = call(tmp_path / "out", short, "--resume")
    assert went.exit_code == 0, went.output
    assert results(tmp_path / "out") == results(whole[0])


def test_a_checkpoint_is_whole_or_as_before(short: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Interrupted while it is written: what was there before can be read."""
    interrupted(tmp_path / "out", short, monkeypatch, 3)
    before = (tmp_path / "out" / resume.NAME).read_bytes()

    def half(path: Path, **arrays: np.ndarray) -> None:
        path.write_bytes(before[: len(before) // 2])
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(np, "savez", half)
        assert call(tmp_path / "out", short, "--resume").exit_code != 0
    assert [p.name for p in (tmp_path / "out").iterdir()] == [resume.NAME] and (tmp_path / "out" / resume.NAME).read_bytes() == before


@pytest.fixture
def stopped(short: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    interrupted(tmp_path / "out", short, monkeypatch, 2)
    return tmp_path / "out"


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (["--seed", "1"], "other --seed;"),
        (["--known", "m_b"], "other --known;"),
        (["--holdout", "DATA"], "other --holdout;"),
        (["--channel", "z_road=z_road"], "other --channel;"),
    ],
)
def test_another_call_is_refused(given: list[str], says: str, stopped: Path, short: Path) -> None:
    refused(stopped, call(stopped, short, "--resume", *(str(short) if g == "DATA" else g for g in given)), says)


def refused(folder: Path, result: Result, says: str) -> None:
    """One line that says so, and the checkpoint stays."""
    (problem,) = result.exception.problems
    assert says in problem and "--resume" in problem, problem
    assert [p.name for p in folder.iterdir()] == [resume.NAME]


def test_another_model_or_recording_is_refused(stopped: Path, short: Path, tmp_path: Path) -> None:
    (tmp_path / "other.toml").write_text(MODEL.read_text().replace("value = 90,", "value = 91,"))
    refused(stopped, call(stopped, short, "--resume", model=tmp_path / "other.toml"), "other model file;")
    other = generator.make(generator.Truth(), 2, seconds=SHORT).write(tmp_path / "rec.csv")
    refused(stopped, call(stopped, other, "--resume"), "other --data;")


def test_other_bits_or_a_damaged_file_are_refused(stopped: Path, short: Path) -> None:
    file = stopped / resume.NAME
    with np.load(file) as found:
        arrays = dict(found)
    good = file.read_bytes()
    np.savez(file, **(arrays | {"starts": np.array(["0" * 64, *arrays["starts"][1:]])}))
    refused(stopped, call(stopped, short, "--resume"), "does not compute the bits")
    for damaged in (good[: len(good) // 2], b"no archive", b""):
        file.write_bytes(damaged)
        refused(stopped, call(stopped, short, "--resume"), "not a readable checkpoint")


def test_nothing_to_resume(short: Path, whole: tuple[Path, int], tmp_path: Path) -> None:
    """An ended training is not trained again; where none began, it begins."""
    (problem,) = call(whole[0], short, "--resume").exception.problems
    assert "has ended" in problem
    assert call(tmp_path / "new", short, "--resume").exit_code == 0
    assert results(tmp_path / "new") == results(whole[0])
