# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Calibration of an emulated Cortex-M4F over its serial line, by pyxcp: step in the timer interrupt, slave in the main loop."""

from __future__ import annotations

import importlib.util
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from exchanges import EIGHT, check_characteristics, check_log, check_measurements, drive

import penode_gen
from penode_sil.calibration import a2l_read, address, emulated, link as links, measure, pages, stage
from penode_sil.errors import UserError

NQVM = Path(__file__).resolve().parents[2] / "gen" / "nqvm" / "nqvm.toml"

pytestmark = [
    pytest.mark.skipif(
        not (importlib.util.find_spec("pyxcp") and importlib.util.find_spec("elftools")),
        reason="pyxcp or pyelftools is not installed: pip install penode[xcp]",
    ),
    pytest.mark.skipif(
        not (shutil.which("qemu-system-arm") and shutil.which("arm-none-eabi-gcc")),
        reason="qemu-system-arm or arm-none-eabi-gcc is not installed",
    ),
]


@pytest.fixture(scope="module", params=[pytest.param(0, id="TCP port"), pytest.param(None, id="serial device", marks=pytest.mark.long)])
def running(request: pytest.FixtureRequest) -> Iterator[tuple[object, np.ndarray, address.Address, a2l_read.A2l]]:
    """The emulated controller; its line is a TCP port, or a device."""
    model = penode_gen.load(NQVM)
    u = drive(model, 20000)  # longer than the test: each sample has an input of its own
    with emulated.emulated(model, "m4f", "127.0.0.1", request.param, u) as found:
        yield model, u, address.parse(found.address), a2l_read.parse(found.a2l, "emulated")


def test_every_entry_and_then_an_exchange(running: tuple) -> None:
    model, u, where, a2l = running
    with links.connected(where) as link:
        assert link.text(links.Text.EPK) == a2l.epk[0]
        check_characteristics(model, link, a2l)
    for seconds in (0.3, 3.0, 20.0):  # the emulated clock is behind on a busy machine
        log = measure.record(where, a2l, list(a2l.measurements), seconds, 50)  # 180 bytes each 50 ms
        if log.time.size > 3:
            break
    check_measurements(model, u, a2l, log)
    chosen = pages.choose(f"{NQVM}:altered_friction", np.dtype("f4"))
    every = 10  # 23 bytes and a head each 10 ms of the emulated time
    log = measure.record(
        where, a2l, ["z_b", "z_w", "sample", "set_in_force", "adopted_at"], 0.3, every, lambda link: stage.stage_set(link, a2l, chosen)
    )
    check_log(model, u, log, every)


def test_line_carries_eight_signals_each_step(running: tuple) -> None:
    """45 bytes a step with stamp and head: 45 kB a second. At the divisor of port/cortex-m/uart.c, 25 MHz / 16, a line passes 156 kB; the
    emulator paces none."""
    _, _, where, a2l = running
    for seconds in (0.5, 4.0, 20.0):  # as above
        log = measure.record(where, a2l, [*EIGHT, "sample"], seconds)
        if log.time.size > 100:
            break
    assert log.time.size > 100 and log.lost == 0
    assert (np.diff(log.values["sample"].astype(int)) == 1).all()
    assert (np.rint(np.diff(log.time) * 1e6) == 1000).all()


def test_inputs_that_it_cannot_hold_are_refused() -> None:
    model = penode_gen.load(NQVM)
    with (
        pytest.raises(UserError, match=r"holds the inputs of 262\.144 s, not of 262\.145 s"),
        emulated.emulated(model, "m4f", "127.0.0.1", 0, np.zeros((262145, 1), np.float32)),
    ):
        pass
