# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""From ordered assignments to C: what is printed is decided here, how it looks stands in templates/."""
