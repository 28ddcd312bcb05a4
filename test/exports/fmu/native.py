# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""FMUs compiled together with a master in C (master.c), for many steps: `make campaign-fmu` runs the longest."""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path

import penode_gen
from penode_gen import exports
from penode_gen.exports.fmi.files import _FLAGS
from penode_gen.model import Model

COUNTER = """[model]
name = "counter"
sample_time = "1 ms"
method = "euler"
[parameters]
r = { value = 1000, unit = "1/s" }
[states]
n = { unit = "1" }
[equations]
q = "der(n) = r"
[outputs]
samples = { value = "n", unit = "1" }
"""
_PLAIN = """#include "{name}.h"
#define PLAIN_STEP {step!r}
static {name}_t plain;
static {name}_banks_t plain_banks;

static void plain_begin(void)
{{
    (void){name}_init(&plain, &{name}_set_default, &plain_banks);
}}

static void plain_step(double value)
{{
    const {name}_u_t u = {{ (pen_real_t)value }};
    {name}_y_t y;

    (void){name}_step(&plain, &u, &y);
}}
"""


def counter(folder: Path) -> Model:
    """A model whose only output is the number of its samples."""
    path = folder / "counter.toml"
    path.write_text(COUNTER)
    return penode_gen.load(path)


@dataclass(frozen=True)
class Native:
    """A program of master.c and an FMU; its references by name."""

    program: Path
    token: str
    reference: dict[str, str]

    def numbers(self, task: str, name: str, *words: object) -> tuple[float, ...]:
        """What a task of master.c prints; `name`: of the variable that it needs."""
        command = [str(self.program), task, self.token, self.reference[name], *map(str, words)]
        return tuple(map(float, subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout.split()))

    def count(self, kind: str, start: float, size: float, samples: int, steps: int) -> tuple[float, ...]:
        """Steps that are refused, and comparisons that fail, of the counter."""
        return self.numbers("count", "samples", kind, repr(start), repr(size), samples, steps)


def build(model: Model, version: int, folder: Path, real: str = "float") -> Native:
    """Compile an FMU of a model with at most one input, with the options of the export."""
    path, sources = folder / "source.fmu", folder / "sources"
    path.write_bytes(exports.export(model, f"fmu{version}", path, {"source_only": True, "real": real}))
    zipfile.ZipFile(path).extractall(folder)
    (sources / "plain.h").write_text(_PLAIN.format(name=model.name, step=model.sample_time))
    own = [*(flag for flag in _FLAGS if flag != "-shared"), f"-DFMI_VERSION={version}", f"-DFMI{version}_OVERRIDE_FUNCTION_PREFIX"]
    files = [Path(__file__).with_name("master.c"), *sorted(sources.glob("*.c"))]
    subprocess.run(["gcc", *own, f"-I{sources}", *map(str, files), "-o", str(folder / "master"), "-lm"], check=True)
    text = (folder / "modelDescription.xml").read_text()
    token = re.search(r'(?:instantiationToken|guid)="([^"]*)"', text)
    assert token
    return Native(folder / "master", token[1], dict(re.findall(r' name="([^"]*)" valueReference="(\d+)"', text)))


def main() -> int:
    """A thousand million steps of a master that adds up its time, of either version, from 10^6 s on."""
    bad = False
    for version in (3, 2):
        with tempfile.TemporaryDirectory() as folder:
            refused, wrong = build(counter(Path(folder)), version, Path(folder), "double").count("add", 1e6, 1e-3, 1, 10**9)
        print(f"FMI {version}: 10^9 steps of 1 ms from 10^6 s on, added up: {refused:.0f} refused, {wrong:.0f} wrong", flush=True)
        bad = bad or refused > 0 or wrong > 0
    return int(bad)


if __name__ == "__main__":
    sys.exit(main())
