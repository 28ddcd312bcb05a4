# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
#
# The gates of `make prove`, each also a target of its own; README.md beside this file says what each shows.

##@ Proofs

PROVE_STATIC  := prove-rules prove-eva prove-coverage
PROVE_DYNAMIC := prove-spin prove-preempt prove-tsan prove-status prove-fuzz prove-xcp-fuzz prove-xcp-preempt prove-xcp-cost prove-xcp-size prove-readers prove-flip prove-longrun prove-stack prove-bits \
                 prove-accuracy prove-cost prove-ekf-cost prove-monitor-cost prove-ekf-long prove-kernels prove-promise prove-promises

PROVE_PARTS   := prove-eva-filter prove-mutation-filter

.PHONY: $(PROVE_STATIC) $(PROVE_DYNAMIC) $(PROVE_PARTS)

# -- static -----------------------------------------------------------------------------------------------------------

prove-rules: | $(READY) ## MISRA and names from outside, counted
	@$(PYTHON) test/prove/rules_check.py
prove-eva: | $(READY) build/setup/proof ## Frama-C: no undefined behaviour for any bytes, in any order of calls
	@$(PYTHON) test/prove/eva.py
prove-coverage: | $(READY) build/setup/proof build/setup/unity ## Every line, branch and condition (MC/DC) taken by a test
	@$(PYTHON) test/prove/coverage.py

# -- dynamic ----------------------------------------------------------------------------------------------------------

prove-spin: | $(READY) build/setup/proof ## Spin: the exchange of sets, in every order, on one core and on two with weak memory
	@$(PYTHON) test/prove/spin_check.py
prove-preempt: | $(READY) ## Emulated cores: step and tuning calls interrupt each other at every instruction
	@$(PYTHON) test/prove/preempt_check.py
prove-tsan: | $(READY) ## ThreadSanitizer: one thread steps, one exchanges sets
	@$(PYTHON) test/prove/tsan_check.py
prove-status: | $(READY) ## NaN and Inf anywhere: always reported, the last good state kept
	@$(PYTHON) test/prove/status_check.py
prove-fuzz: | $(READY) ## libFuzzer: any calls of the interface, against an oracle
	@$(PYTHON) test/prove/fuzz_check.py
prove-xcp-fuzz: | $(READY) ## libFuzzer: any packets to the XCP slave, against an oracle
	@$(PYTHON) test/prove/xcp_fuzz_check.py --keep
prove-xcp-preempt: | $(READY) ## An emulated core: a step and a packet to the XCP slave interrupt each other at every instruction
	@$(PYTHON) test/prove/xcp_preempt_check.py
prove-xcp-cost: | $(READY) ## Packets to the XCP slave take the instructions that port/xcp/README.md states
	@$(PYTHON) test/prove/xcp_cost_check.py
prove-xcp-size: | $(READY) ## Code and RAM of the XCP slave on a Cortex-M4F: as port/xcp/README.md states, below what is promised
	@$(PYTHON) test/prove/xcp_size_check.py
prove-readers: | $(READY) ## Damaged files: every reader takes them or says what is wrong
	@$(PYTHON) test/prove/readers_check.py
prove-flip: | $(READY) ## One flipped bit anywhere in an instance or its banks: no write beside them, no hang
	@$(PYTHON) test/prove/flip_check.py
prove-longrun: | $(READY) ## Minutes of samples with a set every second: no drift beyond a derived bound, counters right
	@$(PYTHON) test/prove/longrun_check.py
prove-stack: | $(READY) ## Each core: no recursion, no call through a pointer, the painted stack within its bound
	@$(PYTHON) test/prove/stack_check.py

prove-bits: | $(READY) ## exp, tanh, sigmoid, softplus: the same bits on every target
	@$(PYTHON) test/prove/bits_check.py
prove-accuracy: | $(READY) ## exp, tanh, sigmoid, softplus: no further off than their header says
	@$(PYTHON) test/prove/accuracy_check.py
prove-cost: | $(READY) ## Functions take the instructions that their headers name
	@$(PYTHON) test/prove/cost_check.py
prove-ekf-cost: | $(READY) ## A filter takes the instructions that gen/README.md states, whatever is measured
	@$(PYTHON) test/prove/ekf_cost_check.py
prove-monitor-cost: | $(READY) ## A monitor takes the instructions that gen/README.md states, whatever is measured
	@$(PYTHON) test/prove/monitor_cost_check.py
prove-ekf-long: | $(READY) ## A filter over a million steps with wild and missing measurements: positive, judged and counted
	@$(PYTHON) test/prove/ekf_long_check.py
prove-kernels: | $(READY) build/setup/unity ## A fault in a kernel in assembler is found by its test
	@$(PYTHON) test/prove/kernels_check.py
prove-promise: | $(READY) ## Random networks in exact arithmetic: what the promise check accepts and refuses
	@$(PYTHON) test/prove/promise_check.py
prove-promises: | $(READY) ## PROMISES.md: each promise, the test that shows it, the figures of the last run
	@$(PYTHON) test/prove/promises.py

# -- parts of gates, while one works on what they are about --------------------------------------------------------------

prove-eva-filter: | $(READY) build/setup/proof ## Frama-C: filter and monitor alone, with their seeded faults
	@$(PYTHON) test/prove/eva.py "runtime, filters" "runtime, monitors" --seeds
prove-mutation-filter: | $(READY) build/setup/proof build/setup/unity ## Small faults in filter and monitor are found by their unit tests
	@$(PYTHON) test/prove/mutation.py --tests 'test_pen_ekf*' pen_ekf.c pen_ekf.h
	@$(PYTHON) test/prove/mutation.py --tests 'test_pen_monitor*' pen_monitor.c

# -- the same in full -------------------------------------------------------------------------------------------------

CAMPAIGN := campaign-mutation campaign-status campaign-fuzz campaign-xcp-fuzz campaign-readers campaign-recordings campaign-flip campaign-longrun campaign-ekf campaign-filter campaign-monitor campaign-accuracy
.PHONY: campaign-proofs $(CAMPAIGN)

campaign-proofs: setup build/setup/proof ## The long proofs: all floats, 10^7 sequences of calls, every bit, a whole day
	$(Q)$(PYTHON) test/tally.py $(CAMPAIGN)
campaign-mutation: | $(READY) build/setup/proof build/setup/unity
	@$(PYTHON) test/prove/mutation.py
campaign-status: | $(READY)
	@$(PYTHON) test/prove/status_check.py --runs 10000000 --as "status campaign"
campaign-fuzz: | $(READY)
	@$(PYTHON) test/prove/fuzz_check.py --runs 5000000 --as "fuzz campaign"
campaign-xcp-fuzz: | $(READY)
	@$(PYTHON) test/prove/xcp_fuzz_check.py --runs 2000000 --as "xcp fuzz campaign" --keep
campaign-readers: | $(READY)
	@$(PYTHON) test/prove/readers_check.py --files 20000 --seed 2 --as "readers campaign"
campaign-recordings: | $(READY)
	@$(PYTHON) test/prove/readers_check.py --files 50000 --seed 3 --only recording forms mdf --as "recordings campaign"
campaign-flip: | $(READY)
	@$(PYTHON) test/prove/flip_check.py --every 1 --as "flip campaign"
campaign-longrun: | $(READY)
	@$(PYTHON) test/prove/longrun_check.py --hours 24 --as "longrun campaign"
campaign-accuracy: | $(READY)
	@$(PYTHON) test/prove/accuracy_check.py --stride 1 --as "accuracy campaign"
campaign-ekf: | $(READY)
	@$(PYTHON) test/prove/ekf_long_check.py --steps 50000000 --as "ekf campaign"
campaign-filter: | $(READY) ## Filters against a plant of their own, and an hour against another filter: test/filter/FILTER.md; RUNS and SECONDS
	@hour=0; PYTHONPATH=test/prove $(PYTHON) test/filter/hour_check.py --seconds $(or $(SECONDS),3600) || hour=$$?; \
	$(PYTHON) test/filter/filter_campaign.py --runs $(or $(RUNS),100) && exit $$hour
campaign-monitor: | $(READY) ## The fault monitor: friction put in, and hours without, beside chi-square tests: test/filter/MONITOR.md; RUNS and HOURS
	@$(PYTHON) test/filter/monitor_campaign.py --runs $(or $(RUNS),200) --hours $(or $(HOURS),200) --jobs $$(nproc)
