# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Where an XCP slave is: tcp:HOST:PORT, udp:HOST:PORT or serial:DEVICE[:BAUD]."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..errors import WrongUse

FORMS = "tcp:HOST:PORT, udp:HOST:PORT or serial:DEVICE[:BAUD]"


@dataclass(frozen=True)
class Address:
    """`layer` and `settings` as pyxcp calls them."""

    text: str
    layer: str
    settings: dict[str, Any]


def parse(text: str, baud: int = 115200) -> Address:
    """`baud` is that of a serial line whose address names none. Raises UserError."""
    kind, _, rest = text.partition(":")
    place, _, number = rest.rpartition(":")
    if kind in ("tcp", "udp") and place and number.isdecimal() and 0 < int(number) < 65536:
        return Address(text, "eth", {"Eth": {"host": place, "port": int(number), "protocol": kind.upper(), "tcp_nodelay": True}})
    if kind == "serial" and rest:
        device, rate = (place, int(number)) if place and number.isdecimal() else (rest, baud)
        settings = {"port": device, "bitrate": rate, "header_format": "HEADER_LEN_CTR_WORD", "tail_format": "NO_CHECKSUM"}
        return Address(text, "sxi", {"SxI": settings})
    raise WrongUse(f'--to: "{text}" is not an address; use {FORMS}')
