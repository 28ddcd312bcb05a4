# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors

.PHONY: imports campaign-fmu
imports: | $(READY) ## 1000 damaged or foreign files for each command that imports: taken, or refused with a line; ten minutes
	@$(PYTHON) test/exports/damaged_files.py

campaign-fmu: | $(READY) ## FMUs of either version for 10^9 steps of a master that adds up its time; ten minutes
	@$(PYTHON) test/exports/fmu/native.py
