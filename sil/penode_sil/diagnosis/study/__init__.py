# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What was measured, on one clock: recordings with their noise, fits of the model to them, and what these leave."""
