# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
#
# The library cannot be built wrong: part of test/test.mk.

GATES.builds := builds-contraction builds-dialects builds-flags builds-linked builds-copies builds-placed

.PHONY: $(GATES.builds) builds-long
builds: $(GATES.builds) ## Wrong flags stop the compiler, default flags do not contract, C99 to C2x and C++17, a whole program for Cortex-M0, step and sets placed by a linker script
$(filter-out builds-placed,$(GATES.builds)): builds-%: | $(READY)
	@$(PYTHON) test/builds/builds.py $*
builds-placed: | $(READY)
	@$(PYTHON) test/builds/placed.py
builds-long: | $(READY) ## 100 000 layered steps on each core, RISC-V, s390x and Armv6-M included: the same bits
	@PENODE_LONG=1 $(PYTHON) -m pytest -q test/sil/test_other_cores.py test/sil/test_targets.py -k "chirp or everywhere"
