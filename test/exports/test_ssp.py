# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""SSP of both versions: valid against the schemas, read by another reader, played with its schedule to the bit of SiL."""

from __future__ import annotations

import importlib.util
import io
import random
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from case_study import chirp
from click.testing import CliRunner

import penode_gen
from penode_gen import exports
from penode_gen.exports.archive import zipped
from penode_gen.sets import layout
from penode_sil import ssp_file, ssp_player
from penode_sil.cli import cli
from penode_sil.errors import UserError
from penode_sil.schedule import Call
from penode_sil.targets import Sil

SET = "altered_friction"


def needs(*packages: str) -> pytest.MarkDecorator:
    missing = [p for p in packages if importlib.util.find_spec(p) is None]
    return pytest.mark.skipif(bool(missing), reason=f"{', '.join(missing)} is not installed: pip install penode[ssp]")


@pytest.fixture(scope="module", params=["2.0", "1.0"])
def ssp(request: pytest.FixtureRequest, nqvm: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("ssp") / f"nqvm{request.param}.ssp"
    path.write_bytes(exports.export(nqvm, "ssp", path, {"schedule": f"1:{SET}, 1.5 s:default", "ssp_version": request.param}))
    return path


def contents(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


@needs("xmlschema", "pyssp_standard", "fmpy")
def test_every_file_is_valid(ssp: Path) -> None:
    """SSP 2.0 and 1.0 by the schemas of the standard, as foreign packages have them; the schedule by its own."""
    import fmpy
    import pyssp_standard
    import xmlschema

    old = "1.0" in ssp.name
    folder = Path(fmpy.__file__).parent / "ssp" / "schema" if old else Path(pyssp_standard.__file__).parent / "resources" / "ssp2"
    files = contents(ssp)
    kinds = {".ssd": "Description", ".ssv": "ParameterValues", ".ssm": "ParameterMapping"}
    checked = 0
    for name, data in files.items():
        if Path(name).suffix in kinds:
            schema = xmlschema.XMLSchema11(str(folder / f"SystemStructure{kinds[Path(name).suffix]}.xsd"))
            assert [str(e.reason) for e in schema.iter_errors(data.decode())] == []
            assert not schema.is_valid(
                data.decode().replace("version=", "versions=", 2).replace('versions="1.0" enc', 'version="1.0" enc')
            )  # a seeded fault
            checked += 1
    assert checked == 4
    own = xmlschema.XMLSchema(files["extra/penode/parameter-schedule.xsd"].decode())
    schedule = files["extra/penode/schedule.xml"].decode()
    assert own.is_valid(schedule)
    for wrong in (('time="1.0"', 'time="-1"'), ('element="nqvm"', ""), ('version="1.0">', 'version="2">'), ("Exchange", "Swap")):
        assert not own.is_valid(schedule.replace(*wrong))


@needs("pyssp_standard")
def test_another_reader_finds_the_values(ssp: Path, nqvm: Any, tmp_path: Path) -> None:
    from pyssp_standard.ssv import SSV

    values = penode_gen.set_values(nqvm, SET)
    (tmp_path / "set.ssv").write_bytes(contents(ssp)[f"resources/{SET}.ssv"])
    with SSV(tmp_path / "set.ssv") as read:
        parameters = {p["name"]: p for p in read.parameters}
    if "2.0" in ssp.name:  # of arrays it reads names and types only
        assert {n: p["type_name"] for n, p in parameters.items()} == {a.name: "Float64" for a in layout.arrays(nqvm)}
        return
    for array in layout.arrays(nqvm):
        expected = layout.gather(array, values)
        for index in np.ndindex(expected.shape):
            name = f"{array.name}[{','.join(str(k + 1) for k in index)}]"
            assert float(parameters[name]["type_value"].parameter["value"]) == expected[index]


def play(*words: str) -> str:
    result = CliRunner().invoke(cli, ["simulate", *words], catch_exceptions=False, standalone_mode=False)
    if result.exception:
        raise result.exception
    return result.output


@needs("fmpy")
def test_the_player_gives_the_bits_of_sil(ssp: Path, held: Any, tmp_path: Path) -> None:
    """A recording as input, the schedule of the file; without the schedule the result is another one."""
    u = chirp(2.0)
    record = tmp_path / "road.csv"
    record.write_text("time [s],z_road [m]\n" + "".join(f"{k * 1e-3:.9g},{v:.9g}\n" for k, v in enumerate(u[:, 0])))
    output = tmp_path / "out.csv"
    play("--ssp", str(ssp), "--input", str(record), "-o", str(output))
    with open(output) as file:
        assert file.readline().startswith("time [s],z_road [m],z_b [m],z_w [m],")
    found = np.loadtxt(output, delimiter=",", skiprows=1)
    reference = Sil(held).run(u, [Call(1001, "select", set=SET), Call(1501, "select", set="default")]).y
    assert np.array_equal(found[:, 2:4].astype(np.float32), reference)
    files = contents(ssp)
    del files["extra/penode/schedule.xml"]
    plain = tmp_path / "plain.ssp"
    plain.write_bytes(zipped(files))
    play("--ssp", str(plain), "--input", str(record), "-o", str(output))
    without = np.loadtxt(output, delimiter=",", skiprows=1)[:, 2:4].astype(np.float32)
    assert np.array_equal(without, Sil(held).run(u).y) and not np.array_equal(without, reference)


@needs("ecospy", "fmpy")
@pytest.mark.long
def test_ecos_plays_it(nqvm: Any, held: Any, tmp_path: Path) -> None:
    """SSP 1.0 with the FMI 2 FMU: ecos applies the bound set, and holds the road at 10 mm."""
    try:
        from ecospy.EcosSimulation import EcosSimulation
    except OSError as missing:
        pytest.skip(f"ecospy cannot be loaded: {missing}")
    path = tmp_path / "nqvm.ssp"
    path.write_bytes(exports.export(nqvm, "ssp", path, {"set": SET, "ssp_version": "1.0"}))
    found = []
    with EcosSimulation(step_size=1e-3, ssp_path=str(path)) as simulation:
        simulation.init(0, SET)
        simulation.set_real("nqvm::z_road", 0.01)
        for _ in range(500):
            simulation.step(1)
            found.append([simulation.get_real("nqvm::z_b"), simulation.get_real("nqvm::z_w")])
        checksum = simulation.get_real("nqvm::set_checksum")
    assert checksum == penode_gen.set_head(nqvm, SET)[3]
    road = np.full((501, 1), 0.01, np.float32)
    reference = Sil(held).run(road, set_name=SET).y
    # ecos sets the road after initialisation: the first sample, at rest, still has 0, which the body does not feel
    assert np.array_equal(np.array(found, np.float32), reference[1:])


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"schedule": "2"}, "--schedule: '2' is no exchange; write a time in seconds, a colon and a set, such as 2.5:default"),
        ({"schedule": "2:other"}, "--schedule: the model file has no set 'other'; use one of: default, altered_friction"),
        ({"schedule": "2:default,1:default"}, "--schedule: 1 s does not come after 2 s; give the times in order"),
        (
            {"schedule": "0.0005:default"},
            "--schedule: 0.0005 s is no multiple of the sample time, 0.001 s; a set comes into force between two samples",
        ),
        ({"set": "other"}, "--set: the model file has no set 'other'; use one of: default, altered_friction"),
    ],
)
def test_options_that_do_not_fit_are_one_line(nqvm: Any, options: dict[str, Any], line: str) -> None:
    with pytest.raises(exports.ExportError) as found:
        exports.export(nqvm, "ssp", Path("n.ssp"), {"source_only": True, **options})
    assert found.value.problems == [line]


def changed(path: Path, to: Path, name: str, *swap: tuple[str, str]) -> Path:
    files: dict[str, Any] = contents(path)
    text = files[name].decode()
    for old, new in swap:
        assert old in text
        text = text.replace(old, new, 1)
    to.write_bytes(zipped({**files, name: text}))
    return to


def test_what_is_wrong_in_an_ssp_is_one_line(ssp: Path, tmp_path: Path) -> None:
    to = tmp_path / "wrong.ssp"
    for name, swap, line in (
        ("extra/penode/schedule.xml", ('time="1.0"', 'time="soon"'), "extra/penode/schedule.xml: 'soon' is not a number; correct it"),
        (
            "extra/penode/schedule.xml",
            ('time="1.0"', 'time="9"'),
            "extra/penode/schedule.xml: an exchange at 1.5 s; times are 0 or more and ascend",
        ),
        (
            "extra/penode/schedule.xml",
            ('element="nqvm"', 'element="other"'),
            "extra/penode/schedule.xml: there is no component 'other'; the system has 'nqvm'",
        ),
        (
            "extra/penode/schedule.xml",
            (f"resources/{SET}.ssv", "resources/no.ssv"),
            "extra/penode/schedule.xml: there is no 'resources/no.ssv' in the archive; export it again",
        ),
        (
            "extra/penode/schedule.xml",
            ('version="1.0">', 'version="2.0">'),
            "extra/penode/schedule.xml: version 2.0; this player reads version 1",
        ),
        ("SystemStructure.ssd", ("<ssd:Component ", "<ssd:Components "), "SystemStructure.ssd: not readable XML: mismatched tag"),
        ("SystemStructure.ssd", ('source="resources/nqvm.fmu"', ""), "SystemStructure.ssd: Component has no attribute source; add it"),
    ):
        with pytest.raises(UserError) as found:
            ssp_file.read(changed(ssp, to, name, swap))
        assert len(found.value.problems) == 1 and found.value.problems[0].startswith(f"{to}: {line}"), found.value.problems


def check_damaged(ssp: Path, to: Path, seeds: range) -> None:
    """Archives with damaged bytes, and archives that are whole with damaged files in them: read, or refused with one line."""
    files = contents(ssp)
    texts = [n for n in files if n.endswith((".ssd", ".ssv", ".xml"))]
    files["resources/nqvm.fmu"] = b"not read here"
    data, refused = zipped(dict(files)), 0
    for seed in seeds:
        rng = random.Random(seed)
        inside = seed % 2 == 0
        name = rng.choice(texts)
        source = bytearray(files[name] if inside else data)
        at, length = rng.randrange(len(source)), rng.randrange(1, 60)
        match rng.randrange(4):
            case 0:
                del source[at:]
            case 1:
                del source[at : at + length]
            case 2:
                source[at : at + length] = rng.randbytes(length)
            case _:
                source[at:at] = source[at : at + length] * rng.randrange(1, 9)
        to.write_bytes(zipped({**files, name: bytes(source)}) if inside else bytes(source))
        try:
            ssp_file.read(to)
        except UserError as problem:
            refused += 1
            assert len(problem.problems) == 1 and "\n" not in problem.problems[0], problem.problems
    assert refused > len(seeds) / 3


def test_damaged_archives_are_refused_with_a_line(ssp: Path, tmp_path: Path) -> None:
    check_damaged(ssp, tmp_path / "damaged.ssp", range(40))


@pytest.mark.long
def test_1000_damaged_archives_are_refused_with_a_line(ssp: Path, tmp_path: Path) -> None:
    check_damaged(ssp, tmp_path / "damaged.ssp", range(1000, 2000))


@needs("fmpy")
def test_exchanges_after_the_end_are_reported(ssp: Path, tmp_path: Path) -> None:
    """The schedule has sets at 1 s and 1.5 s; the recording ends at 1.2 s."""
    record = tmp_path / "road.csv"
    record.write_text("time [s],z_road [m]\n0,0\n1.2,0.01\n")
    told: list[str] = []
    ssp_player.play(ssp, record, told.append)
    assert [line for line in told if "never in force" in line] == [line for line in told if "at 1.5 s" in line] != []


@needs("fmpy")
def test_an_input_without_a_column_keeps_what_the_ssp_binds_to_it(ssp: Path, tmp_path: Path) -> None:
    """A road of 0.01 m as a start value of the SSP, not the 0 of the FMU."""
    system = ssp_file.read(ssp)
    wire = system.wires["z_road"]
    record = tmp_path / "time.csv"
    record.write_text("time [s]\n0\n0.02\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ssp_file, "read", lambda path: replace(system, start={**system.start, wire: (0.01,)}))
        columns = {c.name: c.values for c in ssp_player.play(ssp, record)}
    assert (columns["z_road"] == 0.01).all()
    assert columns["z_w"][-1] > 0.0, "the wheel follows it"


@needs("fmpy")
def test_units_of_a_recording_count(ssp: Path, tmp_path: Path) -> None:
    """The same road in m, in mm under another name with decimal commas, and without a clock of the same rows."""
    time = np.arange(41) * 5e-3
    road = np.round(0.01 * np.sin(20.0 * time), 9)
    forms = {
        "m.csv": ("time [s],z_road [m]\n" + "".join(f"{t:.9g},{z:.9g}\n" for t, z in zip(time, road, strict=True)), []),
        "mm.csv": (
            "Zeit [ms];Weg [mm]\n" + "".join(f"{t:.9g};{z:.9g}\n" for t, z in zip(1e3 * time, 1e3 * road, strict=True)).replace(".", ","),
            ["--channel", "z_road=Weg"],
        ),
    }
    found = []
    for name, (text, words) in forms.items():
        (tmp_path / name).write_text(text)
        play("--ssp", str(ssp), "--input", str(tmp_path / name), *words, "-o", str(tmp_path / "o.csv"))
        found.append(np.loadtxt(tmp_path / "o.csv", delimiter=",", skiprows=1))
    assert np.max(np.abs(found[0][:, 1])) > 5e-3
    assert found[1] == pytest.approx(found[0], rel=1e-9, abs=1e-12)


def test_tables_and_options_that_do_not_fit_are_one_line(ssp: Path, tmp_path: Path) -> None:
    pytest.importorskip("fmpy")
    record, output = tmp_path / "r.csv", tmp_path / "o.csv"
    for text, part in (
        ("", "it is empty"),
        ("time [s],z_road [m]\n0,a\n1,0\n", 'channel z_road: "a" is not a number'),
        ("time [s],z_road [m]\n0,0\n0,0\n", "has the same value as the row before; remove"),
        ("time [s],z_road [m]\n0,1\n1\n", "1 values for 2 channels"),
        ("time [s],z_road\n0,1\n1,1\n", 'channel z_road has no unit; write "z_road [m]" in the header'),
        ("time [s],z_road [kg]\n0,1\n1,1\n", "channel z_road: kg cannot be turned into m"),
        ("time [s],z_road [m]\n0,1\n1,nan\n", "channel z_road has no finite value there"),
    ):
        record.write_text(text)
        with pytest.raises(UserError) as found:
            play("--ssp", str(ssp), "--input", str(record), "-o", str(output))
        assert len(found.value.problems) == 1 and part in found.value.problems[0], found.value.problems
    for words in (["x.toml"], ["--set", "default"], ["--on", "mil"]):
        with pytest.raises(UserError, match="it goes with one --input"):
            play("--ssp", str(ssp), *words, "-o", str(output))
    assert not output.exists() and zipfile.is_zipfile(io.BytesIO(ssp.read_bytes()))
