# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What every answer has to pass before anything is reported, and faults that samples alone show."""
