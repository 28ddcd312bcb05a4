# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a program gets of an error: code, exit code, and where and what is wrong, in the words that stderr has."""

from __future__ import annotations

import ast
import copy
import json
import pickle
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import pytest
from places import HERE, ROOT

import penode_gen
from penode_gen.exports import ExportError
from penode_sil import errors
from penode_sil.cli import main
from penode_sil.errors import PenodeError, Problem, UserError

MODEL = HERE / "models" / "oscillator.toml"
TRAINABLE = ROOT / "test" / "training" / "quarter.toml"
SCENARIO = """duration = "1 s"
[input.foot]
kind = "constant"
value = "1 mm"
[[instance]]
name = "a"
exchange = [{ time = "0.3 s", set = "softer" }]
"""
RUN = ["-o", "o.csv", "--json"]


@pytest.fixture
def failing(tmp_path, monkeypatch, capsys):
    """failing(*words) runs a command in a folder with wrong files; gives its object, whose problems are the lines of stderr."""
    monkeypatch.chdir(tmp_path)
    Path("s.toml").write_text(SCENARIO)
    Path("syntax.toml").write_text("duration = \n")
    Path("bad.toml").write_text(MODEL.read_text().replace("value = 800", "value = inf"))
    Path("bad.csv").write_text("time [s],foot [mm]\n0,0\n1,nan\n")
    Path("other.csv").write_text("time [s],foot [kg]\n0,0\n1,1\n")
    Path("spring_net.onnx").write_text("nonsense")

    def run(*words):
        monkeypatch.setattr(sys, "argv", ["penode", *map(str, words)])
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = capsys.readouterr()
        found = json.loads(out)["error"]
        assert ended.value.code == found["exit"]
        lines = err.splitlines()
        assert len(lines) == len(found["problems"])
        for line, problem in zip(lines, found["problems"], strict=True):
            assert set(problem) == {"message", "place", "line", "key", "remedy", "channel"}
            assert line.startswith("penode: ") and all(str(part) in line for part in problem.values() if part is not None)
        return found

    return run


CASES = [
    ("model-file", ["simulate", "bad.toml", "--scenario", "s.toml", *RUN], {"place": "bad.toml", "line": 13, "key": "parameters.c.value"}),
    ("recording", ["simulate", MODEL, "--input", "bad.csv", *RUN], {"place": "bad.csv", "line": 3, "channel": "foot"}),
    ("recording", ["simulate", MODEL, "--input", "other.csv", *RUN], {"place": "other.csv", "line": 1, "channel": "foot"}),
    ("recording", ["inspect", "none.csv", "--json"], {"place": "none.csv", "remedy": "name a CSV file that can be read"}),
    ("scenario", ["simulate", MODEL, "--scenario", "s.toml", *RUN], {"place": "s.toml", "key": "instance[1].exchange[1].set"}),
    ("scenario", ["simulate", MODEL, "--scenario", "syntax.toml", *RUN], {"place": "syntax.toml", "line": 1, "remedy": "correct it there"}),
    ("network", ["train", TRAINABLE, "--data", "bad.csv", "--from", "spring_net.onnx", "-o", "t", "--json"], {"line": None}),
    ("target", ["stage", "--back", "--to", "tcp:127.0.0.1:1", "--json"], {"place": "tcp:127.0.0.1:1", "message": "nothing answers there"}),
    (
        "usage",
        ["simulate", MODEL, "--scenario", "s.toml", "--on", "hil", *RUN],
        {"place": "--on", "remedy": "use mil, sil, pil or pil:MACHINE"},
    ),
    ("usage", ["stage", "--back", "--to", "here", "--json"], {"place": "--to"}),
    ("usage", ["serve", MODEL, "--tcp", "x", "--json"], {"place": "--tcp", "line": None}),
    ("usage", ["simulate", MODEL, "--scenarios", "s.toml", *RUN], {"place": "--scenarios"}),
    ("usage", ["frobnicate", "--json"], {"place": None}),
]


@pytest.mark.parametrize(
    ("code", "words", "parts"), CASES, ids=[f"{code}-{words[-4]}" if len(words) > 3 else code for code, words, _ in CASES]
)
def test_each_code_by_a_command(failing, code, words, parts):
    if code == "target":
        pytest.importorskip("pyxcp")
    found = failing(*words)
    assert found["code"] == code and found["exit"] == 2 and set(found) == {"code", "exit", "problems"}
    (problem,) = found["problems"]
    assert problem["remedy"] and problem["message"]
    assert {name: problem[name] for name in parts} == parts


def test_a_compiler_that_is_missing(failing, monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("PENODE_BUILD", str(tmp_path / "build"))
    (tmp_path / "s.toml").write_text(SCENARIO.replace("softer", "stiff"))
    found = failing("simulate", MODEL, "--scenario", "s.toml", "--on", "sil", *RUN)
    assert (found["code"], found["exit"]) == ("tool-missing", 2) and found["problems"][0]["message"] == "gcc is not installed"


def test_a_fault_of_ours_names_the_traceback(failing, monkeypatch):
    def load(path: Path) -> None:
        raise RuntimeError("lost")

    monkeypatch.setattr(penode_gen, "load", load)
    found = failing("compare", MODEL, "--to", "tcp:127.0.0.1:1", "--json")
    assert (found["code"], found["exit"], len(found["problems"])) == ("internal", 3, 1)
    text = Path(found["traceback"]).read_text()
    assert "RuntimeError: lost" in text and found["traceback"] in found["problems"][0]["remedy"]


def test_a_variable_of_the_environment(tmp_path):
    code = "import penode_sil.cli"
    environment = {"PYTHONPATH": f"{ROOT / 'gen'}:{ROOT / 'sil'}", "SOURCE_DATE_EPOCH": "x"}
    done = subprocess.run([sys.executable, "-c", code, "--json"], env=environment, capture_output=True, text=True)
    found = json.loads(done.stdout)["error"]
    assert (done.returncode, found["code"], found["problems"][0]["place"]) == (2, "usage", "SOURCE_DATE_EPOCH")


def test_without_json_stdout_is_empty(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["penode", "inspect", "none.csv"])
    with pytest.raises(SystemExit):
        main()
    assert capsys.readouterr().out == ""


def leaves(of: type[PenodeError] = PenodeError) -> Iterator[type[PenodeError]]:
    """All classes of the tree with a code of their own."""
    for kind in of.__subclasses__():
        if "code" in vars(kind) and kind is not UserError:
            yield kind
        yield from leaves(kind)


def test_the_page_has_all_codes():
    page = (ROOT / "sil" / "ERRORS.md").read_text()
    rows = re.findall(r"^\| `([a-z-]+)` \| (\d) \| `(\w+)` \| .+ \|$", page, re.M)
    assert sorted(rows) == sorted((kind.code, str(kind.exit), kind.__name__) for kind in leaves())
    assert len({code for code, _, _ in rows}) == len(rows)
    assert {name for _, _, name in rows} <= set(errors.__all__)


def test_an_export_whose_options_are_wrong():
    assert ExportError("--set: no such; x").code == ExportError("--a: b; c", "--d: e; f").code == "usage"
    assert ExportError("m.toml: it has no form; x").code == ExportError("--a: b; c", "m.toml: e; f").code == "model-file"


FORMS = {
    "a b/r.csv:3: channel foot has no finite value there; cut it": ("a b/r.csv", 3, "", "channel foot has no finite value there", "cut it"),
    'my rec.csv: channel x: kg: no; "a: b", c': ("my rec.csv", None, "", "channel x: kg: no", '"a: b", c'),
    's.toml: instance[2].exchange[1].set: "softer" is not known; use one': (
        "s.toml",
        None,
        "instance[2].exchange[1].set",
        '"softer" is not known',
        "use one",
    ),
    "--known m_b='3 s': m_b is measured in kg; write it": ("--known m_b='3 s'", None, "", "m_b is measured in kg", "write it"),
    "--scheduler tcp://h:1: no answer; start one": ("--scheduler tcp://h:1", None, "", "no answer", "start one"),
    "tcp:127.0.0.1:5555: nothing answers there; start it": ("tcp:127.0.0.1:5555", None, "", "nothing answers there", "start it"),
    "serial:/dev/ttyS1:9600: it cannot be opened; name another": (
        "serial:/dev/ttyS1:9600",
        None,
        "",
        "it cannot be opened",
        "name another",
    ),
    "PENODE_BUILD: f is a file; name a directory; or not": ("PENODE_BUILD", None, "", "f is a file; name a directory", "or not"),
    'channel "a: b" is not understood; write it': ("", None, "", 'channel "a: b" is not understood', "write it"),
    "serve needs one of --tcp PORT and --udp PORT; use --tcp 5555": (
        "",
        None,
        "",
        "serve needs one of --tcp PORT and --udp PORT",
        "use --tcp 5555",
    ),
    "it is damaged": ("", None, "", "it is damaged", ""),
    "; ": ("", None, "", "", ""),
}


@pytest.mark.parametrize("text", FORMS)
def test_a_line_is_split(text):
    problem = Problem.read(text)
    assert (problem.place, problem.line, problem.key, problem.message, problem.remedy) == FORMS[text]
    for same in (problem, pickle.loads(pickle.dumps(problem)), copy.deepcopy(problem), Problem.read(problem)):
        assert same == text == str(same) and same.as_json() == problem.as_json()


def test_a_problem_is_its_line():
    assert asdict(Kept([Problem("no number", "m.toml")])) == {"lines": ["m.toml: no number"]}
    assert Problem("no number", "m.toml", 3, "parameters.m", "give one") == "m.toml:3: parameters.m: no number; give one"
    assert Problem("no number", "--set") == "--set: no number" and Problem("no number", remedy="x") == "no number; x"


@dataclass
class Kept:
    """As results keep what was wrong with a recording."""

    lines: list[str]


def raised() -> Iterator[tuple[str, str]]:
    """Place in the sources, and text, of each problem that is written where it is raised; `a b/f.x` for each value in it."""
    kinds = {kind.__name__ for kind in leaves()} | {"ExportError", "ImportProblem", "UserError"}
    for path in [*(ROOT / "gen").rglob("*.py"), *(ROOT / "sil").rglob("*.py")]:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in kinds and node.args:
                first = node.args[0].elts[0] if isinstance(node.args[0], ast.List) else node.args[0]
                where = f"{path.relative_to(ROOT)}:{node.lineno}"
                assert node.func.id != "UserError", f"{where}: raise one of its classes"
                if isinstance(first, ast.JoinedStr):
                    parts = [p.value if isinstance(p, ast.Constant) else "a b/f.x" for p in first.values]
                    yield where, "".join(map(str, parts))


def test_every_raised_text_is_split_where_its_place_ends():
    texts = dict(raised())
    assert len(texts) > 150
    for where, text in texts.items():
        expected = re.match(r"((?:--[\w-]+|a b/f\.x)(?: a b/f\.x)?): ", text)
        problem = Problem.read(text)
        assert problem.place == expected[1] if expected else text.startswith(problem.place), (where, problem.as_json())
        assert problem.remedy or "; " not in text, (where, problem.as_json())
