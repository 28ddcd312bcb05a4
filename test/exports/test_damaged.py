# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The campaign of damaged files (make imports): some of them, and that faulty importers are found."""

from __future__ import annotations

import importlib.util
import os
import signal
import sys
import time
from pathlib import Path
from typing import Any

import click
import damaged_files as df
import pytest

import penode_gen


@pytest.mark.skipif(
    any(importlib.util.find_spec(p) is None for p in ("fmpy", "rumoca")),
    reason="FMPy or rumoca is not installed: pip install penode[ssp,modelica]",
)
def test_damaged_files_are_taken_or_refused_with_a_line_each() -> None:
    for importer in df.check(range(4)):
        assert importer.problems == [] and importer.refused > 0, importer.name


def raises(path: Path, output: Path) -> None:
    raise KeyError("layers")


def writes_before_it_reads(path: Path, output: Path) -> None:
    output.write_bytes(path.read_bytes()[:3])
    raise penode_gen.ModelError(["half of it is bad; correct it"])


def leaves_a_part(path: Path, output: Path) -> None:
    output.with_suffix(".part").write_text("1")
    raise penode_gen.ModelError(["bad; correct it"])


def talks_at_length(path: Path, output: Path) -> None:
    print("warning: something\nis wrong", file=sys.stderr)
    raise penode_gen.ModelError(["bad; correct it"])


def says_nothing(path: Path, output: Path) -> None:
    sys.exit(2)


def claims_success(path: Path, output: Path) -> None:
    return None


def crashes(path: Path, output: Path) -> None:
    signal.signal(signal.SIGSEGV, signal.SIG_DFL)  # pytest's own would print all threads
    os.kill(os.getpid(), signal.SIGSEGV)


def hangs(path: Path, output: Path) -> None:
    time.sleep(100)


@pytest.mark.parametrize(
    "fault", [raises, writes_before_it_reads, leaves_a_part, talks_at_length, says_nothing, claims_success, crashes, hangs]
)
def test_a_faulty_importer_is_found(fault: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(df, "LIMIT", 1)
    importer = df.Importer("faulty", ".mo", "out.json", lambda path, output: [str(path), str(output)], [b"record"], df.text_changed)
    command = click.Command("faulty", params=[click.Argument(["path"], type=Path), click.Argument(["output"], type=Path)], callback=fault)
    assert df.many(importer, [b"record", b"other"], tmp_path, command.main).count("") == 0


def test_an_importer_without_fault_passes(tmp_path: Path) -> None:
    def right(path: Path, output: Path) -> None:
        raise penode_gen.ModelError(["bad; correct it"])

    importer = df.Importer("right", ".mo", "out.json", lambda path, output: [str(path), str(output)], [b"record"], df.text_changed)
    command = click.Command("right", params=[click.Argument(["path"], type=Path), click.Argument(["output"], type=Path)], callback=right)
    assert df.many(importer, [b"record"], tmp_path, command.main) == [""]
