# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
#
# The functions of pen_elementary.h against wider arithmetic. `make test` takes every 256th float; all of them, a quarter of an
# hour on one core: make accuracy-elementary ELEMENTARY_STRIDE=1.

ELEMENTARY := src/pen_trig.c src/pen_atan.c src/pen_log.c src/pen_root.c
ELEMENTARY_STRIDE := 256
ELEMENTARY_DOUBLE := 4001

.PHONY: accuracy-elementary
accuracy-elementary: | build/accuracy $(READY) ## Error of sin, cos, atan, log, sqrt: 1.5 ulp at most
	$(Q)gcc $(ACCURACY) -DPEN_ELEMENTARY -pthread -o build/accuracy/elementary test/accuracy/pen_math_accuracy.c $(ELEMENTARY) -lm
	@test/check "accuracy elementary float, every $(ELEMENTARY_STRIDE). number" build/accuracy/elementary $(ELEMENTARY_STRIDE) 2
	$(Q)gcc $(ACCURACY) -DPEN_ELEMENTARY -DPEN_REAL_DOUBLE -pthread -o build/accuracy/elementary-double \
	    test/accuracy/pen_math_accuracy.c $(ELEMENTARY) -lm
	@test/check "accuracy elementary double" build/accuracy/elementary-double $(ELEMENTARY_DOUBLE) 2
	@test/check "accuracy elementary coefficients are the derived ones" \
	    $(PYTHON) test/accuracy/elementary_coefficients.py --check $(ELEMENTARY)
