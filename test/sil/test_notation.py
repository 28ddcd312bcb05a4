# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Thousands that are parted by a sign which others take for that of a fraction."""

from __future__ import annotations

import numpy as np
import pytest

from penode_sil.errors import UserError
from penode_sil.recordings import read

DRAW = np.random.default_rng(5)
WHOLE = np.rint(DRAW.normal(0.0, 3000.0, 400)).astype(int)
LARGE = 1000000 + WHOLE
FRACTIONS = np.round(WHOLE + DRAW.integers(0, 1000, 400) / 1000.0, 3)


def parted(value, between: str, decimal: str = ".", digits: int = 0) -> str:
    text = f"{value:,.{digits}f}"
    return text.replace(",", "t").replace(".", decimal).replace("t", between)


def read_x(tmp_path, cells, clock=lambda k: str(k), separator=";"):
    path = tmp_path / "r.csv"
    rows = "".join(f"{clock(k)}{separator}{cell}\n" for k, cell in enumerate(cells))
    path.write_text(f"time [ms]{separator}x [mm]\n{rows}", encoding="utf-8")
    (table,) = read(path)
    return 1e3 * table.channel("x", "m")


SURE = {
    "points, whole numbers": ([parted(v, ".") for v in WHOLE], str, WHOLE),
    "commas, whole numbers": ([parted(v, ",") for v in WHOLE], str, WHOLE),
    "commas, whole numbers beside a decimal point": ([parted(v, ",") for v in WHOLE], lambda k: f"{k}.5", WHOLE),
    "points, twice": ([parted(v, ".") for v in LARGE], str, LARGE),
    "points beside decimal commas": ([parted(v, ".", ",", 3) for v in FRACTIONS], lambda k: f"{k},5", FRACTIONS),
    "commas beside decimal points": ([parted(v, ",", ".", 3) for v in FRACTIONS], lambda k: f"{k}.5", FRACTIONS),
    "few, beside decimal commas": (["1.001", "998,5", "12", "-12.862,25"], str, [1001.0, 998.5, 12.0, -12862.25]),
    "apostrophes": ([parted(v, "'", ".", 2) for v in FRACTIONS], str, [float(f"{v:.2f}") for v in FRACTIONS]),
    "blanks": ([parted(v, " ", ",", 2) for v in FRACTIONS], lambda k: f"{k},5", [float(f"{v:.2f}") for v in FRACTIONS]),
    "narrow blanks": ([parted(v, "\u202f") for v in WHOLE], str, WHOLE),
    "quoted": ([f'"{parted(v, ",", ".", 1)}"' for v in FRACTIONS], lambda k: f"{k}.5", [float(f"{v:.1f}") for v in FRACTIONS]),
    # no thousands
    "three decimals": ([f"{v:.3f}" for v in FRACTIONS], str, FRACTIONS),
    "three decimals, all above 1": ([f"{1.0 + abs(v) / 1e4:.3f}" for v in FRACTIONS], str, np.round(1.0 + np.abs(FRACTIONS) / 1e4, 3)),
    "up to three decimals": ([f"{v / 8.0:g}" for v in WHOLE % 8000], str, WHOLE % 8000 / 8.0),
    "decimal commas": ([f"{v:.3f}".replace(".", ",") for v in FRACTIONS], str, FRACTIONS),
    "one fraction in many": (["1.125", "2", "3"] * 40, lambda k: f"{k}.5", [1.125, 2.0, 3.0] * 40),
}


@pytest.mark.parametrize("name", SURE)
def test_signs_are_inferred_from_all_numbers(tmp_path, name):
    cells, clock, exact = SURE[name]
    separator = "," if '"' in cells[0] else ";"
    assert read_x(tmp_path, cells, clock, separator) == pytest.approx(np.asarray(exact, float), rel=1e-12)


@pytest.mark.parametrize(
    "cells, clock",
    [
        (["998", "1.001", "12"], str),  # nothing tells
        (["998", "1,001", "12"], str),
        ([parted(v, ".") for v in WHOLE], lambda k: f"{k}.5"),  # points part fractions elsewhere
        (["1.234.567", "0.5", "3"], str),
    ],
)
def test_what_may_be_thousands_or_a_fraction_is_refused(tmp_path, cells, clock):
    with pytest.raises(UserError, match=r'r\.csv:\d+: channel x: "[-\d.,]+" may be .*; write numbers without signs between thousands'):
        read_x(tmp_path, cells, clock)


def test_a_bad_channel_that_is_not_used_is_ignored(tmp_path):
    path = tmp_path / "r.csv"
    path.write_text("time [s];x [m];y [m]\n" + "".join(f"{k};{k};{y}\n" for k, y in enumerate(["998", "1.001", "12"])))
    (table,) = read(path)
    assert table.channel("x", "m").tolist() == [0.0, 1.0, 2.0]
