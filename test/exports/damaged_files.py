# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
Campaign: damaged and foreign files given to every command that imports; make imports.

Calls are made in forks of this process, many in each; where one crashes or takes too long, its file is the culprit, and the next fork goes
on behind it. A file is taken, with code 0 and a whole result, or
refused, with code 2, a line each that begins with `penode: `, and nothing written: the file that stood there keeps its bytes, no other
file appears. Files are good ones changed at random, in archives also inside of one of their files, and files of quite other kinds.
Random numbers are seeded.
"""

from __future__ import annotations

import argparse
import contextlib
import gzip
import io
import json
import os
import random
import signal
import sys
import tempfile
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

sys.path.extend(str(Path(__file__).resolve().parents[1] / room) for room in ("exports", "prove", "sil"))
import gate  # needs the path above
import readers_check
from lag import lag

import penode_gen
from penode_gen import exports
from penode_gen.exports.archive import zipped
from penode_sil.cli import cli
from penode_sil.errors import UserError
from penode_sil.guard import guarded

HERE = Path(__file__).resolve().parent
LIMIT = 60  # [s] of wall-clock time for one file
FORK = 50  # files for a process
KEPT = b"this file stood here before"
FOREIGN = [
    b"",
    b"\0" * 500,
    b"PK\x03\x04",
    b"PK\x05\x06" + bytes(18),
    b"\x7fELF" + bytes(200),
    b"%PDF-1.7\n%\xe2\xe3",
    b"\x89PNG\r\n\x1a\n" + bytes(40),
    gzip.compress(b"model M end M;"),
    "model M\n end M;".encode("utf-16"),
    b"\xef\xbb\xbfmodel M end M;",
    b"{}",
    b"[]",
    b"null",
    b"<?xml version='1.0'?><a/>",
    b"MZ" + bytes(300),
    b"time,x\n0,1\n",
    b"-" * 70_000,
    b"<?xml version='1.0'?><!DOCTYPE z [<!ENTITY a 'aaaaaaaaaa'>"
    + b"".join(b"<!ENTITY %c '%s'>" % (98 + i, b"&%c;" % (97 + i) * 10) for i in range(9))
    + b"]><z>&j;</z>",
    b"<?xml version='1.0'?><!DOCTYPE z [<!ENTITY x SYSTEM 'file:///etc/hostname'>]><z>&x;</z>",
    b"<a>" * 20_000,
    b"{" * 20_000,
    b"[" * 20_000,
    b"(" * 20_000,
    b"import os; os.abort()",
    b"@startuml",
    b"\xff\xfe" + bytes(range(256)),
    b"record R\n parameter Real layer_1_weights[1,1] = {{1e999}};\nend R;",
]


@dataclass
class Importer:
    """A command that reads a file: `words` are its arguments for that file and an output; what became of those that it was given."""

    name: str
    suffix: str
    output: str
    words: Callable[[Path, Path], list[str]]
    good: list[bytes]
    change: Callable[[bytes, random.Random], bytes]
    taken: int = 0
    refused: int = 0
    lines: set[str] = field(default_factory=set)
    problems: list[str] = field(default_factory=list)


def text_changed(data: bytes, pick: random.Random) -> bytes:
    return readers_check.changed(data, pick, binary=False)


def network_changed(data: bytes, pick: random.Random) -> bytes:
    return readers_check.regraft(data, pick) if pick.random() < 0.7 else readers_check.changed(data, pick, binary=True)


def inside(*suffixes: str, deep: str = "") -> Callable[[bytes, random.Random], bytes]:
    """Changes a file of an archive (`deep`: of the archive in it with that suffix), every fourth time the archive's own bytes."""

    def change(data: bytes, pick: random.Random) -> bytes:
        if pick.random() < 0.25:
            return readers_check.changed(data, pick, binary=True)
        try:
            with zipfile.ZipFile(io.BytesIO(data)) as archive:
                files: dict[str, bytes | str] = {name: archive.read(name) for name in archive.namelist()}
        except Exception:  # no archive any more
            return data
        name = pick.choice([n for n in sorted(files) if n.endswith((deep,) if deep else suffixes)] or [""])
        if not name:
            return data
        before = files[name]
        assert isinstance(before, bytes)
        files[name] = inside(*suffixes)(before, pick) if deep else readers_check.changed(before, pick, binary=False)
        if not deep and pick.random() < 0.05:
            del files[name]
        return zipped(files)

    return change


def called(words: list[str], command: Any, folder: Path) -> tuple[int, str]:
    """Code and stderr of a command, run in this process."""
    said = io.StringIO()
    os.chdir(folder)
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
        try:
            guarded(lambda: command(args=words, standalone_mode=False))
        except SystemExit as end:
            return int(end.code or 0), said.getvalue()
    return 0, said.getvalue()


def listed(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def judge(code: int, said: str, before: dict[str, bytes], after: dict[str, bytes], output: str) -> str:
    """What is wrong with the end of a command; "" if nothing is."""
    lines = said.splitlines()
    if "Traceback" in said or code not in (0, 2):
        return f"code {code}: {said[:300]}"
    if code == 0:
        return (
            ""
            if any(name.startswith(output) and data not in (KEPT, b"") for name, data in after.items())
            else "code 0, but nothing was written"
        )
    if not lines or not all(line.startswith("penode: ") and len(line) < 1000 for line in lines):
        return f"no line each: {said[:300]!r}"
    return "" if after == before else f"refused, but files differ: {sorted(set(after) ^ set(before)) or 'the output'}"


def give(importer: Importer, data: bytes, folder: Path, command: Any) -> tuple[int, str, str]:
    """One file to an importer, in this process: code, what is wrong or "", and what it said."""
    path, output = folder / f"file{importer.suffix}", folder / importer.output
    path.write_bytes(data)
    if output.suffix:
        output.write_bytes(KEPT)
    before = listed(folder)
    code, said = called(importer.words(path, output), command, folder)
    after = listed(folder)
    for extra in set(after) - set(before):
        (folder / extra).unlink()
    return code, judge(code, said, before, after, importer.output), said.replace(str(folder), "")


def many(importer: Importer, files: list[bytes], folder: Path, command: Any = cli) -> list[str]:
    """Files to an importer, in forks; what is wrong with each, or ""."""
    report, found = folder.parent / f"{folder.name}.report", []
    while len(found) < len(files):
        report.unlink(missing_ok=True)
        child = os.fork()
        if child == 0:
            signal.signal(signal.SIGALRM, signal.SIG_DFL)
            quiet = os.open(os.devnull, os.O_WRONLY)
            os.dup2(quiet, 1)
            os.dup2(quiet, 2)
            with open(report, "w") as lines:
                for data in files[len(found) : len(found) + FORK]:
                    signal.alarm(LIMIT)
                    lines.write(json.dumps(give(importer, data, folder, command)) + "\n")
                    lines.flush()
            os._exit(0)
        _, status = os.waitpid(child, 0)
        ended = [json.loads(line) for line in report.read_text().splitlines()] if report.exists() else []
        for code, wrong, said in ended:
            importer.taken += code == 0
            importer.refused += code == 2
            importer.lines |= {"".join(c for c in line if not c.isdigit())[:60] for line in said.splitlines()}
            found.append(wrong)
        code = os.waitstatus_to_exitcode(status)
        if code != 0:
            found.append(
                "too long" if code == -signal.SIGALRM else f"crash, signal {-code}" if code < 0 else f"the process ended with code {code}"
            )
    report.unlink(missing_ok=True)
    return found


def warm(importer: Importer, folder: Path) -> None:
    """Take a good file in this process, so that forks need not load modules anew."""
    path = folder / f"warm{importer.suffix}"
    path.write_bytes(importer.good[0])
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            cli(args=importer.words(path, folder / f"warm-{importer.output}"), standalone_mode=False)
    except (UserError, penode_gen.ModelError):
        pass  # what is wrong with it is found when it is given


def given(importer: Importer, seeds: range) -> Iterator[bytes]:
    """Files for it: every eighth is of another kind, the others are good ones with one to four changes."""
    for seed in seeds:
        pick = random.Random(f"{importer.name} {seed}")
        if seed % 8 == 0:
            yield FOREIGN[seed // 8 % len(FOREIGN)]
            continue
        data = pick.choice(importer.good)
        for _ in range(pick.choice((1, 1, 2, 4))):
            data = importer.change(data, pick)
        yield data


def search(importer: Importer, seeds: range, folder: Path, command: Any = cli) -> None:
    """Give it all files; problems are kept with the file that brought them."""
    files = list(given(importer, seeds))
    for seed, data, wrong in zip(seeds, files, many(importer, files, folder, command), strict=True):
        if wrong:
            kept = gate.BUILD / "imports" / f"{importer.name.replace(' ', '-')}-{seed}{importer.suffix}"
            kept.parent.mkdir(parents=True, exist_ok=True)
            kept.write_bytes(data)
            importer.problems.append(f"{importer.name} {seed}: {wrong}; {kept}")


def importers(folder: Path) -> list[Importer]:
    """All of them; `folder` gets what the files refer to."""
    networks = sorted((gate.ROOT / "gen" / "nqvm" / "networks").glob("*.onnx"))
    layers = sorted((gate.HERE / "small").glob("*.json"))
    for kind, suffix in (("onnx", ".onnx"), ("json", ".json")):
        (folder / f"{kind}.toml").write_text(lag(f"lag_{kind}", f"file{suffix}", tunable=True))
    (folder / "net.json").write_bytes(layers[0].read_bytes())
    (folder / "small.toml").write_text(lag("lag", "net.json", tunable=True))
    small = penode_gen.load(folder / "small.toml")
    made = {
        name: exports.export(small, name, folder / f"x.{suffix}", {"form": "library"} if suffix == "mo" else {})
        for name, suffix in (("ssp", "ssp"), ("modelica", "mo"))
    }
    road = folder / "road.csv"
    road.write_text("time [s],u [m]\n0,0\n0.005,0.01\n")
    library = (HERE / "modelica" / "Translation.mo").read_bytes()

    def play(path: Path, output: Path) -> list[str]:
        return ["simulate", "--ssp", str(path), "--input", str(road), "-o", str(output)]

    def read(path: Path, output: Path) -> list[str]:
        return ["import", str(path), "-o", str(output)]

    def generate(model: str) -> Callable[[Path, Path], list[str]]:
        return lambda path, output: ["generate", str(folder / model if model else path), "-o", str(output)]

    return [
        Importer("Modelica records", ".mo", "out.json", read, [made["modelica"]], text_changed),
        Importer("eFMU and others", ".fmu", "out.json", read, [made["ssp"]], network_changed),
        Importer("SSP", ".ssp", "out.csv", play, [made["ssp"]], inside(".ssd", "schedule.xml")),
        Importer("SSV and SSM", ".ssp", "out.csv", play, [made["ssp"]], inside(".ssv", ".ssm")),
        Importer("FMU in an SSP", ".ssp", "out.csv", play, [made["ssp"]], inside("modelDescription.xml", deep=".fmu")),
        Importer("ONNX", ".onnx", "out", generate("onnx.toml"), [p.read_bytes() for p in networks], network_changed),
        Importer("network files", ".json", "out", generate("json.toml"), [p.read_bytes() for p in layers], text_changed),
        Importer("model files", ".toml", "out", generate(""), [lag("lag", "net.json", tunable=True).encode()], text_changed),
        Importer(
            "Modelica models",
            ".mo",
            "out.toml",
            lambda path, output: [*read(path, output), "--model", "Translation.Swing"],
            [library],
            text_changed,
        ),
    ]


def check(seeds: range, only: str = "") -> Iterator[Importer]:
    """So many files for each importer (or those whose name has one of `only`, parted by commas, in it), which is returned when it has had
    all."""
    with tempfile.TemporaryDirectory() as outer:
        place = Path(outer, "files")
        place.mkdir()
        every = [i for i in importers(place) if any(part in i.name for part in only.split(","))]
        for importer in every:
            warm(importer, place)
            importer.problems += [f"{importer.name}: a good file: {wrong}" for wrong in many(importer, importer.good, place) if wrong]
            if importer.taken != len(importer.good) and importer.suffix != ".fmu":  # penode reads no file of that suffix
                importer.problems.append(f"{importer.name}: a good file is refused")
            importer.taken = importer.refused = 0
            search(importer, seeds, place)
            yield importer


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--files", type=int, default=1000, help="for each importer")
    options.add_argument("--only", default="", help="importers with this in their name; several with commas between")
    chosen = options.parse_args()
    good = True
    for importer in check(range(1000, 1000 + chosen.files), chosen.only):
        count = Counter(taken=importer.taken, refused=importer.refused)
        good &= gate.report(
            (
                f"imports: {importer.name}: {chosen.files} files: {count['taken']} taken, "
                f"{count['refused']} refused in {len(importer.lines)} kinds of lines"
            ),
            importer.problems[:10],
        )
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
