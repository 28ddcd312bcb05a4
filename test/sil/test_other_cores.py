# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The bits of the host on cores that no port has: RISC-V without FPU, Armv6-M by clang, and a big-endian one."""

from __future__ import annotations

import os
import re
import shutil

import pytest
from places import ROOT
from test_targets import chirp, every_call, need

import penode_gen
from penode_sil import building, targets
from penode_sil.errors import UserError

# the emulator and the compiler of each core of test/builds/user
CORES = {
    "rv32": ("qemu-riscv32", "riscv64-unknown-elf-gcc"),
    "s390x": ("qemu-s390x", "s390x-linux-gnu-gcc"),
    "m0": ("qemu-system-arm", "clang-19"),
}


def use(core, monkeypatch, folder):
    """Let Pil() make and run programs for one of CORES."""
    need("gcc", *CORES[core])
    monkeypatch.setattr(targets, "PORT", ROOT / "test" / "builds" / "user")
    monkeypatch.setattr(targets, "SHELL", "bash")
    monkeypatch.setitem(targets.MACHINES, core, core)
    monkeypatch.setenv("PENODE_BUILD", str(folder))
    monkeypatch.setenv("SHIFT", "none")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where programs are built: the runtime of a core once for both models."""
    return tmp_path_factory.mktemp("cores")


@pytest.mark.parametrize("name", ["nqvm", "nqvm_folded"])
@pytest.mark.parametrize("core", CORES)
def test_the_steps_of_a_chirp_are_the_same(name, core, monkeypatch, folder, show):
    """The layered model takes minutes: 1000 steps of it, and 20 000 folded ones on m0; 100 000 of all with PENODE_LONG=1."""
    use(core, monkeypatch, folder)
    folded, every = name == "nqvm_folded", "PENODE_LONG" in os.environ
    steps = 100_000 if every or (folded and core != "m0") else 20_000 if folded else 1000
    nqvm, u = penode_gen.load(ROOT / "gen" / "nqvm" / f"{name}.toml"), chirp(steps)
    sil, pil = targets.Sil(nqvm).run(u), targets.Pil(nqvm, core).run(u)
    show(f"{name}, hash of {len(u)} steps on {core}: {pil.digest[:16]}")
    assert pil.digest == sil.digest


@pytest.mark.parametrize("core", CORES)
def test_every_call_has_the_same_answer(core, nqvm, monkeypatch, folder):
    """Sets that are written, refused, selected, rolled back; in a size build, where compilers like to call memcpy."""
    use(core, monkeypatch, folder)
    u, calls = every_call(nqvm)
    sil, pil = targets.Sil(nqvm).run(u, calls), targets.Pil(nqvm, core, optimise="-Os").run(u, calls)
    assert [status for _, status in sil.calls] == [status for _, status in pil.calls]
    for what in ("x", "y", "z", "status"):
        assert getattr(sil, what).tobytes() == getattr(pil, what).tobytes(), what


def test_a_checksum_over_bytes_as_they_lie_is_found(nqvm, monkeypatch, tmp_path):
    """Seeded fault: what the runtime did before a set had an order of bytes."""
    use("s390x", monkeypatch, tmp_path)
    for part in ("src", "sil/firmware"):
        shutil.copytree(ROOT / part, tmp_path / "copy" / part)
    file = tmp_path / "copy" / "src" / "pen_serial.c"
    body = r"(static size_t swap\(void\)\n\{\n.*?return )[^;]*;"  # of the probe of the order of bytes
    text, found = re.subn(body, r"\1(first[0] == 2U) ? 1U : 0U;", file.read_text(), flags=re.S)
    assert found == 1
    file.write_text(text)
    for module in (building, targets):
        monkeypatch.setattr(module, "native", (tmp_path / "copy").joinpath)
    with pytest.raises(UserError, match="it refused the first parameter set"):
        targets.Pil(nqvm, "s390x").run(chirp(1))
