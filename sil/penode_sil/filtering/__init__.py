# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Virtual sensors: the filter of a model file over measurements, as compiled C and in float64."""
