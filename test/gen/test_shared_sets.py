# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Sets that several methods of a model share: written alike by each, there once in a program."""

from __future__ import annotations

import itertools
import subprocess
from pathlib import Path

import pytest
from test_emit import COMPILERS, REALS, STRICT

import penode_gen

ROOT = Path(__file__).resolve().parents[2]
NQVM = ROOT / "gen" / "nqvm"
SHARING = ("nqvm", "nqvm_euler", "nqvm_folded")
MAIN = """
#include "nqvm.h"
#include "nqvm_euler.h"
#include "nqvm_folded.h"
static nqvm_t a;
static nqvm_euler_t b;
static nqvm_folded_t c;
int main(void)
{
    const nqvm_u_t u = { (pen_real_t)0.01 };
    const nqvm_euler_u_t v = { (pen_real_t)0.01 };
    const nqvm_folded_u_t w = { (pen_real_t)0.01 };
    nqvm_y_t y;
    nqvm_euler_y_t z;
    nqvm_folded_y_t f;
    pen_status_t status = nqvm_init(&a, &nqvm_set_default, NULL) | nqvm_euler_init(&b, &nqvm_euler_set_default, NULL);
    status |= nqvm_folded_init(&c, &nqvm_set_altered_friction, NULL);
    for (int k = 0; k < 9; k++) {
        status |= nqvm_step(&a, &u, &y) | nqvm_euler_step(&b, &v, &z) | nqvm_folded_step(&c, &w, &f);
    }
    return ((status == PEN_OK) && (&nqvm_set_default == &nqvm_folded_set_default)) ? 0 : 1;
}
"""


@pytest.fixture(scope="module")
def sharing(tmp_path_factory):
    """The C of the three in one folder."""
    folder = tmp_path_factory.mktemp("sharing")
    for name in SHARING:
        penode_gen.generate(penode_gen.load(NQVM / f"{name}.toml"), folder, self_test=False)
    return folder


def test_shared_sets_are_the_same_whoever_writes_them(sharing):
    texts = [penode_gen.render(penode_gen.load(NQVM / f"{name}.toml"), self_test=False) for name in SHARING]
    shared = set(texts[0]) & set(texts[1]) & set(texts[2])
    assert shared == {"nqvm_sets.h", "nqvm_params.c", "nqvm_layout.json"}
    assert all(text[name] == texts[0][name] for text in texts for name in shared)
    assert sorted(p.name for p in sharing.iterdir()) == sorted({*texts[0], *texts[1], *texts[2]})


@pytest.mark.parametrize("real", REALS, ids=["float", "double"])
def test_three_methods_link_into_one_program(sharing, tmp_path, real):
    (tmp_path / "main.c").write_text(MAIN)
    sources = [*sorted(sharing.glob("*.c")), *sorted((ROOT / "src").glob("*.c")), tmp_path / "main.c"]
    subprocess.run(
        [
            "gcc",
            "-std=c99",
            "-O1",
            *real,
            f"-I{ROOT}/inc",
            f"-I{ROOT}/port/gnu",
            f"-I{sharing}",
            *map(str, sources),
            "-o",
            str(tmp_path / "a.out"),
        ],
        check=True,
    )
    subprocess.run([tmp_path / "a.out"], check=True)
    table = subprocess.run(["nm", tmp_path / "a.out"], check=True, capture_output=True, text=True).stdout
    for name in ("set_default", "set_altered_friction", "value_default", "value_altered_friction"):
        assert [line.split()[2] for line in table.splitlines() if line.endswith(name)] == [f"nqvm_{name}"]  # once


@pytest.mark.parametrize("compiler", COMPILERS)
def test_three_methods_in_one_translation_unit(sharing, tmp_path, compiler):
    for order, real in itertools.product((SHARING, SHARING[::-1]), REALS):
        unit = tmp_path / "unit.c"
        unit.write_text("".join(f'#include "{name}.c"\n' for name in (*order, "nqvm_params")))
        result = subprocess.run([compiler, *STRICT, *real, f"-I{sharing}", str(unit)], capture_output=True, text=True)
        assert (result.returncode, result.stderr) == (0, "")
