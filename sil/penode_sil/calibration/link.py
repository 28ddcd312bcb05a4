# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A connection to an XCP slave, by pyxcp (pip install penode[xcp]); its errors are UserErrors of one line."""

from __future__ import annotations

import importlib.util
import logging
import socket
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from .. import status
from ..errors import TargetError, ToolMissing, UserError
from .a2l_read import A2l, Entry, parse
from .address import Address
from .codes import Page, Text, Who

_CRC_32 = "XCP_CRC_32"


class Refused(TargetError):
    """A negative answer of the slave; `answer` is its code, `flags` what its tuning call reported, 0 if nothing."""

    def __init__(self, what: str, code: str, flags: int):
        self.answer, self.flags = code, flags
        reasons = f": {', '.join(status.names(flags))}" if flags else ""
        super().__init__(f"{what}: the controller refused it ({code}{reasons}); {_REMEDIES.get(code, 'the running set stays in force')}")


_REMEDIES = {
    "ERR_GENERIC": "the running set stays in force; correct the set",
    "ERR_CMD_BUSY": "a set waits for a step: is the controller stepping?",
    "ERR_ACCESS_LOCKED": "it asks for a key, and penode has none",
    "ERR_ACCESS_DENIED": "the A2L is that of another program; name its own by --a2l",
    "ERR_CMD_UNKNOWN": "it has no such command",
    "ERR_DAQ_ACTIVE": "another measurement runs; stop it",
    "ERR_MEMORY_OVERFLOW": "measure fewer signals",
    "ERR_RESOURCE_TEMPORARY_NOT_ACCESSIBLE": "another tool is connected; end its session",
}


def _without_noise(application: Any) -> None:
    """pyxcp reports each refusal on stderr, with a page of diagnostics."""
    for logger in (
        application.log,
        *(logging.getLogger(name) for name in list(logging.root.manager.loggerDict) if "pyxcp" in name.lower()),
    ):
        logger.handlers = [logging.NullHandler()]
        logger.propagate = False
        logger.setLevel(logging.CRITICAL + 1)


def _spy() -> Any:
    """A policy of pyxcp that keeps the last negative answer: its exceptions leave out what follows the code."""
    from pyxcp.transport.base import FrameCategory, NoOpPolicy

    class Spy(NoOpPolicy):  # type: ignore[misc]  # compiled, without types
        """Sees every frame."""

        def __init__(self) -> None:
            super().__init__(filtered_out=None)
            self.error = b""

        def feed(self, category: Any, counter: int, timestamp: int, payload: bytes) -> None:
            if category == FrameCategory.ERROR:
                self.error = bytes(payload)

    return Spy()


class Link:
    """A connected master. `order` is "<" or ">", that of the target."""

    def __init__(self, master: Any, spy: Any, address: Address):
        self.master, self.address = master, address
        self._spy = spy
        self.order: Literal["<", ">"] = "<"

    def connect(self) -> None:
        """CONNECT, and what pyxcp has to know. Raises UserError."""
        answer = self.ask("connect", self.master.connect)
        self.order = ">" if str(answer.commModeBasic.byteOrder) == "MOTOROLA" else "<"
        self.ask("GET_COMM_MODE_INFO", self.master.getCommModeInfo)  # before any block transfer

    def ask(self, what: str, call: Callable[..., Any], *arguments: Any) -> Any:
        """Call pyxcp. Raises Refused, and UserError where no answer comes."""
        from pyxcp import types

        try:
            return call(*arguments)
        except types.XcpResponseError as exc:
            error = getattr(self._spy, "error", b"")
            flags = int(np.frombuffer(error[3:7], self.order + "u4")[0]) if len(error) >= 7 else 0
            raise Refused(what, str(exc.args[0]), flags) from None
        except (types.XcpTimeoutError, OSError, SystemExit) as exc:
            raise TargetError(f"{self.address.text}: no answer to {what}; is the controller running, and no other tool connected?") from exc

    def give_up(self) -> None:
        """No answer is expected any more: what is still asked for waits 0.1 s."""
        self.master.transport.timeout = 100_000_000  # ns

    def read(self, address: int, n: int) -> bytes:
        """n bytes of memory."""
        self.ask("SET_MTA", self.master.setMta, address)
        return bytes(self.ask("UPLOAD", self.master.fetch, n))

    def values(self, entry: Entry) -> NDArray[Any]:
        """The numbers of an entry, [count]."""
        return np.frombuffer(self.read(entry.address, entry.size), entry.type.newbyteorder(self.order)).astype(entry.type)

    def number(self, entry: Entry) -> float:
        """The only number of an entry."""
        return float(self.values(entry)[0])

    def write(self, address: int, data: bytes) -> None:
        """Bytes into the working page."""
        self.ask("SET_MTA", self.master.setMta, address)
        self.ask("DOWNLOAD", self.master.push, address, 0, data)

    def checksum(self, address: int, n: int) -> int:
        """CRC-32 of n bytes; of a page, of its serial form."""
        self.ask("SET_MTA", self.master.setMta, address)
        answer = self.ask("BUILD_CHECKSUM", self.master.buildChecksum, n)
        if str(answer.checksumType) != _CRC_32:
            raise TargetError(f"{self.address.text}: its checksum is {answer.checksumType}; a slave of penode has {_CRC_32}")
        return int(answer.checksum)

    def set_page(self, who: Who, page: Page) -> None:
        """SET_CAL_PAGE of segment 0. Of the ECU: what was written is checked, and in force with the next step, or Refused."""
        self.ask("SET_CAL_PAGE", self.master.setCalPage, int(who), 0, int(page))

    def page(self, who: Who) -> Page:
        """GET_CAL_PAGE of segment 0."""
        return Page(self.ask("GET_CAL_PAGE", self.master.getCalPage, int(who), 0))

    def text(self, kind: Text) -> str:
        """GET_ID; "" if the slave has no such text."""
        return str(self.ask("GET_ID", self.master.identifier, int(kind)) or "")

    def a2l(self, path: Path | None) -> A2l:
        """The A2L of a file, or the one that the slave offers, once it is known to be that of the program. Raises UserError."""
        text = path.read_text(encoding="utf-8", errors="replace") if path is not None else self.text(Text.A2L)
        if not text:
            raise TargetError(f"{self.address.text}: the controller offers no A2L; name it by --a2l (penode export --format a2l writes it)")
        found = parse(text, str(path or self.address.text))
        epk = self.text(Text.EPK) if found.epk is not None else ""
        if found.epk is not None and epk and epk != found.epk[0]:
            raise TargetError(
                f'{path or self.address.text}: the A2L is that of "{found.epk[0]}", the controller is "{epk}"; '
                "export the A2L of its program"
            )
        return found


@contextmanager
def connected(address: Address, policy: Any = None, patience: float = 10.0) -> Iterator[Link]:
    """A link, disconnected at the end. `patience` [s] for an answer: more than any command takes, on a serial line too. Raises
    UserError."""
    if importlib.util.find_spec("pyxcp") is None:
        raise ToolMissing("XCP needs the Python package pyxcp, which is not installed; pip install penode[xcp]")
    from pyxcp.config import create_application_from_config, set_application
    from pyxcp.master import Master

    arguments, sys.argv = sys.argv, sys.argv[:1]  # which pyxcp would read
    try:
        if "Eth" in address.settings:  # pyxcp raises a bare Exception
            socket.getaddrinfo(address.settings["Eth"]["host"], None, socket.AF_INET)
        application = create_application_from_config({"General": {"disable_error_handling": True}, "Transport": address.settings})
        set_application(application)
        _without_noise(application)
        spy = policy or _spy()
        master = Master(address.layer, config=application, policy=spy)
        _without_noise(application)
    except (OSError, SystemExit) as exc:
        raise TargetError(f"{address.text}: it cannot be opened; name a device, or a host, that is there") from exc
    finally:
        sys.argv = arguments
    master.transport.timeout = round(patience * 1e9)  # pyxcp takes it from no configuration
    link = Link(master, spy, address)
    try:
        master.transport.connect()
    except OSError as exc:
        raise TargetError(f"{address.text}: nothing answers there; start the controller (penode serve), or correct --to") from exc
    try:
        link.connect()
        yield link
    finally:
        with suppress(UserError):
            link.ask("DISCONNECT", master.disconnect)
        master.close()
