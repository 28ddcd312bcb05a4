# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a calibration tool does, by the Python master pyxcp: client.py tcp|udp PORT VALUES; prints what it saw as JSON.

VALUES holds the new set, 4 bytes a value, little endian. The segment and the regions are those of server.c.
"""

from __future__ import annotations

import json
import logging
import struct
import sys
import time
import zlib
from pathlib import Path

from pyxcp.config import create_application_from_config, set_application
from pyxcp.master import Master
from pyxcp.types import TryCommandResult

SEGMENT, SHOWN, EPK = 0x10000, 0x1000, 0x2000
ECU, TOOL, ALL = 1, 2, 0x83
SHOWN_SIZE = 16


def refused(master: Master, call, *arguments) -> str:
    """The error by which the slave refuses a call; "" if it does not."""
    result, answer = master.try_command(call, *arguments)
    return "" if result == TryCommandResult.OK else str(answer)


def master_of(protocol: str, port: int) -> Master:
    application = create_application_from_config({"Transport": {"Eth": {"host": "127.0.0.1", "port": port, "protocol": protocol.upper()}}})
    set_application(application)
    logging.getLogger("PYXCP").setLevel(logging.CRITICAL)
    master = Master("eth", config=application)
    master.transport.timeout = 30_000_000_000  # ns: the machine may be busy
    return master


def fetch(master: Master, address: int, n: int) -> bytes:
    master.setMta(address)
    return bytes(master.fetch(n))


def shown(master: Master) -> dict[str, float]:
    return dict(zip(("samples", "id", "adopted_at", "z_b"), struct.unpack("<IIIf", fetch(master, SHOWN, SHOWN_SIZE)), strict=True))


def after(master: Master, samples: int) -> dict[str, float]:
    """What is shown once two more steps are done."""
    while (now := shown(master))["samples"] < samples + 2:
        time.sleep(0.001)
    return now


def switch(master: Master, page: int) -> dict[str, object]:
    before = shown(master)
    master.setCalPage(ECU, 0, page)
    answered = shown(master)
    return {"before": before, "answered": answered, "after": after(master, int(answered["samples"]))}


def session(master: Master, new: bytes) -> dict[str, object]:
    seen: dict[str, object] = {}
    master.connect()
    master.getCommModeInfo()
    seen["name"], seen["epk"] = master.identifier(1), fetch(master, EPK, 15).decode()
    seen["pages"] = [master.getCalPage(mode, 0) for mode in (ECU, TOOL)]
    seen["info"] = [master.getPagProcessorInfo().maxSegments, master.getSegmentInfo(1, 0, 0, 0).maxPages]
    reference = fetch(master, SEGMENT, len(new))
    seen["reference"] = zlib.crc32(reference)
    seen["first"] = switch(master, 0)
    master.setMta(SEGMENT)
    master.push(SEGMENT, 0, new)
    master.setMta(SEGMENT)
    check = master.buildChecksum(len(new))
    seen["proof"] = [check.checksumType, check.checksum]
    seen["staged"] = shown(master)
    seen["switched"] = switch(master, 0)
    seen["read back"] = fetch(master, SEGMENT, len(new)) == new
    master.setMta(SEGMENT)
    master.download(struct.pack("<f", float("nan")))
    seen["refused"] = refused(master, master.setCalPage, ECU, 0, 0)
    seen["still"] = after(master, int(shown(master)["samples"]))
    seen["denied"] = []
    for address in (SHOWN, SEGMENT - 4, SEGMENT + len(new) - 3):
        master.setMta(address)
        seen["denied"].append(refused(master, master.download, b"1234"))
    seen["outside"] = [
        refused(master, master.shortUpload, 4, a) for a in (0, SHOWN - 1, SHOWN + 13, SEGMENT - 1, SEGMENT + len(new) - 3, 0xFFFFFFFF)
    ]
    seen["back"] = switch(master, 1)
    seen["ecu page"] = master.getCalPage(ECU, 0)
    seen["again"] = refused(master, master.setCalPage, ECU, 0, 0)  # the working page still holds the NaN
    master.disconnect()
    master.connect()
    seen["clean"] = fetch(master, SEGMENT, len(new)) == reference
    master.disconnect()
    return seen


def main() -> int:
    protocol, port, values = sys.argv[1], int(sys.argv[2]), Path(sys.argv[3]).read_bytes()
    with master_of(protocol, port) as master:
        seen = session(master, values)
    print(json.dumps(seen, default=str))
    return 0


if __name__ == "__main__":
    sys.exit(main())
