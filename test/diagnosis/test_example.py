# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The committed recordings are what the script makes."""

from pathlib import Path

import example
import numpy as np

KEPT = Path(__file__).parents[2] / "sil" / "recordings" / "friction"


def test_committed_recordings_are_those_of_the_script(tmp_path):
    """Nine digits are written; integration in C may differ by compiler in the last ones of double."""
    for made in example.make(tmp_path):
        kept = KEPT / made.name
        assert made.read_text().splitlines()[0] == kept.read_text().splitlines()[0]
        got, want = (np.loadtxt(path, delimiter=",", skiprows=1) for path in (made, kept))
        assert np.allclose(got, want, rtol=1e-7, atol=1e-10)
    assert (tmp_path / "model.toml").read_text() == (KEPT / "model.toml").read_text()
