# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What the tests of gen/ share."""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
