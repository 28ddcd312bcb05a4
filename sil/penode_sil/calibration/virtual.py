# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A virtual controller: the compiled model in real time, in a process of its own (port/host/serve.c)."""

from __future__ import annotations

import importlib.util
import socket
import subprocess
import tempfile
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import penode_gen
from penode_gen import exports
from penode_gen.algebra import placeholder
from penode_gen.model import Model
from penode_gen.resources import native

from .. import scenario as scenarios
from ..building import FLAGS, Part, build_once, code_of, compiler_version, filter_options, generated, include, model_options, sources_in
from ..console import note
from ..errors import ModelError, TargetError, WrongUse
from .codes import Slave

MEASURED = "shown"  # the variable of it with what may be measured besides the instance
TROUBLE = {2: "it refused the model, or its inputs", 3: "the port is taken, or the address is not one of this machine"}


def identity(model: Model) -> str:
    """The EPK of a program of this model."""
    return f"{model.name} {penode_gen.VERSION} {model.digest[:12]}"


def period(model: Model) -> int:
    """Time between two steps [ns]. Raises UserError where that is no whole number: a controller that rounds it runs at another speed."""
    exact = model.sample_time * 1e9
    found = round(exact)
    if found < 1000 or abs(found - exact) > 1e-12 * exact:  # 1e-12: a few roundings of float64, from "0.3 ms" to seconds
        near = max(round(exact / 1000.0), 1)
        raise ModelError(
            [
                f"{model.path.name}: sample_time: {model.sample_time!r} s is not a whole number of nanoseconds from 1000 on, "
                f'which a controller needs; choose another, such as "{near} us"'
            ]
        )
    return int(found)


def build(model: Model) -> Path:
    """The virtual controller of a model. Raises UserError."""
    source, firmware = generated(model), native("sil", "firmware")
    code, runtime = code_of(model, source), sources_in(("src", "*.c"))
    own = [
        *(native("port", "host", name) for name in ("serve.c", "serve_line.c")),
        firmware / "controller.c",
        native("port", "xcp", "xcp_frame.c"),
    ]
    folders = [*include("inc", "port/gnu", "port/xcp", "sil/firmware"), f"-I{source}"]
    options = ["gcc", "-O2", "-g", *FLAGS, "-fno-pie", *folders]
    read: list[Part] = [
        compiler_version("gcc"),
        *sources_in(("inc", "*.h"), ("port/gnu", "*.h"), ("port/xcp", "*.h"), ("port/host", "*.h"), ("sil/firmware", "*.h")),
    ]
    same = build_once("runtime-serve", ".o", [*options[:-1], "-r", "-nostdlib", *map(str, runtime)], [*read, *runtime])  # for every model
    told = [f'-DCONTROLLER_EPK="{identity(model)}"', f"-DCONTROLLER_PERIOD={period(model)}ULL"]
    command = [*options, "-no-pie", "-pthread", *model_options(model), *filter_options(model), *told, *map(str, [*own, *code, same])]
    return build_once(f"{model.name}-serve", ".elf", command, [*read, *own, *code, *sorted(source.glob(f"{model.name}*.h")), same])


def describe(model: Model, program: Path, transport: str) -> str:
    """The A2L of a virtual controller."""
    options = {"elf": program, "instance": "filter.model" if model.filter else "controller", "measure": MEASURED, "transport": transport}
    return exports.export(model, "a2l", Path("served.a2l"), options).decode()


def inputs(model: Model, scenario: Path | None) -> NDArray[np.float32]:
    """What drives it, sample by sample, [n, n_u], played again and again; a row of zeros without a scenario."""
    if scenario is None:
        return np.zeros((1, max(len(model.inputs), 1)), np.float32)
    plan = scenarios.load(scenario, model, int(penode_gen.set_head(model, "default")[1]))
    if any(instance.exchanges for instance in plan.instances) or plan.initial:
        note(f"{scenario}: only its inputs are used; exchanges and start states are those of the tool, and of the model file")
    u = scenarios.sampled(plan, model, scenarios.sample_times(plan, model.sample_time))
    return np.ascontiguousarray(placeholder.columns(model, u), dtype=np.float32)


def free_port(host: str, datagrams: bool) -> int:
    """A port that nobody listens to."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM if datagrams else socket.SOCK_STREAM) as probe:
        probe.bind((host, 0))
        return int(probe.getsockname()[1])


@dataclass
class Served:
    """
    A virtual controller that runs: `address` is what --to takes. `steps` and `late` are updated in each second with late steps, and at the
    end; `first`: it steps before all other programs (SCHED_FIFO).
    """

    address: str
    a2l: str
    first: bool = False
    steps: int = 0
    late: int = 0

    def listen(self, said: Iterable[str]) -> None:
        """Take over steps and late steps from the lines of the controller, until they end."""
        for line in said:
            words = line.split()
            if len(words) == 2:
                self.steps, self.late = int(words[0]), int(words[1])


@contextmanager
def served(
    model: Model, kind: str, host: str, port: int, u: NDArray[np.float32], quiet: int = 0, max_cto: int = Slave.MAX_CTO
) -> Iterator[Served]:
    """Run a virtual controller; `kind` is tcp, udp or frames (CAN frames as datagrams). Raises UserError."""
    program = build(model)
    try:
        port = port or free_port(host, kind != "tcp")
    except OSError as exc:
        raise WrongUse(f"--host: {host} is not an address of this machine; use 127.0.0.1, or 0.0.0.0 for all") from exc
    a2l = (
        describe(model, program, f"{kind}:{host}:{port}" if kind != "frames" else "can:0x100:0x101")
        if importlib.util.find_spec("elftools")
        else ""
    )
    with tempfile.TemporaryDirectory() as folder:
        stimulus, offered = Path(folder, "inputs"), Path(folder, "a2l")
        stimulus.write_bytes(u.astype(np.float32).tobytes())
        offered.write_text(a2l, encoding="utf-8")
        words = [program, kind, host, port, int(max_cto), quiet, stimulus, offered if a2l else "-"]
        with subprocess.Popen(
            [str(word) for word in words],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        ) as process:
            assert process.stdin and process.stdout and process.stderr
            begun = process.stdout.readline().split()
            if not begun:
                process.wait()
                raise TargetError(f"{kind}:{host}:{port}: {TROUBLE.get(process.returncode, 'it did not start')}; choose another port")
            found = Served(f"{kind}:{host}:{port}", a2l, begun[1:] == ["fifo"])
            ear = threading.Thread(target=found.listen, args=(process.stdout,))
            ear.start()
            try:
                yield found
            finally:
                process.stdin.close()
                ear.join()
