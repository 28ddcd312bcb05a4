# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Networks of a model trained from recordings: the model's own equations, exact forward sensitivities, Gauss-Newton."""
