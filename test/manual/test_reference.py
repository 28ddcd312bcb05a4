# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The generated reference has every cause, make target and C function; those are counted by other means than the pages are made by."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import c_api
import causes
import jsonschema
import pytest
import schemas
import targets

import penode_gen
from penode_sil import scenario
from penode_sil.diagnosis import catalogue
from penode_sil.diagnosis.catalogue import drives
from penode_sil.errors import RecordingError

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def of_causes() -> str:
    return causes.page()


@pytest.fixture(scope="module")
def found() -> dict[str, causes.Known]:
    return causes.known()


@pytest.mark.parametrize("kind", catalogue.MEANING)
def test_every_cause(kind: str, of_causes: str) -> None:
    section = re.search(rf"^## {kind}\n(.*?)(?=^## |\Z)", of_causes, re.MULTILINE | re.DOTALL)
    assert section and catalogue.MEANING[kind] in section[1]
    assert re.search(r"^Where it can be: \w.*\.$", section[1], re.MULTILINE), "nothing says where it can be: WHERE of its file"
    assert re.search(rf"^\| \[`{kind}`\]\(#{kind}\) \| {re.escape(catalogue.MEANING[kind])} \| (\d+ of \d+|-) \|$", of_causes, re.MULTILINE)
    for pair in catalogue.RIVALS:
        assert kind not in pair or all(f"](#{other})" in section[1] for other in pair - {kind})


def test_causes_are_printed(of_causes: str) -> None:
    """As README.md and sil/README.md promise."""
    done = subprocess.run([sys.executable, ROOT / "sil/manual/causes.py"], capture_output=True, text=True, check=True)
    assert done.stdout == of_causes + "\n"


@pytest.mark.parametrize("kind", [*catalogue.OF, *drives.KINDS])
def test_every_parameter_is_explained(kind: str, found: dict[str, causes.Known]) -> None:
    units = found[kind].units
    assert units and set(causes.meanings().get(kind, {})) == set(units), "say what each means in PARAMETERS of its file"


def test_kinds_of_the_campaigns_are_kinds() -> None:
    found = causes.rates()
    assert len(found) >= 20 and set(found) <= set(catalogue.MEANING)
    assert all(0 <= right <= of for right, of in found.values())


def test_every_make_target() -> None:
    files = [ROOT / "Makefile", *ROOT.glob("test/**/*.mk")]
    documented = {m for f in files for m in re.findall(r"^([a-z][a-z-]*):[^=\n]*## ", f.read_text(encoding="utf-8"), re.MULTILINE)}
    page = targets.page()
    assert len(documented) > 30
    assert documented == set(re.findall(r"^\| `make ([a-z-]+)` \| \S", page, re.MULTILINE))


@pytest.mark.parametrize("header", [h for h in c_api.headers() if re.match(r"inc/(?!.*pen_ekf)", h)])  # that of the filter lacks one
def test_every_function_of_the_runtime_has_a_comment(header: str) -> None:
    assert [f.name for f in c_api.functions((ROOT / header).read_text(encoding="utf-8")) if not f.comment.strip()] == []


PROMISED = """[model]
extends = "ROOT/gen/nqvm/nqvm_folded.toml"
name = "promised"
trial = 100

[networks]
spring_net = { inputs = ["m"], output = "N", max_slope = "130000 N/m" }
"""


@pytest.mark.parametrize("text", [(ROOT / "sil/filter/watched.toml").read_text(encoding="utf-8"), PROMISED], ids=["monitor", "promises"])
def test_every_function_of_generated_headers_has_a_comment_of_its_own(text: str, tmp_path: Path) -> None:
    """With what it returns, and that of a step or a set with its context."""
    model = text.replace("ROOT", str(ROOT)).replace('"quarter.toml"', f'"{ROOT}/sil/filter/quarter.toml"')
    (tmp_path / "model.toml").write_text(model, encoding="utf-8")
    penode_gen.generate(penode_gen.load(tmp_path / "model.toml"), tmp_path)
    found = [f for path in sorted(tmp_path.glob("*.h")) for f in c_api.functions(path.read_text(encoding="utf-8"))]
    comments = [f.comment for f in found]
    assert len(found) > 25 and [f.name for f in found if "@return" not in f.comment] == []
    assert [f.name for f in found if comments.count(f.comment) > 1 and "@return as" not in f.comment] == []
    own = [f for f in found if not re.search(r"_ekf_|_monitor_|_step_jacobian$|_selftest$", f.name)]
    assert [f.name for f in own if "ontext: " not in f.comment] == []


def test_every_function_of_the_headers(tmp_path: Path) -> None:
    """As gcc lists them."""
    own = sorted(p.name for p in (ROOT / "inc/penode").glob("*.h"))
    (tmp_path / "all.c").write_text("".join(f'#include "penode/{name}"\n' for name in own) + '#include "nqvm.h"\n')
    include = [f"-I{ROOT / name}" for name in ("inc", "port/gnu", "gen/nqvm/c")]
    subprocess.run(["gcc", "-std=c99", *include, "-fsyntax-only", "-aux-info", tmp_path / "list", tmp_path / "all.c"], check=True)
    line = re.compile(r"^/\* \S*?((?:inc/penode|nqvm/c)/\w+\.h):\d+:\w+ \*/ [^(]*?(\w+) \(", re.MULTILINE)
    listed = {(Path(m[1]).name, m[2]) for m in line.finditer((tmp_path / "list").read_text())}
    page = c_api.page()
    shown = set()
    for part in re.split(r"^## ", page, flags=re.MULTILINE)[1:]:
        shown |= {(Path(part.split("\n")[0]).name, name) for name in re.findall(r"^### (\w+)$", part, re.MULTILINE)}
    assert len(listed) > 150
    assert shown == listed


def test_every_kind_and_key_of_a_scenario() -> None:
    page = (ROOT / "sil/manual/reference/scenario.md").read_text(encoding="utf-8")
    source = (ROOT / "sil/penode_sil/scenario.py").read_text(encoding="utf-8")
    keys = set(re.findall(r'\.(?:quantity|text|integer|flag|table|tables|has)\("(\w+)"', source))
    assert all(f"| `{kind}` |" in page for kind in scenario.KINDS)
    assert len(keys) > 20 and {key for key in keys if not re.search(rf"[`.\[]{key}\b", page)} == set()


@pytest.mark.parametrize("name", schemas.NAMES)
def test_schemas_are_schemas(name: str) -> None:
    found = schemas.schema(name)
    jsonschema.Draft202012Validator.check_schema(found)
    assert re.fullmatch(rf"penode:{name}:\d+\.\d+\.\d+", found["$id"])
    assert found["$id"] in schemas.page()


def test_an_error_fits_its_schema() -> None:
    written = json.loads(json.dumps(RecordingError("r.csv:3: channel foot is empty; cut it", channel="foot").as_json()))
    jsonschema.validate(written, schemas.schema("error"))
    del written["error"]["code"]
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(written, schemas.schema("error"))
