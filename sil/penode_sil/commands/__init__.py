# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
The commands: what each takes, and its help. What it does stands in other rooms, which are imported when it is called: numpy, SciPy and
sympy take a second, and help needs none of them.
"""
