# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors

.PHONY: imports
imports: | $(READY) ## 1000 damaged or foreign files for each command that imports: taken, or refused with a line; ten minutes
	@$(PYTHON) test/exports/damaged_files.py
