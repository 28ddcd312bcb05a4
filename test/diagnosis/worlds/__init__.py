# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Wrong worlds: every plant is a few per cent wrong everywhere, and perhaps much more in one place. Made from physics alone."""
