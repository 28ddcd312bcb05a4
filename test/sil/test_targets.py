# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The same bits on host and target, with every compiler; constant cost; and errors of the target programs."""

from __future__ import annotations

import os
import re
import shutil
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import numpy as np
import pytest
from places import ROOT

import penode_gen
from penode_sil.errors import UserError
from penode_sil.scenario import Exchange
from penode_sil.schedule import Call, exchange_calls
from penode_sil.signals import VelocityChirp
from penode_sil.status import FLAGS, counts
from penode_sil.targets import MACHINES, Pil, Sil

BOARDS = [name for name, board in MACHINES.items() if board]
HARD_FLOAT = [name for name in BOARDS if name != "m3"]
COMPILERS = [("gcc", "-O2"), ("gcc", "-O3", "-march=native"), ("clang-19", "-O2")]


def need(*programs):
    for program in programs:
        if shutil.which(program) is None:
            pytest.skip(f"{program} is not installed; make test installs it")


def chirp(samples):
    """The published road, from the start again every 60 s."""
    return VelocityChirp(0.15, 1.0, 0.25, np.pi / 2).value(np.arange(samples) * 1e-3 % 60.0)[:, None]


def every_call(model):
    """Samples and calls that exercise everything, refusals and bad inputs included."""
    u = chirp(700)
    u[[50, 51, 600], 0] = np.nan, np.inf, -np.inf
    calls = [Call(0, "state", values=np.array([1e-3, 2e-3, 0.1, -0.1], dtype=np.float32))]
    calls += exchange_calls(model, Exchange(0.1, "altered_friction", "write", 64), np.float32)
    calls += exchange_calls(model, Exchange(0.15, "default", "write", 100, hold=True), np.float32)
    calls += [Call(200, "rollback"), Call(250, "select", set="default"), Call(251, "abort"), Call(251, "commit")]
    calls += [Call(300, "begin", head=(1, 2, 3, 4)), Call(300, "begin", head=penode_gen.set_head(model, "default", np.float32))]
    calls += [Call(301, "write", offset=5, values=np.ones(3, dtype=np.float32)), Call(302, "commit"), Call(303, "abort")]
    calls += [Call(400, "hold", on=True), Call(420, "hold", on=False), Call(500, "state", values=np.full(4, np.nan, np.float32))]
    return u, calls


@cache
def every_call_on(machine, name):
    """Host and target through every call; emulated once for bits and for cost."""
    nqvm = penode_gen.load(ROOT / "gen" / "nqvm" / f"{name}.toml")
    return Sil(nqvm).run(*every_call(nqvm)), Pil(nqvm, machine).run(*every_call(nqvm))


@pytest.mark.parametrize("name", ["nqvm", "nqvm_folded"])
@pytest.mark.parametrize("machine", list(MACHINES))
def test_sil_and_pil_agree_to_the_bit_in_every_sample(name, machine):
    need("gcc", *(["qemu-system-arm", "arm-none-eabi-gcc"] if MACHINES[machine] else []))
    sil, pil = every_call_on(machine, name)
    for name in ("x", "y", "z", "status"):
        assert getattr(sil, name).tobytes() == getattr(pil, name).tobytes(), name
    assert [status for _, status in sil.calls] == [status for _, status in pil.calls]
    assert {"input_nonfinite", "held", "adopted"} <= set(counts(sil.status))
    assert counts(sil.status)["adopted"] == 4
    assert any(status for _, status in sil.calls)


@pytest.mark.parametrize("name", ["nqvm", "nqvm_folded"])
def test_steps_are_the_same_everywhere(name, monkeypatch, show):
    """100 000 folded steps; of the layered model, which takes minutes, 4 000, and as many with PENODE_LONG=1."""
    need("gcc", "clang-19", "qemu-system-arm", "arm-none-eabi-gcc")
    monkeypatch.setenv("SHIFT", "none")  # bits are compared, not counts
    steps = 100_000 if name == "nqvm_folded" or "PENODE_LONG" in os.environ else 4_000
    nqvm, u = penode_gen.load(ROOT / "gen" / "nqvm" / f"{name}.toml"), chirp(steps)
    digests = {" ".join(compiler): Sil(nqvm, compiler=compiler).run(u).digest for compiler in COMPILERS}
    with ThreadPoolExecutor(2) as pool:  # the work is done by other processes
        digests |= zip(BOARDS, pool.map(lambda machine: Pil(nqvm, machine).run(u).digest, BOARDS), strict=True)
    show(f"{name}, hash of {steps} steps: {digests['gcc -O2'][:16]} on {', '.join(digests)}")
    assert len(set(digests.values())) == 1, digests


@pytest.mark.parametrize("name", ["nqvm", "nqvm_folded"])
@pytest.mark.parametrize("machine", HARD_FLOAT)
def test_every_step_costs_the_same(name, machine, show):
    """Held, bad, adopting and normal steps, any input: one number, because no branch depends on data."""
    need("qemu-system-arm", "arm-none-eabi-gcc")
    run = every_call_on(machine, name)[1]
    show(
        f"{machine}: "
        + ", ".join(f"{kind} step {c.least}..{c.most} instructions" for kind, c in run.cost.items())
        + f", stack {run.stack} B"
    )
    assert set(run.cost) == {"normal", "adopting", "holding"}
    assert run.cost["normal"].most - run.cost["normal"].least == 0
    # adopting is a branch that bad data cannot take: two stores and two barriers more
    assert run.cost["adopting"].most - run.cost["normal"].most < 100
    if machine == "m4f":
        assert run.cost["normal"].most <= 18_000


def test_size_build_gives_the_same_bits_on_a_bounded_stack(nqvm, show):
    need("qemu-system-arm", "arm-none-eabi-gcc")
    run = Pil(nqvm, "m4f", optimise="-Os").run(chirp(400))
    assert run.digest == Sil(nqvm).run(chirp(400)).digest
    show(f"m4f -Os: stack of a step {run.stack} B, {run.cost['normal'].most} instructions")
    assert 0 < run.stack <= 400


def test_double_on_the_host_is_close_to_float(nqvm):
    u = chirp(5000)
    single, double = Sil(nqvm).run(u), Sil(nqvm, np.float64).run(u)
    # float's rounding, see test_published: some 6e-8 m over a minute
    assert 0.0 < np.max(np.abs(single.y - double.y)) < 1e-6


def test_flags_are_those_of_the_header():
    text = (ROOT / "inc" / "penode" / "pen_status.h").read_text()
    flags = {int(value, 16): name.lower() for name, value in re.findall(r"#define PEN_(\w+)\s+UINT32_C\(0x(\w+)\)", text)}
    assert [flags[1 << n] for n in range(len(FLAGS))] == list(FLAGS)


def test_missing_compiler_is_said(nqvm, tmp_path, monkeypatch):
    monkeypatch.setenv("PENODE_BUILD", str(tmp_path))
    with pytest.raises(UserError, match="no-such-compiler is not installed; install it"):
        Sil(nqvm, compiler=("no-such-compiler", "-O2"))
    assert not list(tmp_path.glob("*.so"))


@pytest.mark.parametrize(
    ("machine", "program", "packages"),
    [("host", "gcc", "gcc libc6-dev"), ("m4f", "arm-none-eabi-gcc", "gcc-arm-none-eabi libnewlib-arm-none-eabi")],
)
def test_missing_compiler_of_a_target_is_said(machine, program, packages, nqvm, tmp_path, monkeypatch):
    monkeypatch.setenv("PENODE_BUILD", str(tmp_path))
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(UserError, match=f"^{program} is not installed; install it, on Debian: apt-get install {packages}$"):
        Pil(nqvm, machine)


def test_missing_emulator_is_said(nqvm, tmp_path, monkeypatch):
    need("arm-none-eabi-gcc")
    pil = Pil(nqvm, "m4f")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(UserError, match=r"^qemu-system-arm is not installed; install it, on Debian: apt-get install qemu-system-arm$"):
        pil.run(chirp(1))


def test_tape_for_another_model_is_refused(nqvm, oscillator, monkeypatch):
    need("gcc")
    pil = Pil(nqvm, "host")
    monkeypatch.setattr(pil, "model", oscillator)
    with pytest.raises(UserError, match="pil:host: it was given a tape for another model"):
        pil.run(np.zeros((3, 1)))


def test_program_that_takes_too_long_is_ended(nqvm):
    need("qemu-system-arm", "arm-none-eabi-gcc")
    with pytest.raises(UserError, match="pil:m3: it took too long"):
        Pil(nqvm, "m3", limit=1).run(chirp(100_000))
