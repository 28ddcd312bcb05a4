# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Recordings: tables of text whose header carries units, like `time [s],z_road [m],a_body [m/s^2]`, and MDF (.mf4).

Other habits are read where they leave no doubt; the rooms for that are in `reading`, and this is their door.
"""

from .csv_text import read_csv
from .files import pick, read
from .named import aliases
from .resampling import Kernel, on_raster, resample
from .table import GAP, Recording, more

__all__ = ["GAP", "Kernel", "Recording", "aliases", "more", "on_raster", "pick", "read", "read_csv", "resample"]
