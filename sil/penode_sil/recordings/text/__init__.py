# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Tables of text: encoding, layout, header, cells and how numbers and times are written in them."""
