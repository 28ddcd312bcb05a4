# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A controller on an emulated Cortex-M: the step in its timer interrupt, the slave in its main loop, on its serial line."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Model
from penode_gen.resources import native

from ..building import (
    FLAGS,
    build_once,
    code_of,
    compiler_version,
    filter_options,
    generated,
    include,
    missing_tool,
    model_options,
    sources_in,
)
from ..errors import ModelError, ScenarioError, TargetError, WrongUse, hint
from ..targets import MACHINES, PORT, _included, cross
from .codes import Slave
from .virtual import Served, describe, free_port, identity, period

WITH_UART = ("m4f", "m3", "m7")  # port/cortex-m/uart.c knows their serial line
_EMULATOR = "qemu-system-arm"


def build(model: Model, machine: str) -> Path:
    """The program for one of WITH_UART, with debug information. Raises UserError."""
    if machine not in WITH_UART:
        raise WrongUse(f'--on: there is no controller for "{machine}"; {hint(machine, WITH_UART)}')
    between = period(model)
    if 10**9 % between:  # ns
        raise ModelError(
            [
                f"{model.path.name}: the emulated timer has no whole number of ticks a second for a sample_time of "
                f"{model.sample_time!r} s; "
                "use --on sil"
            ]
        )
    source, firmware = generated(model), native("sil", "firmware")
    code = [*code_of(model, source), *sources_in(("src", "*.c"))]
    own = [firmware / "serve_uart.c", firmware / "controller.c", PORT / "uart.c", native("port", "xcp", "xcp_frame.c")]
    command = [
        *cross(MACHINES[machine]),
        *FLAGS,
        "-O2",
        "-g",
        *include("port/xcp"),
        f"-I{PORT}",
        f"-I{source}",
        *model_options(model),
        *filter_options(model),
        f'-DCONTROLLER_EPK="{identity(model)} {machine}"',
        f"-DCONTROLLER_PERIOD={between}ULL",
        *map(str, [*own, *code]),
    ]
    headers = [*sources_in(("port/xcp", "*.h"), ("sil/firmware", "*.h")), *sorted(source.glob(f"{model.name}*.h"))]
    return build_once(
        f"{model.name}-uart-{machine}", ".elf", command, [compiler_version("arm-none-eabi-gcc"), *_included(), *headers, *own, *code]
    )


@contextmanager
def emulated(model: Model, machine: str, host: str, port: int | None, u: NDArray[np.float32]) -> Iterator[Served]:
    """
    Run it. Its serial line is a TCP port, which XCP over Ethernet finds there too: the frames are the same; with port None a device of this
    machine. Raises UserError.
    """
    if shutil.which(_EMULATOR) is None:
        raise missing_tool(_EMULATOR)
    inputs = u.astype(np.float32).tobytes()
    if len(inputs) > Slave.STIMULUS:
        most = Slave.STIMULUS // (len(inputs) // len(u)) * model.sample_time
        raise ScenarioError(
            f"--scenario: the emulated controller holds the inputs of {most:g} s, not of {len(u) * model.sample_time:g} s; shorten it, "
            "or use --on sil"
        )
    program = build(model, machine)
    port = port if port is None else port or free_port(host, False)
    line = "pty" if port is None else f"tcp:{host}:{port},server=on,wait=off"
    a2l = describe(model, program, "serial:115200" if port is None else f"tcp:{host}:{port}")
    with tempfile.TemporaryDirectory() as folder:
        stimulus = Path(folder, "inputs")
        stimulus.write_bytes(inputs)
        words = [
            _EMULATOR,
            "-machine",
            MACHINES[machine],
            "-display",
            "none",
            "-monitor",
            "none",
            "-serial",
            line,
            "-semihosting-config",
            f"enable=on,target=native,arg=program,arg={stimulus}",
            "-kernel",
            str(program),
        ]
        with subprocess.Popen(
            words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
        ) as process:
            assert process.stdout
            device = process.stdout.readline().partition("redirected to ")[2].split()[:1] if port is None else []
            time.sleep(0.5)
            if process.poll() is not None:
                raise TargetError(
                    f"{line}: the emulator has ended ({process.stdout.read().strip() or process.returncode}); choose another port"
                )
            try:
                yield Served(f"serial:{device[0]}" if device else f"tcp:{host}:{port}", a2l)
            finally:
                process.terminate()
