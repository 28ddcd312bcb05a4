# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The generators of the manual, and what the tests share."""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "sil/manual"), str(Path(__file__).parent)]
