# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The lines of the virtual controller, byte by byte: who its master is, and what becomes of one that is gone over TCP."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path

import numpy as np
import pytest

import penode_gen
from penode_sil.calibration import a2l_read, address, link as links, measure, serve, virtual

NQVM = Path(__file__).resolve().parents[2] / "gen" / "nqvm" / "nqvm.toml"
CONNECT, DISCONNECT, GET_STATUS = b"\xff\x00", b"\xfe", b"\xfd"
GET_NAME, UPLOAD_4, GET_DAQ_PROCESSOR_INFO = b"\xfa\x01", b"\xf5\x04", b"\xda"
FREE_DAQ, ALLOC_DAQ_2 = b"\xd6", b"\xd5\x00\x02\x00"
LATER = b"\xfe\x33"  # ERR_RESOURCE_TEMPORARY_NOT_ACCESSIBLE
CALLS = 8  # open connections: port/host/serve_line.c
GONE = 10.0  # s: port/host/serve_line.h
KEEPALIVE = "02"  # the timer of a connection that is probed: proc(5)


def framed(packet: bytes, counter: int = 0) -> bytes:
    return len(packet).to_bytes(2, "little") + counter.to_bytes(2, "little") + packet


def served(kind: str) -> AbstractContextManager[virtual.Served]:
    return virtual.served(penode_gen.load(NQVM), kind, "127.0.0.1", 0, np.zeros((1, 1), np.float32))


class Udp:
    """A master with a port of its own."""

    def __init__(self, port: int):
        self.line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.line.connect(("127.0.0.1", port))

    def ask(self, packet: bytes, patience: float = 5.0) -> bytes:
        """The answer; b"" if none comes."""
        self.line.settimeout(patience)
        self.line.send(framed(packet))
        try:
            return self.line.recv(300)[4:]
        except TimeoutError:
            return b""


def test_answers_of_udp_go_to_the_last_that_sent_connect() -> None:
    with served("udp") as found:
        one, other = (Udp(int(found.address.rpartition(":")[2])) for _ in range(2))
        assert one.ask(GET_STATUS, 0.2) == b""
        assert one.ask(CONNECT)[:1] == b"\xff"
        for stranger in (GET_STATUS, DISCONNECT, b"\xeb\x03\x00\x00", b"\xff"):  # the last is too short for CONNECT
            assert other.ask(stranger, 0.2) == b""
        one.line.settimeout(0.2)
        with pytest.raises(TimeoutError):
            one.line.recv(300)  # nothing of it reaches the master
        assert one.ask(GET_STATUS)[:1] == b"\xff"
        assert other.ask(CONNECT)[:1] == b"\xff"
        assert one.ask(GET_STATUS, 0.2) == b"" and other.ask(GET_STATUS)[:1] == b"\xff"
        for line in (one, other):
            line.line.close()


class Tcp:
    """A connection, which may become a master."""

    def __init__(self, found: virtual.Served):
        self.line = socket.create_connection(("127.0.0.1", int(found.address.rpartition(":")[2])), timeout=5.0)

    def ask(self, packet: bytes, patience: float = 5.0) -> bytes:
        """The answer; b"" if none comes, or the connection is closed."""
        self.line.settimeout(patience)
        try:
            self.line.sendall(framed(packet))
            return self.line.recv(300)[4:]
        except (TimeoutError, ConnectionError):
            return b""

    def connect(self) -> bool:
        """Is it let in, as soon as the server notices that others have gone?"""
        end = time.monotonic() + 3.0
        while (answer := self.ask(CONNECT)) == LATER and time.monotonic() < end:
            time.sleep(0.02)
        return answer[:1] == b"\xff"

    def __enter__(self) -> Tcp:
        return self

    def __exit__(self, *_: object) -> None:
        self.line.close()


def test_silent_connections_do_not_block_others() -> None:
    """One, and as many as there is room for: those that have been silent for 2 s give way."""
    with served("tcp") as found, ExitStack() as stack:
        first = stack.enter_context(Tcp(found))
        begun = time.monotonic()
        with Tcp(found) as other:
            assert other.ask(CONNECT)[:1] == b"\xff" and time.monotonic() - begun < 3.0
        silent = [stack.enter_context(Tcp(found)) for _ in range(CALLS - 1)]
        begun = time.monotonic()
        with Tcp(found) as other:
            assert other.ask(CONNECT)[:1] == b"\xff" and time.monotonic() - begun < 3.0
            assert first.ask(CONNECT, 0.2) == b"", "the first has given way"
        assert silent[-1].ask(GET_STATUS, 0.2) == b"", "there is no answer before CONNECT"
        assert silent[-1].connect()


def test_second_master_is_refused_for_now() -> None:
    """As the standard has it since 1.1: CONNECT may be answered so, and is then repeated."""
    with served("tcp") as found, Tcp(found) as one, Tcp(found) as other:
        assert one.ask(CONNECT)[:1] == b"\xff"
        for _ in range(3):
            assert other.ask(CONNECT) == LATER
            assert one.ask(GET_STATUS)[:1] == b"\xff"
        assert other.ask(DISCONNECT, 0.2) == b"" and one.ask(GET_STATUS)[:1] == b"\xff"
        assert one.ask(CONNECT)[:1] == b"\xff", "the master itself may connect again"
        assert one.ask(DISCONNECT)[:1] == b"\xff"
        assert other.ask(CONNECT)[:1] == b"\xff"
        assert one.ask(CONNECT) == LATER
        other.line.close()
        assert one.connect()


def test_running_session_loses_nothing_to_others() -> None:
    pytest.importorskip("pyxcp", reason="pyxcp is not installed: pip install penode[xcp]")
    answers = []
    with served("tcp") as found:

        def bother(_: object) -> None:
            end = time.monotonic() + 2.0
            with ExitStack() as stack:
                while time.monotonic() < end:
                    answers.append(stack.enter_context(Tcp(found)).ask(CONNECT, 0.3))

        a2l = a2l_read.parse(found.a2l, "served")
        log = measure.record(address.parse(found.address), a2l, ["z_b", "sample"], 0.2, during=bother)
        with Tcp(found) as one:
            assert one.connect()
            with pytest.raises(links.Refused, match="another tool is connected; end its session"):
                links.connected(address.parse(found.address)).__enter__()
    assert LATER in answers and set(answers) <= {LATER, b""}
    assert log.lost == 0 and (np.diff(log.values["sample"].astype(int)) == 1).all() and log.time[-1] > 1.5


def test_name_and_lists_are_those_of_the_a2l() -> None:
    """GET_ID has the A2L's name; of dynamic lists there are as many as were allocated, and before that none."""
    with served("tcp") as found, Tcp(found) as one:
        assert one.ask(CONNECT)[:1] == b"\xff"
        assert one.ask(GET_NAME) == b"\xff\x00\x00\x00\x04\x00\x00\x00" and one.ask(UPLOAD_4) == b"\xffnqvm"
        assert "/begin PROJECT nqvm " in found.a2l and "DYNAMIC 0x00 0x01 0x00" in found.a2l
        assert one.ask(GET_DAQ_PROCESSOR_INFO)[2:7] == b"\x00\x00\x01\x00\x00"
        assert one.ask(FREE_DAQ) == one.ask(ALLOC_DAQ_2) == b"\xff"
        assert one.ask(GET_DAQ_PROCESSOR_INFO)[2:7] == b"\x02\x00\x01\x00\x00"


def test_late_steps_are_reported_while_it_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A model that no machine steps in its sample time."""
    path = tmp_path / "fast.toml"
    path.write_text(f'[model]\nextends = "{NQVM}"\nname = "fast"\nsample_time = "1 us"\n')
    with virtual.served(penode_gen.load(path), "tcp", "127.0.0.1", 0, np.zeros((1, 1), np.float32)) as found:
        serve._wait(3.0, found, 0.1)
        assert 0 < found.late <= found.steps
    assert "steps so far came more than a period late: " in capsys.readouterr().err


def timer(port: int) -> str:
    """The timer of the server's end of the connection at a port."""
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    (found,) = [row[5][:2] for row in rows if int(row[1].split(":")[1], 16) == port and row[3] == "01"]
    return found


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="there is no /proc/net/tcp here")
def test_tcp_connection_is_probed() -> None:
    with served("tcp") as found:
        port = int(found.address.rpartition(":")[2])
        with socket.create_connection(("127.0.0.1", port)) as line:
            line.sendall(framed(CONNECT))
            assert line.recv(300)[4:5] == b"\xff"
            line.settimeout(0.5)
            with pytest.raises(TimeoutError):
                line.recv(300)  # until the acknowledgement of the answer is in
            assert timer(port) == KEEPALIVE


WITHOUT_A_CABLE = f"""
import socket, subprocess, sys, time
sys.path.insert(0, {str(Path(__file__).parent)!r})
from test_serve_lines import CONNECT, GONE, framed, served
def cable(end):
    subprocess.run(["ip", "link", "set", "lo", end], check=True)
cable("up")
with served("tcp") as found:
    at = ("127.0.0.1", int(found.address.rpartition(":")[2]))
    first = socket.create_connection(at)
    first.sendall(framed(CONNECT))
    assert first.recv(300)[4:5] == b"\\xff"
    cable("down")
    time.sleep(GONE + 2.0)
    cable("up")
    second = socket.create_connection(at, timeout=5.0)
    second.sendall(framed(CONNECT))
    print("answered" if second.recv(300)[4:5] == b"\\xff" else "silent")
"""


@pytest.mark.long
def test_port_is_free_again_when_a_master_vanishes() -> None:
    """In a network of its own, whose only cable is out for longer than the controller waits."""
    if os.geteuid() != 0 or subprocess.run(["unshare", "-n", "ip", "link", "set", "lo", "up"], capture_output=True).returncode:
        pytest.skip("a network of its own needs root, unshare and ip")
    done = subprocess.run(["unshare", "-n", sys.executable, "-c", WITHOUT_A_CABLE], capture_output=True, text=True, timeout=120)
    assert done.stdout.strip() == "answered", done.stderr[-2000:]
