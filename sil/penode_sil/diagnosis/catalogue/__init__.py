# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The causes that a diagnosis knows: one file for a kind, or for kinds of one curve. A new one is a file and a row here."""

from . import bushings, dampers, friction, loads, masses, plays, springs, tyres

FILES = (friction, springs, plays, dampers, bushings, masses, loads, tyres)
OF = {kind: file for file in FILES for kind in file.KINDS}
