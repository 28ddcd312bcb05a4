# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Cases with a hidden effect, simulated by MuJoCo: plants and effects are its joints, tendons and actuators; see README.md one level up."""
