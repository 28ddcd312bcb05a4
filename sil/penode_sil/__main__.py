# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
from .cli import main

main()
