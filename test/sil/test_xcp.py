# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A calibration session with the Python master pyxcp, over TCP and UDP, with the slave in a virtual controller."""

from __future__ import annotations

import importlib.util
import json
import re
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
XCP = ROOT / "test" / "xcp"
VALUES = 1198  # of a set of nqvm
FIRST = 1000  # id of the first set that a master opens: server.c

pytestmark = pytest.mark.skipif(importlib.util.find_spec("pyxcp") is None, reason="pyxcp is not installed: pip install penode[xcp]")


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The virtual controller: the C of nqvm, the slave, sockets."""
    elf = tmp_path_factory.mktemp("xcp") / "server"
    model = ROOT / "gen" / "nqvm" / "c"
    subprocess.run(
        [
            ROOT / "port/host/cc",
            "gcc",
            "-std=c99",
            "-D_GNU_SOURCE",
            "-O2",
            "-Wall",
            "-Wextra",
            "-Werror",
            f"-I{model}",
            f"-I{ROOT}/port/xcp",
            "-pthread",
            "-o",
            elf,
            XCP / "server.c",
            ROOT / "port/xcp/xcp_frame.c",
            *sorted((ROOT / "src").glob("*.c")),
            model / "nqvm.c",
            model / "nqvm_params.c",
        ],
        check=True,
    )
    return elf


@pytest.fixture(scope="module")
def values() -> np.ndarray:
    """The set `default` with each value 1 % larger: other values everywhere, all finite."""
    text = re.sub(r"/\*.*?\*/", "", (ROOT / "gen" / "nqvm" / "c" / "nqvm_params.c").read_text(), flags=re.S)
    numbers = re.search(r"nqvm_value_default\[\w+\] = \{(.*?)\}", text, re.S)[1].replace("(pen_real_t)", "").replace("F", "")
    default = np.array([float(n) for n in numbers.split(",") if n.strip()], np.float32)
    assert default.size == VALUES
    return (default * np.float32(1.01)).astype(np.float32)


def session(server: Path, values: np.ndarray, folder: Path, protocol: str, max_cto: int) -> dict:
    file = folder / "set.bin"
    file.write_bytes(values.astype("<f4").tobytes())
    with subprocess.Popen([server, protocol, str(max_cto)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as running:
        port = running.stdout.readline().strip()
        done = subprocess.run([sys.executable, XCP / "client.py", protocol, port, file], capture_output=True, text=True, timeout=300)
        running.stdin.close()
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return json.loads(done.stdout.splitlines()[-1])


def in_force(switch: dict, number: int) -> None:
    """A set came into force at the first step after its commit: not before, not later, and only once."""
    before, answered, after = switch["before"], switch["answered"], switch["after"]
    assert after["id"] == number
    # The commit is between the samples shown before and after the answer; the step after it adopts.
    assert before["samples"] < after["adopted_at"] <= answered["samples"] + 1


@pytest.mark.parametrize(("protocol", "max_cto"), [("tcp", 252), ("udp", 252), ("tcp", 8)], ids=["tcp", "udp", "packets of CAN"])
def test_calibration_session(server: Path, values: np.ndarray, tmp_path: Path, protocol: str, max_cto: int) -> None:
    seen = session(server, values, tmp_path, protocol, max_cto)
    assert (seen["name"], seen["epk"]) == ("nqvm", "nqvm 0.1.0 test")
    assert seen["pages"] == [1, 0]  # the reference runs, the tool looks at the working page
    assert seen["info"] == [1, 2]  # one segment, two pages
    in_force(seen["first"], FIRST)
    assert seen["proof"] == ["XCP_CRC_32", zlib.crc32(values.astype("<f4").tobytes())]
    assert seen["staged"]["id"] == FIRST  # written and proven, not in force
    in_force(seen["switched"], FIRST + 1)
    assert seen["read back"]
    assert "ERR_GENERIC" in seen["refused"]  # NaN
    assert seen["still"]["id"] == FIRST + 1
    assert all("ERR_ACCESS_DENIED" in error for error in seen["denied"] + seen["outside"])
    in_force(seen["back"], 1)
    assert seen["ecu page"] == 1
    assert "ERR_GENERIC" in seen["again"]
    assert seen["clean"]
