# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Makes the independent filter importable."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
