# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
#
# Packages for firmware: what `make dist` lays out is built as their users build it, and has to compute the same bits.

SUITES += packages

.PHONY: packages
packages: | $(READY) build/setup/packages ## Each package built, state hash compared; the integrate page replayed on an emulated Cortex-M4F
	@$(PYTHON) -m pytest -q test/packages
