# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Check the manifests of a package tree with the tools' own readers; prints one line for each problem. Runs in build/packages.

PlatformIO's schema looks up the licence in a list that it downloads; so the licence is left to the caller.
"""

from __future__ import annotations

import sys
from pathlib import Path

import kconfiglib
from platformio.package.manifest.parser import ManifestParserFactory
from platformio.package.manifest.schema import ManifestSchema, ManifestValidationError

KCONFIG = {"PENODE": kconfiglib.BOOL, "PENODE_PORT": kconfiglib.STRING, "PENODE_REAL_DOUBLE": kconfiglib.BOOL}
# A Zephyr that has what the module refers to.
AROUND = 'config FPU\n\tbool\nconfig FPU_SHARING\n\tbool\nsource "{}"\n'


def library_json(tree: Path) -> list[str]:
    """What PlatformIO does not like."""
    manifest = ManifestParserFactory.new_from_dir(str(tree)).as_dict()
    manifest.pop("license")
    known = ManifestSchema().fields
    unknown = [f"library.json: {key} is no field" for key in manifest if key not in {*known, "headers", "build"}]
    try:
        ManifestSchema().load_manifest(manifest)
    except ManifestValidationError as problem:
        return [*unknown, f"library.json: {problem}"]
    return unknown


def kconfig(tree: Path, work: Path) -> list[str]:
    """What Zephyr's configuration language does not like, and what is not as the module's CMakeLists.txt takes it."""
    work.write_text(AROUND.format(tree.resolve() / "zephyr" / "Kconfig"), encoding="utf-8")
    try:
        read = kconfiglib.Kconfig(str(work), warn_to_stderr=False)
    except kconfiglib.KconfigError as problem:
        return [f"Kconfig: {problem}"]
    found = {name: read.syms[name].type for name in read.syms if name.startswith("PENODE")}
    problems = [f"Kconfig: {warning}" for warning in read.warnings]
    if found != KCONFIG:
        problems.append(f"Kconfig: has {sorted(found)}")
    return problems


if __name__ == "__main__":
    for line in [*library_json(Path(sys.argv[1])), *kconfig(Path(sys.argv[1]), Path(sys.argv[2]))]:
        print(line)
