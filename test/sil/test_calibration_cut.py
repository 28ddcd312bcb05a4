# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A bulk write over TCP that is cut, on the master's side or the controller's: all of the set is in force, or nothing; reconnecting finds a
clean state."""

from __future__ import annotations

import importlib.util
import select
import socket
import struct
import threading
import zlib
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import penode_gen
from penode_sil.calibration import a2l_read, address, link as links, measure, pages, stage, virtual
from penode_sil.cli import cli
from penode_sil.errors import UserError

NQVM = Path(__file__).resolve().parents[2] / "gen" / "nqvm" / "nqvm.toml"
CONNECT, CHECKSUM, PAGE, ECU, TOOL = b"\xff\x00", 0xF3, 0xEA, 1, 2
WORKING, REFERENCE = 0, 1
DEFAULT = 1  # id of the set in flash
ALL = 1 << 30  # bytes: no cut

pytestmark = pytest.mark.skipif(
    not (importlib.util.find_spec("pyxcp") and importlib.util.find_spec("elftools")),
    reason="pyxcp or pyelftools is not installed: pip install penode[xcp]",
)


class Cable(threading.Thread):
    """
    Connections to a port, one after the other; the last of them passes `sent` bytes of the master and `answered` of the controller, and is
    then cut, on both sides.
    """

    def __init__(self, port: int, sent: int = ALL, answered: int = ALL, connections: int = 1):
        super().__init__(daemon=True)
        self.limits = [[ALL, ALL]] * (connections - 1) + [[sent, answered]]
        self.port = port
        self.passed = [bytearray(), bytearray()]
        self.listening = socket.create_server(("127.0.0.1", 0))

    def run(self) -> None:
        for limits in self.limits:
            self.left = list(limits)
            self.connection()
        self.listening.close()

    def connection(self) -> None:
        """From its beginning to its end."""
        master, _ = self.listening.accept()
        ends = [master, socket.create_connection(("127.0.0.1", self.port))]
        for end in ends:
            end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        with suppress(OSError):
            while min(self.left) > 0:
                for end in select.select(ends, [], [])[0]:
                    way = ends.index(end)
                    data = end.recv(65536)[: self.left[way]]
                    if not data:
                        self.left[way] = 0
                    self.left[way] -= len(data)
                    self.passed[way] += data
                    ends[1 - way].sendall(data)
        for end in ends:
            end.close()

    @property
    def address(self) -> address.Address:
        return address.parse(f"tcp:127.0.0.1:{self.listening.getsockname()[1]}")


class Raw:
    """A master that knows bytes only."""

    def __init__(self, port: int):
        self.line = socket.create_connection(("127.0.0.1", port), timeout=10.0)
        self.line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def ask(self, packet: bytes) -> bytes:
        """The answer to a packet."""
        self.line.sendall(struct.pack("<HH", len(packet), 0) + packet)
        data = b""
        while len(data) < 4 or len(data) < 4 + int.from_bytes(data[:2], "little"):
            more = self.line.recv(300)
            assert more, "the controller has hung up"
            data += more
        return data[4:]

    def state(self, first: int, size: int) -> tuple[int, list[int]]:
        """After CONNECT: the page that runs, and the checksums of working and reference page."""
        assert self.ask(CONNECT)[:1] == b"\xff"
        running, found = self.ask(bytes([PAGE, ECU, 0]))[3], []
        for page in (WORKING, REFERENCE):
            assert self.ask(bytes([0xEB, TOOL, 0, page]))[:1] == b"\xff"
            assert self.ask(struct.pack("<BxxBI", 0xF6, 0, first))[:1] == b"\xff"
            found.append(int.from_bytes(self.ask(struct.pack("<BxxxI", CHECKSUM, size))[4:8], "little"))
        return running, found

    def back(self, in_force: int) -> None:
        """To the reference page, and until a step has adopted it: the id of the set in force lies at `in_force`."""
        while (answer := self.ask(bytes([0xEB, ECU, 0, REFERENCE])))[:2] == b"\xfe\x10":
            pass  # ERR_CMD_BUSY: no step has adopted the set so far
        assert answer[:1] == b"\xff"
        while self.ask(struct.pack("<BBxBI", 0xF4, 4, 0, in_force))[1:5] != struct.pack("<I", DEFAULT):
            pass


@pytest.fixture(scope="module")
def served() -> Iterator[tuple[int, a2l_read.A2l, pages.ChosenSet, int]]:
    """Port, A2L, a set to write, and the checksum of the set in flash."""
    model = penode_gen.load(NQVM)
    default = np.asarray(penode_gen.set_values(model, "default"), "<f4")
    with virtual.served(model, "tcp", "127.0.0.1", 0, np.zeros((1, 1), np.float32)) as found:
        port = int(found.address.rpartition(":")[2])
        yield (
            port,
            a2l_read.parse(found.a2l, "served"),
            pages.choose(f"{NQVM}:altered_friction", np.dtype("f4")),
            zlib.crc32(default.tobytes()),
        )


def through(cable: Cable, a2l: a2l_read.A2l, chosen: pages.ChosenSet, patience: float) -> str:
    """What penode stage reports: "" if it is done."""
    cable.start()
    try:
        with links.connected(cable.address, patience=patience) as link:
            stage.stage_set(link, a2l, chosen)
    except UserError as exc:
        return str(exc)
    finally:
        cable.join(30.0)
        assert not cable.is_alive()
    return ""


def clean(port: int, a2l: a2l_read.A2l, chosen: pages.ChosenSet, default: int, whole: bool) -> None:
    """All of the set is in force if the switch has come, else nothing; the reference page is untouched."""
    first, size, _ = pages.segment(a2l)
    master = Raw(port)
    with master.line:
        running, (working, reference) = master.state(first, size)
        assert reference == default
        assert (running, working) == ((WORKING, chosen.checksum) if whole else (REFERENCE, default))
        master.back(a2l.measurements["set_in_force"].address)


def whole(served: tuple) -> tuple[bytes, bytes]:
    """What passes in either direction for a bulk write with its switch; the set is in force after it, and withdrawn again."""
    port, a2l, chosen, default = served
    cable = Cable(port)
    assert through(cable, a2l, chosen, 10.0) == ""
    clean(port, a2l, chosen, default, True)
    return bytes(cable.passed[0]), bytes(cable.passed[1])


@pytest.mark.parametrize("every", [97, pytest.param(1, marks=pytest.mark.long)])
def test_set_is_whole_or_not_there_wherever_the_master_breaks_off(served: tuple, every: int) -> None:
    """The bytes that pyxcp sends for a bulk write and its switch, up to any of them."""
    port, a2l, chosen, default = served
    sent, _ = whole(served)
    switch = sent.index(bytes([0xEB, ECU, 0, WORKING])) + 4  # bytes until it is whole
    assert sent.count(bytes([0xEB, ECU, 0, WORKING])) == 1 and 4792 < switch < len(sent)
    for cut in sorted({*range(0, len(sent), every), *range(switch - 8, switch + 2)}):
        with socket.create_connection(("127.0.0.1", port)) as line:
            line.sendall(sent[:cut])
            line.shutdown(socket.SHUT_WR)
            while line.recv(65536):  # until the controller has seen all, and hung up
                pass
        clean(port, a2l, chosen, default, cut >= switch)


@pytest.mark.parametrize("every", [37, pytest.param(1, marks=pytest.mark.long)])
def test_penode_stage_ends_with_one_line_wherever_the_answers_break_off(served: tuple, every: int) -> None:
    port, a2l, chosen, default = served
    _, answers = whole(served)
    written = answers.index(struct.pack("<I", chosen.checksum))  # BUILD_CHECKSUM is answered; the switch follows
    for cut in sorted({*range(1, written, every), written - 9, written, written + 3}):
        report = through(Cable(port, answered=cut), a2l, chosen, 0.3)
        assert report and "\n" not in report and "no answer to" in report
        clean(port, a2l, chosen, default, False)


def test_measurement_that_breaks_off_leaves_the_log_of_what_came(served: tuple, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from asammdf import MDF

    monkeypatch.setattr(measure._wait, "__defaults__", (0.5,))
    out = tmp_path / "log.mf4"
    cable = Cable(served[0], answered=20_000, connections=2)  # the A2L comes over the first
    cable.start()
    done = CliRunner().invoke(
        cli, ["measure", "--signals", "z_b,sample", "--to", cable.address.text, "-o", str(out)], standalone_mode=False
    )
    assert isinstance(done.exception, UserError) and "stopped answering" in str(done.exception)
    with MDF(out) as log:
        sample = log.get("sample").samples.astype(int)
    assert sample.size > 500 and (np.diff(sample) == 1).all() and f"{sample.size} samples in" in done.stdout
