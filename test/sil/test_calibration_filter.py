# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A virtual controller with filter and monitor: what XCP measures of them is what SiL computes, to the bit; an A2L of other firmware."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exchanges import drive
from places import ROOT

import penode_gen
from penode_gen import exports
from penode_gen.emission.monitor_c import threshold
from penode_gen.exports import filtered
from penode_sil.building import filter_options, generated, model_options
from penode_sil.calibration import a2l_read, address, emulated, link as links, measure, pages, stage, virtual
from penode_sil.filtering.compiled import Compiled
from penode_sil.filtering.estimates import VERDICTS, named, signals
from penode_sil.filtering.watched import CompiledMonitor, names
from penode_sil.targets import Sil

MODEL = ROOT / "sil/filter/watched.toml"
A2LTOOL = Path(sys.executable).with_name("a2ltool")

pytestmark = pytest.mark.skipif(
    not (importlib.util.find_spec("pyxcp") and importlib.util.find_spec("elftools")),
    reason="pyxcp or pyelftools is not installed: pip install penode[xcp]",
)


@pytest.fixture(scope="module")
def model() -> Any:
    return penode_gen.load(MODEL)


def expected(model: Any, u: np.ndarray, adopting: int) -> dict[str, np.ndarray]:
    """Every measurement of filter and monitor at each step; the filter's step `adopting`, counted from 1, adopts the set `worn`."""
    seen = np.asarray(Sil(model).run(u).z)
    measured = [[s.name for s in model.sensors].index(s.name) for s in model.filter.sensors]
    z = seen[:, measured]
    own = CompiledMonitor(Compiled(model), "default")
    parts, sums = [], []
    for part in (slice(0, adopting - 1), slice(adopting - 1, len(u))):
        parts.append(own.run(u[part], z[part]))
        sums.append(own.watched())
        own.select("worn")
    values, deviations, ratio, verdict, x = (
        np.concatenate([getattr(found, name) if name else state for found, state, _ in parts])
        for name in ("values", "deviations", "ratio", "verdict", "")
    )
    table = {f"filter.{name}": values[:, at] for at, name, _ in named(model)}
    table |= {f"filter.sd.{name}": deviations[:, at] for at, name, _ in named(model)}
    table |= {f"filter.state.{name}": x[:, n] for n, name in enumerate(model.filter.names)}
    for n, sensor in enumerate(model.filter.sensors):
        table[f"filter.ratio.{sensor.name}"] = ratio[:, n]
        table |= {f"filter.count.{sensor.name}.{v}": np.cumsum(verdict[:, n] == k) for k, v in enumerate(VERDICTS)}
    evidence, raised = (np.concatenate([getattr(found, name) for found in sums]) for name in ("sums", "raised"))
    for n, name in enumerate(names(model)):
        table |= {f"monitor.{name}": evidence[:, n], f"monitor.raised.{name}": raised[:, n]}
    return table | {"sensors": seen, "step_status": np.concatenate([found.status for found, _, _ in parts])}


def test_names_are_those_of_the_filter_of_simulations(model: Any) -> None:
    assert [(e.name, e.unit) for e in filtered.estimates(model)] == [(f"filter.{name}", unit) for _, name, unit in named(model)]
    kinds = list(signals(model))
    assert [e.part for e in filtered.estimates(model)] == [kinds[at][0] for at, _, _ in named(model)]
    assert filtered.tests(model) == names(model)


def test_log_is_that_of_a_sil_filter_through_an_exchange(model: Any) -> None:
    u = np.float32(0.05) * drive(model)  # a road as smooth as the filter takes it to be
    chosen = pages.choose(f"{MODEL}:worn", np.dtype("f4"))
    with virtual.served(model, "tcp", "127.0.0.1", 0, u) as found:
        a2l = a2l_read.parse(found.a2l, "served")
        wanted = [name for name in a2l.measurements if name.startswith(("filter.", "monitor."))]
        wanted += ["sample", "adopted_at", "step_status", "a_body", "deflection"]

        def exchange(link: links.Link) -> None:
            time.sleep(0.2)
            stage.stage_set(link, a2l, chosen)

        log = measure.record(address.parse(found.address), a2l, wanted, 0.4, 1, exchange)
    sample, adopting = log.values["sample"].astype(int), int(log.values["adopted_at"][-1])
    assert log.lost == 0 and sample[0] < adopting < sample[-1]
    driven = np.tile(u, (sample[-1] // len(u) + 1, 1))[: sample[-1]]
    table = expected(model, driven, adopting)
    seen = table.pop("sensors")[sample - 1]
    for name in ("a_body", "deflection"):
        assert np.array_equal(log.values[name], seen[:, [s.name for s in model.sensors].index(name)]), name
    scale = np.float32(threshold(model, model.monitor))
    for name, values in table.items():
        assert name in log.values, name
        got = log.values[name] / scale if name in ("monitor.rubbing", "monitor.other") else log.values[name]
        assert np.array_equal(got, values[sample - 1]), name
    ratio = log.values["filter.ratio.a_body"]
    assert 10.0 * ratio[sample < adopting].mean() < ratio[sample > adopting].mean()  # the plant does not rub
    at_rest = {name for name in log.values if name.startswith(("filter.", "monitor.")) and name not in table}
    assert at_rest == {f"filter.predicted.{s.name}" for s in (*model.outputs, *model.sensors)} | {
        *(f"filter.count.{name}" for name in ("held", "limited", "nonfinite")),
        *(f"monitor.count.{name}" for name in names(model)),
    }


@pytest.fixture(scope="module")
def firmware(model: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example, on this machine: it has an instance of the model, and another one in its filter."""
    folder, c = tmp_path_factory.mktemp("firmware"), generated(model)
    files = [ROOT / "sil/firmware/watch.c", *(c / f"watched{part}.c" for part in ("", "_params", "_ekf", "_monitor"))]
    options = ["-std=c99", "-O1", "-g", f"-I{c}", f"-I{ROOT}/sil/firmware", f"-I{ROOT}/inc", f"-I{ROOT}/port/gnu", "-no-pie"]
    board = ROOT / "port/host/board.c"
    subprocess.run(["gcc", *options, *files, board, *sorted((ROOT / "src").glob("*.c")), "-o", folder / "watch"], check=True)
    return folder / "watch"


def test_a2l_of_firmware_names_the_instance_of_the_filter(model: Any, firmware: Path) -> None:
    with pytest.raises(
        exports.ExportError, match=r"several variables of the type watched_t \(vehicle, filter.model\); name one by --instance"
    ):
        exports.export(model, "a2l", Path("x.a2l"), {"elf": firmware})
    text = exports.export(model, "a2l", Path("x.a2l"), {"elf": firmware, "instance": "filter.model"}).decode()
    a2l = a2l_read.parse(text, "watch")
    listed = subprocess.run(["nm", "-S", firmware], capture_output=True, text=True, check=True).stdout
    first, size = next((int(w[0], 16), int(w[1], 16)) for w in map(str.split, listed.splitlines()) if w[3:] == ["filter"])
    inside = range(first, first + size)
    for name, entry in a2l.measurements.items():
        if name.startswith("filter."):
            assert entry.address in inside, name
    assert a2l.measurements["z_b"].address in inside and a2l.measurements["monitor.rubbing"].address not in inside


@pytest.mark.skipif(not A2LTOOL.exists(), reason="a2ltool is not installed: pip install a2ltool")
def test_a2ltool_has_nothing_to_say_and_finds_the_same_addresses(model: Any, tmp_path: Path) -> None:
    program, path = virtual.build(model), tmp_path / "x.a2l"
    path.write_text(virtual.describe(model, program, "tcp:127.0.0.1:5555"))
    done = subprocess.run([A2LTOOL, path, "--strict", "--check"], capture_output=True, text=True)
    assert (done.returncode, (done.stdout + done.stderr).strip()) == (0, "Consistency check complete. No problems found.")
    subprocess.run(
        [A2LTOOL, path, "--elffile", program, "--update", "ADDRESSES", "-o", tmp_path / "y.a2l"], check=True, capture_output=True
    )
    ours, theirs = (a2l_read.parse((tmp_path / name).read_text(), name).measurements for name in ("x.a2l", "y.a2l"))
    assert {name: entry.address for name, entry in ours.items()} == {name: entry.address for name, entry in theirs.items()}


@pytest.mark.parametrize("real", ["", "-DPEN_REAL_DOUBLE"])
def test_the_controller_gives_no_warning(model: Any, real: str) -> None:
    options = ["-std=c99", "-fsyntax-only", "-Werror", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Wshadow"]
    include = [f"-I{folder}" for folder in (ROOT / "inc", ROOT / "port/gnu", ROOT / "sil/firmware", generated(model))]
    told = [*model_options(model), *filter_options(model), *([real] if real else [])]
    for compiler in ("gcc", "clang-19"):
        subprocess.run([compiler, *options, *include, *told, ROOT / "sil/firmware/controller.c"], check=True)


@pytest.mark.skipif(shutil.which("arm-none-eabi-gcc") is None, reason="arm-none-eabi-gcc is not installed")
def test_the_emulated_controller_has_the_same_measurements(model: Any) -> None:
    texts = (virtual.describe(model, program, "serial:115200") for program in (virtual.build(model), emulated.build(model, "m4f")))
    ours, theirs = (a2l_read.parse(text, "x").measurements for text in texts)
    assert ours.keys() == theirs.keys()
