# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
#
# `make check`: checks of the sources without running the project; seconds. `make format` corrects the layout.

##@ Checks in seconds

GATES.check := check-types check-c check-lint check-pages check-changelog check-structure check-format # the longest begin
RUFF := $(PYTHON) -m ruff

.PHONY: check format $(GATES.check)
check: ## Seconds: layout, lint and types of the Python, layout and lint of the C, references of all pages, the counts of structure.json
	$(Q)$(MAKE) -j$$(nproc) -k --output-sync $(GATES.check)

check-format: | $(READY)
	@test/check "layout of the Python" $(RUFF) format --check --quiet .
check-lint: | $(READY)
	@test/check "lint of the Python" $(RUFF) check --quiet .
check-types: | $(READY)
	@test/check "types of penode_gen and penode_sil" $(PYTHON) -m mypy -p penode_gen -p penode_sil
check-pages: | $(READY)
	@test/check "references of all pages" $(PYTHON) test/tools/pages.py
check-changelog: | $(READY)
	@test/check "fragments of the changelog" $(PYTHON) sil/manual/changelog.py
check-structure: | $(READY)
	@test/check "counts of structure.json" $(PYTHON) test/tools/structure.py
check-c: $(WATCHED) | $(READY)
	@$(PYTHON) test/tools/c_check.py

format: | $(READY) ## Lay out the Python and the C, and sort imports
	$(Q)$(RUFF) check --quiet --select I --fix .
	$(Q)$(RUFF) format --quiet .
	$(Q)$(PYTHON) test/tools/c_check.py --format
