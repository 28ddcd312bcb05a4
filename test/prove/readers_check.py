# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: whatever stands in a file, its reader takes it or says in words what is wrong: model, network, scenario, recording.

Files are made from good ones by changing them at random. One that brings a new message, or is taken, is changed further:
so the search goes on from what leads somewhere. The random numbers are seeded, a run can be repeated.
"""

from __future__ import annotations

import argparse
import math
import random
import re
import shutil
import signal
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "sil"))
import gate
import mdf_files
import numpy as np
import onnx
import recording_forms

import penode_gen
from penode_gen.networks import NetworkError
from penode_gen.reading.json_file import read_json
from penode_gen.reading.onnx_file import read_onnx
from penode_sil import scenario
from penode_sil.errors import UserError
from penode_sil.recordings import look, measured, on_raster, read

REFUSED = (penode_gen.ModelError, NetworkError, UserError)
LIMIT = 20  # [s] of the processor for one file
NQVM = gate.ROOT / "gen" / "nqvm"
WORDS = [
    *"0 -1 1 2 7 1e308 -1e308 1e-320 1e999 nan inf -inf 10000000000000000000000000000000 0x10 1_0 true false null".split(),
    *'"" " " "m" "N*s/m" "m^99999" "der(v_b)" "1/0" "x**x**x" "((((" "\u00e9" [] {} [[]] [0] [1,2,3] [nan] , ; = \n \t \r\n \0 . - #'.split(
        " "
    ),
]


@dataclass
class Reader:
    """A reader, good files for it, and what became of those made from them."""

    name: str
    suffix: str
    read: Callable[[Path], object]
    files: list[bytes]
    limit: int = LIMIT
    share: float = 1.0  # of the files that are asked for
    tried: int = 0
    taken: int = 0
    messages: set[str] = field(default_factory=set)


def changed(data: bytes, pick: random.Random, binary: bool) -> bytes:
    """One change: of bits, bytes, a stretch, a line, a number or a word."""
    at, to = sorted(pick.randrange(len(data) + 1) for _ in range(2))
    way = pick.randrange(5 if binary else 9)
    if way == 0:
        at = min(at, len(data) - 1)
        return data[:at] + bytes([data[at] ^ (1 << pick.randrange(8))]) + data[at + 1 :] if data else b"?"
    if way == 1:
        return data[:at] + pick.randbytes(pick.randrange(1, 9)) + data[at + pick.randrange(9) :]
    if way == 2:
        return data[:at] + data[to:] if to - at < 200 else data[:at]
    if way == 3:
        return data[:to] + data[at:to][:200] + data[to:]
    if way == 4:
        return data[:at] + pick.choice(WORDS).encode() + data[at:]
    if way in (5, 6):  # a number or a word by another
        kind = rb"-?\d[\d.eE+-]*" if way == 5 else rb"[A-Za-z_]\w*|\"[^\"\n]*\""
        found = [m.span() for m in re.finditer(kind, data)] or [(at, to)]
        start, end = pick.choice(found)
        other = data[slice(*pick.choice(found))] if pick.random() < 0.5 else pick.choice(WORDS).encode()
        return data[:start] + other + data[end:]
    lines = data.split(b"\n")
    one, other = pick.randrange(len(lines)), pick.randrange(len(lines))
    if way == 7:
        lines[one], lines[other] = lines[other], lines[one]
    else:
        lines[one : one + 1] = [] if pick.random() < 0.5 else [lines[one], lines[one]]
    return b"\n".join(lines)


def regraft(data: bytes, pick: random.Random) -> bytes:
    """One change of the contents of an ONNX file, if it can be read: damage to its bytes rarely gets beyond the protocol buffer."""
    try:
        model = onnx.load_from_string(data)
    except Exception:  # not ours
        return data
    graph = model.graph
    parts = [graph.node, graph.initializer, graph.input, graph.output, model.opset_import]
    part = pick.choice([some for some in parts if len(some)] or [graph.node])
    if not part:
        return data
    one, other = pick.choice(part), pick.choice(part)
    way = pick.randrange(4)
    if way == 0:
        part.remove(one)
    elif way == 1:
        part.append(other)
    elif part is graph.node:
        names = [name for node in graph.node for name in (*node.input, *node.output)] + ["", "nowhere"]
        if way == 2:
            one.op_type = pick.choice(["Gemm", "MatMul", "Add", "Relu", "Tanh", "Softplus", "Conv", "Identity", "Reshape", "Flatten", ""])
        else:
            where = pick.choice((one.input, one.output))
            where.append(pick.choice(names))
            where[pick.randrange(len(where))] = pick.choice(names)
            one.attribute.extend(
                [onnx.helper.make_attribute(pick.choice(["alpha", "beta", "transA", "transB", "axis"]), pick.choice([0, 1, 2, 0.5]))]
            )
    elif part is graph.initializer:
        if way == 2:
            one.dims[:] = [pick.choice([-1, 0, 1, 3, 16, 2**40]) for _ in range(pick.randrange(4))]
        else:
            one.data_type = pick.randrange(20)
    elif part is model.opset_import:
        one.version, one.domain = pick.choice([0, 1, 7, 13, 999]), pick.choice(["", "ai.onnx.ml"])
    else:
        one.type.tensor_type.elem_type = pick.randrange(20)
        for size in one.type.tensor_type.shape.dim:
            size.dim_value = pick.choice([-1, 0, 1, 2, 2**40])
    return model.SerializeToString()


DEEPER = {".onnx": regraft, ".mf4": mdf_files.overwritten}  # changes beyond which a reader of that kind of file still looks


def failure(reader: Reader, path: Path) -> str | None:
    """Read a file; None if it was taken or refused in words, else what happened."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)  # of numpy: a number went wrong and nobody looked
            signal.setitimer(signal.ITIMER_PROF, reader.limit)
            reader.read(path)
            reader.taken += 1
            reader.messages.add("taken")
    except REFUSED as refusal:
        text = str(refusal)
        reader.messages.add(re.sub(r"\d+|'[^']*'|\"[^\"]*\"", "_", text.replace(str(path.parent), ""))[:200])
        return None if text.strip() and "Traceback" not in text else f"refused without words: {text!r}"
    except Exception:  # that is what is looked for
        return traceback.format_exc(limit=-4)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    return None


def search(reader: Reader, tries: int, folder: Path, seed: int = 1) -> list[str]:
    """Change files of a reader; the failures, with the file kept beside the build."""
    pick, known, found = random.Random(f"{reader.name} {seed}"), list(reader.files), []
    for _ in range(math.ceil(tries * reader.share)):
        data = pick.choice(reader.files) if pick.random() < 0.3 else pick.choice(known)
        for _ in range(pick.choice((1, 1, 2, 4))):
            inside = DEEPER.get(reader.suffix) if pick.random() < 0.7 else None
            data = inside(data, pick) if inside else changed(data, pick, reader.suffix in DEEPER)
        path = folder / f"file{reader.suffix}"
        path.write_bytes(data)
        before = len(reader.messages)
        said = failure(reader, path)
        reader.tried += 1
        if said is not None:
            kept = gate.BUILD / "readers" / f"{reader.name}-{seed}-{reader.tried}{reader.suffix}"
            kept.parent.mkdir(parents=True, exist_ok=True)
            kept.write_bytes(data)
            found.append(f"{kept}:\n{said}")
        elif len(reader.messages) > before and len(data) < 100_000:
            known.append(data)
    return found


def readers(folder: Path) -> list[Reader]:
    """All readers; `folder` gets what the files refer to."""
    shutil.copytree(NQVM / "networks", folder / "networks", dirs_exist_ok=True)
    for path in (gate.HERE / "small").iterdir():
        shutil.copy(path, folder)
    nqvm = penode_gen.load(NQVM / "nqvm.toml")
    length = len(penode_gen.set_values(nqvm, "default"))
    time = np.arange(400) * 1e-3
    rows = [f"{t:.3f},{1e-3 * np.sin(20 * t):.6g},{np.cos(30 * t):.6g},{-np.sin(9 * t):.6g}" for t in time]
    csv = "\n".join(["time [s],z_road [m],a_body [m/s^2],a_wheel [m/s^2]", *rows]).encode()
    german = "\n".join(["t;z_road (mm)", *(f"{t:.3f};{np.sin(t):.4f}".replace(".", ",") for t in time)]).encode()
    models = [(NQVM / "nqvm.toml").read_bytes(), *(path.read_bytes() for path in sorted((gate.HERE / "small").glob("*.toml")))]
    return [
        Reader("model", ".toml", lambda path: penode_gen.render(penode_gen.load(path)), models),
        Reader("json", ".json", read_json, [path.read_bytes() for path in sorted((gate.HERE / "small").glob("*.json"))]),
        Reader("onnx", ".onnx", read_onnx, [path.read_bytes() for path in sorted((NQVM / "networks").glob("*.onnx"))]),
        Reader(
            "scenario",
            ".toml",
            lambda path: scenario.load(path, nqvm, length),
            [path.read_bytes() for path in sorted((gate.ROOT / "sil" / "scenarios").glob("*.toml"))],
        ),
        Reader("recording", ".csv", lambda path: measured.load([path], nqvm), [csv, german]),
        Reader("forms", ".csv", lambda path: (look.look(path, nqvm), _channels(path)), small_forms()),
        *([Reader("mdf", ".mf4", lambda path: measured.load([path], nqvm), mdf_files.good(), share=0.05)] if mdf_files.asammdf else []),
    ]


def small_forms() -> list[bytes]:
    """Recordings in many forms, the first rows of each: whole lines, or whole characters of four bytes at most."""
    every = [form.data for form in recording_forms.FORMS.values()]
    short = [data[: max(2400, 2000 + 2000 * data[:400].count(0) // 200) // 4 * 4] for data in every]
    return [data if b"\0" in data else data.rpartition(b"\n")[0] or data for data in short]


def _channels(path: Path) -> object:
    return on_raster(read(path, [*recording_forms.UNITS, "time"]), recording_forms.UNITS, recording_forms.STEP)


def _too_long(*_: object) -> None:
    raise TimeoutError("it takes too long")


def check(tries: int, seed: int = 1, only: Collection[str] = ()) -> tuple[list[str], dict[str, dict[str, int]]]:
    """So many files for each reader (or those of these names): failures, and per reader how many files were tried and taken, and
    messages seen."""
    signal.signal(signal.SIGPROF, _too_long)
    with tempfile.TemporaryDirectory() as place, mdf_files.quick():
        every = [reader for reader in readers(Path(place)) if not only or reader.name in only]
        good = [
            f"{reader.name}: a good file is refused" for reader in every if failure(reader, _put(reader, Path(place))) or not reader.taken
        ]
        found = good + [problem for reader in every for problem in search(reader, tries, Path(place), seed)]
    return found, {r.name: {"files": r.tried, "taken": r.taken, "messages": len(r.messages)} for r in every}


def _put(reader: Reader, folder: Path) -> Path:
    """The first good file of a reader."""
    path = folder / f"file{reader.suffix}"
    path.write_bytes(reader.files[0])
    return path


def _raises(path: Path) -> object:
    return float(path.read_bytes().split(b"=")[1])


def _says_nothing(path: Path) -> object:
    raise UserError("")


def _shows_a_trace(path: Path) -> object:
    raise UserError("Traceback (most recent call last): ...")


def _computes_nan(path: Path) -> object:
    return np.float64(len(path.read_bytes())) * np.inf * 0


def _hangs(path: Path) -> object:
    while path.exists():
        pass
    return None


FAULTS = {
    "an exception gets out": _raises,
    "refused without a word": _says_nothing,
    "a trace instead of words": _shows_a_trace,
    "goes on with NaN": _computes_nan,
    "hangs": _hangs,
}


def faults_missed() -> list[str]:
    """Readers that do what none may: those that are not found out."""
    signal.signal(signal.SIGPROF, _too_long)
    with tempfile.TemporaryDirectory() as place:
        return [
            f"not found: {fault}"
            for fault, read in FAULTS.items()
            if not search(Reader("faulty", ".toml", read, [b"a = 1\n"], limit=1), 3, Path(place))
        ]


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--files", type=int, default=2000, help="for each reader")
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--only", nargs="*", default=(), help="readers; all if not given")
    options.add_argument("--as", dest="key", default="readers", help="key in figures.json")
    given = options.parse_args()
    problems, seen = check(given.files, given.seed, given.only)
    total = sum(row["files"] for row in seen.values())
    good = gate.report(f"readers: {total} damaged files: all taken or refused in words", problems[:20])
    missed = faults_missed()
    good &= gate.report(f"readers: {len(FAULTS) - len(missed)} of {len(FAULTS)} faulty readers found", missed)
    gate.keep(
        given.key, {"files": total} | seen | {"failures": len(problems), "faults": list(FAULTS), "faults found": len(FAULTS) - len(missed)}
    )
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
