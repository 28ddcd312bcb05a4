# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The version of the generator, which is that of the runtime: PEN_VERSION of inc/penode/pen_real.h."""

VERSION = "0.1.0"
