# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The gate of `make prove` that damages files, for a few hundred of them."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "prove"))
import readers_check


def test_damaged_files_are_taken_or_refused_in_words():
    problems, seen = readers_check.check(60)
    assert not problems
    assert all(row["taken"] and row["messages"] > 5 for name, row in seen.items() if name != "mdf")  # of these are three


def test_careless_readers_are_found_out():
    assert not readers_check.faults_missed()
