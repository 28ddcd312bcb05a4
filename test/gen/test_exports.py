# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What all exports have in common: options of a format, lines for what is wrong, archives and texts that are always the same."""

from __future__ import annotations

import dataclasses
import io
import sys
import types
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner

from penode_gen import exports
from penode_gen.exports import archive, templating
from penode_gen.model import ModelError
from penode_sil.cli import cli
from penode_sil.commands import export
from penode_sil.commands.formats import OPTIONS, SUMMARIES
from penode_sil.errors import UserError

NQVM = Path(__file__).resolve().parents[2] / "gen" / "nqvm" / "nqvm.toml"


@pytest.fixture
def formats(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Two formats of the test's own, each a module with an EXPORTER."""
    shout = exports.Exporter(
        "the name of the model, loud",
        (".txt",),
        lambda model, options: (model.name.upper() * int(options["times"])).encode(),
        options=(exports.Option("times", "how often", "number", default=1), exports.Option("as_is", "not read", "flag")),
    )
    absent = exports.Exporter("needs what is nowhere", (".txt",), lambda model, options: b"", needs=("no_such_package",))
    extra = dataclasses.replace(absent, extra="nowhere")
    for name, exporter in (("shout", shout), ("absent", absent), ("extra", extra)):
        module = types.ModuleType(f"penode_gen.exports.{name}")
        module.EXPORTER = exporter
        monkeypatch.setitem(sys.modules, module.__name__, module)
        monkeypatch.setitem(exports.FORMATS, name, name)
    exports.exporter.cache_clear()
    yield
    exports.exporter.cache_clear()


def run(*words: str) -> str:
    """What the command prints; its exceptions are those that guard.py makes lines of."""
    result = CliRunner().invoke(cli, ["export", *words], catch_exceptions=False, standalone_mode=False)
    if result.exception:
        raise result.exception
    return result.output


@pytest.mark.usefixtures("formats")
def test_a_format_is_a_module_and_a_line(tmp_path: Path) -> None:
    output = tmp_path / "n.txt"
    run(str(NQVM), "--format", "shout", "-o", str(output))
    assert output.read_text() == "NQVM"
    run(str(NQVM), "--format", "shout", "--times", "2", "-o", str(output))
    assert output.read_text() == "NQVMNQVM"


def test_help_shows_what_the_formats_declare() -> None:
    """The help is written down, for it is not to load them all."""
    assert {name: exports.exporter(name).summary for name in exports.FORMATS} == SUMMARIES
    assert export.declared() == OPTIONS


@pytest.mark.usefixtures("formats")
@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["--format", "shot", "-o", "n.txt"], '--format: "shot" is not known; did you mean "shout"?'),
        (["--format", "absent", "--as-is", "-o", "n.txt"], "--as-is: the format absent has no such option; leave it out"),
        (
            ["--format", "absent", "-o", "n.txt"],
            "--format absent: it needs the Python package no_such_package, which is not installed; pip install no_such_package",
        ),
        (
            ["--format", "extra", "-o", "n.txt"],
            "--format extra: it needs the Python package no_such_package, which is not installed; pip install penode[nowhere]",
        ),
        (["--format", "shout", "-o", "n.bin"], 'n.bin: a file of the format shout does not end in ".bin"; end its name in .txt'),
        (["--format", "shout", "-o", "no/n.txt"], "no/n.txt: there is no directory no; create it or name another file"),
    ],
)
def test_what_is_wrong_is_one_line_and_writes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], line: str) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises((UserError, ModelError)) as found:
        run(str(NQVM), *words)
    assert found.value.problems == [line]
    assert list(tmp_path.iterdir()) == []


def test_an_archive_depends_on_its_contents_only() -> None:
    first, second = archive.zipped({"b": "x", "a/c": b"\0"}), archive.zipped({"a/c": b"\0", "b": "x"})
    assert first == second != archive.zipped({"b": "y", "a/c": b"\0"})
    with zipfile.ZipFile(io.BytesIO(first)) as read:
        assert read.namelist() == ["a/c", "b"] and read.testzip() is None


@pytest.mark.parametrize("text", ['say "µ" \\ ??/ 1', "line\nline", "a\0" + "7"])
def test_texts_survive_as_c_strings(text: str) -> None:
    quoted = templating.c_string(text)
    assert quoted.isascii() and '"' not in quoted and "??" not in quoted
    parts, rest = bytearray(), quoted
    while rest:
        if rest[0] == "\\":
            parts.append(int(rest[1:4], 8))
            rest = rest[4:]
        else:
            parts.append(ord(rest[0]))
            rest = rest[1:]
    assert parts.decode() == text
