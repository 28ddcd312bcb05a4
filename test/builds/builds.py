# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The library cannot be built wrong. builds.py flags|contraction|dialects|linked|copies

Each gate also has to find what it is for: it looks at a copy of the sources from which the guard was taken.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RUNTIME, MODEL = sorted(ROOT.glob("src/*.c")), sorted(ROOT.glob("gen/nqvm/c/*.c"))
STRICT = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Wshadow", "-Wundef", "-Werror"]
M4F = ["-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard", "-mthumb"]
CLANG_ARM = ["clang-19", "-mthumb", "--target=thumbv7em-none-eabihf", "-ffreestanding"]
FUSED = re.compile(r"\bv?f(?:n?m(?:add|sub)|m(?:add|sub)sub|n?m[as])\w*[ .\t]", re.I)
bad = 0


def check(name: str, good: bool, why: str = "") -> None:
    global bad
    bad += not good
    print(f"{'ok  ' if good else 'FAIL'}  builds: {name}" + ("" if good else f"\n    {why}"), flush=True)


def compile(compiler: list[str], file: Path, *more: str, root: Path = ROOT) -> subprocess.CompletedProcess[str]:
    include = [f"-I{root / part}" for part in ("inc", "port/gnu", "gen/nqvm/c")]
    return subprocess.run([*compiler, *include, *more, str(file)], capture_output=True, text=True)


def copy(folder: str) -> Path:
    """The sources, to be damaged."""
    for part in ("src", "inc", "port/gnu", "gen/nqvm/c"):
        shutil.copytree(ROOT / part, Path(folder, part))
    return Path(folder)


# -- options that a macro shows ---------------------------------------------------------------------------------------

# what breaks the contract; the word in the #error that stops it
BROKEN = [
    (["gcc", "-ffinite-math-only"], "-ffinite-math-only"),
    (["arm-none-eabi-gcc", *M4F, "-ffinite-math-only"], "-ffinite-math-only"),
    (["clang-19", "-ffinite-math-only"], "-ffinite-math-only"),
    (["gcc", "-fassociative-math", "-fno-trapping-math", "-fno-signed-zeros", "-U__NO_SIGNED_ZEROS__"], "-fassociative-math"),
    (["gcc", "-freciprocal-math"], "-freciprocal-math"),
    (["gcc", "-fno-signed-zeros"], "-fno-signed-zeros"),
    (["gcc", "-mfpmath=387"], "wider than their type"),
    (["gcc", "-D__FAST_MATH__"], "-ffast-math"),
    (["arm-none-eabi-gcc", "-mcpu=cortex-m55", "-mfloat-abi=hard", "-mthumb"], "(MVE)"),
]
STOPPED = [[c, f] for c in ("gcc", "clang-19") for f in ("-ffast-math", "-Ofast")] + [
    ["gcc", "-funsafe-math-optimizations"],
    ["gcc", "-fassociative-math", "-fno-trapping-math", "-fno-signed-zeros"],
]
HARMLESS = ["-frounding-math", "-fno-trapping-math", "-fno-math-errno", "-fsignaling-nans", "-fno-strict-aliasing", "-funsigned-char"]


def flags() -> None:
    header = (ROOT / "inc/penode/pen_real.h").read_text()
    for compiler, word in BROKEN:
        name = " ".join(part for part in compiler if part not in M4F and not part.startswith("-U"))
        run = compile([*compiler, "-fsyntax-only"], ROOT / "src/pen_math.c")
        check(f"{name} is refused", run.returncode != 0 and word in run.stderr, run.stderr)
        with tempfile.TemporaryDirectory() as folder:
            place = copy(folder)
            lines = [line for line in header.splitlines() if not ("#error" in line and word in line)]
            (place / "inc/penode/pen_real.h").write_text("\n".join(lines) + "\n")
            run = compile([*compiler, "-fsyntax-only"], place / "src/pen_math.c", root=place)
            check(f"{name} would pass without its #error", run.returncode == 0, run.stderr)
    for compiler in STOPPED:
        run = compile([*compiler, "-fsyntax-only"], ROOT / "src/pen_math.c")
        check(f"{' '.join(compiler)} is refused", run.returncode != 0 and "penode:" in run.stderr, run.stderr)
    runs = [compile(["gcc", "-O2", *HARMLESS, "-Werror", "-c", "-o", "/dev/null"], file) for file in [*RUNTIME, *MODEL]]
    check(f"gcc {' '.join(HARMLESS)} passes", not any(r.returncode for r in runs), "".join(r.stderr for r in runs))
    numbers = [re.search(rf"PEN_VERSION_{part} (\d+)", header)[1] for part in ("MAJOR", "MINOR", "PATCH")]
    check("the version in numbers is that in words", f'"{".".join(numbers)}"' in header)


# -- contraction, which none shows ------------------------------------------------------------------------------------

DEFAULT = {
    "gcc -O2, Cortex-M4F": ["arm-none-eabi-gcc", *M4F, "-O2"],
    "gcc -Os, Cortex-M4F": ["arm-none-eabi-gcc", *M4F, "-Os"],
    "gcc -O2 -ffp-contract=fast, Cortex-M4F": ["arm-none-eabi-gcc", *M4F, "-O2", "-ffp-contract=fast"],
    "gcc -O3 -march=haswell": ["gcc", "-O3", "-march=haswell"],
    "gcc -O2, RISC-V with FPU": ["riscv64-unknown-elf-gcc", "-O2", "-ffreestanding"],
    "clang -O2, Cortex-M4F": [*CLANG_ARM, "-mcpu=cortex-m4", "-O2"],
    "clang -Os, Cortex-M7": [*CLANG_ARM, "-mcpu=cortex-m7", "-Os"],
    "clang -O3 -march=haswell": ["clang-19", "-O3", "-march=haswell"],
}
FUSING = (
    "gcc -O2, Cortex-M4F",
    "gcc -O3 -march=haswell",
    "clang -Os, Cortex-M7",
    "clang -O3 -march=haswell",
)  # clang does not on a Cortex-M4F


def fused(compiler: list[str], files: list[Path], root: Path = ROOT) -> int:
    """How many fused operations; -1 if a file does not compile."""
    runs = [compile([*compiler, "-S", "-o", "-"], file, root=root) for file in files]
    return sum(len(FUSED.findall(run.stdout)) for run in runs) if not any(run.returncode for run in runs) else -1


def contraction() -> None:
    files = [file for file in [*RUNTIME, *MODEL] if not file.stem.endswith(("_params", "_euler"))]
    for name, compiler in DEFAULT.items():
        n = fused(compiler, files)
        check(f"no fused operation by {name}", n == 0, f"{n} of them")
    with tempfile.TemporaryDirectory() as folder:
        place = copy(folder)
        (place / "inc/penode/pen_exact.h").write_text("")
        for name in FUSING:
            check(f"found without pen_exact.h by {name}", fused(DEFAULT[name], [place / "src/pen_net.c"], place) > 10)
    first = [re.search(r'#include [<"](.*?)[>"]', file.read_text())[1] for file in [*RUNTIME, *MODEL]]
    check("pen_exact.h is the first of all includes", set(first) == {"penode/pen_exact.h"}, str(first))


# -- dialects ---------------------------------------------------------------------------------------------------------


def dialects() -> None:
    for compiler in ("gcc", "clang-19"):
        for dialect in ("c99", "c11", "c17", "c2x"):
            runs = [compile([compiler, f"-std={dialect}", *STRICT, "-fsyntax-only"], file) for file in [*RUNTIME, *MODEL]]
            check(f"{compiler} -std={dialect} without a warning", not any(r.returncode for r in runs), "".join(r.stderr for r in runs))
    headers = sorted(ROOT.glob("inc/penode/*.h")) + sorted(ROOT.glob("gen/nqvm/c/*.h"))
    entries = subprocess.run([ROOT / "test/misra/every_entry", *headers], capture_output=True, text=True, check=True).stdout
    functions = sorted(set(re.findall(r"\(void\)(pen_\w+|nqvm\w*);", entries)))
    includes = "".join(f'#include "{str(h).split("/inc/")[-1].split("/c/")[-1]}"\n' for h in headers)
    table = "".join(f"    reinterpret_cast<any_t>(&{name}),\n" for name in functions)
    text = (
        f"{includes}typedef void (*any_t)();\nextern const any_t every[];\nconst any_t every[] = {{\n"
        f"{table}}};\nint main() {{ return every[0] == nullptr; }}\n"
    )
    for c, cpp in (("gcc", "g++"), ("clang-19", "clang++-19")):
        with tempfile.TemporaryDirectory() as folder:
            place = copy(folder)
            for file in [*RUNTIME, *MODEL]:
                subprocess.run(
                    [c, "-std=c99", f"-I{ROOT}/inc", f"-I{ROOT}/port/gnu", f"-I{ROOT}/gen/nqvm/c", "-c", file], cwd=folder, check=True
                )
            (place / "main.cpp").write_text(text)
            objects = [str(path) for path in sorted(place.glob("*.o"))]
            strict = [cpp, "-std=c++17", *STRICT, "-o", str(place / "main")]
            run = compile([*strict, str(place / "main.cpp")], Path(objects[0]), *objects[1:])
            check(
                f"{cpp} -std=c++17 compiles and links {len(functions)} functions",
                run.returncode == 0 and len(functions) > 60,
                run.stderr[:3000],
            )
            for header in [h for part in ("inc", "gen/nqvm/c") for h in sorted((place / part).rglob("*.h"))]:
                header.write_text(header.read_text().replace("__cplusplus", "NO_CPLUSPLUS").replace("#if NO_C", "#if 0 && NO_C"))
            run = compile([*[w for w in strict if w != "-Wundef"], str(place / "main.cpp")], Path(objects[0]), *objects[1:], root=place)
            check(f'{cpp}: a missing extern "C" is found', "undefined reference" in run.stderr, run.stderr[:500])


# -- a whole program for a core without atomic instructions -----------------------------------------------------------

MAIN = (
    '#include "nqvm.h"\nnqvm_t model;\nnqvm_banks_t banks;\nint main(void)\n{\n    nqvm_u_t u = { 0 };\n    nqvm_y_t y;\n'
    "    return (int)(nqvm_init(&model, &nqvm_set_default, &banks) | nqvm_step(&model, &u, &y) | nqvm_tune_commit(&model));\n}\n"
)


def link(root: Path, core: str, level: str) -> str:
    """What the linker says; nothing if all is there."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "main.c").write_text(MAIN)
        objects = []
        for file in [Path(folder, "main.c"), *sorted(root.glob("src/*.c")), root / "gen/nqvm/c/nqvm.c", root / "gen/nqvm/c/nqvm_params.c"]:
            objects.append(str(Path(folder, file.stem + ".o")))
            run = compile(
                [
                    "clang-19",
                    "--target=thumbv6m-none-eabi",
                    f"-mcpu={core}",
                    "-ffreestanding",
                    level,
                    "-Wall",
                    "-Wextra",
                    "-c",
                    "-o",
                    objects[-1],
                ],
                file,
                root=root,
            )
            if run.returncode or run.stderr:
                return run.stderr
        run = subprocess.run(
            ["arm-none-eabi-gcc", f"-mcpu={core}", "-mthumb", "-nostdlib", "-Wl,-e,main", "-o", f"{folder}/program", *objects, "-lgcc"],
            capture_output=True,
            text=True,
        )
        return run.stderr if run.returncode else ""


def linked() -> None:
    for core in ("cortex-m0", "cortex-m0plus"):
        for level in ("-O2", "-Os"):
            said = link(ROOT, core, level)
            check(f"clang links a whole program for {core} {level} with libgcc alone", said == "", said[:3000])
    with tempfile.TemporaryDirectory() as folder:
        place = copy(folder)
        port = place / "port/gnu/pen_port_target.h"
        port.write_text(port.read_text().replace("__GCC_ATOMIC_INT_LOCK_FREE == 2", "1"))
        check("built-ins that need libatomic are found", "atomic" in link(place, "cortex-m0", "-O2"))


# -- struct assignment ------------------------------------------------------------------------------------------------


def copies() -> None:
    """The gate `symbols` finds a struct assignment that the compiler turns into a call of memcpy."""
    with tempfile.TemporaryDirectory() as folder:
        place = copy(folder)
        file = place / "src/pen_set.c"
        text, n = re.subn(r"    copy_head\(&to->head, &from->head\);\n    to->value = from->value;", "    *to = *from;", file.read_text())
        check("the copy of a set stands where it is looked for", n == 1)
        file.write_text(text)
        compiler = ["riscv64-unknown-elf-gcc", "-march=rv32imac", "-mabi=ilp32", "-std=c99", "-ffreestanding", "-Os"]
        include = [f"-I{place / part}" for part in ("inc", "port/gnu")]
        run = subprocess.run([ROOT / "test/symbols", "pen_.*", *compiler, *include, file], capture_output=True, text=True)
        check("a struct assignment is found on RISC-V -Os", run.returncode != 0 and "memcpy" in run.stdout, run.stdout + run.stderr)


if __name__ == "__main__":
    {"flags": flags, "contraction": contraction, "dialects": dialects, "linked": linked, "copies": copies}[sys.argv[1]]()
    sys.exit(bad > 0)
