# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The table of measured rigs."""

from rigs_table import moves


def test_an_extended_model_moves_where_the_one_that_it_extends_does(tmp_path):
    """Its file has no bodies of its own, and its start is still predicted from the first samples."""
    (tmp_path / "swing.toml").write_text(
        '[model]\nname = "swing"\n[bodies]\narm = { inertia = "J", position = "phi", velocity = "omega" }\n'
    )
    (tmp_path / "bench.toml").write_text('[model]\nname = "bench"\n')
    (tmp_path / "out").mkdir()
    for name, answer in (("swing", True), ("bench", False)):
        (tmp_path / "out" / "model_extended.toml").write_text(f'[model]\nextends = "../{name}.toml"\n')
        assert moves(tmp_path / "out" / "model_extended.toml") == moves(tmp_path / f"{name}.toml") == answer
