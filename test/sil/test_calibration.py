# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Calibration over XCP, by pyxcp, with a virtual controller: what the log shows is what a SiL run does, to the bit."""

from __future__ import annotations

import contextlib
import dataclasses
import importlib.util
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from exchanges import EIGHT, check_characteristics, check_log, check_measurements, drive

import penode_gen
from penode_sil.calibration import a2l_read, address, link as links, measure, pages, stage, virtual
from penode_sil.calibration.codes import Page, Slave, Who
from penode_sil.errors import UserError

ROOT = Path(__file__).resolve().parents[2]
NQVM = ROOT / "gen" / "nqvm" / "nqvm.toml"
FOLDED = ROOT / "gen" / "nqvm" / "nqvm_folded.toml"
SIGNALS = ["z_b", "z_w", "sample", "set_in_force", "adopted_at"]
CAN_MASTER, CAN_SLAVE = 0x100, 0x101

pytestmark = pytest.mark.skipif(
    not (importlib.util.find_spec("pyxcp") and importlib.util.find_spec("elftools")),
    reason="pyxcp or pyelftools is not installed: pip install penode[xcp]",
)


class Bridge(threading.Thread):
    """Moves CAN frames between a virtual bus of python-can and datagrams of one frame each."""

    def __init__(self, channel: str, port: int):
        import can

        super().__init__(daemon=True)
        self.bus = can.Bus(interface="virtual", channel=channel)
        self.line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.line.connect(("127.0.0.1", port))
        self.line.settimeout(0.001)
        self.ended = False

    def run(self) -> None:
        import can

        while not self.ended:
            while (message := self.bus.recv(0.0)) is not None:
                if message.arbitration_id == CAN_MASTER:
                    self.line.send(bytes(message.data))
            with contextlib.suppress(TimeoutError, ConnectionRefusedError):
                self.bus.send(can.Message(arbitration_id=CAN_SLAVE, is_extended_id=False, data=self.line.recv(64)))


@contextlib.contextmanager
def reached(kind: str, model: Any, u: np.ndarray) -> Iterator[tuple[address.Address, virtual.Served]]:
    """A virtual controller, and where it is; `can` is 8-byte frames on a virtual bus."""
    if kind != "can":
        with virtual.served(model, kind, "127.0.0.1", 0, u) as found:
            yield address.parse(found.address), found
        return
    pytest.importorskip("can", reason="python-can is not installed")
    with virtual.served(model, "frames", "127.0.0.1", 0, u, max_cto=8) as found:
        channel = found.address
        bridge = Bridge(channel, int(found.address.rpartition(":")[2]))
        bridge.start()
        settings = {
            "CAN": {
                "interface": "virtual",
                "channel": channel,
                "can_id_master": CAN_MASTER,
                "can_id_slave": CAN_SLAVE,
                "max_dlc_required": True,
            }
        }
        try:
            yield address.Address(found.address, "can", settings), found
        finally:
            bridge.ended = True
            bridge.join()
            bridge.bus.shutdown()


EVERY = 20  # on CAN: a sample of 28 bytes takes 5 frames, and the virtual bus of python-can carries few thousand a second


@pytest.mark.parametrize(
    ("kind", "path", "every"),
    [("tcp", NQVM, 1), ("udp", NQVM, 1), ("can", NQVM, EVERY), ("tcp", FOLDED, 1)],
    ids=["tcp", "udp", "can", "folded"],
)
def test_log_is_that_of_a_sil_run_with_the_exchange_where_it_shows_the_new_id(kind: str, path: Path, every: int) -> None:
    model = penode_gen.load(path)
    u = drive(model)
    with reached(kind, model, u) as (where, found):
        a2l = a2l_read.parse(found.a2l, "served")
        chosen = pages.choose(f"{NQVM}:altered_friction", np.dtype("f4"))

        def exchange(link: links.Link) -> None:
            time.sleep(0.2)
            staged = stage.stage_set(link, a2l, chosen)
            assert (staged.bytes, staged.id) == (4 * 1198, Slave.FIRST_ID)

        alias = dataclasses.replace(a2l.measurements["z_w"], name="alias")  # a second name of one place
        named = dataclasses.replace(a2l, measurements=a2l.measurements | {"alias": alias})
        log = measure.record(where, named, ["alias", *SIGNALS], 0.3, every, exchange)
    assert (log.values["alias"] == log.values["z_w"]).all()
    check_log(model, u, log, every)


@pytest.mark.parametrize("seconds", [2.0, pytest.param(60.0, marks=pytest.mark.long)])
def test_eight_signals_at_1_khz_without_loss(seconds: float) -> None:
    model = penode_gen.load(NQVM)
    u = drive(model)
    with reached("tcp", model, u) as (where, found):
        log = measure.record(where, a2l_read.parse(found.a2l, "served"), [*EIGHT, "sample"], seconds)
    assert log.lost == 0 and log.period == pytest.approx(1e-3)
    assert (np.diff(log.values["sample"].astype(int)) == 1).all()
    assert np.allclose(np.diff(log.time), 1e-3, rtol=0.0, atol=1e-9)  # rounding of the sum of whole microseconds: 60 s * 2^-53 and less
    assert log.time[-1] > 0.9 * seconds  # a busy machine is late, but makes up for it


def test_every_entry_of_the_a2l_is_the_models_value() -> None:
    model = penode_gen.load(NQVM)
    u = drive(model)
    with reached("tcp", model, u) as (where, _):
        with links.connected(where) as link:
            a2l = link.a2l(None)  # GET_ID offers it
            check_characteristics(model, link, a2l)
            network = model.sets["default"].networks["damper_net"]
            weights = [layer.weights for layer in network.layers if hasattr(layer, "weights")]
            entry = a2l.characteristics["damper_net.weights_2"]
            assert entry.sizes[:2] == weights[1].shape  # fastest: rows
            assert (link.values(entry).reshape(weights[1].shape, order="F") == weights[1].astype(np.float32)).all()
            assert link.number(a2l.measurements["set.layout"]) == penode_gen.set_head(model, "default")[0]  # by UPLOAD
        log = measure.record(where, a2l, list(a2l.measurements), 0.3)
    check_measurements(model, u, a2l, log)


def test_refused_set_changes_nothing_and_has_a_reason() -> None:
    model = penode_gen.load(NQVM)
    bad = pages.choose(f"{NQVM}:altered_friction", np.dtype("f4"))
    bad.values[700] = np.nan
    with reached("tcp", model, drive(model)) as (where, found):
        a2l = a2l_read.parse(found.a2l, "served")
        with links.connected(where) as link, pytest.raises(links.Refused, match="set_nonfinite"):
            stage.stage_set(link, a2l, bad)
        with links.connected(where) as link:
            seen = pages.look(link, a2l)
            assert seen.page == Page.REFERENCE and not seen.differing(a2l, pages.segment(a2l)[0])
            foreign = pages.ChosenSet("foreign", bad.layout ^ 1, bad.values)
            with pytest.raises(UserError, match="set of another model"):
                stage.stage_set(link, a2l, foreign)


def test_quiet_commits_edits_of_the_working_page_while_that_runs() -> None:
    model = penode_gen.load(NQVM)
    chosen = pages.choose(f"{NQVM}:altered_friction", np.dtype("f4"))
    with (
        virtual.served(model, "tcp", "127.0.0.1", 0, drive(model), quiet=200) as found,
        links.connected(address.parse(found.address)) as link,
    ):
        a2l = a2l_read.parse(found.a2l, "served")
        first, (running, status) = pages.segment(a2l)[0], (a2l.measurements[name] for name in ("set_in_force", "count.set_nonfinite"))

        def in_force_after(data: bytes, seconds: float) -> tuple[float, float]:
            old = link.number(running)
            begin = time.monotonic()
            link.write(first, data)
            while link.number(running) == old and time.monotonic() - begin < seconds:
                time.sleep(0.002)
            return link.number(running) - old, time.monotonic() - begin

        assert in_force_after(chosen.serial, 0.5)[0] == 0  # the reference runs
        link.set_page(Who.ECU, Page.WORKING)
        stage._await(link, a2l, 1)
        more, seconds = in_force_after(np.float32(0.5).tobytes(), 5.0)
        assert more == 1 and seconds > 0.2 - 0.011  # its clock ticks each 10 ms, and counts whole ms
        assert in_force_after(np.float32(np.nan).tobytes(), 0.5)[0] == 0 and link.number(status) == 1


def test_a2l_of_another_program_is_refused(tmp_path: Path) -> None:
    model = penode_gen.load(NQVM)
    other = tmp_path / "other.a2l"
    with virtual.served(model, "tcp", "127.0.0.1", 0, drive(model)) as found, links.connected(address.parse(found.address)) as link:
        other.write_text(found.a2l.replace('EPK "nqvm ', 'EPK "nqvm_old '))
        with pytest.raises(UserError, match=r'is that of "nqvm_old .*the controller is "nqvm '):
            link.a2l(other)


def test_compare_names_sets_and_values() -> None:
    model = penode_gen.load(NQVM)
    chosen = pages.choose(f"{NQVM}:altered_friction", np.dtype("f4"))
    with reached("tcp", model, drive(model)) as (where, found):
        a2l = a2l_read.parse(found.a2l, "served")
        with links.connected(where) as link:
            stage.stage_set(link, a2l, chosen)
        with links.connected(where) as link:
            seen = pages.look(link, a2l)
    assert stage.what_runs(model, np.dtype("f4"), seen) == ("altered_friction (set 2)", "default (set 1)")
    default = np.asarray(penode_gen.set_values(model, "default"))
    rows = seen.differing(a2l, pages.segment(a2l)[0])
    assert len(rows) == np.count_nonzero(default != chosen.values)
    layers = [layer for layer in model.sets["altered_friction"].networks["damper_net"].layers if hasattr(layer, "weights")]
    named = {name: running for name, _, running, _ in rows}
    assert named["damper_net.weights_2[3][5]"] == np.float32(layers[1].weights[3, 5])
    assert named["damper_net.bias_1[7]"] == np.float32(layers[0].bias[7])


def test_no_answer_is_one_line() -> None:
    with pytest.raises(UserError, match="nothing answers there"), links.connected(address.parse("tcp:127.0.0.1:1")):
        pass
    with pytest.raises(UserError, match="is not an address"):
        address.parse("tcp:nowhere")
    for kind in ("tcp", "udp"):
        with pytest.raises(UserError, match="cannot be opened"), links.connected(address.parse(f"{kind}:nowhere.invalid:5555")):
            pass


def test_what_cannot_be_meant_is_one_line() -> None:
    kind = np.dtype("f4")
    with pytest.raises(UserError, match=r"which of its sets\? Name it as .*nqvm\.toml:NAME, one of: default, altered_friction$"):
        pages.choose(str(NQVM), kind)
    with pytest.raises(UserError, match="a set begins with b'PENS'; name a set as"):
        pages.choose(str(ROOT / "README.md"), kind)
    with pytest.raises(UserError, match=r"cannot be read as A2L \(it has no MODULE\)"):
        a2l_read.parse((ROOT / "README.md").read_text(encoding="utf-8"), "README.md")
    with pytest.raises(UserError, match="--signals names none"):
        measure.choose(a2l_read.A2l("x", {}, {}, None, None), [])


class Timed:
    """A link to a slave whose event comes each millisecond."""

    master = SimpleNamespace(getDaqEventInfo=None)

    def ask(self, what: str, *_: object) -> SimpleNamespace:
        assert what == "GET_DAQ_EVENT_INFO"
        return SimpleNamespace(eventChannelTimeUnit=6, eventChannelTimeCycle=1)


def test_log_counts_what_is_missing_and_its_clock_goes_on_when_the_stamps_wrap() -> None:
    kept = measure.Samples(names=["a"])
    steps = [-3, -2, -1, 0, 1, 3, 4, 8]  # ms; the stamps wrap at 0; 2, 5, 6 and 7 never came
    kept.stamps = [step * 1000 % (1 << 32) * 1000 for step in steps]  # ns, as pyxcp gives them
    kept.rows = [[(1 << 60) + n] for n in range(len(steps))]
    kept.stamps.append(0)  # of a sample whose values come after the look at them
    entries = [a2l_read.Entry(name, "", 64, np.dtype("u8"), ()) for name in ("a", "b")]  # two names of one place
    log = measure._log(measure._period(Timed(), 1), entries, kept)
    assert log.lost == 4 and np.allclose(log.time, (np.array(steps) + 3) * 1e-3, rtol=0.0, atol=1e-15)  # rounding of seven sums below 16 ms
    assert all(log.values[name].tolist() == [(1 << 60) + n for n in range(len(steps))] for name in ("a", "b"))


def test_signals_of_one_place_are_measured_and_those_that_overlap_refused() -> None:
    def entry(name: str, at: int, kind: str) -> a2l_read.Entry:
        return a2l_read.Entry(name, "", at, np.dtype(kind), ())

    entries = [entry("whole", 64, "u4"), entry("same", 64, "u4"), entry("next", 68, "f4"), entry("high", 66, "u2"), entry("low", 64, "u2")]
    a2l = a2l_read.A2l("x", {}, {e.name: e for e in entries}, None, None)
    assert [e.name for e in measure.choose(a2l, ["whole", "same", "next"])] == ["whole", "same", "next"]
    for part in ("high", "low"):
        with pytest.raises(UserError, match="lies in the bytes of"):
            measure.choose(a2l, ["whole", part])


def test_port_that_is_taken_is_one_line() -> None:
    model = penode_gen.load(NQVM)
    with virtual.served(model, "tcp", "127.0.0.1", 0, drive(model)) as found:
        port = int(found.address.rpartition(":")[2])
        with pytest.raises(UserError, match="the port is taken"), virtual.served(model, "tcp", "127.0.0.1", port, drive(model)):
            pass
    assert found.steps > 0  # it has ended, and said how much it did
