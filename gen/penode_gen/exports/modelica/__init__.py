# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Modelica: the equations of the model, or its networks."""
