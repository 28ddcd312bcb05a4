# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: hand-written C is laid out as .clang-format says, and clang-tidy finds nothing in library, firmware and the port for this host.

c_check.py            both; clang-tidy takes again only files that have changed, or of which a header has (build/check)
c_check.py --format   lay the files out
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
KEPT = ROOT / "build" / "check"
TIDIED = ("src/", "port/host/", "port/xcp/", "sil/firmware/")
FOLDERS = ("inc", "port/gnu", "port/xcp", "port/cortex-m", "sil/firmware", "gen/nqvm/c", "build/watched")
MODEL = ['-DMODEL_HEADER="nqvm.h"', "-DMODEL(name)=nqvm_##name", "-DMODEL_SIZE(name)=NQVM_##name", "-DMODEL_SETS=&nqvm_set_default"]
FLAGS = ["-std=c99", "-ffp-contract=off", *(f"-I{folder}" for folder in FOLDERS), *MODEL, "-DBOARD_TICK_MHZ=25U", "-DEXACT_WIDTH=16U"]


def tool(name: str) -> str:
    """A program beside this Python, else in the path."""
    beside = Path(sys.executable).with_name(name)
    return str(beside) if beside.exists() else name


def run(command: list[str]) -> tuple[bool, str]:
    """Did a program end well, and what it said."""
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    return done.returncode == 0, done.stdout


def sources() -> list[str]:
    """The C that git has, without symbolic links; clang-format itself leaves out .clang-format-ignore."""
    listed = run(["git", "ls-files", "-s", "*.c", "*.h", "*.inc"])[1].splitlines()
    return [line.split("\t")[1] for line in listed if not line.startswith("120000")]


def tidy(file: str, common: bytes) -> str:
    """What clang-tidy says about a file; "" if nothing, which is remembered."""
    mark = KEPT / hashlib.sha256(common + file.encode() + (ROOT / file).read_bytes()).hexdigest()
    if mark.exists():
        return ""
    good, said = run([tool("clang-tidy"), "--quiet", file, "--", *FLAGS])
    if good:
        mark.touch()
    return "" if good else said


def report(name: str, problems: str) -> bool:
    """One line that test/tally.py counts, and what is wrong below it."""
    print(f"FAIL  {name}\n{problems}" if problems else f"ok    {name}", flush=True)
    return not problems


def main() -> int:
    files = sources()
    if "--format" in sys.argv[1:]:
        good, said = run([tool("clang-format"), "-i", *files])
        return int(not report("clang-format", "" if good else said))
    good, said = run([tool("clang-format"), "--dry-run", "-Werror", *files])
    clean = report(f"clang-format: {len(files)} files", "" if good else said)
    KEPT.mkdir(parents=True, exist_ok=True)
    tidied = [file for file in files if file.endswith(".c") and file.startswith(TIDIED)]
    shared = [file for file in files if file.endswith(".h") and not file.startswith("test/")] + [".clang-tidy"]
    text = run([tool("clang-tidy"), "--version"])[1] + " ".join(FLAGS)
    common = hashlib.sha256(text.encode() + b"".join((ROOT / file).read_bytes() for file in shared)).digest()
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        said = "".join(pool.map(lambda file: tidy(file, common), tidied))
    return int(not (report(f"clang-tidy: {len(tidied)} files", said) and clean))


if __name__ == "__main__":
    sys.exit(main())
