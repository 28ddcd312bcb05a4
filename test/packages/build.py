# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Build the hash program from each package, as its users would: what it prints, and which symbols the library has."""

from __future__ import annotations

import json
import os
import re
import subprocess
import xml.etree.ElementTree as xml
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
HERE = ROOT / "test" / "packages"
HEADERS = sorted(path.name for path in (ROOT / "inc" / "penode").glob("*.h"))
MODEL = ["nqvm.c", "nqvm_params.c"]
VERSION = re.search(r'#define PEN_VERSION +"(.*)"', (ROOT / "inc/penode/pen_real.h").read_text(encoding="utf-8"))[1]
# Bits do not depend on the level, so take the fastest to compile; the reference is compiled at another one.
CC = ["gcc", "-std=c99", "-O0", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off"]


class Built(NamedTuple):
    """A package, built."""

    said: str  # by the hash program
    symbols: frozenset[str]  # that the library defines


class Fails(Exception):
    """A command failed; its output."""


def run(command: Iterable[object], cwd: Path = ROOT, env: dict[str, str] | None = None) -> str:
    """What a command prints. Raises Fails."""
    words = [str(word) for word in command]
    done = subprocess.run(
        words,
        cwd=cwd,
        env={**os.environ, **(env or {})},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=120,
    )
    if done.returncode != 0:
        raise Fails(f"{' '.join(words)}: exit code {done.returncode}\n{done.stdout}")
    return done.stdout


def symbols(*files: Path) -> frozenset[str]:
    """Names that a library or objects define for others."""
    lines = run(["nm", "-g", "--defined-only", *files]).splitlines()
    return frozenset(line.split()[2] for line in lines if len(line.split()) == 3)


def with_all_headers(work: Path) -> Path:
    """A source that includes every header of the runtime: none may be missing in a package."""
    source = work / "headers.c"
    source.write_text("".join(f'#include "penode/{name}"\n' for name in HEADERS) + "extern int headers;\n", encoding="utf-8")
    return source


def by_hand(work: Path, options: list[object], library: list[Path], program: list[Path], level: str = "-O0") -> Built:
    """Compile all with gcc, then link."""
    objects = {}
    for source in [*library, *program]:
        objects[source] = work / f"{source.parent.name}-{source.stem}.o"
        run([*CC, level, *options, "-c", source, "-o", objects[source]], cwd=work)
    run(["gcc", *objects.values(), "-o", work / "hash"])
    return Built(run([work / "hash"]), symbols(*(objects[source] for source in library)))


def reference(work: Path, double: bool = False) -> Built:
    """The repository itself, as its own Makefile builds it."""
    options = ["-Iinc", "-Iport/gnu", "-Igen/nqvm/c", *(["-DPEN_REAL_DOUBLE"] if double else [])]
    options = [f"-I{ROOT}/{word[2:]}" if word.startswith("-I") else word for word in options]
    model = [ROOT / "gen/nqvm/c" / name for name in MODEL]
    return by_hand(work, options, sorted((ROOT / "src").glob("*.c")), [HERE / "hash.c", *model], "-O1")


def cmake(work: Path, source: Path, *options: str) -> None:
    """Configure and build."""
    flags = "-DCMAKE_C_FLAGS=-O0 -Wall -Wextra -Werror"
    run(["cmake", "-S", source, "-B", work, flags, *options])
    run(["cmake", "--build", work])


def consumer(work: Path, source: Path, *options: str) -> str:
    """What the hash program says, built by CMake."""
    cmake(work / "hash", source, f"-DHEADERS={with_all_headers(work)}", *options)
    return run([work / "hash" / "hash"])


def subdirectory(tree: Path, work: Path, *options: str) -> Built:
    """CMake's add_subdirectory."""
    said = consumer(work, HERE / "cmake", f"-DTREE={tree / f'penode-{VERSION}'}", *options)
    return Built(said, symbols(work / "hash/penode/libpenode.a"))


def installed(tree: Path, work: Path) -> Path:
    """Where CMake has installed the library."""
    source = tree / f"penode-{VERSION}"
    cmake(work / "library", source, f"-DCMAKE_INSTALL_PREFIX={work / 'prefix'}", "-DCMAKE_INSTALL_LIBDIR=lib")
    run(["cmake", "--install", work / "library"])
    return work / "prefix"


def find_package(tree: Path, work: Path) -> Built:
    """CMake's find_package of the installed package."""
    prefix = installed(tree, work)
    model = f"-DMODEL={tree / f'penode-{VERSION}' / 'models/nqvm'}"
    return Built(consumer(work, HERE / "cmake", f"-DCMAKE_PREFIX_PATH={prefix}", model), symbols(prefix / "lib/libpenode.a"))


def pkg_config(tree: Path, work: Path) -> Built:
    """A compiler with the flags of pkg-config; no others."""
    prefix, model = installed(tree, work), tree / f"penode-{VERSION}" / "models/nqvm"
    env = {"PKG_CONFIG_PATH": str(prefix / "lib/pkgconfig")}
    if run(["pkg-config", "--modversion", "penode"], env=env).strip() != VERSION:
        raise Fails("pkg-config tells another version")
    flags, libraries = (run(["pkg-config", word, "penode"], env=env).split() for word in ("--cflags", "--libs"))
    sources = [HERE / "hash.c", with_all_headers(work), *(model / name for name in MODEL)]
    run(["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", *flags, f"-I{model}", *sources, "-o", work / "hash", *libraries])
    return Built(run([work / "hash"]), symbols(prefix / "lib/libpenode.a"))


def tarball(tree: Path, work: Path) -> Built:
    """All sources and a list of include paths."""
    source = tree / f"penode-{VERSION}"
    options = [f"-I{source / name}" for name in ("inc", "port/gnu", "models/nqvm")]
    program = [HERE / "hash.c", with_all_headers(work), *(source / "models/nqvm" / name for name in MODEL)]
    return by_hand(work, options, sorted((source / "src").glob("*.c")), program)


def amalgamated(tree: Path, work: Path) -> Built:
    """One source, one header, the port."""
    one = tree / f"penode-{VERSION}-amalgamated"
    header = (one / "penode.h").read_text(encoding="utf-8")
    missing = [name for name in HEADERS if f"==== {name} ====" not in header]
    if missing:
        raise Fails(f"penode.h lacks {missing}")
    return by_hand(work, [f"-I{one}"], [one / "penode.c"], [HERE / "hash.c", *(one / name for name in MODEL)])


def platformio(tree: Path, work: Path) -> Built:
    """What library.json tells PlatformIO: all sources under srcDir; its flags; includeDir for the library and the program."""
    source = tree / f"penode-{VERSION}"
    build = json.loads((source / "library.json").read_text(encoding="utf-8"))["build"]
    flags = " ".join(build["flags"]).replace("-I ", "-I").split()
    flags = [f"-I{source / flag[2:]}" if flag.startswith("-I") else flag for flag in flags]
    options = [*flags, f"-I{source / build['includeDir']}", f"-I{source / 'models/nqvm'}"]
    program = [HERE / "hash.c", with_all_headers(work), *(source / "models/nqvm" / name for name in MODEL)]
    return by_hand(work, options, sorted((source / build["srcDir"]).rglob("*.c")), program)


def zephyr(tree: Path, work: Path) -> Built:
    """The module's CMakeLists.txt, in a stand-in for Zephyr's build, with the defaults of its Kconfig."""
    source = tree / f"penode-{VERSION}"
    used = set(re.findall(r"CONFIG_(\w+)", (source / "zephyr/CMakeLists.txt").read_text(encoding="utf-8")))
    known = set(re.findall(r"^config (\w+)", (source / "zephyr/Kconfig").read_text(encoding="utf-8"), re.MULTILINE))
    if used != known:
        raise Fails(f"Kconfig has {sorted(known)}, CMakeLists.txt uses {sorted(used)}")
    said = consumer(work, HERE / "zephyr", f"-DMODULE={source}", "-DCONFIG_PENODE=y", "-DCONFIG_PENODE_PORT=gnu")
    return Built(said, symbols(work / "hash/penode/libpenode.a"))


def cmsis_pack(tree: Path, work: Path) -> Built:
    """The files of the components Runtime, Port GNU and Model, as the .pdsc lists them; headers and doc must be there."""
    source = tree / f"penode-{VERSION}"
    files = pack_files(source)
    missing = [file["name"] for component in files.values() for file in component if not (source / file["name"]).exists()]
    if missing:
        raise Fails(f"the .pdsc lists what is not there: {missing}")
    chosen = {name: files[name] for name in ("Runtime", "Port GNU", "Model nQVM")}
    headers = {Path(file["name"]).name for file in chosen["Runtime"] if file["category"] == "header"}
    if headers != set(HEADERS):
        raise Fails(f"the .pdsc and inc/penode differ: {sorted(headers ^ set(HEADERS))}")
    every = [file for component in chosen.values() for file in component]
    options = [f"-I{source / file['name']}" for file in every if file["category"] == "include"]
    sources = {name: [source / file["name"] for file in chosen[name] if file["category"] == "source"] for name in chosen}
    return by_hand(work, options, sources["Runtime"], [HERE / "hash.c", with_all_headers(work), *sources["Model nQVM"]])


def pack_files(source: Path) -> dict[str, list[dict[str, str]]]:
    """Files of each component of a .pdsc, with their attributes."""
    package = xml.parse(source / "penode.penode.pdsc").getroot()
    found = {}
    for component in package.iter("component"):
        name = " ".join(filter(None, (component.get("Cgroup"), component.get("Csub"))))
        found[name] = [dict(file.attrib) for file in component.iter("file")]
    return found


PACKAGES: dict[str, Callable[[Path, Path], Built]] = {
    each.__name__: each for each in (subdirectory, find_package, pkg_config, tarball, amalgamated, platformio, zephyr, cmsis_pack)
}
