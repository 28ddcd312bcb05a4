# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Recordings: tables of text whose header carries units, like `time [s],z_road [m],a_body [m/s^2]`, and MDF (.mf4).

Other habits are read where they leave no doubt. What stands in `__all__` is imported when it is asked for: the process that
reads an MDF file needs none of it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from penode_gen.on_demand import names_from

if TYPE_CHECKING:
    from .files import pick, read
    from .named import aliases
    from .resampling import Kernel, on_raster, resample
    from .table import GAP, Recording, more
    from .text.csv_text import read_csv

__all__ = ["GAP", "Kernel", "Recording", "aliases", "more", "on_raster", "pick", "read", "read_csv", "resample"]

_FROM = {  # name -> module that has it
    "GAP": "table",
    "Kernel": "resampling",
    "Recording": "table",
    "aliases": "named",
    "more": "table",
    "on_raster": "resampling",
    "pick": "files",
    "read": "files",
    "read_csv": "text.csv_text",
    "resample": "resampling",
}
__getattr__ = names_from(__name__, _FROM)
