# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A2L: every characteristic lies where the program has it, checked against the network files, the linker and foreign tools."""

from __future__ import annotations

import importlib.util
import itertools
import re
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from models import RICH, network_file

import penode_gen
from penode_gen import exports
from penode_gen.exports.a2l import a2l, elf_types
from penode_gen.sets import layout
from penode_sil.calibration import a2l_read, virtual

ROOT = Path(__file__).resolve().parents[2]
NQVM = ROOT / "gen" / "nqvm" / "nqvm.toml"
A2LTOOL = Path(sys.executable).with_name("a2ltool")
SIZES = [2, 22, 5, 1]  # rows in blocks of 16, 4, 1, 1; then 4, 1

pytestmark = pytest.mark.skipif(importlib.util.find_spec("elftools") is None, reason="pyelftools is not installed: pip install penode[xcp]")


@pytest.fixture(scope="module")
def rich(tmp_path_factory: pytest.TempPathFactory) -> tuple[penode_gen.Model, dict]:
    """A model with a tunable mass and a network of layers that are not square, and what its file says."""
    folder = tmp_path_factory.mktemp("rich")
    written = network_file(folder / "n2.json", SIZES, ["relu", "relu", "identity"], seed=5)
    text = RICH.format(h="0.001", method="rk4", substeps=1, input="held", outside="extrapolate", foot_damper="")
    (folder / "rich.toml").write_text(text)
    return penode_gen.load(folder / "rich.toml"), written


@pytest.fixture(scope="module")
def program(rich: tuple[penode_gen.Model, dict]) -> Path:
    return virtual.build(rich[0])


@pytest.fixture(scope="module")
def text(rich: tuple[penode_gen.Model, dict], program: Path) -> str:
    return virtual.describe(rich[0], program, "tcp:127.0.0.1:5555")


def in_elf(program: Path, address: int, n: int) -> bytes:
    """Bytes of the program's file, by objdump: no code of ours."""
    shown = subprocess.run(
        ["objdump", "-s", f"--start-address={address}", f"--stop-address={address + n}", program],
        capture_output=True,
        text=True,
        check=True,
    )
    rows = [line[1:].split("  ")[0].split()[1:] for line in shown.stdout.splitlines() if re.match(r" [0-9a-f]+ ", line)]
    return bytes.fromhex("".join("".join(row) for row in rows))


def test_blocks_are_the_weights_of_the_file(rich: tuple[penode_gen.Model, dict], program: Path, text: str) -> None:
    model, written = rich
    a2l = a2l_read.parse(text, "a2l")
    total = 0
    for n, layer in enumerate(written["layers"], start=1):
        weights = np.zeros((0, len(layer["weights"][0])), np.float32)
        for name, entry in a2l.characteristics.items():
            if re.fullmatch(rf"n2\.weights_{n}(\.rows_\d+_\d+)?", name):
                found = np.frombuffer(in_elf(program, entry.address, entry.size), "<f4")
                weights = np.vstack([weights, found.reshape(entry.sizes[1], entry.sizes[0]).T])  # the first size is the fastest
        assert (weights == np.array(layer["weights"], np.float32)).all()
        total += weights.size
    assert total == sum(a * b for a, b in itertools.pairwise(SIZES))
    mass = a2l.characteristics["m"]
    assert (mass.sizes, mass.unit) == ((), "kg") and np.frombuffer(in_elf(program, mass.address, 4), "<f4")[0] == 2.0
    names = {f"n2.weights_1.rows_{rows}" for rows in ("0_15", "16_19", "20_20", "21_21")}
    assert names <= a2l.characteristics.keys()
    assert sum(entry.count for entry in a2l.characteristics.values()) == layout.length(model)


def test_units_limits_and_signals(text: str) -> None:
    a2l = a2l_read.parse(text, "a2l")
    assert {name: a2l.measurements[name].unit for name in ("q", "a", "F", "v", "F_lag", "w")} == {
        "q": "m",
        "a": "m/s^2",
        "F": "N",
        "v": "m/s",
        "F_lag": "N",
        "w": "N",
    }
    assert a2l.epk is not None and a2l.epk[0].startswith("rich ")


@pytest.mark.skipif(not A2LTOOL.exists(), reason="a2ltool is not installed: pip install a2ltool")
@pytest.mark.parametrize(
    "transport", ["tcp:127.0.0.1:5555", "udp:10.0.0.1:5555", "serial:115200", "can:0x100:0x101", "canfd:0x18DA00F1:0x18DAF100"]
)
def test_a2ltool_reports_nothing(rich: tuple[penode_gen.Model, dict], program: Path, tmp_path: Path, transport: str) -> None:
    path, kept = tmp_path / "x.a2l", tmp_path / "kept.a2l"

    def tool(*words: object) -> str:
        done = subprocess.run([A2LTOOL, *map(str, words)], capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout + done.stderr

    path.write_text(virtual.describe(rich[0], program, transport))
    assert tool(path, "--strict", "--check").strip() == "Consistency check complete. No problems found."
    tool(path, "--insert-a2ml", "--ifdata-cleanup", "-o", kept)  # drops each IF_DATA that is not as the standard's A2ML has it
    assert kept.read_text().count("/begin IF_DATA") == path.read_text().count("/begin IF_DATA")
    path.write_text(path.read_text().replace("OVERLOAD_INDICATION_EVENT", "OVERLOAD_INDICATION_NOWHERE"))
    tool(path, "--insert-a2ml", "--ifdata-cleanup", "-o", kept)
    assert kept.read_text().count("/begin IF_DATA") == path.read_text().count("/begin IF_DATA") - 1


@pytest.mark.skipif(not A2LTOOL.exists(), reason="a2ltool is not installed: pip install a2ltool")
def test_a2ltool_finds_the_same_addresses_in_the_elf(program: Path, text: str, tmp_path: Path) -> None:
    path, found = tmp_path / "x.a2l", tmp_path / "found.a2l"
    path.write_text(re.sub(r"(ECU_ADDRESS|VAL_BLK|VALUE) 0x[0-9A-F]{8}", r"\1 0x00000010", text))
    subprocess.run([A2LTOOL, path, "--elffile", program, "--update", "ADDRESSES", "-o", found], check=True, capture_output=True)
    ours, theirs = a2l_read.parse(text, "ours"), a2l_read.parse(found.read_text(), "theirs")
    for kind in ("characteristics", "measurements"):
        addresses = [{name: entry.address for name, entry in getattr(a2l, kind).items()} for a2l in (ours, theirs)]
        assert addresses[0] == addresses[1]


@pytest.mark.skipif(not A2LTOOL.exists(), reason="a2ltool is not installed: pip install a2ltool")
def test_a2ltool_makes_the_same_measurements_out_of_the_types_in_the_elf(program: Path, text: str, tmp_path: Path) -> None:
    """The second way: types, sizes and addresses without us. It does not carry to the set, which is one array in C: one block without
    names."""
    made = tmp_path / "made.a2l"
    links = {
        name: re.search(rf'MEASUREMENT {re.escape(name)} .*?SYMBOL_LINK "(.*?)"', text, re.S)[1]
        for name in a2l_read.parse(text, "a2l").measurements
    }
    words = [word for link in links.values() for word in ("--measurement", link)] + ["--characteristic", "rich_value_default"]
    subprocess.run([A2LTOOL, "--create", "--elffile", program, *words, "-o", made], check=True, capture_output=True)
    ours, theirs = a2l_read.parse(text, "ours"), a2l_read.parse(made.read_text(), "theirs")
    assert {name: (e.address, e.type) for name, e in ours.measurements.items()} == {
        name: (theirs.measurements[link].address, theirs.measurements[link].type) for name, link in links.items()
    }
    (whole,) = theirs.characteristics.values()
    assert (whole.address, whole.size) == ours.segment


@pytest.mark.skipif(shutil.which("pya2l") is None, reason="pya2l is not on the path: it needs an environment of its own")
def test_pya2l_reads_it(text: str, tmp_path: Path) -> None:
    """It remarks on each block in an IF_DATA, were it the only one in the file, and on nothing else."""
    path = tmp_path / "x.a2l"

    def remarks(text: str) -> list[str]:
        path.write_text(text)
        done = subprocess.run(["pya2l", path, "to_json", "-o", tmp_path / "x.json"], capture_output=True, text=True, check=True)
        json = (tmp_path / "x.json").read_text()
        assert all(f'"{name}"' in json for name in a2l_read.parse(text, "a2l").characteristics)
        return (done.stdout + done.stderr).splitlines()

    inside = [
        (text.count("\n", 0, m.start()) + 1, text.count("\n", 0, m.end()) + 1)
        for m in re.finditer(r"/begin IF_DATA.*?/end IF_DATA", text, re.S)
    ]
    for line in remarks(text):
        at, what = re.fullmatch(r"(\d+):\d+ (.*)", line).groups()
        assert "may be used at most once here" in what and any(first <= int(at) <= last for first, last in inside), line
    assert remarks(re.sub(r"/begin IF_DATA.*?/end IF_DATA", "", text, flags=re.S)) == []
    (only,) = remarks(
        re.sub(r"/begin IF_DATA.*?/end IF_DATA", "", text, flags=re.S).replace(
            "/end MODULE", "/begin IF_DATA XCP /begin PAG 0x01 /end PAG /end IF_DATA /end MODULE"
        )
    )
    assert only.endswith("PAG may be used at most once here, only the last occurrence is kept")


@pytest.mark.skipif(shutil.which("arm-none-eabi-gcc") is None, reason="arm-none-eabi-gcc is not installed")
def test_addresses_on_a_cortex_m_are_those_of_the_linker(tmp_path: Path) -> None:
    elf, c = tmp_path / "example.elf", ROOT / "gen" / "nqvm" / "c"
    source = [ROOT / "sil" / "firmware" / "example.c", *sorted((ROOT / "src").glob("*.c")), c / "nqvm.c", c / "nqvm_params.c"]
    subprocess.run([ROOT / "port/cortex-m/cc", "mps2-an386", "-std=c99", "-O1", "-g", f"-I{c}", *source, "-o", elf], check=True)
    model = penode_gen.load(NQVM)
    a2l = a2l_read.parse(exports.export(model, "a2l", Path("x.a2l"), {"elf": elf, "transport": "serial:115200"}).decode(), "a2l")
    listed = subprocess.run(["arm-none-eabi-nm", elf], capture_output=True, text=True, check=True).stdout
    symbol = {line.split()[2]: int(line.split()[0], 16) for line in listed.splitlines() if len(line.split()) == 3}
    at = {array.name: array.blocks[0].at for array in layout.arrays(model)}
    for name, entry in a2l.characteristics.items():
        assert entry.address == symbol["nqvm_value_default"] + 4 * at[name], name
    assert a2l.segment == (symbol["nqvm_value_default"], 4 * 1198)
    assert a2l.measurements["state.z_b"].address == symbol["model"] + 4 * 6  # row 1 of nqvm_t.row[3][6]
    assert a2l.measurements["z_road"].address == symbol["model"] + 4 * 18


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"elf": NQVM}, "cannot be read as an ELF program"),
        ({"elf": None}, "--elf: it is missing"),
        ({"instance": "nowhere"}, "has no variable nowhere; name one of: controller"),
        ({"instance": "shown"}, "name one of: controller"),
        ({"measure": "shown,nothing"}, "has no variable nothing"),
        ({"transport": "tcp:5555"}, "is none; use tcp:HOST:PORT"),
        ({"transport": "can:0x100:0x100"}, "is none; use tcp:HOST:PORT"),
        ({"epk": "nowhere"}, "has no variable nowhere"),
        ({"epk": "controller"}, 'holds "", which'),  # no text
    ],
)
def test_what_is_wrong_is_one_line(rich: tuple[penode_gen.Model, dict], program: Path, options: dict, line: str) -> None:
    with pytest.raises(exports.ExportError) as refused:
        exports.export(rich[0], "a2l", Path("x.a2l"), {"elf": program} | options)
    assert len(refused.value.problems) == 1 and line in refused.value.problems[0]


def test_program_of_another_model_or_without_debug_information_is_refused(
    rich: tuple[penode_gen.Model, dict], program: Path, tmp_path: Path
) -> None:
    with pytest.raises(exports.ExportError, match="no variable nqvm_set_default"):
        exports.export(penode_gen.load(NQVM), "a2l", Path("x.a2l"), {"elf": program})
    stripped = tmp_path / "stripped"
    subprocess.run(["objcopy", "--strip-debug", program, stripped], check=True)
    with pytest.raises(exports.ExportError, match="compile and link it with -g"):
        exports.export(rich[0], "a2l", Path("x.a2l"), {"elf": stripped})
    other = tmp_path / "rich.toml"
    network_file(tmp_path / "n2.json", [2, 21, 5, 1], ["relu", "relu", "identity"], seed=5)
    other.write_text(rich[0].path.read_text())
    with pytest.raises(exports.ExportError, match="generate the C of this model file again"):
        exports.export(penode_gen.load(other), "a2l", Path("x.a2l"), {"elf": program})


@pytest.mark.parametrize("dwarf", [2, 3, 4, 5])
def test_members_that_have_no_type_in_a2l_are_left_out_and_the_others_lie_where_they_are(tmp_path: Path, dwarf: int) -> None:
    source, elf = tmp_path / "shown.c", tmp_path / "shown"
    source.write_text(
        "struct { unsigned a : 3, b : 5; float c; long double d; __int128 e; short f[2]; } shown = { .c = 1.5F, .f = { 7, -8 } };\n"
        "int main(void) { return 0; }\n"
    )
    subprocess.run(["gcc", f"-gdwarf-{dwarf}", "-gstrict-dwarf", "-no-pie", source, "-o", elf], check=True)
    program = elf_types.read_program(elf)
    found = {place.path: (place.kind, in_elf(elf, place.address, place.size)) for place in program.numbers(program.find("shown"))}
    assert found == {
        "shown.c": ("float", struct.pack("<f", 1.5)),
        "shown.f[0]": ("signed", struct.pack("<h", 7)),
        "shown.f[1]": ("signed", struct.pack("<h", -8)),
    }


@pytest.mark.parametrize("text", ['a \\"b\\"', "a  b", "a\\\\b", ""])
def test_epk_that_an_a2l_cannot_repeat_is_refused(tmp_path: Path, text: str) -> None:
    source, elf = tmp_path / "epk.c", tmp_path / "epk"
    source.write_text(f'const char penode_epk[] = "{text}", plain[] = "a b";\nint main(void) {{ return 0; }}\n')
    subprocess.run(["gcc", "-g", "-no-pie", source, "-o", elf], check=True)
    program = elf_types.read_program(elf)
    with pytest.raises(exports.ExportError, match="which an A2L cannot repeat"):
        a2l.epk(program, None)
    assert a2l.epk(program, "plain") == ("a b", program.find("plain").address)
