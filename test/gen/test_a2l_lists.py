# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A2L: static DAQ lists of a program, units that are not SI, event cycles."""

from __future__ import annotations

import dataclasses
import importlib.util
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from models import RICH, network_file

import penode_gen
from penode_gen import exports
from penode_gen.exports.a2l import a2l, elf_types, lists as a2l_lists
from penode_sil.calibration import a2l_read, measure, virtual
from penode_sil.errors import UserError

ROOT = Path(__file__).resolve().parents[2]
A2LTOOL = Path(sys.executable).with_name("a2ltool")
OURS = {"mm", "kN", "km/h", "g"}  # units of the model file that are not SI

pytestmark = pytest.mark.skipif(importlib.util.find_spec("elftools") is None, reason="pyelftools is not installed: pip install penode[xcp]")

LISTS = """#include "penode/pen_xcp_static.h"
static struct { float a; uint16_t b[2]; } shown = { 1.0F, { 2U, 3U } };
static const pen_xcp_entry_t constant[4] = {
    { (const uint8_t *)&shown.a, 4U }, { (const uint8_t *)&shown.b[1], 2U }, { NULL, 0U }, { (const uint8_t *)&shown, 8U }
};
static const pen_xcp_static_t list[3] = { { 2U, 2U, constant }, { 3U, 1U, NULL }, { 1U, 4U, NULL } };
const pen_xcp_statics_t penode_daq_lists = { 3U, list };
int main(void) { return penode_daq_lists.list[0].entry[0].byte[0]; }
"""


def compiled(folder: Path, text: str, *options: str) -> elf_types.Program:
    source, elf = folder / "program.c", folder / "program"
    source.write_text(text)
    subprocess.run(["gcc", "-g", "-no-pie", *options, f"-I{ROOT}/inc", f"-I{ROOT}/port/gnu", source, "-o", elf], check=True)
    return elf_types.read_program(elf)


@pytest.fixture(scope="module")
def scaled(tmp_path_factory: pytest.TempPathFactory) -> tuple[penode_gen.Model, Path]:
    """A model in units that are not SI, with a sample time that XCP has no code for, and its virtual controller."""
    folder = tmp_path_factory.mktemp("scaled")
    network_file(folder / "n2.json", [2, 5, 1], ["relu", "identity"], seed=5)
    text = RICH.format(h="0.0000625", method="rk4", substeps=1, input="held", outside="extrapolate", foot_damper="")
    text = text.replace('m = { value = 2, unit = "kg"', 'm = { value = 2000, unit = "g"').replace(
        'F = { unit = "N" }', 'F = { unit = "kN", min = -2, max = 3 }', 1
    )
    text = text.replace('q = { value = "q", unit = "m" }', 'q = { value = "q", unit = "mm" }\nspeed = { value = "v", unit = "km/h" }')
    (folder / "scaled.toml").write_text(text)
    model = penode_gen.load(folder / "scaled.toml")
    return model, virtual.build(model)


def test_lists_are_those_of_the_constants(tmp_path: Path) -> None:
    program = compiled(tmp_path, LISTS)
    at = program.find("shown").address
    first, second, third = a2l_lists.static_lists(program)
    assert first.predefined == (((0, at, 4, 255), (1, at + 6, 2, 255)), ((1, at, 8, 255),))
    assert [(one.number, one.odts, one.entries, one.first) for one in (first, second, third)] == [(0, 2, 2, 0), (1, 3, 1, 2), (2, 1, 4, 5)]
    assert second.predefined == third.predefined == ()
    assert a2l_lists.static_lists(compiled(tmp_path, "int a; int main(void) { return 0; }")) == []


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (
            "const int penode_daq_lists = 3; int main(void) { return 0; }",
            "of the type int; make it a constant of the type pen_xcp_statics_t",
        ),
        (
            '#include "penode/pen_xcp_static.h"\nconst pen_xcp_statics_t penode_daq_lists = { 1U, NULL }; int main(void) { return 0; }',
            "make it, its lists and their entries constants",
        ),
        (
            (
                '#include "penode/pen_xcp_static.h"\n'
                "const pen_xcp_statics_t penode_daq_lists = { 1U, (const pen_xcp_static_t *)16 }; int main(void) { return 0; }"
            ),
            "is not in the file",
        ),
    ],
)
def test_what_is_no_list_is_one_line(tmp_path: Path, text: str, line: str) -> None:
    with pytest.raises(exports.ExportError) as refused:
        a2l_lists.static_lists(compiled(tmp_path, text))
    assert len(refused.value.problems) == 1 and line in refused.value.problems[0]


def tool(*words: object) -> str:
    done = subprocess.run([A2LTOOL, *map(str, words)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.mark.skipif(not A2LTOOL.exists(), reason="a2ltool is not installed: pip install a2ltool")
def test_a2ltool_takes_lists_and_units(scaled: tuple[penode_gen.Model, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model, program = scaled
    lists = a2l_lists.static_lists(compiled(tmp_path, LISTS))
    monkeypatch.setattr(a2l, "static_lists", lambda _: lists)
    path, kept = tmp_path / "x.a2l", tmp_path / "kept.a2l"
    text = virtual.describe(model, program, "tcp:127.0.0.1:5555")
    assert "STATIC 3 0x01 1" in text and "DYNAMIC" not in text and "ALLOC_DAQ" not in text and text.count("ODT_ENTRY ") == 3
    path.write_text(text)
    assert tool(path, "--strict", "--check").strip() == "Consistency check complete. No problems found."
    tool(path, "--insert-a2ml", "--ifdata-cleanup", "-o", kept)
    assert kept.read_text().count("/begin IF_DATA") == text.count("/begin IF_DATA")
    path.write_text(text.replace("FIRST_PID", "LAST_PID"))
    tool(path, "--insert-a2ml", "--ifdata-cleanup", "-o", kept)
    assert kept.read_text().count("/begin IF_DATA") == text.count("/begin IF_DATA") - 1


def test_units_of_the_model_file_are_shown(scaled: tuple[penode_gen.Model, Path]) -> None:
    model, program = scaled
    text = virtual.describe(model, program, "tcp:127.0.0.1:5555")
    found = a2l_read.parse(text, "a2l")
    entries = found.measurements | found.characteristics
    assert {entry.unit for entry in entries.values()} >= OURS
    assert {name: entries[name].shown(1.0) for name in ("q", "speed", "F", "m", "a")} == pytest.approx(
        {"q": 1e3, "speed": 3.6, "F": 1e-3, "m": 1e3, "a": 1.0}, rel=1e-15
    )
    assert entries["state.q"].unit == "m" and entries["a"].shown(np.float32(0.1)) == np.float32(0.1)
    assert 'F "" FLOAT32_IEEE unit_kN 0 0 -2 3' in text.replace("-2.0000000000000000", "-2")
    log = measure.Log(np.zeros(2), {"q": np.array([0.0, 0.25], np.float32), "a": np.array([0.1, 0.2], np.float32)}, 0, 1e-3)
    columns = {column.name: column for column in measure.columns(log, found)}
    assert (columns["q"].unit, *columns["q"].values) == ("mm", 0.0, 250.0) and columns["a"].values.dtype == np.float32


def test_conversions_of_other_tools_are_read() -> None:
    text = (
        '/begin PROJECT p "" /begin MODULE m "" {} /begin MEASUREMENT x "" FLOAT32_IEEE c 0 0 0 1 '
        "ECU_ADDRESS 0x10 /end MEASUREMENT /end MODULE /end PROJECT"
    )
    for method, unit, shown in (
        ('/begin COMPU_METHOD c "" RAT_FUNC "%6.3" "degC" COEFFS 0 2 10 0 0 4 /end COMPU_METHOD', "degC", 1.0),  # 4 * 3 = 2 x + 10
        ('/begin COMPU_METHOD c "" LINEAR "%6.3" "degC" COEFFS_LINEAR 2 -5 /end COMPU_METHOD', "degC", 1.0),
        ('/begin COMPU_METHOD c "" RAT_FUNC "%6.3" "x" COEFFS 1 0 0 0 0 1 /end COMPU_METHOD', "", 3.0),  # a root: not linear
        ('/begin COMPU_METHOD c "" TAB_VERB "%6.3" "x" COMPU_TAB_REF t /end COMPU_METHOD', "", 3.0),
    ):
        entry = a2l_read.parse(text.format(method), "a2l").measurements["x"]
        assert (entry.unit, entry.shown(3.0)) == (unit, shown)


def test_period_of_the_event_is_exact_or_not_stated(scaled: tuple[penode_gen.Model, Path]) -> None:
    model, program = scaled
    assert "DAQ 0x04 0 0 0x00" in virtual.describe(model, program, "tcp:127.0.0.1:5555")  # 62.5 us: 625 times 100 ns
    assert virtual.period(model) == 62500
    for seconds, coded in (
        (1e-3, (1, 6)),
        (2.5e-4, (25, 4)),
        (333e-6, (0, 0)),
        (3.2e-6, (32, 2)),
        (260e-6, (26, 4)),
        (10.0, (10, 9)),
        (300.0, (0, 0)),
    ):
        assert a2l._cycle(seconds) == coded
    for seconds in (1.0 / 3000.0, 1e-7):
        with pytest.raises(UserError, match="is not a whole number of nanoseconds"):
            virtual.period(dataclasses.replace(model, sample_time=seconds))
