# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""FMUs of FMI 2.0 and 3.0: interface, C sources, binaries, and XCP through the importer."""
