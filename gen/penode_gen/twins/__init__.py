# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
The runtime and the generated step a second time, in NumPy, to the bit.

And the model as float64 functions that share nothing with the C.
"""
