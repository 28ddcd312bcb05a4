# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Recordings: CSV whose header carries units, like `time [s],z_road [m],a_body [m/s^2]`, and MDF (.mf4).

Other habits are read where they leave no doubt: `z_road (mm)`; `force_N` and `v_m_s` for force and v, if what the model
asks for is measured in that unit; `t` for time; columns between semicolons or tabs, then also with decimal commas.
The rooms are in `reading`; this is their door.
"""

from .reading.csv_text import read_csv
from .reading.files import aliases, pick, read
from .reading.resampling import Kernel, on_raster, resample
from .reading.table import GAP, Recording, more

__all__ = ["GAP", "Kernel", "Recording", "aliases", "more", "on_raster", "pick", "read", "read_csv", "resample"]
