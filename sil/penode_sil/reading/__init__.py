# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Recordings as people have them: text of any form and MDF, made tables whose channels come in SI."""
