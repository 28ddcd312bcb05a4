# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The lines of the virtual controller, byte by byte: who its master is over UDP, and what becomes of one that is gone over TCP."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np
import pytest

import penode_gen
from penode_sil.calibration import virtual

NQVM = Path(__file__).resolve().parents[2] / "gen" / "nqvm" / "nqvm.toml"
CONNECT, DISCONNECT, GET_STATUS = b"\xff\x00", b"\xfe", b"\xfd"
GONE = 10.0  # s: port/host/serve.c
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


def timer(port: int) -> str:
    """Of the server's end of the connection at a port."""
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
