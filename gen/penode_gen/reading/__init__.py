# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Model files and network files: read, checked, with every problem at its line; what comes out is plain data (model.py, networks.py)."""
